"""Key numbers of a part, with their units: printed one a line, and rows of a report."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..units import Units


def without_round_off(point: Any, points: Any) -> tuple[float, ...]:
    """Return a point's coordinates, 0 where they are 1e-12 or less of the extent of points, shape (n, coordinates)."""
    return tuple(float(x) if abs(x) > 1e-12 * np.ptp(points) else 0.0 for x in point)


class KeyNumbers:
    """Prints its `rows`; `units`: of the labels."""

    units: Units

    @property
    def rows(self) -> list[tuple[str, str]]:
        """(what, its value with its unit), for people."""
        raise NotImplementedError

    def __str__(self) -> str:
        width = max(len(what) for what, _ in self.rows)
        return "\n".join(f"{what:{width}}  {value}" for what, value in self.rows)

    __repr__ = __str__

    def _length(self, value: float) -> str:
        return self._said(value, self.units.length or "")

    def _said(self, value: float, unit: str) -> str:
        return f"{value:{'.5g' if abs(value) < 1e5 else '.0f'}} {unit}".rstrip()


class PartNumbers(KeyNumbers):
    """Common base of a part of a section and of a sheet in three dimensions."""

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
        """The words before the weight."""
        return "weight" + ", lengths taken for cm" * (not self.units.length)

    def _rows(self, where: str, more: list[tuple[str, str]]) -> list[tuple[str, str]]:
        """Return the rows; where: place of the minimum wall, as text; more: rows of one kind of part alone."""
        rows = [("given for", self.basis)] if self.basis else []
        rows += [(self.weight_label, self._said(self.weight, self.units.weight))] if self.weight is not None else []
        rows += [("minimum wall", f"{self._length(self.min_wall)} at {where}"),
                 ("mean wall", self._length(self.mean_wall)),
                 ("uniformity (minimum over mean wall)", f"{self.uniformity:.4g}"),
                 ("coefficient of variation of the wall", f"{self.variation:.4g}"),
                 ("areal draw ratio", f"{self.draw_ratio:.4g}"),
                 ("volume", self._said(self.volume, self.units.volume)),
                 ("area of the middle surface", self._said(self.area, self.units.area)), *more]
        return rows + ([("scrap, of the sheet's volume", f"{100 * self.scrap:.3g} %")] if self.scrap else [])
