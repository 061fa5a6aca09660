"""Tests by small oscillations from CSV files: frequency, storage and loss modulus, and temperature."""

from __future__ import annotations

import itertools
from collections.abc import Container, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, check_name
from ...io.numerals import is_number
from ...units import STRESSES
from .oscillation import OSCILLATIONS

OSCILLATION_COLUMNS = {
    "frequency": ("frequency", "freq", "frequenz"),
    "angular frequency": ("angular frequency", "omega", "kreisfrequenz", "winkelfrequenz"),
    "storage modulus": ("storage modulus", "speichermodul"),
    "loss modulus": ("loss modulus", "verlustmodul"),
    "G'": ("g'", "shear storage modulus"), "G''": ("g''", 'g"', "shear loss modulus"),
    "E'": ("e'", "tensile storage modulus"), "E''": ("e''", 'e"', "tensile loss modulus"),
    "tan delta": ("tan delta", "tan(delta)", "loss factor", "verlustfaktor"),
}
"""{quantity: names of its column, in lower case and without accents}."""
_PAIRS = {("storage modulus", "loss modulus"): None, ("G'", "G''"): "shear", ("E'", "E''"): "uniaxial"}
"""{columns of both moduli: mode of the test, or None if the columns do not say it}."""
MODULI = {name for names in _PAIRS for name in names}
TEMPERATURE_UNITS = ("C", "°C", "K", "degC", "Grad C")
_UNITS: dict[str, tuple[str, ...]] = {
    "frequency": ("Hz",), "angular frequency": ("rad/s", "1/s", "s^-1"), "temperature": TEMPERATURE_UNITS,
    **dict.fromkeys(MODULI, tuple(STRESSES))}


class MeasuredOscillation(NamedTuple):
    """Test by oscillations from a file, at n frequencies.

    Attributes:
        mode: "shear" or "uniaxial".
        frequencies: angular frequencies, 1/s, shape (n,).
        storage: storage moduli, stress, shape (n,).
        loss: loss moduli, stress, shape (n,).
        temperature: temperature of the test, or None.
        source: name of the file.
        conversions: what was done to the columns, as text.
        unit: unit of the moduli, or None if the file does not say it.
    """

    mode: str
    frequencies: np.ndarray
    storage: np.ndarray
    loss: np.ndarray
    temperature: float | None
    source: str
    conversions: tuple[str, ...]
    unit: str | None


def read_oscillations(caller: str, columns: dict[str, int], rows: list[tuple[int, list[str]]], units: dict[str, Any],
                      test: str | None) -> list[MeasuredOscillation]:
    """Return the tests by oscillations of a file; a test ends where its mode or temperature changes.

    Rows are (line number, cells). Missing columns, an unknown mode or a cell that is no number are an InputError.
    """
    used = used_columns(caller, columns, rows, units, {*OSCILLATION_COLUMNS, "test", "temperature"}, _UNITS)
    pairs = [names for names in _PAIRS if set(names) & used.keys()]
    if len(pairs) != 1 or not set(pairs[0]) <= used.keys():
        raise InputError(f"{caller}: has the moduli {', '.join(sorted(MODULI & used.keys()))}: must be one pair of"
                         f" storage and loss modulus: {', '.join(' and '.join(names) for names in _PAIRS)}")
    found = [name for name in ("frequency", "angular frequency") if name in used]
    if len(found) != 1:
        raise InputError(f"{caller}: must have one column 'frequency' (Hz) or 'angular frequency' (rad/s)")
    mode = _PAIRS[pairs[0]] or test
    if mode is None and "test" not in used:
        raise InputError(f"{caller}: its columns do not say whether the moduli are of shear or tension: give"
                         f" fit(..., test='shear') or 'uniaxial'")
    if test is not None:
        check_name("fit: test", test, OSCILLATIONS)
        if test != mode or "test" in used:
            raise InputError(f"{caller}: its columns say the mode of the test: give no test={test!r}")
    points = [_point(f"{caller}, line {n}", cells, used, mode) for n, cells in rows]
    if not points:
        raise InputError(f"{caller}: has no rows of {found[0]}, {pairs[0][0]}, {pairs[0][1]}")
    done = ["angular frequency = 2 pi frequency"] * (found[0] == "frequency")
    done += ["tan delta is not used: it is the ratio of the moduli"] * ("tan delta" in used)
    factor = 2 * np.pi if found[0] == "frequency" else 1.0
    named = {units.get(name) for name in pairs[0]} - {None}
    if len(named) > 1:
        raise InputError(f"{caller}: storage and loss modulus have the units {' and '.join(sorted(map(str, named)))}:"
                         f" convert them to one")
    tests = []
    for (kind, T), group in itertools.groupby(points, key=lambda p: (p["test"], p.get("temperature"))):
        several = list(group)
        omega, storage, loss = (np.array([p[name] for p in several]) for name in (found[0], *pairs[0]))
        tests.append(MeasuredOscillation(kind, factor * omega, storage, loss, T, caller.removeprefix("fit: data: "),
                                         tuple(done), next(iter(named), None)))
    return tests


def used_columns(caller: str, columns: dict[str, int], rows: list[tuple[int, list[str]]], units: Mapping[str, Any],
                 known: Container[str], units_of: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """Return {quantity: column} of known columns; unknown columns of numbers or units are an InputError."""
    for name, k in columns.items():
        numeric = any(k < len(row) and is_number(row[k]) for _, row in rows)
        if name not in known and numeric:
            raise InputError(f"{caller}: the first line names a column {name!r}, which a fit does not use: leave it out"
                             f" of the file")
        unit = units.get(name)
        if name in known and unit is not None and unit not in units_of.get(name, ()):
            raise InputError(f"{caller}: column {name!r} is in {unit!r}: must be"
                             f" {'in one of ' + ', '.join(units_of[name]) if name in units_of else 'without a unit'}")
    return {name: k for name, k in columns.items() if name in known}


def _point(where: str, cells: list[str], columns: dict[str, int], mode: str | None) -> dict[str, Any]:
    """Return a row as {quantity: value}; an unknown mode, or a cell that is missing or no number, is an InputError."""
    found: dict[str, Any] = {"test": mode}
    for name, k in columns.items():
        cell = cells[k] if k < len(cells) else ""
        if name == "test":
            check_name(f"{where}: test", cell, OSCILLATIONS)
            found[name] = cell
        elif is_number(cell):
            found[name] = float(cell)
        elif cell == "" and name in MODULI:
            found[name] = float("nan")
        else:
            raise InputError(f"{where}: {cell!r}: must be a number")
    return found
