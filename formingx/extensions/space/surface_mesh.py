"""Meshes of surfaces in three dimensions: flat sheets, tubes, preforms and other surfaces of triangles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI

from ... import _compat
from ...errors import InputError, as_list
from ...mesh.check_surface import check_surface
from ...mesh.grid import Grid, to_mesh
from ...mesh.mesh import Mesh
from ...mesh.nodes import cell_node_positions, own_cells, span
from ...ranks import gathered


@dataclass(frozen=True)
class SurfaceMesh(Mesh):
    """Mesh of a surface in three dimensions: triangles, flat or curved in the reference configuration.

    Each layer covers the whole surface. Besides the boundaries along its edges a surface has two faces, which are
    boundaries, too. A membrane has one surface only, so the face on which a pressure acts determines the direction of
    the pressure. The boundary of a face contains all edges of the triangles.

    Attributes:
        faces: {name of a face: 1 if its outward normal is the normal of the triangles, -1 if it is the opposite}. The
            triangles are counter-clockwise seen from the side of their normal.
        of_size: function that meshes the same flat sheet again; its argument is the edge length of the triangles, a
            number or a function of (x, y). None for other surfaces.
        meridian: points (r, z) of the meridian of a surface of revolution, from the neck on, shape (n, 2), length; else
            None.
    """

    faces: dict[str, float] = field(default_factory=dict)
    of_size: Callable[[Any], SurfaceMesh] | None = None
    meridian: np.ndarray | None = None

    def __str__(self) -> str:
        x, n = self.domain.geometry.x, self.domain.topology.index_map(2).size_global
        spans = [f"{a} from {x[:, k].min():.6g} to {x[:, k].max():.6g}" for k, a in enumerate("xyz")
                 if k < 2 or np.ptp(x[:, k]) > 0]
        return "\n".join([f"{n} triangles" + f", {', '.join(spans)}" * (self.comm.size == 1),
                          f"layers: {', '.join(self.layers)}", f"boundaries: {', '.join(self.boundaries)}"])

    @property
    def flat(self) -> bool:
        """True if the surface lies in a plane z = constant; collective."""
        low, high = span(self.domain, self.comm)
        return bool((high - low)[2] <= 1e-9 * (high - low).max())

    def check(self) -> None:
        """Check the triangles of this mesh, after a script moved its nodes; collective.

        Raises:
            InputError: the surface is not valid (`formingx.mesh.check_surface`).
        """
        check_surface(*self.whole(), "the mesh")

    def facets_of(self, boundary: str) -> np.ndarray:
        """Return the local numbers of the edges on a boundary, shape (k,); all edges for a face."""
        if boundary in self.faces:
            edges = self.domain.topology
            edges.create_entities(1)
            return np.arange(edges.index_map(1).size_local + edges.index_map(1).num_ghosts, dtype=np.int32)
        return super().facets_of(boundary)

    def whole(self) -> tuple[np.ndarray, np.ndarray]:
        """Return nodes and triangles of all ranks; collective.

        Returns:
            Nodes (x, y, z), shape (n, 3), length; node numbers of the triangles, shape (m, 3).
        """
        geometry, nodes = self.domain.geometry, np.asarray(_compat.cell_nodes(self.domain))[own_cells(self.domain)]
        numbers = geometry.index_map().local_to_global(nodes.ravel().astype(np.int32)).reshape(nodes.shape)
        triangles = gathered(self.comm, numbers)
        points = np.zeros((geometry.index_map().size_global, 3))
        points[gathered(self.comm, numbers.ravel())] = gathered(self.comm, geometry.x[nodes.ravel()])
        return points, triangles

    def outward(self, face: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the nodes, and the outward unit normals of a face at the nodes; collective.

        The normal at a node is the mean of the normals of the adjacent triangles, weighted with their areas.

        Args:
            face: name of the face.

        Returns:
            Nodes (x, y, z), shape (n, 3), length; unit normals, shape (n, 3); equal on all ranks.
        """
        points, triangles = self.whole()
        corners, normal = points[triangles], np.zeros_like(points)
        each = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        np.add.at(normal, triangles.ravel(), np.repeat(each, 3, axis=0))
        return points, self.faces[face] * normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def nearest(self, places: np.ndarray) -> np.ndarray:
        """Return the points of a curved surface that stand for given places, such as the middle of an arc; collective.

        Triangles are chords of the curved surface. A place that is farther from them than a quarter of an edge, or any
        place on a flat sheet, is returned as it is.

        Args:
            places: coordinates (x, y, z) of the n places, shape (n, 3), length.

        Returns:
            Coordinates, shape (n, 3), length.
        """
        if self.flat or places.shape[1] < 3:
            return places
        points, triangles = self.whole()
        corners = points[triangles]
        found, rows, away = closest_points(places, corners)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)[rows]
        return np.where((away < longest / 4)[:, None], found, places)

    def enclosed_volume(self) -> float:
        r"""Return the volume inside the modelled surface in the reference configuration; collective.

        Lids normal to z close its open ends, and planes of symmetry x = 0 and y = 0 its other edges.

        .. math:: V = \frac{1}{2} \int_{\Gamma} (x N_x + y N_y) \, dS

        N is the normal of the triangles. On the lids N_x and N_y vanish; on the planes of symmetry x N_x and y N_y do.

        Returns:
            Volume, length^3.
        """
        return volume_within(*self.whole())

    def arc_length(self, x: Any, y: Any, z: Any) -> np.ndarray:
        """Return the arc length along the meridian of a surface of revolution, from its neck.

        Args:
            x: coordinates x of n points near the surface, shape (n,), length.
            y: coordinates y, shape (n,), length.
            z: coordinates z, shape (n,), length.

        Returns:
            Arc lengths of the nearest points of the meridian, shape (n,), length.

        Raises:
            InputError: the mesh is no surface of revolution.

        >>> fx.mesh.tube(radius=10.0, length=60.0, elements=(6, 8)).arc_length([10.0], [0.0], [-20.0]).tolist()
        [20.0]
        """
        if self.meridian is None:
            raise InputError("arc_length: the mesh has no meridian: it must be made by fx.mesh.tube or"
                             " fx.mesh.revolved")
        points = np.column_stack([np.hypot(x, y), np.broadcast_to(np.asarray(z, float), np.shape(x))])
        start, edge = self.meridian[:-1], np.diff(self.meridian, axis=0)
        length = np.linalg.norm(edge, axis=1)
        s = np.clip(np.einsum("nki,ki->nk", points[:, None] - start, edge) / length**2, 0.0, 1.0)
        away = np.linalg.norm(points[:, None] - start - s[..., None] * edge, axis=2)
        k, before = away.argmin(1), np.concatenate([[0.0], np.cumsum(length)[:-1]])
        return np.asarray(before[k] + s[np.arange(len(k)), k] * length[k])


def closest_points(places: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the closest point of triangles (m, 3, 3) to each place (n, 3), its triangle and distance (n,), length."""
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    squares = np.maximum(np.einsum("mki,mki->mk", edges, edges), 1e-300)
    found, rows, away = np.empty_like(places), np.empty(len(places), dtype=int), np.empty(len(places))
    for n, place in enumerate(places):
        off = place - corners
        height = np.einsum("mi,mi->m", off[:, 0], normal)
        inside = (np.einsum("mki,mi->mk", np.cross(edges, off), normal) >= 0).all(1)
        share = np.clip(np.einsum("mki,mki->mk", off, edges) / squares, 0.0, 1.0)
        on_edges = corners + share[..., None] * edges
        distance = np.linalg.norm(place - on_edges, axis=2)
        distance, best = np.where(inside[:, None], np.abs(height)[:, None], distance), distance.argmin(1)
        k = rows[n] = distance.min(1).argmin()
        found[n] = place - height[k] * normal[k] if inside[k] else on_edges[k, best[k]]
        away[n] = distance[k].min()
    return found, rows, away


def volume_within(points: np.ndarray, triangles: np.ndarray) -> float:
    """Return the volume in outward triangles (m, 3), closed by lids normal to z and planes x = 0, y = 0, length^3."""
    corners = points[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    return float(np.einsum("mi,mi->", corners.mean(1)[:, :2], area[:, :2]) / 2)


def below(points: np.ndarray, triangles: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the part of a surface below the plane z = `level`, length (`positive_part`)."""
    return positive_part(points[triangles], level - points[triangles][..., 2])


def positive_part(corners: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the part of triangles in which a linear function is not negative.

    corners: (m, 3, 3), length; values: (m, 3). Results: vertices (k, 3), triangles (j, 3), their old triangles (j,).
    """
    inside = values >= 0
    whole, cut = np.flatnonzero(inside.all(1)), np.flatnonzero(inside.any(1) & ~inside.all(1))
    first = np.where(inside[cut].sum(1) == 1, inside[cut].argmax(1), (~inside[cut]).argmax(1))    # alone on its side
    order = (first[:, None] + np.arange(3)) % 3
    (a, b, c), (f, g, h) = corners[cut[:, None], order].swapaxes(0, 1), values[cut[:, None], order].T
    p, q = (a + (f / (f - other))[:, None] * (end - a) for end, other in ((b, g), (c, h)))
    single = inside[cut].sum(1) == 1
    tips = np.stack([a, p, q], 1)[single]
    rests = np.concatenate([np.stack([p, b, c], 1)[~single], np.stack([p, c, q], 1)[~single]])
    found = np.concatenate([corners[whole], tips, rests])
    owner = np.concatenate([whole, cut[single], cut[~single], cut[~single]])
    return found.reshape(-1, 3), np.arange(3 * len(found)).reshape(-1, 3), owner


def surface_mesh(make: Callable[[], Grid], comm: MPI.Comm, what: str, faces: tuple[str, str],
                 layers: Sequence[str] = ("sheet",), **more: Any) -> SurfaceMesh:
    """Return the distributed mesh of a surface, with its two faces among the boundaries; collective.

    Rank 0 calls `make`; `faces[0]` is opposite to the normals. Raise `InputError` for invalid elements or names.
    """
    words = as_list(f"{what}: layers", layers, "names")
    if not words or len(set(words)) < len(words):
        raise InputError(f"{what}: layers = {layers!r}: must be at least one name, and each another")
    return of_plain(to_mesh(make, comm, what), faces, words, **more)


def of_plain(plain: Mesh, faces: tuple[str, str] = ("inner", "outer"), layers: Sequence[str] = (),
             **more: Any) -> SurfaceMesh:
    """Return the mesh of a surface with the domain and the boundaries of a plain mesh of triangles.

    `faces[0]` is opposite to the normals. Raise `InputError` for several layers, or for six-node triangles.
    """
    if len(plain.layers) > 1 or cell_node_positions(plain.domain, own_cells(plain.domain)[:0]).shape[1] > 3:
        raise InputError(f"a surface in three dimensions consists of three-node triangles, and each layer covers all of"
                         f" it: this one has the layers {', '.join(map(repr, plain.layers))}: name one group")
    words = list(layers) or list(plain.layers)
    return SurfaceMesh(**{**{name: getattr(plain, name) for name in Mesh.__dataclass_fields__},
                          "layers": dict.fromkeys(words, next(iter(plain.layers.values()))),
                          "boundaries": plain.boundaries | dict.fromkeys(faces, ()),
                          "faces": dict(zip(faces, (-1.0, 1.0)))}, **more)
