"""Contact of one face at Gauss points of its facets: they let go one by one, and a facet's forces change less."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem

from ..errors import InputError
from .contact_nodes import ContactNodes


class ContactPoints(ContactNodes):
    """`ContactNodes`, at `contact.points` Gauss points of each facet.

    Raises:
        InputError: there is more than one rank (a facet's nodes may belong to another).

    Attributes:
        dofs: local numbers of (u_r, u_z) of the three nodes of the facet that each point is on, shape (n, 6).
        shapes: their shape functions at the points, shape (n, 3).
    """

    def _place(self, assemble: Any) -> None:
        if self._comm.size > 1:
            raise InputError(f"Contact({self.contact.on!r}): points = {self.contact.points!r}, {self._comm.size} ranks:"
                             " contact at Gauss points runs in one process; use points='nodes' under mpirun")
        solid, mesh = self.solid, self.solid.scene.mesh
        vectors, numbers = solid.space.sub(0).collapse()
        numbers, X = np.asarray(numbers, dtype=np.int32).reshape(-1, 2), vectors.tabulate_dof_coordinates()[:, :2]
        facets = mesh.facets_of(self.contact.on)
        nodes = np.array([_ends_first(fem.locate_dofs_topological(vectors, 1, np.array([f], dtype=np.int32)), X)
                          for f in facets], dtype=np.int32).reshape(-1, 3)
        at, weights = np.polynomial.legendre.leggauss(int(self.contact.points))
        s, q = (1 + at) / 2, len(at)
        shapes = np.column_stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
        slopes = np.column_stack([4 * s - 3, 4 * s - 1, 4 - 8 * s])
        self.dofs = np.repeat(numbers[nodes].reshape(-1, 6), q, axis=0)
        self.shapes = np.tile(shapes, (len(nodes), 1))
        self._corners = np.repeat(X[nodes], q, axis=0)
        self.points = np.einsum("qa,fai->fqi", shapes, X[nodes]).reshape(-1, 2)
        along = np.einsum("qa,fai->fqi", slopes, X[nodes]).reshape(-1, 2)
        self.lengths = np.hypot(*along.T) * np.tile(weights / 2, len(nodes))
        self.area = self.lengths * solid.scene.kinematics.weight(self.points.T)

    def _nodes(self) -> np.ndarray:
        """Three for each point, shape (n, 3, 2)."""
        return self._corners

    def _temperatures(self) -> np.ndarray | None:
        """See `ContactNodes`; a face that is as hot all over stays so to the last bit."""
        T = super()._temperatures()
        return None if T is None else T[:, 0] + np.einsum("na,na->n", self.shapes[:, 1:], T[:, 1:] - T[:, :1])

    def displacement(self, values: np.ndarray) -> np.ndarray:
        """See `ContactNodes`."""
        return np.einsum("na,nai->ni", self.shapes, values[self.dofs].reshape(-1, 3, 2))

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        """See `ContactNodes`."""
        np.add.at(values, self.dofs, np.einsum("na,ni->nai", self.shapes, forces).reshape(-1, 6))

    def _between_unknowns(self, stiffness: np.ndarray) -> np.ndarray:
        blocks = np.einsum("na,nb,nij->naibj", self.shapes, self.shapes, stiffness)
        return blocks.reshape(-1, 6, 6)


def _ends_first(nodes: np.ndarray, X: np.ndarray) -> np.ndarray:
    """The two ends and the middle of an edge: no two of its nodes are further apart than the ends."""
    away = np.linalg.norm(X[nodes][:, None] - X[nodes][None], axis=-1)
    i, j = np.unravel_index(np.argmax(away), (3, 3))
    return nodes[[i, j, 3 - i - j]]
