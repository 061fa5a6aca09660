"""Outline and thickness of a sheet in a state, from the axis to the rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, finite, finite_array
from ...forms.probes import Probe, probe
from ...mesh.nodes import SAME_PLACE
from ...mesh.sizes import length_along
from ...scene.symmetry import MirrorPlane, MirrorPlanes
from ...values.tolerances import PIECE_POINTS

FACES = (("bottom", "top"), ("inner", "outer"))
"""Names of the boundaries that are the two faces of a sheet, or of the wall of a parison."""


_EDGE_POINTS = (PIECE_POINTS + 1) // 2
"""Number of points on the edge of a section through the wall, enough for eight curved edges of elements."""


@dataclass(frozen=True)
class Profile:
    """Outline of a sheet in one state: n pairs of opposite points on its two faces, from the axis to the rim.

    The bottom points are the nodes of the bottom face. A top point lies where the reference normal of the bottom face
    meets the top face. For the wall of a parison or a sphere, the bottom is the inner face and the top the outer face.

    Attributes:
        reference_bottom: reference positions (R, Z) of the bottom points, shape (n, 2), length.
        reference_top: reference positions (R, Z) of the top points, shape (n, 2), length.
        bottom: deformed positions (r, z) of the bottom points, shape (n, 2), length.
        top: deformed positions (r, z) of the top points, shape (n, 2), length.
        start: deformed positions of points through the wall at the first pair, from bottom to top, at equal distances
            along the reference edge, shape (17, 2), length. None in checkpoints of earlier versions.
        end: the same at the last pair, the rim.

    >>> wall = path.profile().thickness                                                   # from the pole to the rim
    >>> [round(float(h), 3) for h in (wall[0], wall[-1])]
    [0.059, 0.218]
    """

    reference_bottom: np.ndarray
    reference_top: np.ndarray
    bottom: np.ndarray
    top: np.ndarray
    start: np.ndarray | None = None
    end: np.ndarray | None = None

    @property
    def reference_radius(self) -> np.ndarray:
        """Reference radius R of the bottom points, shape (n,), length."""
        return self.reference_bottom[:, 0]

    @property
    def reference_length(self) -> np.ndarray:
        """Arc length from the axis along the reference middle line to each point, shape (n,), length.

        It is R for a flat sheet.
        """
        return length_along((self.reference_bottom + self.reference_top) / 2)

    @property
    def original_thickness(self) -> np.ndarray:
        """Distance between bottom and top point in the reference configuration, shape (n,), length."""
        return np.hypot(*(self.reference_top - self.reference_bottom).T)

    @property
    def thickness(self) -> np.ndarray:
        """Distance between bottom and top point in the deformed sheet, shape (n,), length.

        In a sheared sheet it exceeds the wall thickness.
        """
        return np.hypot(*(self.top - self.bottom).T)

    @property
    def thickness_ratio(self) -> np.ndarray:
        """Deformed over reference distance between bottom and top point, shape (n,)."""
        return self.thickness / self.original_thickness

    @property
    def wall_ratio(self) -> np.ndarray:
        """`wall_thickness` over `original_thickness`, shape (n,)."""
        return self.wall_thickness / self.original_thickness

    @property
    def wall_thickness(self) -> np.ndarray:
        """Shortest deformed distance from each of the n bottom points to the top face, shape (n,), length."""
        return distance_to_line(self.bottom, refined(self.top))

    @property
    def middle(self) -> np.ndarray:
        """Deformed positions (r, z) half-way between bottom and top points, shape (n, 2), length: the middle line."""
        return (self.top + self.bottom) / 2

    @property
    def arc_length(self) -> np.ndarray:
        """Arc length of the deformed middle line from the axis to each point, shape (n,), length."""
        return length_along(self.middle)

    @property
    def outline(self) -> np.ndarray:
        """Deformed boundary of the section in order: bottom, end, top and start, shape (m, 2), length."""
        start, end = (points if edge is None else edge[1:-1]
                      for points, edge in ((self.bottom[:0], self.start), (self.bottom[:0], self.end)))
        return np.vstack([self.bottom, end, self.top[::-1], start[::-1]])

    @property
    def end_weights(self) -> np.ndarray:
        """Part of the bulge of the start and of the end that each pair of points shares, shape (2, n).

        It decreases from 1 to 0 over twice the thickness, or over the whole length of a shorter body.
        """
        s = self.reference_length
        reach = min(s[-1], 2 * float(self.original_thickness.max()))
        return np.clip(1 - np.array([s, s[-1] - s]) / reach, 0.0, 1.0)

    def through_wall(self, fractions: np.ndarray | None = None) -> np.ndarray:
        """Return deformed positions between the faces, for drawing, shape (m, n, 2), length.

        They lie on straight lines from bottom to top points. Near the two ends of the section they are displaced normal
        to these lines, as much as the end bulges.

        Args:
            fractions: position between bottom (0) and top (1), shape (m,); None: 17 positions at equal distances.

        Raises:
            InputError: a fraction that is not a finite number.
        """
        fractions = np.linspace(0, 1, _EDGE_POINTS) if fractions is None else finite_array(
            "through_wall: fractions", fractions).ravel()
        s = fractions[:, None, None]
        straight = (1 - s) * self.bottom + s * self.top
        found = straight.copy()
        for edge, k, weight in zip((self.start, self.end), (0, -1), self.end_weights):
            if edge is not None:
                chord = edge[-1] - edge[0]
                along = (edge - edge[0]) @ chord / (chord @ chord)
                rises = np.append(True, along[1:] > np.maximum.accumulate(along)[:-1])      # elsewhere it rolls over
                rises = np.append(rises[:-1] & (along[:-1] < 1), True)
                curve = np.column_stack([np.interp(fractions, along[rises], values) for values in edge[rises].T])
                found += weight[:, None] * (curve - straight[:, k])[:, None]
        return found

    def thickness_ratio_at(self, radius: float) -> float:
        """Return `thickness_ratio` at a reference radius, interpolated linearly between the bottom points.

        Args:
            radius: reference radius, length.

        Raises:
            InputError: the radius lies outside the sheet.
        """
        low, high = self.reference_radius[[0, -1]]
        if not abs(finite("thickness_ratio_at: radius", radius) - (low + high) / 2) <= (0.5 + 1e-9) * (high - low):
            raise InputError(f"thickness_ratio_at: radius = {radius:g}: must be from {low:g} to {high:g}")
        return float(np.interp(radius, self.reference_radius, self.thickness_ratio))


def whole_part(profile: Profile, planes: MirrorPlanes) -> Profile:
    """Return the profile of the whole part from that of its half or quarter and the mirror planes."""
    for plane in planes.planes:
        profile = _joined_with_image(profile, plane, max(planes.near, SAME_PLACE * float(np.ptp(profile.bottom))))
    return profile


def _joined_with_image(profile: Profile, plane: MirrorPlane, near: float) -> Profile:
    """Return a profile joined with its image if an end or face lies within `near`, length, of the plane."""
    def image(points: np.ndarray) -> np.ndarray:
        """Return the mirror images of points, shape (n, 2), length."""
        unit = np.eye(2)[plane.axis]
        return points * (1 - 2 * unit) + 2 * plane.position * unit

    def lies_in(points: np.ndarray) -> np.ndarray:
        """Return a mask of the points that lie in the plane."""
        return np.abs(points[:, plane.axis] - plane.position) <= near
    lines = [profile.reference_bottom, profile.reference_top, profile.bottom, profile.top]
    (first, second), start, end = (lies_in(line) for line in lines[:2]), profile.start, profile.end
    if first[-1] and second[-1]:
        lines = [np.vstack([line, image(line[:-1])[::-1]]) for line in lines]
        return Profile(lines[0], lines[1], lines[2], lines[3], start, None if start is None else image(start))
    if first[0] and second[0]:
        lines = [np.vstack([image(line[1:])[::-1], line]) for line in lines]
        return Profile(lines[0], lines[1], lines[2], lines[3], None if end is None else image(end), end)
    if first.all():
        start, end = (None if edge is None else np.vstack([image(edge)[::-1], edge[1:]]) for edge in (start, end))
        return Profile(image(lines[1]), lines[1], image(lines[3]), lines[3], start, end)
    if second.all():
        start, end = (None if edge is None else np.vstack([edge, image(edge[:-1])[::-1]]) for edge in (start, end))
        return Profile(lines[0], image(lines[0]), lines[2], image(lines[2]), start, end)
    return profile


def distance_to_line(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the distance of points (m, 2) from a polyline (n, 2), shape (m,), length."""
    a, b = line[:-1], line[1:]
    fraction = np.einsum("mij,ij->mi", points[:, None] - a, b - a) / np.einsum("ij,ij->i", b - a, b - a)
    offset = points[:, None] - a - np.clip(fraction, 0, 1)[..., None] * (b - a)
    return np.hypot(offset[..., 0], offset[..., 1]).min(1)


class Profiles:
    """Computes the `Profile` of a sheet with `bottom` and `top`, or `inner` and `outer`, in states of a problem."""

    def __init__(self, problem: Any):
        self._problem = problem
        self._probe: Probe | None = None

    def evaluate(self, state: Any) -> Profile:
        """Return the profile of a state; collective. A mesh without pair of faces, or in space, is an InputError."""
        self._probe = faces = self._probe or self._make_probe()
        deformed = faces.points + faces.displacement_in(state)
        n = (len(faces.points) - 2 * _EDGE_POINTS) // 2
        bottom, top, start, end = np.split(deformed, np.cumsum([n, n, _EDGE_POINTS]))
        return Profile(faces.points[:n].copy(), faces.points[n:2 * n].copy(), bottom, top, start, end)

    def _make_probe(self) -> Probe:
        """Return the `Probe` of the displacements at the bottom points, the top points, the start and the end.

        A mesh without a pair of faces, or a sheet in three dimensions, is an InputError.
        """
        mesh = self._problem.scene.first.mesh
        if self._problem.scene.kinematics.components == 3:
            raise InputError("a sheet in three dimensions has no profile: use path.wall(), its section(), or"
                             " path.view3d")
        faces = next((pair for pair in FACES if all(name in mesh.boundaries for name in pair)), None)
        if faces is None:
            raise InputError(f"a profile needs boundaries {' or '.join(f'{a!r} and {b!r}' for a, b in FACES)};"
                             f" the mesh has {list(mesh.boundaries)}")
        bottom, top = (mesh.line_of(name) for name in faces)
        if np.hypot(*(top - bottom[0]).T).argmin() > np.hypot(*(top - bottom[-1]).T).argmin():
            top = top[::-1]                                 # an open tube whose wall changes: see `Mesh.line_of`
        opposite = _opposite(bottom, top)
        edges = [_edge_points(mesh, faces, bottom[k], opposite[k]) for k in (0, -1)]
        return probe(self._problem, np.vstack([bottom, opposite, *edges]))


def _edge_points(mesh: Any, faces: tuple[str, str], bottom: np.ndarray, top: np.ndarray) -> np.ndarray:
    """Return points at equal distances along the edge of a section from its bottom to its top, shape (17, 2), length.

    The edge is the boundary of the mesh, other than the two `faces`, that ends at the two points `bottom` and `top`,
    shape (2,) each, length. If there is no such boundary, it is the straight line between them.
    """
    line = np.array([bottom, top])
    for name in (name for name in mesh.boundaries if name not in faces):
        try:
            found = mesh.line_of(name)
        except InputError:                                   # it is in several parts
            continue
        found = found if np.hypot(*(found[0] - bottom)) < np.hypot(*(found[-1] - bottom)) else found[::-1]
        if np.hypot(*(found[[0, -1]] - line).T).max() < SAME_PLACE * np.hypot(*(top - bottom)):
            line = refined(found)
            break
    length = length_along(line)
    at = np.linspace(0, length[-1], _EDGE_POINTS)
    return np.column_stack([np.interp(at, length, values) for values in line.T])


def refined(line: np.ndarray, parts: int = 6) -> np.ndarray:
    """Return points on parabolic edges with nodes (n, 2), `parts` intervals each, ((n - 1) / 2 parts + 1, 2)."""
    a, m, b = line[:-1:2, None], line[1::2, None], line[2::2, None]
    xi = np.linspace(0, 1, parts, endpoint=False)[:, None]
    inner = (1 - xi) * (1 - 2 * xi) * a + 4 * xi * (1 - xi) * m + xi * (2 * xi - 1) * b
    return np.vstack([inner.reshape(-1, line.shape[1]), line[-1]])


def _opposite(line: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return for each node of a face the point at which its normal meets the other face, shape (n, 2), length.

    Both faces have nodes end, middle, end, ... in the same direction, (n, 2) and (m, 2). Ends are opposite ends; a
    normal that misses takes the nearest end.
    """
    a, m, b = line[:-1:2], line[1::2], line[2::2]          # tangents of the parabola through an edge's nodes
    tangent = np.zeros_like(line)
    tangent[1::2] = b - a
    tangent[:-1:2] += _unit(4 * m - 3 * a - b)
    tangent[2::2] += _unit(3 * b - 4 * m + a)
    found = np.empty_like(line)
    for k, (x, t) in enumerate(zip(line, tangent)):
        distance = (other - x) @ t
        away = np.hypot(*(other - x).T)
        met = np.flatnonzero((distance[:-1] <= 0) & (distance[1:] > 0))
        if k in (0, len(line) - 1) or not len(met):
            found[k] = other[0 if k == 0 or k < len(line) - 1 and away[0] < away[-1] else -1]
            continue
        i = met[np.argmin(away[met])]
        xi = (i % 2 + distance[i] / (distance[i] - distance[i + 1])) / 2
        a, m, b = other[i - i % 2: i - i % 2 + 3]
        for _ in range(3):                                 # Newton's method along the curved edge
            point = (1 - xi) * (1 - 2 * xi) * a + 4 * xi * (1 - xi) * m + xi * (2 * xi - 1) * b
            slope = (4 * xi - 3) * a + (4 - 8 * xi) * m + (4 * xi - 1) * b
            xi -= ((point - x) @ t) / (slope @ t)
        found[k] = (1 - xi) * (1 - 2 * xi) * a + 4 * xi * (1 - xi) * m + xi * (2 * xi - 1) * b
    return found


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors, shape (n, 2), scaled to unit length."""
    return vectors / np.hypot(*vectors.T)[:, None]
