"""The triangles of a mesh in the reference configuration: their sizes and shapes, and where in the body one is."""

from typing import Any, NamedTuple

import numpy as np

from ..ranks import gathered
from .mesh import Mesh
from .nodes import of_cells, own_cells


class Place(NamedTuple):
    """A point of the body: reference (R, Z), length; the layer it is in ("" if that is not known); the nearest named
    boundary and its distance, length."""

    R: float
    Z: float
    layer: str
    boundary: str
    distance: float

    def __str__(self) -> str:
        layer = f" in layer {self.layer!r}" if self.layer else ""
        if not self.boundary:
            return f"(R, Z) = ({self.R:.6g}, {self.Z:.6g}){layer}"
        near = f", {self.distance:.3g} from boundary {self.boundary!r}" if self.distance else f", on {self.boundary!r}"
        return f"(R, Z) = ({self.R:.6g}, {self.Z:.6g}){layer}{near}"


def place(mesh: Mesh, point: Any, layer: str = "") -> Place:
    """Return the `Place` of a point, with its nearest boundary; collective.

    Args:
        point: reference coordinates, shape (2,), of a sheet in three dimensions (x, y); the same on all ranks.
    """
    best, size = ("", np.inf), 0.0
    for name in mesh.boundaries:
        nodes = mesh.nodes_of(name)[:, :2]
        if len(nodes):
            away = float(np.hypot(*(nodes - point).T).min())
            best, size = (name, away) if away < best[1] else best, max(size, float(np.abs(nodes).max()))
    R, Z, distance = (0.0 if abs(v) < 1e-9 * size else float(v) for v in (*point, best[1]))
    return Place(R, Z, layer, best[0], distance)


def shape_quality(corners: np.ndarray) -> np.ndarray:
    """4 sqrt(3) area / (sum of squared edges) of triangles, corners (n, 3, 2): 1 equilateral, 0 flat, < 0 inverted."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    squares = sum(((p - q) ** 2).sum(1) for p, q in ((a, b), (b, c), (c, a)))
    return 4 * np.sqrt(3) * area / squares


class Triangles:
    """The m triangles of a mesh, all ranks; collective.

    Attributes:
        corners: shape (m, 3, 2), length.
        layer: names of their layers, shape (m,).
        edge: the longest of each, shape (m,), length; area: shape (m,), length^2.
        slenderness: longest edge over the height on it, shape (m,).
        length: the largest extent of the body; thickness: its area over that length.
    """

    def __init__(self, mesh: Mesh):
        self._mesh = mesh
        n = len(own := own_cells(mesh.domain))
        names = np.full(n, "", dtype=object)
        for name, tag in mesh.layers.items():
            found = mesh.cells.find(tag)
            names[found[found < n]] = name
        self.corners = gathered(mesh.comm, of_cells(mesh.domain, own)[:, :3, :2])  # in three dimensions (x, y)
        self.layer = gathered(mesh.comm, names).astype(str)
        edges = np.stack([np.hypot(*(self.corners[:, i] - self.corners[:, j]).T)
                          for i, j in ((0, 1), (1, 2), (2, 0))], 1)
        self.edge = edges.max(1)
        self.area = np.abs(shape_quality(self.corners)) * (edges**2).sum(1) / (4 * np.sqrt(3))
        self.slenderness = self.edge**2 / (2 * np.maximum(self.area, 1e-300))
        self.length = float(np.ptp(self.corners, axis=(0, 1)).max())
        self.thickness = float(self.area.sum()) / self.length

    def place(self, number: int) -> Place:
        """Return the `Place` of the middle of a triangle."""
        return place(self._mesh, self.corners[number].mean(0), str(self.layer[number]))
