"""Key numbers of a formed part with their units, for printing and for the rows of a report."""

from __future__ import annotations

from ..units import Units


class KeyNumbers:
    """Base class of sets of key numbers; as text, a set is a table with one row per number.

    Attributes:
        units: units of the printed values.
    """

    units: Units

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Rows of the printed table: pairs (name, value with its unit)."""
        raise NotImplementedError

    def __str__(self) -> str:
        width = max(len(what) for what, _ in self.rows)
        return "\n".join(f"{what:{width}}  {value}" for what, value in self.rows)

    __repr__ = __str__

    def _length(self, value: float) -> str:
        """Return a length as text with its unit."""
        return self._with_unit(value, self.units.length or "")

    def _with_unit(self, value: float, unit: str) -> str:
        """Return a value as text with five digits and its unit."""
        return f"{value:{'.5g' if abs(value) < 1e5 else '.0f'}} {unit}".rstrip()


class PartNumbers(KeyNumbers):
    """Base class of the key numbers of a part, for sections and for sheets in three dimensions.

    Attributes:
        volume: volume of the part, length^3.
        area: area of the middle surface, length^2.
        draw_ratio: area over the reference area of the same material (areal draw ratio).
        mean_wall: volume over area, length.
        min_wall: minimum wall, length.
        uniformity: minimum wall over mean wall.
        variation: coefficient of variation of the wall over the middle surface: standard deviation over mean value.
        weight: weight in grams, or None without a density.
        scrap: fraction of the undeformed volume, and so of the weight, of the whole sheet that lies beyond the trim.
        basis: reference of volume, area and weight as text, such as "the part, per mm of depth"; "" for a part that is
            modelled whole.
    """

    volume: float
    area: float
    draw_ratio: float
    mean_wall: float
    min_wall: float
    uniformity: float
    variation: float
    weight: float | None
    scrap: float
    basis: str

    @property
    def weight_label(self) -> str:
        """Label of the weight in the printed table: "weight", with a note if lengths have no unit and count as cm."""
        return "weight" + ", lengths taken for cm" * (not self.units.length)

    def _rows(self, where: str, further: list[tuple[str, str]]) -> list[tuple[str, str]]:
        """Return rows (name, value with unit) with `further` ones before the scrap; where: place of the minimum."""
        rows = [("given for", self.basis)] if self.basis else []
        if self.weight is not None:
            rows += [(self.weight_label, self._with_unit(self.weight, self.units.weight))]
        if self.min_wall == self.min_wall:                   # not of a block
            rows += [("minimum wall", f"{self._length(self.min_wall)} at {where}"),
                     ("mean wall", self._length(self.mean_wall)),
                     ("uniformity (minimum over mean wall)", f"{self.uniformity:.4g}"),
                     ("coefficient of variation of the wall", f"{self.variation:.4g}")]
        rows += [("areal draw ratio", f"{self.draw_ratio:.4g}"),
                 ("volume", self._with_unit(self.volume, self.units.volume)),
                 ("area of the middle surface", self._with_unit(self.area, self.units.area)), *further]
        return rows + ([("scrap, of the sheet's weight", f"{100 * self.scrap:.3g} %")] if self.scrap else [])
