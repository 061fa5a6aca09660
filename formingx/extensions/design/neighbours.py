r"""Perturbed runs: copies of a run with one parameter slightly changed, solved with the LU factors of the run.

Each perturbed run has a problem of its own, built from the scene of the user's function. It therefore includes every
effect of a parameter (nodes, constants, tools, friction, targets, temperatures). At a state of the base run with dF/dx
= K, a perturbed run solves its own equilibrium F' = 0 and constraint c' = 0 by modified Newton iterations:

.. math::
    K \, dx + F_\lambda \, d\lambda = -F', \qquad c_x \, dx + c_\lambda \, d\lambda = -c'

:math:`\lambda` is the control. The derivative of an output quantity is its central difference between two perturbed
runs, over 2 dp, with an error of second order in dp.
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
class PerturbedTolerances:
    """Convergence criterion of a perturbed run: Newton corrections over its distance from the base state.

    Attributes:
        enough: tolerance without contact.
        enough_in_contact: tolerance with contact.
        good: tolerance after the last iteration.
        iterations: maximum number of iterations.
        none: relative correction of the unknowns that counts as round-off.
    """

    enough: float = 1e-9
    enough_in_contact: float = 1e-5
    good: float = 1e-3
    iterations: int = 12
    none: float = 2e-13


_TOLERANCES = PerturbedTolerances()


class PerturbedRunFailure(Failure):
    """Failure to find a perturbed state near the base run: the change is too large for the regularised contact."""


class PerturbedRun:
    """Problem and state of one perturbed run.

    Args:
        scene: scene with the perturbed parameter.
        end: target or stages with the perturbed parameter.
        base: the `Problem` of the base run.
        name: name of the parameter.

    Raises:
        InputError: the mesh has other elements, or the number of items or unknowns differs.
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
        """Return its state, with the path data of a state of the base run.

        Args:
            like: state of the base run.

        Returns:
            The state.
        """
        return State(self.x, self.control, like.direction, like.slope, memory=self.memory, stage=like.stage,
                     kind=like.kind, time=self.problem.time_at(self.control))

    def residual(self, left_over: np.ndarray) -> np.ndarray:
        """Return F at its state minus the residual of the base run.

        Args:
            left_over: residual of the base run, locally owned entries, shape (n,).

        Returns:
            Locally owned entries, shape (n,).
        """
        self.problem.x.array_w[:] = self.x
        self.problem.residual(self.problem.x, self.control, self.F)
        self.F.array_w[:] -= left_over
        return np.array(self.F.array_r)

    def balance(self, left_over: np.ndarray) -> None:
        """Set the contact forces of the perturbed run so that they balance the internal forces of its body.

        The gaps of the perturbed run are below round-off, so its contact law gives no useful force.

        Args:
            left_over: residual of the base run, locally owned entries, shape (n,).
        """
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
        """Return the residual of an equation in the present state of the perturbed run.

        Args:
            equation: function of (x, control, gradient), see `Bound.equation`.

        Returns:
            The residual.
        """
        self.problem.x.array_w[:] = self.x
        return float(equation(self.problem.x, self.control, self.gradient)[0])

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.F.destroy()
        self.gradient.destroy()
        self.problem.destroy()


def settle(curve: Any, state: State, neighbours: Sequence[PerturbedRun], equation: Any,
           equations: Sequence[Any]) -> np.ndarray:
    """Solve for the perturbed runs at a state of the base run, whose problem is restored to that state.

    Args:
        curve: the `Curve` of the base run.
        state: the accepted state of the base run.
        neighbours: the perturbed runs; their states are updated in place.
        equation: constraint of the base state; None: the perturbed states lie in the plane normal to its path.
        equations: constraints of the perturbed runs.

    Returns:
        Residual of the base run, locally owned entries, shape (n,).

    Raises:
        PerturbedRunFailure: no perturbed state is found near the base state.
        Failure: the state has no tangent, or the target quantity does not change along the path.
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
    left_over = newton.F.array_r.copy()                      # round-off, and the forces of points kept open

    def constraint(k: int) -> float:
        """Return the residual of the constraint of perturbed run k."""
        entry = neighbours[k]
        if equation is None:
            return float(problem.comm.allreduce(float(g @ (entry.x - state.x))) + by_control * (
                entry.control - state.control))
        return entry.constraint(equations[k]) - kept
    size = _norm(problem, state.x) + abs(state.control)
    enough = _TOLERANCES.enough_in_contact if problem.has_kinks else _TOLERANCES.enough
    todo, first = list(range(len(neighbours))), np.full(len(neighbours), np.inf)
    for iteration in range(_TOLERANCES.iterations):
        rows = np.column_stack([neighbours[k].residual(left_over) for k in todo])
        left = np.array([constraint(k) for k in todo])
        if len(todo) > 1:
            dx = -newton.solver.solve_all(rows)
        else:
            entry = neighbours[todo[0]]
            newton.solver.solve(entry.F, entry.gradient)
            dx = -entry.gradient.array_r[:, None]
        steps = -(left + problem.comm.allreduce(g @ dx)) / slope
        dx += np.outer(b, steps)
        good = True
        for j, k in enumerate(todo):
            entry = neighbours[k]
            correction = _norm(problem, dx[:, j]) + abs(steps[j])
            if iteration != 1:                               # iteration 1 checks one perturbed run, and updates none
                entry.x, entry.control = entry.x + dx[:, j], entry.control + steps[j]
            away = _norm(problem, entry.x - state.x) + abs(entry.control - state.control)
            if not np.isfinite(correction):
                raise PerturbedRunFailure(f"with {entry.name} a little changed no state is found near", [])
            first[k] = correction if iteration == 0 else first[k]
            good &= correction <= max(enough * away, _TOLERANCES.none * size)
            if iteration == _TOLERANCES.iterations - 1 and correction > max(_TOLERANCES.good * away,
                                                                            10 * _TOLERANCES.none * size):
                raise PerturbedRunFailure(f"with {entry.name} a little changed no state is found near", [])
        if good:
            break
        # the error is now of second order: if the most corrected run has converged, so have the others
        todo = [int(np.argmax(first))] if iteration == 0 else list(range(len(neighbours)))
    return left_over


def _norm(problem: Any, x: np.ndarray) -> float:
    """Return the norm of locally owned entries over all ranks."""
    return float(np.sqrt(problem.comm.allreduce(float(x @ x))))
