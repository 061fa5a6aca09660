"""The only place that knows DOLFINx versions: 0.9 is the floor, later ones are probed by feature."""

from __future__ import annotations

from typing import Any

import dolfinx

from .errors import InputError

if tuple(int(n) for n in dolfinx.__version__.split(".")[:2]) < (0, 9):
    raise ImportError(f"formingx needs DOLFINx >= 0.9, this is {dolfinx.__version__}; './fx CMD' provides one")

# The compiler waits for another process that compiles the same form; its own limit of 10 s is short for that.
JIT_OPTIONS = {"timeout": 120}


def gmsh_to_mesh(model: Any, comm: Any, rank: int = 0) -> tuple[Any, Any, Any]:
    """(mesh, cell tags, facet tags) of a gmsh model that lives on `rank` (0.9: tuple; later: MeshData)."""
    try:
        from dolfinx.io import gmsh as reader
    except ImportError:
        from dolfinx.io import gmshio as reader
    data = reader.model_to_mesh(model, comm, rank, gdim=2)
    if hasattr(data, "cell_tags"):
        return data.mesh, data.cell_tags, data.facet_tags
    return data[0], data[1], data[2]


def coordinate_map(mesh: Any) -> Any:
    """The map from reference to physical coordinates of the cells."""
    geometry = mesh.geometry
    return geometry.cmaps[0] if hasattr(geometry, "cmaps") else geometry.cmap


def cell_nodes(mesh: Any) -> Any:
    """Numbers of the points (rows of `geometry.x`) of the cells, shape (cells, nodes of a cell)."""
    geometry = mesh.geometry
    return geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap


def tree_of_cells(mesh: Any, padding: float, cells: Any) -> Any:
    """Bounding boxes of cells (local numbers)."""
    from dolfinx import geometry
    return geometry.bb_tree(mesh, mesh.topology.dim, entities=cells, padding=padding)


def adios4dolfinx() -> Any:
    """The library that writes and reads checkpoints.

    Raises:
        InputError: it is not there, or cannot be used.
    """
    try:
        import adios4dolfinx
    except ImportError as error:
        raise InputError(f"checkpoints need adios4dolfinx (Debian: python3-adios4dolfinx; to be imported before adios2,"
                         f" or that is there without MPI): {error}") from None
    return adios4dolfinx
