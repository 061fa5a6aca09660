"""Tests from a file: columns test, stretch, stress, and time if there is any."""

from __future__ import annotations

import csv
import itertools
from pathlib import Path

import numpy as np

from ..csv_files import is_number
from ..errors import InputError, known
from .homogeneous import MODES


def read_tests(file: Path) -> list[tuple[str, np.ndarray]]:
    """[(test, columns)] of a CSV file, each test of rows that follow one another; see `fit`.

    Columns is (stretch, stress), or (stretch, stress, time), shape (2 or 3, n); stresses left empty are not numbers.

    Raises:
        InputError: a file that cannot be read, has no rows, or a row that is not of this form.
    """
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"fit: data: {file}: cannot be read: {error}") from None
    lines = [line if line.split("#")[0].strip() else "" for line in text.splitlines()]
    cells = list(csv.reader(lines, delimiter=";" if any(";" in line for line in lines) else ","))
    rows = [(n, [c.strip() for c in row]) for n, row in enumerate(cells, 1) if row]
    if rows and rows[0][1][0] not in MODES and len(rows[0][1]) > 1 and not is_number(rows[0][1][1]):
        rows = rows[1:]                                                                  # names of the columns
    if not rows:
        raise InputError(f"fit: data: {file}: has no rows of test, stretch, stress")
    width = len(rows[0][1])
    points = [(row[0], _numbers(f"fit: data: {file}, line {n}", row, width)) for n, row in rows]
    numbered = zip(_counted(points), points)
    return [(group[0][1][0], np.array([numbers for _, (_, numbers) in group]).T)
            for group in (list(found) for _, found in itertools.groupby(numbered, key=lambda x: x[0]))]


def _numbers(where: str, row: list[str], width: int) -> list[float]:
    if len(row) != width or width not in (3, 4):
        raise InputError(f"{where}: has {len(row)} columns: must be test, stretch, stress or test, stretch, stress,"
                         f" time, the same in all lines")
    known(f"{where}: test", row[0], MODES)
    for i, cell in enumerate(row[1:], 1):
        if not is_number(cell) and not (cell == "" and i == 2 and width == 4):
            raise InputError(f"{where}: {cell!r}: must be a number with a decimal point")
    return [float(cell or "nan") for cell in row[1:]]


def _counted(points: list[tuple[str, list[float]]]) -> list[int]:
    """A number for each point, higher by one where the test changes or time begins again."""
    found, n = [], 0
    for (mode, row), (before, last) in zip(points, [points[0], *points]):
        n += mode != before or len(row) == 3 and row[2] < last[2]
        found.append(n)
    return found
