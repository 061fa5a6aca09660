"""Nodes of cells and facets of a DOLFINx mesh, in reference coordinates."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from mpi4py import MPI

from .. import _compat
from ..errors import InputError

SAME_PLACE = 1e-5
"""Distance, over the extent of a body, below which two places are one: names of points have six digits."""

MAX_COMPARED = 1_000_000
"""Number of pairs of points or boxes above which a tree finds the near ones."""
COORDINATES = 2
"""Number of reference coordinates of a point of a section: (R, Z)."""


def axes(domain: Any) -> str:
    """Return the names of the reference coordinates of a DOLFINx mesh: "RZ", in three dimensions "xyz"."""
    return "RZ" if domain.geometry.dim == 2 else "xyz"


def arguments(function: Callable, coordinates: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the leading coordinates, {name: values (n,), length}, that a function takes without a default."""
    try:
        taken = list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):                         # a function of NumPy, for example, has no signature
        taken = []
    positional = [p for p in taken if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    any_number = any(p.kind is p.VAR_POSITIONAL for p in taken)
    least = COORDINATES if len([p for p in positional if p.default is p.empty]) <= COORDINATES else len(positional)
    return dict(list(coordinates.items())[: len(coordinates) if any_number else least])


def own_cells(domain: Any) -> np.ndarray:
    """Return the local numbers of the cells of a DOLFINx mesh that this rank owns, shape (m,)."""
    return np.arange(domain.topology.index_map(domain.topology.dim).size_local, dtype=np.int32)


def node_positions(domain: Any) -> np.ndarray:
    """Return the reference positions of the nodes of a DOLFINx mesh on this rank, shape (n, 2 or 3), length."""
    return domain.geometry.x[:, :domain.geometry.dim]


def span(domain: Any, comm: Any) -> np.ndarray:
    """Return the lowest and highest reference coordinates of all nodes, shape (2, 2 or 3), length; collective."""
    X = node_positions(domain)
    return np.array([[comm.allreduce(f(X[:, i], initial=-sign * np.inf), op) for i in range(X.shape[1])]
                     for f, sign, op in ((np.min, -1, MPI.MIN), (np.max, 1, MPI.MAX))])


def dof_positions(space: Any) -> np.ndarray:
    """Return the reference positions of the (blocked) unknowns of a function space, shape (n, 2 or 3), length."""
    return space.tabulate_dof_coordinates()[:, :space.mesh.geometry.dim]


def nearest(points: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance from places, (..., d), to the nearest of points (n, d), and its index, both (...,)."""
    if len(points) * places.size > MAX_COMPARED:
        from scipy.spatial import cKDTree
        return cKDTree(points).query(places)
    squares = ((places[..., None, :] - points) ** 2).sum(-1)            # faster than the import of SciPy
    numbers = squares.argmin(-1)
    return np.sqrt(np.take_along_axis(squares, numbers[..., None], -1)[..., 0]), numbers


def without_round_off(point: Any, points: Any) -> tuple[float, ...]:
    """Return the coordinates of a point, with 0 for up to 1e-12 times the range of points of the body, length."""
    return tuple(float(x) if abs(x) > 1e-12 * np.ptp(points) else 0.0 for x in point)


def matching_rows(points: np.ndarray, stored: Any, tolerance: float, message: str) -> np.ndarray:
    """Return the row of stored positions (m, d) at each point (n, d), (n,); beyond `tolerance`: InputError."""
    stored = np.reshape(stored, (-1, points.shape[-1]))
    if not len(points):                                      # a rank without such points
        return np.zeros(0, dtype=int)
    if not len(stored):
        raise InputError(message)
    away, rows = nearest(stored, points)
    if np.any(away > tolerance):
        raise InputError(message)
    return rows


def cell_node_positions(domain: Any, cells: Any) -> np.ndarray:
    """Return the node positions of local cells, corners first, shape (cells, nodes, coordinates), length."""
    geometry = domain.geometry
    return geometry.x[np.asarray(_compat.cell_nodes(domain))[cells], :geometry.dim]


def facet_node_positions(domain: Any, facets: np.ndarray) -> np.ndarray:
    """Return the node positions of local facets, ends first, (facets, 2 or 3, coordinates), length."""
    return domain.geometry.x[facet_nodes(domain, facets), :domain.geometry.dim]


def facet_nodes(domain: Any, facets: np.ndarray) -> np.ndarray:
    """Return the nodes of local facets, ends first, as rows of `domain.geometry.x`, shape (facets, 2 or 3)."""
    from dolfinx.mesh import entities_to_geometry
    domain.topology.create_connectivity(1, 2)
    domain.topology.create_connectivity(2, 1)
    if not len(facets):                                      # entities_to_geometry divides by zero
        return np.zeros((0, 1 + _compat.coordinate_map(domain).degree), dtype=np.int32)
    return entities_to_geometry(domain, 1, facets)
