"""Mesh files: gmsh's format and plain text."""

import os

import numpy as np
from mpi4py import MPI

from ..errors import InputError, file_path
from . import msh, text
from .grid import to_grid, to_mesh
from .mesh import Mesh


def read(file: str | os.PathLike, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return a mesh of triangles from a file.

    A gmsh file (MSH 2.2 or 4.1, text or binary) names the layers by physical groups of dimension 2. Groups of dimension
    1 are the boundaries. A name that ends in .txt means the text format of `formingx.mesh.text`. Nothing in a file is
    executed: a gmsh script is refused.

    Args:
        file: name of the file.
        comm: MPI communicator.

    Returns:
        The mesh, distributed over the ranks of `comm`.

    Raises:
        InputError: the file is missing or not in this format, has no named group of dimension 2, or contains an invalid
            mesh (`Mesh.check`).

    >>> fx.mesh.write(sheet, "sheet.msh")
    >>> list(fx.mesh.read("sheet.msh").boundaries)
    ['axis', 'rim', 'bottom', 'top']
    """
    name = os.fspath(file_path("mesh.read: file", file))

    def grid():
        if not os.path.isfile(name):
            raise InputError(f"mesh file {name!r} is not there")
        return (text if _is_text(name) else msh).read(name)
    return to_mesh(grid, comm, f"mesh file {name!r}")


def write(mesh: Mesh, file: str | os.PathLike, shift: tuple[float, float] = (0.0, 0.0),
          numbering: str = "corners") -> None:
    """Write a mesh with its names, for `read` and for other solvers; on one rank only.

    A name that ends in .txt means the text format of `formingx.mesh.text`, any other a gmsh file (MSH 2.2, text). Nodes
    are numbered as in the mesh.

    Args:
        mesh: the mesh.
        file: name of the file.
        shift: (R, Z) added to the coordinates, length.
        numbering: order of the six nodes of an element in the text format: "corners" (the corners first) or "around"
            (corner, middle, corner, ...).

    Raises:
        InputError: the numbering is unknown, or there is more than one rank.

    >>> fx.mesh.write(sheet, "sheet.txt", numbering="around")                # nodes of an element in a circle
    """
    name = os.fspath(file_path("mesh.write: file", file))
    plain = to_grid(mesh)
    plain = plain._replace(points=plain.points + np.array(shift))
    if _is_text(name):
        text.write(plain, name, numbering)
        return
    if numbering != "corners":
        raise InputError(f"mesh.write: numbering = {numbering!r}: gmsh files have their own, 'corners'; the text format"
                         f" (.txt) has a choice")
    msh.write(plain, name)


def _is_text(file: str) -> bool:
    """Return True if the file name ends in .txt."""
    return file.lower().endswith(".txt")
