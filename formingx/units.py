"""Names of the units of a script, for labels and for the weight of a part. Numbers are not converted."""

from dataclasses import dataclass
from typing import Any

from .errors import InputError, check_name, finite

# lengths in m, stresses in Pa; kg/cm2 is the technical atmosphere of the older literature (kgf/cm2)
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
STRESSES = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm2": 1e6, "bar": 1e5, "atm": 101325.0,
            "psi": 6894.757293168, "kg/cm2": 98066.5, "kgf/cm2": 98066.5}
FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "kgf": 9.80665, "lbf": 4.4482216152605}
_ENERGIES = {"J": 1.0, "kJ": 1e3, "MJ": 1e6, "mJ": 1e-3, "uJ": 1e-6}
_KINDS = (("pressure", "stress"), ("stress", "stress"), ("force", "force"), ("energy", "energy"), ("work", "energy"),
          ("power", "power"), ("volume", "volume"), ("area", "area"), ("travel", "length"),
          ("height", "length"), ("contact_length", "length"), ("arc_length", "length"), ("reference_length", "length"),
          ("penetration", "length"), ("displacement", "length"), ("radius", "length"), ("wall", "length"),
          ("gap", "length"), ("resultant", "tension"),
          ("thickness", "length"), ("process_time", "time"), ("temperature", "temperature"))
_COORDINATES = {*"rzxyRZXY", "r_bottom", "z_bottom", "r_top", "z_top", "sag"}


@dataclass(frozen=True)
class Units:
    """Names of the units of the numbers of a script, for labels; numbers are not converted.

    Attributes:
        length: "m", "cm", "mm", "um", "in" or "ft"; None if not given.
        stress: "Pa", "kPa", "MPa", "GPa", "N/mm2", "bar", "atm", "psi", "kg/cm2" or "kgf/cm2"; None if not given.
        time: name of the unit of process time.

    Raises:
        InputError: a unit is unknown.

    >>> units = fx.Units(length="mm", stress="MPa")
    >>> units.force
    'N'
    """

    length: str | None = None
    stress: str | None = None
    time: str = "s"

    def __post_init__(self) -> None:
        for kind, unit, names in (("length", self.length, LENGTHS), ("stress", self.stress, STRESSES)):
            if unit is not None:
                check_name(f"Units: {kind}", unit, names)
        if not isinstance(self.time, str):
            raise InputError(f"Units: time = {self.time!r}: must be a word, such as 's'")

    def __bool__(self) -> bool:
        return self.length is not None or self.stress is not None

    @property
    def area(self) -> str:
        """Unit of areas, such as "mm2"; "" if the unit of length is not given."""
        return self._whole(f"{self.length}2" if self.length else "")

    @property
    def volume(self) -> str:
        """Unit of volumes, such as "mm3"; "" if the unit of length is not given."""
        return self._whole(f"{self.length}3" if self.length else "")

    @property
    def weight(self) -> str:
        """Unit of weights, "g"; in plane strain per unit depth, such as "g/mm"."""
        return self._whole("g")

    @property
    def force(self) -> str:
        """Unit of forces, stress length^2: "N" for mm and MPa, "lbf" for in and psi; "" if a unit is not given."""
        return self._whole(self._derived(FORCES, 2))

    @property
    def tension(self) -> str:
        """Unit of forces per length, stress length: "MPa mm" for mm and MPa; "" if a unit is not given."""
        return self._derived({}, 1).removesuffix("1")

    @property
    def energy(self) -> str:
        """Unit of energies, stress length^3: "mJ" for mm and MPa; "" if a unit is not given."""
        return self._whole(self._derived(_ENERGIES, 3))

    def per_depth(self) -> "Units":
        """Return these units for plane strain, where forces, energies, volumes and areas are per unit depth.

        >>> fx.Units(length="mm", stress="MPa").per_depth().force
        'N/mm'
        """
        return _UnitsPerDepth(self.length, self.stress, self.time)

    def _whole(self, unit: str) -> str:
        """Return the unit of an integral over the whole body, such as "N"; the subclass divides it by the depth."""
        return unit

    @property
    def power(self) -> str:
        """Unit of energies per process time: "mJ/s" for mm, MPa and s; "" if a unit is not given."""
        return f"{self.energy}/{self.time}" if self.energy else ""

    def mass(self, volume: float, density: float) -> float:
        """Return the mass of a volume in grams, in plane strain per unit depth.

        Args:
            volume: volume, length^3; in cm^3 if the unit of length is not given.
            density: density, g/cm3.

        Returns:
            The mass, g; in plane strain g per unit of depth.

        Raises:
            InputError: a number is not finite, or the density is above 22.6 g/cm3.
        """
        volume, density = finite("mass: volume", volume), finite("mass: density", density)
        if density > _DENSITY_OF_OSMIUM:
            raise InputError(f"density = {density:g}: must be in g/cm3 (water has 1, osmium {_DENSITY_OF_OSMIUM:g})")
        return volume * (LENGTHS[self.length or "cm"] / LENGTHS["cm"]) ** 3 * density

    def unit_of(self, column: str) -> str:
        """Return the unit of a column of results; "" for dimensionless columns, or if a unit is not given.

        Args:
            column: name of the column.
        """
        if column in _COORDINATES or column.startswith("u_"):
            return self.length or ""
        if column.endswith(("ratio", "stretch", "error")):
            return ""
        kind = next((kind for end, kind in _KINDS if column.endswith(end) or column.startswith(f"{end}_of")), None)
        return {"temperature": ""}.get(kind, getattr(self, kind) or "") if kind else ""

    def label(self, column: str, words: str = "") -> str:
        """Return the name of a column with spaces and its unit, such as "plug force, N".

        Args:
            column: name of the column.
            words: text in place of the name; "" for the name.
        """
        unit = self.unit_of(column)
        return (words or column.replace("_", " ")) + (f", {unit}" if unit else "")

    def heading(self, column: str) -> str:
        """Return the name of a column with its unit for a file, such as "plug_force [N]".

        Args:
            column: name of the column.
        """
        unit = self.unit_of(column)
        return f"{column} [{unit}]" if unit else column

    def _derived(self, names: dict[str, float], power: int) -> str:
        """Return the unit of stress times a power of length; a name {unit: size in SI} of equal size is preferred."""
        if not (self.length and self.stress):
            return ""
        size = STRESSES[self.stress] * LENGTHS[self.length] ** power
        exact = (name for name, unit in names.items() if abs(unit / size - 1) < 1e-9)
        return next(exact, f"{self.stress} {self.length}{power}")


class _UnitsPerDepth(Units):
    """Units of the numbers of a script in plane strain, per unit depth."""

    def _whole(self, unit: str) -> str:
        """Return the unit of an integral over a body, such as "N", divided by the unit of the depth: "N/mm"."""
        return f"{unit}/{self.length or 'cm'}" if unit else ""


_DENSITY_OF_OSMIUM = 22.6
"""Density of osmium, the densest of all materials, g/cm3."""

NONE: Any = Units()
"""Units of a script that states none."""
