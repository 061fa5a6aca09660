"""Corrections of a solved step with lagged contact, whose points open and close between steps only.

After a correction the state is solved for again, until no point opens or closes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from ...solve.arc_length import Curve
from ...solve.equations import Constraint
from ...solve.newton import Failure, fixed
from ...solve.state import State
from .lagged_steps import LAGGED, LaggedApproach

log = logging.getLogger("formingx")


class LaggedCorrections:
    """Corrections of a solved step for all faces with lagged contact; n: number of owned unknowns of the fields."""

    def __init__(self, contacts: list[LaggedApproach], n: int):
        self._contacts, self._n = contacts, n

    def _separates(self, new: State) -> bool:
        """Open the points in tension at a converged state; return True if there are any."""
        return any([c.separate(new.x[:self._n], new.control) for c in self._contacts])

    def separate(self, curve: Curve, old: State, new: State, jump: Callable[[State], State]) -> State:
        """Separate the points in tension from their tools, and solve for `new` again at the same control.

        `jump` returns the state after a snap-through if the body snaps off. Raise `Failure` without a state.
        """
        for _ in range(LAGGED.max_solutions):
            if not self._separates(new):
                return new
            try:
                new = curve.solve_again(new, fixed(new.control), old)
            except Failure:
                new = jump(new)
        raise Failure("points that separate from a tool touch it again and again", [])

    def close_penetrated(self, curve: Curve, old: State, new: State, equation: Constraint | None) -> State:
        """Put points that penetrate a tool into contact where they met it, and solve again for the end of a step.

        At a target (`equation`) all tools count and pressures are renewed: without friction the state is then
        independent of earlier steps; if this fails, the solution before is returned. If pressure and friction increase
        each other, as in a groove with much friction, it is the one before all renewals. Elsewhere tools with friction
        count, and the control stays. Raise `Failure` without a state.
        """
        constraint, first = equation or fixed(new.control), None
        for sweep in range(LAGGED.max_solutions):
            late = any([c.correct(new.x[:self._n], new.control, equation is not None, sweep) for c in self._contacts])
            variables = curve.problem.history.variables
            if not late:
                if equation is None or not self.renew(new):
                    return new
                first = first or (new, variables, self._difference())
                if sweep > LAGGED.max_solutions / 2:
                    if self._difference() >= first[-1]:
                        log.warning("the contact pressure at %s stays that of the first solution: in further ones it"
                                    " changes more and more; use smaller triangles, or less friction", new.target)
                        new, variables, _ = first
                    curve.problem.history.variables = variables
                    return new
            try:
                new = curve.solve_again(new, constraint, old)
            except Failure as failure:
                if late:
                    raise
                log.info("the contact pressure at %s stays that of the last solution: %s", new.target, failure.reason)
                curve.problem.history.variables = variables
                return new
        raise Failure("points that come into contact late bring others into their tool again and again", [])

    def _difference(self) -> float:
        """Return the largest relative difference of the pressures that `renew` found last; 0 where the sheet sticks."""
        return max((c.pressure_difference for c in self._contacts), default=0.0)

    def renew(self, new: State) -> bool:
        """Open points in tension, and store the pressures of a state at a target; True: solve for it again."""
        return self._separates(new) or any([c.renew_pressure(new.x[:self._n], new.control) for c in self._contacts])
