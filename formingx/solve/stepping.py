"""How long the next step is. No PETSc, no physics."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class StepControl:
    """Step length from the iterations of the last step, eq. (4.21) of Song (1993): target over actual.

    Attributes:
        length: the next step (dimensionless arc length: mean displacement over the size of the body).
        target: iterations that a step should take.
        growth: at most this factor from one step to the next; failures halve.
        smallest, largest: bounds of the length.
    """

    length: float = 0.1
    target: int = 4
    growth: float = 2.0
    smallest: float = 1e-6
    largest: float = float("inf")

    def accepted(self, iterations: int) -> None:
        """A full step converged in so many iterations."""
        factor = min(max(self.target / max(iterations, 1), 0.5), self.growth)
        self.length = min(self.length * factor, self.largest)

    def failed(self) -> bool:
        """Halve after a failure; False if the step is then too small to go on."""
        self.length /= 2
        return self.length >= self.smallest
