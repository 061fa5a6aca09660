"""Tests from the CSV files of laboratories and testing machines, turned into stretch and nominal stress.

The columns may hold stretch, strain or displacement, and nominal stress, true stress or force, under English or German
names. A title may stand before the line that names the columns, and a line of units behind it.
"""

from __future__ import annotations

import itertools
import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, check_name, check_type, positive
from ...io.csv_files import name_and_unit, records
from ...io.numerals import is_number
from ...materials.homogeneous import MODES
from ...units import FORCES, LENGTHS, STRESSES
from .measured_oscillation import (
    MODULI,
    OSCILLATION_COLUMNS,
    TEMPERATURE_UNITS,
    MeasuredOscillation,
    read_oscillations,
    used_columns,
)

_QUANTITIES = {
    "test": ("test", "mode", "versuch", "prufart"),
    "stretch": ("stretch", "stretch ratio", "extension ratio", "lambda", "verstreckung", "streckverhaltnis"),
    "strain": ("strain", "engineering strain", "nominal strain", "tensile strain", "dehnung", "technische dehnung",
               "nominelle dehnung"),
    "true strain": ("true strain", "hencky strain", "logarithmic strain", "log strain", "wahre dehnung",
                    "logarithmische dehnung"),
    "displacement": ("displacement", "extension", "elongation", "crosshead", "crosshead travel", "travel", "weg",
                     "standardweg", "traversenweg", "verlangerung"),
    "stress": ("stress", "nominal stress", "engineering stress", "tensile stress", "spannung", "technische spannung",
               "nennspannung"),
    "true stress": ("true stress", "cauchy stress", "wahre spannung"),
    "force": ("force", "standard force", "load", "kraft", "standardkraft", "prufkraft"),
    "time": ("time", "test time", "zeit", "prufzeit"),
    "temperature": ("temperature", "temp", "temperatur", "pruftemperatur"),
}
"""{quantity: names of its column, in lower case and without accents}."""
_NAMES = {name: quantity for quantity, names in (_QUANTITIES | OSCILLATION_COLUMNS).items() for name in names}
_STRETCHES, _STRESSES = ("stretch", "strain", "true strain", "displacement"), ("stress", "true stress", "force")
_UNITS: dict[str, tuple[str, ...]] = {
    "strain": ("%", "mm/mm", "m/m"), "true strain": ("%",), "displacement": tuple(LENGTHS), "stress": tuple(STRESSES),
    "true stress": tuple(STRESSES), "force": tuple(FORCES), "time": ("s", "ms", "min", "h"),
    "temperature": TEMPERATURE_UNITS}
_SPECIMEN = ("length", "width", "thickness", "area")


class MeasuredTest(NamedTuple):
    """Test from a file, with n points.

    Attributes:
        mode: "uniaxial", "pure_shear" or "equibiaxial".
        stretch: stretches, shape (n,).
        stress: nominal stresses, shape (n,); nan for an empty cell.
        times: times, shape (n,), or None.
        temperature: temperature of the test, or None.
        source: name of the file.
        conversions: what was done to the columns, as text.
        unit: unit of the stress, or None if the file does not say it.
    """

    mode: str
    stretch: np.ndarray
    stress: np.ndarray
    times: np.ndarray | None
    temperature: float | None
    source: str
    conversions: tuple[str, ...]
    unit: str | None = None


def read_tests(file: Path, test: str | None = None, specimen: Any = None) -> list[MeasuredTest | MeasuredOscillation]:
    """Return the tests of a CSV file, by default with columns test, stretch, nominal stress and, in time, time.

    A test ends where its name or temperature changes, or the time decreases. `specimen` has "length" and "area", or
    "width" and "thickness", for displacement and force. A malformed file is an InputError.
    """
    caller = f"fit: data: {file}"
    try:
        rows = records(file)
    except InputError as error:
        raise InputError(f"fit: data: {error}") from None
    start, columns, units = _head(caller, rows)
    if columns is None:
        columns = dict(zip(("test", "stretch", "stress", "time"), range(len(rows[0][1]) if rows else 0)))
        units, width = {}, len(rows[0][1]) if rows else 0
    else:
        width = len(rows[start - 1][1])
        if start < len(rows) and not any(map(is_number, rows[start][1])) and len(rows[start][1]) == width and not any(
                cell in MODES for cell in rows[start][1]):              # a line of units
            for name, k in columns.items():
                units[name] = rows[start][1][k].strip("[]()") or units.get(name)
            start += 1
        if columns.keys() & MODULI:
            return [*read_oscillations(caller, columns, rows[start:], units, test)]
        columns = _checked_columns(caller, columns, rows, start, units, test)
    body = rows[start:]
    if not body:
        raise InputError(f"{caller}: has no rows of test, stretch, stress")
    if test is not None:
        check_name("fit: test", test, MODES)
    points = [_point(f"{caller}, line {n}", row, width, columns, test) for n, row in body]
    converted, conversions = _converted(caller, points, units, specimen)
    found: list[MeasuredTest | MeasuredOscillation] = []
    unit = units.get("stress") or units.get("true stress")
    for _, group in itertools.groupby(zip(_test_numbers(converted), converted), key=lambda pair: pair[0]):
        part = [point for _, point in group]
        times = np.array([p["time"] for p in part]) if "time" in part[0] else None
        found.append(MeasuredTest(part[0]["test"], np.array([p["stretch"] for p in part]),
                                  np.array([p["stress"] for p in part]), times, part[0].get("temperature"),
                                  str(file), conversions, unit))
    return found


def _head(caller: str, rows: list[tuple[int, list[str]]]) -> tuple[int, dict[str, int] | None, dict[str, Any]]:
    """Return the line behind the one that names the columns, {quantity or name: column}, and {quantity: unit or None}.

    A title is skipped; without names it is (0, None, {}). A quantity twice, or an unknown unit, is an InputError.
    """
    for start, (_, row) in enumerate(rows, 1):
        cells = [name_and_unit(cell) for cell in row]
        quantities = [_NAMES.get(_plain(words)) for words, _ in cells]
        if row and row[0] in MODES or len(row) > 1 and all(map(is_number, row)):
            break
        if sum(q is not None for q in quantities) < 2:
            continue
        columns: dict[str, int] = {}
        units: dict[str, Any] = {}
        for k, ((words, unit), quantity) in enumerate(zip(cells, quantities)):
            name = quantity or words
            if name in columns:
                raise InputError(f"{caller}: the first line names two columns {name!r}")
            columns[name] = k
            if quantity is not None:
                units[name] = unit
        return start, columns, units
    if rows and not any(map(is_number, rows[0][1])) and rows[0][1][0] not in MODES:
        names = [name_and_unit(cell)[0] for cell in rows[0][1]]
        raise InputError(f"{caller}: the first line names the columns {', '.join(map(repr, names))}: no 'stretch'; must"
                         f" be test, stretch (or strain, displacement), stress (nominal, true, or force), and time if"
                         f" any")
    return 0, None, {}


def _checked_columns(caller: str, columns: dict[str, int], rows: list[tuple[int, list[str]]], start: int,
                     units: dict[str, Any], test: str | None) -> dict[str, int]:
    """Return {quantity: column} that a fit uses; missing, unused numeric or unknown ones are an InputError."""
    what = ("must be test, stretch (or strain, displacement), stress (nominal, true, or force), and time if any")
    names = ", ".join(repr(name_and_unit(cell)[0]) for cell in rows[start - 1][1] if not is_number(cell))
    for needed in ((("test",),) if test is None else ()) + (_STRETCHES, _STRESSES):
        found = [name for name in needed if name in columns]
        if not found:
            advice = "; or give fit(..., test='uniaxial')" if needed == ("test",) else ""
            raise InputError(f"{caller}: the first line names the columns {names}: no {needed[0]!r}; {what}{advice}")
        if len(found) > 1:
            raise InputError(f"{caller}: the first line names both {found[0]!r} and {found[1]!r}: leave one of them out"
                             f" of the file")
    if test is not None and "test" in columns:
        raise InputError(f"{caller}: has a column 'test': give no test={test!r}")
    return used_columns(caller, columns, rows[start:], units, _QUANTITIES, _UNITS)


def _plain(words: str) -> str:
    """Return words in lower case, without accents, underscores and double spaces."""
    for quote in "\u2019\u2032\u00b4":                       # quotation marks and primes of G' and G''
        words = words.replace(quote, "'")
    plain = unicodedata.normalize("NFKD", words.lower()).encode("ascii", "ignore").decode()
    return " ".join(plain.replace("_", " ").replace("-", " ").split())


def _point(where: str, row: list[str], width: int, columns: dict[str, int], test: str | None) -> dict[str, Any]:
    """Return a row of the file as {quantity: value}; an empty stress in a test in time is nan.

    Another number of cells, an unknown test, or a cell that is no number is an InputError.
    """
    if len(row) != width or len(columns) < 3 - (test is not None):
        raise InputError(f"{where}: has {len(row)} columns: must be test, stretch, stress or test, stretch, stress,"
                         f" time, the same in all lines")
    found: dict[str, Any] = {"test": test}
    for name, k in columns.items():
        if name == "test":
            check_name(f"{where}: test", row[k], MODES)
            found[name] = row[k]
            continue
        empty = row[k] == "" and name in _STRESSES and "time" in columns
        if not is_number(row[k]) and not empty:
            raise InputError(f"{where}: {row[k]!r}: must be a number")
        found[name] = float(row[k] or "nan")
    return found


def _converted(caller: str, points: list[dict[str, Any]], units: dict[str, Any], specimen: Any
               ) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return points with stretch and nominal stress, and conversions as text; a wrong specimen is an InputError."""
    given = dict(check_type("fit: specimen", {} if specimen is None else specimen, Mapping,
                            "a dict such as {'length': 30.0, 'width': 4.0, 'thickness': 1.0}"))
    for name in given:
        check_name("fit: specimen", name, _SPECIMEN)
        given[name] = positive(f"fit: specimen: {name}", given[name])
    if "area" not in given and {"width", "thickness"} <= given.keys():
        given["area"] = given["width"] * given["thickness"]
    first, done = points[0], []
    strain = next(name for name in _STRETCHES if name in first)
    stress = next(name for name in _STRESSES if name in first)
    percent = units.get(strain) == "%"
    if strain == "displacement" and "length" not in given:
        raise InputError(f"{caller}: has a displacement: give fit(..., specimen={{'length': ..., ...}}), the gauge"
                         f" length")
    if stress == "force" and "area" not in given:
        raise InputError(f"{caller}: has a force: give fit(..., specimen={{'width': ..., 'thickness': ...}}), or its"
                         f" 'area'")
    if strain != "stretch":
        done.append({"strain": "stretch = 1 + strain" + "/100" * percent,
                     "true strain": "stretch = exp(true strain" + "/100" * percent + ")",
                     "displacement": f"stretch = 1 + displacement/{given.get('length', 0):g}"}[strain])
    if stress != "stress":
        scale = FORCES[units.get("force") or "N"]
        done.append({"true stress": "nominal stress = true stress / stretch",
                     "force": f"nominal stress = force/{given.get('area', 0):g}" + f" x {scale:g}" * (scale != 1)
                              + ", N per area of the specimen"}[stress])
    found = []
    for point in points:
        value, load = point[strain] / (100.0 if percent else 1.0), point[stress]
        stretch = {"stretch": value, "strain": 1 + value, "true strain": np.exp(min(value, 50.0)),
                   "displacement": 1 + value / given.get("length", 1.0)}[strain]
        nominal = {"stress": load, "true stress": load / stretch if stretch else np.nan,
                   "force": load * FORCES[units.get("force") or "N"] / given.get("area", 1.0)}[stress]
        found.append({k: v for k, v in point.items() if k in ("test", "time", "temperature")}
                     | {"stretch": float(stretch), "stress": float(nominal)})
    return found, tuple(done)


def _test_numbers(points: list[dict[str, Any]]) -> list[int]:
    """Return the test of each row, from 0; one ends where its name or temperature changes, or the time decreases."""
    found, n = [], 0
    for point, last in zip(points, [points[0], *points]):
        n += (point["test"] != last["test"] or point.get("temperature") != last.get("temperature")
              or point.get("time", 0.0) < last.get("time", 0.0))
        found.append(n)
    return found
