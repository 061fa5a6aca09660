"""Rules of snap-through in a run: at limit points, and after steps that fail."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .arc_length import Curve
from .equations import Equations
from .newton import Failure
from .progress import RunTargets
from .snap_through import NoEquilibrium, SnapThrough, snap_through
from .state import State


class JumpRules:
    """Snap-throughs of a run: where they are tried, and with which change of the control.

    Args:
        curve: solver of the path.
        targets: targets of the run.
        settings: settings of snap-through.
        rule: rule at limit points: "continue", "continue_volume" (snap where the enclosed volume has a maximum),
            "snap_through" or "stop"; "" until it is known.

    Attributes:
        rule: the argument `rule`; a run sets it at its start.
        change: change of the control in the next snap-through, dimensionless. It is 10 times larger after each
            snap-through, and returns to its first value after a step along the path.
        no_equilibrium_at: control at which a snap-through reached no equilibrium, dimensionless; NaN without one.
    """

    def __init__(self, curve: Curve, targets: RunTargets, settings: SnapThrough, rule: str = ""):
        self._curve, self._problem, self._targets, self._settings = curve, curve.problem, targets, settings
        self.rule, self.change, self.no_equilibrium_at = rule, settings.control_change, np.nan

    @property
    def allowed(self) -> bool:
        """True if `rule` snaps, or is "continue" and the path may end at a kink of F (contact, history variables)."""
        may_end = self._problem.has_history or self._problem.has_kinks
        return self.rule in ("snap_through", "continue_volume") or self.rule == "continue" and may_end

    @property
    def tried_early(self) -> bool:
        """True if a snap-through is tried after two failed steps, False if only after the smallest step has failed.
        False for a pressure with history variables, since slip in the viscous motion changes the final state."""
        return self.rule in ("snap_through", *["continue_volume"] * (not self._problem.has_history))

    def found_no_equilibrium_near(self, old: State) -> bool:
        """Return True if an earlier snap-through, at nearly the control of `old`, reached no equilibrium."""
        return abs(old.control - self.no_equilibrium_at) < self._settings.max_control_change

    def jump(self, old: State, length: float, sense: float, passed: Sequence[State], listener: Callable[[], None],
             work_sign: float = 0.0) -> State:
        """Return the state of kind "jump" after a snap-through from `old`; raise `Failure` if none was found.

        The motion starts at arc length `length` along the tangent. With length 0 and history variables several changes
        of the control are tried, since contact may converge at one of them only. While unbalanced forces fade, the
        control goes to 1 at once. The work of the controlled load has the sign `work_sign`; 0: either.
        """
        fading, settings = self._problem.setting.fading, self._settings
        others = (settings.control_change, settings.max_control_change) if (
            length == 0 and self._problem.has_history and not fading) else ()
        failure: Failure | None = None
        for next_change in dict.fromkeys((self.change, *others)):
            self.change = next_change
            solutions = settings.max_solutions // 5 if self.found_no_equilibrium_near(old) else settings.max_solutions
            change = sense * max(self.change, length * abs(old.slope))
            change = 1 - old.control if fading else self._targets.short_of_targets(old, change)
            try:
                new = snap_through(self._curve, old, change, length > 0 and not fading, settings, solutions, listener,
                                   work_sign, passed)
            except Failure as last:
                failure = last
                if isinstance(last, NoEquilibrium):
                    self.no_equilibrium_at = old.control
            else:
                self.change = min(10 * self.change, settings.max_control_change)
                return new
        assert failure is not None
        raise failure


def at_limit_points(problem: Equations, decreases: bool) -> str:
    """Return the default rule at limit points of the control.

    "continue" follows the path: without history variables, except for a pressure in contact. "continue_volume" snaps at
    a maximum of the volume: for an increasing pressure with history variables or contact. Else "snap_through".
    """
    if problem.control_kind == "time":
        return "snap_through"
    by_pressure = problem.control_kind == "pressure"
    if not (problem.has_history or problem.has_kinks and by_pressure):
        return "continue"
    return "continue_volume" if by_pressure and not decreases else "snap_through"


def snaps(curve: Curve, old: State, at_limit_point: str, sense: float) -> bool:
    """Return True if the body snaps at a state: its control reverses or, with "continue_volume", its enclosed volume.

    `sense`: direction 1 or -1 of the control at the start of the run.
    """
    if at_limit_point not in ("snap_through",
                              "continue_volume") or old.kind != "limit point" and old.slope * sense >= 0:
        return False
    return at_limit_point == "snap_through" or curve.work_rate(old) * sense < 0
