"""Meshes of six-node triangles with named layers (cells) and named boundaries (facets)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from .. import _compat
from ..errors import InputError, known, pair
from ..ranks import gathered
from .check import check_elements
from .nodes import numbers_of_facets, of_facets, own_cells


class Columns(NamedTuple):
    """The columns of elements side by side along a sheet, and how to make the same body of others.

    Attributes:
        ends: where they end, by a coordinate along the sheet, shape (n + 1,); fixed: ends that must stay, shape (m,).
        faces: names of the boundaries along the sheet, with the first and the last row of nodes.
        place: at coordinates, shape (k,): the nodes of all rows there, shape (rows, k, 2), length.
        make: the mesh with other ends.
    """

    ends: np.ndarray
    fixed: np.ndarray
    faces: tuple[str, str]
    place: Callable[[np.ndarray], np.ndarray]
    make: Callable[[np.ndarray], Mesh]


@dataclass(frozen=True)
class Mesh:
    """A distributed mesh and the names of its parts.

    Attributes:
        domain: the `dolfinx.mesh.Mesh`; coordinates (R, Z) in the user's unit of length.
        cells, facets: its `MeshTags`.
        layers: name to tag.
        boundaries: name to the tags of its facets: one, or several where a part has a name of its own (`with_part`).
        comm: the communicator on which the mesh was made. Pass Python objects on it, not on its copy `domain.comm`.
            Data that mpi4py attaches to the copy are freed with it. Inside an exception this would lock up the exit of
            Python.
        columns: `Columns` of elements along a disc, a sphere, a parison or a `from_lines` body; None for other meshes.

    >>> list(sheet.layers), list(sheet.boundaries), sheet.nodes_of("rim").shape
    (['sheet'], ['axis', 'rim', 'bottom', 'top'], (3, 2))
    """

    domain: Any
    cells: Any
    facets: Any
    layers: dict[str, int]
    boundaries: dict[str, tuple[int, ...]]
    comm: MPI.Comm
    columns: Columns | None = None

    def __str__(self) -> str:
        """Return a text on the mesh; edges and sizes only of a mesh on one rank: it is not collective."""
        cells, alone = self.domain.topology.index_map(2).size_global, self.comm.size == 1
        edges = {name: f" ({len(self.facets_of(name))} edges)" if alone else "" for name in self.boundaries}
        lines = [f"{cells} six-node triangles"]
        if alone:
            (r, z), (R, Z) = (f(self.domain.geometry.x[:, :2], axis=0) for f in (np.min, np.max))
            lines[0] += f", R from {r:.6g} to {R:.6g}, Z from {z:.6g} to {Z:.6g}"
        return "\n".join([*lines, f"layers: {', '.join(self.layers)}",
                          f"boundaries: {', '.join(name + of for name, of in edges.items())}"])

    def check(self) -> None:
        """Check the elements of a mesh whose nodes were moved, as on reading a file. Collective.

        Raises:
            InputError: a coordinate is not finite. An element is flat or inside out. Two elements overlap, or meet
                without sharing their nodes. The message gives the position.
        """
        geometry, nodes = self.domain.geometry, np.asarray(_compat.cell_nodes(self.domain))[own_cells(self.domain)]
        numbers = geometry.index_map().local_to_global(nodes.ravel().astype(np.int32)).reshape(nodes.shape)
        parts = self.comm.allgather((numbers, geometry.x[nodes, :2]))
        triangles = np.concatenate([part for part, _ in parts])[:, [0, 1, 2, 5, 3, 4][: nodes.shape[1]]]
        points = np.zeros((triangles.max() + 1, 2))
        for part, x in parts:
            points[part] = x
        check_elements(points, triangles, "the mesh")

    def facets_of(self, boundary: str) -> np.ndarray:
        """Local facet indices of a boundary, sorted, shape (n,), ghosts included."""
        known("Mesh: boundary", boundary, self.boundaries)
        return np.sort(np.concatenate([self.facets.find(tag) for tag in self.boundaries[boundary]]))

    def with_part(self, name: str, of: str, within: tuple[float, float], along: str = "r") -> Mesh:
        """Return the mesh with one more boundary: the facets of a boundary between two coordinates.

        They belong to both boundaries from then on: a load or contact on the whole acts on the part too.

        Args:
            name: of the part, a new one.
            of: the boundary that it is a part of.
            within: (lowest, highest) reference coordinate, length; nodes must lie there (`disc`: `concentrate`), unless
                the boundary ends before.
            along: the coordinate, "r" or "z".

        Raises:
            InputError: a name that is not known or not new, no facet within, or one that is within in part only.
        """
        from dolfinx.mesh import meshtags
        caller = f"with_part({name!r}, {of!r})"
        if not isinstance(name, str) or not name or name in self.boundaries:
            raise InputError(f"{caller}: name = {name!r}: must be a word that no boundary has yet; there are"
                             f" {', '.join(map(repr, self.boundaries))}")
        known(f"{caller}: boundary", of, self.boundaries)
        known(f"{caller}: along", along, ("r", "z"))
        low, high = pair(f"{caller}: within", within)
        if not low < high:
            raise InputError(f"{caller}: within = {within!r}: the first must be below the second")
        domain, axis = self.domain, "rz".index(along)
        comm, facets = self.comm, self.facets_of(of)
        ends = of_facets(domain, facets)[:, :2, axis]
        near = 1e-8 * comm.allreduce(np.abs(domain.geometry.x).max(initial=0.0), MPI.MAX)
        lowest, highest = ends.min(1), ends.max(1)
        inside = (lowest > low - near) & (highest < high + near)
        cut = ~inside & (lowest < high - near) & (highest > low + near)
        cuts = gathered(comm, np.column_stack([lowest, highest])[cut])
        if len(cuts):
            raise InputError(f"{caller}: within = {within!r} cuts the element edge from {along} = {cuts[0, 0]:.6g} to"
                             f" {cuts[0, 1]:.6g}: both must be {along} of nodes; a disc has nodes where it is told to"
                             f" concentrate")
        if not comm.allreduce(int(inside.sum()), MPI.SUM):
            raise InputError(f"{caller}: within = {within!r}: {of!r} has nothing there; its {along} is from"
                             f" {comm.allreduce(lowest.min(initial=np.inf), MPI.MIN):.6g} to"
                             f" {comm.allreduce(highest.max(initial=-np.inf), MPI.MAX):.6g}")
        # a facet has one tag: facets of the part get new tags, which belong to every boundary of the old tags
        first, old = 1 + max(tag for tags in self.boundaries.values() for tag in tags), self.boundaries[of]
        values, places = self.facets.values.copy(), np.searchsorted(self.facets.indices, facets[inside])
        values[places] = first + np.searchsorted(old, values[places])
        new = {tag: first + k for k, tag in enumerate(old)}
        boundaries = {key: (*tags, *(new[tag] for tag in tags if tag in new)) for key, tags in self.boundaries.items()}
        return replace(self, facets=meshtags(domain, 1, self.facets.indices, values),
                       boundaries=boundaries | {name: tuple(new.values())},
                       columns=self._columns_with((low, high), axis, near, (name, of, within, along)))

    def _columns_with(self, limits: tuple, axis: int, near: float, part: tuple) -> Columns | None:
        """Return the columns of the mesh with one more part, which ends between two of them."""
        if self.columns is None:
            return None
        columns, make = self.columns, self.columns.make
        x = columns.place(columns.ends)[[0, -1], :, axis]
        limit = (np.abs(x[..., None] - np.array(limits)) < near).any((0, 2))
        return columns._replace(fixed=np.union1d(columns.fixed, columns.ends[limit]),
                                make=lambda ends: make(ends).with_part(*part))

    def nodes_of(self, boundary: str) -> np.ndarray:
        """Coordinates of all geometry nodes of a boundary, sorted by R, then Z, shape (n, 2) (in three dimensions
        (n, 3))."""
        domain, facets = self.domain, self.facets_of(boundary)
        nodes = np.unique(numbers_of_facets(domain, facets))
        points = gathered(self.comm, domain.geometry.x[nodes, :domain.geometry.dim])
        scale = np.ptp(points, axis=0).max() if len(points) else 1.0
        keys = np.round(points / (scale or 1.0), 12)
        _, first = np.unique(keys, axis=0, return_index=True)
        points = points[first]
        return points[np.lexsort((points[:, 1], points[:, 0]))]

    def line_of(self, boundary: str) -> np.ndarray:
        """Return ends and middles of the edges of a boundary one after the other, from its end of smaller R (of
        smaller Z).

        Shape (2 n + 1, 2) for n edges, the ends at even rows; same on all ranks.

        Raises:
            InputError: the boundary is not one line with two ends.
        """
        edges = gathered(self.comm, of_facets(self.domain, self.facets_of(boundary)))
        size = max(np.ptp(edges, axis=(0, 1)).max(), 1e-300)
        corners, ends = np.unique(np.round(edges[:, :2].reshape(-1, edges.shape[-1]) / size, 12), axis=0,
                                  return_inverse=True)
        ends = ends.reshape(-1, 2)
        _, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)       # a ghost is there twice
        at: dict[int, list[int]] = {}
        for edge in first.tolist():
            for corner in ends[edge].tolist():
                at.setdefault(corner, []).append(edge)
        tips = sorted(corner for corner, there in at.items() if len(there) == 1)     # corners are sorted by R, then Z
        if len(tips) != 2 or max(map(len, at.values())) > 2:
            raise InputError(f"boundary {boundary!r} must be one line with two ends; {len(tips)} ends were found")
        corner, line, here = tips[0], [], -1
        for _ in first:
            here = next(e for e in at[corner] if e != here)
            forward = ends[here, 0] == corner
            a, b = edges[here, [0, 1] if forward else [1, 0]]
            line += [a, edges[here, 2] if edges.shape[1] == 3 else (a + b) / 2]
            corner = ends[here, 1 if forward else 0]
        if len(line) != 2 * len(first) or corner != tips[1]:
            raise InputError(f"boundary {boundary!r} must be one line with two ends, but is in several parts")
        return np.array([*line, b])
