"""Meshes by gmsh, and the files of meshes: gmsh's own and plain text."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from mpi4py import MPI

from .. import _compat
from ..errors import InputError
from . import text
from .mesh import Mesh


def read(file: str | os.PathLike, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    """A mesh of triangles from a file.

    A gmsh file: physical groups name the layers (2-D) and the boundaries (1-D). A name that ends in .txt: the text
    format of `formingx.grid`.

    Raises:
        InputError: the file is not there, cannot be read, or has no named 2-D group.
    """
    if not isinstance(file, str | os.PathLike):
        raise InputError(f"mesh.read: file = {file!r}: must be the name of a file")
    file = os.fspath(file)

    def build(model):
        import gmsh
        if not os.path.isfile(file):
            raise InputError(f"mesh file {file!r} is not there")
        if _is_text(file):
            _fill(model, text.read(file))
            return
        try:
            gmsh.merge(file)
        except Exception as error:
            raise InputError(f"mesh file {file!r} cannot be read: {error}") from None
        if not model.getPhysicalGroups(2):
            raise InputError(f"mesh file {file!r} has no physical group of dimension 2: name its layers")

    return from_gmsh(build, comm)


def write(mesh: Mesh, file: str | os.PathLike, shift: tuple[float, float] = (0.0, 0.0),
          numbering: str = "corners") -> None:
    """Write a mesh with its names as a file for `read` and for other solvers.

    A name that ends in .txt: the text format of `formingx.grid`, with its `numbering` ("corners" or "around"). Else a
    gmsh file (MSH 2.2, text). Serial only. Nodes are numbered as in the mesh; `shift` is added to their coordinates.

    Raises:
        InputError: an unknown numbering, more than one rank, or a boundary that is a part of another (`with_part`).
    """
    for name, tags in mesh.boundaries.items():
        if len(tags) > 1:
            raise InputError(f"mesh.write: boundary {name!r} has a part with a name of its own, which files cannot"
                             f" hold: write the mesh without it, and call with_part on what is read")
    plain = to_grid(mesh)
    plain = plain._replace(points=plain.points + np.array(shift))
    if _is_text(file):
        text.write(plain, file, numbering)
        return
    if numbering != "corners":
        raise InputError(f"mesh.write: numbering = {numbering!r}: gmsh files have their own, 'corners'; the text format"
                         f" (.txt) has a choice")
    import gmsh
    with gmsh_model(mesh.comm) as model:
        _fill(model, plain, mesh.layers | {name: tags[0] for name, tags in mesh.boundaries.items()})
        gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
        gmsh.write(os.fspath(file))


def to_grid(mesh: Mesh) -> text.Grid:
    """The mesh as plain arrays (serial only); node i of the mesh has the number i + 1."""
    from dolfinx.mesh import entities_to_geometry
    domain = mesh.domain
    if mesh.comm.size > 1:
        raise InputError("the nodes of a mesh are numbered and written on one rank only: run this on one")
    domain.topology.create_connectivity(1, 2)
    points = domain.geometry.x[:, :2].copy()
    triangles = np.asarray(_compat.cell_nodes(domain))
    # DOLFINx numbers a mid-edge node like the opposite corner; here edges are 01, 12, 20
    triangles = text.counter_clockwise(points, triangles[:, [0, 1, 2, 5, 3, 4][: triangles.shape[1]]])
    corners = ((0, 1, 3), (1, 2, 4), (2, 0, 5))
    edges = {frozenset(row[[i, j]].tolist()): row[[n for n in (i, j, k) if n < len(row)]]
             for row in triangles for i, j, k in corners}
    layers = {name: triangles[mesh.cells.find(tag)] for name, tag in mesh.layers.items()}
    boundaries = {}
    for name in mesh.boundaries:
        ends = entities_to_geometry(domain, 1, mesh.facets_of(name))[:, :2]
        rows = [edges[frozenset(pair)] for pair in ends.tolist()]
        boundaries[name] = np.array(rows, dtype=np.int64).reshape(len(rows), triangles.shape[1] // 2)
    return text.Grid(points, np.arange(1, len(points) + 1), layers, boundaries)


def _is_text(file: str | os.PathLike) -> bool:
    return os.fspath(file).lower().endswith(".txt")


def _fill(model: Any, plain: text.Grid, tags: Mapping[str, int] | None = None) -> None:
    """Put a grid into an empty gmsh model; `tags` of the named parts (default: counted)."""
    names = [(2, name, rows) for name, rows in plain.layers.items()]
    names += [(1, name, rows) for name, rows in plain.boundaries.items()]
    # gmsh's readers want 1, 2, 3, ... and no node that belongs to nothing
    used = np.unique(np.concatenate([rows.ravel() for rows in plain.layers.values()]))
    number = np.zeros(len(plain.points), dtype=np.int64)
    number[used] = np.arange(1, len(used) + 1)
    nodes = np.column_stack([plain.points[used], np.zeros(len(used))])
    kinds = {(2, 6): 9, (2, 3): 2, (1, 3): 8, (1, 2): 1}
    model.addDiscreteEntity(2, 1)
    model.mesh.addNodes(2, 1, np.arange(1, len(used) + 1), nodes.ravel())
    for k, (dim, name, rows) in enumerate(names, 1):
        tag = tags[name] if tags else k
        entity = model.addDiscreteEntity(dim, tag + 100)
        if len(rows):
            model.mesh.addElementsByType(entity, kinds[dim, rows.shape[1]], [], number[rows].ravel())
        model.addPhysicalGroup(dim, [entity], tag, name)


def from_gmsh(build: Any, comm: MPI.Comm) -> Mesh:
    """Run `build(model)` on rank 0 and distribute the model; an InputError there is raised on all ranks."""
    with gmsh_model(comm) as model:
        error, names = None, None
        if comm.rank == 0:
            try:
                build(model)
                names = [{model.getPhysicalName(d, t) or str(t): t for d, t in model.getPhysicalGroups(d)}
                         for d in (2, 1)]
            except InputError as e:
                error = e
        error, names = comm.bcast((error, names), root=0)
        if error is not None:
            raise error
        domain, cells, facets = _compat.gmsh_to_mesh(model, comm)
    if domain.topology.cell_name() != "triangle":
        raise InputError(f"the mesh is made of {domain.topology.cell_name()}s: formingx needs triangles")
    layers, boundaries = names
    return Mesh(domain, cells, facets, layers, {name: (tag,) for name, tag in boundaries.items()}, comm)


@contextlib.contextmanager
def gmsh_model(comm: MPI.Comm) -> Iterator[Any]:
    """A new gmsh model on rank 0, None elsewhere; removed at the end."""
    import gmsh
    if comm.rank != 0:
        yield None
        return
    ours = not gmsh.isInitialized()
    if ours:
        gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("formingx")
    try:
        yield gmsh.model
    finally:
        gmsh.model.remove()
        if ours:
            gmsh.finalize()
