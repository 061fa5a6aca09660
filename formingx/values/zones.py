"""Table of a quantity over the plane of a sheet, such as the temperatures of the zones of a heater."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, as_list, check_type, finite
from ..io import csv_files


class Zones:
    """Table over x and y, for a law of heat of a sheet in three dimensions (see `zones`).

    Args:
        x: coordinates x of the columns of the grid, shape (k,), ascending, length.
        y: coordinates y of the rows of the grid, shape (l,), ascending, length.
        values: values at the points of the grid, shape (l, k).

    Attributes:
        x: coordinates x, shape (k,), length.
        y: coordinates y, shape (l,), length.
        values: values at the points of the grid, shape (l, k).
    """

    def __init__(self, x: ArrayLike, y: ArrayLike, values: ArrayLike):
        self.x, self.y = (_ascending(name, given) for name, given in (("x", x), ("y", y)))
        try:
            self.values = np.array(values, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"zones: values = {values!r}: must be a row of numbers for each y") from None
        if self.values.shape != (len(self.y), len(self.x)) or not np.isfinite(self.values).all():
            raise InputError(f"zones: values has the shape {self.values.shape}: must be {len(self.y)} rows, one for"
                             f" each y, of {len(self.x)} finite numbers, one for each x")

    def __call__(self, x: ArrayLike, y: ArrayLike) -> np.ndarray:
        """Return the values at positions x and y, of their shape; beyond the grid the value of its nearest edge.

        Args:
            x: coordinates, any shape, length.
            y: coordinates, the shape of `x`, length.
        """
        i, s = _cell(self.x, np.asarray(x, dtype=float))
        j, t = _cell(self.y, np.asarray(y, dtype=float))
        right, up = np.minimum(i + 1, len(self.x) - 1), np.minimum(j + 1, len(self.y) - 1)
        z = self.values
        return np.asarray((1 - t) * ((1 - s) * z[j, i] + s * z[j, right])
                          + t * ((1 - s) * z[up, i] + s * z[up, right]))

    def __repr__(self) -> str:
        return (f"zones({len(self.x)} x {len(self.y)}, from {self.values.min():.6g} to {self.values.max():.6g};"
                f" x from {self.x[0]:g} to {self.x[-1]:g}, y from {self.y[0]:g} to {self.y[-1]:g})")


def zones(x: Any, y: ArrayLike | None = None, values: ArrayLike | None = None, *, column: str = "value") -> Zones:
    """Return a table over x and y, such as the temperatures of the zones of a heater above a sheet.

    x and y are the centres of the zones. Between them the values are bilinear, beyond the outer ones constant.

    Args:
        x: centres of the zones along x, shape (k,), length; or the name of a CSV file with the columns x, y and
            `column`, a row for each zone.
        y: centres of the zones along y, shape (l,), length; None with a file.
        values: a row of k values for each y, shape (l, k); None with a file.
        column: name of the column of the file with the values.

    Returns:
        The table, for a parameter of `Convection`, `Radiation` or `HeatFlux`.

    Raises:
        InputError: coordinates that are not ascending, a value that is missing or not finite, or a file that cannot be
            read.

    >>> heater = fx.zones(x=[0.0, 60.0], y=[0.0, 40.0], values=[[620.0, 560.0], [580.0, 520.0]])
    >>> float(heater(30.0, 20.0))
    570.0
    """
    if y is None and values is None:
        return _from_file(x, check_type("zones: column", column, str, "the name of a column"))
    if y is None or values is None:
        raise InputError("zones: y and values: must be given together, or a CSV file alone")
    return Zones(x, y, values)


def _from_file(file: Any, column: str) -> Zones:
    """Return the table of a CSV file with the columns x, y and `column`; its rows must form a grid."""
    table = csv_files.read(file)
    x, y, found = (table.take(name) for name in ("x", "y", column))
    across, i = np.unique(x, return_inverse=True)
    along, j = np.unique(y, return_inverse=True)
    values = np.full((len(along), len(across)), np.nan)
    for row, (a, b) in enumerate(zip(j.ravel(), i.ravel())):
        if np.isfinite(values[a, b]):
            raise InputError(f"{table.name}: two rows have x = {x[row]:.6g} and y = {y[row]:.6g}: must be one")
        values[a, b] = found[row]
    if not np.isfinite(values).all():
        a, b = np.argwhere(~np.isfinite(values))[0]
        raise InputError(f"{table.name}: no row has x = {across[b]:.6g} and y = {along[a]:.6g}: zones must form a grid,"
                         f" here {len(across)} x {len(along)}")
    return Zones(across, along, values)


def _ascending(name: str, given: Any) -> np.ndarray:
    """Return coordinates as an array, shape (k,); raise an InputError unless they are finite and ascending."""
    found = np.array([finite(f"zones: {name}", value) for value in as_list(f"zones: {name}", given, "numbers")])
    if not len(found) or np.any(np.diff(found) <= 0):
        raise InputError(f"zones: {name} = {given!r}: must be ascending coordinates")
    return found


def _cell(grid: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of the interval of a grid that contains each position, and the share within it (0 to 1)."""
    k = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, max(len(grid) - 2, 0))
    if len(grid) == 1:
        return k, np.zeros(np.shape(at))
    return k, np.clip((at - grid[k]) / (grid[k + 1] - grid[k]), 0.0, 1.0)
