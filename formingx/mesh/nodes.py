"""Nodes of the locally owned cells and facets of a DOLFINx mesh, in as many coordinates as the mesh has."""

from typing import Any

import numpy as np
from mpi4py import MPI

from .. import _compat

MOST_COMPARED = 1_000_000
"""At most so many coordinates are compared to find nearest points one by one."""
COORDINATES = 2
"""Number of reference coordinates of a point of the body: (R, Z); (x, y) of a sheet in three dimensions."""


def axes(domain: Any) -> str:
    """Names of the two reference coordinates: "RZ" of a section, "xy" of a sheet in three dimensions."""
    return "RZ" if domain.geometry.dim == 2 else "xy"


def own_cells(domain: Any) -> np.ndarray:
    """Numbers of the cells that are this rank's own, shape (m,), from 0 on."""
    return np.arange(domain.topology.index_map(domain.topology.dim).size_local, dtype=np.int32)


def of_mesh(domain: Any) -> np.ndarray:
    """Return this rank's nodes in the reference configuration, shape (n, COORDINATES)."""
    return domain.geometry.x[:, :COORDINATES]


def span(domain: Any, comm: Any) -> np.ndarray:
    """Lowest and highest coordinates of the nodes in the reference configuration, all ranks, shape (2, COORDINATES)."""
    X = of_mesh(domain)
    return np.array([[comm.allreduce(f(X[:, i], initial=-sign * np.inf), op) for i in range(COORDINATES)]
                     for f, sign, op in ((np.min, -1, MPI.MIN), (np.max, 1, MPI.MAX))])


def of_space(space: Any) -> np.ndarray:
    """Return the reference positions of the unknowns of a space (of blocks, the blocks), shape (n, COORDINATES)."""
    return space.tabulate_dof_coordinates()[:, :COORDINATES]


def nearest(points: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance from each place to the nearest point, and the number of that point, shapes as of `places`.

    Args:
        points: shape (n, d), length.
        places: shape (..., d), length.
    """
    if len(points) * places.size > MOST_COMPARED:
        from scipy.spatial import cKDTree
        return cKDTree(points).query(places)
    squares = ((places[..., None, :] - points) ** 2).sum(-1)            # importing SciPy takes longer than all of them
    numbers = squares.argmin(-1)
    return np.sqrt(np.take_along_axis(squares, numbers[..., None], -1)[..., 0]), numbers


def of_cells(domain: Any, cells: Any) -> np.ndarray:
    """Nodes of cells, their corners first, shape (cells, nodes, coordinates)."""
    geometry = domain.geometry
    return geometry.x[np.asarray(_compat.cell_nodes(domain))[cells], :geometry.dim]


def of_facets(domain: Any, facets: np.ndarray) -> np.ndarray:
    """Nodes of facets of a plane mesh or of a sheet, their ends first, shape (facets, 2 or 3, coordinates)."""
    return domain.geometry.x[numbers_of_facets(domain, facets), :domain.geometry.dim]


def numbers_of_facets(domain: Any, facets: np.ndarray) -> np.ndarray:
    """Return the rows of `geometry.x` of the nodes of facets, shape (facets, 2 or 3)."""
    from dolfinx.mesh import entities_to_geometry
    domain.topology.create_connectivity(1, 2)
    domain.topology.create_connectivity(2, 1)
    if not len(facets):                                      # entities_to_geometry divides by zero
        return np.zeros((0, 1 + _compat.coordinate_map(domain).degree), dtype=np.int32)
    return entities_to_geometry(domain, 1, facets)
