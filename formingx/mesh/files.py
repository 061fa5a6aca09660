"""Mesh files: gmsh's format and plain text."""

import os
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from ..errors import InputError, file_path, positive
from . import msh, text
from .grid import Grid, to_grid, to_mesh
from .mesh import Mesh


class SurfaceReader(NamedTuple):
    """Functions of the extension that has meshes of surfaces in three dimensions.

    Attributes:
        stl: function of the path of an STL file that returns its `Grid`.
        of_plain: function of a `Mesh` of triangles in three dimensions that returns the mesh of the surface.
    """

    stl: Callable[[str], Grid]
    of_plain: Callable[[Mesh], Mesh]


surface_readers: list[SurfaceReader] = []
"""Reader of surfaces in three dimensions, empty without the extension."""


def read(file: str | os.PathLike, comm: MPI.Comm = MPI.COMM_WORLD, *, scale: float = 1.0) -> Mesh:
    """Return a mesh of triangles from a file.

    A gmsh file (MSH 2.2 or 4.1, text or binary) names the layers by physical groups of dimension 2. Groups of dimension
    1 are the boundaries. A name that ends in .txt means the text format of `formingx.mesh.text`. Nothing in a file is
    executed: a gmsh script is refused.

    A gmsh file of three-node triangles in which z varies, and an STL file (.stl), give a surface in three dimensions
    with the faces "inner" and "outer". Its triangles are counter-clockwise seen from "outer". An STL file has no names;
    its open edges get those of `fx.mesh.surface`.

    Args:
        file: name of the file.
        comm: MPI communicator.
        scale: unit of length of the file over the unit of the scene, such as 25.4 for a file in inches.

    Returns:
        The mesh, distributed over the ranks of `comm`.

    Raises:
        InputError: the file is missing or not in this format, has no named group of dimension 2, or contains an invalid
            mesh (`Mesh.check`).

    >>> fx.mesh.write(sheet, "sheet.msh")
    >>> list(fx.mesh.read("sheet.msh").boundaries)
    ['axis', 'rim', 'bottom', 'top']
    """
    name, factor = os.fspath(file_path("mesh.read: file", file)), positive("mesh.read: scale", scale)
    is_stl = name.lower().endswith(".stl")

    def grid():
        if not os.path.isfile(name):
            raise InputError(f"mesh file {name!r} is not there")
        if is_stl and not surface_readers:
            raise InputError(f"mesh file {name!r}: the extension 'space' of formingx is not installed")
        found = surface_readers[0].stl(name) if is_stl else (text if _is_text(name) else msh).read(name)
        return found._replace(points=factor * found.points)
    mesh = to_mesh(grid, comm, f"mesh file {name!r}")
    return surface_readers[0].of_plain(mesh) if mesh.domain.geometry.dim == 3 and surface_readers else mesh


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
    named = {key: edges for key, edges in plain.boundaries.items() if mesh.boundaries[key]}       # no faces of surfaces
    plain = plain._replace(boundaries=named, points=plain.points + np.resize([*shift, 0.0], plain.points.shape[1]))
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
