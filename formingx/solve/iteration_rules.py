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
        force_floor: number that is added to the norm of the support forces in the relative residual, dimensionless.
        displacement_floor: number that is added to the norm of the displacements in the relative correction,
            dimensionless. On a tool whose force grows as the square of the penetration, corrections near the reference
            configuration are as large as displacements.
        history_settling: largest number of iterations while the active set changes, in place of `Tolerances.settling`.
            It holds for contact with history variables in a step that is repeated with a smaller length if it fails.
        small_correction: size of a correction (dimensionless displacement) below which growing corrections are no sign
            of divergence while the active set changes.
        exempt_iterations: largest number of iterations that do not count in `newton.Tolerances.settling`. Each is an
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
    history_settling: int = 16
    small_correction: float = 1e-3
    exempt_iterations: int = 160
    max_cycles: int = 8
    divergence_correction: float = 0.3
    uncorrected_iteration: int = 1
    max_chords: int = 3
    max_residual_ratio: float = 0.1


class ActiveSetChanges:
    """Changes of the active set of contact during one run of Newton's method.

    Args:
        problem: the equations.
        small: size below which a correction counts as small (`Newton.small_correction`).

    Attributes:
        changed: number of the iteration in which the active set changed last, counted from 0.
        share: factor of the next correction, halved (to 1/4 at least) when an earlier active set returns, as full
            corrections would cycle.
        found: number of small corrections that led to a new active set, for `Newton.exempt_iterations`.
        returns: number of returns to an earlier active set.
    """

    def __init__(self, problem: Equations, small: float):
        self._problem, self._small, self._iteration = problem, small, -1
        self._seen: dict[Hashable, int] = {}
        self._last: Hashable = None
        self.changed, self.share, self.found, self.returns = 0, 1.0, 0, 0

    def compare(self, moved: float) -> None:
        """Compare the active set with earlier ones, once after each residual.

        moved: size of the last correction, which decides whether a new active set counts in `found`.
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

    Source: Ortega and Rheinboldt 1970, section 7.1. Let q be the residual after an iteration over the residual before
    it. A chord iteration is expected to have the q of the iteration before it.

    The first iteration of a step may use the tangent matrix of an earlier state. Let q_0 be its q in the last step that
    began so. The expected q is q_0, halved for each step since then. Earlier matrices are thus tried again after some
    steps.

    Args:
        settings: settings of Newton's method.
    """

    def __init__(self, settings: Newton) -> None:
        self._settings = settings
        self._setting: StepData | None = None                # step data of the factorised tangent, or None
        self._before, self._fall = 0.0, 1.0

    def note_tangent(self, setting: StepData | None) -> None:
        """Note the step data of a factorised tangent, which later iterations may keep; None if it is singular."""
        self._setting = setting

    def begin(self, setting: StepData | None, allowed: bool) -> None:
        """Begin a run of Newton's method; only a tangent with the same step data is kept, and only if `allowed`."""
        self._allowed, self._first = allowed, True
        self._fall = self._before if self._setting is setting else 1.0

    def keeps(self, residual: float, requested: float) -> bool:
        """Return True if `Newton.max_chords` chord iterations are expected to reach the relative residual `requested`.
        """
        ahead = residual * self._fall**self._settings.max_chords
        return self._allowed and self._fall < self._settings.max_residual_ratio and ahead < requested

    def note_iteration(self, chord: bool, fall: float) -> None:
        """Note the ratio of residuals of an iteration, and whether it was a chord iteration."""
        if self._allowed and self._first:
            self._before = fall if chord else self._before / 2
        self._fall, self._first = fall, False
