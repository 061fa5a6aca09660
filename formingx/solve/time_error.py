"""Whether a step in time keeps its accuracy, and how long the next one may be."""

from __future__ import annotations

import numpy as np

from ..errors import InputError, finite
from . import predictor
from .equations import Equations
from .state import State

ACCURACY = {"draft": 1e-2, "standard": 2e-3, "fine": 3e-4}
"""Error of stress and thickness that each promises."""

_ONCE = 0.5
"""Error of the stress at the end of a step, over the promised one, that is allowed if the next step forgets it."""

_ADDING_UP = 0.5
"""Error allowed over the promised one to the power 3/2 if it lasts: steps of the third root of it add up to that."""


def allowed(who: str, accuracy: str | float) -> float:
    """The error promised by a word or a number, or an InputError."""
    if isinstance(accuracy, str):
        if accuracy not in ACCURACY:
            raise InputError(f"{who}: accuracy = {accuracy!r}: must be one of {', '.join(map(repr, ACCURACY))}, or an"
                             f" error such as 1e-4")
        return ACCURACY[accuracy]
    if not 0 < finite(f"{who}: accuracy", accuracy) < 1:
        raise InputError(f"{who}: accuracy = {accuracy!r}: must be between 0 and 1")
    return float(accuracy)


class TimeError:
    """Measures steps in time.

    Args:
        problem: the `Problem`. accuracy: the error promised.
    """

    def __init__(self, problem: Equations, accuracy: float):
        self._problem = problem
        self._once, self._adding_up = _ONCE * accuracy, _ADDING_UP * accuracy**1.5

    def of(self, states: list[State], x: np.ndarray, control: float) -> float:
        """Error of the step from the last of some states to (x, control) over what is allowed; 0: no time goes by."""
        time = self._problem.time_at(control)
        past = predictor.before(states, time, predictor.QUADRATIC - 1)
        end = State(x, control, x, 0.0, time=time)
        middle = (past[-1].time + time) / 2
        share = predictor.weights([*past, end], middle) if time > past[-1].time else np.array([])
        once, lasting = self._problem.step_error(past, share, x, control)
        return max(once / self._once, lasting / self._adding_up)
