"""Rules for Newton's iterations: settings, changes of the active set of contact, and tangents that are kept."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

from ..forms.schedule import StepData
from .equations import Equations


@dataclass(frozen=True)
class Newton:
    """Settings of Newton's method besides the convergence criteria (`newton.Tolerances`).

    Attributes:
        unloaded: lower bound of the support forces in the relative residual, dimensionless.
        at_rest: lower bound of the displacements (dimensionless) in the relative correction. On a tool whose force
            grows as the square of the penetration, corrections near the reference configuration are as large as
            displacements.
        hurried: iterations allowed while the active set of a contact with history variables changes, if a cheaper
            attempt follows a failure, such as half the step.
        small: corrections (dimensionless displacement) that may grow without a sign of divergence while the active set
            changes.
        exempt: number of iterations with a small correction and a new active set that do not count against
            `newton.Tolerances.settling`. On a flat plug a hundred points of a slack sheet separate one or two at a
            time. With history variables, a shorter step is better.
        cycles: number of returns to an earlier active set at which the iteration counts as cycling. Converged
            iterations took up to 4.
        diverged: relative correction above which three corrections in a row mean divergence, with contact or without.
            In converged iterations they stayed below 0.1.
        left_alone: number, counted from 0, of the iteration without a local solve of contact, since this iteration
            often corrects the errors of the first one.
        chords: number of chord iterations that together cost less than one iteration with a new tangent. Each takes
            a residual and a solve, about a sixth of the time.
        slow: factor of the residual in an iteration above which a tangent is not kept, since round-off would look like
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


class ActiveSetChanges:
    """Changes of the active set of contact during one run of Newton's method.

    Args:
        problem: the equations.
        small: size of a correction below which it counts as small (`Newton.small`).

    Attributes:
        changed: number of the iteration in which the active set changed last, counted from 0.
        share: factor of a correction, halved when an earlier active set returns: full corrections would cycle.
        found: number of small corrections that led to a new active set (`Newton.small`).
        returns: number of returns to an earlier active set.
    """

    def __init__(self, problem: Equations, small: float):
        self._problem, self._small, self._iteration = problem, small, -1
        self._seen: dict[Hashable, int] = {}
        self._last: Hashable = None
        self.changed, self.share, self.found, self.returns = 0, 1.0, 0, 0

    def compare(self, moved: float) -> None:
        """Compare the present active set with earlier ones; called once after each residual.

        Args:
            moved: size of the last correction.
        """
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


class ModifiedNewton:
    """Rule of the modified Newton method: a tangent is kept while chord iterations cost less than a new one.

    Source: Ortega and Rheinboldt 1970, section 7.1. The first iteration of a step uses the tangent of an earlier state.
    The expected fall of the residual is its fall in the last step that began with an old tangent. It is halved for
    every step since, so that an old tangent is tried again.

    Args:
        settings: settings of Newton's method.
    """

    def __init__(self, settings: Newton) -> None:
        self._settings = settings
        self._setting: StepData | None = None                # step data of the factorised tangent, or None
        self._before, self._fall = 0.0, 1.0

    def note_tangent(self, setting: StepData | None) -> None:
        """Note that a tangent was factorised.

        Args:
            setting: step data of the tangent; None if it is singular.
        """
        self._setting = setting

    def begin(self, setting: StepData | None, allowed: bool) -> None:
        """Begin a run of Newton's method.

        Args:
            setting: present step data. A tangent of other step data is not kept.
            allowed: True if tangents may be kept in this step.
        """
        self._allowed, self._first = allowed, True
        self._fall = self._before if self._setting is setting else 1.0

    def keeps(self, residual: float, requested: float) -> bool:
        """Return True if the next iteration should be a chord iteration with the last tangent.

        Args:
            residual: present relative residual.
            requested: tolerance of the relative residual.

        Returns:
            True if `Newton.chords` chord iterations are expected to reach the tolerance.
        """
        ahead = residual * self._fall**self._settings.chords
        return self._allowed and self._fall < self._settings.slow and ahead < requested

    def note_iteration(self, chord: bool, fall: float) -> None:
        """Note the convergence of an iteration.

        Args:
            chord: True if the iteration used an earlier tangent.
            fall: residual after the iteration over the residual before it.
        """
        if self._allowed and self._first:
            self._before = fall if chord else self._before / 2
        self._fall, self._first = fall, False
