"""Curves through points in the space of several columns, and the pairing of points with points of a curve.

A curve is given by its points in order, shape (n, c), with c columns. Each column is divided by its range.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError

_CURVE_SAMPLES = 2000                    # samples of a curve over its arc length
_PIECE_POINTS = 33                         # points of the two pieces of the curve that meet at a sample
_MAX_POINTS = 10_000                     # largest number of points to pair: each is compared with every sample


@np.errstate(over="ignore")
def ranges(points: np.ndarray) -> np.ndarray:
    """Return the range of each column of a curve, its largest minus its smallest value.

    Args:
        points: points of the curve, shape (n, c), in the units of the columns.

    Returns:
        Ranges, shape (c,).
    """
    return np.ptp(points, axis=0)


def arc_length(points: np.ndarray) -> np.ndarray:
    """Return the arc lengths of points along the polyline through them.

    Args:
        points: points in order, shape (n, c).

    Returns:
        Arc lengths from the first point, shape (n,).
    """
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


class SampledCurve:
    """Curve through points in the space of c columns, interpolated over the arc length.

    Akima's interpolation causes no oscillation at a kink, such as a first contact.

    Args:
        points: points of the curve in order, shape (n, c), each column divided by its range.

    Attributes:
        at: function that returns the points of the curve at arc lengths.
        s: m = 2000 equidistant arc lengths, shape (m,), the samples.
        line: points of the curve at these arc lengths, shape (m, c).
    """

    def __init__(self, points: np.ndarray):
        from scipy.interpolate import Akima1DInterpolator, interp1d
        s = arc_length(points)
        grows = np.concatenate([[True], np.diff(s) > 0])
        points, s = points[grows], s[grows]
        self.at = Akima1DInterpolator(s, points, axis=0) if len(points) > 3 else interp1d(s, points, axis=0)
        self.s = np.linspace(0, s[-1], _CURVE_SAMPLES)
        self.line = self.at(self.s)

    def foot(self, point: np.ndarray, k: int) -> tuple[np.ndarray, bool]:
        """Return the point of the curve that is closest to a point, near a sample.

        Args:
            point: the point, shape (c,).
            k: number of the sample; the result lies between the samples before and after it.

        Returns:
            The closest point of the curve, shape (c,); True if `point` lies beyond an end of the curve.
        """
        low, high = max(k - 1, 0), min(k + 1, _CURVE_SAMPLES - 1)
        line = self.at(np.linspace(self.s[low], self.s[high], _PIECE_POINTS))
        d = np.diff(line, axis=0)
        t = ((point - line[:-1]) * d).sum(1) / (d * d).sum(1)
        feet = line[:-1] + np.clip(t, 0, 1)[:, None] * d
        j = int(np.argmin(((feet - point) ** 2).sum(1)))
        past = 0.0
        if low == 0 and j == 0:
            past = -t[j]
        elif high == _CURVE_SAMPLES - 1 and j == len(t) - 1:
            past = t[j] - 1
        beyond = float(past * np.linalg.norm(d[j]))
        across = float(np.linalg.norm(point - line[j] - t[j] * d[j]))
        return feet[j], beyond > max(across, 1e-9)


def paired(points: np.ndarray, curve: SampledCurve) -> tuple[np.ndarray, np.ndarray]:
    """Pair points with points of a curve in order, so that the sum of squared distances is minimal.

    Args:
        points: the points in order, shape (n, c).
        curve: the curve.

    Returns:
        Indices of the k points that do not lie beyond the ends of the curve, shape (k,); their partners on the curve,
        shape (k, c).

    Raises:
        InputError: too many points, or points in the reverse order of the curve.
    """
    n, line = len(points), curve.line
    if n > _MAX_POINTS:
        raise InputError(f"compare: theirs has {n} points; at most {_MAX_POINTS} can be compared: thin it out")
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


def paired_at_equal_values(points: np.ndarray, curve: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Pair points with points of a curve at equal values of one column.

    Args:
        points: the points, shape (n, c).
        curve: points of the curve, shape (l, c).
        k: number of the column.

    Returns:
        Indices of the j points between the ends of the curve, shape (j,); their partners on the curve, shape (j, c).
    """
    low, high = curve[:, k].min(), curve[:, k].max()
    inside = np.flatnonzero((points[:, k] >= low - 1e-9) & (points[:, k] <= high + 1e-9))
    return inside, _over(curve, k)(np.clip(points[inside, k], low, high))


def resolution_of(points: np.ndarray, k: int | None) -> float:
    """Return the largest distance of every second point from the curve through the other points.

    Args:
        points: points of the curve, shape (n, c), each column divided by its range.
        k: column at whose equal values distances are measured; None for distances across the curve.

    Returns:
        Largest distance; infinite for fewer than five points.
    """
    if len(points) < 5:
        return float("inf")
    kept = np.unique(np.append(np.arange(0, len(points), 2), len(points) - 1))
    dropped = np.setdiff1d(np.arange(len(points)), kept)
    if k is not None:
        return float(np.abs(_over(points[kept], k)(points[dropped, k]) - points[dropped]).max())
    curve = SampledCurve(points[kept])
    feet = [(curve.foot(point, int(np.argmin(((curve.line - point) ** 2).sum(1))))[0], point)
            for point in points[dropped]]
    return float(max(np.linalg.norm(foot - point) for foot, point in feet))


def _costs(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the smallest sums of squared distances for pairs of points and samples of a curve, both in order.

    Args:
        points: the points, shape (n, c).
        line: the samples of the curve, shape (m, c).

    Returns:
        Sums, shape (n, m): entry (i, j) is the sum over points 0 to i, with sample j as the partner of point i.
    """
    cost = np.stack([((line - p) ** 2).sum(1) for p in points])
    for i in range(1, len(points)):
        cost[i] += np.minimum.accumulate(cost[i - 1])
    return cost


def _over(points: np.ndarray, k: int) -> Any:
    """Return the curve through points, shape (n, c), as a function of the value of its monotonic column k."""
    from scipy.interpolate import Akima1DInterpolator, interp1d
    points = points[np.argsort(points[:, k])]
    return (Akima1DInterpolator if len(points) > 3 else interp1d)(points[:, k], points, axis=0)
