"""Length of the next step, and the accuracy of the last one in time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, count, finite, positive
from . import predictor
from .equations import Array, Equations
from .state import State

ACCURACY = {"draft": 1e-2, "standard": 2e-3, "fine": 3e-4}
"""Error of stress and thickness that each promises."""

SAME_TIME = 1e-12
"""Largest relative difference of times that count as equal."""


@dataclass
class StepControl:
    r"""Step length from the iterations of the last step, eq. (4.21) of Song (1993).

    .. math:: s_{k+1} = s_k \min\left(\max\left(\frac{n_{target}}{n_k}, \frac{1}{2}\right), growth\right)

    With an estimated error e over its tolerance in time, the factor is at most 0.9 e^(-1/3).

    Attributes:
        length: the next step (dimensionless arc length: mean displacement over the size of the body); at most
            `largest`.
        target: iterations that a step should take.
        growth: at most this factor from one step to the next, at least 1; failures halve.
        smallest, largest: a run gives up below the one; no step is longer than the other.

    Raises:
        InputError: a value that is not greater than 0, a growth below 1, or `smallest` above `largest`.

    >>> fine = fx.trace(scene, until=fx.pole_height(3.0), step=fx.StepControl(largest=0.05), progress=False)
    >>> len(fine.states)
    6
    """

    length: float = 0.1
    target: int = 4
    growth: float = 2.0
    smallest: float = 1e-6
    largest: float = math.inf

    def __post_init__(self) -> None:
        for name in ("length", "growth", "smallest"):
            positive(f"StepControl: {name}", getattr(self, name))
        count("StepControl: target", self.target)
        if not (isinstance(self.largest, float) and self.largest == math.inf):
            positive("StepControl: largest", self.largest)
        if self.growth < 1:
            raise InputError(f"StepControl: growth = {self.growth!r}: must be at least 1, or steps never grow again")
        if self.smallest > self.largest:
            raise InputError(f"StepControl: smallest = {self.smallest!r}: must not be above largest ="
                             f" {self.largest!r}")
        self.length = min(self.length, self.largest)

    def accepted(self, iterations: int, error: float = 0.0) -> None:
        """Adapt the length after a full step with this number of new tangents; error: in time, over the
        tolerance."""
        factor = min(max(self.target / max(iterations, 1), 0.5), self.growth)
        factor = min(factor, 0.9 * max(error, 1e-9) ** (-1 / 3))
        self.length = min(self.length * factor, self.largest)

    def failed(self) -> bool:
        """Halve after a failure; False if the step is then too small to go on."""
        self.length /= 2
        return self.length >= self.smallest


def allowed(caller: str, accuracy: str | float) -> float:
    """Return the error promised by a word or a number, or an InputError."""
    if isinstance(accuracy, str):
        if accuracy not in ACCURACY:
            raise InputError(f"{caller}: accuracy = {accuracy!r}: must be one of {', '.join(map(repr, ACCURACY))},"
                             f" or an"
                             f" error such as 1e-4")
        return ACCURACY[accuracy]
    if not 0 < finite(f"{caller}: accuracy", accuracy) < 1:
        raise InputError(f"{caller}: accuracy = {accuracy!r}: must be between 0 and 1")
    return float(accuracy)


class TimeError:
    """Time integration error of steps, over its tolerance.

    Args:
        problem: the equations.
        accuracy: the promised error.
        once: part of the promised error that is allowed at the end of a step, if later steps do not keep it.
        adding_up: error that is allowed if later steps keep it, over the promised error to the power 3/2.
    """

    def __init__(self, problem: Equations, accuracy: float, once: float = 0.5, adding_up: float = 0.5):
        self._problem = problem
        self._once, self._adding_up = once * accuracy, adding_up * accuracy**1.5

    def of(self, states: Sequence[State], x: Array, control: float) -> float:
        """Error of the step from the last of some states to (x, control) over the tolerance; 0: no time goes by."""
        time = self._problem.time_at(control)
        past = predictor.before(states, time, predictor.QUADRATIC - 1)
        end = State(x, control, x, 0.0, time=time)
        middle = (past[-1].time + time) / 2
        share = predictor.weights([*past, end], middle) if time > past[-1].time else np.array([])
        once, lasting = self._problem.step_error(past, share, x, control)
        return max(once / self._once, lasting / self._adding_up)


class Cutback(Exception):
    """A step is too long; part: of its length, that will do. lasts: of the steps after it, too.

    control: to hold at the end of the shorter step, in place of its length. Along the path a step in time may be far
    from short in time where the body moves at once as a step begins.
    """

    def __init__(self, why: str, part: float, lasts: bool = False, control: float | None = None):
        super().__init__(why)
        self.part, self.lasts, self.control = part, lasts, control
