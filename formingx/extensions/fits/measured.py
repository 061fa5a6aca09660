"""Tests from a CSV file with columns test, stretch, stress, and optionally time."""

import itertools
from pathlib import Path

import numpy as np

from ...errors import InputError, check_name
from ...io.csv_files import name_and_unit, records
from ...io.numerals import is_number
from ...materials.homogeneous import MODES
from ...units import STRESSES

_NAMES = {"test": "test", "mode": "test", "stretch": "stretch", "stress": "stress", "nominal stress": "stress",
          "engineering stress": "stress", "time": "time"}
_ORDER = ("test", "stretch", "stress", "time")
_UNITS = {"stress": tuple(STRESSES), "time": ("s", "ms", "min", "h")}


def read_tests(file: Path) -> list[tuple[str, np.ndarray]]:
    """Read the tests of a CSV file with the columns test, stretch, stress (nominal) and, for tests in time, time.

    If the first line names the columns, their order is free. A test ends where its name changes or the time decreases.

    Args:
        file: path of the CSV file.

    Returns:
        List of (name of the test, array). The rows of the array are stretch, nominal stress and, if the file has it,
        time, shape (2, n) or (3, n). An empty stress is nan.

    Raises:
        InputError: a file that cannot be read or has no rows, a first line without a required column or with an unknown
            unit, or a malformed row.
    """
    caller = f"fit: data: {file}"
    try:
        rows = records(file)
    except InputError as error:
        raise InputError(f"fit: data: {error}") from None
    head = rows[0][1] if rows and rows[0][1][0] not in MODES and not any(map(is_number, rows[0][1])) else None
    body = rows if head is None else rows[1:]
    if not body:
        raise InputError(f"{caller}: has no rows of test, stretch, stress")
    width = len(body[0][1]) if head is None else len(head)
    columns = list(range(width)) if head is None else _columns(caller, head)
    points = [(_mode(f"{caller}, line {n}", row, width, columns), _numbers(f"{caller}, line {n}", row, columns))
              for n, row in body]
    numbered = zip(_test_numbers(points), points)
    return [(group[0][1][0], np.array([numbers for _, (_, numbers) in group]).T)
            for group in (list(found) for _, found in itertools.groupby(numbered, key=lambda x: x[0]))]


def _columns(caller: str, head: list[str]) -> list[int]:
    """Return the numbers of the columns with test, stretch, stress and, if there is one, time.

    Args:
        caller: name of the caller and the file, for messages.
        head: names of the columns, the first line of the file.

    Raises:
        InputError: a missing or duplicate column, or an unknown unit.
    """
    found: dict[str, int] = {}
    for k, cell in enumerate(head):
        words, unit = name_and_unit(cell)
        name = _NAMES.get(" ".join(words.lower().replace("_", " ").split()), "")
        if name in found:
            raise InputError(f"{caller}: the first line names two columns {name!r}")
        if name and unit is not None and unit not in _UNITS.get(name, ()):
            raise InputError(f"{caller}: column {name!r} is in {unit!r}: must be"
                             f" {'in one of ' + ', '.join(_UNITS[name]) if name in _UNITS else 'without a unit'}")
        found |= {name: k} if name else {}
    missing = [name for name in _ORDER[:3] if name not in found]
    if missing:
        raise InputError(f"{caller}: the first line names the columns {', '.join(map(repr, head))}: no {missing[0]!r};"
                         f" must be test, stretch (length over first length), stress (nominal), and time if any")
    return [found[name] for name in _ORDER if name in found]


def _mode(where: str, row: list[str], width: int, columns: list[int]) -> str:
    """Return the name of the test ("uniaxial", ...) in a row of the file, checked.

    Args:
        where: file and line, for messages.
        row: cells of the row.
        width: number of cells that a row must have.
        columns: numbers of the columns with test, stretch, stress and, if there is one, time.

    Raises:
        InputError: another number of cells, or an unknown test.
    """
    if len(row) != width or len(columns) not in (3, 4):
        raise InputError(f"{where}: has {len(row)} columns: must be test, stretch, stress or test, stretch, stress,"
                         f" time, the same in all lines")
    check_name(f"{where}: test", row[columns[0]], MODES)
    return row[columns[0]]


def _numbers(where: str, row: list[str], columns: list[int]) -> list[float]:
    """Return the numbers in a row of the file: stretch, stress (nan if empty) and, if there is one, time.

    Args:
        where: file and line, for messages.
        row: cells of the row.
        columns: numbers of the columns with test, stretch, stress and, if there is one, time.
    """
    cells = [row[k] for k in columns[1:]]
    for i, cell in enumerate(cells):
        if not is_number(cell) and not (cell == "" and i == 1 and len(cells) == 3):
            raise InputError(f"{where}: {cell!r}: must be a number")
    return [float(cell or "nan") for cell in cells]


def _test_numbers(points: list[tuple[str, list[float]]]) -> list[int]:
    """Return for each row of a file the number of the test to which it belongs, counted from 0.

    A test ends where its name changes or the time decreases.

    Args:
        points: for each row (name of the test, [stretch, stress] or [stretch, stress, time]).
    """
    found, n = [], 0
    for (mode, row), (before, last) in zip(points, [points[0], *points]):
        n += mode != before or len(row) == 3 and row[2] < last[2]
        found.append(n)
    return found
