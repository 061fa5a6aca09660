"""Perturbed runs: copies of a run with one parameter slightly changed, solved with the LU factors of the run.

Each perturbed run has its own problem, built from the scene that the user's function returns. It therefore includes
every effect of a parameter (nodes, constants, tools, friction, targets, temperatures). Near a state of the base run it
solves its own equilibrium and constraint (`solve_perturbed`). Without contact, two runs are perturbed, by +dp and -dp
of a parameter p. The derivative of an output quantity by p is its difference between both over 2 dp, with an error of
second order in dp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ... import _compat
from ...errors import InputError
from ...problem.problem import Problem
from ...solve.newton import Failure, Tolerances
from ...solve.state import State
from ...values.tolerances import ROUND_OFF


@dataclass(frozen=True)
class PerturbedTolerances:
    """Convergence criterion of a perturbed run.

    A run has converged if its Newton correction of (x, control), over the distance of the perturbed state from the base
    state, is at most the tolerance. Without contact the tolerance is `formingx.values.tolerances.ROUND_OFF`, 1e-9.

    Attributes:
        tolerance_in_contact: tolerance with contact.
        last_tolerance: tolerance in the last allowed iteration; above it the perturbed run fails.
        round_off: a correction also suffices if it is at most this multiple of the norm of the base state.
    """

    tolerance_in_contact: float = 1e-5
    last_tolerance: float = 1e-3
    round_off: float = 2e-13


_TOLERANCES = PerturbedTolerances()

_LARGEST_ROUND_OFF = 1e-10
"""Largest correction, over the size of the unknowns, that counts as round-off if corrections become no smaller."""


class PerturbedRunFailure(Failure):
    """Failure to find a perturbed state: the parameter moves points by more than the reach of contact pressure."""


class _Start(NamedTuple):
    """State at the start of a step (`formingx.forms.history.Start`)."""

    x: np.ndarray
    control: float


class PerturbedRun:
    """Problem and present state of one perturbed run, a copy of the base run with one parameter slightly changed.

    Other elements, or another number of items or unknowns than in the base run, are an InputError.

    Attributes:
        name: name of the parameter.
        end: target or stages with the changed parameter.
        path: path with the state alone, made when an output quantity first needs it; None before.
        problem: the `Problem` of the perturbed run.
        F: residual, a PETSc vector for temporary results.
        gradient: gradient of a constraint, a PETSc vector for temporary results.
        x: locally owned unknowns of the state, shape (n,).
        control: load parameter (control) of the state, dimensionless.
        history_variables: history variables of the state.
        plans: `Plan` of each stage, in which loads, supports and contacts are indices into `Scene.items`.
        piece_end: process time at which the present piece of a stage in time ends: at a knot of an amplitude, or at the
            end of the stage.
    """

    def __init__(self, scene: Any, end: Any, base: Problem, name: str):
        self.name, self.end = name, end
        self.path: Any = None
        cells, base_cells = (_compat.cell_nodes(s.mesh.domain) for s in (scene, base.scene))
        if not np.array_equal(cells, base_cells) or len(scene.items) != len(base.scene.items):
            raise InputError(f"Design: {name} changes the elements of the mesh, or the number of loads, supports or"
                             f" contacts: there are derivatives only by what moves nodes or changes numbers")
        self.problem = Problem(scene)
        if self.problem.x.getSize() != base.x.getSize():
            raise InputError(f"Design: {name} changes the number of unknowns: there is no derivative by that")
        self.F, self.gradient = self.problem.x.duplicate(), self.problem.x.duplicate()
        self.x: Any = None                                   # locally owned entries, shape (n,)
        self.control, self.history_variables = 0.0, self.problem.history.variables
        self.plans: list[Any] = []
        self.piece_end = 0.0
        self._start: _Start | None = None

    def begin_step(self) -> None:
        """Store the present state as the start of the next step."""
        self._start = _Start(self.x, self.control)

    def advance(self) -> None:
        """Update the history variables at the end of a step, as a run does: heat needs the start of the step, too."""
        if self._start is not None:
            self.problem.history.predict(self._start, self.x, self.control)
        self.problem.history.advance(self.x, self.control)
        self.begin_step()

    def state(self, base: State) -> State:
        """Return the present state as a `State`, with tangent, stage and kind of the base state."""
        return State(self.x, self.control, base.direction, base.slope, history_variables=self.history_variables,
                     stage=base.stage, kind=base.kind, time=self.problem.history.time_at(self.control))

    def residual(self, base_residual: np.ndarray) -> np.ndarray:
        """Return the residual minus that of the base run; both of locally owned entries, shape (n,)."""
        self.problem.x.array_w[:] = self.x
        self.problem.residual(self.problem.x, self.control, self.F)
        self.F.array_w[:] -= base_residual
        return np.array(self.F.array_r)

    def balance(self, base_residual: np.ndarray) -> None:
        """Set each contact's `unbalanced` force by equilibrium: gaps within round-off give no accurate force."""
        forms, fields = self.problem.forms, self.x[: self.problem.n_owned]
        F = self.residual(base_residual)[: self.problem.n_owned]
        unit = forms.stress * forms.volume / forms.length
        for face in self.problem.contact.faces:
            touching = face.rule.dofs[face.touching(fields, self.control)]
            for c in range(len(face.unbalanced)):
                numbers = np.unique(touching[:, c::len(face.unbalanced)])
                numbers = numbers[numbers < len(F)]
                face.unbalanced[c] = unit * F[numbers].sum()
                F[numbers] = 0.0                                 # a node between two tools counts once

    def constraint(self, equation: Any) -> float:
        """Return the residual of a constraint, a function of (x, control, gradient), at the present state."""
        self.problem.x.array_w[:] = self.x
        return float(equation(self.problem.x, self.control, self.gradient)[0])

    def destroy(self) -> None:
        """Free the PETSc objects of the perturbed run; collective."""
        self.F.destroy()
        self.gradient.destroy()
        self.problem.destroy()


def solve_perturbed(curve: Any, state: State, perturbed: Sequence[PerturbedRun], equation: Any,
           equations: Sequence[Any]) -> np.ndarray:
    r"""Solve for the states of the perturbed runs near a state of the base run; collective.

    Modified Newton iterations use the tangent K and the constraint derivatives of the base run:

    .. math:: K \, dx + F_\lambda \, d\lambda = -F', \qquad c_x \, dx + c_\lambda \, d\lambda = -c'

    with residual F' and constraint c' of the perturbed run, its unknowns x and its control lambda. Subscripts are
    derivatives. The problem of the base run must be in the state, with the history variables of the state before it.
    `equation` is the constraint of the base run, None for the plane normal to its path. The residual of the base run is
    returned, shape (n,). PerturbedRunFailure: no state is found; Failure: the tangent is singular or the target
    constant.
    """
    problem, newton = curve.problem, curve.newton
    problem.x.array_w[:] = state.x
    if not newton.tangent(problem.x, state.control):
        raise Failure("the tangent is singular at a state of the run", [])
    b = newton.b.array_r.copy()
    if equation is None:
        problem.metric_times(newton.b, newton.gradient)
        residual, by_control = 0.0, curve.control_weight
    else:
        problem.x.array_w[:] = state.x
        residual, by_control = equation(problem.x, state.control, newton.gradient)
    g = newton.gradient.array_r.copy()
    slope = problem.comm.allreduce(float(g @ b)) + by_control
    if not abs(slope) > 1e-300:
        raise Failure("the quantity of the target does not change along the path at its end", [])
    problem.x.array_w[:] = state.x
    problem.residual(problem.x, state.control, newton.F)
    base_residual = newton.F.array_r.copy()                  # round-off and forces of points that are kept open

    def constraint(k: int) -> float:
        """Return the residual of the constraint of the perturbed run with number k."""
        run = perturbed[k]
        if equation is None:
            return float(problem.comm.allreduce(float(g @ (run.x - state.x))) + by_control * (
                run.control - state.control))
        return run.constraint(equations[k]) - residual
    size = _norm(problem, state.x) + abs(state.control)
    tolerance = _TOLERANCES.tolerance_in_contact if problem.contact.faces else ROUND_OFF
    active, first = list(range(len(perturbed))), np.full(len(perturbed), np.inf)
    least = np.full(len(perturbed), np.inf)                  # smallest correction so far
    for iteration in range(Tolerances.iterations):
        rows = np.column_stack([perturbed[k].residual(base_residual) for k in active])
        violations = np.array([constraint(k) for k in active])
        if len(active) > 1:
            dx = -newton.solver.solve_all(rows)
        else:
            run = perturbed[active[0]]
            newton.solver.solve(run.F, run.gradient)
            dx = -run.gradient.array_r[:, None]
        steps = -(violations + problem.comm.allreduce(g @ dx)) / slope
        dx += np.outer(b, steps)
        converged = True
        for column, k in enumerate(active):
            run = perturbed[k]
            correction = _norm(problem, dx[:, column]) + abs(steps[column])
            if iteration != 1:                               # iteration 1 checks one perturbed run, and updates none
                run.x, run.control = run.x + dx[:, column], run.control + steps[column]
            distance = _norm(problem, run.x - state.x) + abs(run.control - state.control)
            # a thin sheet that is hinged turns by round-off: its corrections become no smaller
            stagnates = iteration > 2 and least[k] / 2 < correction <= _LARGEST_ROUND_OFF * size
            least[k] = min(least[k], correction) if np.isfinite(correction) else least[k]
            failed = not stagnates and correction > max(
                _TOLERANCES.last_tolerance * distance, 10 * _TOLERANCES.round_off * size)
            if not np.isfinite(correction) or iteration == Tolerances.iterations - 1 and failed:
                raise PerturbedRunFailure(f"with {run.name} a little changed no state is found near", [])
            first[k] = correction if iteration == 0 else first[k]
            converged &= stagnates or correction <= max(tolerance * distance, _TOLERANCES.round_off * size)
        if converged:
            break
        # the error is now of second order: if the most corrected run has converged, so have the others
        active = [int(np.argmax(first))] if iteration == 0 else list(range(len(perturbed)))
    return base_residual


def _norm(problem: Any, x: np.ndarray) -> float:
    """Return the Euclidean norm over all ranks of a vector of locally owned entries, shape (n,)."""
    return float(np.sqrt(problem.comm.allreduce(float(x @ x))))
