"""The only place that knows DOLFINx versions: 0.9 is the floor, later ones are probed by feature."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import dolfinx
import ffcx
import ufl
from dolfinx import default_scalar_type, fem, jit, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from ufl.classes import Label
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction

from . import _jit

if tuple(int(n) for n in dolfinx.__version__.split(".")[:2]) < (0, 9):
    raise ImportError(f"formingx needs DOLFINx >= 0.9, this is {dolfinx.__version__}; './fx CMD' provides one")

# DOLFINx's own compilation waits for another process with the same form; its limit of 10 s is short for that.
JIT_OPTIONS = {"timeout": 120}

_compiled: dict[str, Any] = {}
"""Compiled forms and expressions of this process, by their keys."""


def compile_form(form: Any) -> Any:
    """Return a compiled form."""
    return _compiled_here(lambda: fem.form(form, jit_options=JIT_OPTIONS))


def compile_expression(expression: Any, points: Any) -> Any:
    """Return a compiled expression at points of the reference cell.

    Its variables are numbered from 0: with UFL's numbers, which count on in a process and are part of its signature, it
    would be compiled for every problem again.
    """
    numbered = map_expr_dag(_Numbered(), expression)
    return _compiled_here(lambda: fem.Expression(numbered, points, jit_options=JIT_OPTIONS))


class _Numbered(MultiFunction):
    def __init__(self) -> None:
        super().__init__()
        self._labels: dict[Any, Label] = {}

    expr = MultiFunction.reuse_if_untouched

    def label(self, label: Label) -> Label:
        return self._labels.setdefault(label, Label(len(self._labels)))


def compile_ahead(comm: Any, forms: Sequence[Any]) -> None:
    """Compile forms together (collective), which takes less time than one by one; `compile_form` then finds them."""
    options, form_options = jit.get_options(JIT_OPTIONS), ffcx.get_options({"scalar_type": default_scalar_type})
    if not _jit.supported(options):
        return
    items = {_jit.key(form, options, form_options): form for form in forms}
    if comm.allreduce(any(key not in _compiled for key in items), op=MPI.LOR):
        _compiled.update(_jit.compile_together(comm, items, options, form_options))


def _compiled_here(compiled: Any) -> Any:
    """Return `compiled()`, whose form or expression is compiled by `_jit`, once in a process."""
    compiler = jit.ffcx_jit

    def once(comm: Any, item: Any, form_compiler_options: Any, jit_options: dict[str, Any], **more: Any) -> Any:
        options, form_options = jit.get_options(jit_options), ffcx.get_options(form_compiler_options)
        key = _jit.key(item, options, form_options)
        if not comm.allreduce(key in _compiled, op=MPI.LAND):    # ranks compile together, or none does
            if _jit.supported(options):
                _compiled.update(_jit.compile_together(comm, {key: item}, options, form_options))
            else:
                _compiled[key] = compiler(comm, item, form_compiler_options, jit_options, **more)
        return _compiled[key]
    jit.ffcx_jit = once
    try:
        return compiled()
    finally:
        jit.ffcx_jit = compiler


def mesh_of_triangles(comm: Any, cells: Any, points: Any, cell_tags: Any, edges: Any, edge_tags: Any) -> tuple:
    """Return (mesh, cell tags, facet tags), distributed, from arrays on rank 0 (of length 0 on other ranks).

    Args:
        cells, edges: indices of points, shapes (m, 3 or 6) and (k, 2 or 3), as DOLFINx orders them; a tag for each.
        points: shape (n, 2), or in three dimensions (n, 3).
    """
    import basix.ufl
    from dolfinx import graph, mesh
    from dolfinx.io import distribute_entity_data
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
    """Add the entries of a compiled form to a PETSc matrix.

    Args:
        matrix: the matrix.
        form: the compiled form.
        bcs: boundary conditions; nothing is added in the rows and columns of constrained unknowns.
        diagonal: entry on the diagonal of constrained unknowns.
    """
    fem_petsc.assemble_matrix(matrix, form, bcs, diagonal)  # type: ignore[misc]  # types of another variant


def assemble_vector(vector: Any, form: Any) -> Any:
    """Assemble a compiled linear form into a `la.Vector` and add what other ranks have for this one.

    Returns:
        The owned entries, shape (n,): a view of the vector.
    """
    vector.array[:] = 0
    fem.assemble_vector(vector.array, form)
    vector.scatter_reverse(la.InsertMode.add)
    return vector.array[: vector.index_map.size_local * vector.block_size]


def interpolation_points(space: Any) -> Any:
    """Return the points of the reference cell where a space evaluates a function to interpolate it, shape (n, 2)."""
    points = space.element.interpolation_points
    return points() if callable(points) else points


def coordinate_map(mesh: Any) -> Any:
    """Return the map from reference to physical coordinates of the cells."""
    geometry = mesh.geometry
    return geometry.cmaps[0] if hasattr(geometry, "cmaps") else geometry.cmap


def cell_nodes(mesh: Any) -> Any:
    """Return the indices of the points (rows of `geometry.x`) of the cells, shape (cells, nodes of a cell)."""
    geometry = mesh.geometry
    return geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap


def tree_of_cells(mesh: Any, padding: float, cells: Any) -> Any:
    """Return the tree of bounding boxes of cells (local indices), each enlarged by `padding`, length."""
    from dolfinx import geometry
    return geometry.bb_tree(mesh, mesh.topology.dim, entities=cells, padding=padding)
