"""Stress-free mesh of a deformed body: to be crushed, formed once more, or written for another program."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem

from ... import _compat
from ...errors import InputError, positive
from ...forms.outline import Outline
from ...mesh.files import write
from ...mesh.grid import Grid, counter_clockwise, to_mesh
from ...mesh.mesh import Mesh
from ...mesh.nodes import own_cells
from ...results.extend import method_of
from ...results.path import Path
from ...results.reader import section_only
from ...solve.state import State

_NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
"""Local coordinates of the corners of a triangle, and of the midpoints of the opposite edges."""
_TO_GRID = [0, 1, 2, 5, 3, 4]
"""Numbers of these nodes in the order of a `Grid`: corners 0, 1, 2, midpoints of the edges 01, 12, 20."""


@method_of(Path)
def deformed_mesh(path: Path, state: State | None = None, *, size: float | None = None) -> Mesh:
    """Return a stress-free mesh of the deformed body in a state; collective.

    In contrast, `Path.springback` releases the body with its stresses.

    Args:
        path: the path of a solid.
        state: a state of the path; default the last.
        size: edge length of new elements, length; None: the deformed elements stay. New elements are available for a
            body of one layer without holes, on one rank.

    Returns:
        The mesh, with the names of layers and boundaries and with second-order geometry.

    Raises:
        InputError: a membrane, a sheet in three dimensions, or deformed elements that are inverted or overlap. Also new
            elements of several layers, on several ranks, or around a hole.
    """
    section_only(path.scene, "deformed_mesh", "use to_stl, or shell_model")
    state = state or path.last
    problem = path.record.segment(state).problem
    forms, mesh = problem.forms, problem.scene.mesh
    domain, comm = mesh.domain, mesh.comm
    if forms.domain is not domain:
        raise InputError("Path.deformed_mesh: a membrane has no elements across its thickness: form"
                         " a solid, MixedPressure()")
    if size is not None:
        return _with_new_elements(problem, state, positive("Path.deformed_mesh: size", size))
    numbers = fem.functionspace(domain, ("Lagrange", 2)).dofmap
    cells = own_cells(domain)
    triangles = numbers.index_map.local_to_global(np.asarray(numbers.list)[cells].ravel().astype(np.int32))
    triangles = triangles.reshape(-1, 6)
    points = np.zeros((len(cells), 6, forms.scene.kinematics.components))
    if len(cells):
        with problem.state_context(state):
            moved = _compat.compile_expression(forms.X + forms.u, _NODES)
            points = moved.eval(domain, cells).reshape(points.shape)
    layers = {name: triangles[(found := mesh.cells.find(tag))[found < len(cells)]] for name, tag in mesh.layers.items()}
    domain.topology.create_connectivity(1, 2)
    domain.topology.create_connectivity(2, 1)
    to_cell, to_facet = domain.topology.connectivity(1, 2), domain.topology.connectivity(2, 1)
    edges: dict[str, list] = {name: [] for name in mesh.boundaries}
    for name, rows in edges.items():
        for facet in mesh.facets_of(name):
            cell = to_cell.links(facet)[0]
            if cell < len(cells):
                k = int(np.flatnonzero(to_facet.links(cell) == facet)[0])
                rows.append(triangles[cell, [(k + 1) % 3, (k + 2) % 3, 3 + k]])
    parts = comm.allgather((triangles, points, layers, edges))

    def grid() -> Grid:
        """Return the deformed mesh of all ranks as a grid."""
        place = np.zeros((1 + max(int(t.max(initial=0)) for t, *_ in parts), points.shape[-1]))
        for t, x, *_ in parts:
            place[t] = x
        if problem.scene.kinematics.axisymmetric:            # nodes on the axis have R = 0 exactly
            place[np.abs(place[:, 0]) < 1e-12 * np.ptp(place), 0] = 0.0
        return Grid(place, np.arange(1, len(place) + 1),
                    {name: counter_clockwise(place, np.concatenate([p[2][name] for p in parts])[:, _TO_GRID])
                     for name in mesh.layers},
                    {name: np.array([row for p in parts for row in p[3][name]], dtype=np.int64).reshape(-1, 3)
                     for name in mesh.boundaries})
    return to_mesh(grid, comm, "Path.deformed_mesh: the deformed mesh")


@method_of(Path)
def to_msh(path: Path, file: Any, state: State | None = None) -> None:
    """Write the mesh of the deformed body in a state as a gmsh file, with its names; on one rank.

    Args:
        path: the path of a solid.
        file: path of the file.
        state: a state of the path; default the last.

    Raises:
        InputError: as `deformed_mesh`.
    """
    write(deformed_mesh(path, state), file)


def _with_new_elements(problem: Any, state: Any, size: float) -> Mesh:
    """Return a mesh of the deformed body with new elements of a size; several layers or ranks are an InputError."""
    from ..remeshing.outline_mesh import mesh_of_outline
    mesh, outline = problem.scene.mesh, Outline(problem.forms)
    if len(mesh.layers) > 1 or mesh.comm.size > 1:
        raise InputError(f"Path.deformed_mesh: size = {size:g}: new elements are made of one layer, on one"
                         f" rank: leave it out")
    with problem.state_context(state):
        edges = outline.edges()
    masks, order = {name: outline.mask(name) for name in mesh.boundaries}, outline.ordered("Path.deformed_mesh: size")
    names = [frozenset(name for name, mask in masks.items() if mask[k]) for k in order]
    (layer,), axisymmetric = mesh.layers, problem.scene.kinematics.axisymmetric
    return mesh_of_outline(edges[order], names, np.zeros((0, edges.shape[-1])), size, size, layer, axisymmetric,
                           mesh.comm)
