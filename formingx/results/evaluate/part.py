"""Key numbers of the formed part: volume, weight, area, minimum wall, uniformity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...errors import InputError, finite, known, positive, several
from ...scene.symmetry import NO_PLANES, MirrorPlanes
from ...units import NONE, Units
from ..numbers import PartNumbers, without_round_off
from .profile import fine
from .wall import Wall


@dataclass(frozen=True, repr=False)
class Part(PartNumbers):
    """Whole part to its rim or its trim, also if a half is modelled; in plane strain per unit depth.

    Attributes:
        volume: volume between the two faces without a bulging rim, length^3.
        area: area of the middle surface, length^2.
        draw_ratio: area over the reference area of the same material (areal draw ratio).
        mean_wall: volume over area, length.
        min_wall: minimum wall, length.
        min_wall_radius: reference radius of the minimum wall, length.
        min_wall_at: its place (r, z) on the middle line, length.
        min_wall_height: its height (as in `Wall`), length.
        min_wall_reference: its reference position: ("R", radius), for a parison ("Z", height on the inner face).
        uniformity: minimum wall over mean wall, 1 for a uniform part.
        variation: coefficient of variation of the wall over the middle surface: standard deviation over mean.
        weight: weight in grams, or None without a density. It uses the volume before thermal expansion, so it does not
            change with the temperature.
        walls: {height: wall at this height}, length.
        scrap: volume beyond the trim over the volume of the whole sheet.
        capacity: volume inside the inner face, up to planes across its ends, length^3. A closed bottle counts whole, a
            pot up to its rim or trim.
        basis: basis of volume, area, weight and capacity as text, such as a unit of depth. It also tells if only a half
            was modelled; "" for an axisymmetric part.
        units: units of the printed values.
    """

    volume: float
    area: float
    draw_ratio: float
    mean_wall: float
    min_wall: float
    min_wall_radius: float
    min_wall_at: tuple[float, ...]
    min_wall_height: float
    min_wall_reference: tuple[str, float]
    uniformity: float
    variation: float
    weight: float | None
    walls: dict[float, float]
    scrap: float
    capacity: float
    basis: str = ""
    units: Units = field(repr=False, default=NONE)

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Rows of the printed table: pairs (name, value with its unit)."""
        axis, reference = self.min_wall_reference
        where = (f"height {self._length(self.min_wall_height)}, r = {self._length(self.min_wall_at[0])}, from {axis} ="
                 f" {self._length(reference)}")
        return self._rows(where, [("capacity", self._with_unit(self.capacity, self.units.volume)), *(
            (f"wall at height {self._length(h)}", self._length(w)) for h, w in self.walls.items())])


def part(wall: Wall, axisymmetric: bool, density: float | None = None, trim: float | tuple[str, float] | None = None,
         heights: Sequence[float] = (), units: Units = NONE, planes: MirrorPlanes = NO_PLANES) -> Part:
    """Return the key numbers of a part (`Path.part`).

    Args:
        wall: the wall in a state.
        axisymmetric: False in plane strain.
        density: density, g/cm3.
        trim: radius, or ("height", h), at which the part is cut off, length.
        heights: heights at which the wall is given, too, length.
        units: units of the script.
        planes: symmetry planes that cut the body.

    Raises:
        InputError: the part does not reach the trim or a height.
    """
    profile, images = wall.profile, planes.factor
    basis = planes.basis(None if axisymmetric else units.length or "unit")
    units = units if axisymmetric else units.per_depth()
    strips = _strips(fine(profile.bottom), fine(profile.top), axisymmetric)
    middle = _surface(fine(profile.middle), axisymmetric)
    reference = _surface(fine((profile.reference_bottom + profile.reference_top) / 2), axisymmetric)
    reference_strips = _strips(fine(profile.reference_bottom), fine(profile.reference_top), axisymmetric)
    inside = strips_within(wall, trim)
    volume, area, *before = (_sums(v, len(wall.r)) for v in (strips, middle, reference, reference_strips))
    sums = [float((v * inside).sum()) for v in (volume, area, *before)]
    reached = np.append(inside > 0, False) | np.append(False, inside == 1)
    reached[0] = True
    k = int(np.argmin(np.where(reached, wall.wall, np.inf)))
    coordinate = int(np.argmax(np.ptp(profile.reference_bottom, axis=0)))
    mean = sums[0] / sums[1]
    of_strip = (wall.wall[1:] + wall.wall[:-1]) / 2
    average = (of_strip * area * inside).sum() / sums[1]
    spread = ((of_strip - average) ** 2 * area * inside).sum() / sums[1]
    weight = None if density is None else units.mass(images * sums[3], positive("part: density", density))
    walls_at = {finite("part: heights", h): wall.at_height(h) for h in several("part: heights", heights, "numbers")}
    return Part(images * sums[0], images * sums[1], sums[1] / sums[2], mean, float(wall.wall[k]),
                float(wall.reference_radius[k]),
                without_round_off((wall.r[k], wall.z[k]), profile.middle), float(wall.height[k]),
                ("RZ"[coordinate], float(profile.reference_bottom[k, coordinate])), float(wall.wall[k] / mean),
                float(np.sqrt(spread) / average), weight, walls_at, float(1 - sums[0] / volume.sum()),
                images * _capacity(wall, inside, axisymmetric), basis, units)


def strips_within(wall: Wall, trim: float | tuple[str, float] | None) -> np.ndarray:
    """Return the fraction of each strip between nodes that belongs to the part, 0 to 1, shape (n - 1,).

    Args:
        wall: the wall at n nodes.
        trim: radius, or ("height", h), at which the part is cut off, length.

    Raises:
        InputError: the part does not reach the trim.
    """
    inside = np.ones(len(wall.r) - 1)
    if trim is None:
        return inside
    coordinate, value = trim if isinstance(trim, tuple) and len(trim) == 2 else ("r", trim)
    known("part: trim along", coordinate, ("r", "height"))
    value, line = finite("part: trim", value), wall.r if coordinate == "r" else wall.height
    crossed = np.flatnonzero((line[:-1] < value) & (line[1:] >= value))
    if not len(crossed):
        low, high = without_round_off((line.min(), line.max()), line)
        raise InputError(f"part: trim = {trim!r}: the part goes from {low:.6g} to {high:.6g} along {coordinate}")
    k = crossed[-1]
    inside[k], inside[k + 1:] = (value - line[k]) / (line[k + 1] - line[k]), 0.0
    return inside


def _capacity(wall: Wall, inside: np.ndarray, axisymmetric: bool) -> float:
    """Return the volume inside the inner face, over the strips between nodes that belong to the part, length^3."""
    found = []
    for face in (wall.profile.bottom, wall.profile.top):
        slices = _sums(_up_to(fine(face)[:-1], fine(face)[1:], axisymmetric), len(wall.r)) * inside
        tolerance = 1e-12 * np.abs(face).max() ** (2 + axisymmetric)           # below it is round-off
        found.append(abs(float(slices.sum())) if abs(slices.sum()) > tolerance else 0.0)
    return min(found)


def _strips(bottom: np.ndarray, top: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Return the volumes between two lines, from each pair of points to the next, shape (m - 1,), length^3."""
    corners = [bottom[:-1], bottom[1:], top[1:], top[:-1]]
    total = np.zeros(len(bottom) - 1)
    for a, b in zip(corners, corners[1:] + corners[:1]):
        total += _up_to(a, b, axisymmetric)
    return np.abs(total)


def _up_to(a: np.ndarray, b: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Return the volumes between the axis and lines from a to b, shape (n, 2); positive if b is above a, shape (n,)."""
    (r, z), (s, w) = a.T, b.T
    return np.pi / 3 * (r * r + r * s + s * s) * (w - z) if axisymmetric else (r + s) / 2 * (w - z)


def _surface(line: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Return the areas swept by the pieces of a line about the axis (plane strain: their lengths), shape (m - 1,)."""
    length = np.hypot(*np.diff(line, axis=0).T)
    return np.pi * (line[1:, 0] + line[:-1, 0]) * length if axisymmetric else length


def _sums(fine_values: np.ndarray, nodes: int) -> np.ndarray:
    """Return sums of finely spaced values over each piece between two of n nodes, shape (n - 1,)."""
    return fine_values.reshape(nodes - 1, -1).sum(1)
