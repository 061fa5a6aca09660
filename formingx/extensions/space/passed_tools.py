"""Parts of tools that passed through a sheet in three dimensions, between its nodes or with them.

Contact acts at the nodes of the sheet. A pin that is narrower than the triangles meets no node, and in a long step the
nodes pass a thin floor. So points on the surface of the tool are compared with the triangles of the sheet: each must be
on the side of the sheet that its contact names.
"""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..._jit import CFunctions
from .surface_sides import SurfaceSides

_C = CFunctions("extensions/space/crossings.c")

_SPACING = 0.35            # of the points on a tool, over the median edge of the triangles of the sheet
_MOST_POINTS = 20_000      # on the surface of one tool
_OFFSET = np.array([1.3e-6, 0.7e-6, 0.0])
"""Shift of the points in the plane, over the median edge of the triangles of the sheet."""

_MOST_COMPARED = 200       # of points on the wrong side, with all triangles
_TOUCHING = 0.01           # distance of a node from the tool, over the median edge, up to which it touches
_ADVANCES = 40             # of a corner of a triangle towards the tool, each as long as its distance from it
_OFF_SURFACE = 0.5         # distance of a point from the tool's surface, over the spacing, above which it is hidden
_POWERS = np.array([1 << 42, 1 << 21, 1])
"""Factors that turn three numbers of cells below 2^21 into one number."""

_MARGIN = 0.2              # of the points round the sheet, over its extent


class PassedPoint(NamedTuple):
    """Point of a tool that lies on the wrong side of the sheet.

    Attributes:
        ratio: its distance from the nearest triangle, over the longest edge of this triangle.
        depth: this distance, length.
        place: position (x, y, z), shape (3,), length.
        bridged: distance, over the same edge, when all corners of this triangle have moved onto the tool along its
            normal: that of a ridge above a chord. Infinite beside a vertical wall, which the corners do not meet.
    """

    ratio: float
    depth: float
    place: np.ndarray
    bridged: float


class PassedTool:
    """Test of one contact for parts of its tool on the wrong side of the sheet, by the sides of `SurfaceSides`."""

    def __init__(self, face: Any):
        self._face, surface = face, face.rule.surface
        self._whole, scene, flat = surface.whole, surface.scene, surface.mesh.flat
        self._cells, X = self._whole.triangles, self._whole.reference
        corners = X[self._cells]
        edges = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2)
        self._size = float(np.median(edges))
        self._sides = SurfaceSides(self._cells, X, flat, scene.symmetry.planes, self._size)
        self._faces_out = face.contact.on in ("top", "outer")
        way = face.contact.travel_vector
        margin = (1.0 if way[0] or way[1] or not flat else _MARGIN) * np.ptp(X, axis=0).max()
        points = surface_points(face.contact.tool, _SPACING * self._size, X, margin)
        for plane in scene.symmetry.planes:
            if way[plane.axis] == 0:                          # the mirror image of the sheet is on the other side
                points = points[(points[:, plane.axis] >= plane.position) == plane.above]
        self._points = points + self._size * _OFFSET @ self._sides.axes           # off the edges, which no ray must hit

    def deepest(self, fields: np.ndarray, control: float, limit: float, bridged_limit: float) -> PassedPoint | None:
        """Return the point of the tool with the largest ratio above `limit`, or None; collective.

        fields: owned, shape (n,). Points whose ratio `bridged` (computed above `limit`, else infinite) is below its
        limit come last; with 0 none is. Points nearer to a node than `limit` times the median edge are not examined.
        """
        face, x, sides = self._face, self._points, self._sides
        shift = face.tool_displacement(control)
        P = self._whole.positions(fields) - shift
        x = x[sides.within(x, P, not self._faces_out)] if sides.known else x[:0]
        if not len(x):
            return None
        outside, met = sides.outside(x, P, shift[2])
        wrong = np.flatnonzero(met & (outside != self._faces_out))
        wrong = wrong[far_off(x[wrong], P, limit * self._size)]
        wrong = wrong[far_off(x[wrong], P[sides.edge], self._size)]           # at its edge, the sheet is not continued
        if not len(wrong):
            return None
        wrong = wrong[:: max(len(wrong) // _MOST_COMPARED, 1)]
        depth, longest, triangle = np.zeros(len(wrong)), np.zeros(len(wrong)), np.zeros(len(wrong), dtype=np.int64)
        x = np.ascontiguousarray(x[wrong])
        _C.distances(len(x), x, len(self._cells), P, self._cells, np.empty((len(self._cells), 4)), depth, longest,
                     triangle)
        ratio, bridged = depth / longest, np.full(len(x), np.inf)
        if bridged_limit > 0 and (far := np.flatnonzero(ratio > limit)).size:
            travels = self._travels(x[far], P[self._cells[triangle[far]]], (bridged_limit * longest - depth)[far])
            bridged[far] = (depth[far] + travels) / longest[far]
        k = np.lexsort((ratio, bridged >= bridged_limit))[-1]
        return PassedPoint(float(ratio[k]), float(depth[k]), x[k] + shift, float(bridged[k]))

    def _travels(self, x: np.ndarray, corners: np.ndarray, most: np.ndarray) -> np.ndarray:
        """Return how far triangles move along their normals until all corners are on the tool, shape (n,), length.

        It is infinite above `most`, (n,). x: points of the tool, (n, 3); corners: shape (n, 3, 3), length.
        """
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        normal *= np.sign(np.einsum("ni,ni->n", normal, x - corners.mean(1)))[:, None]          # out of the tool
        close, tool = _TOUCHING * self._size, self._face.contact.tool
        travel, moves = np.zeros(corners.shape[:2]), np.ones(corners.shape[:2], dtype=bool)
        for _ in range(_ADVANCES):                            # the distance from the tool is a safe advance
            i, j = np.nonzero(moves)
            if not len(i):
                break
            gap = -tool.signed_distance(corners[i, j] - travel[i, j, None] * normal[i])
            travel[i, j] += np.maximum(gap, close)
            moves[i, j] = (gap > close) & (travel[i, j] < most[i])
        return np.where((travel < most[:, None]) & ~moves, travel, np.inf).max(1)


def far_off(x: np.ndarray, points: np.ndarray, distance: float) -> np.ndarray:
    """Return the mask of positions x, shape (n, 3), farther than a distance from all points, shape (m, 3), length."""
    found = np.empty(len(x), dtype=int)
    _C.far_off(len(x), x, len(points), points, distance, found)
    return found > 0


def surface_points(tool: Any, spacing: float, nodes: np.ndarray, margin: float) -> np.ndarray:
    """Return points on the surface of a tool over the sheet and a strip of width `margin`, shape (n, 3), length.

    Drawn triangles are divided to `spacing`, and the points moved onto the tool, without those inside another part.
    nodes: of the flat sheet, shape (m, 3), length.
    """
    low, high = nodes[:, :2].min(0) - margin, nodes[:, :2].max(0) + margin
    key = (spacing, *low, *high)
    if key not in _stored.setdefault(tool, {}):
        _stored[tool][key] = _surface_points(tool, spacing, low, high)
    return _stored[tool][key]


_stored: WeakKeyDictionary[Any, dict[tuple[float, ...], np.ndarray]] = WeakKeyDictionary()
"""Points on tools, of the arguments with which they were asked for."""


def _surface_points(tool: Any, spacing: float, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the points of `surface_points` between two corners in the plane, shape (2,), length."""
    points, triangles = tool.surface()
    corners = points[triangles]
    over = (corners[..., :2].max(1) >= low).all(1) & (corners[..., :2].min(1) <= high).all(1)
    corners = corners[over]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    edges = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2)
    spacing = max(spacing, float(np.sqrt(area.sum() / _MOST_POINTS)))
    found, rng = [corners.reshape(-1, 3)], np.random.default_rng(0)
    count = np.ceil(area / spacing**2).astype(int)
    rows = np.repeat(np.arange(len(corners)), count)
    u = np.sort(rng.uniform(size=(len(rows), 2)), axis=1)
    weights = np.column_stack([u[:, 0], u[:, 1] - u[:, 0], 1 - u[:, 1]])
    found.append(np.einsum("nk,nki->ni", weights, corners[rows]))
    for k in range(3):                                        # on long edges
        pieces = np.ceil(edges[:, k] / spacing).astype(int)
        rows = np.repeat(np.arange(len(corners)), np.maximum(pieces - 1, 0))
        place = np.arange(len(rows)) - np.repeat(np.cumsum(pieces - 1) - (pieces - 1), np.maximum(pieces - 1, 0)) + 1
        share = (place / pieces[rows])[:, None]
        found.append((1 - share) * corners[rows, k - 1] + share * corners[rows, k])
    x = np.concatenate(found)
    x = x[((x[:, :2] >= low) & (x[:, :2] <= high)).all(1)]
    cell = np.round((x - x.min(0, initial=np.inf)) / (spacing / 2)).astype(np.int64)
    x = x[np.unique(cell @ _POWERS, return_index=True)[1]]
    near = tool.distances(x)
    on = np.abs(near.distance) < _OFF_SURFACE * spacing
    x = x[on] - (near.distance[:, None] * near.normal)[on]
    return np.ascontiguousarray(x)
