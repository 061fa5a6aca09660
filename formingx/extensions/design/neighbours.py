"""The neighbours of a run: the same with one parameter a little more, or less, carried along with its factors.

Each neighbour is a problem of its own, made of the scene of the user's function: every change by a parameter (nodes,
constants, tools, friction, targets, temperatures) is changed in it. At a state of the run with dF/dx = K, a neighbour
solves its own F = 0 and its own constraint by iterations with the factors of K, which are near its own,

    K dx + F_c dc = -F',    c_x dx + c_c dc = -c',

and every output quantity at two neighbours has their difference over 2 dp for its derivative: of second order in dp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from ...problem.problem import Problem
from ...solve.newton import Failure
from ...solve.state import State


@dataclass(frozen=True)
class Solved:
    """Convergence criterion of a perturbed run: corrections of Newton's method over its distance from the state.

    Attributes:
        enough, enough_in_contact: without contact, and with it.
        good: of one that is taken as it is after all iterations.
        iterations: at most this number of.
        none: corrections over the unknowns that are round-off.
    """

    enough: float = 1e-9
    enough_in_contact: float = 1e-5
    good: float = 1e-3
    iterations: int = 12
    none: float = 2e-13


_SOLVED = Solved()


class Apart(Failure):
    """A neighbour is not found near its run: its parameter was changed by too much for contact's thin ramps."""


class Neighbour:
    """One problem beside that of a run, and its state.

    Args:
        scene, end: as the parameter makes them; base: the `Problem` of the run; name: of the parameter.

    Raises:
        InputError: the mesh has other elements.
    """

    def __init__(self, scene: Any, end: Any, base: Problem, name: str):
        self.name, self.end = name, end
        self.path: Any = None
        mine, its = (s.mesh.domain.geometry.dofmap for s in (scene, base.scene))
        if mine.shape != its.shape or not np.array_equal(mine, its) or len(scene.items) != len(base.scene.items):
            raise InputError(f"Design: {name} changes the elements of the mesh, or the number of loads, supports or"
                             f" contacts: there are derivatives only by what moves nodes or changes numbers")
        self.problem = Problem(scene)
        if self.problem.x.getSize() != base.x.getSize():
            raise InputError(f"Design: {name} changes the number of unknowns: there is no derivative by that")
        self.F, self.gradient = self.problem.x.duplicate(), self.problem.x.duplicate()
        self.x: Any = None                                   # locally owned entries, shape (n,)
        self.control, self.memory = 0.0, self.problem.memory
        self.plans: list[Any] = []
        self.then = 0.0

    def state(self, like: State) -> State:
        """Its state beside one of the run."""
        return State(self.x, self.control, like.direction, like.slope, memory=self.memory, stage=like.stage,
                     kind=like.kind, time=self.problem.time_at(self.control))

    def residual(self, left_over: np.ndarray) -> np.ndarray:
        """F at its state less the residual of the run's, own part, shape (n,)."""
        self.problem.x.array_w[:] = self.x
        self.problem.residual(self.problem.x, self.control, self.F)
        self.F.array_w[:] -= left_over
        return np.array(self.F.array_r)

    def balance(self, left_over: np.ndarray) -> None:
        """Forces of tools are what the body bears: theirs, of gaps smaller than round-off, tell nothing beside a run's.

        left_over: as in `residual`."""
        forms, fields = self.problem.forms, self.x[: self.problem.n_owned]
        F = self.residual(left_over)[: self.problem.n_owned]
        unit = forms.stress * forms.volume / forms.length
        for face in self.problem.present:
            touching = face.rule.dofs[face.touching(fields, self.control)]
            for c in range(len(face.unbalanced)):
                numbers = np.unique(touching[:, c::len(face.unbalanced)])
                numbers = numbers[numbers < len(F)]
                face.unbalanced[c] = unit * F[numbers].sum()
                F[numbers] = 0.0                                 # a node between two tools counts once

    def constraint(self, equation: Any) -> float:
        """Return the residual of an equation at its state."""
        self.problem.x.array_w[:] = self.x
        return float(equation(self.problem.x, self.control, self.gradient)[0])

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.F.destroy()
        self.gradient.destroy()
        self.problem.destroy()


def settle(curve: Any, state: State, neighbours: Sequence[Neighbour], equation: Any,
           equations: Sequence[Any]) -> np.ndarray:
    """Solve for the neighbours beside a state of the run, at which its problem stands; its residual, locally owned
    entries.

    equation: the constraint of the run's state; None: the neighbours are in the plane normal to its path; equations: of
    the neighbours.

    Raises:
        Apart: one is not found near it. Failure: the state has no tangent.
    """
    problem, newton = curve.problem, curve.newton
    problem.x.array_w[:] = state.x
    if not newton.tangent(problem.x, state.control):
        raise Failure("the tangent is singular at a state of the run", [])
    b = newton.b.array_r.copy()
    if equation is None:
        problem.metric_times(newton.b, newton.gradient)
        kept, by_control = 0.0, curve.control_weight
    else:
        problem.x.array_w[:] = state.x
        kept, by_control = equation(problem.x, state.control, newton.gradient)
    g = newton.gradient.array_r.copy()
    slope = problem.comm.allreduce(float(g @ b)) + by_control
    if not abs(slope) > 1e-300:
        raise Failure("the quantity of the target does not change along the path at its end", [])
    problem.x.array_w[:] = state.x
    problem.residual(problem.x, state.control, newton.F)
    left_over = newton.F.array_r.copy()                      # round-off, and the forces of points that are left out

    def constraint(k: int) -> float:
        one = neighbours[k]
        if equation is None:
            return float(problem.comm.allreduce(float(g @ (one.x - state.x))) + by_control * (
                one.control - state.control))
        return one.constraint(equations[k]) - kept
    size = _norm(problem, state.x) + abs(state.control)
    enough = _SOLVED.enough_in_contact if problem.has_kinks else _SOLVED.enough
    todo, first = list(range(len(neighbours))), np.full(len(neighbours), np.inf)
    for iteration in range(_SOLVED.iterations):
        rows = np.column_stack([neighbours[k].residual(left_over) for k in todo])
        left = np.array([constraint(k) for k in todo])
        if len(todo) > 1:
            dx = -newton.solver.solve_all(rows)
        else:
            one = neighbours[todo[0]]
            newton.solver.solve(one.F, one.gradient)
            dx = -one.gradient.array_r[:, None]
        steps = -(left + problem.comm.allreduce(g @ dx)) / slope
        dx += np.outer(b, steps)
        good = True
        for j, k in enumerate(todo):
            one = neighbours[k]
            correction = _norm(problem, dx[:, j]) + abs(steps[j])
            if iteration != 1:                               # there it is but a sample: all are treated alike
                one.x, one.control = one.x + dx[:, j], one.control + steps[j]
            away = _norm(problem, one.x - state.x) + abs(one.control - state.control)
            if not np.isfinite(correction):
                raise Apart(f"with {one.name} a little changed no state is found near", [])
            first[k] = correction if iteration == 0 else first[k]
            good &= correction <= max(enough * away, _SOLVED.none * size)
            if iteration == _SOLVED.iterations - 1 and correction > max(_SOLVED.good * away, 10 * _SOLVED.none * size):
                raise Apart(f"with {one.name} a little changed no state is found near", [])
        if good:
            break
        # what is left is of second order: if nothing is of the one that was corrected most, the others are solved for
        todo = [int(np.argmax(first))] if iteration == 0 else list(range(len(neighbours)))
    return left_over


def _norm(problem: Any, x: np.ndarray) -> float:
    return float(np.sqrt(problem.comm.allreduce(float(x @ x))))
