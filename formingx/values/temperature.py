"""Functions of the temperature, and time-temperature superposition."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from numpy.typing import ArrayLike

from ..errors import InputError, check_name, finite, positive, values
from .table import Table
from .tolerances import FAR

ABSOLUTE_ZERO = {"C": -273.15, "K": 0.0}
"""{unit of temperature: absolute zero in this unit}."""
DEGREES = {"C": "°C", "K": "K"}
"""{unit of temperature: its symbol in reports and pictures}."""
EVERYWHERE = (-np.inf, np.inf)
"""Lowest and highest temperature of a function that is known at all temperatures."""
GAS_CONSTANT = 8.31446261815324
"""Molar gas constant, J/(mol K)."""


class FunctionOfTemperature:
    """Function f(T) of the temperature T, in the unit of the scene. It is called with arrays of temperatures.

    Args:
        function: the function f: a `Table`, or a function of an array of temperatures, shape (n,), that returns values
            of this shape.
        words: name of the function in messages; default a name made from the function.
        limits: lowest and highest temperature at which f is known; default the limits of f, or none.

    Attributes:
        function: the function f.
        limits: lowest and highest temperature at which f is known; infinite without limits.
    """

    def __init__(self, function: Callable, words: str | None = None, limits: tuple[float, float] | None = None):
        self.function = function
        self.limits: tuple[float, float] = getattr(function, "limits", EVERYWHERE) if limits is None else limits
        self._words = words or (repr(function) if isinstance(function, Table)
                                else f"of_temperature({getattr(function, '__qualname__', repr(function))})")

    def __call__(self, temperature: ArrayLike) -> np.ndarray:
        """Return the values of the function at temperatures, of their shape.

        Raises:
            InputError: the function fails, or a value is not finite.
        """
        T = np.asarray(temperature, dtype=float)
        if isinstance(self.function, Table):
            self.function.check(T, "temperature")
        return values(f"the constant {self!r}", self.function, {"temperature": T})

    def clamped(self, temperature: ArrayLike) -> np.ndarray:
        """Return the values of the function at temperatures, of their shape; beyond `limits`, the value at the limit.

        A run uses it for a body whose temperature changes. A scene refuses an initial temperature beyond the limits. A
        check before the run reports temperatures of tools and air beyond them.

        Args:
            temperature: temperatures, any shape, in the unit of the scene.
        """
        return self(np.clip(temperature, *self.limits))

    def __repr__(self) -> str:
        return self._words


class WLF:
    r"""Shift factor aT of Williams, Landel and Ferry (J. Am. Chem. Soc. 77 (1955) 3701), a function of temperature.

    At the temperature T, relaxation times are aT times their values at the reference temperature Tr.

    .. math:: \log_{10} a_T = -\frac{c_1 (T - T_r)}{c_2 + T - T_r}

    It is called with numbers, shape (...), or with a UFL expression of the temperature. It is defined above Tr - c2,
    where aT becomes infinite. In a run, aT is at most 1e30, at the lower limit: a colder body does not relax.

    Attributes:
        limits: lowest and highest temperature in a run: the temperature at which aT is 1e30, and infinity.

    Args:
        c1: dimensionless constant for logarithms to base 10, above 0.
        c2: temperature difference, above 0, in the unit of the scene.
        reference: reference temperature Tr, in the unit of the scene.

    >>> slower = fx.WLF(c1=17.44, c2=51.6, reference=100.0)
    >>> round(float(np.log10(slower(110.0))), 4)
    -2.8312
    """

    def __init__(self, c1: float, c2: float, reference: float):
        self.c1, self.c2 = positive("WLF: c1", c1), positive("WLF: c2", c2)
        self.reference = finite("WLF: reference", reference)
        self.limits = self.reference - self.c2 + self.c1 * self.c2 / (math.log10(FAR) + self.c1), np.inf

    def __call__(self, temperature: ArrayLike) -> Any:
        """Return the shift factor aT at temperatures, of their shape.

        Args:
            temperature: numbers, shape (...), or a UFL expression.

        Raises:
            InputError: a number is not above Tr - c2.
        """
        above = _difference(self, temperature, self.reference - self.c2, "reference - c2")
        return _exp(-np.log(10) * self.c1 * (above - self.c2) / above)

    def __repr__(self) -> str:
        return f"WLF({self.c1!r}, {self.c2!r}, {self.reference!r})"


class Arrhenius:
    r"""Shift factor aT of Arrhenius, a function of temperature.

    At the absolute temperature T, relaxation times are aT times their values at the reference temperature Tr.

    .. math:: \ln a_T = \frac{E}{R} \left(\frac{1}{T} - \frac{1}{T_r}\right)

    R is the molar gas constant. The factor is called with numbers, shape (...), or with a UFL expression of the
    temperature, both in the unit `unit`.

    Args:
        activation_energy: activation energy E, J/mol, at least 1000; melts have 2e4 to 4e5.
        reference: reference temperature Tr, in the unit of `unit`.
        unit: unit of the temperatures of the scene, "C" or "K".

    >>> slower = fx.Arrhenius(80e3, 180.0, unit="C")
    >>> round(float(slower(170.0)), 4)
    1.6147
    """

    def __init__(self, activation_energy: float, reference: float, *, unit: str):
        check_name("Arrhenius: unit", unit, ABSOLUTE_ZERO)
        self.activation_energy, self.unit = positive("Arrhenius: activation_energy", activation_energy), unit
        if self.activation_energy < 1000:
            raise InputError(f"Arrhenius: activation_energy = {activation_energy!r}: must be in J/mol, at least 1000"
                             f" (melts have 2e4 to 4e5)")
        self.reference = finite("Arrhenius: reference", reference)
        _difference(self, self.reference, ABSOLUTE_ZERO[unit], "absolute zero")

    def __call__(self, temperature: ArrayLike) -> Any:
        """Return the shift factor aT at temperatures, of their shape.

        Args:
            temperature: numbers, shape (...), or a UFL expression.

        Raises:
            InputError: a number is not above absolute zero.
        """
        zero = ABSOLUTE_ZERO[self.unit]
        kelvin = _difference(self, temperature, zero, "absolute zero")
        return _exp(self.activation_energy / GAS_CONSTANT * (1 / kelvin - 1 / (self.reference - zero)))

    def __repr__(self) -> str:
        return f"Arrhenius({self.activation_energy!r}, {self.reference!r}, unit={self.unit!r})"


def _difference(shift: Any, temperature: Any, limit: float, what: str) -> Any:
    """Return temperatures, any shape or UFL, above the limit of a shift; another number is an InputError."""
    if isinstance(temperature, ufl.core.expr.Expr):
        return temperature - limit
    temperature = np.asarray(temperature, dtype=float)
    wrong = ~((temperature > limit) & np.isfinite(temperature))
    if np.any(wrong):
        raise InputError(f"{shift!r}: temperature = {temperature[wrong].flat[0]:.6g}: must be above {what},"
                         f" {limit:g}, and finite")
    return temperature - limit


def _exp(x: Any) -> Any:
    """Return the exponential of numbers or of a UFL expression."""
    return ufl.exp(x) if isinstance(x, ufl.core.expr.Expr) else np.exp(x)
