"""Newton's method for F(x, control) = 0 with a constraint c(x, control) = 0: one factorisation, two solves."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from petsc4py import PETSc

from ..errors import count, positive
from ..forms.schedule import StepData
from .equations import Array, Attempt, Constraint, Equations, ProblemState
from .linear import DirectSolver
from .local_contact import BorderedTangent, LocalSolve, Update, woodbury


@dataclass(frozen=True)
class Newton:
    """Settings of Newton's method besides the convergence criteria (`Tolerances`).

    Attributes:
        force_floor: number that is added to the norm of the support forces in the relative residual, dimensionless.
        displacement_floor: number that is added to the norm of the displacements in the relative correction,
            dimensionless. On a tool whose force grows as the square of the penetration, corrections near the reference
            configuration are as large as displacements.
        small_correction: size of a correction (dimensionless displacement) below which growing corrections are no sign
            of divergence while the active set changes.
        exempt_iterations: largest number of iterations that do not count in `Tolerances.settling`. Each is an
            iteration whose small correction led to a new active set. For example, a hundred points of a slack sheet
            separate one by one from a flat plug. With history variables all iterations count.
        max_cycles: number of returns to an earlier active set at which the iteration counts as cycling. Iterations that
            converged had up to 4 returns.
        divergence_correction: relative correction above which three corrections in a row mean divergence, with contact
            or without. In converged iterations they stayed below 0.1.
        uncorrected_iteration: index of the iteration, counted from 0, in which the local contact problem is never
            solved. The full correction often removes the errors of the iteration before it.
        max_chords: number of chord iterations that together cost less than one iteration with a new tangent. A chord
            iteration takes a residual and a solve, about a sixth of the time.
        max_residual_ratio: residual after an iteration over the residual before it, above which the tangent matrix is
            not kept. A larger ratio may come from round-off instead of slow convergence.
    """

    force_floor: float = 1e-5
    displacement_floor: float = 1e-2
    small_correction: float = 1e-3
    exempt_iterations: int = 160
    max_cycles: int = 8
    divergence_correction: float = 0.3
    uncorrected_iteration: int = 1
    max_chords: int = 3
    max_residual_ratio: float = 0.1


class ActiveSetChanges:
    """Changes of the active set of contact during one run of Newton's method.

    Attributes:
        changed: number of the iteration in which the active set changed last, counted from 0.
        share: factor of the next correction, halved (to 1/4 at least) when an earlier active set returns, as full
            corrections would cycle.
        found: number of small corrections (`Newton.small_correction`) that led to a new active set, for
            `Newton.exempt_iterations`.
        returns: number of returns to an earlier active set.
    """

    def __init__(self, problem: Equations, small: float):
        self._problem, self._small, self._iteration = problem, small, -1
        self._seen: set[Hashable] = set()
        self._last: Hashable = None
        self.changed, self.share, self.found, self.returns = 0, 1.0, 0, 0

    def compare(self, moved: float) -> None:
        """Compare the active set with earlier ones, once after each residual; moved: size of the last correction."""
        self._iteration += 1
        now = self._problem.contact.status
        if now != self._last and self._last is not None:
            self.changed = self._iteration
            if now in self._seen:
                self.share = max(self.share / 2, 0.25)
                self.returns += 1
            else:
                self.found += moved < self._small and not self._problem.history.path_dependent
        elif self._iteration > self.changed + 1:
            self.share = 1.0
        self._seen.add(now)
        self._last = now


class ModifiedNewton:
    """Rule of the modified Newton method: a tangent is kept while chord iterations cost less than a new one.

    Source: Ortega and Rheinboldt 1970, section 7.1. Let q be the residual after an iteration over the residual before
    it. A chord iteration is expected to have the q of the iteration before it.

    The first iteration of a step may use the tangent matrix of an earlier state. Let q_0 be its q in the last step that
    began so. The expected q is q_0, halved for each step since then. Earlier matrices are thus tried again after some
    steps.

    Attributes:
        setting: step data of the last factorised tangent, which later iterations may keep; None if it is singular.
    """

    def __init__(self, settings: Newton) -> None:
        self._settings = settings
        self.setting: StepData | None = None
        self._before, self._fall = 0.0, 1.0

    def begin(self, setting: StepData | None) -> None:
        """Begin a run of Newton's method with chord iterations; only a tangent with the same step data is kept."""
        self._first = True
        self._fall = self._before if self.setting is setting else 1.0

    def keeps(self, residual: float, requested: float) -> bool:
        """Return True if `Newton.max_chords` chord iterations are expected to reach the relative residual `requested`.
        """
        ahead = residual * self._fall**self._settings.max_chords
        return self._fall < self._settings.max_residual_ratio and ahead < requested

    def note_iteration(self, chord: bool, fall: float) -> None:
        """Note the ratio of residuals of an iteration, and whether it was a chord iteration."""
        if self._first:
            self._before = fall if chord else self._before / 2
        self._fall, self._first = fall, False


def relative(equations: Equations, forces: float, floor: float = Newton.force_floor) -> float:
    """Return the relative norm of unbalanced forces, |F| / (|support forces| + floor), dimensionless."""
    return float(forces / (equations.force_scale + floor))


class Iteration(NamedTuple):
    """Residual and correction of one Newton iteration.

    The last entry of a list of iterations has the residual of the converged state; its correction and work are 0.

    Attributes:
        residual: |F| before the iteration over |support forces| + `Newton.force_floor`.
        correction: ``|dx|/(|x| + Newton.displacement_floor)``, criterion (3.5.1) of Song (1993).
        work: |F . dx| over its value in the first iteration, criterion (3.5.2) of Song (1993).
        chord: True if the tangent of an earlier iteration was used.
    """

    residual: float
    correction: float
    work: float
    chord: bool = False


def tangents(history: list[Iteration]) -> int:
    """Return the number of iterations with a new tangent; the last entry, the converged state, does not count."""
    return sum([not iteration.chord for iteration in history[:-1]])


class Failure(Exception):
    """Failure of Newton's method, or of a step.

    Attributes:
        reason: the reason, as text.
        history: residual and correction of each Newton iteration before the failure (`Iteration`); may be empty.
        attempt: unknowns and last corrections at the end of the iteration; None if no iteration failed.
    """

    def __init__(self, reason: str, history: list[Iteration]):
        super().__init__(reason)
        self.reason, self.history = reason, history
        self.attempt: Attempt | None = None


@dataclass(frozen=True)
class Tolerances:
    """Convergence criteria of a state, all of which must be met.

    Attributes:
        correction: tolerance of the relative correction ``|dx|/(|x| + Newton.displacement_floor)`` that quadratic
            convergence predicts for the next iteration.
        residual: tolerance of ``|F|/(|support forces| + Newton.force_floor)``.
        iterations: largest number of iterations with the same active set of contact.
        settling: largest number of iterations while the active set changes. Iterations whose small correction led to a
            new active set do not count, up to `Newton.exempt_iterations` of them.

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

    def converged(self, corrections: list[float], residuals: list[float], chord: bool = False,
                  smooth: bool = False) -> bool:
        """Return True if an iteration has converged, to its tolerances or to round-off.

        * The correction predicted for the next iteration and the residual are below their tolerances. After a chord
          iteration only this counts.
        * The last correction is below its tolerance, and the residual no longer decreases (by a factor 0.3): in a thin
          sheet a stiff penalty times the round-off of displacements can exceed the support forces.
        * The residual is below 1000 times its tolerance. The last correction is below 1e-11, or it is below 1e-7 and no
          longer decreases.
        * F is `smooth`, without kinks. In the last five iterations corrections were below 1e-8, and residuals differed
          by less than a factor of 3.

        corrections: ``|dx|/(|x| + Newton.displacement_floor)`` of all iterations so far. residuals: ``|F|/(|support
        forces| + floor)`` before each iteration and after the last one.
        """
        if not corrections:
            return False
        residual, last, before = residuals[-1], corrections[-1], corrections[-2] if len(corrections) > 1 else 1.0
        if chord:
            if residual == 0:                                # in the unloaded reference configuration
                return True
            ratio = max(residual / (residuals[-2] or residual), last / (before or last or 1.0))
            ahead = 2 * last * ratio                        # linear convergence, doubled
            return ahead < self.correction and residual < self.residual
        ahead = last * min(1.0, last / (before or last or 1.0)) ** 2
        if ahead < self.correction and residual < self.residual:
            return True
        if last < self.correction and residual > 0.3 * residuals[-2]:
            return True
        if smooth and len(corrections) >= 5 and max(corrections[-5:]) < 1e-8 and max(residuals[-5:]) < 3 * min(
                residuals[-5:]):
            return True
        stalled = 0.3 * before < last < 1e-7 and residual > 0.3 * residuals[-2]
        return (last < 1e-11 or stalled) and residual < 1e3 * self.residual


class Drag(Protocol):
    """Interface of forces that are added to the residual F, such as viscous forces; F has internal forces as positive.
    """

    def forces(self, x: Array) -> Array:
        """Return the dimensionless forces that are added to F at x, locally owned entries, shape (n,) both."""

    def add_to(self, tangent: PETSc.Mat) -> None:
        """Add the derivative of the forces with respect to x to a tangent matrix, in place."""


class BorderedNewton:
    """Newton's method for F(x, control) = 0 together with a constraint c(x, control) = 0.

    norm: function (change of x, change of the control) that returns the size of a correction, dimensionless. drag:
    forces added to F, such as viscous forces, or None. With them the control must be constant: the constraint must be
    `fixed`.

    Attributes:
        solver: direct solver with the factors of the last tangent dF/dx.
        F: vector of the residual in the last iteration.
        F_control: vector dF/dcontrol.
        gradient: vector dc/dx.
        a: vector of the last correction of x.
        b: vector dx/dcontrol along the path.
        reached: (control at the end of the last iteration, last correction of the control).
    """

    def __init__(self, problem: Equations, tolerances: Tolerances, norm: Callable[[PETSc.Vec, float], float],
                 settings: Newton | None = None, drag: Drag | None = None):
        self.problem, self.tolerances, self._norm = problem, tolerances, norm
        self.settings, self._drag = settings or Newton(), drag
        self.solver = DirectSolver(problem.matrix, problem.symmetric, determinant=not drag)
        new = problem.x.duplicate
        self.F, self.F_control, self.gradient, self.a, self.b = new(), new(), new(), new(), new()
        self.reached = 0.0, 0.0
        self._update: Update | None = None                  # of solutions, to a tangent that is not factorised
        self._modified = ModifiedNewton(self.settings)

    def tangent(self, x: PETSc.Vec, control: float, one_sided: bool = False) -> bool:
        """Factorise dF/dx at a solution (one-sided: for the next step), store `b`; return False if it is singular."""
        if not self._factorise(x, control, one_sided):
            return False
        self.solver.solve(self.F_control, self.b)
        self.b.scale(-1)
        return bool(np.isfinite(self.b.norm()))

    def _factorise(self, x: PETSc.Vec, control: float, one_sided: bool = False, rescale: bool = True) -> bool:
        """Factorise dF/dx at (x, control) and compute `F_control`; return False if dF/dx is singular.

        one_sided: True if the next step starts here. At a kink of F, derivatives are then taken on the side to which
        this step goes. rescale: True for a new scaling of rows and columns by MUMPS.
        """
        matrix = self.problem.tangent(x, control, one_sided)
        if self._drag:
            self._drag.add_to(matrix)
        good, self._update = self.solver.factorise(rescale), None
        self._modified.setting = self.problem.setting if good else None
        if good and not self._drag:
            self.problem.control_derivative(x, control, self.F_control, one_sided)
        return good

    def update_one_sided(self, x: PETSc.Vec, control: float) -> bool:
        """Update `b` = dx/dcontrol at a solution for the start of the next step, by Woodbury's formula.

        It adds the changed stiffness of a few contact points. Return False, `b` unchanged, if they are too many or
        dF/dx is singular.
        """
        update = woodbury(self.problem, self.problem.contact.one_sided_changes(x, control), self.solver)
        found = update and update(self.b.array_r[:, None], 1.0)
        if found is None:
            return False
        self.b.array_w[:], self._update = found[:, 0], update
        return True

    def solve_one_sided(self, E: Array) -> Array | None:
        """Return K^-1 E, shape (n, m), with K of the last `tangent` or `update_one_sided`; None if K is singular."""
        V = self.solver.solve_all(E)
        return self._update(V, 0.0) if self._update else V

    def correct(self, x: PETSc.Vec, control: float, constraint: Constraint, old: ProblemState | None = None,
                chords: bool = False) -> tuple[float, list[Iteration]]:
        """Iterate a guess (x, control) to a solution of F = 0 and of a constraint c = 0; x changes in place.

        Return the control and the iterations; raise `Failure` without convergence. `b` is then dx/dcontrol of the last
        tangent. `old`: accepted state at which contact increments start. chords: True to use earlier factors, if F has
        no kinks.
        """
        problem = self.problem
        history: list[Iteration] = []
        problem.contact.begin(old)
        self._residual(x, control)
        self.a.set(0)
        self.reached = control, 0.0
        modified = self._modified if chords and not problem.contact.faces else None
        if modified:
            modified.begin(problem.setting)
        work0 = moved = 0.0
        active = ActiveSetChanges(problem, self.settings.small_correction)
        points = LocalSolve(problem) if problem.contact.faces else None
        while True:
            residual = relative(problem, self.F.norm(), self.settings.force_floor)
            if not np.isfinite(residual):
                raise Failure(f"the forces are not finite: {problem.description.why_not_finite}", history)
            if modified and history:
                modified.note_iteration(history[-1].chord, residual / (history[-1].residual or 1.0))
            if self.tolerances.converged([i.correction for i in history], [*[i.residual for i in history], residual],
                                   bool(history) and history[-1].chord, not problem.contact.faces):
                history.append(Iteration(residual, 0.0, 0.0))
                return control, history
            problem.contact.linearise(x, control, self.F)
            active.compare(moved)
            if points:
                points.mark_changes()
            self._check(history, active, moved)
            chord = modified is not None and modified.keeps(residual, self.tolerances.residual)
            if not self._solve(x, control, chord, rescale=not history):
                raise Failure("the tangent matrix is singular", history)
            step = self._correction(x, control, constraint, history)
            share = active.share
            if points and active.changed == len(history) != self.settings.uncorrected_iteration:
                border = BorderedTangent(self.gradient, self.b, self._slope)
                step, share = points.correct(self.solver, self.a, step, border), 1.0
                if points.failed == 2 and problem.history.path_dependent:
                    raise Failure("contact does not settle: no combination of touching, sticking and sliding is"
                                  " in equilibrium at the points that change", history)
            work = abs(self.F.dot(self.a))
            work0 = work0 or work or 1.0
            x.axpy(share, self.a)
            control += share * step
            moved = self._norm(self.a, step)
            correction = moved / (self._norm(x, control) + self.settings.displacement_floor)
            if not np.isfinite(correction):
                raise Failure("the tangent matrix is singular", history)
            history.append(Iteration(residual, correction, work / work0, chord))
            self.reached = control, step
            self._residual(x, control)

    def _residual(self, x: PETSc.Vec, control: float) -> None:
        """Compute `F` = F(x, control), plus the forces of the `Drag` (such as viscous forces) if there is one."""
        self.problem.residual(x, control, self.F)
        if self._drag:
            self.F.array_w += self._drag.forces(x.array_r)

    def _check(self, history: list[Iteration], active: ActiveSetChanges, moved: float) -> None:
        """Raise `Failure` if the iteration diverges, cycles or takes too long; moved: size of the last correction."""
        settings, quiet = self.settings, history[active.changed:]
        grown = len(quiet) >= 2 and quiet[-1].correction > (quiet[0].correction if len(quiet) > 2 else 0.5)
        diverged = len(history) > 2 and min([i.correction for i in history[-3:]]) > settings.divergence_correction
        if diverged or grown and not (self.problem.contact.faces and moved < settings.small_correction):
            raise Failure("Newton's method diverges", history)
        if active.returns >= settings.max_cycles:
            raise Failure("contact does not settle: the same points change between open, sticking and sliding"
                          " over and over", history)
        settling = len(history) - min(active.found, settings.exempt_iterations) >= self.tolerances.settling
        if len(quiet) >= self.tolerances.iterations or settling:
            unsettled = settling and len(history) - active.changed < 3
            where = "contact does not settle: " * unsettled
            raise Failure(f"{where}no convergence in {len(history)} Newton iterations", history)

    def _solve(self, x: PETSc.Vec, control: float, chord: bool, rescale: bool) -> bool:
        """Compute the correction `a` = -K^-1 F with the tangent K at (x, control); return False if K is singular.

        The vector `b` = dx/dcontrol is computed, too, except with a `Drag` and in a chord iteration. chord: True to use
        the factors of an earlier dF/dx. rescale: True for a new scaling of rows and columns by MUMPS.
        """
        if not chord and not self._factorise(x, control, rescale=rescale):
            return False
        if chord or self._drag:
            self.solver.solve(self.F, self.a)
            self.a.scale(-1)
            return bool(np.isfinite(self.a.norm()))
        both = self.solver.solve_all(np.array([self.F.array_r, self.F_control.array_r]).T)
        self.a.array_w[:], self.b.array_w[:] = -both[:, 0], -both[:, 1]
        return bool(np.isfinite(self.b.norm()))

    def _correction(self, x: PETSc.Vec, control: float, constraint: Constraint, history: list[Iteration]) -> float:
        """Return the correction of the control from the linearised constraint, and add its share times `b` to `a`.

        Raise `Failure`, with the iterations so far, if the constraint does not change along the path.
        """
        c, c_control = constraint(x, control, self.gradient)
        self._slope = self.gradient.dot(self.b) + c_control
        if self._slope == 0 or not np.isfinite(self._slope):
            raise Failure("the quantity of the target does not change along the path here", history)
        step = (-c - self.gradient.dot(self.a)) / self._slope
        self.a.axpy(step, self.b)
        return step

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.solver.destroy()
        for vector in (self.F, self.F_control, self.gradient, self.a, self.b):
            vector.destroy()


def fixed(target: float) -> Constraint:
    """Return the constraint control - target of (x, control, gradient): (c, dc/dcontrol), with dc/dx zeros set."""
    def c(x: PETSc.Vec, control: float, gradient: PETSc.Vec) -> tuple[float, float]:
        gradient.set(0)
        return control - target, 1.0
    return c
