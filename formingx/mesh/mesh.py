"""Meshes of six-node triangles with named layers (cells) and named boundaries (facets)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from .. import _compat
from ..errors import InputError, check_name, pair
from ..ranks import gathered
from .check import check_elements
from .nodes import facet_node_positions, facet_nodes, own_cells, without_round_off


class Columns(NamedTuple):
    """Columns of elements along a sheet, and the functions that make the same body with other columns.

    Attributes:
        ends: coordinates of the ends of the n columns along the sheet, such as radii of a disc, shape (n + 1,).
        fixed: coordinates of m ends that must be kept, shape (m,).
        faces: names of the boundaries that contain the first and the last row of nodes.
        place: function of k such coordinates, shape (k,), that returns the nodes of all rows through the sheet, shape
            (rows, k, 2), length.
        make: function of other ends that returns the mesh.
    """

    ends: np.ndarray
    fixed: np.ndarray
    faces: tuple[str, str]
    place: Callable[[np.ndarray], np.ndarray]
    make: Callable[[np.ndarray], Mesh]


class Preset(NamedTuple):
    """Accuracy that a script requests for the elements of a sheet, and the function that meshes the sheet again.

    Attributes:
        accuracy: "draft", "standard" or "fine".
        thickness: largest thickness of each layer, shape (layers,), length.
        through: number of elements through each layer.
        make: function that returns a mesh of the same sheet. Its arguments are the coordinates along the sheet of the
            ends of the n columns, shape (n + 1,), and the number of elements through each layer.
    """

    accuracy: str
    thickness: np.ndarray
    through: tuple[int, ...]
    make: Callable[[np.ndarray, Sequence[int]], Mesh]


@dataclass(frozen=True)
class Mesh:
    """Distributed mesh with named layers and boundaries.

    Attributes:
        domain: the `dolfinx.mesh.Mesh`, with coordinates (R, Z), length.
        cells: `MeshTags` of the cells, by layers.
        facets: `MeshTags` of the facets, by boundaries.
        layers: {name: tag of its cells}.
        boundaries: {name: tags of its facets}; several tags if a part has its own name (`with_part`).
        comm: the communicator on which the mesh was made. Pass Python objects on it, not on its copy `domain.comm`.
            Data that mpi4py attaches to the copy are freed with it. Inside an exception this would block the exit of
            Python.
        columns: `Columns` of elements along a disc, a sphere, a parison or a `from_lines` body; None for other meshes.
        preset: `Preset` of a disc or parison whose elements a `Scene` may choose; None for other meshes.
        inaccurate: for elements that a `Scene` chose, places where the wall may miss the promised accuracy, as text.

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
    preset: Preset | None = None
    inaccurate: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return a summary of the mesh; not collective, so on several ranks without sizes and numbers of edges."""
        cells, serial = self.domain.topology.index_map(2).size_global, self.comm.size == 1
        edges = {name: f" ({len(self.facets_of(name))} edges)" if serial else "" for name in self.boundaries}
        lines = [f"{cells} six-node triangles"]
        if serial:
            x = self.domain.geometry.x[:, :2]
            (r, z), (R, Z) = (without_round_off(point, x) for point in (x.min(axis=0), x.max(axis=0)))
            lines[0] += f", R from {r:.6g} to {R:.6g}, Z from {z:.6g} to {Z:.6g}"
        return "\n".join([*lines, f"layers: {', '.join(self.layers)}",
                          f"boundaries: {', '.join(name + of for name, of in edges.items())}"])

    def check(self) -> None:
        """Check the elements of this mesh, after a script moved its nodes; collective.

        Raises:
            InputError: a coordinate is not finite. An element is flat or inverted. Two elements overlap, or meet
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
        """Return the local numbers of the facets of a boundary, in ascending order, with ghosts, shape (n,).

        Args:
            boundary: name of the boundary.
        """
        check_name("Mesh: boundary", boundary, self.boundaries)
        return np.sort(np.concatenate([self.facets.find(tag) for tag in self.boundaries[boundary]]))

    def with_part(self, name: str, of: str, within: tuple[float, float], along: str = "r") -> Mesh:
        """Return the mesh with a further boundary: a part of a boundary between two coordinates.

        The facets then belong to both boundaries. So a load or contact on the whole boundary also acts on the part.

        Args:
            name: new name of the part.
            of: name of the boundary that contains the part.
            within: (lowest, highest) reference coordinate of the part, length. There must be nodes at both values,
                unless the boundary ends before; a `disc` has nodes at the radii in its argument `concentrate`.
            along: coordinate that `within` limits, "r" or "z".

        Returns:
            A mesh that shares the elements of this mesh.

        Raises:
            InputError: `of` is unknown, `name` is not new, no facet lies between the coordinates, or a facet is cut.
        """
        from dolfinx.mesh import meshtags
        caller = f"with_part({name!r}, {of!r})"
        if not isinstance(name, str) or not name or name in self.boundaries:
            raise InputError(f"{caller}: name = {name!r}: must be a word that no boundary has yet; there are"
                             f" {', '.join(map(repr, self.boundaries))}")
        check_name(f"{caller}: boundary", of, self.boundaries)
        check_name(f"{caller}: along", along, ("r", "z"))
        low, high = pair(f"{caller}: within", within)
        if not low < high:
            raise InputError(f"{caller}: within = {within!r}: the first must be below the second")
        domain, axis = self.domain, "rz".index(along)
        comm, facets = self.comm, self.facets_of(of)
        ends = facet_node_positions(domain, facets)[:, :2, axis]
        tolerance = 1e-8 * comm.allreduce(np.abs(domain.geometry.x).max(initial=0.0), MPI.MAX)
        lowest, highest = ends.min(1), ends.max(1)
        inside = (lowest > low - tolerance) & (highest < high + tolerance)
        cut = ~inside & (lowest < high - tolerance) & (highest > low + tolerance)
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
        preset, part = self.preset, (name, of, within, along)
        if preset is not None:
            made = preset.make
            preset = preset._replace(make=lambda ends, through: made(ends, through).with_part(*part))
        return replace(self, facets=meshtags(domain, 1, self.facets.indices, values),
                       boundaries=boundaries | {name: tuple(new.values())}, preset=preset,
                       columns=self._columns_with_part((low, high), axis, tolerance, part))

    def _columns_with_part(self, limits: tuple, axis: int, tolerance: float, part: tuple) -> Columns | None:
        """Return the `Columns` of the mesh, which end at the limits of a new part of a boundary; None without columns.

        The axis is 0 for R, 1 for Z; limits and tolerance are lengths; `part` has the arguments of `with_part`.
        """
        if self.columns is None:
            return None
        columns, make = self.columns, self.columns.make
        x = columns.place(columns.ends)[[0, -1], :, axis]
        limit = (np.abs(x[..., None] - np.array(limits)) < tolerance).any((0, 2))
        return columns._replace(fixed=np.union1d(columns.fixed, columns.ends[limit]),
                                make=lambda ends: make(ends).with_part(*part))

    def nodes_of(self, boundary: str) -> np.ndarray:
        """Return the coordinates of all nodes of a boundary, sorted by R, then Z; collective.

        Args:
            boundary: name of the boundary.

        Returns:
            Coordinates (R, Z), shape (n, 2), in three dimensions (x, y, z), shape (n, 3), length; equal on all ranks.
        """
        domain, facets = self.domain, self.facets_of(boundary)
        nodes = np.unique(facet_nodes(domain, facets))
        points = gathered(self.comm, domain.geometry.x[nodes, :domain.geometry.dim])
        scale = np.ptp(points, axis=0).max() if len(points) else 1.0
        keys = np.round(points / (scale or 1.0), 12)
        _, first = np.unique(keys, axis=0, return_index=True)
        points = points[first]
        return points[np.lexsort((points[:, 1], points[:, 0]))]

    def line_of(self, boundary: str) -> np.ndarray:
        """Return the ends and middles of the edges of a boundary in order along it; collective.

        The first node is the end of smaller R, or of smaller Z for equal R.

        Args:
            boundary: name of the boundary.

        Returns:
            Nodes (R, Z), shape (2 n + 1, 2) for n edges, with the ends in even rows, length; equal on all ranks.

        Raises:
            InputError: the boundary is not one line with two ends.
        """
        edges = gathered(self.comm, facet_node_positions(self.domain, self.facets_of(boundary)))
        size = max(np.ptp(edges, axis=(0, 1)).max(), 1e-300)
        corners, ends = np.unique(np.round(edges[:, :2].reshape(-1, edges.shape[-1]) / size, 12), axis=0,
                                  return_inverse=True)
        ends = ends.reshape(-1, 2)
        _, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)       # ghost edges occur twice
        edges_at: dict[int, list[int]] = {}
        for number in first.tolist():
            for corner in ends[number].tolist():
                edges_at.setdefault(corner, []).append(number)
        # corners are sorted by R, then Z
        tips = sorted(corner for corner, adjacent in edges_at.items() if len(adjacent) == 1)
        if len(tips) != 2 or max(map(len, edges_at.values())) > 2:
            raise InputError(f"boundary {boundary!r} must be one line with two ends; {len(tips)} ends were found")
        corner, line, edge = tips[0], [], -1
        for _ in first:
            edge = next(e for e in edges_at[corner] if e != edge)
            forward = ends[edge, 0] == corner
            a, b = edges[edge, [0, 1] if forward else [1, 0]]
            line += [a, edges[edge, 2] if edges.shape[1] == 3 else (a + b) / 2]
            corner = ends[edge, 1 if forward else 0]
        if len(line) != 2 * len(first) or corner != tips[1]:
            raise InputError(f"boundary {boundary!r} must be one line with two ends, but is in several parts")
        return np.array([*line, b])
