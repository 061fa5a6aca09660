"""Boundary of a deformed solid: curved edges of all ranks."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import dolfinx.mesh
import numpy as np
from dolfinx import fem

from ..errors import InputError
from ..mesh.check import crossing_edges, crossing_point
from ..ranks import gathered

FINE_PIECES = 16
"""Straight pieces that replace a curved edge where distances and lengths are measured."""

_SEARCH_PIECES = 8
"""Straight pieces of an edge in the search for self-intersections."""


class Outline:
    """Boundary of a deformed solid: m edges of all ranks, each a parabola through its ends and its midpoint.

    The body lies to the left of each edge; the field `w` of the forms is examined.

    Attributes:
        reference_edges: start, end and midpoint of each edge in the reference configuration, shape (m, 3, 2), length.
        ends: vertex numbers of start and end of each edge, shape (m, 2); edges that meet share a number.
    """

    def __init__(self, forms: Any):
        self._forms, domain = forms, forms.domain
        topology = domain.topology
        topology.create_connectivity(1, 2)
        self._facets = dolfinx.mesh.exterior_facet_indices(topology)
        vectors, numbers = forms.space.sub(0).collapse()
        n = forms.scene.kinematics.components
        numbers, X = np.asarray(numbers, dtype=np.int64).reshape(-1, n), vectors.tabulate_dof_coordinates()[:, :n]
        nodes = np.zeros((len(self._facets), 3), dtype=np.int64)
        for k, facet in enumerate(self._facets):
            at = fem.locate_dofs_topological(vectors, 1, np.array([facet], dtype=np.int32), remote=False)
            a, b, middle = ends_first(at, X)
            cell = vectors.dofmap.cell_dofs(topology.connectivity(1, 2).links(facet)[0])
            (tangent, inwards) = X[b] - X[a], X[cell].mean(0) - X[middle]
            left = tangent[0] * inwards[1] > tangent[1] * inwards[0]
            nodes[k] = (a, b, middle) if left else (b, a, middle)
        self._dofs, self._own = numbers[nodes], X[nodes]
        names = vectors.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32)).reshape(-1, 3)
        ends = gathered(forms.comm, names)[:, :2]
        self.ends = np.unique(ends, return_inverse=True)[1].reshape(-1, 2)
        self.reference_edges = gathered(forms.comm, self._own)

    def edges(self) -> np.ndarray:
        """Return start, end and midpoint of each deformed edge, shape (m, 3, 2), length; collective."""
        return gathered(self._forms.comm, self._own + self._forms.length * self._forms.w.x.array[self._dofs])

    def mask(self, boundary: str) -> np.ndarray:
        """Return a mask of the edges that belong to a named boundary, shape (m,); collective."""
        return gathered(self._forms.comm, np.isin(self._facets, self._forms.scene.mesh.facets_of(boundary)))

    def ordered(self, caller: str) -> list[int]:
        """Return the edge numbers counter-clockwise round a body of one part without holes, else an InputError."""
        after = {int(a): k for k, (a, _) in enumerate(self.ends)}
        order = [0]
        while len(order) < len(self.ends):
            order.append(after[int(self.ends[order[-1], 1])])
        if len(set(order)) < len(order):
            raise InputError(f"{caller}: the body has a hole, or several parts: must be one piece without holes")
        return order

    def pieces(self, edges: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray]:
        """Return straight pieces of curved edges (m, 3, 2), length: points (n, 2), end numbers (m parts, 2)."""
        m, corners = len(edges), int(self.ends.max()) + 1
        points = np.empty((corners + m * (parts - 1), edges.shape[-1]))
        points[self.ends] = edges[:, :2]
        points[corners:] = edge_points(edges, parts)[:, 1:-1].reshape(-1, edges.shape[-1])
        inner = corners + np.arange(m * (parts - 1)).reshape(m, parts - 1)
        chain = np.column_stack([self.ends[:, 0], inner, self.ends[:, 1]])
        return points, np.stack([chain[:, :-1], chain[:, 1:]], -1).reshape(-1, 2)

    def self_intersection(self, edges: np.ndarray) -> np.ndarray | None:
        """Return a point where deformed edges, shape (m, 3, 2), length, cross, shape (2,), length; else None.

        Edges with a common neighbour may cross: an element that bends over a sharp edge makes a crease.
        """
        if crossing_point(*self.pieces(edges, 2)) is None:        # chords may cross where the curves do not
            return None
        points, pieces = self.pieces(edges, _SEARCH_PIECES)
        for i, j in itertools.chain.from_iterable(crossing_edges(points, pieces)):
            if not self._near(i // _SEARCH_PIECES, j // _SEARCH_PIECES):
                return points[pieces[i]].mean(0)
        return None

    def _near(self, i: int, j: int) -> bool:
        """Return True if two edges, given by their numbers, are identical, neighbours, or have a common neighbour."""
        around = np.isin(self.ends, self.ends[i]).any(1)
        return bool(np.isin(self.ends[around], self.ends[j]).any())


def edge_points(edges: np.ndarray, parts: int = _SEARCH_PIECES) -> np.ndarray:
    """Return equidistant points on parabolic edges (start, end, midpoint), shape (m, parts + 1, 2), length."""
    return np.einsum("pk,mki->mpi", _shapes(parts), edges)


@functools.cache
def _shapes(parts: int) -> np.ndarray:
    """Return the shape functions of start, end and middle of an edge at equal intervals, shape (parts + 1, 3)."""
    s = np.linspace(0, 1, parts + 1)
    return np.column_stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])


def ends_first(nodes: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Sort the node numbers of an edge, shape (3,): the two furthest apart come first; X: shape (n, 2), length."""
    away = np.linalg.norm(X[nodes][:, None] - X[nodes][None], axis=-1)
    i, j = np.unravel_index(np.argmax(away), (3, 3))
    return nodes[[i, j, 3 - i - j]]
