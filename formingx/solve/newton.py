"""Newton's method for F(x, control) = 0 with one more equation, c(x, control) = 0: one factorisation, two solves."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from petsc4py import PETSc

from ..errors import count, positive
from .chords import Chords
from .equations import Attempt, Equations
from .linear import DirectSolver
from .local_contact import Settling, woodbury

UNLOADED = 1e-5
"""Floor of the support forces (over stress times volume over length) in the relative residual."""

AT_REST = 1e-2
"""Floor of the displacements (dimensionless) in the relative correction: near the state of rest on a tool, whose force
grows as the square of the penetration, corrections are no smaller than the displacements themselves."""

SETTLING = 40
"""Iterations allowed while the active set of contact still changes. Those with a `SMALL` correction that find an active
set for the first time do not count: of a slack sheet on a flat plug a hundred points let go one or two at a time.
(With a history, which depends on the step, a shorter step is better.)"""

HURRIED = 16
"""The same, of a contact with a history where there is something cheaper to try, such as half the step."""

_CYCLES = 8
"""Returns of the active set to one it has had before, after which it counts as cycling (solutions took up to 4)."""

_DIVERGED = 0.3
"""The iteration has diverged, contact or not, where three corrections in a row are larger (of solutions: below 0.1)."""

_LEFT_ALONE = 1
"""The iteration (from 0) that settles no contact points: what the first got wrong often comes right in it."""

SMALL = 1e-3
"""Corrections (dimensionless displacement) that may grow without a sign of divergence while the active set changes."""


class Iteration(NamedTuple):
    """One Newton iteration: what it found and what it did. The last entry of a history is the converged state.

    residual: |F| before it, over the norm of the support forces; correction: |dx|/(|x| + AT_REST), criterion (3.5.1);
    work: |F . dx| over its first value, criterion (3.5.2). chord: with the tangent of an iteration before it.
    """

    residual: float
    correction: float
    work: float
    chord: bool = False


def tangents(history: list[Iteration]) -> int:
    """How many iterations had a tangent of their own; the last entry is the converged state."""
    return sum(not iteration.chord for iteration in history[:-1])


class Failure(Exception):
    """Newton's method did not converge; `reason` says how, `history` holds the iterations."""

    def __init__(self, reason: str, history: list[Iteration]):
        super().__init__(reason)
        self.reason, self.history = reason, history
        self.attempt: Attempt | None = None                 # where it ended, if that is known


class _ActiveSet:
    """The active set of contact, iteration by iteration.

    Attributes:
        changed: the iteration at which it changed last; share: of a correction to take, halved when an active set comes
            back: full corrections would cycle.
        found: how often a small correction led to an active set for the first time; returns: how often one came back.
    """

    def __init__(self, problem: Equations):
        self._problem, self._iteration = problem, -1
        self._seen: dict[Any, int] = {}
        self._last: Any = None
        self.changed, self.share, self.found, self.returns = 0, 1.0, 0, 0

    def look(self, moved: float) -> None:
        """To be called once an iteration, after the residual was computed; moved: by the correction before."""
        self._iteration += 1
        now = self._problem.active_set
        if now != self._last and self._last is not None:
            self.changed = self._iteration
            if now in self._seen:
                self.share = max(self.share / 2, 0.25)
                self.returns += 1
            else:
                self.found += moved < SMALL and not self._problem.has_history
        elif self._iteration > self.changed + 1:
            self.share = 1.0
        self._seen[now] = self._iteration
        self._last = now


@dataclass(frozen=True)
class Tolerances:
    """When a state counts as converged: all of these.

    correction: the next correction that quadratic convergence predicts, over the norm of x (and `AT_REST`).
    residual: norm of F over the norm of the support forces.
    iterations: at most so many with one active set of contact; settling: and while it changes, see `SETTLING`.

    Raises:
        InputError: a value that is not greater than 0.
    """

    correction: float = 1e-10
    residual: float = 1e-8
    iterations: int = 12
    settling: int = SETTLING

    def __post_init__(self) -> None:
        positive("Tolerances: correction", self.correction)
        positive("Tolerances: residual", self.residual)
        count("Tolerances: iterations", self.iterations)
        count("Tolerances: settling", self.settling)

    def met(self, corrections: list[float], residuals: list[float], chord: bool = False) -> bool:
        """True if a state with these corrections behind it, and these residuals (its own last), has converged.

        `chord`: the last correction was one of a chord iteration, which converges linearly: the next one is foretold
        from the fall of residuals and corrections, and doubled.

        Corrections that no longer shrink, below 1e-7, or that are below 1e-11, have met round-off (a flat thin sheet:
        near 1e-8): then nothing better is to be had, and the residual may be what round-off leaves. A
        residual that no longer shrinks with corrections below the tolerance is at round-off, however large: a stiff
        penalty (8 mu/eps) times the round-off of the displacements can well exceed the support forces of a thin sheet.
        """
        if not corrections:
            return False
        residual, last, before = residuals[-1], corrections[-1], corrections[-2] if len(corrections) > 1 else 1.0
        if chord:
            if residual == 0:                                # at rest, where nothing acts
                return True
            ahead = 2 * last * max(residual / residuals[-2], last / before)
            return ahead < self.correction and residual < self.residual
        ahead = last * min(1.0, last / before) ** 2
        if ahead < self.correction and residual < self.residual:
            return True
        if last < self.correction and residual > 0.3 * residuals[-2]:
            return True
        stalled = 0.3 * before < last < 1e-7 and residual > 0.3 * residuals[-2]
        return (last < 1e-11 or stalled) and residual < 1e3 * self.residual


class BorderedNewton:
    """Solves F(x, control) = 0 together with c(x, control) = 0.

    `norm(x, control)` measures corrections. The constraint is called as c(x, control, gradient) and returns
    (c, dc/dcontrol), having put dc/dx into `gradient`.
    """

    def __init__(self, problem: Equations, tolerances: Tolerances, norm: Callable[[PETSc.Vec, float], float]):
        self.problem, self.tolerances, self._norm = problem, tolerances, norm
        self.solver = DirectSolver(problem.matrix, problem.symmetric)
        new = problem.x.duplicate
        self.F, self.F_control, self.gradient, self.a, self.b = new(), new(), new(), new(), new()
        self.reached = 0.0, 0.0                             # control and its last correction in `correct`
        self._hurried = False
        self._chords = Chords()

    @contextlib.contextmanager
    def in_a_hurry(self, hurried: bool) -> Iterator[None]:
        """While something cheaper is left to try, contact with a history has to settle within `HURRIED` iterations."""
        self._hurried = hurried and self.problem.has_history
        try:
            yield
        finally:
            self._hurried = False

    def tangent(self, x: PETSc.Vec, control: float, ahead: bool = False) -> bool:
        """`self.b` = dx/dcontrol along the path at a solution; False if the tangent matrix is singular.

        `ahead`: see `Problem.tangent`.
        """
        if not self._factorise(x, control, ahead):
            return False
        self.solver.solve(self.F_control, self.b)
        self.b.scale(-1)
        return bool(np.isfinite(self.b.norm()))

    def _factorise(self, x: PETSc.Vec, control: float, ahead: bool = False, rescale: bool = True) -> bool:
        """Make factors of the tangent, and `F_control`; False if it is singular."""
        self.problem.tangent(x, control, ahead)
        good = self.solver.factorise(rescale)
        self._chords.made(self.problem.setting if good else None)
        if good:
            self.problem.control_derivative(x, control, self.F_control, ahead)
        return good

    def update_ahead(self, x: PETSc.Vec, control: float) -> bool:
        """Make `self.b`, at a solution just found, that of the tangent ahead, by the factors at hand; False: failed."""
        return woodbury(self.problem, self.problem.changes_ahead(x, control), self.solver, self.b)

    def correct(self, x: PETSc.Vec, control: float, constraint: Any, old: Any = None,
                chords: bool = False) -> tuple[float, list[Iteration]]:
        """Iterate x (in place) and control to convergence; returns the control and the history.

        `old`: the state that they are a guess ahead of, if there is one. `chords`: tangents may be kept where
        that costs less and no contact has kinks (see `Chords`).

        Afterwards `self.b` is dx/dcontrol at the solution (to the accuracy of the last correction, or of the tangent
        that was kept).

        Raises:
            Failure: no convergence; x is then worthless.
        """
        problem = self.problem
        history: list[Iteration] = []
        problem.begin(old)
        problem.residual(x, control, self.F)
        self.a.set(0)
        self.reached = control, 0.0
        self._chords.begin(problem.setting, chords and not problem.has_kinks)
        work0 = moved = 0.0
        active = _ActiveSet(problem)
        points = Settling(problem) if problem.has_kinks else None
        while True:
            residual = self.F.norm() / (problem.force_scale + UNLOADED)
            if not np.isfinite(residual):
                raise Failure(f"the forces are not finite: {problem.why_not_finite}", history)
            if history:
                self._chords.took(history[-1].chord, residual / (history[-1].residual or 1.0))
            if self.tolerances.met([i.correction for i in history], [*(i.residual for i in history), residual],
                                   bool(history) and history[-1].chord):
                history.append(Iteration(residual, 0.0, 0.0))
                return control, history
            problem.linearise(x, control, self.F)
            active.look(moved)
            if points:
                points.look()
            self._check(history, active, moved)
            chord = self._chords.serve(residual, self.tolerances.residual)
            if not self._solve(x, control, chord, rescale=not history):
                raise Failure("the tangent matrix is singular", history)
            step = self._correction(x, control, constraint, history)
            share = active.share
            if points and active.changed == len(history) != _LEFT_ALONE:
                step, share = points.correct(self.solver, self.a, step, self._border), 1.0
                if points.failed == 2 and problem.has_history:
                    raise Failure("contact does not settle: no state of the points that change is consistent", history)
            work = abs(self.F.dot(self.a))
            work0 = work0 or work or 1.0
            x.axpy(share, self.a)
            control += share * step
            moved = self._norm(self.a, step)
            correction = moved / (self._norm(x, control) + AT_REST)
            if not np.isfinite(correction):
                raise Failure("the tangent matrix is singular", history)
            history.append(Iteration(residual, correction, work / work0, chord))
            self.reached = control, step
            problem.residual(x, control, self.F)

    def _check(self, history: list[Iteration], active: _ActiveSet, moved: float) -> None:
        """Raise `Failure` if the iteration diverges, or takes too long."""
        quiet = history[active.changed:]
        grown = len(quiet) >= 2 and quiet[-1].correction > (quiet[0].correction if len(quiet) > 2 else 0.5)
        diverged = len(history) > 2 and min(iteration.correction for iteration in history[-3:]) > _DIVERGED
        if diverged or grown and not (self.problem.has_kinks and moved < SMALL):
            raise Failure("the iteration diverges", history)
        if active.returns >= _CYCLES:
            raise Failure("contact does not settle: the same points touch, stick and slide in turns", history)
        most = min(self.tolerances.settling, HURRIED) if self._hurried else self.tolerances.settling
        settling = len(history) - min(active.found, 4 * SETTLING) >= most
        if len(quiet) >= self.tolerances.iterations or settling:
            unsettled = settling and len(history) - active.changed < 3
            raise Failure("contact does not settle: " * unsettled + f"no convergence in {len(history)} iterations",
                          history)

    def _solve(self, x: PETSc.Vec, control: float, chord: bool, rescale: bool) -> bool:
        """`self.a` = -K^-1 F and, but in a chord iteration, a new K and `self.b` as in `tangent`; False if singular."""
        if chord:
            self.solver.solve(self.F, self.a)
            self.a.scale(-1)
            return True
        if not self._factorise(x, control, rescale=rescale):
            return False
        both = self.solver.solve_all(np.column_stack([self.F.array_r, self.F_control.array_r]))
        self.a.array_w[:], self.b.array_w[:] = -both[:, 0], -both[:, 1]
        return bool(np.isfinite(self.b.norm()))

    def _correction(self, x: PETSc.Vec, control: float, constraint: Any, history: list) -> float:
        """Make `self.a` the correction of x; returns that of the control."""
        c, c_control = constraint(x, control, self.gradient)
        self._slope = self.gradient.dot(self.b) + c_control
        if self._slope == 0 or not np.isfinite(self._slope):
            raise Failure("the quantity that is aimed at does not change along the path here", history)
        step = (-c - self.gradient.dot(self.a)) / self._slope
        self.a.axpy(step, self.b)
        return step

    def _border(self, V: np.ndarray) -> np.ndarray:
        """Make V = K^-1 E, own rows, shape (n, m), in place, those of the bordered system; the control's part, (m,)."""
        steps = -self.problem.comm.allreduce(self.gradient.array_r @ V) / self._slope
        V += np.outer(self.b.array_r, steps)
        return steps

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.solver.destroy()
        for vector in (self.F, self.F_control, self.gradient, self.a, self.b):
            vector.destroy()


def fixed(target: float) -> Any:
    """The constraint control = target."""
    def c(x: Any, control: float, gradient: Any) -> tuple[float, float]:
        gradient.set(0)
        return control - target, 1.0
    return c
