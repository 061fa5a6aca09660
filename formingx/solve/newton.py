"""Newton's method for F(x, control) = 0 with a constraint c(x, control) = 0: one factorisation, two solves."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from petsc4py import PETSc

from ..errors import count, positive
from ..forms.schedule import StepData
from .equations import Array, Attempt, Constraint, Equations, Residual, Standing
from .linear import DirectSolver
from .local_contact import LocalSolve, Update, woodbury


@dataclass(frozen=True)
class Newton:
    """Settings of Newton's method. `Tolerances` state when the iteration ends.

    Attributes:
        unloaded: lower bound of the support forces (over stress times volume over length) in the relative residual.
        at_rest: lower bound of the displacements (dimensionless) in the relative correction. On a tool whose force
            grows as the square of the penetration, corrections near the reference configuration are as large as
            displacements.
        hurried: iterations allowed while the active set of a contact with a history changes, where a cheaper attempt is
            left, such as half the step.
        small: corrections (dimensionless displacement) that may grow without a sign of divergence while the active set
            changes.
        exempt: number of iterations with a small correction and a new active set that do not count against
            `Tolerances.settling`. On a flat plug a hundred points of a slack sheet separate one or two at a time. With
            a history, a shorter step is better.
        cycles: number of returns to an earlier active set from which on the iteration counts as cycling. Converged
            iterations took up to 4.
        diverged: relative correction above which three corrections in a row mean divergence, with contact or without.
            In converged iterations they stayed below 0.1.
        left_alone: number (from 0) of the iteration without a local solve of contact: it often corrects the errors of
            the first one.
        chords: number of chord iterations that may cost less than one with a new tangent: each costs a residual and a
            solve, about a sixth.
        slow: factor of the residual in an iteration above which a tangent is not kept: round-off would look like
            convergence.
    """

    unloaded: float = 1e-5
    at_rest: float = 1e-2
    hurried: int = 16
    small: float = 1e-3
    exempt: int = 160
    cycles: int = 8
    diverged: float = 0.3
    left_alone: int = 1
    chords: int = 3
    slow: float = 0.1


def relative(equations: Residual, forces: float, floor: float = Newton.unloaded) -> float:
    """Return `forces`, the norm of out-of-balance forces, relative to the support forces at the residual last computed.

    floor: lower bound of the support forces (`Newton.unloaded`).
    """
    return float(forces / (equations.force_scale + floor))


class Iteration(NamedTuple):
    """One Newton iteration. The last entry of a history is the converged state.

    Attributes:
        residual: |F| before the iteration, over the norm of the support forces.
        correction: |dx|/(|x| + `Newton.at_rest`), criterion (3.5.1) of Song (1993).
        work: |F . dx| over its first value, criterion (3.5.2).
        chord: True if the tangent of an earlier iteration was used.
    """

    residual: float
    correction: float
    work: float
    chord: bool = False


def tangents(history: list[Iteration]) -> int:
    """Return the number of iterations with a new tangent in a history, whose last entry is the converged state."""
    return sum(not iteration.chord for iteration in history[:-1])


class Failure(Exception):
    """Failure of Newton's method, or of a step: `reason` is a text, `history` holds the iterations, `attempt` their
    end."""

    def __init__(self, reason: str, history: list[Iteration]):
        super().__init__(reason)
        self.reason, self.history = reason, history
        self.attempt: Attempt | None = None                 # end of the iteration, if known


class _ActiveSet:
    """Changes of the active set of contact in a run of Newton's method.

    Attributes:
        changed: number of the iteration in which the active set changed last.
        share: factor of a correction, halved when an earlier active set returns: full corrections would cycle.
        found: number of small corrections that led to a new active set (`Newton.small`).
        returns: number of returns to an earlier active set.
    """

    def __init__(self, problem: Equations, small: float):
        self._problem, self._small, self._iteration = problem, small, -1
        self._seen: dict[Hashable, int] = {}
        self._last: Hashable = None
        self.changed, self.share, self.found, self.returns = 0, 1.0, 0, 0

    def look(self, moved: float) -> None:
        """Compare the active set with earlier ones; call it once after each residual. moved: size of the last
        correction."""
        self._iteration += 1
        now = self._problem.active_set
        if now != self._last and self._last is not None:
            self.changed = self._iteration
            if now in self._seen:
                self.share = max(self.share / 2, 0.25)
                self.returns += 1
            else:
                self.found += moved < self._small and not self._problem.has_history
        elif self._iteration > self.changed + 1:
            self.share = 1.0
        self._seen[now] = self._iteration
        self._last = now


@dataclass(frozen=True)
class Tolerances:
    """Convergence criteria of a state, all of which must be met.

    Attributes:
        correction: tolerance of the next correction, as quadratic convergence predicts it, over the norm of x (and
            `Newton.at_rest`).
        residual: tolerance of the norm of F over the norm of the support forces.
        iterations: largest number of iterations with one active set of contact.
        settling: largest number of iterations while the active set changes (but `Newton.exempt`).

    Raises:
        InputError: a value that is not greater than 0.

    >>> exact = fx.solve(scene, to=0.01, tolerances=fx.Tolerances(correction=1e-12))
    """

    correction: float = 1e-10
    residual: float = 1e-8
    iterations: int = 12
    settling: int = 40

    def __post_init__(self) -> None:
        positive("Tolerances: correction", self.correction)
        positive("Tolerances: residual", self.residual)
        count("Tolerances: iterations", self.iterations)
        count("Tolerances: settling", self.settling)

    def met(self, corrections: list[float], residuals: list[float], chord: bool = False, smooth: bool = False) -> bool:
        """Return True if an iteration with these relative corrections and residuals (one more) has converged.

        `chord`: the last iteration was a chord iteration, which converges linearly. The next correction is then
        predicted from the fall of residuals and corrections, and doubled. `smooth`: F has no kinks, between which an
        iteration could oscillate.

        Corrections below 1e-7 that no longer shrink, and all below 1e-11, are round-off (a flat thin sheet: near 1e-8).
        The residual may then be round-off, too. With corrections below the tolerance, a residual that no longer shrinks
        is round-off, of any size. A stiff penalty (8 mu/eps) times the round-off of the displacements can exceed the
        support forces of a thin sheet. (r0/h0 = 1e6: corrections vary from 1e-10 to 4e-9, the residual is constant.)
        """
        if not corrections:
            return False
        residual, last, before = residuals[-1], corrections[-1], corrections[-2] if len(corrections) > 1 else 1.0
        if chord:
            if residual == 0:                                # in the unloaded reference configuration
                return True
            ahead = 2 * last * max(residual / residuals[-2], last / before)
            return ahead < self.correction and residual < self.residual
        ahead = last * min(1.0, last / before) ** 2
        if ahead < self.correction and residual < self.residual:
            return True
        if last < self.correction and residual > 0.3 * residuals[-2]:
            return True
        if smooth and len(corrections) >= 5 and max(corrections[-5:]) < 1e-8 and max(residuals[-5:]) < 3 * min(
                residuals[-5:]):
            return True
        stalled = 0.3 * before < last < 1e-7 and residual > 0.3 * residuals[-2]
        return (last < 1e-11 or stalled) and residual < 1e3 * self.residual


class _ModifiedNewton:
    """Modified Newton method: keeps a tangent while a few chord iterations cost less than a new one.

    Source: Ortega and Rheinboldt 1970, section 7.1. The first iteration of a step uses the tangent of an earlier state.
    The expected fall of the residual is its fall in the last step that began with an old tangent. It is halved for
    every step since, so that an old tangent is tried again.
    """

    def __init__(self, settings: Newton) -> None:
        self._settings = settings
        self._setting: StepData | None = None                # step data of the factorised tangent, or None
        self._before, self._fall = 0.0, 1.0

    def made(self, setting: StepData | None) -> None:
        """Note that a tangent was factorised under these step data; None: the tangent is singular."""
        self._setting = setting

    def begin(self, setting: StepData | None, allowed: bool) -> None:
        """Begin Newton's method at a guess, under these step data; `allowed`: tangents may be kept in this step."""
        self._allowed, self._first = allowed, True
        self._fall = self._before if self._setting is setting else 1.0

    def keeps(self, residual: float, requested: float) -> bool:
        """Return True if the present tangent should be kept, to reduce the present residual to the requested one."""
        ahead = residual * self._fall**self._settings.chords
        return self._allowed and self._fall < self._settings.slow and ahead < requested

    def took(self, chord: bool, fall: float) -> None:
        """Note the factor `fall` of the residual in an iteration; `chord`: the iteration used an old tangent."""
        if self._allowed and self._first:
            self._before = fall if chord else self._before / 2
        self._fall, self._first = fall, False


class Drag(Protocol):
    """Forces that are added to F, with their derivative, such as viscous forces."""

    def forces(self, x: Array) -> Array:
        """Return the forces at x, locally owned, shape (n,)."""

    def add_to(self, tangent: PETSc.Mat) -> None:
        """Add the derivative of the forces with respect to x to a tangent matrix."""


class BorderedNewton:
    """Solver of F(x, control) = 0 together with a constraint c(x, control) = 0 (`Constraint`).

    Args:
        problem: the equations.
        tolerances: convergence criteria.
        norm: function (change of x, change of the control) that returns the size of a correction.
        settings: settings of Newton's method.
        drag: forces that are added to F, or None. With them the control must stay constant (`fixed`).

    Attributes:
        F: residual of the last iteration.
        F_control: dF/dcontrol.
        gradient: dc/dx.
        a: last correction of x.
        b: derivative dx/dcontrol along the path.
    """

    def __init__(self, problem: Equations, tolerances: Tolerances, norm: Callable[[PETSc.Vec, float], float],
                 settings: Newton | None = None, drag: Drag | None = None):
        self.problem, self.tolerances, self._norm = problem, tolerances, norm
        self.settings, self._drag = settings or Newton(), drag
        self.solver = DirectSolver(problem.matrix, problem.symmetric, determinant=not problem.has_history)
        new = problem.x.duplicate
        self.F, self.F_control, self.gradient, self.a, self.b = new(), new(), new(), new(), new()
        self.reached = 0.0, 0.0                             # control and its last correction in `correct`
        self._hurried = False
        self._update: Update | None = None                  # of solutions, to a tangent that is not factorised
        self._modified = _ModifiedNewton(self.settings)

    @contextlib.contextmanager
    def in_a_hurry(self, hurried: bool) -> Iterator[None]:
        """Return a context in which contact with a history must settle in `Newton.hurried` iterations, if `hurried`."""
        self._hurried = hurried and self.problem.has_history
        try:
            yield
        finally:
            self._hurried = False

    def tangent(self, x: PETSc.Vec, control: float, ahead: bool = False) -> bool:
        """Compute `self.b` = dx/dcontrol along the path at a solution (x, control); return False if dF/dx is singular.

        `ahead`: use the one-sided derivative of F towards the next step.
        """
        if not self._factorise(x, control, ahead):
            return False
        self.solver.solve(self.F_control, self.b)
        self.b.scale(-1)
        return bool(np.isfinite(self.b.norm()))

    def _factorise(self, x: PETSc.Vec, control: float, ahead: bool = False, rescale: bool = True) -> bool:
        """Factorise dF/dx and compute `F_control` at (x, control), with a new scaling by MUMPS if `rescale`; False
        if singular."""
        matrix = self.problem.tangent(x, control, ahead)
        if self._drag:
            self._drag.add_to(matrix)
        good, self._update = self.solver.factorise(rescale), None
        self._modified.made(self.problem.setting if good else None)
        if good and not self._drag:
            self.problem.control_derivative(x, control, self.F_control, ahead)
        return good

    def update_ahead(self, x: PETSc.Vec, control: float) -> bool:
        """Update `self.b` at a converged solution to the tangent ahead, by Woodbury's formula; return False if this
        fails."""
        update = woodbury(self.problem, self.problem.changes_ahead(x, control), self.solver)
        found = update and update(self.b.array_r[:, None], 1.0)
        if found is None:
            return False
        self.b.array_w[:], self._update = found[:, 0], update
        return True

    def solve_ahead(self, E: Array) -> Array | None:
        """Return K^-1 E by the tangent K ahead of a state, (n, m), locally owned; None if K is singular. Call it
        after `tangent` or `update_ahead`."""
        V = self.solver.solve_all(E)
        return self._update(V, 0.0) if self._update else V

    def correct(self, x: PETSc.Vec, control: float, constraint: Constraint, old: Standing | None = None,
                chords: bool = False) -> tuple[float, list[Iteration]]:
        """Iterate a guess to a solution of F = 0 and c = 0, with x changed in place; return the control and the
        iterations.

        `old`: the accepted state before the guess, or None. `chords`: allow tangents of earlier iterations where they
        cost less and F has no kinks (modified Newton). Afterwards `self.b` is dx/dcontrol at the solution, to the
        accuracy of the last correction or of the kept tangent.

        Raises:
            Failure: no convergence; x is then meaningless.
        """
        problem = self.problem
        history: list[Iteration] = []
        problem.begin(old)
        self._residual(x, control)
        self.a.set(0)
        self.reached = control, 0.0
        self._modified.begin(problem.setting, chords and not problem.has_kinks)
        work0 = moved = 0.0
        active = _ActiveSet(problem, self.settings.small)
        points = LocalSolve(problem) if problem.has_kinks else None
        while True:
            residual = relative(problem, self.F.norm(), self.settings.unloaded)
            if not np.isfinite(residual):
                raise Failure(f"the forces are not finite: {problem.why_not_finite}", history)
            if history:
                self._modified.took(history[-1].chord, residual / (history[-1].residual or 1.0))
            if self.tolerances.met([i.correction for i in history], [*(i.residual for i in history), residual],
                                   bool(history) and history[-1].chord, not problem.has_kinks):
                history.append(Iteration(residual, 0.0, 0.0))
                return control, history
            problem.linearise(x, control, self.F)
            active.look(moved)
            if points:
                points.look()
            self._check(history, active, moved)
            chord = self._modified.keeps(residual, self.tolerances.residual)
            if not self._solve(x, control, chord, rescale=not history):
                raise Failure("the tangent matrix is singular", history)
            step = self._correction(x, control, constraint, history)
            share = active.share
            if points and active.changed == len(history) != self.settings.left_alone:
                step, share = points.correct(self.solver, self.a, step, self._border), 1.0
                if points.failed == 2 and problem.has_history:
                    raise Failure("contact does not settle: no combination of touching, sticking and sliding is"
                                  " in equilibrium at the points that change", history)
            work = abs(self.F.dot(self.a))
            work0 = work0 or work or 1.0
            x.axpy(share, self.a)
            control += share * step
            moved = self._norm(self.a, step)
            correction = moved / (self._norm(x, control) + self.settings.at_rest)
            if not np.isfinite(correction):
                raise Failure("the tangent matrix is singular", history)
            history.append(Iteration(residual, correction, work / work0, chord))
            self.reached = control, step
            self._residual(x, control)

    def _residual(self, x: PETSc.Vec, control: float) -> None:
        """Compute `self.F` at (x, control), the drag included."""
        self.problem.residual(x, control, self.F)
        if self._drag:
            self.F.array_w += self._drag.forces(x.array_r)

    def _check(self, history: list[Iteration], active: _ActiveSet, moved: float) -> None:
        """Check the progress of the iteration; moved: size of the last correction.

        Raises:
            Failure: the iteration diverges, cycles or takes too long.
        """
        settings, quiet = self.settings, history[active.changed:]
        grown = len(quiet) >= 2 and quiet[-1].correction > (quiet[0].correction if len(quiet) > 2 else 0.5)
        diverged = len(history) > 2 and min(iteration.correction for iteration in history[-3:]) > settings.diverged
        if diverged or grown and not (self.problem.has_kinks and moved < settings.small):
            raise Failure("Newton's method diverges", history)
        if active.returns >= settings.cycles:
            raise Failure("contact does not settle: the same points change between open, sticking and sliding"
                          " over and over", history)
        most = min(self.tolerances.settling, settings.hurried) if self._hurried else self.tolerances.settling
        settling = len(history) - min(active.found, settings.exempt) >= most
        if len(quiet) >= self.tolerances.iterations or settling:
            unsettled = settling and len(history) - active.changed < 3
            where = "contact does not settle: " * unsettled
            raise Failure(f"{where}no convergence in {len(history)} Newton iterations", history)

    def _solve(self, x: PETSc.Vec, control: float, chord: bool, rescale: bool) -> bool:
        """Compute `self.a` = -K^-1 F, and `self.b` unless there is drag or `chord`; return False if K is singular.

        A chord iteration (`chord`) uses the factors of an earlier tangent K.
        """
        if not chord and not self._factorise(x, control, rescale=rescale):
            return False
        if chord or self._drag:
            self.solver.solve(self.F, self.a)
            self.a.scale(-1)
            return bool(np.isfinite(self.a.norm()))
        both = self.solver.solve_all(np.column_stack([self.F.array_r, self.F_control.array_r]))
        self.a.array_w[:], self.b.array_w[:] = -both[:, 0], -both[:, 1]
        return bool(np.isfinite(self.b.norm()))

    def _correction(self, x: PETSc.Vec, control: float, constraint: Constraint, history: list[Iteration]) -> float:
        """Complete the correction of x in `self.a` by the constraint, and return the correction of the control.

        Raises:
            Failure: the constraint does not change along the path.
        """
        c, c_control = constraint(x, control, self.gradient)
        self._slope = self.gradient.dot(self.b) + c_control
        if self._slope == 0 or not np.isfinite(self._slope):
            raise Failure("the quantity of the target does not change along the path here", history)
        step = (-c - self.gradient.dot(self.a)) / self._slope
        self.a.axpy(step, self.b)
        return step

    def _border(self, V: Array) -> Array:
        """Map V = K^-1 E, locally owned rows, shape (n, m), to the bordered system; return control changes, (m,)."""
        steps = -self.problem.comm.allreduce(self.gradient.array_r @ V) / self._slope
        V += np.outer(self.b.array_r, steps)
        return steps

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.solver.destroy()
        for vector in (self.F, self.F_control, self.gradient, self.a, self.b):
            vector.destroy()


def fixed(target: float) -> Constraint:
    """Return the constraint control = target."""
    def c(x: PETSc.Vec, control: float, gradient: PETSc.Vec) -> tuple[float, float]:
        gradient.set(0)
        return control - target, 1.0
    return c
