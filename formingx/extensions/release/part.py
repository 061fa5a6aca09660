"""A part of a mesh: the rest of a trimmed sheet."""

import numpy as np

from ...mesh.grid import Grid, gathered, to_mesh
from ...mesh.mesh import Mesh

_EDGES = ((0, 1), (1, 2), (2, 0))


def part_along(mesh: Mesh, line: np.ndarray, pieces: int) -> Mesh:
    """Return the elements of a mesh that lie next to the first pieces of a line through it; collective.

    The cut edges belong to each boundary that vanishes, such as the rim; else to a new one, "trim".

    Args:
        mesh: the mesh.
        line: points of the line, shape (n, 2), length.
        pieces: number of its n - 1 segments that are kept.

    Returns:
        The mesh.

    Raises:
        InputError: nothing is left of a layer.
    """
    grid = gathered(mesh)

    def part() -> Grid:
        return _kept(grid, {name: rows[_nearest(grid.points[rows[:, :3]].mean(1), line) < pieces]
                            for name, rows in grid.layers.items()})
    return to_mesh(part, mesh.comm, "the trimmed part")


def _nearest(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the number of the piece of a line, shape (n, 2), next to each point."""
    a, along = line[:-1], np.diff(line, axis=0)
    away = points[:, None] - a
    share = np.clip(np.einsum("mij,ij->mi", away, along) / np.einsum("ij,ij->i", along, along), 0, 1)
    return np.argmin(np.hypot(*np.moveaxis(away - share[..., None] * along, -1, 0)), axis=1)


def _kept(grid: Grid, layers: dict[str, np.ndarray]) -> Grid:
    triangles = np.concatenate(list(layers.values()))
    outline, before = _outline(triangles), _outline(np.concatenate(list(grid.layers.values())))
    cut: np.ndarray = np.array([edge for key, edge in outline.items() if key not in before], dtype=np.int64)
    boundaries: dict[str, np.ndarray] = {name: np.array([row for row in rows.tolist() if frozenset(row[:2]) in outline],
                                                    dtype=np.int64).reshape(-1, rows.shape[1])
                                     for name, rows in grid.boundaries.items()}
    gone = [name for name, rows in boundaries.items() if not len(rows) and len(grid.boundaries[name])] or ["trim"]
    boundaries |= dict.fromkeys(gone if len(cut) else [], cut)
    used = np.unique(triangles)
    number = np.zeros(len(grid.points), dtype=np.int64)
    number[used] = np.arange(len(used))
    return Grid(grid.points[used], grid.numbers[used], {name: number[rows] for name, rows in layers.items()},
                {name: number[rows] for name, rows in boundaries.items()})


def _outline(triangles: np.ndarray) -> dict[frozenset[int], list[int]]:
    """Return {ends of an edge: first, last, middle} of the edges that belong to a single triangle."""
    found: dict[frozenset[int], list[list[int]]] = {}
    for row in ([int(node) for node in nodes] for nodes in triangles):
        for k, (i, j) in enumerate(_EDGES):
            found.setdefault(frozenset((row[i], row[j])), []).append([row[i], row[j], *row[3 + k: 4 + k]])
    return {key: edges[0] for key, edges in found.items() if len(edges) == 1}
