"""CSV tables of other programs, with named columns and units."""

import csv
import io
import os
import re
from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, check_name, file_path, positive
from ..units import LENGTHS, STRESSES
from .numerals import is_number

_VOLUMES = {f"{name}3": size**3 for name, size in LENGTHS.items()} | {"l": 1e-3, "ml": 1e-6}
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?")
UNITS = {"length": LENGTHS, "stress": STRESSES, "volume": _VOLUMES}


class CsvTable(NamedTuple):
    """Columns of numbers with n rows, from a CSV file or from arrays.

    Attributes:
        name: name of the file or of the arrays, for messages.
        columns: {name of the column: values, shape (n,)}; nan for a cell that is empty or holds no number.
        units: {name of the column: its unit in the header, or None}.
        kinds: the n cells of the column "kind" that `Path.to_csv` writes, or None without this column.
    """

    name: str
    columns: dict[str, np.ndarray]
    units: dict[str, str | None]
    kinds: list[str] | None = None

    def take(self, column: str, requested: float | str | None = None) -> np.ndarray:
        """Return the values of a column, shape (n,), converted to a unit or multiplied by a factor.

        None keeps a column without unit. No column, no finite number, or a wrong unit is an InputError.
        """
        check_name(f"{self.name}: column", column, self.columns)
        values, unit = self.columns[column], self.units[column]
        if not np.all(np.isfinite(values)):
            row = int(np.argmin(np.isfinite(values))) + 1
            raise InputError(f"{self.name}: column {column!r}: row {row} of the data is empty or not a finite number")
        if requested is None:
            if unit is not None:
                raise InputError(f"{self.name}: column {column!r} is in {unit!r}: give units=..., a factor or the"
                                 f" unit of the other side")
            return values
        if not isinstance(requested, str):
            return values * positive(f"units of {column!r}", requested)
        if unit is None:
            raise InputError(f"{self.name}: the header does not state the unit of column {column!r} (as in"
                             f" '{column} [{requested}]'): give a factor instead of {requested!r}")
        return values * conversion(unit, requested)


def conversion(unit: str, requested: str) -> float:
    """Return the factor from one unit to another, such as 10 from "cm" to "mm"; an impossible one is an InputError."""
    if unit == requested:
        return 1.0
    for sizes in UNITS.values():
        if unit in sizes and requested in sizes:
            return sizes[unit] / sizes[requested]
    names = [name for sizes in UNITS.values() for name in sizes]
    for name in (unit, requested):
        if name not in names:
            raise InputError(f"unit {name!r} is not known; known: {', '.join(names)}; or give a factor")
    raise InputError(f"{unit!r} cannot be turned into {requested!r}: they measure different quantities")


def read(file: Any) -> CsvTable:
    """Return the table in a CSV file with its units; columns without any number are left out.

    The first row names the columns, with units as in "pressure [psi]". A file without, with a name twice, fewer than
    two rows, or a ragged row is an InputError.
    """
    name = os.fspath(file_path("table", file))
    cells = records(name)
    if not cells:
        raise InputError(f"table {name!r} is empty")
    heads = [name_and_unit(cell) for cell in cells[0][1]]
    names = [head for head, _ in heads]
    if any(is_number(cell) for cell in cells[0][1]):
        raise InputError(f"table {name!r}: the first line must name the columns; it reads {', '.join(names)[:60]!r}")
    if len(set(names)) < len(names):
        raise InputError(f"table {name!r}: a column name stands twice in the header: {', '.join(names)}")
    for n, row in cells[1:]:
        if len(row) != len(names):
            raise InputError(f"table {name!r}, line {n}: {len(row)} cells, but the header names {len(names)} columns")
    if len(cells) < 3:
        raise InputError(f"table {name!r}: {len(cells) - 1} rows of data; a curve needs at least 2")
    text = {head: [row[k] for _, row in cells[1:]] for k, head in enumerate(names)}
    columns = {head: np.array([float(c) if is_number(c) else np.nan for c in column]) for head, column in text.items()
               if any(is_number(c) for c in column)}
    return CsvTable(name, columns, {head: unit for head, unit in heads if head in columns}, text.get("kind"))


def records(file: Any) -> list[tuple[int, list[str]]]:
    """Return (line number, cells as text) of each row of a CSV file, with points for decimal commas.

    Cells are separated by semicolons or tabs, if the first line or half of the lines contain one, else by commas. Empty
    lines and those from # are skipped. Unreadable files, quotes or mixed decimals are an InputError.
    """
    name = os.fspath(file)
    try:
        with open(name, "rb") as stream:
            text = _decoded(stream.read())
        lines = _without_remarks(list(io.StringIO(text, newline="")))
    except FileNotFoundError:
        raise InputError(f"table {name!r} is not there") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"table {name!r} cannot be read: {error}") from None
    bare = [re.sub('"[^"]*"', "", line) for _, line in lines]
    delimiter = next((mark for mark in ";\t" if bare and (mark in bare[0]
                                                          or 2 * sum(mark in line for line in bare) > len(bare))), ",")
    found, reader = [], csv.reader((line for _, line in lines), delimiter=delimiter, strict=True)
    try:
        for row in reader:
            found.append((lines[reader.line_num - 1][0], [cell.strip() for cell in row]))
    except csv.Error as error:
        line_number = lines[min(reader.line_num, len(lines)) - 1][0] if lines else 0
        raise InputError(f"table {name!r}, line {line_number}: {error}") from None
    width = Counter(len(row) for _, row in found).most_common(1)[0][0] if found else 0
    table = [(n, row) for n, row in found if len(row) == width]           # a title may have numbers of its own
    commas = [(n, cell) for n, row in table for cell in row if _DECIMAL_COMMA.fullmatch(cell)]
    if not commas:
        return found
    points = [(n, cell) for n, row in table for cell in row if "." in cell and is_number(cell)]
    if points:
        raise InputError(f"table {name!r}: {commas[0][1]!r} in line {commas[0][0]} has a decimal comma,"
                         f" {points[0][1]!r} in line {points[0][0]} a point: all numbers must have the same")
    return [(n, [cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell for cell in row])
            for n, row in found]


def _decoded(content: bytes) -> str:
    """Return bytes as text: UTF-16 by mark or zeros, UTF-8, or Windows-1252; others are a UnicodeDecodeError."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    if content[1:400:2].count(0) > len(content[1:400:2]) / 2:
        return content.decode("utf-16-le")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252")


def _without_remarks(lines: list[str]) -> list[tuple[int, str]]:
    """Return (line number, line) of lines that are not empty and do not begin with #, and of all lines in a quote."""
    found, quoted = [], False
    for n, line in enumerate(lines, 1):
        if quoted or line.strip() and not line.lstrip().startswith("#"):
            found.append((n, line))
            quoted ^= line.count('"') % 2 == 1
    return found


def from_arrays(name: str, columns: Mapping[str, Any]) -> CsvTable:
    """Return a table of {column: values (n,)}, n at least 2, without units; others are an InputError by `name`."""
    arrays = {}
    for key, values in columns.items():
        try:
            arrays[str(key)] = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{name}: column {key!r} does not hold numbers") from None
    shapes = {a.shape for a in arrays.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1 or next(iter(shapes))[0] < 2:
        raise InputError(f"{name}: columns must be as long as each other, with at least 2 values; they have the shapes"
                         f" {', '.join(f'{k}: {a.shape}' for k, a in arrays.items()) or 'none'}")
    return CsvTable(name, arrays, dict.fromkeys(arrays))


def name_and_unit(cell: str) -> tuple[str, str | None]:
    """Return name and unit of a cell in the header, as ("pressure", "psi") of "pressure [psi]", or None. """
    found = re.fullmatch(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]", cell)
    if not found or not found[1]:
        return cell, None
    return found[1], None if found[2] in ("", "-", "1") else found[2]
