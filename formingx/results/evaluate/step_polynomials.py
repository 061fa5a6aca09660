"""Polynomials in one parameter, which interpolate quantities between the start and the end of a step."""

from typing import Any, NamedTuple

import numpy as np

GAUSS = tuple((1 + s) / 2 for s in (-(0.6**0.5), 0.0, 0.6**0.5)), (5 / 18, 8 / 18, 5 / 18)
"""Points and weights of Gauss quadrature with three points on 0 <= s <= 1."""


class Polynomial(NamedTuple):
    """Polynomial in a parameter s, 0 <= s <= 1.

    Attributes:
        coefficients: coefficients in ascending order of powers, numbers or arrays of one shape.
    """

    coefficients: tuple

    def value(self, s: float) -> Any:
        """Return the value of the polynomial at s, a number or an array."""
        return sum(c * s**k for k, c in enumerate(self.coefficients))

    def slope(self, s: float) -> Any:
        """Return the derivative of the polynomial at s, a number or an array."""
        return sum(k * c * s ** (k - 1) for k, c in enumerate(self.coefficients) if k)


def interpolate(a: Any, b: Any, start: Any = None, end: Any = None) -> Polynomial:
    """Return the line, parabola or cubic with values a, b at s = 0 and 1 and none, one or two end slopes."""
    change = b - a
    if start is None and end is None:
        return Polynomial((a, change))
    if end is None:
        return Polynomial((a, start, change - start))
    if start is None:
        return Polynomial((a, 2 * change - end, end - change))
    return Polynomial((a, start, 3 * change - 2 * start - end, start + end - 2 * change))


def integral(f: Polynomial, y: Polynomial) -> float:
    """Return the integral of f . dy/ds over s from 0 to 1, exact for cubics of numbers or arrays of one shape."""
    return float(sum(w * np.sum(f.value(s) * y.slope(s)) for s, w in zip(*GAUSS)))
