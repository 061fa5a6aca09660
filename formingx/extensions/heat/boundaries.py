"""Thermal properties of a body, and the laws of heat at its faces and in its interior.

A flux is heat into the body per deformed area and time. All numbers are in one consistent set of units, with the mesh's
unit of length. A `table` over the reference radius is a `formingx.table`, for sections; for sheets in three dimensions
`formingx.zones` is a table over x and y.
"""

from typing import Any

from ...errors import InputError, finite, non_negative, positive
from ...values.table import Table
from ...values.zones import Zones

Parameter = float | Table | Zones
"""Parameter of a law of heat: a number, a table over R in a section, or zones over x and y in three dimensions."""

STEFAN_BOLTZMANN = 5.670374419e-8
"""Stefan-Boltzmann constant, W/(m2 K4)."""


def numbers_of(parameter: Parameter) -> list[float]:
    """Return the values of a parameter of a law of heat: one number, or all entries of its table or zones."""
    if isinstance(parameter, Zones):
        return [float(value) for value in parameter.values.ravel()]
    return [float(value) for value in parameter.y] if isinstance(parameter, Table) else [float(parameter)]


def is_implausible(biot_number: float) -> bool:
    """Return True for a finite Biot number above 1e4, that of 1e6 W/(m2 K) and 2 mm of a polymer."""
    return 1e4 < biot_number < float("inf")


def law_name(kind: str, on: str, name: Any) -> str | None:
    """Return the checked name of a law of heat, or None; `kind` and `on` are for the message."""
    if name is not None and (not isinstance(name, str) or not name):
        raise InputError(f"{kind}({on!r}): name = {name!r}: must be a word")
    return name


class ThermalProperties:
    """Thermal properties of a material, in one consistent set of units (in SI: W/(m K), kg/m3, J/(kg K)).

    Args:
        conductivity: k, heat per time, length and degree.
        density: density of the reference body, mass per volume.
        heat_capacity: specific heat capacity, heat per mass and degree.

    Raises:
        InputError: a number that is not positive.

    >>> fx.ThermalProperties(conductivity=0.2e-3, density=1e-3, heat_capacity=2.0)      # W/(mm K), g/mm3, J/(g K)
    ThermalProperties(conductivity=0.0002, density=0.001, heat_capacity=2.0)
    """

    def __init__(self, *, conductivity: float, density: float, heat_capacity: float):
        self.conductivity = positive("ThermalProperties: conductivity", conductivity)
        self.density = positive("ThermalProperties: density", density)
        self.heat_capacity = positive("ThermalProperties: heat_capacity", heat_capacity)

    @property
    def diffusivity(self) -> float:
        """Thermal diffusivity k/(density heat_capacity), length^2/time."""
        return self.conductivity / (self.density * self.heat_capacity)

    def __repr__(self) -> str:
        return (f"ThermalProperties(conductivity={self.conductivity!r}, density={self.density!r},"
                f" heat_capacity={self.heat_capacity!r})")


class _Boundary:
    """Law of heat at a face, with parameters that are constant or vary with the reference position.

    Args:
        on: name of the boundary.
        name: name of the law for `Stage.inactive`, or None.
        parameters: numbers, tables over R or zones over x and y, by name.

    Attributes:
        on: name of the boundary.
        name: name of the law, or None.
        parameters: {name: number, `Table` over R or `Zones`}.
        temperatures: names of the parameters that are temperatures.
        quadrature_degree: degree of the quadrature of the flux along an edge.

    Raises:
        InputError: a parameter that is neither a finite number nor a table.
    """

    parameters: dict[str, Parameter]
    temperatures: tuple[str, ...] = ()
    quadrature_degree = 5

    def __init__(self, on: str, name: str | None, **parameters: Any):
        self.on, self.name = on, law_name(type(self).__name__, on, name)
        caller = f"{type(self).__name__}({on!r})"
        self.parameters = {name: value if isinstance(value, Table | Zones) else finite(f"{caller}: {name}", value)
                           for name, value in parameters.items()}

    def _check_range(self, name: str, low: float, high: float = float("inf")) -> None:
        """Raise an InputError unless the values of the parameter `name` lie between `low` and `high`."""
        for number in numbers_of(self.parameters[name]):
            if not low <= number <= high:
                allowed = f"at least {low:g}" if high == float("inf") else f"from {low:g} to {high:g}"
                raise InputError(f"{type(self).__name__}({self.on!r}): {name} = {number!r}: must be {allowed}")

    def check(self, mesh: Any, absolute_zero: float) -> None:
        """Raise an InputError if a temperature is below absolute zero, or a table does not fit the boundary.

        A section takes tables over R that cover it, a sheet in three dimensions zones over x and y.

        Args:
            mesh: the `Mesh`, which must have the boundary.
            absolute_zero: absolute zero in the unit of temperatures.
        """
        in_space = mesh.domain.geometry.dim == 3
        for name, value in self.parameters.items():
            if name in self.temperatures:
                self._check_range(name, absolute_zero)
            if isinstance(value, Table if in_space else Zones):
                allowed = ("a sheet in three dimensions takes fx.zones(x, y, values)" if in_space else
                           "a section takes a table over R, fx.table({R: value})")
                raise InputError(f"{self!r}: {name}: {allowed}")
            if isinstance(value, Table):
                value.check(mesh.nodes_of(self.on)[:, 0], f"R on {self.on!r}")

    def __repr__(self) -> str:
        named = {"name": self.name} if self.name else {}
        values = ", ".join(f"{k}={v!r}" for k, v in {**self.parameters, **named}.items())
        return f"{type(self).__name__}({self.on!r}, {values})"


class Convection(_Boundary):
    """Convection at a face.

    .. math:: q = h (T_{air} - T)

    Args:
        on: name of the boundary.
        h: heat transfer coefficient, heat per time, area and degree, number, `table` over the reference radius, or
            `zones`.
        air: temperature of the air, number, `table` over the reference radius, or `zones`.
        name: name of the law, for `Stage.inactive`; None: it acts in all stages.

    Raises:
        InputError: a negative h, or a value that is neither a finite number nor a table.

    >>> fx.Convection("top", h=2e-5, air=fx.table({0.0: 25.0, 10.0: 20.0}))              # W/(mm2 K); by R
    Convection('top', h=2e-05, air=table({0: 25, 10: 20}))
    """

    temperatures = ("air",)

    def __init__(self, on: str, *, h: Parameter, air: Parameter, name: str | None = None):
        super().__init__(on, name, h=h, air=air)
        self._check_range("h", 0.0)

    def flux(self, T, absolute_zero, h, air):
        """Return the heat flux h (air - T) into the face.

        Args:
            T: temperature of the face (UFL scalar).
            absolute_zero: not used.
            h: heat transfer coefficient (UFL scalar), heat per time, area and degree.
            air: temperature of the air (UFL scalar).

        Returns:
            Flux (UFL scalar), heat per time and area.
        """
        return h * (air - T)


class Radiation(_Boundary):
    r"""Radiation from a black heater to a grey face.

    .. math:: q = f \epsilon \sigma (T_{heater}^4 - T^4)

    T is the absolute temperature of the face; the run converts temperatures in degrees Celsius.

    Args:
        on: name of the boundary.
        emissivity: emissivity epsilon of the face, from 0 to 1, number, `table` over the reference radius, or `zones`.
        heater: temperature of the heater in the unit of the run, number, `table` over the reference radius, or `zones`.
        view_factor: view factor f, from 0 to 1, number, `table` over the reference radius, or `zones`.
        stefan_boltzmann: sigma in the units of the run: 5.670374419e-8 in W/(m2 K4), 5.670374419e-14 in W/(mm2 K4).
        name: name of the law, for `Stage.inactive`; None: it acts in all stages.

    Raises:
        InputError: an emissivity or view factor that is not between 0 and 1, or a value that is neither a finite number
            nor a table.

    >>> fx.Radiation("top", emissivity=0.9, heater=600.0, stefan_boltzmann=5.67e-14)      # W/(mm2 K4)
    Radiation('top', emissivity=0.9, heater=600.0, view_factor=1.0, stefan_boltzmann=5.67e-14)
    """

    temperatures = ("heater",)
    quadrature_degree = 9                          # T^4 on P2 edges

    def __init__(self, on: str, *, emissivity: Parameter, heater: Parameter, view_factor: Parameter = 1.0,
                 stefan_boltzmann: float = STEFAN_BOLTZMANN, name: str | None = None):
        super().__init__(on, name, emissivity=emissivity, heater=heater, view_factor=view_factor,
                         stefan_boltzmann=positive(f"Radiation({on!r}): stefan_boltzmann", stefan_boltzmann))
        self._check_range("emissivity", 0.0, 1.0)
        self._check_range("view_factor", 0.0, 1.0)

    def flux(self, T, absolute_zero, emissivity, heater, view_factor, stefan_boltzmann):
        """Return the heat flux into the face, proportional to heater^4 - T^4 in absolute temperatures.

        Args:
            T: temperature of the face (UFL scalar).
            absolute_zero: absolute zero in the unit of temperatures.
            emissivity: emissivity of the face, from 0 to 1 (UFL scalar).
            heater: temperature of the heater (UFL scalar).
            view_factor: view factor, from 0 to 1 (UFL scalar).
            stefan_boltzmann: Stefan-Boltzmann constant in the units of the run.

        Returns:
            Flux (UFL scalar), heat per time and area.
        """
        kelvin = (heater - absolute_zero, T - absolute_zero)
        return view_factor * emissivity * stefan_boltzmann * (kelvin[0] ** 4 - kelvin[1] ** 4)


class HeatFlux(_Boundary):
    """Prescribed heat flux into a face.

    Args:
        on: name of the boundary.
        flux: heat per time and deformed area, number, `table` over the reference radius, or `zones`; positive into the
            body.
        name: name of the law, for `Stage.inactive`; None: it acts in all stages.

    Raises:
        InputError: a flux that is neither a finite number nor a table.

    >>> fx.HeatFlux("top", flux=1e-3)
    HeatFlux('top', flux=0.001)
    """

    def __init__(self, on: str, *, flux: Parameter, name: str | None = None):
        super().__init__(on, name, flux=flux)

    def flux(self, T, absolute_zero, flux):
        """Return the prescribed heat flux into the face.

        Args:
            T: not used.
            absolute_zero: not used.
            flux: prescribed flux (UFL scalar), heat per time and area.

        Returns:
            The argument `flux`.
        """
        return flux


class FixedTemperature(_Boundary):
    """Prescribed temperature of a face from the start of the run.

    Args:
        on: name of the boundary.
        temperature: temperature of the face, number, `table` over the reference radius, or `zones`.

    Raises:
        InputError: a temperature that is neither a finite number nor a table.

    >>> fx.FixedTemperature("rim", temperature=80.0)
    FixedTemperature('rim', temperature=80.0)
    """

    temperatures = ("temperature",)

    def __init__(self, on: str, *, temperature: Parameter):
        super().__init__(on, None, temperature=temperature)


class Absorption:
    r"""Radiation that passes through a face and is absorbed below it (Beer-Lambert law).

    The heat per deformed volume and time at a distance x from the deformed face is

    .. math:: s = q \, a \exp(-a x)

    Radiation that reaches the opposite face leaves the body there. For radiation from both sides give one law per face.

    Args:
        on: name of the boundary through which the radiation enters.
        flux: incoming radiation q, heat per time and deformed area.
        coefficient: absorption coefficient a, 1/length, positive.
        name: name of the law, for `Stage.inactive`; None: it acts in all stages.

    Raises:
        InputError: a negative flux, or a coefficient that is not positive.

    >>> fx.Absorption("top", flux=2e-3, coefficient=1.5)                           # W/mm2, 1/mm
    Absorption('top', flux=0.002, coefficient=1.5)
    """

    def __init__(self, on: str, *, flux: float, coefficient: float, name: str | None = None):
        self.on, self.name = on, law_name("Absorption", on, name)
        self.flux = non_negative(f"Absorption({on!r}): flux", flux)
        self.coefficient = positive(f"Absorption({on!r}): coefficient", coefficient)

    def __repr__(self) -> str:
        named = f", name={self.name!r}" * bool(self.name)
        return f"Absorption({self.on!r}, flux={self.flux!r}, coefficient={self.coefficient!r}{named})"
