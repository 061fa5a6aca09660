"""Triangles of a mesh in the reference configuration: sizes, shapes, and places in the body."""

from typing import Any, NamedTuple

import numpy as np

from ..findings import coordinates
from ..ranks import gathered
from .mesh import Mesh
from .nodes import cell_node_positions, own_cells


class Place(NamedTuple):
    """Place of a point in a body, for messages.

    Attributes:
        position: reference coordinates (R, Z), in three dimensions (x, y, z), length.
        layer: name of the layer, "" if unknown.
        boundary: name of the nearest boundary, "" for a mesh without boundaries.
        distance: distance from the nearest node of this boundary, length.
    """

    position: tuple[float, ...]
    layer: str
    boundary: str
    distance: float

    @property
    def R(self) -> float:
        """First reference coordinate, R of a section, length."""
        return self.position[0]

    @property
    def Z(self) -> float:
        """Second reference coordinate, Z of a section, length."""
        return self.position[1]

    def __str__(self) -> str:
        layer = f" in layer {self.layer!r}" if self.layer else ""
        axes = "(R, Z)" if len(self.position) == 2 else "(x, y, z)"
        where = f"{axes} = {coordinates(self.position, 6)}{layer}"
        if not self.boundary:
            return where
        side = f", {self.distance:.3g} from boundary {self.boundary!r}" if self.distance else f", on {self.boundary!r}"
        return where + side


def place(mesh: Mesh, point: Any, layer: str = "") -> Place:
    """Return the place of a point, (2,) or (3,), length, with the nearest boundary, for messages; collective."""
    best, size = ("", np.inf), 0.0
    for name in mesh.boundaries:
        nodes = mesh.nodes_of(name)
        if len(nodes):
            gap = float(np.linalg.norm(nodes - point, axis=1).min())
            best, size = (name, gap) if gap < best[1] else best, max(size, float(np.abs(nodes).max()))
    *position, distance = (0.0 if abs(v) < 1e-9 * size else float(v) for v in (*point, best[1]))
    return Place(tuple(position), layer, best[0], distance)


def shape_quality(corners: np.ndarray) -> np.ndarray:
    """Return 4 sqrt(3) area/(l_1^2 + l_2^2 + l_3^2), (n,), of triangles, corners (n, 3, 2 or 3), length.

    It is 1 for an equilateral triangle, 0 for a flat one, and in the plane negative for a clockwise one.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    if corners.shape[2] == 3:
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    else:
        area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    squares = sum(((p - q) ** 2).sum(1) for p, q in ((a, b), (b, c), (c, a)))
    return 4 * np.sqrt(3) * area / squares


class Triangles:
    """Sizes of the m triangles of a mesh, gathered from all ranks; collective.

    Attributes:
        corners: corners (R, Z), in three dimensions (x, y, z), shape (m, 3, 2 or 3), length.
        layer: names of their layers, shape (m,).
        edge: longest edges, shape (m,), length.
        area: areas, shape (m,), length^2.
        slenderness: longest edge over the height on this edge, shape (m,).
        length: longer side of the bounding box of the body, length.
        thickness: area of the section of the body over `length`, length.
    """

    def __init__(self, mesh: Mesh):
        self._mesh = mesh
        n = len(owned := own_cells(mesh.domain))
        names = np.full(n, "", dtype=object)
        for name, tag in mesh.layers.items():
            found = mesh.cells.find(tag)
            names[found[found < n]] = name
        self.corners = gathered(mesh.comm, cell_node_positions(mesh.domain, owned)[:, :3])
        self.layer = gathered(mesh.comm, names).astype(str)
        edges = np.stack([np.linalg.norm(self.corners[:, i] - self.corners[:, j], axis=1)
                          for i, j in ((0, 1), (1, 2), (2, 0))], 1)
        self.edge = edges.max(1)
        self.area = np.abs(shape_quality(self.corners)) * (edges**2).sum(1) / (4 * np.sqrt(3))
        self.slenderness = self.edge**2 / (2 * np.maximum(self.area, 1e-300))
        self.length = float(np.ptp(self.corners, axis=(0, 1)).max())
        self.thickness = float(self.area.sum()) / self.length

    def place(self, number: int) -> Place:
        """Return the `Place` of the centroid of triangle `number`."""
        return place(self._mesh, self.corners[number].mean(0), str(self.layer[number]))
