"""Curves through points in the space of several columns, and the pairing of points with points of a curve.

A curve is given by its points in order, shape (n, c), with c columns. Each column is divided by its range.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError
from ...values.tolerances import CURVE_POINTS, PIECE_POINTS

_MAX_POINTS = 10_000                     # largest number of points to pair: each is compared with every sample


@np.errstate(over="ignore")
def ranges(points: np.ndarray) -> np.ndarray:
    """Return the range of each column, largest minus smallest value, shape (c,), of points (n, c)."""
    return np.ptp(points, axis=0)


def arc_length(points: np.ndarray) -> np.ndarray:
    """Return the arc lengths of points in order, (n, c), along their polyline, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


class SampledCurve:
    """Curve through points, shape (n, c), each column over its range: Akima's interpolation, without oscillation.

    Attributes:
        evaluate: function that returns the points of the curve at arc lengths.
        arc_lengths: m = 2000 equidistant arc lengths, the samples, shape (m,).
        line: points of the curve at these arc lengths, shape (m, c).
    """

    def __init__(self, points: np.ndarray):
        from scipy.interpolate import Akima1DInterpolator, interp1d
        s = arc_length(points)
        advances = np.concatenate([[True], np.diff(s) > 0])
        points, s = points[advances], s[advances]
        self.evaluate = Akima1DInterpolator(s, points, axis=0) if len(points) > 3 else interp1d(s, points, axis=0)
        self.arc_lengths = np.linspace(0, s[-1], CURVE_POINTS)
        self.line = self.evaluate(self.arc_lengths)

    def closest_point(self, point: np.ndarray, k: int) -> tuple[np.ndarray, bool]:
        """Return the closest point (c,) on the two pieces that meet at sample k, and True for one beyond an end."""
        low, high = max(k - 1, 0), min(k + 1, CURVE_POINTS - 1)
        line = self.evaluate(np.linspace(self.arc_lengths[low], self.arc_lengths[high], PIECE_POINTS))
        d = np.diff(line, axis=0)
        t = ((point - line[:-1]) * d).sum(1) / (d * d).sum(1)
        closest = line[:-1] + np.clip(t, 0, 1)[:, None] * d
        j = int(np.argmin(((closest - point) ** 2).sum(1)))
        overshoot = 0.0
        if low == 0 and j == 0:
            overshoot = -t[j]
        elif high == CURVE_POINTS - 1 and j == len(t) - 1:
            overshoot = t[j] - 1
        beyond = float(overshoot * np.linalg.norm(d[j]))
        distance = float(np.linalg.norm(point - line[j] - t[j] * d[j]))
        return closest[j], beyond > max(distance, 1e-9)


def pair_in_order(points: np.ndarray, curve: SampledCurve) -> tuple[np.ndarray, np.ndarray]:
    """Return k indices of points (n, c) and their partners on the curve, (k, c), of least squared distances in order.

    Points beyond the ends are left out. Too many points, or points in the reverse order, are an InputError.
    """
    n, line = len(points), curve.line
    if n > _MAX_POINTS:
        raise InputError(f"compare: theirs has {n} points; at most {_MAX_POINTS} can be compared: thin it out")
    cost = _pairing_costs(points, line)
    if 100 * _pairing_costs(points[::-1], line)[-1].min() < cost[-1].min():
        raise InputError("compare: theirs runs along our curve backwards: put its rows in order along the path")
    sample, partners, kept = len(line) - 1, np.empty_like(points), []
    for i in range(n - 1, -1, -1):
        sample = int(np.argmin(cost[i, :sample + 1]))
        partners[i], beyond = curve.closest_point(points[i], sample)
        if not beyond:
            kept.append(i)
    kept.reverse()
    return np.array(kept, dtype=int), partners[kept]


def pair_at_equal_values(points: np.ndarray, curve: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return j indices of points (n, c) and their partners on a curve (l, c) at equal values of column k, (j, c)."""
    low, high = curve[:, k].min(), curve[:, k].max()
    inside = np.flatnonzero((points[:, k] >= low - 1e-9) & (points[:, k] <= high + 1e-9))
    return inside, _interpolant(curve, k)(np.clip(points[inside, k], low, high))


def resolution_of(points: np.ndarray, k: int | None) -> float:
    """Return the largest error of a curve if every second point is interpolated from the others, dimensionless.

    Points have shape (n, c). The error is that at equal column k, None: the distance; infinite below five points.
    """
    if len(points) < 5:
        return float("inf")
    kept = np.unique(np.append(np.arange(0, len(points), 2), len(points) - 1))
    dropped = np.setdiff1d(np.arange(len(points)), kept)
    if k is not None:
        return float(np.abs(_interpolant(points[kept], k)(points[dropped, k]) - points[dropped]).max())
    curve = SampledCurve(points[kept])
    closest = [(curve.closest_point(point, int(np.argmin(((curve.line - point) ** 2).sum(1))))[0], point)
            for point in points[dropped]]
    return float(max(np.linalg.norm(nearest - point) for nearest, point in closest))


def _pairing_costs(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the least sums of squared distances of points (n, c) to ordered partners in samples (m, c), (n, m)."""
    cost = np.stack([((line - p) ** 2).sum(1) for p in points])
    for i in range(1, len(points)):
        cost[i] += np.minimum.accumulate(cost[i - 1])
    return cost


def _interpolant(points: np.ndarray, k: int) -> Any:
    """Return the interpolated curve through points, shape (n, c), as a function of its monotonic column k."""
    from scipy.interpolate import Akima1DInterpolator, interp1d
    points = points[np.argsort(points[:, k])]
    return (Akima1DInterpolator if len(points) > 3 else interp1d)(points[:, k], points, axis=0)
