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
        """True if `rule` lets the body snap through, or if it is "continue" and the path may end at a kink of F.

        The residual F has kinks in contact, and where history variables change.
        """
        may_end = self._problem.has_history or self._problem.has_kinks
        return self.rule in ("snap_through", "continue_volume") or self.rule == "continue" and may_end

    @property
    def tried_early(self) -> bool:
        """True if a snap-through is tried after two failed steps, False if only after the smallest step has failed.

        False for a pressure on a body with history variables, since slip in the viscous motion changes the final state.
        """
        return self.rule in ("snap_through", *["continue_volume"] * (not self._problem.has_history))

    def found_no_equilibrium_near(self, old: State) -> bool:
        """Return True if an earlier snap-through, at nearly the control of `old`, reached no equilibrium."""
        return abs(old.control - self.no_equilibrium_at) < self._settings.max_control_change

    def jump(self, old: State, length: float, sense: float, passed: Sequence[State], listener: Callable[[], None],
             work_sign: float = 0.0) -> State:
        """Return the state after a snap-through.

        With length 0 and history variables several changes of the control are tried, since contact may converge at one
        of them only. While unbalanced forces fade, the control goes to 1 at once, where they are 0.

        Args:
            old: the state from which the body snaps.
            length: arc length along the tangent of `old` at which the motion starts; 0: at `old` itself.
            sense: 1 or -1, direction of the control in the run.
            passed: earlier states of the path, to which the body must not return.
            listener: function that is called before each viscous solution.
            work_sign: 1 or -1, the sign that the work of the controlled load must have; 0: either.

        Returns:
            The state, of kind "jump".

        Raises:
            Failure: no such state was found.
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

    * "continue": follow the path through limit points. For problems without history variables, except for a pressure on
      a body in contact.
    * "continue_volume": follow the path while the enclosed volume grows, and snap where this volume has a maximum. For
      an increasing pressure on a body with history variables or in contact.
    * "snap_through": snap to the next equilibrium. For the other problems, and for time as the control: beyond a limit
      point the control would reverse.

    Args:
        problem: the equations.
        decreases: True if the controlled quantity decreases towards 0, such as a pressure that is released.

    Returns:
        Name of the rule.
    """
    if problem.control_kind == "time":
        return "snap_through"
    by_pressure = problem.control_kind == "pressure"
    if not (problem.has_history or problem.has_kinks and by_pressure):
        return "continue"
    return "continue_volume" if by_pressure and not decreases else "snap_through"


def snaps(curve: Curve, old: State, at_limit_point: str, sense: float) -> bool:
    """Return True if the body snaps at a state, where the control (or the enclosed volume) begins to reverse.

    Args:
        curve: solver of the path.
        old: the state.
        at_limit_point: the rule at limit points. With "snap_through" the body snaps where the control reverses, with
            "continue_volume" where the enclosed volume reverses, too; with other rules it never snaps here.
        sense: 1 or -1, direction of the control at the start of the run.

    Returns:
        True if a snap-through should start here.
    """
    if at_limit_point not in ("snap_through",
                              "continue_volume") or old.kind != "limit point" and old.slope * sense >= 0:
        return False
    return at_limit_point == "snap_through" or curve.work_rate(old) * sense < 0
