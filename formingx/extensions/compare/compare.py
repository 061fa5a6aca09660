"""Comparison of a run with the curve of another program or run: differences, limit points, and a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
from mpi4py import MPI

from ... import figures
from ...errors import InputError, as_list, check_name, check_type
from ...findings import percent
from ...io import csv_files
from ...results import files
from ...values.tolerances import FAR
from .curves import SampledCurve, arc_length, pair_at_equal_values, pair_in_order, ranges, resolution_of

_MAP = ("X", "Y")
"""Columns with the positions of the centroids of triangles on the flat sheet."""


@dataclass(frozen=True)
class Difference:
    """Difference of one column between two curves, theirs minus ours, at the n compared points of their curve.

    "Ours" is the curve of the run, "theirs" the curve of the other program.

    Attributes:
        values: differences, shape (n,), in the unit of our column.
        range: largest minus smallest value of our column.
        maximum: largest absolute difference.
        argmax: index of the point with the largest absolute difference.
        rms: root mean square of the differences along the curve, weighted with its arc length.
    """

    values: np.ndarray
    range: float
    maximum: float
    argmax: int
    rms: float


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`; its text is a report.

    "Ours" is the curve of the run, "theirs" the curve of the other program, both in the space of c columns.

    Attributes:
        columns: names of the c compared columns, by our names.
        ours: points of our curve in order, shape (n, c).
        theirs: points of their curve in order, shape (l, c), in our units.
        line: finely interpolated points of our curve, shape (m, c).
        pairs: indices of the k compared points of `theirs`, shape (k,), and their partners on our curve, shape (k, c).
        differences: {column: `Difference`}.
        limit_points: limit points of (ours, theirs), each a list of {column: value}. For a `Path` they are states that
            the run located. For a table each is the vertex of the parabola through three points, at whose middle point
            the control turns. The control is pressure or travel, else the first column.
        resolution: resolutions of (our curve, their curve), with each column divided by its range. Every second point
            is left out. The resolution is the largest distance of a point left out from the curve through the others. A
            difference below a tenth of the resolution may come from interpolation. A `Path` also knows its tangents, so
            its curve is more accurate.
        along: independent column at whose values the others are compared; "X, Y" for maps of walls; "" for pairs by
            arc length.
    """

    columns: list[str]
    ours: np.ndarray
    theirs: np.ndarray
    line: np.ndarray
    pairs: tuple[np.ndarray, np.ndarray]
    differences: dict[str, Difference]
    limit_points: tuple[list[dict[str, float]], list[dict[str, float]]]
    resolution: tuple[float, float]
    along: str = ""

    @property
    def points_beyond_ends(self) -> int:
        """Number of points of the other program beyond the ends of the run's curve, which are not compared."""
        return len(self.theirs) - len(self.pairs[0])

    def __str__(self) -> str:
        compared = self.theirs[self.pairs[0]]
        how = f"at the same {self.along}" if self.along else "paired by arc length"
        omitted = self.points_beyond_ends
        kind = "map" if self.along == ", ".join(_MAP) else "curve"
        lines = [f"{len(compared)} of {len(self.theirs)} points of theirs compared with our {kind} through"
                 f" {len(self.ours)}, {how}" + (f"; {omitted} lie beyond its ends" if omitted else ""),
                 f"{'theirs minus ours':24}{'largest':>13}{'of range':>10}{'rms':>13}{'of range':>10}   largest at"]
        for name, d in self.differences.items():
            if name == self.along:
                continue
            where = ", ".join(f"{c} {v:.6g}" for c, v in zip(self.columns, compared[d.argmax]))
            lines.append(f"{name:24}{d.values[d.argmax]:13.5g}{_percent(d.maximum / d.range)}{d.rms:13.5g}"
                         f"{_percent(d.rms / d.range)}   {where}")
        if self.along == ", ".join(_MAP):
            ours, theirs = self.resolution
            return "\n".join([*lines, f"with every other triangle left out, our map moves by {ours:.1e} of its range,"
                                      f" theirs by {theirs:.1e}"])
        lines.append(f"{'limit points':24}{'':13}" + "".join(f"{c:>16}" for c in self.columns))
        for k, (a, b) in enumerate(zip_longest(*self.limit_points), 1):
            for side, point in (("ours", a), ("theirs", b)):
                lines.append(f"  {k} {side:20}{'' if point else 'none':13}"
                             + "".join(f"{point[c]:16.8g}" for c in self.columns if point))
        if not any(self.limit_points):
            lines.append("  none on either side")
        ours, theirs = self.resolution
        lines.append(f"with every other point left out, our curve moves by {ours:.1e} of its range, theirs by"
                     f" {theirs:.1e}" if np.isfinite([ours, theirs]).all() else
                     "a curve of fewer than five points does not tell how well it is resolved")
        return "\n".join(lines)

    __repr__ = __str__

    def plot(self) -> Any:
        """Draw the curves of the run and of the other program, and their differences.

        The curves are drawn as the first column over the second, the differences over the arc length of the run's
        curve.

        Returns:
            The matplotlib figure.
        """
        figure, (left, right) = figures.figure(2)
        if self.along == ", ".join(_MAP):
            name, d = next(iter(self.differences.items()))
            points = self.theirs[self.pairs[0]]
            for axes, values, label in ((left, self.pairs[1][:, 2], f"our {name}"),
                                        (right, 100 * d.values / d.range, "theirs minus ours, % of range")):
                drawn = axes.tripcolor(*points[:, :2].T, values, shading="gouraud")
                axes.set(xlabel="X", ylabel="Y", aspect="equal")
                figure.colorbar(drawn, ax=axes, label=label.replace("_", " "))
            return figure
        y, x = self.columns[:2]
        line, = left.plot(self.line[:, 1], self.line[:, 0], label="ours")
        left.plot(self.theirs[:, 1], self.theirs[:, 0], "kx", markersize=5, label="theirs")
        for points, style in zip(self.limit_points, ({"color": line.get_color(), "markersize": 11},
                                                     {"color": "k", "markersize": 8})):
            left.plot([p[x] for p in points], [p[y] for p in points], "o", fillstyle="none", **style)
        left.set(xlabel=x.replace("_", " "), ylabel=y.replace("_", " "))
        left.legend(frameon=False)
        length = arc_length(self.pairs[1] / ranges(self.line))
        for name, d in self.differences.items():
            right.plot(length, 100 * d.values / d.range, ".-", label=name.replace("_", " "))
        right.set(xlabel="arc length of our curve (each range is 1)", ylabel="theirs minus ours, % of range")
        right.legend(frameon=False)
        return figure

    def to_csv(self, file: Any, comm: Any = MPI.COMM_WORLD) -> None:
        """Write a CSV file with a row for each compared point (rank 0 writes).

        A row has for every column the value of the other program, the value of the run, and the difference.

        Args:
            file: path of the CSV file.
            comm: MPI communicator.
        """
        header = [f"{c}_{side}" for c in self.columns for side in ("theirs", "ours", "difference")]
        theirs = self.theirs[self.pairs[0]]
        rows = np.stack([theirs, self.pairs[1], theirs - self.pairs[1]], 2).reshape(len(theirs), -1)
        files.write_rows(file, header, rows.tolist(), comm)


def compare(ours: Any, theirs: Any, *, columns: Mapping[str, str] | Sequence[str] | None = None,
            units: Mapping[str, float | str] | None = None, along: str | None = None) -> Comparison:
    """Compare a run ("ours") with a curve of another program ("theirs"), such as pressure over height.

    Each side is a curve in the space of the compared columns, given by points in order; it may turn back. A column that
    is monotonic on both sides is the independent variable: the others are compared at equal values of it, as walls at
    the same radius. Of several such columns, the one over which the curve is flattest is chosen.

    Walls of two sheets in three dimensions, tables with the columns X, Y and wall, are compared at the same positions
    (X, Y) of the flat sheet: our walls are interpolated to theirs.

    If every column turns back, the points are paired by arc length, with each column divided by its range. Both arc
    lengths increase together, and the sum of squared distances is minimal. So a shift along the curve counts as no
    difference: the differences are measured across the curve. Points of theirs beyond the ends of our curve are left
    out and counted.

    Args:
        ours: a `Path`, a CSV file (for example of `Path.to_csv`), or {column: values}.
        theirs: a `Path`, a CSV file, or {column: values}. The header of a CSV file names the columns and may state
            units, as "pressure [psi]".
        columns: {our name: their name}, or a list of names on both sides; at least two. Default: the first two of our
            columns that theirs also has; if one of these has the name "wall", it takes the second place.
        units: {our name: factor} from their units to ours, or {our name: our unit} if their header states their unit.
            Known units are "m", "cm", "mm", "in", "Pa", "MPa", "bar", "psi", "kg/cm2", "cm3" and more.
        along: our name of the independent variable, or "arc length"; default as above.

    Returns:
        Differences of each column, and the limit points of both curves.

    Raises:
        InputError: a file that cannot be read, an unknown column or unit, a constant column, rows that run backwards,
            or no common point.

    >>> other = {"pressure": 1.01 * path["pressure"], "pole_height": path["pole_height"]}
    >>> compared = fx.compare(path, other)
    >>> round(float(compared.differences["pressure"].maximum / path["pressure"].max()), 3)
    0.01
    """
    left, right = _table("compare: ours", ours), _table("compare: theirs", theirs)
    if along is None and units is None and all(
            {*_MAP, "wall"} <= {*side.columns} and "Z" not in side.columns for side in (left, right)):
        names = as_list("compare: columns", columns, "names") if columns is not None and not isinstance(
            columns, Mapping) else None
        if columns is None or names is not None and {*names} <= {*_MAP, "wall", "wall_ratio"}:
            return _compare_maps(left, right, [n for n in names or ["wall"] if n not in _MAP] or ["wall"])
    pairs = _columns(left, right, columns)
    units = check_type("compare: units", {} if units is None else units, Mapping, "{our name: factor or unit}")
    for name in units:
        check_name("compare: units: column", name, pairs)
    in_units: dict[str, Any] = {name: left.units.get(name) for name in pairs} | dict(units)
    a = np.column_stack([left.take(c, left.units[c]) for c in pairs])
    b = np.column_stack([right.take(their, in_units[our]) for our, their in pairs.items()])
    names = list(pairs)
    scale = ranges(a)
    for name, size, other in zip(names, scale, ranges(b)):
        if not size > 0 or not other > 0:
            raise InputError(f"compare: column {name!r} does not vary on {'our' if not size > 0 else 'their'} side")
        if not min(size, other) > max(size, other) / FAR:      # the square of the ratio stays finite
            raise InputError(f"compare: column {name!r}: ours changes by {size:.3g}, theirs by {other:.3g}: no curves"
                             f" to compare; are columns and units right?")
    curve = np.column_stack(ours.curve(*names)) if hasattr(ours, "curve") else a
    smooth = SampledCurve(curve / scale)
    line = smooth.line * scale
    k = _independent(names, curve / scale, b / scale, along)
    matched, partners = (pair_in_order(b / scale, smooth) if k is None
                         else pair_at_equal_values(b / scale, curve / scale, k))
    if not len(matched):
        raise InputError("compare: no point of theirs lies along our curve: are columns, units, order of rows right?")
    partners = partners * scale
    control = next((n for n in names if n in ("pressure", "travel")), names[0])
    return Comparison(names, a, b, line, (matched, partners),
                      {n: _difference(b[matched, k] - partners[:, k], scale[k], partners / scale)
                       for k, n in enumerate(names)},
                      (_limit_points(left, a, names, control),
                       _limit_points(right, b, names, control)),
                      (resolution_of(a / scale, k), resolution_of(b / scale, k)), "" if k is None else names[k])


def _compare_maps(left: csv_files.CsvTable, right: csv_files.CsvTable, names: list[str]) -> Comparison:
    """Return the comparison of two maps of walls at their (X, Y); if all lie outside ours, an InputError."""
    from scipy.interpolate import LinearNDInterpolator
    ours, theirs = (np.column_stack([side.take(c, side.units[c]) for c in (*_MAP, *names)]) for side in (left, right))
    found = LinearNDInterpolator(ours[:, :2], ours[:, 2:])(theirs[:, :2])
    matched = np.flatnonzero(np.isfinite(found).all(1))
    if not len(matched):
        raise InputError("compare: no point (X, Y) of theirs lies within ours: are both maps of the same sheet, in the"
                         " same units?")
    partners = np.column_stack([theirs[matched, :2], found[matched]])
    scale = ranges(ours)
    differences = {}
    for k, name in enumerate(names, 2):
        values = theirs[matched, k] - partners[:, k]
        index = int(np.argmax(np.abs(values)))
        differences[name] = Difference(values, float(scale[k]), float(abs(values[index])), index,
                                       float(np.sqrt(np.mean(values**2))))
    return Comparison([*_MAP, *names], ours, theirs, ours, (matched, partners), differences, ([], []),
                      (_map_resolution(ours, scale), _map_resolution(theirs, ranges(theirs))), ", ".join(_MAP))


def _map_resolution(points: np.ndarray, scale: np.ndarray) -> float:
    """Return the largest change of a map at half of its n points if these are left out, over its range.

    Points have X, Y and compared columns, shape (n, c), with ranges (c,).
    """
    from scipy.interpolate import LinearNDInterpolator
    if len(points) < 8:
        return np.nan
    kept = points[::2]
    change = np.abs(LinearNDInterpolator(kept[:, :2], kept[:, 2:])(points[1::2, :2]) - points[1::2, 2:])
    return float(np.nanmax(change / scale[2:])) if np.isfinite(change).any() else np.nan


def _percent(share: float) -> str:
    """Return a ratio in percent as text of ten characters."""
    return f"{percent(share):>10}"


def _table(side: str, given: Any) -> csv_files.CsvTable:
    """Return a `Path`, a CSV file, or {column: values} as a table; `side` is named in messages."""
    if hasattr(given, "states"):
        if len(given) < 2:
            raise InputError(f"{side}: the path has {len(given)} states; it needs at least 2")
        found = csv_files.from_arrays(side, {c: given[c] for c in given.columns})
        return found._replace(kinds=[state.kind for state in given.states])
    return csv_files.from_arrays(side, given) if isinstance(given, Mapping) else csv_files.read(given)


def _columns(left: csv_files.CsvTable, right: csv_files.CsvTable, given: Any) -> dict[str, str]:
    """Return the columns to compare, {our name: their name}, checked.

    `given` is the argument of `compare`; None: the first two columns of equal name, for walls the first and "wall".
    """
    if given is None:
        shared = [c for c in left.columns if c in right.columns and c != "iterations"]
        pairs = {c: c for c in ([shared[0], "wall"] if "wall" in shared[1:] else shared[:2])}
        if len(pairs) < 2:
            raise InputError(f"compare: columns: ours are {', '.join(left.columns)}; theirs are"
                             f" {', '.join(right.columns)}: fewer than two have the same name; say which belong"
                             f" together, as columns={{our name: their name}}")
        return pairs
    pairs = dict(given) if isinstance(given, Mapping) else {
        check_type("compare: columns: column", c, str, "a name"): c
        for c in as_list("compare: columns", given, "names")}
    if len(pairs) < 2:
        raise InputError(f"compare: columns = {given!r}: a curve needs at least two columns")
    for our, their in pairs.items():
        check_name(f"{left.name}: column", our, left.columns)
        check_name(f"{right.name}: column", their, right.columns)
    return pairs


def _independent(names: list[str], a: np.ndarray, b: np.ndarray, along: str | None) -> int | None:
    """Return the column to compare at, None: by arc length; an `along` unknown or not monotonic is an InputError."""
    monotonic = [k for k in range(len(names)) if _is_monotonic(a[:, k]) and _is_monotonic(b[:, k])]
    if along is None:
        return min(monotonic, key=lambda k: _largest_slope(a, k), default=None)
    check_name("compare: along", along, [*names, "arc length"])
    if along == "arc length":
        return None
    if names.index(along) not in monotonic:
        raise InputError(f"compare: along = {along!r}: it turns back, or stands still, on one of the sides: use"
                         f" 'arc length'")
    return names.index(along)


def _is_monotonic(values: np.ndarray) -> bool:
    """Return True if values strictly increase, or strictly decrease."""
    steps = np.diff(values)
    return bool(np.all(steps > 0) or np.all(steps < 0))


def _largest_slope(points: np.ndarray, k: int) -> float:
    """Return the largest slope |d column| / |d column k| of successive points (n, c) over all columns."""
    steps = np.abs(np.diff(points, axis=0))
    return float((steps.max(1) / steps[:, k]).max())


def _difference(values: np.ndarray, size: float, partners: np.ndarray) -> Difference:
    """Return the difference of one column between two curves, with its maximum and root mean square.

    Values have shape (k,). Partners, (k, c) in units of ranges, weight the mean by arc length; `size` is the range.
    """
    s = arc_length(partners)
    weights = np.ones(len(s))
    if s[-1] > 0:                                                   # trapezoidal weights
        weights = (np.diff(s, prepend=s[0]) + np.diff(s, append=s[-1])) / 2
    index = int(np.argmax(np.abs(values)))
    return Difference(values, float(size), float(abs(values[index])), index,
                      float(np.sqrt(np.average(values**2, weights=weights))))


def _limit_points(table: csv_files.CsvTable, points: np.ndarray, names: list[str], control: str
                  ) -> list[dict[str, float]]:
    """Return limit points {column: value}: states of that kind, else vertices of parabolas where the control turns."""
    if table.kinds is not None and "start" in table.kinds:
        return [dict(zip(names, p.tolist())) for p, kind in zip(points, table.kinds) if kind == "limit point"]
    from scipy.signal import find_peaks
    column = names.index(control)
    y, scaled = points[:, column], points / ranges(points)
    found = []
    # noise below half a percent is no limit point
    for k in np.sort(np.concatenate([find_peaks(sign * y, prominence=5e-3 * np.ptp(y))[0] for sign in (1, -1)])):
        s = arc_length(scaled[k - 1:k + 2]) if np.ptp(y[k - 1:k + 2]) > 0 else np.zeros(3)
        if not (s[0] < s[1] < s[2]):
            found.append(points[k])
            continue
        parabolas = np.polyfit(s - s[1], points[k - 1:k + 2], 2)
        index = -parabolas[1, column] / (2 * parabolas[0, column])
        found.append(parabolas[0] * index**2 + parabolas[1] * index + parabolas[2])
    return [dict(zip(names, point.tolist())) for point in found]
