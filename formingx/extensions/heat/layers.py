"""Mesh for heat: elements below faces that exchange heat are cut into thin layers.

By a time t heat penetrates to a depth sqrt(a t), with the diffusivity a, and elements there must be smaller. The
thickness of a layer at a depth y is a given part of a length. This is the penetration depth at the first time of
interest, or y/3 if that is larger. Later and deeper profiles are therefore resolved too.

An edge between two elements is cut once, for both. Triangles are cut into rows between the cuts of their edges, in the
shape of the original element.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ...mesh import Mesh
from ...mesh.grid import Grid, gathered, to_mesh

_LAYER_THICKNESS = 0.3
"""Thickness of a layer over the penetration depth of heat: errors are then some 1e-5 of the span of temperatures."""
_MAX_DEPTH = 7.0
"""Largest depth of heat over the penetration depth at the last time: 1 - erf(7/2) is 7e-7."""
_ROUNDING_MARGIN = 0.2
"""Part of a layer by which the required number of layers is reduced before it is rounded up."""
_SAMPLES = (1 - np.cos(np.pi * np.linspace(0.0, 1.0, 2001))) / 2
"""Positions along an edge, from 0 to 1, at which the required thickness of layers is integrated."""


def layered(mesh: Mesh, depths: Mapping[str, tuple[float, float]], moved: Callable | None = None) -> Mesh:
    """Cut elements below faces into thin layers by depths of penetration, length, in positions `moved`; collective."""
    grid = gathered(mesh)
    cuts = _cuts(grid, depths, moved(grid.points) if moved else grid.points)
    try:
        return to_mesh(lambda: _cut_grid(grid, cuts), mesh.comm, "the mesh, cut into layers for heat") if cuts else mesh
    except InputError:           # an element is so curved that straight rows do not fit in it: a quarter of its height
        return mesh


def graded(mesh: Mesh, faces: Sequence[str], part: float, depth: float) -> list[float]:
    """Return relative sizes of layers that grow by 1.26 with the distance from the faces, bottom up; collective.

    The first is at most `part` of the present element and `_LAYER_THICKNESS` times the penetration depth (length).
    """
    grid = gathered(mesh)
    heights, lengths, area = zip(*(_boundary_sizes(grid, face) for face in faces))
    thinnest, longest = min([_LAYER_THICKNESS * depth, *(part * height for height in heights)]), max(lengths)
    n = int(np.ceil(3 * np.log2((2 ** (1 / 3) - 1) * area[0] / longest / len(faces) / thinnest + 1)))
    sizes = [2 ** (k / 3) for k in range(n)]
    return sizes + sizes[::-1] if len(faces) > 1 else sizes if "bottom" in faces else sizes[::-1]


def height_at(mesh: Mesh, face: str) -> float:
    """Return the median height of the elements along a boundary, perpendicular to it, length; collective."""
    return _boundary_sizes(gathered(mesh), face)[0]


def _boundary_sizes(grid: Grid, face: str) -> tuple[float, float, float]:
    """Return median height of the elements along a face, length of the face, and area of the whole grid."""
    triangles = np.concatenate([rows[:, :3] for rows in grid.layers.values()])
    double = np.abs(np.linalg.det(grid.points[triangles[:, 1:]] - grid.points[triangles[:, :1]]))
    ends = grid.boundaries[face][:, :2]
    length = np.hypot(*(grid.points[ends[:, 1]] - grid.points[ends[:, 0]]).T)
    below = [np.flatnonzero(np.isin(triangles, edge).sum(1) == 2)[0] for edge in ends]
    return float(np.median(double[below] / length)), float(length.sum()), float(double.sum() / 2)


def _cuts(grid: Grid, depths: Mapping[str, tuple[float, float]],
          points: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    """Return {(first, last): cuts} of edges, which divide elements below heated or cooled faces into thin layers.

    Keys are node numbers, the first of smaller (R, Z); cuts increase from 0 to 1. Depths are measured at `points`,
    shape (n, 2), length.
    """
    if not depths:
        return {}
    below = np.array([_distance_from_edges(points, grid.boundaries[name][:, :2]) for name in depths])
    first, last = (np.array(values)[:, None] for values in zip(*depths.values()))
    edges = np.unique(np.concatenate([_ordered(grid.points, rows[:, [i, j]]) for rows in grid.layers.values()
                                      for i, j in ((0, 1), (1, 2), (2, 0))]), axis=0)
    ends = below[:, edges]                                   # shape (faces, edges, 2)
    across, nearest = np.abs(np.diff(ends)[..., 0]), ends.min(2)
    at_most = (across / (_LAYER_THICKNESS * np.maximum(first, nearest / 3)) * (nearest < _MAX_DEPTH * last)).sum(0)
    found = {}
    for k in np.flatnonzero(at_most > 1 + _ROUNDING_MARGIN):
        y = ends[:, k, :1] * (1 - _SAMPLES) + ends[:, k, 1:] * _SAMPLES
        size = np.where(y < _MAX_DEPTH * last, _LAYER_THICKNESS * np.maximum(first, y / 3), np.inf)
        density = np.where(size == size.min(0), across[:, k, None] / size, 0.0).max(0)
        layers = np.concatenate([[0.0], np.cumsum(np.diff(_SAMPLES) * (density[1:] + density[:-1]) / 2)])
        n = int(np.ceil(layers[-1] - _ROUNDING_MARGIN))
        if n > 1:
            found[tuple(edges[k].tolist())] = np.interp(np.arange(1, n) / n * layers[-1], layers, _SAMPLES)
    return found


def _distance_from_edges(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the distance of points (n, 2) from the nearest straight edge, node numbers (m, 2), shape (n,), length."""
    away = np.full(len(points), np.inf)
    for a, b in points[edges]:
        along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        away = np.minimum(away, np.hypot(*(points - a - along[:, None] * (b - a)).T))
    return away


def _ordered(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return edges, shape (n, 2), whose first end has the smaller R, or the smaller Z at equal R."""
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    swap = (a[:, 0] > b[:, 0]) | (a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1])
    return np.where(swap[:, None], edges[:, ::-1], edges)


class _Nodes:
    """Nodes of a grid whose elements are cut into layers: the old nodes, and new ones on cut edges and in triangles.

    Cuts are {(first, last): positions from 0 to 1} for the node numbers of the ends of an edge.

    Attributes:
        points: list of the positions of all nodes so far, shape (2,) each, length.
    """

    def __init__(self, grid: Grid, cuts: dict[tuple[int, int], np.ndarray]):
        self._old, self._cuts = grid.points, cuts
        self.points: list[Any] = [*grid.points]
        self._edge_nodes: dict[tuple[int, int], list[int]] = {}
        self._middles: dict[tuple[int, int], int] = {}

    def edge_nodes(self, a: int, b: int, curve: np.ndarray) -> tuple[list[int], np.ndarray]:
        """Return numbers and positions, 0 at node a to 1 at b, of the nodes along an edge, with new nodes at its cuts.

        `curve` has the ends of the edge, and its middle if it is quadratic, shape (2 or 3, 2), length.
        """
        forward = bool(_ordered(self._old, np.array([[a, b]]))[0, 0] == a)
        key = (a, b) if forward else (b, a)
        places = np.concatenate([[0.0], self._cuts.get(key, np.zeros(0)), [1.0]])
        if key not in self._edge_nodes:
            shape = curve if forward else curve[[1, 0, *range(2, len(curve))]]
            self._edge_nodes[key] = [key[0], *(self._new(p) for p in _on_curve(shape, places[1:-1])), key[1]]
        nodes = self._edge_nodes[key]
        return (nodes, places) if forward else (nodes[::-1], 1 - places[::-1])

    def middle(self, a: int, b: int, point: np.ndarray | None = None) -> int:
        """Return the number of the middle node of an edge between nodes a and b; the first call adds it at `point`."""
        key = min(a, b), max(a, b)
        if key not in self._middles:
            self._middles[key] = self._new(point)
        return self._middles[key]

    def keep(self, a: int, b: int, middle: int) -> None:
        """Store the middle node of the uncut edge (a, b), so that `middle` returns it."""
        self._middles[min(a, b), max(a, b)] = middle

    def _new(self, point: Any) -> int:
        """Add a node at a point and return its number."""
        self.points.append(point)
        return len(self.points) - 1


def _on_curve(curve: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return points of an edge at parameters s from 0 to 1, shape (n, 2); `curve` is its 2 or 3 nodes, length."""
    s = np.asarray(s, dtype=float)[:, None]
    if len(curve) == 2:
        return (1 - s) * curve[0] + s * curve[1]
    return (1 - s) * (1 - 2 * s) * curve[0] + s * (2 * s - 1) * curve[1] + 4 * s * (1 - s) * curve[2]


def _in_element(nodes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the position, shape (2,), at area coordinates x (3,) of a triangle with 3 or 6 nodes."""
    if len(nodes) == 3:
        return x @ nodes
    return (x * (2 * x - 1)) @ nodes[:3] + 4 * np.array([x[0] * x[1], x[1] * x[2], x[2] * x[0]]) @ nodes[3:]


def _cut_grid(grid: Grid, cuts: dict[tuple[int, int], np.ndarray]) -> Grid:
    """Return a grid in which triangles are divided between the cuts, {(first, last): positions from 0 to 1}."""
    nodes = _Nodes(grid, cuts)
    quadratic = next(iter(grid.layers.values())).shape[1] == 6
    layers, boundaries = {}, {}
    for name, triangles in grid.layers.items():
        layers[name] = np.array([new for row in _integer_rows(triangles)
                                 for new in _pieces(grid, nodes, row, quadratic)])
    for name, edges in grid.boundaries.items():
        found = []
        for row in _integer_rows(edges):
            line, _ = nodes.edge_nodes(row[0], row[1], grid.points[row])
            found += [[a, b, nodes.middle(a, b)] if quadratic else [a, b] for a, b in zip(line, line[1:])]
        boundaries[name] = np.array(found, dtype=np.int64).reshape(-1, 3 if quadratic else 2)
    points = np.array(nodes.points)
    return Grid(points, np.arange(1, len(points) + 1), layers, boundaries)


def _integer_rows(table: np.ndarray) -> list[list[int]]:
    """Return the rows of an integer table as lists of int."""
    return [list(map(int, row)) for row in table]


def _pieces(grid: Grid, nodes: _Nodes, row: list[int], quadratic: bool) -> list[list[int]]:
    """Cut the triangle with node numbers `row` into smaller ones, rows of 3 or 6 numbers; adds new nodes to `nodes`."""
    element, at = grid.points[row], {row[k]: np.eye(3)[k] for k in range(3)}      # area coordinates of nodes
    sides = {}
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        middle = [row[3 + k]] if quadratic else []
        line, places = nodes.edge_nodes(row[i], row[j], grid.points[[row[i], row[j], *middle]])
        sides[k] = line
        at |= {n: (1 - s) * np.eye(3)[i] + s * np.eye(3)[j] for n, s in zip(line[1:-1], places[1:-1])}
        if quadratic and len(line) == 2:
            nodes.keep(row[i], row[j], middle[0])
    # rows begin at the corner that faces the side with the fewest cuts; their last triangle is a fan, if that has any
    side = min(range(3), key=lambda k: (len(sides[k]), *element[(k + 2) % 3]))
    corner = (side + 2) % 3
    left, right, end = sides[corner], sides[(side + 1) % 3][::-1], sides[side]
    found, tip, i, j = [[left[0], left[1], right[1]]], left[0], 1, 1
    while (i, j) != (len(left) - 1, len(right) - 1):
        on_left = j == len(right) - 1 or i < len(left) - 1 and at[left[i + 1]][corner] >= at[right[j + 1]][corner]
        tip = left[i] if on_left else right[j]
        found.append([left[i], left[i + 1], right[j]] if on_left else [left[i], right[j + 1], right[j]])
        i, j = (i + 1, j) if on_left else (i, j + 1)
    found[-1:] = [[tip, a, b] for a, b in zip(end, end[1:])]
    if quadratic:
        found = [[*new, *(nodes.middle(a, b, _in_element(element, (at[a] + at[b]) / 2))
                          for a, b in zip(new, [*new[1:], new[0]]))] for new in found]
    return found
