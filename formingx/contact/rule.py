"""Quadrature of contact on a face of the body, and the motion of the quadrature points with the unknowns.

The points of the Gauss-Lobatto rule are the nodes of six-node triangles. With Gauss points a face separates more
smoothly.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np
from dolfinx import fem, la

from ..forms.outline import ends_first
from ..ranks import gathered


class Rule(Protocol):
    """Quadrature rule of a face: the n contact points that this rank owns.

    Attributes:
        dofs: local numbers of the m unknowns that move each point, for each of its nodes all components, shape (n, m).
        points: reference positions, shape (n, components), length.
        nodes: reference positions of the nodes of each point, shape (n, components) if a point is a node, else
            (n, nodes, components).
        lengths: tributary reference length of each point, shape (n,), length.
        lumped: tributary reference area of each point, shape (n,), length^2 (per depth: length); 0 on the axis.
        area: reference area on which the contact forces act, shape (n,). It equals `lumped`, except on the axis with
            `Lobatto`.
    """

    dofs: np.ndarray
    points: np.ndarray
    nodes: np.ndarray
    lengths: np.ndarray
    lumped: np.ndarray
    area: np.ndarray

    @property
    def extent(self) -> np.ndarray:
        """Share of each point in the reference contact length, shape (n,), length; in three dimensions an area."""

    def displacement(self, values: np.ndarray) -> np.ndarray:
        """Return displacements, (n, components[, k]), of points by owned unknowns, (m[, k]), same unit; collective."""

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        """Add forces at the points, shape (n, components), to owned entries of the residual in place; collective."""

    def add_unit_forces(self, E: np.ndarray, points: np.ndarray | None) -> None:
        """Add unit forces at points (local numbers; None on another rank) to columns E in place; collective.

        E: owned entries of the residual, shape (m, k components), ordered by point, then by component.
        """

    def nodal_stiffness(self, stiffness: np.ndarray) -> np.ndarray:
        """Return stiffness by the unknowns `dofs`, (n, m, m), from that by positions, (n, components, components)."""

    def at_points(self, values: np.ndarray) -> np.ndarray:
        """Interpolate values at the `nodes` of each point, shape (n,) or (n, nodes), to the points, shape (n,)."""

    def area_ratio(self, fields: np.ndarray) -> np.ndarray:
        """Return the ratio of deformed to reference area at the points, shape (n,); fields: owned; collective."""


class _NodalPoints:
    """Base of rules whose contact points are nodes of the face, so that a point moves with the unknowns of its node.

    Attributes:
        dofs: local numbers of the displacement unknowns of each point, shape (n, components).
    """

    dofs: np.ndarray

    def displacement(self, values: np.ndarray) -> np.ndarray:
        return values[self.dofs]

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        values[self.dofs] += forces

    def add_unit_forces(self, E: np.ndarray, points: np.ndarray | None) -> None:
        if points is not None:
            E[self.dofs[points].ravel(), np.arange(E.shape[1])] += 1.0

    def nodal_stiffness(self, stiffness: np.ndarray) -> np.ndarray:
        return stiffness

    def at_points(self, values: np.ndarray) -> np.ndarray:
        return values


class Lobatto(_NodalPoints):
    """Gauss-Lobatto rule: the contact points are the nodes of the face.

    The integral over a straight facet is exact if the integrand, with the weight 2 pi R of the area, is cubic. A node
    on the axis has the tributary area 0 (`lumped`).
    """

    def __init__(self, solid: Any, on: str, assemble: Any):
        kinematics, vectors, numbers = solid.scene.kinematics, *_displacements(solid)
        self._brought = solid.scene.state_transfer
        nodes = np.sort(fem.locate_dofs_topological(vectors, 1, solid.scene.mesh.facets_of(on)))
        own = numbers[nodes, 0] < solid.space.dofmap.index_map.size_local
        self.dofs = numbers[nodes[own]]
        self.points = self.nodes = vectors.tabulate_dof_coordinates()[nodes[own], :kinematics.components].copy()
        self.lengths = assemble(solid.compile(solid.length_row(on)))[self.dofs[:, 0]]
        self.lumped = self.lengths * kinematics.weight(self.points.T)
        self.area = self.lumped.copy()
        self._spread_to_axis(kinematics, solid.comm)
        self._comm, self._length, self._weight = solid.comm, solid.length, kinematics.weight
        self._vectors, self._X = vectors, vectors.tabulate_dof_coordinates()[:, :kinematics.components]
        self._facets = _own_facets(solid.scene.mesh, on)

    def area_ratio(self, fields: np.ndarray) -> np.ndarray:
        """Return the ratio of deformed to reference area at each node, shape (n,); collective.

        It is the mean over the edges on both sides. On the axis the hoop stretch equals that along the edge.
        """
        now = gathered(self._comm, self.points + self._length * self.displacement(fields))
        rest, edges = gathered(self._comm, self.points), self.edges
        ratio = np.linalg.norm(_along(now[edges]), axis=-1) / np.linalg.norm(_along(rest[edges]), axis=-1)
        weight, wider = (np.broadcast_to(np.transpose(self._weight(x[edges].T)), ratio.shape) for x in (rest, now))
        ratio *= np.divide(wider, weight, out=ratio.copy(), where=weight > 1e-9 * weight.max())
        count = np.maximum(np.bincount(edges.ravel(), minlength=len(rest)), 1)
        first = sum(self._comm.allgather(len(self.points))[:self._comm.rank])
        return (np.bincount(edges.ravel(), ratio.ravel(), len(rest)) / count)[first:][:len(self.points)]

    @cached_property
    def extent(self) -> np.ndarray:
        """Share of each node in the contact length of the face, on the first mesh of the body, shape (n,), length.

        It is `lengths` times the mean ratio of edge lengths at the node, first mesh over current mesh.
        """
        if self._brought is None:
            return self.lengths
        first, (a, b, _) = self._brought.original_positions(self.points), self.edges.T
        ratio = np.linalg.norm(first[b] - first[a], axis=1) / np.linalg.norm(self.points[b] - self.points[a], axis=1)
        ends, count = np.repeat(ratio, 3), np.bincount(self.edges.ravel(), minlength=len(first))
        return self.lengths * np.bincount(self.edges.ravel(), ends, len(first)) / np.maximum(count, 1)

    @property
    def has_area(self) -> np.ndarray:
        """Mask of the points with a tributary area `lumped`, shape (n,): all except a node on the axis."""
        return self.lumped > 1e-9 * self.lumped.max()

    @cached_property
    def edges(self) -> np.ndarray:
        """Indices of the end nodes and the middle node of each edge of the face on all ranks, shape (m, 3).

        The contact points are these nodes. The indices count the points of all ranks, in the order of the ranks.
        """
        from scipy.spatial import cKDTree
        X = gathered(self._comm, self._X[_nodes_of(self._facets, self._vectors, self._X)])
        found = cKDTree(gathered(self._comm, self.points)).query(X.reshape(-1, X.shape[2]))[1]
        return np.asarray(found).reshape(-1, 3)

    def _spread_to_axis(self, kinematics: Any, comm: Any) -> None:
        """Give the node on the axis a share of the area of its facet, so that contact forces act on the node.

        The facet extends from the axis along a length L. Its three nodes get the additional areas (1/24, -2/24, 1/24) L
        w, with the weight w = 2 pi R (area per length) at the radius R = L. Integrals of linear functions along the
        facet stay exact.
        """
        nodes = gathered(comm, np.column_stack([self.points, self.lengths, self.lumped]))
        for axis in nodes[without_area(nodes[:, -1], nodes[:, -2])]:
            length, at = 6 * axis[-2], axis[:-2].copy()                 # of its facet, on which Gauss-Lobatto gives 1/6
            away = np.linalg.norm(self.points - at, axis=1) / length
            at[0] += length
            whole = kinematics.weight(at) * length / 24
            for place, share in ((0.0, 1), (0.5, -2), (1.0, 1)):
                self.area[np.abs(away - place) < 0.1] += share * whole


class Vertices(_NodalPoints):
    """Contact points of a sheet in three dimensions: its nodes, each with a third of the area of adjacent triangles.

    The tributary length of a node is the square root of this area.
    """

    def __init__(self, surface: Any, assemble: Any):
        vectors, numbers = _displacements(surface)
        own = np.flatnonzero(numbers[:, 0] < surface.space.dofmap.index_map.size_local)
        self.dofs = numbers[own]
        self.points = self.nodes = vectors.tabulate_dof_coordinates()[own].copy()
        self.area = self.lumped = self.extent = assemble(surface.compile(surface.area_row()))[self.dofs[:, 0]]
        self.lengths = np.sqrt(self.area)
        self.surface, self._assemble = surface, assemble

    def area_ratio(self, fields: np.ndarray) -> np.ndarray:
        """Return the deformed area of the triangles around each node over their reference area, shape (n,); collective.
        """
        w = self.surface.w.x
        before = w.array.copy()
        w.array[: len(fields)] = fields
        w.scatter_forward()
        area = self._assemble(self.surface.deformed_area)[self.dofs[:, 0]]
        w.array[:] = before
        return area / self.area


class Gauss:
    """Gauss rule: `count` contact points on each facet of a face whose adjacent cell this rank owns.

    Nodes of such a facet may be ghosts.

    Attributes:
        shapes: shape functions of the three nodes of the facet at the points, shape (n, 3).
    """

    def __init__(self, solid: Any, on: str, count: int):
        self._kinematics, vectors, numbers = solid.scene.kinematics, *_displacements(solid)
        self._length, components = solid.length, self._kinematics.components
        X = vectors.tabulate_dof_coordinates()[:, :components]
        self._unknowns = la.vector(solid.space.dofmap.index_map, 1)
        nodes = _nodes_of(_own_facets(solid.scene.mesh, on), vectors, X)
        at, weights = np.polynomial.legendre.leggauss(count)
        s, q = (1 + at) / 2, len(at)
        shapes = np.column_stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
        slopes = np.column_stack([4 * s - 3, 4 * s - 1, 4 - 8 * s])
        self.dofs = np.repeat(numbers[nodes].reshape(-1, 3 * components), q, axis=0)
        self.shapes, self._slopes = (np.tile(values, (len(nodes), 1)) for values in (shapes, slopes))
        self.nodes = np.repeat(X[nodes], q, axis=0)
        self.points = np.einsum("qa,fai->fqi", shapes, X[nodes]).reshape(-1, components)
        self._along = np.einsum("qa,fai->fqi", slopes, X[nodes]).reshape(-1, components)
        self.lengths = self.extent = np.linalg.norm(self._along, axis=1) * np.tile(weights / 2, len(nodes))
        self.area = self.lumped = self.lengths * self._kinematics.weight(self.points.T)

    def displacement(self, values: np.ndarray) -> np.ndarray:
        if values.ndim > 1:
            found = np.zeros((*self.points.shape, values.shape[1]))
            for k, column in enumerate(values.T):
                found[..., k] = self.displacement(column)
            return found
        return np.einsum("na,nai->ni", self.shapes, self._at_nodes(values))

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        unknowns, n = self._unknowns, self._owned
        unknowns.array[:] = 0
        np.add.at(unknowns.array, self.dofs, np.einsum("na,ni->nai", self.shapes, forces).reshape(self.dofs.shape))
        unknowns.scatter_reverse(la.InsertMode.add)
        values[:n] += unknowns.array[:n]

    def add_unit_forces(self, E: np.ndarray, points: np.ndarray | None) -> None:
        for k, column in enumerate(E.T):
            forces, (i, way) = np.zeros_like(self.points), divmod(k, self.points.shape[1])
            if points is not None:
                forces[points[i], way] = 1.0
            self.add(column, forces)

    def nodal_stiffness(self, stiffness: np.ndarray) -> np.ndarray:
        blocks = np.einsum("na,nb,nij->naibj", self.shapes, self.shapes, stiffness)
        return blocks.reshape(len(blocks), *[3 * stiffness.shape[-1]] * 2)

    def at_points(self, values: np.ndarray) -> np.ndarray:
        """Interpolate values at the nodes of each facet, shape (n, 3), to shape (n,); uniform ones stay exact."""
        return values[:, 0] + np.einsum("na,na->n", self.shapes[:, 1:], values[:, 1:] - values[:, :1])

    def area_ratio(self, fields: np.ndarray) -> np.ndarray:
        along = self._along + self._length * np.einsum("na,nai->ni", self._slopes, self._at_nodes(fields))
        weight, now = self._kinematics.weight, self.points + self._length * self.displacement(fields)
        grown = np.linalg.norm(along, axis=1) / np.linalg.norm(self._along, axis=1)
        return grown * weight(now.T) / weight(self.points.T)

    def _at_nodes(self, values: np.ndarray) -> np.ndarray:
        """Return displacements (n, 3, components) at the nodes of each point's facet from owned unknowns."""
        unknowns, n = self._unknowns, self._owned
        unknowns.array[:n] = values[:n]
        unknowns.scatter_forward()
        return unknowns.array[self.dofs].reshape(len(self.dofs), 3, -1)

    @property
    def _owned(self) -> int:
        """Number of locally owned unknowns."""
        return self._unknowns.index_map.size_local


def _along(edges: np.ndarray) -> np.ndarray:
    """Return dx/ds at both ends and the middle of edges (m, 3, components), length; s goes from 0 to 1 along each."""
    a, b, m = edges.transpose(1, 0, 2)
    return np.stack([4 * m - 3 * a - b, a - 4 * m + 3 * b, b - a], axis=1)


def without_area(lumped: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return a mask of the nodes on the axis, shape (n,), from areas, length^2, and tributary lengths."""
    return (lumped < 1e-9 * lumped.max()) & (lengths > 0)


def _displacements(solid: Any) -> tuple[Any, np.ndarray]:
    """Return the space of the displacement and the local numbers of each node's unknowns, shape (nodes, components)."""
    vectors, numbers = solid.space.sub(0).collapse()
    return vectors, np.asarray(numbers, dtype=np.int32).reshape(-1, solid.scene.kinematics.components)


def _nodes_of(facets: np.ndarray, vectors: Any, X: np.ndarray) -> np.ndarray:
    """Return local numbers (facets, 3) of ends and middle of facets; X: reference positions (nodes, components)."""
    found = [ends_first(fem.locate_dofs_topological(vectors, 1, np.array([f], dtype=np.int32), remote=False), X)
             for f in facets]
    return np.array(found, dtype=np.int32).reshape(-1, 3)


def _own_facets(mesh: Any, on: str) -> np.ndarray:
    """Return the local numbers of the facets of a boundary whose cells this rank owns."""
    topology, facets = mesh.domain.topology, mesh.facets_of(on)
    topology.create_connectivity(1, 2)
    cells = np.array([topology.connectivity(1, 2).links(f)[0] for f in facets], dtype=np.int64)
    return facets[cells < topology.index_map(2).size_local]
