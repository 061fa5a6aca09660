"""Sides of a surface in three dimensions, by the signs of the triangles that a ray from a point crosses.

A flat sheet is continued by its plane beyond its edge, and rays lead along z. A curved surface is continued by lids
normal to z at its open edges, and by planes of symmetry. A horizontal ray that leads away from these planes meets
neither.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..._jit import CFunctions
from ...mesh.edges import edges_of
from ...mesh.nodes import SAME_PLACE

_C = CFunctions("extensions/space/crossings.c")

_MAX_LEVELS = 4            # heights at which a curved surface may have open edges
_SAMPLES = 50              # triangles whose both sides are tried
_NEAR = 1e-3               # distance of these points from a triangle, over the median edge


class SurfaceSides:
    """Side of points of a surface: outside is the side of the face "top" or "outer".

    cells: shape (m, 3), counter-clockwise from outside; X: reference positions of nodes, shape (n, 3), length; planes:
    the `MirrorPlane`s of the scene; size: median edge, length.

    Attributes:
        flat: True if the surface is a flat sheet in the plane z = 0.
        axes: rows are two unit vectors normal to the rays, and that of the rays, shape (3, 3).
        edge: nodes at the edge of the surface, without its cuts at planes of symmetry, shape (k,).
        known: False if the sides of the surface are not known: its open edges are not normal to z.
    """

    def __init__(self, cells: np.ndarray, X: np.ndarray, flat: bool, planes: tuple[Any, ...], size: float):
        self._cells, self._flat, self._size, self._planes = np.ascontiguousarray(cells), flat, size, planes
        self.axes, self.edge, self.known = np.eye(3), _outer_nodes(cells, X, planes), True
        self._levels: list[tuple[np.ndarray, float]] = []
        if flat:
            return
        way = np.array([0.8, 0.6, 0.0])
        for plane in planes:
            way[plane.axis] *= 1.0 if plane.above else -1.0
        way[2] = 0.0
        self.axes = np.array([np.cross([0.0, 0.0, 1.0], way), [0.0, 0.0, 1.0], way])
        heights = np.round(X[self.edge, 2] / np.ptp(X, axis=0).max(), 5)
        levels = np.unique(heights)
        self._levels = [(self.edge[heights == level], 1.0 if X[self.edge[heights == level], 2].mean()
                         > X[:, 2].mean() else -1.0) for level in levels[:_MAX_LEVELS]]
        self.known = len(levels) <= _MAX_LEVELS and self._consistent(X)

    def within(self, x: np.ndarray, P: np.ndarray, beyond: bool) -> np.ndarray:
        """Return the mask of points, shape (n, 3), whose side is known; nodes P, shape (k, 3), length.

        A flat sheet has sides over its extent. A curved surface has them between its lids and planes of symmetry.
        beyond: False to leave out points beyond the extent of a curved surface, which are outside.
        """
        low, high = P.min(0), P.max(0)
        if self._flat:
            low[2], high[2] = -np.inf, np.inf
        elif beyond:
            cut = np.zeros((2, 3), dtype=bool)
            for plane in self._planes:
                cut[0 if plane.above else 1, plane.axis] = True
            low, high = np.where(cut[0], low, -np.inf), np.where(cut[1], high, np.inf)
        for nodes, sign in self._levels:                     # a lid closes the surface there
            if sign > 0:
                high[2] = min(high[2], P[nodes, 2].min())
            else:
                low[2] = max(low[2], P[nodes, 2].max())
        return np.asarray(((x >= low) & (x <= high)).all(1))

    def outside(self, x: np.ndarray, P: np.ndarray, height: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the masks of points that are outside, and of points whose ray crosses the surface, shape (n,) each.

        x: shape (n, 3); P: nodes, shape (k, 3), length. height: z of the point that has z = 0 here, length.
        """
        y, Q = (np.ascontiguousarray(points @ self.axes.T) for points in (x, P))
        low, high = Q[:, :2].min(0), Q[:, :2].max(0)
        n = np.maximum(np.ceil((high - low) / self._size), 1).astype(int)
        cell = np.clip(((y[:, :2] - low) / self._size).astype(int), 0, n - 1) @ [n[1], 1]
        first = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=n[0] * n[1]))])
        ahead, total, number = (np.zeros(len(y), dtype=int) for _ in range(3))
        _C.crossings(len(y), y, len(self._cells), Q, self._cells, first, np.argsort(cell, kind="stable"), *low,
                     self._size, *n, ahead, total, number)
        if self._flat:
            return ahead + ((total == 0) & (x[:, 2] + height < 0)) <= 0, number > 0
        return ahead <= 0, np.ones(len(y), dtype=bool)

    def _consistent(self, X: np.ndarray) -> bool:
        """Return True if points on both sides of some triangles in the reference configuration are found there."""
        rows = np.unique(np.linspace(0, len(self._cells) - 1, _SAMPLES).astype(int))
        corners = X[self._cells[rows]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal *= _NEAR * self._size / np.linalg.norm(normal, axis=1, keepdims=True)
        middle = corners.mean(1)
        return bool(self.outside(middle + normal, X)[0].all() and not self.outside(middle - normal, X)[0].any())


def _outer_nodes(cells: np.ndarray, X: np.ndarray, planes: tuple[Any, ...]) -> np.ndarray:
    """Return the nodes (k,) at the edge of cells (m, 3), positions X (n, 3), without cuts at planes of symmetry."""
    _, edges, _, times = edges_of(cells)
    outer = edges[times == 1]
    for plane in planes:
        off = np.abs(X[outer, plane.axis] - plane.position).max(1)
        outer = outer[off > SAME_PLACE * np.ptp(X, axis=0).max()]
    return np.unique(outer)
