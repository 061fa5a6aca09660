"""Wall thickness of a part in three dimensions in each triangle and along a cut, and a grid printed on the sheet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ... import figures
from ...errors import InputError, as_points, count, direction, finite, pair, positive, triple
from ...findings import coordinates
from ...mesh.divisions import MAX_RECTANGLES
from ...mesh.edges import edges_of
from ...mesh.nodes import cell_node_positions, own_cells, without_round_off
from ...ranks import gathered
from ...results.files.column_table import ColumnTable
from .surface import wrinkled
from .surface_mesh import below, closest_points, volume_within

_EQUAL_WALLS = 1e-6                                          # relative difference of walls of mirror images

@dataclass(frozen=True, repr=False)
class SheetWall(ColumnTable):
    """Wall thickness of a sheet of m triangles and n nodes in one state of a run; the same on all ranks.

    Attributes:
        reference_points: reference positions of the n nodes, shape (n, 3), length.
        deformed_points: deformed positions of the nodes, shape (n, 3), length.
        triangles: nodes of each triangle, shape (m, 3), counter-clockwise seen from the face "top" or "outer".
        layers: {layer: reference thickness at the centroid of each triangle, shape (m,), length}.
        comm: MPI communicator of the run.
        images: number of images of the modelled body in the whole part, such as 4 for a quarter.
    """

    reference_points: np.ndarray
    deformed_points: np.ndarray
    triangles: np.ndarray
    layers: Mapping[str, np.ndarray]
    comm: Any
    images: int = 1

    @cached_property
    def reference_area(self) -> np.ndarray:
        """Reference area of each triangle, shape (m,), length^2."""
        return np.linalg.norm(_normals(self.reference_points[self.triangles]), axis=1)

    @cached_property
    def area(self) -> np.ndarray:
        """Deformed area of each triangle, shape (m,), length^2."""
        return np.linalg.norm(_normals(self.deformed_points[self.triangles]), axis=1)

    @property
    def reference_thickness(self) -> np.ndarray:
        """Reference thickness of all layers together in each triangle, shape (m,), length."""
        return np.sum(list(self.layers.values()), axis=0)

    @property
    def ratio(self) -> np.ndarray:
        """Deformed over reference thickness of each triangle, shape (m,).

        It equals the reference area over the deformed area, since the material is incompressible.
        """
        return self.reference_area / self.area

    @property
    def wall(self) -> np.ndarray:
        """Deformed thickness of each triangle, shape (m,), length."""
        return self.reference_thickness * self.ratio

    @cached_property
    def middle(self) -> np.ndarray:
        """Deformed position of the centroid of each triangle, shape (m, 3), length."""
        return self.deformed_points[self.triangles].mean(1)

    @cached_property
    def stretches(self) -> np.ndarray:
        """Principal stretches of each triangle in the surface, the larger first, shape (m, 2)."""
        a, b = (x[self.triangles[:, 1:]] - x[self.triangles[:, :1]]
                for x in (self.reference_points, self.deformed_points))
        first = a[:, 0] / np.linalg.norm(a[:, 0], axis=1, keepdims=True)
        second = a[:, 1] - np.einsum("mi,mi->m", a[:, 1], first)[:, None] * first
        second /= np.linalg.norm(second, axis=1, keepdims=True)
        in_plane = np.einsum("mki,mji->mkj", a, np.stack([first, second], 1))
        F = np.einsum("mij,mjk->mki", np.linalg.inv(in_plane), b)
        return np.linalg.svd(F, compute_uv=False)

    @cached_property
    def flat(self) -> bool:
        """True if the surface lies in a plane z = constant in the reference configuration."""
        sides = np.ptp(self.reference_points, axis=0)
        return bool(sides[2] <= 1e-9 * sides.max())

    @property
    def wrinkled(self) -> np.ndarray:
        """Mask of the triangles in compression, in which a membrane wrinkles, shape (m,)."""
        return wrinkled(self.stretches)

    @cached_property
    def at_nodes(self) -> np.ndarray:
        """Wall thickness at the nodes, shape (n,), length.

        It is the mean of the adjacent triangles, weighted with their reference areas.
        """
        return self.to_nodes(self.wall)

    def error_of(self, triangle: int) -> float:
        """Return the estimated error of the wall of a triangle at a minimum of the wall, length.

        A minimum lies in a corner of the mould, where the wall of flat triangles decreases with their size. The
        estimate is the mean wall of the triangles that share a node with this one, minus its own wall. On five trays
        with three meshes each it is 0.5 to 3 times the difference to triangles of a quarter of the size.

        Args:
            triangle: number of the triangle.
        """
        shared = np.asarray(np.isin(self.triangles, self.triangles[triangle]).any(axis=1))
        shared[triangle] = False
        return float(max(self.wall[shared].mean() - self.wall[triangle], 0.0)) if shared.any() else 0.0

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the table that `to_csv` writes, with a row for each triangle: {name: values, shape (m,)}.

        X, Y and x, y, z are the reference and deformed positions of the centroid, length; a surface that is not flat
        in the reference configuration has Z, too. `area` is the deformed area. `wall` is the deformed thickness,
        length; `wall_ratio` is `wall` over the reference thickness. `stretch_1` and `stretch_2` are the larger and the
        smaller principal stretch. `wrinkled` is 1 in compression, else 0. For a sheet of several layers, `wall_of_NAME`
        is the deformed thickness of the layer NAME, length.
        """
        X, x = self.reference_points[self.triangles].mean(1), self.middle
        each = {f"wall_of_{name}": h * self.ratio for name, h in self.layers.items()}
        height = {} if self.flat else {"Z": X[:, 2]}
        return {"X": X[:, 0], "Y": X[:, 1], **height, "x": x[:, 0], "y": x[:, 1], "z": x[:, 2], "area": self.area,
                "wall": self.wall, "wall_ratio": self.ratio, "stretch_1": self.stretches[:, 0],
                "stretch_2": self.stretches[:, 1], "wrinkled": self.wrinkled.astype(float),
                **(each if len(each) > 1 else {})}

    def thickness_at(self, x: float, y: float, z: float | None = None) -> float:
        """Return the wall thickness at the node nearest to a reference position.

        Args:
            x: coordinate X in the reference configuration, length.
            y: coordinate Y in the reference configuration, length.
            z: coordinate Z in the reference configuration, length; left out for a flat sheet.

        Returns:
            Deformed wall thickness, length.

        Raises:
            InputError: a position off the surface, such as in the quarter that is not modelled; no z for a surface that
                is not flat.
        """
        if z is None and not self.flat:
            raise InputError("thickness_at: the surface is not flat in the reference configuration: give x, y and z")
        place = pair("thickness_at", (x, y)) if z is None else triple("thickness_at", (x, y, z))
        X = self.reference_points[:, :len(place)]
        away = np.linalg.norm(X - place, axis=1)
        if away.min() > np.linalg.norm(np.diff(self.reference_points[self.triangles], axis=1), axis=2).max():
            n, ends = len(place), without_round_off([*X.min(0), *X.max(0)], X)
            spans = " and ".join(f"{axis} from {ends[k]:.4g} to {ends[n + k]:.4g}" for k, axis in enumerate("XYZ"[:n]))
            raise InputError(f"thickness_at: {coordinates(place, 6)} is not on the modelled sheet,"
                             f" {spans}")
        return float(self.at_nodes[np.argmin(away)])

    def capacity(self, level: float | None = None) -> float:
        r"""Return the volume that the whole part holds, such as a bottle.

        .. math:: V = \frac{1}{2} \int_{\gamma} (x n_x + y n_y) \, da - \int_{\gamma} h \, da

        The integrals run over the deformed surface below the level, n is its normal and h its wall thickness. Lids
        normal to z close the openings. A blown part touches its mould with its outer face, so the whole wall lies
        inside the surface. Planes of symmetry must be x = 0 or y = 0.

        Args:
            level: coordinate z up to which the part is filled, length; None: to the brim.

        Returns:
            Volume, length^3.

        Raises:
            InputError: a level that the part does not reach.
        """
        points, triangles, owner = self.deformed_points, self.triangles, np.arange(len(self.triangles))
        if level is not None:
            low, high = points[:, 2].min(), points[:, 2].max()
            if not low < finite("capacity: level", level) <= high:
                raise InputError(f"capacity: level = {level!r}: must be a z of the part, from {low:.6g} to {high:.6g}")
            points, triangles, owner = below(points, triangles, level)
        corners = points[triangles]
        area = np.linalg.norm(_normals(corners), axis=1)
        return self.images * (volume_within(points, triangles) - float(self.wall[owner] @ area))

    def unrolled(self, angles: int = 36, levels: int = 40) -> dict[str, np.ndarray]:
        """Return the wall of the modelled part on a grid of angle and height, such as the label side of a bottle.

        Args:
            angles: number of angles about the z axis, from the smallest to the largest angle of the nodes.
            levels: number of heights, from the lowest to the highest node.

        Returns:
            {"angle": shape (angles,), degrees; "z": shape (levels,), length; "wall": shape (levels, angles), length,
            nan where the plane of an angle does not meet the part at a height}. Where it meets the part more than
            once, the outermost wall counts.

        Raises:
            InputError: fewer than two angles or heights.
        """
        if count("unrolled: angles", angles) < 2 or count("unrolled: levels", levels) < 2:
            raise InputError("unrolled: angles and levels: must be at least two each")
        x, z = self.deformed_points, self.deformed_points[:, 2]
        turn = np.degrees(np.arctan2(x[:, 1], x[:, 0]))
        off_axis = np.hypot(x[:, 0], x[:, 1]) > 1e-6 * np.ptp(x, axis=0).max()
        at, heights = np.linspace(turn[off_axis].min(), turn[off_axis].max(), angles), np.linspace(
            z.min(), z.max(), levels + 2)[1:-1]
        found = np.full((levels, angles), np.nan)
        for row, height in enumerate(heights):
            cut = self.section((0, 0, height), (0, 0, 1))
            angle, radius = np.degrees(np.arctan2(cut["y"], cut["x"])), np.hypot(cut["x"], cut["y"])
            for column, value in enumerate(at):
                a, b = (angle[:-1] - value + 180) % 360 - 180, (angle[1:] - value + 180) % 360 - 180
                crossed = np.flatnonzero((a * b <= 0) & (np.abs(a - b) < 90) & (a != b))
                if len(crossed):
                    k = crossed[np.argmax(radius[crossed])]
                    s = a[k] / (a[k] - b[k])
                    found[row, column] = (1 - s) * cut["wall"][k] + s * cut["wall"][k + 1]
        return {"angle": at, "z": heights, "wall": found}

    def plot_unrolled(self, axes: Any = None, angles: int = 73, levels: int = 80) -> Any:
        """Draw the wall of the modelled part over angle and height (`unrolled`), coloured by the wall thickness.

        Args:
            axes: matplotlib axes; default new ones.
            angles: number of angles about the z axis.
            levels: number of heights.

        Returns:
            The matplotlib axes.

        Raises:
            InputError: fewer than two angles or heights.
        """
        found = self.unrolled(angles, levels)
        if axes is None:
            _, axes = figures.figure()
        drawn = axes.pcolormesh(found["angle"], found["z"], found["wall"], cmap="viridis_r", shading="nearest",
                                rasterized=True)
        axes.figure.colorbar(drawn, ax=axes, label="wall")
        axes.set(xlabel="angle, degrees", ylabel="z")
        return axes

    def at(self, points: Any) -> dict[str, np.ndarray]:
        """Return the wall thickness of the modelled part at deformed positions, such as measured ones.

        Each position belongs to the closest point of the surface of triangles. Between the nodes the wall is linear.

        Args:
            points: positions (x, y, z), shape (k, 3), length.

        Returns:
            {"wall", "distance", "X", "Y", "Z"}: wall thickness, distance of the position from the middle surface, and
            reference position of the closest point, shape (k,) each, length.
        """
        places = as_points("at: points", points, 3)
        corners = self.deformed_points[self.triangles]
        found, rows, away = closest_points(places, corners)
        a, b, c = corners[rows].swapaxes(0, 1)
        normal = np.cross(b - a, c - a)
        square = np.einsum("ni,ni->n", normal, normal)
        share, nodes = np.stack([np.einsum("ni,ni->n", np.cross(q - p, found - p), normal) / square
                                 for p, q in ((b, c), (c, a), (a, b))], 1), self.triangles[rows]
        X = np.einsum("nk,nki->ni", share, self.reference_points[nodes])
        return {"wall": np.einsum("nk,nk->n", share, self.at_nodes[nodes]), "distance": away,
                "X": X[:, 0], "Y": X[:, 1], "Z": X[:, 2]}

    def mean_ratio(self, point: tuple[float, float, float], radius: float) -> float:
        """Return the mean ratio of deformed to reference thickness around a point of the part.

        It is the mean of the triangles whose deformed centroid lies within a radius of the point, weighted with their
        reference areas. If there is no such triangle, the ratio of the nearest triangle is returned.

        Args:
            point: position (x, y, z) on the deformed part, length.
            radius: radius about the point, length, positive.

        Returns:
            Deformed over reference thickness.

        Raises:
            InputError: a radius that is not positive, or a point that is farther than the radius and an edge of a
                triangle from the modelled part.
        """
        away = np.linalg.norm(self.middle - triple("mean_ratio: point", point), axis=1)
        near = away <= positive("mean_ratio: radius", radius)
        if not near.any():
            longest = np.linalg.norm(np.diff(self.deformed_points[self.triangles], axis=1), axis=2).max()
            if away.min() > radius + longest:
                raise InputError(f"mean_ratio: the point {tuple(point)} is {away.min():.4g} away from the modelled"
                                 f" part")
            return float(self.ratio[np.argmin(away)])
        return float(np.average(self.ratio[near], weights=self.reference_area[near]))

    def section(self, point: tuple[float, float, float], normal: tuple[float, float, float]) -> dict[str, np.ndarray]:
        """Return the wall thickness along the curve in which a plane cuts the deformed part.

        A cut may consist of several curves. The arc length then continues from one curve to the next.

        Args:
            point: a point (x, y, z) of the plane, length.
            normal: normal of the plane, shape (3,).

        Returns:
            {"arc_length", "x", "y", "z", "wall"}: arc length, deformed positions and wall thickness at the k points of
            the cut, shape (k,) each, length.

        Raises:
            InputError: the plane does not meet the part.
        """
        d = (self.deformed_points - triple("section: point", point)) @ direction("section: normal", normal)
        size = 1e-9 * np.ptp(self.deformed_points, axis=0).max()
        beyond = size if d.min() < -size else -size         # where nodes on the plane count to; it may be a symmetry's
        d = np.where(np.abs(d) < size, beyond, d)
        sides = d[self.triangles] > 0
        crossed = np.flatnonzero(sides.any(1) & ~sides.all(1))
        if not len(crossed):
            raise InputError(f"section: the plane through {point!r} normal to {normal!r} does not meet the part")
        ends: dict[Any, list[Any]] = {}
        for row in self.triangles[crossed].tolist():
            a, b = (tuple(sorted((i, j))) for i, j in ((row[0], row[1]), (row[1], row[2]), (row[2], row[0]))
                    if (d[i] > 0) != (d[j] > 0))
            ends.setdefault(a, []).append(b)
            ends.setdefault(b, []).append(a)
        found, length = [], 0.0
        while ends:
            edge: Any = next((e for e, others in ends.items() if len(others) == 1), next(iter(ends)))
            before = None
            while edge is not None:
                i, j = edge
                s = d[i] / (d[i] - d[j])
                x, h = (v[i] + s * (v[j] - v[i]) for v in (self.deformed_points, self.at_nodes))
                step = np.inf if before is None else float(np.linalg.norm(x - before))
                if step > size:
                    length += 0.0 if before is None else step
                    found.append([length, *x, h])
                    before = x
                after = ends.pop(edge)
                edge = next((e for e in after if e in ends), None)
        return dict(zip(("arc_length", "x", "y", "z", "wall"), np.array(found).T))

    def printed(self, size: float) -> list[np.ndarray]:
        """Return the deformed lines of a square grid that is printed on the surface.

        On a flat sheet the lines are X = i size and Y = j size, with integers i and j. On another surface they are
        R a = i size and Z = j size, with the angle a about the z axis and the largest distance R from it. Each deformed
        line is a polyline with a point at every edge of a triangle that it crosses.

        Args:
            size: edge length of the squares, length.

        Returns:
            Deformed polylines, shape (k, 3) each, length.

        Raises:
            InputError: a size that is not positive, or so small that the grid has more squares than a sheet may have
                triangles.
        """
        size, found = positive("printed: size", size), []
        X, period = self._unrolled()
        sides = np.ptp(X, axis=0)
        if np.prod(sides) > 2 * MAX_RECTANGLES * size * size:
            raise InputError(f"printed: size = {size!r}: would make more than {2 * MAX_RECTANGLES} squares on the"
                             f" sheet, whose sides are {sides[0]:.4g} and {sides[1]:.4g}")
        edges = edges_of(self.triangles)[1]
        for axis in (0, 1):
            a, b = X[edges[:, 0]], X[edges[:, 1]].copy()
            if period:                                       # the ends of an edge lie within half a turn
                b[:, 0] = a[:, 0] + (b[:, 0] - a[:, 0] + period / 2) % period - period / 2
            low, high = X[:, axis].min(), X[:, axis].max()
            for k in range(int(np.ceil(low / size)), int(np.floor(high / size)) + 1):
                at = k * size + 1e-9 * size * (1 if k * size < (low + high) / 2 else -1)
                cut = (a[:, axis] - at) * (b[:, axis] - at) < 0
                s = ((at - a[cut, axis]) / (b[cut, axis] - a[cut, axis]))[:, None]
                order = np.argsort((a[cut] + s * (b[cut] - a[cut]))[:, 1 - axis])
                i, j = edges[cut].T
                line = (self.deformed_points[i] + s * (self.deformed_points[j] - self.deformed_points[i]))[order]
                if len(line) > 1:
                    found.append(line)
        return found

    def _unrolled(self) -> tuple[np.ndarray, float]:
        """Return coordinates (n, 2) of a printed grid, length, and the period of the first, 0 for a flat sheet."""
        X = self.reference_points
        if self.flat:
            return X[:, :2], 0.0
        radius = float(np.hypot(*X[:, :2].T).max())
        return np.column_stack([radius * np.arctan2(X[:, 1], X[:, 0]), X[:, 2]]), 2 * np.pi * radius

    def to_nodes(self, values: np.ndarray) -> np.ndarray:
        """Average values of triangles to nodes, weighted with the reference areas of the adjacent triangles.

        Args:
            values: values of the m triangles, shape (m,).

        Returns:
            Values at the n nodes, shape (n,).
        """
        total, weight = np.zeros(len(self.reference_points)), np.zeros(len(self.reference_points))
        np.add.at(total, self.triangles.ravel(), np.repeat(values * self.reference_area, 3))
        np.add.at(weight, self.triangles.ravel(), np.repeat(self.reference_area, 3))
        return total / weight


def wall_of(path: Any, state: Any) -> SheetWall:
    """Return the wall of a sheet in a state with positions of nodes, in the same order on any ranks; collective."""
    problem = path.problem
    forms, domain, comm = problem.forms, problem.forms.domain, problem.comm
    own = own_cells(domain)
    vectors, numbers = forms.space.sub(0).collapse()
    dofs = np.asarray(numbers, dtype=np.int64).reshape(-1, 3)
    with problem.state_context(state):
        now = forms.length * forms.w.x.array[dofs]
    cells = vectors.dofmap.list[own]
    X = vectors.tabulate_dof_coordinates()
    middles = cell_node_positions(domain, own).mean(1).T
    h = {name: given(*middles) for name, given in problem.scene.thickness.items()}
    order = np.argsort(gathered(comm, domain.topology.original_cell_index[own]))
    rest, moved = (gathered(comm, part)[order].reshape(-1, 3) for part in (X[cells], X[cells] + now[cells]))
    keys = np.round(rest / max(problem.scene.extent), 10)
    _, first, row = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    layers = {name: gathered(comm, values)[order] for name, values in h.items()}
    return SheetWall(rest[first], moved[first], row.reshape(-1, 3), layers, comm, problem.scene.symmetry_factor)


def thinnest_triangle(wall: SheetWall, share: np.ndarray | None = None) -> int:
    """Return the number of the thinnest triangle, of those with a positive share, shape (m,), if given.

    Of mirror images, which round-off tells apart, it is the one with the largest x, then y, then z.
    """
    h = np.where(True if share is None else share > 0, wall.wall, np.inf)
    equal = np.flatnonzero(h <= h.min() * (1 + _EQUAL_WALLS))
    places = np.round(wall.middle[equal] / np.ptp(wall.deformed_points), 6)
    return int(equal[np.lexsort(places.T[::-1])[-1]])


def nearest_triangles(wall: SheetWall, position: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the node nearest to a reference position, (3,), length, and the mask of its triangles, shape (m,)."""
    node = int(np.argmin(np.linalg.norm(wall.reference_points - position, axis=1)))
    return node, (wall.triangles == node).any(1)


def _normals(corners: np.ndarray) -> np.ndarray:
    """Return the area vectors of m triangles, shape (m, 3), length^2, for their corners, shape (m, 3, 3)."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
