"""Mesh of a trimmed sheet: the elements up to a cut."""

import numpy as np

from ...mesh.grid import Grid, gathered, to_mesh
from ...mesh.mesh import Mesh

_EDGES = ((0, 1), (1, 2), (2, 0))
"""Corner numbers of the edges of a triangle."""


def trimmed_mesh(mesh: Mesh, line: np.ndarray, segments: int) -> Mesh:
    """Return the elements of a mesh along the first segments of a polyline (n, 2) through the body; collective.

    A boundary that vanishes, such as the rim, moves to the cut edges, else "trim". An empty layer is an InputError.
    """
    grid = gathered(mesh)

    def part() -> Grid:
        """Return the grid of the triangles whose centres are nearest to the first segments of the line."""
        return _part_of_grid(grid, {name: rows[_nearest(grid.points[rows[:, :3]].mean(1), line) < segments]
                            for name, rows in grid.layers.items()})
    return to_mesh(part, mesh.comm, "the trimmed part")


def _nearest(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the number of the nearest segment of a polyline (n, 2) to each point (m, 2), shape (m,)."""
    a, along = line[:-1], np.diff(line, axis=0)
    offsets = points[:, None] - a
    share = np.clip(np.einsum("mij,ij->mi", offsets, along) / np.einsum("ij,ij->i", along, along), 0, 1)
    return np.argmin(np.hypot(*np.moveaxis(offsets - share[..., None] * along, -1, 0)), axis=1)


def _part_of_grid(grid: Grid, layers: dict[str, np.ndarray]) -> Grid:
    """Return the grid of some triangles, {layer: rows of node numbers}, with boundaries on the cut edges."""
    triangles = np.concatenate(list(layers.values()))
    outline, before = _boundary_edges(triangles), _boundary_edges(np.concatenate(list(grid.layers.values())))
    cut: np.ndarray = np.array([edge for key, edge in outline.items() if key not in before], dtype=np.int64)
    boundaries: dict[str, np.ndarray] = {name: np.array([row for row in rows.tolist() if frozenset(row[:2]) in outline],
                                                    dtype=np.int64).reshape(-1, rows.shape[1])
                                     for name, rows in grid.boundaries.items()}
    vanished = [name for name, rows in boundaries.items() if not len(rows) and len(grid.boundaries[name])] or ["trim"]
    boundaries |= dict.fromkeys(vanished if len(cut) else [], cut)
    used = np.unique(triangles)
    number = np.zeros(len(grid.points), dtype=np.int64)
    number[used] = np.arange(len(used))
    return Grid(grid.points[used], grid.numbers[used], {name: number[rows] for name, rows in layers.items()},
                {name: number[rows] for name, rows in boundaries.items()})


def _boundary_edges(triangles: np.ndarray) -> dict[frozenset[int], list[int]]:
    """Return {set of ends: [first, last, any middle]} of the edges of one triangle only, nodes (m, 3 or 6)."""
    found: dict[frozenset[int], list[list[int]]] = {}
    for row in ([int(node) for node in nodes] for nodes in triangles):
        for k, (i, j) in enumerate(_EDGES):
            found.setdefault(frozenset((row[i], row[j])), []).append([row[i], row[j], *row[3 + k: 4 + k]])
    return {key: edges[0] for key, edges in found.items() if len(edges) == 1}
