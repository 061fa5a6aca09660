"""Columns of numbers as files that other programs open: CSV, and Excel."""

import math
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import NONE, Units
from . import tabular

_SHOWN = 10           # rows that are printed: the first and the last
_LONGEST = 32_767     # characters of a cell in Excel


class Sheet:
    """A table with named columns, one row to a place; `comm`: its rank 0 writes. Prints its first and last rows."""

    comm: Any

    @property
    def columns(self) -> dict[str, Any]:
        """Columns of the files: {name: values, shape (n,)}."""
        raise NotImplementedError

    def to_csv(self, file: Any, units: Units = NONE) -> None:
        """Write a CSV file, its name ending in .csv; `units` go into the header, as in "wall [mm]".

        Raises:
            InputError: the name ends otherwise. OSError: it cannot be written.
        """
        tabular.write_rows(file, self._header(units), self._rows(), self.comm)

    def to_excel(self, file: Any, units: Units = NONE) -> None:
        """Write an Excel file, its name ending in .xlsx.

        Raises:
            InputError: the name ends otherwise, openpyxl is not installed, or a text is none that Excel takes.
            OSError: it cannot be written.
        """
        file = tabular.named("to_excel", file, ".xlsx")
        try:
            from openpyxl import Workbook
            from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE
        except ImportError:
            raise InputError("to_excel: needs openpyxl, which is not installed; to_csv needs nothing") from None
        book = Workbook()
        sheet: Any = book.active
        for n, row in enumerate((self._header(units), *self._rows())):
            for name, cell in zip(self.columns, row):
                if isinstance(cell, str) and (len(cell) > _LONGEST or ILLEGAL_CHARACTERS_RE.search(cell)):
                    raise InputError(f"to_excel: column {name!r}, row {n}: {len(cell)} characters, {cell[:40]!r}...: an"
                                     f" Excel cell holds {_LONGEST}, and none that cannot be printed; to_csv writes it")
            sheet.append([v.item() if isinstance(v, np.generic) else v for v in row])
        sheet.freeze_panes = "A2"
        tabular.on_root(self.comm, lambda: tabular.replace(file, book.save, "wb"))

    def __str__(self) -> str:
        rows = [list(row) for row in zip(*map(_words, self.columns.values()), strict=True)]
        n, half = len(rows), _SHOWN // 2
        if n > _SHOWN + 1:
            rows[half:n - half] = [["..."] * len(self.columns)]
        lines = [list(self.columns), *rows]
        widths = [max(map(len, column)) for column in zip(*lines)]
        return "\n".join("  ".join(f"{cell:>{w}}" for cell, w in zip(line, widths)) for line in lines) + f"\n{n} rows"

    def __repr__(self) -> str:                               # shown by a notebook
        return str(self)

    def _header(self, units: Units) -> list[str]:
        return [units.heading(name) for name in self.columns]

    def _rows(self) -> list[tuple]:
        return list(zip(*self.columns.values(), strict=True))


def _words(column: Any) -> list[str]:
    """Numbers to the fifth digit of the largest in the column; words as they are."""
    values = np.asarray(column)
    if values.dtype.kind != "f":
        return [str(v) for v in values]
    largest = np.nanmax(np.abs(values), initial=0.0)
    places = 4 - math.floor(math.log10(largest)) if 0 < largest < math.inf else 0
    rounded = np.round(values, places) + 0.0                # no -0
    return [f"{v:.5g}" if abs(places) > 8 else f"{v:.{max(places, 0)}f}" for v in rounded]
