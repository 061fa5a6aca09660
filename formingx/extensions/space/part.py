"""Numbers of a formed part in three dimensions, and the filling of a tool by the sheet."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...errors import InputError, finite, positive
from ...findings import coordinates
from ...results.files.column_table import ColumnTable
from ...results.numbers import PartNumbers
from ...scene.symmetry import MirrorPlanes
from ...units import NONE, Units
from .sheet import chords, outline_edges
from .union import Union
from .wall import SheetWall, thinnest_triangle


@dataclass(frozen=True, repr=False)
class SheetPart(PartNumbers):
    """Numbers of a whole formed part in three dimensions, also if only a half or a quarter of it is modelled.

    Attributes:
        volume: volume, length^3.
        area: deformed area of the surface, length^2.
        draw_ratio: deformed over reference area.
        mean_wall: mean wall thickness, volume over area, length.
        min_wall: minimum wall thickness, length.
        min_wall_at: deformed position (x, y, z) of the minimum wall, length.
        min_wall_reference: reference position of the minimum wall, (X, Y) on a flat sheet, else (X, Y, Z), length.
        min_wall_error: estimated error of the minimum wall, length: the true minimum is smaller by about as much
            (`SheetWall.error_of`).
        uniformity: minimum over mean wall thickness.
        variation: standard deviation of the wall thickness over the surface, over its mean.
        weight: weight in grams if a density in g/cm3 was given; else None.
        capacity: volume that the part holds, length^3, up to its brim (`SheetWall.capacity`), above the plane of
            `trim`; None for a flat sheet.
        scrap: volume that is trimmed off over the volume of the sheet.
        wrinkled: share of the reference area that is in compression.
        basis: text that states from which modelled part volume, area and weight were computed, such as a quarter; ""
            if the whole part was modelled.
        units: units of the labels in `rows`.
    """

    volume: float
    area: float
    draw_ratio: float
    mean_wall: float
    min_wall: float
    min_wall_at: tuple[float, ...]
    min_wall_reference: tuple[float, ...]
    uniformity: float
    variation: float
    weight: float | None
    scrap: float
    wrinkled: float
    basis: str = ""
    units: Units = field(repr=False, default=NONE)
    capacity: float | None = None
    min_wall_error: float = 0.0

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Rows of a table of the formed part, (label, value with its unit), both as text."""
        deformed, reference = map(coordinates, (self.min_wall_at, self.min_wall_reference))
        axes = "(X, Y)" if len(self.min_wall_reference) == 2 else "(X, Y, Z)"
        holds = [] if self.capacity is None else [
            ("capacity", self._with_unit(self.capacity, self.units.volume))]
        return self._rows(f"(x, y, z) = {deformed}, from {axes} = {reference}, too large by"
                          f" about {self._length(self.min_wall_error)}", []) + holds + (
            [("in compression, of the sheet", f"{100 * self.wrinkled:.3g} %")] if self.wrinkled else [])


def part(wall: SheetWall, density: float | None, trim: Any, heights: Any, units: Units,
         planes: MirrorPlanes) -> SheetPart:
    """Return the numbers of the whole formed part, from the wall of the sheet in a state and its mirror planes.

    trim: z of a plane, length, whose side away from the flat sheet (upper side of another surface) is the part, or an
    outline around it. heights must be empty (`SheetWall.section` gives cuts). density: g/cm3. Raise `InputError` for
    heights, a trim that does not meet the part, or a density that is not positive.
    """
    if len(tuple(heights)):
        raise InputError("part: heights: in three dimensions use path.wall().section(point, normal)")
    share = np.ones(len(wall.wall)) if trim is None else _trimmed_share(wall, trim)
    kept = share > 0
    h, area, rest = wall.wall[kept], (wall.area * share)[kept], (wall.reference_area * share)[kept]
    volume, images = float((h * area).sum()), planes.factor
    mean, k = volume / area.sum(), thinnest_triangle(wall, share)
    whole = float((wall.wall * wall.area).sum())
    weight = None if density is None else units.mass(images * volume, positive("part: density", density))
    return SheetPart(images * volume, images * float(area.sum()), float(area.sum() / rest.sum()), mean,
                     float(wall.wall[k]), tuple(wall.middle[k].tolist()),
                     tuple(wall.reference_points[wall.triangles[k], :2 if wall.flat else 3].mean(0).tolist()),
                     float(wall.wall[k] / mean),
                     float(np.sqrt(np.average((h - mean) ** 2, weights=area)) / mean),
                     weight, 1 - volume / whole, float(rest[wall.wrinkled[kept]].sum() / rest.sum()),
                     planes.basis(None), units, _capacity(wall, trim), wall.error_of(k))


def _capacity(wall: SheetWall, trim: Any) -> float | None:
    """Return the volume that a part holds, above the plane `trim` if that is a number, length^3; None if it is flat."""
    if wall.flat:
        return None
    return wall.capacity() - (wall.capacity(float(trim)) if isinstance(trim, int | float) else 0.0)


def _trimmed_share(wall: SheetWall, trim: Any) -> np.ndarray:
    """Return the remaining share of each triangle, (m,), by z of a plane or an outline (x, y), else an InputError."""
    points = wall.deformed_points
    if not isinstance(trim, list | tuple | np.ndarray):
        level, z = finite("part: trim", trim), points[:, 2]
        if not z.min() < level < z.max():
            raise InputError(f"part: trim = {trim!r}: must be a z that the part passes: it goes from {z.min():.6g} to"
                             f" {z.max():.6g}; or an outline, such as fx.mesh.rectangle(...)")
        side = np.sign(z[np.argmax(np.abs(z))] - level) if wall.flat else 1.0
        return _positive_share((z - level)[wall.triangles] * side)
    corners = chords(outline_edges(trim, "part: trim"), "part: trim")
    inside = _depth_in_polygon(points[:, :2], corners)
    if inside.max() <= 0:
        (x_min, y_min), (x_max, y_max) = corners.min(0), corners.max(0)
        raise InputError(f"part: trim: the outline, with x from {x_min:.6g} to {x_max:.6g} and y from {y_min:.6g} to"
                         f" {y_max:.6g}, does not contain any node of the part")
    return _positive_share(inside[wall.triangles])


def _depth_in_polygon(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return distances (n,) of points (n, 2) from a polygon of corners (k, 2), positive inside, length."""
    inside, nearest = np.zeros(len(points), dtype=bool), np.full(len(points), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        off, way = points - a, b - a
        along = np.clip(off @ way / (way @ way), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(off - along[:, None] * way, axis=1))
        crossed = (a[1] > points[:, 1]) != (b[1] > points[:, 1])          # a ray along x, of odd number from inside
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crossed & (off[:, 0] < way[0] * off[:, 1] / way[1])
    return np.where(inside, nearest, -nearest)


def _positive_share(d: np.ndarray) -> np.ndarray:
    """Return the share of each of m triangles on which a linear field, shape (m, 3), is positive, shape (m,)."""
    alone = np.argmax((d > 0) == ((d > 0).sum(1) == 1)[:, None], axis=1)       # the corner that is on its own side
    a, b, c = (np.take_along_axis(d, (alone[:, None] + k) % 3, 1)[:, 0] for k in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        tip = a * a / ((a - b) * (a - c))
    return np.where((d > 0).all(1), 1.0, np.where((d <= 0).all(1), 0.0, np.where(a > 0, tip, 1 - tip)))


@dataclass(frozen=True, repr=False)
class SheetFilling(ColumnTable):
    """Filling of a tool by a sheet in each of the n states of a run.

    Attributes:
        control: name of the first column of the run, such as "pressure", and its value in each state, shape (n,).
        touching: share of the reference area that is in contact, or nearer to the tool than a tenth of the thickness,
            in each state, shape (n,).
        gap: largest distance of the sheet from the tool in each state, shape (n,), length.
        comm: MPI communicator of the run.
        parts: for each part of a `fx.tools.union` its name, with two arrays: the share of the reference area that
            touches this part, shape (n,); the force of the modelled sheet on it, shape (n, 3), stress length^2.
    """

    control: tuple[str, np.ndarray]
    touching: np.ndarray
    gap: np.ndarray
    comm: Any
    parts: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the table, with a row for each state: {name: values, shape (n,)}.

        They are the first column of the run, such as "pressure", then "touching" and "gap", the attributes. Of a part
        "rib" of a union there are "touching_rib", and the force on it along z, "rib_force".
        """
        found = {self.control[0]: self.control[1], "touching": self.touching, "gap": self.gap}
        for name, (touching, force) in self.parts.items():
            found |= {f"touching_{name}": touching, f"{name}_force": force[:, 2]}
        return found


def filling(path: Any, contact: Any, states: Any = None) -> SheetFilling:
    """Return in states (None: all) the share of a sheet that touches a tool, and its largest gap; collective."""
    rows, comm, states = [], path.problem.comm, path.states if states is None else states
    tool = contact.contact.tool
    names = tool.names if isinstance(tool, Union) else []
    for state in states:
        with path.problem.state_context(state) as problem:
            fields = problem.x.array_r
            x = contact.positions(fields, state.control)
            d = tool.signed_distance(x)
            closed = contact.touching(fields, state.control) | (d > -0.1 * contact.thickness)
            forces = contact.forces(fields, state.control)
        area = contact.rule.area
        nearest = tool.nearest_parts(x) if names else np.zeros(len(x), dtype=int)
        shares = [np.append(area[closed & (nearest == k)].sum(), forces[nearest == k].sum(0))
                  for k in range(len(names))]
        parts = comm.allgather((np.array([area[closed].sum(), area.sum(), *np.ravel(shares)]),
                                float((-d).max(initial=0.0))))
        total = np.sum([sums for sums, _ in parts], axis=0)
        each = total[2:].reshape(-1, 4) / [total[1], 1.0, 1.0, 1.0]
        rows.append([total[0] / total[1], max(gap for _, gap in parts), *each.ravel()])
    table = np.array(rows)
    each = table[:, 2:].reshape(len(table), -1, 4)
    name = path.columns[0]
    control = np.array([state.measures[name] for state in states])
    return SheetFilling((name, control), table[:, 0], table[:, 1], comm,
                        {part: (each[:, k, 0], each[:, k, 1:]) for k, part in enumerate(names)})
