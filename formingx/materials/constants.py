"""Material constants that vary over the body.

Each constant of a material can be one of the following.

- A number.
- A function f(R, Z) of the reference position, called with arrays of shape (n,).
- A UFL expression of the scene's mesh, such as a DOLFINx `Function`.
- A `table` over the temperature, or the result of `of_temperature`.
- An object of a subclass of `Varying`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import ufl

from .. import _compat
from ..errors import InputError, check_name, finite, values
from ..mesh.nodes import arguments, axes
from ..values.table import Table
from ..values.temperature import ABSOLUTE_ZERO, FunctionOfTemperature


class Sample(NamedTuple):
    """Quadrature points of a layer at which the constants of its material are checked.

    They are q points in each of the m locally owned cells of the layer, cell by cell.

    Attributes:
        points: reference positions (R, Z) of the points, shape (m q, 2), length.
        cells: local numbers of the cells, shape (m,).
        places: positions of the points in the reference cell, shape (q, 2).
        domain: the `dolfinx.mesh.Mesh`.
        temperature: temperatures at the points, shape (m q,); None if the scene has no temperature.
    """

    points: np.ndarray
    cells: np.ndarray
    places: np.ndarray
    domain: Any
    temperature: np.ndarray | None = None


class Varying(ABC):
    """Base class of material constants that vary over the body, with position or temperature.

    Subclasses define `values`, for checks before a run, and `expression`, for the forms.
    """

    @abstractmethod
    def values(self, sample: Sample) -> np.ndarray:
        """Return the values of the constant at quadrature points, for checks, moduli and scales.

        Args:
            sample: n quadrature points of a layer, with their positions `points`, shape (n, 2), length. Their
                temperatures `temperature` have the shape (n,), or are None in a scene without temperature.

        Returns:
            Values, shape (n,).

        Raises:
            InputError: the constant has no value at a point.
        """

    @abstractmethod
    def expression(self, fields: Any) -> Any:
        """Return the constant as an expression for a UFL form.

        Args:
            fields: source of fields that the expression may use. `fields.X` is the reference position (UFL, shape
                (2,)). `fields.position_coefficient(f)` and `fields.temperature_coefficient(f)` are coefficients with
                the values f(R, Z) and f(T) at the quadrature points of the energy. The latter follows changes of the
                temperature.

        Returns:
            The constant (UFL scalar).
        """


class OfPosition(Varying):
    """Material constant f(R, Z), a function of two arrays (n,), length, that returns the constant, (n,)."""

    def __init__(self, function: Callable):
        self.function = function

    def __call__(self, *coordinates: np.ndarray) -> np.ndarray:
        """Return the constant at R and Z, or x, y and z, (n,) each, length, checked to be finite, shape (n,)."""
        return self.at(dict(zip("RZ" if len(coordinates) == 2 else "xyz", coordinates)))

    def at(self, coordinates: dict[str, np.ndarray]) -> np.ndarray:
        """Return the constant at reference positions given as {name of a coordinate: values, shape (n,), length}."""
        return values(f"the constant {self!r}", self.function, arguments(self.function, coordinates))

    def values(self, sample):
        return self.at(dict(zip(axes(sample.domain), sample.points.T)))

    def expression(self, fields):
        return fields.position_coefficient(self)

    def __repr__(self) -> str:
        return getattr(self.function, "__qualname__", repr(self.function))


class OfTemperature(FunctionOfTemperature, Varying):
    """Material constant that is a function f(T) of the temperature T of the scene.

    Args:
        function: the function f: a `Table`, or a function of an array of temperatures, shape (n,).
        words: name of the function in messages; default a name made from the function.
        limits: lowest and highest temperature at which f is known; default the limits of f, or none.
    """

    def values(self, sample):
        if sample.temperature is None:
            raise InputError(f"the constant {self!r} depends on the temperature: give Scene a temperature=...")
        return self(sample.temperature)

    def expression(self, fields):
        return fields.temperature_coefficient(self)


def of_temperature(function: Callable) -> OfTemperature:
    """Return a material constant, or a coefficient of friction, that depends on the temperature of the scene.

    Args:
        function: f(T), called with an array of temperatures, shape (n,), in the unit of the scene's temperature.

    Returns:
        The constant.

    Raises:
        InputError: `function` is not callable.

    >>> fx.NeoHookean(c10=fx.of_temperature(lambda T: 0.4 * np.exp(-(T - 150.0) / 20.0)))
    NeoHookean(c10=of_temperature(<lambda>))
    """
    if not callable(function):
        raise InputError(f"of_temperature({function!r}): must be a function of the temperature")
    return OfTemperature(function)


def entropic(value: float, reference: float, *, unit: str) -> OfTemperature:
    r"""Return a modulus proportional to the absolute temperature, as for a network of flexible chains (Treloar 1975).

    .. math:: G(T) = G_0 \, \frac{T - T_z}{T_0 - T_z}

    Here :math:`T_z` is absolute zero in the unit of the temperatures.

    Args:
        value: modulus :math:`G_0` at the reference temperature, stress.
        reference: reference temperature :math:`T_0`.
        unit: unit of temperatures, "C" or "K".

    Returns:
        The modulus as a function of the temperature.

    Raises:
        InputError: the reference temperature is not above absolute zero, or the unit is unknown.

    >>> modulus = fx.entropic(1.0, 20.0, unit="C")
    >>> float(modulus(313.15).round(6))
    2.0
    """
    value, reference = finite("entropic: value", value), finite("entropic: reference", reference)
    check_name("entropic: unit", unit, ABSOLUTE_ZERO)
    zero = ABSOLUTE_ZERO[unit]
    if not reference > zero:
        raise InputError(f"entropic: reference = {reference!r}: must be above {zero:g}, absolute zero")
    return OfTemperature(lambda T: value * (T - zero) / (reference - zero),
                         f"entropic({value!r}, {reference!r}, unit={unit!r})")


class OfMesh(Varying):
    """Material constant that is a UFL expression of the scene's own mesh. The expression is a scalar."""

    def __init__(self, expression: Any):
        self._expression = expression

    def values(self, sample):
        domain = ufl.domain.extract_unique_domain(self._expression)
        if self._expression.ufl_shape != () or domain is not None and domain is not sample.domain.ufl_domain():
            raise InputError(f"the constant {self!r} must be a scalar of the scene's own mesh")
        compiled = _compat.compile_expression(self._expression, sample.places)         # collective
        return compiled.eval(sample.domain, sample.cells).ravel() if len(sample.cells) else np.zeros(0)

    def expression(self, fields):
        return fields.mesh_coefficient(self._expression)

    def __repr__(self) -> str:
        return str(self._expression)


def varying(value: Any) -> Varying | None:
    """Return f(R, Z), a UFL expression or a `table` over the temperature as a `Varying`; None for a number."""
    if isinstance(value, Varying):
        return value
    if isinstance(value, ufl.core.expr.Expr):
        return OfMesh(value)
    if isinstance(value, Table):
        return OfTemperature(value)
    return OfPosition(value) if callable(value) else None
