"""Location of points in a mesh: the cell and the place in it, on one rank each."""

from typing import Any, NamedTuple

import numpy as np
from dolfinx import geometry
from mpi4py import MPI

from .. import _compat
from ..errors import InputError
from .nodes import own_cells

OUTSIDE = 1e-3
"""So far outside a cell, in parts of it, a point still counts as in it: a curved edge is met to fourth order only."""


class Place(NamedTuple):
    """Points of this rank: their numbers, shape (m,), cells, shape (m,), and places in them, shape (m, dimension)."""

    mine: np.ndarray
    cells: np.ndarray
    reference: np.ndarray


def locate(mesh: Any, points: np.ndarray, size: float, cells: np.ndarray | None = None, within: str = "mesh") -> Place:
    """Find points, shape (n, 2), the same on all ranks; collective.

    Args:
        mesh: the `dolfinx.mesh.Mesh`. size: its extent, length.
        cells: look only in these (local numbers); default all. within: name of the cells in the error.

    Raises:
        InputError: a point that lies in none of the cells.
    """
    comm, X, cmap, dim = mesh.comm, mesh.geometry.x, _compat.coordinate_map(mesh), mesh.topology.dim
    nodes, own = _compat.cell_nodes(mesh), own_cells(mesh)
    cells = own if cells is None else cells[cells < len(own)]
    padded = np.zeros((len(points), 3))
    padded[:, :2] = points
    found = np.full(len(points), -1)
    reference = np.zeros((len(points), dim))
    depth = np.full(len(points), -OUTSIDE)
    if len(cells):
        tree = _compat.tree_of_cells(mesh, OUTSIDE * size, cells)
        candidates = geometry.compute_collisions_points(tree, padded)
        for i, point in enumerate(padded):
            for cell in candidates.links(i):
                try:
                    place = cmap.pull_back(point[None], X[nodes[cell]])[0, :dim]
                except RuntimeError:                 # a curved cell that the point is far from
                    continue
                inside = min(*place, 1 - place.sum())
                if inside > depth[i]:
                    found[i], reference[i], depth[i] = cell, place, inside
    best = np.empty_like(depth)
    comm.Allreduce(np.where(found >= 0, depth, -np.inf), best, MPI.MAX)
    if np.any(best == -np.inf):
        r, z = points[np.argmax(best == -np.inf)]
        raise InputError(f"point (R, Z) = ({r:.6g}, {z:.6g}) is not in the {within}")
    ranks = np.where((found >= 0) & (depth == best), comm.rank, comm.size)
    owner = np.empty_like(ranks)
    comm.Allreduce(ranks, owner, MPI.MIN)
    mine = np.flatnonzero(owner == comm.rank)
    return Place(mine, found[mine], reference[mine])
