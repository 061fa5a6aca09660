"""Check that the layers of a surface in three dimensions do not pass through each other, or through a mirror plane."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...findings import Finding, register
from ...mesh.boxes import overlapping

_DEPTH = 1e-3
"""Smallest distance by which an edge passes through another triangle, over the extent of the surface.

Layers that a mould presses flat lie on each other to its penetration.
"""

_DEPTH_OF_WALL, _DEPTH_OF_EDGE = 0.5, 0.4
"""The same over the mean thickness, and at most over the median edge: layers at a pinch lie within the wall."""


@register("end")
def crossing_layers(path: Any) -> Iterator[Finding]:
    """Yield a finding if layers of a surface cross each other or a plane of symmetry at the end; collective.

    A membrane has no contact with itself. Layers that meet need a tool between them, such as the parting plane of half
    moulds, or a plane of symmetry.
    """
    scene = path.problem.scene
    if scene.kinematics.components != 3:
        return
    wall = path.wall()
    x, size = wall.deformed_points, float(np.ptp(wall.deformed_points, axis=0).max())
    for plane in scene.symmetry.planes:
        beyond = (plane.position - x[:, plane.axis]) * (1 if plane.above else -1)
        if beyond.max() > 10 * _DEPTH * size:
            yield _finding(f"the surface passes {beyond.max():.3g} through the plane of symmetry"
                           f" {'xyz'[plane.axis]} = {plane.position:.4g}", x[np.argmax(beyond)])
    edge = float(np.median(np.linalg.norm(np.diff(x[wall.triangles], axis=1), axis=2)))
    thickness = float(wall.reference_thickness.mean())
    places = crossings(x, wall.triangles, max(_DEPTH * size, min(_DEPTH_OF_WALL * thickness, _DEPTH_OF_EDGE * edge)))
    if len(places):
        yield _finding(f"layers of the surface pass through each other at {len(places)} edges", places[0])


def _finding(text: str, place: np.ndarray) -> Finding:
    """Return the finding for a fault at a place, shape (3,), length."""
    at = ", ".join(f"{v:.4g}" for v in place)
    return Finding("serious", "membrane", f"{text}, one at (x, y, z) = ({at}): a membrane has no contact with itself",
                   "half moulds that are solid up to their parting plane (fx.tools.half), or a model of the half with"
                   " Symmetry there")


def crossings(points: np.ndarray, triangles: np.ndarray, depth: float) -> np.ndarray:
    """Return the places where edges of a surface pass through its triangles, shape (k, 3), length.

    depth: smallest distance of both ends of an edge from the plane of the triangle, length.
    """
    corners = points[triangles]
    low, high = corners.min(1), corners.max(1)
    found = []
    plane = [np.ascontiguousarray(box[:, [0, 2]]) for box in (low, high)]
    for i, j in overlapping(*plane):
        near = (low[i, 1] <= high[j, 1]) & (low[j, 1] <= high[i, 1])
        apart = ~(triangles[i][:, :, None] == triangles[j][:, None]).any((1, 2))
        i, j = i[near & apart], j[near & apart]
        for a, b in ((i, j), (j, i)):
            A = corners[a]
            normal = np.cross(A[:, 1] - A[:, 0], A[:, 2] - A[:, 0])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
            for k in range(3):
                p, q = corners[b, k], corners[b, (k + 1) % 3]
                d, e = (np.einsum("ni,ni->n", end - A[:, 0], normal) for end in (p, q))
                cut = (d * e < 0) & (np.minimum(np.abs(d), np.abs(e)) > depth)
                place = p[cut] + (d[cut] / (d - e)[cut])[:, None] * (q - p)[cut]
                T, n = A[cut], normal[cut]
                sides = [np.einsum("ni,ni->n", np.cross(T[:, (m + 1) % 3] - T[:, m], place - T[:, m]), n)
                         for m in range(3)]
                found.append(place[np.min(sides, axis=0) > 0])
    return np.concatenate(found) if found else np.zeros((0, 3))
