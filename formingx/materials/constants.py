"""Constants of a material that vary over the body.

A constant may be a number, a function of the reference position, called as f(R, Z) with arrays of shape (n,), a UFL
expression of the scene's mesh (a DOLFINx `Function` is one), a `table` over the temperature, the result of
`of_temperature`, or an object of a class made from `Varying`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import ufl

from .. import _compat
from ..errors import InputError, finite, known, values
from ..mesh.nodes import axes
from ..values.table import Table
from ..values.temperature import ABSOLUTE_ZERO, FunctionOfTemperature


class Sample(NamedTuple):
    """Sample of the body for the check of constants: points of the locally owned cells of a layer.

    Attributes:
        points: reference positions (R, Z), shape (m q, 2), length.
        cells: local numbers of the cells, shape (m,).
        places: positions of the q points in the reference cell, shape (q, 2).
        domain: the `dolfinx.mesh.Mesh`.
        temperature: temperatures at the points, shape (m q,); None: not given.
    """

    points: np.ndarray
    cells: np.ndarray
    places: np.ndarray
    domain: Any
    temperature: np.ndarray | None = None


class Varying(ABC):
    """A constant that varies."""

    @abstractmethod
    def values(self, sample: Sample) -> np.ndarray:
        """Return the values at the points of a sample, shape (n,): for checks, moduli and scales.

        Raises:
            InputError: it cannot be evaluated there.
        """

    @abstractmethod
    def expression(self, fields: Any) -> Any:
        """Return the constant in a form (UFL scalar).

        Args:
            fields: possible arguments of the constant: `fields.X`, the reference position (UFL, shape (2,)), and
                `fields.of_position(f)` and `fields.of_temperature(f)`, coefficients that hold f(R, Z) and f(T) at the
                quadrature points of the energy; the latter follows the temperature when that changes.
        """


class OfPosition(Varying):
    """f(R, Z) of the reference position; arrays of shape (n,) go in and come out."""

    def __init__(self, function: Callable):
        self.function = function

    def __call__(self, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        """Values, shape (n,), all finite."""
        return values(f"the constant {self!r}", self.function, {"R": R, "Z": Z})

    def values(self, sample):
        return values(f"the constant {self!r}", self.function, dict(zip(axes(sample.domain), sample.points.T)))

    def expression(self, fields):
        return fields.of_position(self)

    def __repr__(self) -> str:
        return getattr(self.function, "__qualname__", repr(self.function))


class OfTemperature(FunctionOfTemperature, Varying):
    """A constant that depends on the temperature of the scene, see `FunctionOfTemperature`."""

    def values(self, sample):
        if sample.temperature is None:
            raise InputError(f"the constant {self!r} depends on the temperature: give Scene a temperature=...")
        return self(sample.temperature)

    def expression(self, fields):
        return fields.of_temperature(self)


def of_temperature(function: Callable) -> OfTemperature:
    """Return a constant of a material, or a coefficient of friction, that depends on the temperature of the scene.

    Args:
        function: f(T), called with an array of temperatures, shape (n,), in the unit that the scene's are given in.

    >>> fx.NeoHookean(c10=fx.of_temperature(lambda T: 0.4 * np.exp(-(T - 150.0) / 20.0)))
    NeoHookean(c10=of_temperature(<lambda>))
    """
    if not callable(function):
        raise InputError(f"of_temperature({function!r}): must be a function of the temperature")
    return OfTemperature(function)


def entropic(value: float, reference: float, *, unit: str) -> OfTemperature:
    """Return a modulus in proportion to the absolute temperature, as of a network of flexible chains (Treloar 1975).

    Args:
        value: modulus at the temperature `reference`. unit: unit of temperatures, "C" or "K".

    >>> modulus = fx.entropic(1.0, 20.0, unit="C")
    >>> float(modulus(313.15).round(6))
    2.0
    """
    value, reference = finite("entropic: value", value), finite("entropic: reference", reference)
    known("entropic: unit", unit, ABSOLUTE_ZERO)
    zero = ABSOLUTE_ZERO[unit]
    if not reference > zero:
        raise InputError(f"entropic: reference = {reference!r}: must be above {zero:g}, absolute zero")
    return OfTemperature(lambda T: value * (T - zero) / (reference - zero),
                         f"entropic({value!r}, {reference!r}, unit={unit!r})")


class OfMesh(Varying):
    """A UFL scalar of the scene's own mesh."""

    def __init__(self, expression: Any):
        self._expression = expression

    def values(self, sample):
        domain = ufl.domain.extract_unique_domain(self._expression)
        if self._expression.ufl_shape != () or domain is not None and domain is not sample.domain.ufl_domain():
            raise InputError(f"the constant {self!r} must be a scalar of the scene's own mesh")
        compiled = _compat.compile_expression(self._expression, sample.places)         # by all ranks
        return compiled.eval(sample.domain, sample.cells).ravel() if len(sample.cells) else np.zeros(0)

    def expression(self, fields):
        return fields.of_mesh(self._expression)

    def __repr__(self) -> str:
        return str(self._expression)


def varying(value: Any) -> Varying | None:
    """Return a constant as `Varying`, or None if it does not vary."""
    if isinstance(value, Varying):
        return value
    if isinstance(value, ufl.core.expr.Expr):
        return OfMesh(value)
    if isinstance(value, Table):
        return OfTemperature(value)
    return OfPosition(value) if callable(value) else None
