"""Monotone interpolation of a quantity between a few points, such as a modulus at some temperatures."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from ..errors import InputError, finite


class Table:
    """Smooth curve y(x) through n points, monotone between successive points (see `table`).

    A table is called with numbers, shape (...), and returns values of this shape; or with a UFL expression,
    and returns an expression. Numbers outside the table are refused. Beyond the table an expression is extrapolated
    linearly, because an iteration may leave the table; `check` is called before a state is accepted.

    Args:
        points: {x: y}, at least two points.

    Attributes:
        x: arguments x of the points in ascending order, shape (n,).
        y: values y at these arguments, shape (n,).
        limits: smallest and largest argument x.
    """

    def __init__(self, points: Mapping[float, float]):
        if not isinstance(points, Mapping) or len(points) < 2:
            raise InputError(f"table({points!r}): must be {{x: y, ...}} with at least two points")
        pairs = sorted((finite("table: x", x), finite(f"table: y at {x!r}", y)) for x, y in points.items())
        self.x, self.y = (np.array(column) for column in zip(*pairs))
        if np.any(np.diff(self.x) <= 0):
            raise InputError(f"table({points!r}): two points have the same x")
        self.limits = float(self.x[0]), float(self.x[-1])

    def __call__(self, x: Any) -> Any:
        """Return the values of the curve at x, of the shape of x.

        Args:
            x: numbers, shape (...), or a UFL expression.

        Raises:
            InputError: a number lies outside the table.
        """
        if isinstance(x, ufl.core.expr.Expr):
            return self._expression(x)
        self.check(x)
        return self._curve(np.clip(x, self.x[0], self.x[-1]))

    def check(self, x: Any, name: str = "x") -> None:
        """Check that all numbers x lie between the smallest and the largest argument of the table.

        Args:
            x: numbers.
            name: name of x in the message.

        Raises:
            InputError: a number lies outside the table.
        """
        x = np.asarray(x, dtype=float)
        tolerance = 1e-9 * (self.x[-1] - self.x[0])
        outside = ~((x >= self.x[0] - tolerance) & (x <= self.x[-1] + tolerance))
        if np.any(outside):
            raise InputError(f"{self!r}: {name} = {x[outside].flat[0]:.6g}: must be from {self.x[0]:g} to"
                             f" {self.x[-1]:g}")

    @cached_property
    def _curve(self) -> Any:
        """Piecewise cubic Hermite interpolation of the points (Fritsch and Butland 1984), a function of x."""
        from scipy.interpolate import PchipInterpolator
        return PchipInterpolator(self.x, self.y)

    def _expression(self, x: Any) -> Any:
        """Return the curve at a UFL expression x, extrapolated linearly beyond the table, as a UFL expression."""
        # numbers as UFL constants: tables with as many points share one compiled form
        domain = ufl.domain.extract_unique_domain(x)
        slopes = self._curve.derivative()(self.x[[0, -1]])
        ends = fem.Constant(domain, np.array([self.x[[0, -1]], self.y[[0, -1]], slopes]).T.copy())
        pieces = fem.Constant(domain, np.vstack([self.x[:-1], self._curve.c]).T.copy())
        value = ends[1, 1] + ends[1, 2] * (x - ends[1, 0])
        upper = ends[1, 0]
        for k in reversed(range(len(self.x) - 1)):
            s = x - pieces[k, 0]
            cubic = ((pieces[k, 1] * s + pieces[k, 2]) * s + pieces[k, 3]) * s + pieces[k, 4]
            value = ufl.conditional(ufl.lt(x, upper), cubic, value)
            upper = pieces[k, 0]
        return ufl.conditional(ufl.lt(x, upper), ends[0, 1] + ends[0, 2] * (x - ends[0, 0]), value)

    def __repr__(self) -> str:
        return f"table({{{', '.join(f'{x:g}: {y:g}' for x, y in zip(self.x, self.y))}}})"


def table(points: Mapping[float, float]) -> Table:
    """Return a smooth curve y(x) through points, such as a modulus that depends on the temperature.

    Between two points it is a monotone cubic without overshoot (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5
    (1984) 300).

    Args:
        points: {x: y}, such as {temperature: modulus}.

    Raises:
        InputError: there are fewer than two points, or one is not two finite numbers.

    >>> modulus = fx.table({100.0: 2.0, 120.0: 1.0, 140.0: 0.4})
    >>> float(modulus(120.0)), bool(modulus(110.0) > 1.0)
    (1.0, True)
    """
    return Table(points)
