"""Mesh as plain arrays on one rank, and its conversion to and from a distributed mesh."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from .. import _compat
from ..errors import InputError
from ..findings import coordinates
from .check import check_elements
from .check_surface import check_surface
from .mesh import Mesh
from .nodes import facet_nodes, own_cells

# DOLFINx numbers a mid-edge node like the opposite corner; in a grid edges are 01, 12, 20
_TO_DOLFINX, _FROM_DOLFINX = [0, 1, 2, 4, 5, 3], [0, 1, 2, 5, 3, 4]
_EDGES = ((0, 1, 3), (1, 2, 4), (2, 0, 5))              # ends, middle


class Grid(NamedTuple):
    """Mesh on one rank; `layers` and `boundaries` refer to rows of `points`.

    Attributes:
        points: nodes (R, Z), shape (n, 2), length; in three dimensions (x, y, z), shape (n, 3).
        numbers: node numbers in a file, shape (n,).
        layers: {name: triangles, shape (m, 6)}: corners counter-clockwise, then middles of edges 01, 12, 20.
            First-order triangles have shape (m, 3).
        boundaries: {name: edges, shape (k, 3)}: first, last, middle node, with the body on the left. First-order edges
            have shape (k, 2).

    >>> grid = fx.mesh.to_grid(sheet)
    >>> grid.points.shape, grid.layers["sheet"].shape, grid.boundaries["bottom"].shape
    ((51, 2), (16, 6), (8, 3))
    """

    points: np.ndarray
    numbers: np.ndarray
    layers: dict[str, np.ndarray]
    boundaries: dict[str, np.ndarray]


def counter_clockwise(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return triangles (m, 3 or 6), corners then middles, with their nodes in counter-clockwise order."""
    triangles = np.array(triangles)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    wrong = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[wrong] = triangles[wrong][:, [0, 2, 1, 5, 4, 3][: triangles.shape[1]]]
    return triangles


def to_grid(mesh: Mesh) -> Grid:
    """Return the mesh as plain arrays (`Grid`), on one rank only; node i of the mesh has the number i + 1.

    Raises:
        InputError: there is more than one rank.

    >>> fx.mesh.to_grid(sheet).points.max(0).tolist()
    [10.0, 0.3]
    """
    if mesh.comm.size > 1:
        raise InputError("the nodes of a mesh are numbered and written on one rank only: run this on one")
    return gathered(mesh)


def gathered(mesh: Mesh) -> Grid:
    """Return the whole mesh as plain arrays (`Grid`), equal on all ranks; collective."""
    domain, comm = mesh.domain, mesh.comm
    owned, X = len(own_cells(domain)), domain.geometry.x
    numbers = domain.geometry.index_map().local_to_global(np.arange(len(X), dtype=np.int32))
    cells = numbers[np.asarray(_compat.cell_nodes(domain))[:owned]]
    marks = {name: mesh.cells.find(tag) for name, tag in mesh.layers.items()}
    ends = {name: facet_nodes(domain, mesh.facets_of(name))[:, :2] for name in mesh.boundaries}
    tagged = {name: cells[found[found < owned]] for name, found in marks.items()}
    parts = comm.allgather((numbers, X[:, :domain.geometry.dim], tagged,
                            {name: numbers[found] for name, found in ends.items()}))
    points = np.zeros((domain.geometry.index_map().size_global, domain.geometry.dim))
    for number, x, _, _ in parts:
        points[number] = x
    layers = {name: np.concatenate([rows[name] for _, _, rows, _ in parts]) for name in mesh.layers}
    layers = {name: rows[:, _FROM_DOLFINX[: rows.shape[1]]] for name, rows in layers.items()}
    if points.shape[1] == 2:
        layers = {name: counter_clockwise(points, rows) for name, rows in layers.items()}
    triangles = np.concatenate(list(layers.values()))
    edges = {frozenset(row[[i, j]].tolist()): row[[n for n in (i, j, k) if n < len(row)]]
             for row in triangles for i, j, k in _EDGES}
    boundaries = {}
    for name in mesh.boundaries:
        pairs = dict.fromkeys(frozenset(pair) for _, _, _, rows in parts for pair in rows[name].tolist())
        boundaries[name] = np.array([edges[pair] for pair in pairs], dtype=np.int64).reshape(
            len(pairs), 3 if triangles.shape[1] == 6 else 2)
    return Grid(points, np.arange(1, len(points) + 1), layers, boundaries)


def to_mesh(make: Callable[[], Grid], comm: MPI.Comm, what: str) -> Mesh:
    """Return the distributed mesh of `make`'s grid on rank 0; an InputError is raised on all ranks; collective."""
    error, shape = None, None
    if comm.rank == 0:
        try:
            grid = make()
            cells, points, cell_tags, edges, edge_tags, layers, boundaries = _tagged(grid, what)
            shape = cells.shape[1], edges.shape[1], points.shape[1], layers, boundaries
        except InputError as e:
            error = e
    error, shape = comm.bcast((error, shape), root=0)
    if error is not None:
        raise error
    nodes, ends, dim, layers, boundaries = shape
    if comm.rank != 0:
        cells, points, cell_tags = np.empty((0, nodes), np.int64), np.empty((0, dim)), np.empty(0, np.int32)
        edges, edge_tags = np.empty((0, ends), np.int64), np.empty(0, np.int32)
    domain, cell_marks, facet_marks = _compat.mesh_of_triangles(comm, cells, points, cell_tags, edges, edge_tags)
    return Mesh(domain, cell_marks, facet_marks, layers, boundaries, comm)


def _tagged(grid: Grid, what: str) -> tuple:
    """Return the arrays of a grid with its names as tags, in the order of nodes of DOLFINx.

    They are cells (m, 3 or 6), points (n, 2 or 3), length, cell tags (m,), edges (k, 2 or 3), edge tags (k,), {layer:
    tag} and {boundary: tags}; an edge of several boundaries has its own tag. Invalid elements, layers or edges are an
    InputError.
    """
    triangles = np.concatenate(list(grid.layers.values()))
    used = np.unique(triangles)
    number = np.full(len(grid.points), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    points, triangles = grid.points[used], number[triangles]
    same = np.unique(np.sort(triangles[:, :3], axis=1), axis=0, return_counts=True)[1]
    if np.any(same > 1):
        raise InputError(f"{what}: {np.sum(same > 1)} elements belong to more than one layer, or are there twice;"
                         f" layers are {', '.join(map(repr, grid.layers))}")
    (check_elements if points.shape[1] == 2 else check_surface)(points, triangles, what)
    layers = {name: tag for tag, name in enumerate(grid.layers, 1)}
    cell_tags = np.repeat(np.arange(1, len(layers) + 1), [len(rows) for rows in grid.layers.values()])
    width = 3 if triangles.shape[1] == 6 else 2
    first = len(layers) + 1
    tags: dict[tuple[int, ...], int] = {(k,): first + k for k in range(len(grid.boundaries))}
    owners: dict[tuple[int, int], tuple[list, list[int]]] = {}
    known = _edges(triangles)
    for k, (name, rows) in enumerate(grid.boundaries.items()):
        for row in _element_edges(number[rows[:, :2]], known, f"{what}: boundary {name!r}", points):
            key = (min(row[:2]), max(row[:2]))
            names = owners.setdefault(key, (row, []))[1]
            if k not in names:
                names.append(k)
    for _, names in owners.values():
        tags.setdefault(tuple(names), first + len(tags))
    boundaries = {name: tuple(tag for names, tag in tags.items() if k in names)
                  for k, name in enumerate(grid.boundaries)}
    edges = np.array([row for row, _ in owners.values()], dtype=np.int64).reshape(len(owners), width)
    edge_tags = np.array([tags[tuple(names)] for _, names in owners.values()], dtype=np.int32)
    return (triangles[:, _TO_DOLFINX[: triangles.shape[1]]], points, cell_tags.astype(np.int32), edges, edge_tags,
            layers, boundaries)


def _edges(triangles: np.ndarray) -> dict[tuple[int, int], list[int]]:
    """Return {(lower, higher end node): [middle node], [] for three-node triangles} of all edges of triangles."""
    found: dict[tuple[int, int], list[int]] = {}
    for i, j, k in _EDGES:
        ends = np.sort(triangles[:, [i, j]], axis=1).tolist()
        found |= {(a, b): middle for (a, b), middle in zip(ends, triangles[:, k:k + 1].tolist())}
    return found


def _element_edges(edges: np.ndarray, known: dict[tuple[int, int], list[int]], caller: str,
                   points: np.ndarray) -> list[list[int]]:
    """Return [first end, last end, middle] of each boundary edge (k, 2), as node numbers; [] if all are foreign.

    `known` maps the sorted ends of element edges to [middle]; curves outside, such as tools, give []. Only some in
    elements is an InputError.
    """
    pairs = [(int(a), int(b)) for a, b in edges]
    found = [[a, b, *known[min(a, b), max(a, b)]] for a, b in pairs if (min(a, b), max(a, b)) in known]
    if found and len(found) < len(edges):
        bad = next(pair for pair in pairs if (min(pair), max(pair)) not in known)
        position = [coordinates(points[n], 6) if n >= 0 else "a node of no element" for n in bad]
        raise InputError(f"{caller}: its edge from {position[0]} to {position[1]} is not an edge of an element")
    return found
