"""Calls of DOLFINx that differ between its versions from 0.9 on. Features distinguish the versions."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from typing import Any

import dolfinx
import ffcx
import numpy as np
import ufl
from dolfinx import default_scalar_type, fem, jit, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from ufl.classes import Label
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction

from . import _jit
from .ranks import original

if tuple(int(n) for n in dolfinx.__version__.split(".")[:2]) < (0, 9):
    raise ImportError(f"formingx needs DOLFINx >= 0.9, this is {dolfinx.__version__}; './fx CMD' provides one")

# DOLFINx's own compilation waits for another process with the same form; its limit of 10 s is short for that.
JIT_OPTIONS = {"timeout": 120}

_add_to_array = fem.assemble_vector.dispatch(np.ndarray)
"""Variant of `assemble_vector` of DOLFINx that adds to an array."""

_compiled: dict[str, Any] = {}
"""Compiled forms and expressions of this process, by their keys."""


def compile_form(form: Any) -> Any:
    """Return the compiled DOLFINx form of a UFL form, which can be assembled; `_jit` compiles it."""
    return _compiled_by_jit(lambda: fem.form(form, jit_options=JIT_OPTIONS))


def compile_expression(expression: Any, points: Any) -> Any:
    """Return the compiled `Expression` at reference points (n, 2); its variables count from 0, to be shared."""
    numbered = map_expr_dag(_Numbered(), expression)
    return _compiled_by_jit(lambda: fem.Expression(numbered, points, jit_options=JIT_OPTIONS))


class _Numbered(MultiFunction):
    """Map of a UFL expression to an equal one, in which labels of variables have the numbers 0, 1, ..."""

    def __init__(self) -> None:
        super().__init__()
        self._labels: dict[Any, Label] = {}

    expr = MultiFunction.reuse_if_untouched

    def label(self, label: Label) -> Label:
        """Return the label that replaces the label of a UFL variable; its number is the count of labels before it."""
        return self._labels.setdefault(label, Label(len(self._labels)))


def compile_ahead(comm: Any, forms: Sequence[Any]) -> None:
    """Compile UFL forms, the same on all ranks, in one call of the compiler, for `compile_form` to find; collective."""
    options, form_options = jit.get_options(JIT_OPTIONS), ffcx.get_options({"scalar_type": default_scalar_type})
    if not _jit.supported(options):
        return
    items = {_jit.key(form, options, form_options): form for form in forms}
    if comm.allreduce(any(key not in _compiled for key in items), op=MPI.LOR):
        _compiled.update(_jit.compile_together(comm, items, options, form_options))


def _compiled_by_jit(request: Callable[[], Any]) -> Any:
    """Return the form or expression that `request` makes by DOLFINx and `_jit`; it is compiled once in a process."""
    compiler = jit.ffcx_jit

    def compile_once(comm: Any, item: Any, form_compiler_options: Any, jit_options: dict[str, Any],
                     **others: Any) -> Any:
        comm = original(comm)
        options, form_options = jit.get_options(jit_options), ffcx.get_options(form_compiler_options)
        key = _jit.key(item, options, form_options)
        if not comm.allreduce(key in _compiled, op=MPI.LAND):    # ranks compile together, or none does
            if _jit.supported(options):
                _compiled.update(_jit.compile_together(comm, {key: item}, options, form_options))
            else:
                _compiled[key] = compiler(comm, item, form_compiler_options, jit_options, **others)
        return _compiled[key]
    jit.ffcx_jit = compile_once
    try:
        return request()
    finally:
        jit.ffcx_jit = compiler


_UNCOLLECTED = 20
"""Meshes and problems made between two collections of garbage; each may hold 26 communicators of the 2046 of MPICH."""
_made: list[None] = []


def collect_communicators() -> None:
    """Free, now and then, communicators of unused meshes and problems, by a collection of garbage; collective."""
    _made.append(None)
    if len(_made) >= _UNCOLLECTED:
        _made.clear()
        gc.collect()


def mesh_of_triangles(comm: Any, cells: Any, points: Any, cell_tags: Any, edges: Any, edge_tags: Any) -> tuple:
    """Return a distributed mesh of triangles, and the `MeshTags` of its cells and facets; collective.

    Rank 0 gives cells (m, 3 or 6) in the order of DOLFINx, points (n, 2 or 3), length, cell tags (m,), edges (k, 2 or
    3) and edge tags (k,).
    """
    import basix.ufl
    from dolfinx import graph, mesh
    from dolfinx.io import distribute_entity_data
    collect_communicators()
    element = basix.ufl.element("Lagrange", "triangle", 1 if cells.shape[1] == 3 else 2,
                                shape=(points.shape[1],))
    domain = mesh.create_mesh(comm, cells=cells, x=points, e=ufl.Mesh(element))
    marks = []
    for dim, entities, tags in ((2, cells, cell_tags), (1, edges, edge_tags)):
        found, values = distribute_entity_data(domain, dim, entities, tags)
        domain.topology.create_connectivity(dim, 0)
        domain.topology.create_connectivity(dim, 2)
        marks.append(mesh.meshtags_from_entities(domain, dim, graph.adjacencylist(found), values.astype("int32")))
    return domain, marks[0], marks[1]


def assemble_matrix(matrix: Any, form: Any, bcs: Any, diagonal: float = 1.0) -> None:
    """Add a compiled form to a PETSc matrix; constrained rows and columns have `diagonal` alone."""
    fem_petsc.assemble_matrix(matrix, form, bcs, diagonal)  # type: ignore[misc]  # types of another variant


def assemble_vector(vector: Any, form: Any) -> Any:
    """Assemble a compiled linear form into a `la.Vector`, and return a view of owned entries, (n,); collective."""
    values = vector.array
    values[:] = 0
    _add_to_array(values, form)
    vector.scatter_reverse(la.InsertMode.add)
    return values[: vector.index_map.size_local * vector.block_size]


def interpolation_points(space: Any) -> Any:
    """Return the points of the reference cell where a space evaluates a function to interpolate it, shape (n, 2)."""
    points = space.element.interpolation_points
    return points() if callable(points) else points


def coordinate_map(mesh: Any) -> Any:
    """Return the `CoordinateElement` of a DOLFINx mesh, which maps reference to physical coordinates of its cells."""
    geometry = mesh.geometry
    return geometry.cmaps[0] if hasattr(geometry, "cmaps") else geometry.cmap


def cell_nodes(mesh: Any) -> Any:
    """Return the nodes of the cells of a DOLFINx mesh, rows of `mesh.geometry.x`, shape (cells, nodes of a cell)."""
    geometry = mesh.geometry
    return geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap


def collapsed(space: Any) -> tuple[Any, np.ndarray]:
    """Return a part of a DOLFINx space, and the numbers of its unknowns in the whole, (n,)."""
    own, numbers = space.collapse()
    return own, np.asarray(numbers).ravel()


def tree_of_cells(mesh: Any, padding: float, cells: Any) -> Any:
    """Return the tree of bounding boxes of local cells (m,), enlarged by a padding, length."""
    from dolfinx import geometry
    return geometry.bb_tree(mesh, mesh.topology.dim, entities=cells, padding=padding)
