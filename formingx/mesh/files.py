"""The files of meshes: gmsh's own and plain text."""

import os

import numpy as np
from mpi4py import MPI

from ..errors import InputError, place
from . import msh, text
from .grid import to_grid, to_mesh
from .mesh import Mesh


def read(file: str | os.PathLike, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """Return a mesh of triangles from a file.

    A gmsh mesh (MSH 2.2 or 4.1, text or binary): physical groups name the layers (2-D) and the boundaries (1-D). A name
    that ends in .txt: the text format of `formingx.mesh.text`. Nothing in a file is run: a gmsh script is refused.

    Raises:
        InputError: the file is not there, is no such mesh, has no named 2-D group, or its elements do not cover a
            section once (see `Mesh.check`).

    >>> fx.mesh.write(sheet, "sheet.msh")
    >>> list(fx.mesh.read("sheet.msh").boundaries)
    ['axis', 'rim', 'bottom', 'top']
    """
    name = os.fspath(place("mesh.read: file", file))

    def grid():
        if not os.path.isfile(name):
            raise InputError(f"mesh file {name!r} is not there")
        return (text if _is_text(name) else msh).read(name)
    return to_mesh(grid, comm, f"mesh file {name!r}")


def write(mesh: Mesh, file: str | os.PathLike, shift: tuple[float, float] = (0.0, 0.0),
          numbering: str = "corners") -> None:
    """Write a mesh with its names as a file for `read` and for other solvers.

    A name that ends in .txt: the text format of `formingx.mesh.text`, with its `numbering` ("corners" or "around").
    Else a gmsh file (MSH 2.2, text). Serial only. Nodes are numbered as in the mesh; `shift` is added to their
    coordinates.

    Raises:
        InputError: an unknown numbering, or more than one rank.

    >>> fx.mesh.write(sheet, "sheet.txt", numbering="around")                # nodes of an element in a circle
    """
    name = os.fspath(place("mesh.write: file", file))
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
    return file.lower().endswith(".txt")
