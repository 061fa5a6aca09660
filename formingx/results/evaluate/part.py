"""Key numbers of the formed part: volume, weight, area, minimum wall, uniformity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import InputError, as_list, check_name, finite, positive
from ...mesh.nodes import without_round_off
from ...scene.symmetry import NO_PLANES, MirrorPlanes
from ...units import NONE, Units
from ..numbers import PartNumbers
from .profile import refined
from .wall import Wall

_THICKEST = 0.5
"""Mean thickness over the length of a section above which the body is a block without a wall."""


@dataclass(frozen=True, repr=False)
class Part(PartNumbers):
    """Key numbers of the whole part up to its rim or its trim, also if a half is modelled.

    In plane strain, volume, area, weight and capacity are per unit depth.

    Attributes:
        volume: volume between the two faces and the ends of the section, which may bulge, length^3.
        area: area of the middle surface, length^2.
        draw_ratio: area over the reference area of the same material (areal draw ratio).
        mean_wall: volume over area, length.
        min_wall: minimum wall, length.
        min_wall_radius: reference radius R of the place of the minimum wall, length.
        min_wall_at: deformed position (r, z) of this place on the middle line, length.
        min_wall_height: axial distance of this place from the pole (`Wall.height`), length.
        min_wall_reference: reference position of this place on the bottom face: ("R", radius), and for a parison, on
            the inner face, ("Z", height).
        uniformity: minimum wall over mean wall, 1 for a uniform part.
            The walls, `uniformity` and `variation` are nan for a body thicker than half its length, which is no sheet.
        variation: coefficient of variation of the wall over the middle surface: standard deviation over mean value.
        weight: weight in grams, or None without a density. It uses the volume before thermal expansion, so it does not
            change with the temperature.
        walls: {axial distance from the pole (`Wall.height`): wall there}, both length.
        scrap: fraction of the undeformed volume, and so of the weight, of the whole sheet that lies beyond the trim.
        capacity: volume that the part holds, length^3: it lies inside the inner face, up to planes across the ends of
            this face. For a pot, such a plane lies at its rim or trim.
        basis: reference of volume, area, weight and capacity as text, such as "the part, per mm of depth"; "" for an
            axisymmetric part that is modelled whole.
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

    The density is in g/cm3, trim radius or ("height", h) and heights are lengths, and `planes` are symmetry planes of a
    modelled half or quarter. A trim or height out of reach is an InputError.
    """
    profile, images = wall.profile, planes.factor
    basis = planes.basis(None if axisymmetric else units.length or "unit")
    units = units if axisymmetric else units.per_depth()
    strips = _strips(refined(profile.bottom), refined(profile.top), axisymmetric, profile.start, profile.end)
    middle = _surface(refined(profile.middle), axisymmetric)
    reference = _surface(refined((profile.reference_bottom + profile.reference_top) / 2), axisymmetric)
    reference_strips = _strips(refined(profile.reference_bottom), refined(profile.reference_top), axisymmetric)
    inside = strips_within(wall, trim)
    volume, area, *before = (_sums(v, len(wall.r)) for v in (strips, middle, reference, reference_strips))
    sums = [float((v * inside).sum()) for v in (volume, area, *before)]
    reached = np.append(inside > 0, False) | np.append(False, inside == 1)
    reached[0] = True
    k = int(np.argmin(np.where(reached, wall.wall, np.inf)))
    coordinate = int(np.argmax(np.ptp(profile.reference_bottom, axis=0)))
    mean = sums[0] / sums[1]
    of_strip = (wall.wall[1:] + wall.wall[:-1]) / 2
    if profile.original_thickness.mean() > _THICKEST * profile.reference_length[-1]:      # a block has no wall
        mean, of_strip, wall = np.nan, of_strip * np.nan, replace(wall)
        vars(wall)["wall"] = np.full(len(wall.r), np.nan)
    average = (of_strip * area * inside).sum() / sums[1]
    spread = ((of_strip - average) ** 2 * area * inside).sum() / sums[1]
    weight = None if density is None else units.mass(images * sums[3], positive("part: density", density))
    walls_at = {finite("part: heights", h): wall.at_height(h) for h in as_list("part: heights", heights, "numbers")}
    return Part(images * sums[0], images * sums[1], sums[1] / sums[2], mean, float(wall.wall[k]),
                float(wall.reference_radius[k]),
                without_round_off((wall.r[k], wall.z[k]), profile.middle), float(wall.height[k]),
                ("RZ"[coordinate], float(profile.reference_bottom[k, coordinate])), float(wall.wall[k] / mean),
                float(np.sqrt(spread) / average), weight, walls_at, float(1 - sums[3] / before[1].sum()),
                images * _capacity(wall, inside, axisymmetric), basis, units)


def strips_within(wall: Wall, trim: float | tuple[str, float] | None) -> np.ndarray:
    """Return the fraction, 0 to 1, of each strip of the wall that belongs to the trimmed part, shape (n - 1,).

    The middle line is cut where it passes the trim, r or ("height", h), for the last time, else an InputError.
    """
    inside = np.ones(len(wall.r) - 1)
    if trim is None:
        return inside
    coordinate, value = trim if isinstance(trim, tuple) and len(trim) == 2 else ("r", trim)
    check_name("part: trim along", coordinate, ("r", "height"))
    value, line = finite("part: trim", value), wall.r if coordinate == "r" else wall.height
    crossed = np.flatnonzero((line[:-1] < value) & (line[1:] >= value))
    if not len(crossed):
        low, high = without_round_off((line.min(), line.max()), line)
        raise InputError(f"part: trim = {trim!r}: the part goes from {low:.6g} to {high:.6g} along {coordinate}")
    k = crossed[-1]
    inside[k], inside[k + 1:] = (value - line[k]) / (line[k + 1] - line[k]), 0.0
    return inside


def _capacity(wall: Wall, inside: np.ndarray, axisymmetric: bool) -> float:
    """Return the volume in the inner face, length^3 (plane strain: length^2); inside: share of strips (n - 1,)."""
    found = []
    for face in (wall.profile.bottom, wall.profile.top):
        slices = _sums(_up_to(refined(face)[:-1], refined(face)[1:], axisymmetric), len(wall.r)) * inside
        tolerance = 1e-12 * np.abs(face).max() ** (2 + axisymmetric)           # below it is round-off
        found.append(abs(float(slices.sum())) if abs(slices.sum()) > tolerance else 0.0)
    return min(found)


def _strips(bottom: np.ndarray, top: np.ndarray, axisymmetric: bool, start: np.ndarray | None = None,
            end: np.ndarray | None = None) -> np.ndarray:
    """Return the volumes of the m - 1 strips between two lines, length^3; in plane strain per unit depth, length^2.

    Lines: (m, 2), length. First and last strip extend to lines `start` and `end`, (k, 2); None is straight.
    """
    corners = [bottom[:-1], bottom[1:], top[1:], top[:-1]]
    total = np.zeros(len(bottom) - 1)
    for a, b in zip(corners, corners[1:] + corners[:1]):
        total += _up_to(a, b, axisymmetric)
    sense = np.sign(total.sum())
    for edge, strip, sign in ((start, 0, -1), (end, -1, 1)):
        if edge is not None:
            line = refined(edge)
            bulge = _up_to(line[:-1], line[1:], axisymmetric).sum() - _up_to(line[:1], line[-1:], axisymmetric)[0]
            total[strip] += sign * bulge
    return sense * total if sense else np.abs(total)


def _up_to(a: np.ndarray, b: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Return volumes of cones swept by lines from a to b, (n, 2) each, (n,), length^3; areas in plane strain."""
    (r, z), (s, w) = a.T, b.T
    return np.pi / 3 * (r * r + r * s + s * s) * (w - z) if axisymmetric else (r + s) / 2 * (w - z)


def _surface(line: np.ndarray, axisymmetric: bool) -> np.ndarray:
    """Return areas swept by pieces of a polyline (m, 2), shape (m - 1,), length^2; lengths in plane strain."""
    length = np.hypot(*np.diff(line, axis=0).T)
    return np.pi * (line[1:, 0] + line[:-1, 0]) * length if axisymmetric else length


def _sums(fine_values: np.ndarray, nodes: int) -> np.ndarray:
    """Return sums (nodes - 1,) of equally many values (k,) on the pieces between nodes."""
    return fine_values.reshape(nodes - 1, -1).sum(1)
