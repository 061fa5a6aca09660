"""Base class of tables that print, and that are written as CSV or Excel files."""

import math
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import NONE, Units
from . import tabular

PRINTED_ROWS = 10        # number of printed rows, half of them at the beginning and half at the end
_LONGEST = 32_767  # largest number of characters in a cell of Excel


class ColumnTable:
    """Base class of tables with named columns. As text, a table shows at most its first and last five rows.

    Attributes:
        comm: MPI communicator; its rank 0 writes files.
    """

    comm: Any

    @property
    def columns(self) -> dict[str, Any]:
        """Columns of the table: {name: values, shape (n,)}."""
        raise NotImplementedError

    def to_csv(self, file: Any, units: Units = NONE) -> None:
        """Write the table as a CSV file (rank 0 writes).

        Args:
            file: its name ends in .csv.
            units: units for the header, as in "wall [mm]"; default none.

        Raises:
            InputError: the name has another ending.
            OSError: the file cannot be written.
        """
        tabular.write_rows(file, self._header(units), self._rows(), self.comm)

    def to_excel(self, file: Any, units: Units = NONE) -> None:
        """Write the table as an Excel file (rank 0 writes).

        Args:
            file: its name ends in .xlsx.
            units: units for the header, as in "wall [mm]"; default none.

        Raises:
            InputError: the name has another ending, openpyxl is not installed, or a text has characters or a length
                that Excel does not accept.
            OSError: the file cannot be written.
        """
        file = tabular.named("to_excel", file, ".xlsx")
        try:
            from openpyxl import Workbook
            from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE
        except ImportError:
            raise InputError("to_excel: needs openpyxl, which is not installed; to_csv needs no library") from None
        book = Workbook()
        sheet: Any = book.active
        for n, row in enumerate((self._header(units), *self._rows())):
            for name, cell in zip(self.columns, row):
                if isinstance(cell, str) and (len(cell) > _LONGEST or ILLEGAL_CHARACTERS_RE.search(cell)):
                    raise InputError(f"to_excel: column {name!r}, row {n}: {len(cell)} characters, {cell[:40]!r}...: an"
                                     f" Excel cell holds at most {_LONGEST} characters, all of them printable; to_csv"
                                     f" writes it")
            sheet.append([v.item() if isinstance(v, np.generic) else v for v in row])
        sheet.freeze_panes = "A2"
        tabular.on_root(self.comm, lambda: tabular.replace(file, book.save, "wb"))

    def __str__(self) -> str:
        rows = [list(row) for row in zip(*map(_words, self.columns.values()), strict=True)]
        n, half = len(rows), PRINTED_ROWS // 2
        if n > PRINTED_ROWS + 1:
            rows[half:n - half] = [["..."] * len(self.columns)]
        lines = [list(self.columns), *rows]
        widths = [max(map(len, column)) for column in zip(*lines)]
        return "\n".join("  ".join(f"{cell:>{w}}" for cell, w in zip(line, widths)) for line in lines) + f"\n{n} rows"

    def __repr__(self) -> str:                               # shown by a notebook
        return str(self)

    def _header(self, units: Units) -> list[str]:
        """Return the names of the columns with their units, such as "wall [mm]"."""
        return [units.heading(name) for name in self.columns]

    def _rows(self) -> list[tuple]:
        """Return the rows of the table, each with one value per column."""
        return list(zip(*self.columns.values(), strict=True))


def _words(column: Any) -> list[str]:
    """Return the cells of a column as text; numbers are rounded to the fifth digit of the largest one."""
    values = np.asarray(column)
    if values.dtype.kind != "f":
        return [str(v) for v in values]
    largest = np.nanmax(np.abs(values), initial=0.0)
    places = 4 - math.floor(math.log10(largest)) if 0 < largest < math.inf else 0
    rounded = np.round(values, places) + 0.0                # no -0
    return [f"{v:.5g}" if abs(places) > 8 else f"{v:.{max(places, 0)}f}" for v in rounded]
