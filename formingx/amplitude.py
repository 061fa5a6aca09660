"""How far the things of a scene that can be driven are: all follow one dimensionless control."""

from __future__ import annotations

from typing import Any


class Amplitude:
    """One thing's value is scale (base + rate control): a driven one has base 0 and rate 1, one that waits rate 0.

    Args:
        scale: of the thing, in the user's units (stress for a pressure, length for a motion).
        constant: makes a number of the forms.
    """

    def __init__(self, scale: float, constant: Any):
        self.scale, self._factor = scale, constant(scale)
        self._base, self._rate = constant(0.0), constant(0.0)

    def form(self, control: Any) -> Any:
        """The value as UFL of the control."""
        return self._factor * (self._base + self._rate * control)

    def at(self, control: float) -> float:
        """Value over scale."""
        return float(self._base.value) + float(self._rate.value) * control

    @property
    def rate(self) -> float:
        """Derivative of `at` by the control."""
        return float(self._rate.value)

    @property
    def line(self) -> tuple[float, float]:
        """(base, rate)."""
        return float(self._base.value), self.rate

    @line.setter
    def line(self, line: tuple[float, float]) -> None:
        self._base.value, self._rate.value = line
