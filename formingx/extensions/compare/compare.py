"""Comparison of a run with another program's curve: differences, limit points, and a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError, instance, known, several
from ...io import csv_files
from ...results import files
from ...results.show import plots

_SAMPLES = 2000                    # of a curve, for the arc length
_FINE = 33                         # of the two pieces that meet at a sample
_MOST = 10_000                     # points of theirs: each is measured against every sample
_LARGEST = 1e100                   # largest ratio of the two ranges: its square stays finite


@dataclass(frozen=True)
class Difference:
    """Difference of one column, theirs minus ours, at their points.

    Attributes:
        values: differences at the n compared points, shape (n,).
        range: range of our column.
        maximum: largest |value|.
        at: index of the largest among the compared points.
        rms: root mean square along the curve.
    """

    values: np.ndarray
    range: float
    maximum: float
    at: int
    rms: float


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`; its text is a report.

    "Ours" is the run, "theirs" the curve of the other program.

    Attributes:
        columns: compared columns, by our names.
        ours: the run as ordered points, shape (n, columns).
        theirs: the other curve as ordered points, shape (n, columns), in the units of the run.
        line: our curve as compared, shape (m, columns).
        pairs: indices of the compared points of `theirs`, and their partners on our curve, shape (k, columns).
        differences: {column: `Difference`}.
        limit_points: (ours, theirs), each a list of {column: value}. They are located by the run, else on the parabola
            through the three points at which the control turns. The control is pressure or travel, else the first
            column.
        resolution: change of each side's curve, relative to the ranges, if every second point is left out. A difference
            below a tenth of it may come from interpolation. A `Path` also knows its tangents: its curve is more
            accurate.
        along: independent column at which the others are compared; "" for the arc length.
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
    def beyond(self) -> int:
        """Number of points of the other program beyond the ends of the run's curve, which are left out."""
        return len(self.theirs) - len(self.pairs[0])

    def __str__(self) -> str:
        compared = self.theirs[self.pairs[0]]
        how = f"at the same {self.along}" if self.along else "paired by arc length"
        lines = [f"{len(compared)} of {len(self.theirs)} points of theirs compared with our curve through"
                 f" {len(self.ours)}, {how}" + (f"; {self.beyond} lie beyond its ends" if self.beyond else ""),
                 f"{'theirs minus ours':24}{'largest':>13}{'of range':>10}{'rms':>13}{'of range':>10}   largest at"]
        for name, d in self.differences.items():
            if name == self.along:
                continue
            where = ", ".join(f"{c} {v:.6g}" for c, v in zip(self.columns, compared[d.at]))
            lines.append(f"{name:24}{d.values[d.at]:13.5g}{_percent(d.maximum / d.range)}{d.rms:13.5g}"
                         f"{_percent(d.rms / d.range)}   {where}")
        lines.append(f"{'limit points':24}{'':13}" + "".join(f"{c:>16}" for c in self.columns))
        for k, (a, b) in enumerate(zip_longest(*self.limit_points), 1):
            for side, point in (("ours", a), ("theirs", b)):
                lines.append(f"  {k} {side:20}{'' if point else 'none':13}"
                             + "".join(f"{point[c]:16.8g}" for c in self.columns if point))
        if not any(self.limit_points):
            lines.append("  none on either side")
        ours, theirs = self.resolution
        lines.append(f"with every other point left out, our curve moves by {ours:.1e} of its range, theirs by"
                     f" {theirs:.1e}")
        return "\n".join(lines)

    __repr__ = __str__

    def plot(self) -> Any:
        """Draw both curves (first column over second), and the differences along the curve.

        Returns:
            The matplotlib figure.
        """
        figure, (left, right) = plots.figure(2)
        y, x = self.columns[:2]
        line, = left.plot(self.line[:, 1], self.line[:, 0], label="ours")
        left.plot(self.theirs[:, 1], self.theirs[:, 0], "kx", markersize=5, label="theirs")
        for points, style in zip(self.limit_points, ({"color": line.get_color(), "markersize": 11},
                                                     {"color": "k", "markersize": 8})):
            left.plot([p[x] for p in points], [p[y] for p in points], "o", fillstyle="none", **style)
        left.set(xlabel=x.replace("_", " "), ylabel=y.replace("_", " "))
        left.legend(frameon=False)
        length = _arc_length(self.pairs[1] / _ranges(self.line))
        for name, d in self.differences.items():
            right.plot(length, 100 * d.values / d.range, ".-", label=name.replace("_", " "))
        right.set(xlabel="arc length of our curve (each range is 1)", ylabel="theirs minus ours, % of range")
        right.legend(frameon=False)
        return figure

    def to_csv(self, file: Any, comm: Any = MPI.COMM_WORLD) -> None:
        """Write a row per compared point: both values and the difference of every column (rank 0 writes).

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
    """Compare a run with another program's curve, which may turn back.

    Each side is a curve in the space of the columns, with its rows in order. A column that is monotonic on both sides
    is the independent variable. The others are compared at equal values of it, as walls at the same radius. Of several
    such columns the one with the flattest curve is chosen.

    If every column turns back, points are paired by arc length. Each column is divided by its range. Both arc lengths
    increase together, and the sum of squared distances is minimal. So a shift along the curve counts as no difference:
    differences are measured across it. Their points beyond our ends are left out and counted.

    Args:
        ours: a `Path`, a CSV file (for example of `Path.to_csv`), or {column: values}.
        theirs: the same choice. The header of a CSV file names the columns and may state units, as "pressure [psi]".
        columns: {our name: their name}, or names on both sides; at least two. Default: the controlled quantity and the
            next column of ours that theirs also has.
        units: {our name: factor} to our units, or {our name: our unit} if their header states theirs. Known units are
            ("m", "cm", "mm",
            "in", "Pa", "MPa", "bar", "psi", "kg/cm2", "cm3", ...).
        along: our name of the independent variable, or "arc length"; default as above.

    Returns:
        The `Comparison`.

    Raises:
        InputError: a file that cannot be read, an unknown column or unit, a constant column, rows that run backwards,
            or no common point.

    >>> other = {"pressure": 1.01 * path["pressure"], "pole_height": path["pole_height"]}
    >>> compared = fx.compare(path, other)
    >>> round(float(compared.differences["pressure"].maximum / path["pressure"].max()), 3)
    0.01
    """
    left, right = _table("ours", ours), _table("theirs", theirs)
    pairs = _columns(left, right, columns)
    units = instance("compare: units", {} if units is None else units, Mapping, "{our name: factor or unit}")
    for name in units:
        known("compare: units: column", name, pairs)
    in_units: dict[str, Any] = {name: left.units.get(name) for name in pairs} | dict(units)
    a = np.column_stack([left.take(c, left.units[c]) for c in pairs])
    b = np.column_stack([right.take(their, in_units[our]) for our, their in pairs.items()])
    names = list(pairs)
    scale = _ranges(a)
    for name, size, other in zip(names, scale, _ranges(b)):
        if not size > 0 or not other > 0:
            raise InputError(f"compare: column {name!r} does not vary on {'our' if not size > 0 else 'their'} side")
        if not min(size, other) > max(size, other) / _LARGEST:
            raise InputError(f"compare: column {name!r}: ours changes by {size:.3g}, theirs by {other:.3g}: no curves"
                             f" to compare; are columns and units right?")
    curve = np.column_stack(ours.curve(*names)) if hasattr(ours, "curve") else a
    smooth = Smooth(curve / scale)
    line = smooth.line * scale
    k = _independent(names, curve / scale, b / scale, along)
    matched, partners = _pair(b / scale, smooth) if k is None else _at_same(b / scale, curve / scale, k)
    if not len(matched):
        raise InputError("compare: no point of theirs lies along our curve: are columns, units, order of rows right?")
    partners = partners * scale
    control = next((n for n in names if n in ("pressure", "travel")), names[0])
    return Comparison(names, a, b, line, (matched, partners),
                      {n: _difference(b[matched, k] - partners[:, k], scale[k], partners / scale)
                       for k, n in enumerate(names)},
                      (_limit_points(left, a, names, control),
                       _limit_points(right, b, names, control)),
                      (_resolution(a / scale, k), _resolution(b / scale, k)), "" if k is None else names[k])


def _percent(share: float) -> str:
    return f"{f'{100 * share:.2g} %':>10}"


def _table(side: str, given: Any) -> csv_files.Table:
    if hasattr(given, "states"):
        if len(given) < 2:
            raise InputError(f"compare: {side}: the path has {len(given)} states; it needs at least 2")
        found = csv_files.from_arrays(side, {c: given[c] for c in given.columns})
        return found._replace(kinds=[state.kind for state in given.states])
    return csv_files.from_arrays(f"compare: {side}", given) if isinstance(given, Mapping) else csv_files.read(given)


def _columns(left: csv_files.Table, right: csv_files.Table, given: Any) -> dict[str, str]:
    """Return {column of left: column of right} to compare: the given pairs, else columns of equal name; checked."""
    if given is None:
        shared = [c for c in left.columns if c in right.columns and c != "iterations"]
        pairs = {c: c for c in shared[:2]}
        if len(pairs) < 2:
            raise InputError(f"compare: columns: ours are {', '.join(left.columns)}; theirs are"
                             f" {', '.join(right.columns)}: fewer than two have the same name; say which belong"
                             f" together, as columns={{our name: their name}}")
        return pairs
    pairs = dict(given) if isinstance(given, Mapping) else {
        instance("compare: columns: column", c, str, "a name"): c for c in several("compare: columns", given, "names")}
    if len(pairs) < 2:
        raise InputError(f"compare: columns = {given!r}: a curve needs at least two columns")
    for our, their in pairs.items():
        known(f"compare: {left.name}: column", our, left.columns)
        known(f"compare: {right.name}: column", their, right.columns)
    return pairs


@np.errstate(over="ignore")
def _ranges(points: np.ndarray) -> np.ndarray:
    return np.ptp(points, axis=0)


def _arc_length(points: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


class Smooth:
    """Curve through points by arc length, with Akima's interpolation: a kink (a first contact) causes no oscillation.

    Attributes:
        s: `_SAMPLES` equidistant arc lengths.
        line: points there, shape (m, columns).
    """

    def __init__(self, points: np.ndarray):
        from scipy.interpolate import Akima1DInterpolator, interp1d
        s = _arc_length(points)
        grows = np.concatenate([[True], np.diff(s) > 0])
        points, s = points[grows], s[grows]
        self.at = Akima1DInterpolator(s, points, axis=0) if len(points) > 3 else interp1d(s, points, axis=0)
        self.s = np.linspace(0, s[-1], _SAMPLES)
        self.line = self.at(self.s)

    def foot(self, point: np.ndarray, k: int) -> tuple[np.ndarray, bool]:
        """Return the closest point of the curve between the neighbours of a sample.

        Args:
            point: the point, shape (2,).
            k: number of the sample.

        Returns:
            The closest point, shape (2,); True if `point` lies beyond the end of the curve.
        """
        low, high = max(k - 1, 0), min(k + 1, _SAMPLES - 1)
        line = self.at(np.linspace(self.s[low], self.s[high], _FINE))
        d = np.diff(line, axis=0)
        t = ((point - line[:-1]) * d).sum(1) / (d * d).sum(1)
        feet = line[:-1] + np.clip(t, 0, 1)[:, None] * d
        j = int(np.argmin(((feet - point) ** 2).sum(1)))
        past = 0.0
        if low == 0 and j == 0:
            past = -t[j]
        elif high == _SAMPLES - 1 and j == len(t) - 1:
            past = t[j] - 1
        beyond = float(past * np.linalg.norm(d[j]))
        across = float(np.linalg.norm(point - line[j] - t[j] * d[j]))
        return feet[j], beyond > max(across, 1e-9)


def _costs(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the smallest sums of squared distances by which points can be paired with samples of a curve in order.

    Entry (i, j), shape (points, samples): points 0 to i, with sample j as the partner of point i.
    """
    cost = np.stack([((line - p) ** 2).sum(1) for p in points])
    for i in range(1, len(points)):
        cost[i] += np.minimum.accumulate(cost[i - 1])
    return cost


def _pair(points: np.ndarray, curve: Smooth) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the points with a partner, and their partners on the curve; both in increasing order."""
    n, line = len(points), curve.line
    if n > _MOST:
        raise InputError(f"compare: theirs has {n} points; at most {_MOST} can be compared: thin it out")
    cost = _costs(points, line)
    if 100 * _costs(points[::-1], line)[-1].min() < cost[-1].min():
        raise InputError("compare: theirs runs along our curve backwards: put its rows in order along the path")
    at, partners, kept = len(line) - 1, np.empty_like(points), []
    for i in range(n - 1, -1, -1):
        at = int(np.argmin(cost[i, :at + 1]))
        partners[i], beyond = curve.foot(points[i], at)
        if not beyond:
            kept.append(i)
    kept.reverse()
    return np.array(kept, dtype=int), partners[kept]


def _independent(names: list[str], a: np.ndarray, b: np.ndarray, along: str | None) -> int | None:
    """Return the number of the independent column, or None for the arc length."""
    rising = [k for k in range(len(names)) if _rises(a[:, k]) and _rises(b[:, k])]
    if along is None:
        return min(rising, key=lambda k: _steepest(a, k), default=None)
    known("compare: along", along, [*names, "arc length"])
    if along == "arc length":
        return None
    if names.index(along) not in rising:
        raise InputError(f"compare: along = {along!r}: it turns back, or stands still, on one of the sides: use"
                         f" 'arc length'")
    return names.index(along)


def _rises(values: np.ndarray) -> bool:
    """Return True if values are monotonic."""
    steps = np.diff(values)
    return bool(np.all(steps > 0) or np.all(steps < 0))


def _steepest(points: np.ndarray, k: int) -> float:
    """Return the largest slope of a curve over column k."""
    steps = np.abs(np.diff(points, axis=0))
    return float((steps.max(1) / steps[:, k]).max())


def _over(points: np.ndarray, k: int) -> Any:
    """Return the curve through points as a function of the monotonic column k."""
    from scipy.interpolate import Akima1DInterpolator, interp1d
    points = points[np.argsort(points[:, k])]
    return (Akima1DInterpolator if len(points) > 3 else interp1d)(points[:, k], points, axis=0)


def _at_same(points: np.ndarray, curve: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the points within the curve's ends, and their partners at equal values of column k."""
    low, high = curve[:, k].min(), curve[:, k].max()
    inside = np.flatnonzero((points[:, k] >= low - 1e-9) & (points[:, k] <= high + 1e-9))
    return inside, _over(curve, k)(np.clip(points[inside, k], low, high))


def _difference(values: np.ndarray, size: float, partners: np.ndarray) -> Difference:
    s = _arc_length(partners)
    weights = np.ones(len(s))
    if s[-1] > 0:                                                   # trapezoidal weights
        weights = (np.diff(s, prepend=s[0]) + np.diff(s, append=s[-1])) / 2
    at = int(np.argmax(np.abs(values)))
    return Difference(values, float(size), float(abs(values[at])), at,
                      float(np.sqrt(np.average(values**2, weights=weights))))


def _limit_points(table: csv_files.Table, points: np.ndarray, names: list[str], control: str) -> list[dict[str, float]]:
    """Return the limit points marked in the table, else the turning points of the control on parabolas."""
    if table.kinds is not None and "start" in table.kinds:
        return [dict(zip(names, p.tolist())) for p, kind in zip(points, table.kinds) if kind == "limit point"]
    from scipy.signal import find_peaks
    column = names.index(control)
    y, scaled = points[:, column], points / _ranges(points)
    found = []
    # noise below half a percent is no limit point
    for k in np.sort(np.concatenate([find_peaks(sign * y, prominence=5e-3 * np.ptp(y))[0] for sign in (1, -1)])):
        s = _arc_length(scaled[k - 1:k + 2]) if np.ptp(y[k - 1:k + 2]) > 0 else np.zeros(3)
        if not (s[0] < s[1] < s[2]):
            found.append(points[k])
            continue
        parabolas = np.polyfit(s - s[1], points[k - 1:k + 2], 2)
        at = -parabolas[1, column] / (2 * parabolas[0, column])
        found.append(parabolas[0] * at**2 + parabolas[1] * at + parabolas[2])
    return [dict(zip(names, point.tolist())) for point in found]


def _resolution(points: np.ndarray, k: int | None) -> float:
    """Return the largest distance of every second point from the curve through the others.

    The distance is at the same value of column k; None: across the curve.
    """
    if len(points) < 5:
        return float("inf")
    kept = np.unique(np.append(np.arange(0, len(points), 2), len(points) - 1))
    dropped = np.setdiff1d(np.arange(len(points)), kept)
    if k is not None:
        return float(np.abs(_over(points[kept], k)(points[dropped, k]) - points[dropped]).max())
    curve = Smooth(points[kept])
    feet = [(curve.foot(point, int(np.argmin(((curve.line - point) ** 2).sum(1))))[0], point)
            for point in points[dropped]]
    return float(max(np.linalg.norm(foot - point) for foot, point in feet))
