"""How long the next step is. No PETSc, no physics."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import InputError, count, positive


@dataclass
class StepControl:
    """Step length from the iterations of the last step, eq. (4.21) of Song (1993): target over actual.

    Attributes:
        length: the next step (dimensionless arc length: mean displacement over the size of the body); at most
            `largest`.
        target: iterations that a step should take.
        growth: at most this factor from one step to the next, at least 1; failures halve.
        smallest, largest: a run gives up below the one; no step is longer than the other.

    Raises:
        InputError: a value that is not greater than 0, a growth below 1, or `smallest` above `largest`.
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
        """A full step converged in so many iterations with a tangent of their own; error: in time, over what is
        allowed."""
        factor = min(max(self.target / max(iterations, 1), 0.5), self.growth)
        factor = min(factor, 0.9 * max(error, 1e-9) ** (-1 / 3))
        self.length = min(self.length * factor, self.largest)

    def failed(self) -> bool:
        """Halve after a failure; False if the step is then too small to go on."""
        self.length /= 2
        return self.length >= self.smallest
