"""Check of a state of a surface in three dimensions: do its layers pass through each other, or through a mirror plane?

A membrane has no contact with itself. Layers that meet need a tool between them, such as the parting plane of half
moulds, or a plane of symmetry.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..._jit import CFunctions
from ...findings import coordinates

_C = CFunctions("extensions/space/layers.c")

_DEPTH = 1e-3
"""Smallest distance by which an edge passes through another triangle, over the extent of the surface.

Layers that a mould presses flat lie on each other to its penetration.
"""

_DEPTH_OF_WALL, _DEPTH_OF_EDGE = 0.5, 0.4
"""The same over the mean thickness, and at most over the longest edge of its triangle.

Layers at a pinch lie within the wall.
"""

_CREASE = 4.0
"""Distance of two triangles in the reference configuration, over the mean thickness, below which only the wall counts.

A membrane has no bending stiffness: at the end of a pinch it folds within a few walls, where a body is only compressed.
"""

_BEYOND_PLANE = 0.02
"""Largest distance of a surface beyond a plane of symmetry, over its extent."""


class SelfPenetration:
    """Check of the states of a surface for layers that cross each other or a plane of symmetry."""

    def __init__(self, surface: Any):
        self._whole, self._planes = surface.whole, surface.scene.symmetry.planes
        X = self._whole.reference
        thickness = np.sum([given(*X.T) for given in surface.scene.thickness.values()], axis=0)
        self._thickness = float(thickness.mean())

    def reasons(self, fields: np.ndarray) -> Iterator[str]:
        """Yield each reason why no sheet can have a state, as text; fields: owned unknowns; collective."""
        x = self._whole.positions(fields)
        size = float(np.ptp(x, axis=0).max())
        for plane in self._planes:
            beyond = (plane.position - x[:, plane.axis]) * (1 if plane.above else -1)
            k = int(np.argmax(beyond))
            if beyond[k] > _BEYOND_PLANE * size:
                yield (f"the sheet crosses the plane of symmetry {'xyz'[plane.axis]} = {plane.position:.4g} by"
                       f" {beyond[k]:.3g} at (x, y, z) = {coordinates(x[k])}, where its mirror image is: a tool between"
                       f" both halves is missing")
        found = crossings(x, self._whole.triangles, _DEPTH * size, _DEPTH_OF_WALL * self._thickness,
                          self._whole.reference, _CREASE * self._thickness)
        if len(found):
            k = int(np.argmax(found[:, 3]))
            yield (f"the sheet passes through itself at (x, y, z) = {coordinates(found[k, :3])}, where an edge of one"
                   f" layer is {found[k, 3]:.2g} beyond the other: a membrane has no contact with itself. Put a tool"
                   f" between the layers, such as half moulds that are solid up to their parting plane"
                   f" (fx.tools.half), or model one half with Symmetry there, or stop before they meet (until=)")


def crossings(points: np.ndarray, triangles: np.ndarray, least: float, wall: float = 0.0,
              reference: np.ndarray | None = None, crease: float = 0.0) -> np.ndarray:
    """Return the places where edges of a surface pass through its triangles, and their depths, (k, 4), length.

    The depth is the smaller distance of an edge's ends from the plane. Edges count that are deeper than `least`, and
    than `wall` or 0.4 of the triangle's longest edge. Of two triangles nearer than `crease` in the reference
    configuration, shape (n, 3), `wall` alone counts.
    """
    X = points if reference is None else reference
    room = 100
    while True:
        found = np.empty((room, 4))
        count = _C.crossings(len(triangles), points, triangles, least, wall, _DEPTH_OF_EDGE, X, crease, room,
                             found)
        if count < 0:
            raise MemoryError("no memory to compare the triangles of a surface")
        if count <= room:
            return found[:count]
        room = count
