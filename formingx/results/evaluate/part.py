"""The formed part in numbers: volume, weight, area, minimum wall, uniformity."""

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
    """A whole part, also where a half is modelled, to its rim or its trim; in plane strain per unit depth.

    Attributes:
        volume: between the two faces, length^3 (a rim that bulges is left out).
        area: of the middle surface, length^2.
        draw_ratio: area over the area that it had in the reference configuration (areal draw ratio).
        mean_wall: volume over area, length.
        min_wall: minimum wall, length.
        min_wall_radius: reference radius there, length.
        min_wall_at: (r, z) of the middle line there, length.
        min_wall_height: height there (as in `Wall`), length.
        min_wall_reference: ("R", reference radius), for a parison ("Z", reference height of its inner face).
        uniformity: minimum wall over mean wall, 1 for an even part.
        variation: standard deviation of the wall over the middle surface, over its mean: coefficient of variation.
        weight: grams if a density in g/cm3 was given, else None; of the material before thermal expansion, so that it
            does not change with the temperature.
        walls: {height: wall there}, lengths.
        capacity: volume within the inner face, between planes across its ends, length^3: the whole of a closed bottle;
            of a pot to its rim, or to the trim.
        scrap: volume beyond the trim over the volume of the whole sheet.
        basis: basis of volume, area, weight and capacity, as text: the whole part of which a half was modelled, a unit
            of depth; "" for an axisymmetric part.
        units: of the labels.
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
        """(what, its value with its unit), for people."""
        along, rest = self.min_wall_reference
        where = (f"height {self._length(self.min_wall_height)}, r = {self._length(self.min_wall_at[0])}, from {along} ="
                 f" {self._length(rest)}")
        return self._rows(where, [("capacity", self._said(self.capacity, self.units.volume)), *(
            (f"wall at height {self._length(h)}", self._length(w)) for h, w in self.walls.items())])


def part(wall: Wall, axisymmetric: bool, density: float | None = None, trim: float | tuple[str, float] | None = None,
         heights: Sequence[float] = (), units: Units = NONE, planes: MirrorPlanes = NO_PLANES) -> Part:
    """Return the part in numbers, see `Path.part`; planes: symmetry planes that cut the body."""
    profile, images = wall.profile, planes.factor
    basis = planes.basis(None if axisymmetric else units.length or "unit")
    units = units if axisymmetric else units.per_depth()
    strips = _strips(fine(profile.bottom), fine(profile.top), axisymmetric)
    middle = _surface(fine(profile.middle), axisymmetric)
    rest = _surface(fine((profile.rest_bottom + profile.rest_top) / 2), axisymmetric)
    at_rest = _strips(fine(profile.rest_bottom), fine(profile.rest_top), axisymmetric)
    inside = strips_within(wall, trim)
    volume, area, *before = (_sums(v, len(wall.r)) for v in (strips, middle, rest, at_rest))
    kept = [float((v * inside).sum()) for v in (volume, area, *before)]
    reached = np.append(inside > 0, False) | np.append(False, inside == 1)
    reached[0] = True
    k = int(np.argmin(np.where(reached, wall.wall, np.inf)))
    along = int(np.argmax(np.ptp(profile.rest_bottom, axis=0)))
    mean = kept[0] / kept[1]
    of_strip = (wall.wall[1:] + wall.wall[:-1]) / 2
    average = (of_strip * area * inside).sum() / kept[1]
    spread = ((of_strip - average) ** 2 * area * inside).sum() / kept[1]
    weight = None if density is None else units.mass(images * kept[3], positive("part: density", density))
    at = {finite("part: heights", h): wall.at_height(h) for h in several("part: heights", heights, "numbers")}
    return Part(images * kept[0], images * kept[1], kept[1] / kept[2], mean, float(wall.wall[k]),
                float(wall.reference_radius[k]),
                without_round_off((wall.r[k], wall.z[k]), profile.middle), float(wall.height[k]),
                ("RZ"[along], float(profile.rest_bottom[k, along])), float(wall.wall[k] / mean),
                float(np.sqrt(spread) / average), weight, at, float(1 - kept[0] / volume.sum()),
                images * _content(wall, inside, axisymmetric), basis, units)


def strips_within(wall: Wall, trim: float | tuple[str, float] | None) -> np.ndarray:
    """Return the share of each of the n - 1 strips between nodes that belongs to the part, 0 to 1."""
    inside = np.ones(len(wall.r) - 1)
    if trim is None:
        return inside
    along, value = trim if isinstance(trim, tuple) and len(trim) == 2 else ("r", trim)
    known("part: trim along", along, ("r", "height"))
    value, line = finite("part: trim", value), wall.r if along == "r" else wall.height
    crossed = np.flatnonzero((line[:-1] < value) & (line[1:] >= value))
    if not len(crossed):
        low, high = without_round_off((line.min(), line.max()), line)
        raise InputError(f"part: trim = {trim!r}: the part goes from {low:.6g} to {high:.6g} along {along}")
    k = crossed[-1]
    inside[k], inside[k + 1:] = (value - line[k]) / (line[k + 1] - line[k]), 0.0
    return inside


def _content(wall: Wall, inside: np.ndarray, axisymmetric: bool) -> float:
    """Return the volume within the inner one of the two faces, as far as strips between nodes belong to the part."""
    found = []
    for face in (wall.profile.bottom, wall.profile.top):
        slices = _sums(_up_to(fine(face)[:-1], fine(face)[1:], axisymmetric), len(wall.r)) * inside
        least = 1e-12 * np.abs(face).max() ** (2 + axisymmetric)           # below it is round-off
        found.append(abs(float(slices.sum())) if abs(slices.sum()) > least else 0.0)
    return min(found)


def _strips(bottom: np.ndarray, top: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Volumes between successive pairs of points of two lines, shape (m - 1,): of polygons, turned about the axis."""
    corners = [bottom[:-1], bottom[1:], top[1:], top[:-1]]
    total = np.zeros(len(bottom) - 1)
    for a, b in zip(corners, corners[1:] + corners[:1]):
        total += _up_to(a, b, axisymmetric)
    return np.abs(total)


def _up_to(a: np.ndarray, b: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Volumes between the axis and lines from a to b, shape (n, 2), going up, shape (n,)."""
    (r, z), (s, w) = a.T, b.T
    return np.pi / 3 * (r * r + r * s + s * s) * (w - z) if axisymmetric else (r + s) / 2 * (w - z)


def _surface(line: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Areas that the straight pieces of a line sweep about the axis (lengths in plane strain), shape (m - 1,)."""
    length = np.hypot(*np.diff(line, axis=0).T)
    return np.pi * (line[1:, 0] + line[:-1, 0]) * length if axisymmetric else length


def _sums(fine_values: np.ndarray, nodes: int) -> np.ndarray:
    """Return the sums of values over each piece between two of n nodes, on equal parts of it, shape (n - 1,)."""
    return fine_values.reshape(nodes - 1, -1).sum(1)
