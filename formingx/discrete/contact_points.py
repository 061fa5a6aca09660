"""Contact of one face at Gauss points of its facets: they let go one by one, and a facet's forces change less."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem, la

from .contact_nodes import ContactNodes


class ContactPoints(ContactNodes):
    """`ContactNodes`, at `contact.points` Gauss points of each facet of a cell that this rank owns.

    Nodes of such a facet may be ghosts: `displacement`, `add` and what calls them are collective.

    Attributes:
        dofs: local numbers of (u_r, u_z) of the three nodes of the facet that each point is on, shape (n, 6), ghosts
            included.
        shapes: their shape functions at the points, shape (n, 3).
    """

    def _place(self, assemble: Any) -> None:
        solid, mesh = self.solid, self.solid.scene.mesh
        vectors, numbers = solid.space.sub(0).collapse()
        numbers, X = np.asarray(numbers, dtype=np.int32).reshape(-1, 2), vectors.tabulate_dof_coordinates()[:, :2]
        self._unknowns = la.vector(solid.space.dofmap.index_map, 1)
        facets = [ends_first(fem.locate_dofs_topological(vectors, 1, np.array([f], dtype=np.int32), remote=False), X)
                  for f in _own_facets(mesh, self.contact.on)]
        nodes = np.array(facets, dtype=np.int32).reshape(-1, 3)
        at, weights = np.polynomial.legendre.leggauss(int(self.contact.points))
        s, q = (1 + at) / 2, len(at)
        shapes = np.column_stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
        slopes = np.column_stack([4 * s - 3, 4 * s - 1, 4 - 8 * s])
        self.dofs = np.repeat(numbers[nodes].reshape(-1, 6), q, axis=0)
        self.shapes, self._slopes = (np.tile(values, (len(nodes), 1)) for values in (shapes, slopes))
        self._corners = np.repeat(X[nodes], q, axis=0)
        self.points = np.einsum("qa,fai->fqi", shapes, X[nodes]).reshape(-1, 2)
        self._along = np.einsum("qa,fai->fqi", slopes, X[nodes]).reshape(-1, 2)
        self.lengths = np.hypot(*self._along.T) * np.tile(weights / 2, len(nodes))
        self.area = self.lumped = self.lengths * solid.scene.kinematics.weight(self.points.T)

    def _nodes(self) -> np.ndarray:
        """Three for each point, shape (n, 3, 2)."""
        return self._corners

    def _temperatures(self) -> np.ndarray | None:
        """See `ContactNodes`; a face that is as hot all over stays so to the last bit."""
        T = super()._temperatures()
        return None if T is None else T[:, 0] + np.einsum("na,na->n", self.shapes[:, 1:], T[:, 1:] - T[:, :1])

    def displacement(self, values: np.ndarray) -> np.ndarray:
        """See `ContactNodes`."""
        return np.einsum("na,nai->ni", self.shapes, self._at_nodes(values))

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        """See `ContactNodes`."""
        unknowns, n = self._unknowns, self._owned
        unknowns.array[:] = 0
        np.add.at(unknowns.array, self.dofs, np.einsum("na,ni->nai", self.shapes, forces).reshape(-1, 6))
        unknowns.scatter_reverse(la.InsertMode.add)
        values[:n] += unknowns.array[:n]

    def area_ratio(self, fields: np.ndarray) -> np.ndarray:
        """Deformed over reference area at the points, shape (n,); `fields`: owned unknowns."""
        along = self._along + self._length * np.einsum("na,nai->ni", self._slopes, self._at_nodes(fields))
        weight, now = self.solid.scene.kinematics.weight, self.points + self._length * self.displacement(fields)
        return np.hypot(*along.T) / np.hypot(*self._along.T) * weight(now.T) / weight(self.points.T)

    def _at_nodes(self, values: np.ndarray) -> np.ndarray:
        """Of the three nodes of each point, shape (n, 3, 2), from owned unknowns."""
        unknowns, n = self._unknowns, self._owned
        unknowns.array[:n] = values[:n]
        unknowns.scatter_forward()
        return unknowns.array[self.dofs].reshape(-1, 3, 2)

    @property
    def _owned(self) -> int:
        return self._unknowns.index_map.size_local

    def _between_unknowns(self, stiffness: np.ndarray) -> np.ndarray:
        blocks = np.einsum("na,nb,nij->naibj", self.shapes, self.shapes, stiffness)
        return blocks.reshape(-1, 6, 6)


def _own_facets(mesh: Any, on: str) -> np.ndarray:
    """Local numbers of the facets of a boundary whose cells this rank owns: each facet is one rank's."""
    topology, facets = mesh.domain.topology, mesh.facets_of(on)
    topology.create_connectivity(1, 2)
    cells = np.array([topology.connectivity(1, 2).links(f)[0] for f in facets], dtype=np.int64)
    return facets[cells < topology.index_map(2).size_local]


def ends_first(nodes: np.ndarray, X: np.ndarray) -> np.ndarray:
    """The two ends and the middle of an edge: no two of its nodes are further apart than the ends."""
    away = np.linalg.norm(X[nodes][:, None] - X[nodes][None], axis=-1)
    i, j = np.unravel_index(np.argmax(away), (3, 3))
    return nodes[[i, j, 3 - i - j]]
