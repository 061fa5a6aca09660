"""Control of the step length, and the time integration error of a step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, count, fraction, positive
from . import predictor
from .equations import Array, Equations
from .state import State

ACCURACY = {"draft": 1e-2, "standard": 2e-3, "fine": 3e-4}
"""Relative error of stress and thickness for each name of an accuracy."""

SAME_TIME = 1e-12
"""Largest relative difference of times that count as equal."""


@dataclass
class StepControl:
    r"""Step length from the iterations of the last step, eq. (4.21) of Song (1993).

    .. math:: s_{k+1} = s_k \min\left(\max\left(\frac{n_{target}}{n_k}, \frac{1}{2}\right), growth\right)

    Step k has the arc length s_k and took n_k Newton iterations with a new tangent matrix; n_target is `target`. If the
    time integration error of the step is e times its tolerance, the factor of s_k is at most 0.9 e^(-1/3).

    Attributes:
        length: arc length of the next step, at most `largest`. It is dimensionless: about the root mean square of the
            displacement over the size of the body.
        target: number of Newton iterations with a new tangent matrix that a step should take.
        growth: largest factor of the length from one step to the next, at least 1. A failure halves the length.
        smallest: step length below which a run gives up.
        largest: largest step length.

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
        """Adapt the step length after a converged step of full length (Song 1993, eq. 4.21).

        `error`: time integration error of the step over its tolerance.
        """
        factor = min(max(self.target / max(iterations, 1), 0.5), self.growth)
        factor = min(factor, 0.9 * max(error, 1e-9) ** (-1 / 3))
        self.length = min(self.length * factor, self.largest)

    def failed(self) -> bool:
        """Halve the step length after a failed step; return False if it is then below `smallest`."""
        self.length /= 2
        return self.length >= self.smallest


def allowed(caller: str, accuracy: str | float) -> float:
    """Return the relative error that "draft", "standard", "fine" or a number in (0, 1) allows, else InputError."""
    if isinstance(accuracy, str):
        if accuracy not in ACCURACY:
            raise InputError(f"{caller}: accuracy = {accuracy!r}: must be one of {', '.join(map(repr, ACCURACY))},"
                             f" or an error such as 1e-4")
        return ACCURACY[accuracy]
    return fraction(f"{caller}: accuracy", accuracy)


class TimeError:
    """Estimator of the time integration error of a step, relative to its tolerance.

    accuracy: allowed relative error of stress and thickness in the run. once: tolerance of the error at the end of a
    step, over `accuracy`. adding_up: tolerance of the part that persists, over `accuracy` to the power 3/2. It
    decreases faster, since this part adds up over more steps.
    """

    def __init__(self, problem: Equations, accuracy: float, once: float = 0.5, adding_up: float = 0.5):
        self._problem = problem
        self._once, self._adding_up = once * accuracy, adding_up * accuracy**1.5

    def ratio(self, states: Sequence[State], x: Array, control: float) -> float:
        """Return the error of a step, at its end or persistent, over its tolerance; x: shape (n,). 0 if no time passes.
        """
        time = self._problem.history.time_at(control)
        past = predictor.recent_states(states, time, degree=1)
        end = State(x, control, x, 0.0, time=time)
        middle = (past[-1].time + time) / 2
        share = predictor.weights([*past, end], middle) if time > past[-1].time else np.array([])
        once, lasting = self._problem.history.step_error(past, share, x, control)
        return max(once / self._once, lasting / self._adding_up)


class Cutback(Exception):
    """Exception for a step that is too long: the step is repeated with `part` of its length.

    lasts: True if later steps must be shorter, too. control: control at which the repeated step ends; None: it ends at
    its arc length. A step in time needs the control if the body moves at once when the step begins: the arc length then
    says little about the time.
    """

    def __init__(self, why: str, part: float, lasts: bool = False, control: float | None = None):
        super().__init__(why)
        self.part, self.lasts, self.control = part, lasts, control
