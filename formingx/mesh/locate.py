"""Location of points in a mesh: each point in one cell on one rank."""

from typing import Any, NamedTuple

import numpy as np
from dolfinx import geometry
from mpi4py import MPI

from .. import _compat
from ..errors import InputError
from ..findings import coordinates
from ..values.tolerances import NEGLIGIBLE
from .nodes import axes, own_cells


class LocatedPoints(NamedTuple):
    """Given points that lie in cells of this rank, and their cells.

    Attributes:
        numbers: indices of these m points among all given points, shape (m,).
        cells: local number of the cell that contains each point, shape (m,).
        reference: position of each point in the reference cell, shape (m, dimension).
    """

    numbers: np.ndarray
    cells: np.ndarray
    reference: np.ndarray


def locate(mesh: Any, points: np.ndarray, size: float, cells: np.ndarray | None = None, within: str = "mesh"
           ) -> LocatedPoints:
    """Return the points that lie in cells of this rank, each found once; collective.

    Points are reference positions (n, 2 or 3), length, equal on all ranks; inside is up to 0.001 cell sizes from one of
    the cells (None: all). A point in none is an InputError.
    """
    comm, X, cmap, dim = mesh.comm, mesh.geometry.x, _compat.coordinate_map(mesh), mesh.topology.dim
    nodes, owned = _compat.cell_nodes(mesh), own_cells(mesh)
    cells = owned if cells is None else cells[cells < len(owned)]
    padded = np.zeros((len(points), 3))
    padded[:, :points.shape[1]] = points
    found = np.full(len(points), -1)
    reference = np.zeros((len(points), dim))
    depth = np.full(len(points), -NEGLIGIBLE)
    if len(cells):
        tree = _compat.tree_of_cells(mesh, NEGLIGIBLE * size, cells)
        candidates = geometry.compute_collisions_points(tree, padded)
        for i, point in enumerate(padded):
            for cell in candidates.links(i):
                try:
                    place = cmap.pull_back(point[None], X[nodes[cell]])[0, :dim]
                except RuntimeError:                 # the point is far from a curved cell
                    continue
                inside = min(*place, 1 - place.sum())
                if dim < mesh.geometry.dim:                  # a surface: the point may lie off its triangle
                    away = np.linalg.norm(cmap.push_forward(place[None], X[nodes[cell]])[0] - point)
                    inside = min(inside, -away / np.ptp(X[nodes[cell]], axis=0).max())
                if inside > depth[i]:
                    found[i], reference[i], depth[i] = cell, place, inside
    best = np.empty_like(depth)
    comm.Allreduce(np.where(found >= 0, depth, -np.inf), best, MPI.MAX)
    if np.any(best == -np.inf):
        at = coordinates(points[np.argmax(best == -np.inf)], 6)
        raise InputError(f"point ({', '.join(axes(mesh)[:points.shape[1]])}) = {at} is not in the {within}")
    ranks = np.where((found >= 0) & (depth == best), comm.rank, comm.size)
    owner = np.empty_like(ranks)
    comm.Allreduce(ranks, owner, MPI.MIN)
    numbers = np.flatnonzero(owner == comm.rank)
    return LocatedPoints(numbers, found[numbers], reference[numbers])
