"""Estimate of the parts of an undeformed sheet that reach the fillets and the flat faces of a tool.

A sheet under pressure is nearly a membrane. In the tool its free surface is a part of a sphere, whose radius decreases
as the pressure increases. So the sheet touches a point of the tool when this radius equals the radius of the largest
ball that touches the tool there. Points in contact stick, and the free part of the sheet stretches evenly along the
section.
In a cup the estimated position of the material on the fillet is wrong by at most 5 % of the length of the sheet
(tests/test_accuracy_in_moulds.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .sizes import length_along


class FilletInSheet(NamedTuple):
    """A fillet of a tool, and the part of the undeformed sheet that is estimated to lie on it.

    Attributes:
        first, last: distances of the ends of this part from the start of the sheet, along the sheet, length.
        radius: radius of the fillet, length.
        turn: 1 - cos of the angle of the arc, at most 1.
        stretch: inverse stretch of the sheet on the fillet along the section, reference over deformed length.
        area_ratio: reference over deformed area there, which equals deformed over reference thickness.
        concave: True if the sheet bridges the fillet before it touches it.
        wall_change: absolute change of the logarithm of the wall over the fillet.
    """

    first: float
    last: float
    radius: float
    turn: float
    stretch: float
    area_ratio: float
    concave: bool
    wall_change: float


class FlatsInSheet(NamedTuple):
    """Points of an undeformed sheet that are estimated to touch the straight pieces of a tool.

    Attributes:
        positions: lengths along the sheet from its start to the points, ascending, shape (n,), length.
        free_radii: radius of the free surface of the sheet when a point touches, shape (n,), length.
        stretches: inverse stretches of the sheet there along the section, reference over deformed length, shape (n,).
        area_ratios: reference over deformed area there, shape (n,).
    """

    positions: np.ndarray
    free_radii: np.ndarray
    stretches: np.ndarray
    area_ratios: np.ndarray


class _Touched(NamedTuple):
    """Estimate of the material that touches the points of a tool.

    Attributes:
        points: points of the tool in order along the sheet, shape (m, 2), length.
        curvature: absolute curvature of the tool there, shape (m,), 1/length.
        free_radii: radius of the largest ball outside the tool that touches it there, shape (m,), length.
        positions: length along the sheet from its start to the material that touches there, shape (m,), length.
        reference_radii: radius of this material in the reference configuration, shape (m,), length.
    """

    points: np.ndarray
    curvature: np.ndarray
    free_radii: np.ndarray
    positions: np.ndarray
    reference_radii: np.ndarray

    def stretches(self, axisymmetric: bool, group: np.ndarray) -> tuple[float, float]:
        """Return reference over deformed length in the section and over deformed area, of consecutive points `group`.
        """
        along = length_along(self.points)
        before, after = max(group[0] - 1, 0), min(group[-1] + 1, len(along) - 1)
        stretch = (self.positions[after] - self.positions[before]) / max(along[after] - along[before], 1e-300)
        stretch = max(stretch, 0.01)                            # also where the estimate puts points on one another
        mean = self.reference_radii[group].mean(), self.points[group, 0].mean()
        return stretch, stretch * (mean[0] / max(mean[1], 1e-300) if axisymmetric else 1.0)

    def wall_change(self, axisymmetric: bool, group: np.ndarray) -> float:
        """Return the absolute change of the logarithm of the wall over consecutive points `group`."""
        sides = np.clip([group[0] - 2, group[-1] + 2], 0, len(self.points) - 1)      # their neighbours are outside, too
        before, after = (max(self.stretches(axisymmetric, side)[1], 1e-9) for side in sides[:, None])
        return float(abs(np.log(after / before)))


_PIECE = 1 / 60
"""Distance between successive points of a tool over the size of the tool."""

_SURFACE_RADII = 80
"""Number of radii of the free surface at which the sheet is examined."""

_MAX_SURFACE_RADIUS = 30.0
"""Largest radius of the free surface over the length of the sheet."""

_MIN_RADIUS_RATIO = 0.6
"""Smallest reference radius over present radius of a point of the sheet at the edge of a moving tool. (The largest
is 1.)"""


def fillets_in_sheet(tool: Any, face: np.ndarray, axisymmetric: bool, moving: bool) -> Iterator[FilletInSheet]:
    """Yield the fillets of a section tool that a sheet may reach, with the part of the sheet on each.

    The undeformed face has points (R, Z), shape (n, 2), length. A `moving` tool moves by an unknown amount.
    """
    s = length_along(face)
    if moving:
        x, _, curvature = _surface(tool, face, s[-1])
        for group in _groups(curvature):
            r = x[group, 0].max()
            first, last = np.interp([_MIN_RADIUS_RATIO * r, r], face[:, 0], s)
            stretch = (1 + _MIN_RADIUS_RATIO) / 2
            yield FilletInSheet(first, last, 1 / curvature[group[0]], 1.0, stretch, stretch, False, 1 - stretch)
        return
    found = _touched(tool, face)
    along = length_along(found.points)
    for group in _groups(found.curvature):
        radius = 1 / found.curvature[group[0]]
        before, after = max(group[0] - 1, 0), min(group[-1] + 1, len(along) - 1)
        angle = min((along[after] - along[before]) / radius, np.pi / 2)
        first, last = found.positions[group[[0, -1]]]
        stretch, area_ratio = found.stretches(axisymmetric, group)
        concave = bool(found.free_radii[group[len(group) // 2]] < 1.5 * radius)
        yield FilletInSheet(first, last, radius, 1 - np.cos(angle), stretch, area_ratio, concave,
                            found.wall_change(axisymmetric, group))


def flats_in_sheet(tool: Any, face: np.ndarray, axisymmetric: bool) -> FlatsInSheet:
    """Return the points of an undeformed face (n, 2), length, that may touch a fixed tool's straight pieces."""
    found = _touched(tool, face)
    straight = np.flatnonzero(found.curvature == 0)
    stretches = [found.stretches(axisymmetric, np.arange(max(k - 1, 0), min(k + 2, len(found.points))))
                 for k in straight]
    order = np.argsort(found.positions[straight], kind="stable")
    along, area = np.array(stretches).reshape(-1, 2)[order].T
    return FlatsInSheet(found.positions[straight][order], found.free_radii[straight][order], along, area)


def _touched(tool: Any, face: np.ndarray) -> _Touched:
    """Return an estimate of the material of a face, (n, 2), length, that will touch points of a fixed tool."""
    s = length_along(face)
    x, normal, curvature = _surface(tool, face, s[-1])
    if len(x) < 2:
        return _Touched(x[:0], *np.zeros((4, 0)))
    free = _free_radii(tool, x, normal, _MAX_SURFACE_RADIUS * s[-1])
    positions = _positions(x, free, face, s)
    return _Touched(x, curvature, free, positions, np.interp(positions, s, face[:, 0]))


def _surface(tool: Any, face: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points of a section tool along a sheet, (m, 2), normals into it, (m, 2), and curvatures, (m,).

    Curvatures are absolute, 1/length; the undeformed face has points (n, 2), and `length` is that of the sheet.
    """
    outline = tool.surface()[0]
    pieces = np.diff(outline, axis=0)
    number = np.ceil(np.hypot(*pieces.T) / (_PIECE * np.ptp(outline, axis=0).max())).astype(int)
    x = np.concatenate([a + d * ((np.arange(n) + 0.5) / n)[:, None] for a, d, n in zip(outline, pieces, number)])
    closest = tool.nearest(x)
    x = x - closest.distance[:, None] * closest.normal                   # from the chords of an arc onto the arc
    closest = tool.nearest(x - 1e-6 * length * closest.normal)
    on_axis = face[0, 0] <= 1e-9 * length, face[-1, 0] <= 1e-9 * length
    first, last = (int(x[:, 0].argmin() if axis else np.hypot(*(x - end).T).argmin())
                   for axis, end in zip(on_axis, face[[0, -1]]))
    order = np.arange(first, last + 1) if first <= last else np.arange(first, last - 1, -1)
    return x[order], closest.normal[order], np.abs(closest.curvature[order])


def _groups(curvature: np.ndarray) -> list[np.ndarray]:
    """Return the indices of points on each arc: consecutive ones of equal curvature (m,) above 0, 1/length."""
    if not len(curvature):
        return []
    same = np.isclose(curvature[1:], curvature[:-1], rtol=1e-3)
    groups = np.split(np.arange(len(curvature)), np.flatnonzero(~same) + 1)
    return [group for group in groups if curvature[group[0]] > 0]


def _free_radii(tool: Any, x: np.ndarray, normal: np.ndarray, largest: float) -> np.ndarray:
    """Return the radius (m,), at most `largest`, of the largest ball outside the tool at points x (m, 2), length."""
    low: np.ndarray = np.zeros(len(x))
    high: np.ndarray = np.full(len(x), largest)
    for _ in range(40):
        radius = (low + high) / 2
        fits = tool.signed_distance(x - radius[:, None] * normal) <= -(1 - 1e-6) * radius
        low, high = np.where(fits, radius, low), np.where(fits, high, radius)
    return low


def _positions(x: np.ndarray, free: np.ndarray, face: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return the positions along the undeformed sheet of the material that touches a tool, shape (m,), length.

    A tool point x, (m, 2), is touched when the radius of the free surface equals its ball `free`, (m,). Each free part
    of the face (n, 2) is an arc and stretches evenly between sticking ends.
    """
    points = np.concatenate([face[:1], x, face[-1:]])
    on_axis = [(end, neighbour) for end, neighbour in ((0, 1), (-1, -2)) if face[end, 0] <= 1e-9 * s[-1]]
    place, sticks = np.full(len(points), np.nan), np.zeros(len(points), bool)
    place[[0, -1]], sticks[[0, -1]] = s[[0, -1]], True
    for radius in np.geomspace(max(free.max(), 1e-12 * s[-1]), max(free.min(), 1e-6 * s[-1]), _SURFACE_RADII):
        touches = sticks.copy()
        touches[1:-1] |= free >= (1 - 1e-9) * radius
        line = points[touches]
        for end, neighbour in on_axis:
            line[end, 1] = np.clip(line[neighbour, 1], *sorted((face[end, 1], x[end, 1])))  # the pole
        chord = np.hypot(*np.diff(line, axis=0).T)
        arc = np.maximum(2 * radius * np.arcsin(np.minimum(chord / (2 * radius), 1.0)), chord)
        along, known = np.concatenate([[0.0], np.cumsum(arc)]), sticks[touches]
        place[touches] = np.interp(along, along[known], place[touches][known])
        sticks = touches
    place[~sticks] = np.interp(np.flatnonzero(~sticks), np.flatnonzero(sticks), place[sticks])
    return place[1:-1]
