"""Rigid tools in three dimensions that are made of profiles: tools of revolution, extruded tools and boxes.

A profile is swept about an axis, along a line, or round a rectangle. The distance to such a tool is as exact as the
distance to its profile in the plane, except near the edges at which an extruded profile ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, as_points, check_name, check_type, non_negative, pair, positive, triple
from ...io.stl import volume, write_stl
from ...physics.contact import Contact
from ...physics.contact_law import ContactLaw
from ...tools.profile import Tool
from ...values.tolerances import ROUND_OFF
from .bodies import merged
from .lagged_corrections import LaggedCorrections
from .lagged_friction import Distances, LaggedFriction
from .lagged_steps import LaggedApproach
from .lagged_stick import LaggedStick

_CORNER_PIECES = 24           # straight pieces of a rounded corner in `surface`


class SolidTool:
    """Rigid tool in three dimensions, the base class of swept profiles and of surfaces from STL files.

    A subclass defines `_distance`, `_distances` and `_surface`.

    Attributes:
        components: number of coordinates, 3.
        sized: True if the surface is bounded; False for a plane, whose `bounds` have no meaning.
        approach: class of the limits of a step with this tool.
        corrections: class of the corrections of a solved step.
        shift: displacement (x, y, z) from the initial position, length, see `moved`.
    """

    components = 3
    sized = True
    approach = LaggedApproach
    corrections = LaggedCorrections
    shift: tuple[float, ...] = (0.0, 0.0, 0.0)

    def signed_distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distances of points from the surface of the tool, positive inside.

        Args:
            x: positions, shape (n, 3), length.

        Returns:
            Signed distances, shape (n,), length.
        """
        return self._distance(as_points("signed_distance: x", x, 3) - self.shift)

    def distances(self, x: np.ndarray) -> Distances:
        """Return the signed distances of points from the tool, with first and second derivatives.

        Args:
            x: positions, shape (n, 3), length.

        Returns:
            Distances (positive inside the tool), normals (into the tool) and Hessians at the n points.

        >>> found = fx.tools.revolved(fx.tools.sphere(radius=10.0, z=-10.0)).distances([[0.0, 0.0, -8.0]])
        >>> found.distance.tolist(), found.normal.tolist()
        ([2.0], [[0.0, 0.0, 1.0]])
        """
        return self._distances(as_points("distances: x", x, 3) - self.shift)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest coordinates (x, y, z) of the drawn surface of the tool, shape (2, 3), length."""
        points = self.surface()[0]
        return np.array([points.min(0), points.max(0)])

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the surface of the tool as triangles, for drawing.

        Returns:
            Vertices, shape (n, 3), length; vertex numbers of the triangles, shape (m, 3).
        """
        points, triangles = self._surface()
        return points + self.shift, triangles

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
        """Return a copy of the tool that is displaced by (x, y, z).

        Args:
            x: displacement along x, length.
            y: displacement along y, length.
            z: displacement along z, length.

        Returns:
            The displaced tool.
        """
        import copy
        found = copy.copy(self)
        found.shift = tuple(a + b for a, b in zip(self.shift, triple("moved", (x, y, z))))
        return found

    def contact_law(self, contact: Contact, k: np.ndarray | float, thickness: float) -> ContactLaw:
        """Return the law of a sheet of a given thickness, length: `LaggedStick`, or `LaggedFriction` if it slides.

        k: penalty, stress/length, the same at all points; the thickness scales the regularisation.
        """
        theta = contact.ramp * thickness
        if contact.sticks:
            return LaggedStick(self, k, theta, contact.separates)
        return LaggedFriction(self, contact.mu, k, theta, contact.elastic_slip * thickness)

    def _distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distances from the unmoved tool, positive inside, shape (n,), length."""
        raise NotImplementedError

    def _distances(self, x: np.ndarray) -> Distances:
        """Return distances, normals and Hessians at positions x relative to the unmoved tool, shape (n, 3), length."""
        raise NotImplementedError

    def _surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices, shape (n, 3), length, and vertex numbers of triangles, shape (m, 3), of the unmoved tool."""
        raise NotImplementedError


def nearest_of(parts: list[Distances]) -> Distances:
    """Return distances of n points from a union of solids, positive inside: the largest, which is exact outside."""
    if len(parts) == 1:
        return parts[0]
    nearest = np.argmax([part.distance for part in parts], axis=0)
    rows = np.arange(len(nearest))
    return Distances(*(np.stack(arrays)[nearest, rows] for arrays in zip(*parts)))


class Swept(SolidTool):
    """Rigid tool whose profile (r, z) is swept along a curve in the plane of x and y.

    The coordinate r of a position (x, y, z) depends on the kind of the tool:

    * revolved: r is the distance from the axis x = y = 0.
    * extruded along y: r is x. Extruded along x: r is y.
    * box: r is min(half) minus the distance inwards from the outline of a rectangle with rounded corners.

    Args:
        profile: profile in the plane (r, z), with the solid to its left.
        kind: "revolved", "extruded" or "box".
        half: half widths of the rectangle along x and y, length, for "box".
        corner: radius of the corners of the rectangle, length, for "box".
        along: axis along which the profile is extruded, "x" or "y", for "extruded".
    """

    def __init__(self, profile: Tool, kind: str, half: tuple[float, float] = (0.0, 0.0), corner: float = 0.0,
                 along: str = "y"):
        self.profile, self.kind, self.half, self.corner, self.along = profile, kind, half, corner, along
        self.sized = profile.sized

    def _distances(self, x):
        """Return distances, normals and Hessians at positions x relative to the unmoved tool, shape (n, 3), length."""
        r, way, bend = self._profile_coordinate(x)
        found = self.profile.nearest(np.column_stack([r, x[:, 2]]))
        normal, tangent = (v[:, :1] * way + v[:, 1:] * [0.0, 0.0, 1.0] for v in (found.normal, found.tangent))
        hessian = found.curvature[:, None, None] * tangent[:, :, None] * tangent[:, None]
        across = np.column_stack([-way[:, 1], way[:, 0], np.zeros(len(x))])         # where the curve of `r` bends
        turn = found.normal[:, 0] * bend
        if self.kind == "revolved":                          # on the axis both curvatures are one
            turn = np.where(r > ROUND_OFF * self._size, turn, found.curvature)
        return Distances(found.distance, normal, hessian + turn[:, None, None] * across[:, :, None] * across[:, None])

    def _distance(self, x):
        """Return the signed distances from the unmoved tool, positive inside, shape (n,), length."""
        if self.kind == "extruded":
            r = x[:, "yx".index(self.along)]
        else:
            u, inner_half = np.abs(x[:, :2]) - self._inner_half, float(np.min(self._inner_half))
            r = inner_half + np.hypot(*np.maximum(u, 0.0).T) + np.minimum(u.max(1), 0.0)
        return self.profile.signed_distance(np.column_stack([r, x[:, 2]]))

    @property
    def _inner_half(self) -> np.ndarray:
        """Half widths of the rectangle of the centres of its corners, shape (2,), length; 0 for a revolved tool."""
        return np.array(self.half) - self.corner if self.kind == "box" else np.zeros(2)

    def _profile_coordinate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the coordinate r of points, shape (n, 3), in the plane (r, z) of the profile, shape (n,), length.

        Also its gradient, shape (n, 3), and the curvature of the curve of constant r there, (n,), 1/length.
        """
        way = np.zeros((len(x), 3))
        if self.kind == "extruded":
            axis = "yx".index(self.along)
            way[:, axis] = 1.0
            return x[:, axis], way, np.zeros(len(x))
        sign, u = np.where(x[:, :2] < 0, -1.0, 1.0), np.abs(x[:, :2]) - self._inner_half
        outside = np.hypot(*np.maximum(u, 0.0).T)
        flat = (u.min(1) < 0) | (outside == 0)
        way[:, :2] = sign * np.maximum(u, 0.0) / np.maximum(outside, 1e-300)[:, None]
        way[flat, :2] = (sign * (np.arange(2) == u.argmax(1)[:, None]))[flat]
        bend = np.where(flat, 0.0, 1 / np.maximum(outside, 1e-300))
        return self._inner_half.min() + outside + np.minimum(u.max(1), 0.0), way, bend

    @property
    def _size(self) -> float:
        """Largest extent of the profile, length; 1 for a plane."""
        return float(np.ptp(self.profile.bounds, axis=0).max()) if self.sized else 1.0

    def _surface(self):
        """Return vertices, shape (n, 3), length, and vertex numbers of triangles, shape (m, 3), of the unmoved tool."""
        return self._swept(self.profile.outline())

    def to_stl(self, file: Any, wall: float) -> None:
        """Write the tool as a closed solid in a binary STL file, with a flat bottom below its lowest point.

        Args:
            file: path of the STL file.
            wall: distance of the flat bottom below the lowest point of the profile, length, positive. Also of the
                outer side from the widest part of a profile that begins at a smaller radius, such as a bottle.

        Raises:
            InputError: the tool is extruded, or its profile does not lead from r > 0 to r = 0.
        """
        outline, wall = self.profile.outline(), positive("to_stl: wall", wall)
        if self.kind == "extruded" or outline[-1, 0] != 0 or outline[0, 0] <= 0:
            raise InputError(f"to_stl: {self!r}: must be a mould revolved or round a box, its profile to end at r = 0")
        low, (radius, height), widest = outline[:, 1].min() - wall, outline[0], outline[:, 0].max()
        side = [[radius, low]]
        if widest > radius:                                  # a bottle from its neck: outside its widest part
            side = [[widest + wall, low], [widest + wall, max(height, outline[:, 1].max())]]
        (top, upper), (back, lower) = (self._swept(np.array(line)) for line in (
            outline, [[0.0, low], *side, outline[0]]))
        points, triangles = merged(np.vstack([top, back]), np.vstack([upper, lower + len(top)]))
        write_stl(points + self.shift, triangles if volume(points, triangles) > 0 else triangles[:, ::-1], file)

    def _swept(self, outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (n, 3), length, and triangles (m, 3) of a swept outline, points (r, z), (k, 2), length."""
        rings = np.array([np.insert(self._ring(r), 2, z, axis=1) for r, z in outline])
        m, n = rings.shape[:2]
        row = np.arange(m * n).reshape(m, n)
        a, b, c, d = row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]
        return rings.reshape(-1, 3), np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], -2).reshape(-1, 3)

    def _ring(self, r: float) -> np.ndarray:
        """Return points (x, y) of the curve that a point (r, z) of the profile sweeps, shape (n, 2), length."""
        turn = np.linspace(0, np.pi / 2, _CORNER_PIECES + 1)
        if self.kind == "extruded":
            ends = np.array([-1.0, 1.0]) * np.ptp(self.profile.bounds, axis=0).max() / 2
            line = np.column_stack([np.full(2, r), ends])
            return line if self.along == "y" else line[:, ::-1]
        offset = r - (min(self.half) if self.kind == "box" else 0.0)
        radius = max(self.corner + offset, 0.0)
        middle = np.array(self.half) + (offset if self.kind == "box" else 0.0) - radius
        middle = middle if self.kind == "box" else np.zeros(2)
        found = [np.column_stack([sx * middle[0] + radius * np.cos(turn + q),
                                  sy * middle[1] + radius * np.sin(turn + q)])
                 for sx, sy, q in ((1, 1, 0), (-1, 1, np.pi / 2), (-1, -1, np.pi), (1, -1, 1.5 * np.pi))]
        ring = np.concatenate(found)
        return np.vstack([ring, ring[:1]])

    def __repr__(self) -> str:
        options = f", half={self.half}, corner={self.corner:g}" if self.kind == "box" else ""
        return f"{self.kind}({self.profile!r}{options})"


def revolved(profile: Tool) -> Swept:
    """Return the rigid tool that a profile forms by revolution about the axis x = y = 0.

    Args:
        profile: profile in the plane (r, z), such as `fx.tools.sphere(...)`.

    Returns:
        The tool.

    Raises:
        InputError: the profile is no tool of the plane.

    >>> ball = fx.tools.revolved(fx.tools.sphere(radius=10.0, z=0.0))
    >>> ball.bounds.round(6).tolist()
    [[-10.0, -10.0, 0.0], [10.0, 10.0, 20.0]]
    """
    return Swept(check_type("revolved: profile", profile, Tool, "a Tool"), "revolved")


def extruded(profile: Tool, along: str = "y") -> Swept:
    """Return the rigid tool that a profile forms by extrusion along y or x.

    Args:
        profile: profile in the plane (r, z), such as `fx.tools.sphere(...)`.
        along: "y": r of the profile is x; "x": r is y.

    Returns:
        The tool.

    Raises:
        InputError: the profile is no tool of the plane, or `along` is another axis.

    >>> fx.tools.extruded(fx.tools.sphere(radius=10.0)).signed_distance([[0.0, 55.0, -1.0]]).tolist()
    [-1.0]
    """
    check_name("extruded: along =", along, ("x", "y"))
    return Swept(check_type("extruded: profile", profile, Tool, "a Tool"), "extruded", along=along)


def swept(profile: Tool, *, half: tuple[float, float], corner: float = 0.0) -> Swept:
    """Return the rigid tool that a profile forms by a sweep round a rectangle with rounded corners.

    Args:
        profile: profile in the plane (r, z). Its radius r = min(half) follows the rectangle; other radii follow curves
            at a constant distance from it.
        half: half widths of the rectangle along x and y, length.
        corner: radius of the corners of the rectangle, length.

    Returns:
        The tool.

    Raises:
        InputError: the profile is no tool of the plane, or the corner radius is above the smaller half width.

    >>> line = [(0, -16), (10, -16), (35, -46), (35, -180), (0, -180)]
    >>> body = fx.tools.swept(fx.Tool(line, [0, 0, 12, 6, 0]), half=(35.0, 35.0), corner=12.0)
    >>> body.signed_distance([[0.0, 30.0, -100.0]]).tolist()
    [-5.0]
    """
    check_type("swept: profile", profile, Tool, "a Tool")
    a, b = (positive("swept: half", value) for value in pair("swept: half", half))
    if non_negative("swept: corner", corner) > min(a, b):
        raise InputError(f"swept: corner = {corner!r}: must be at most the smaller half width, {min(a, b):g}")
    return Swept(profile, "box", (a, b), float(corner))


def box(*, half: tuple[float, float], depth: float, corner: float = 0.0, fillet: float = 0.0, lip: float = 0.0,
        draft: float = 0.0, mouth: float = 0.0, plug: bool = False) -> Swept:
    """Return a box-shaped mould with rounded corners, open upwards, centred at x = y = 0; or the plug that fits it.

    Args:
        half: half widths along x and y at the mouth (for a plug: at its upper end), length.
        depth: depth from the mouth to the floor, length.
        corner: radius in plan at the mouth, length; with draft the radius at the floor is smaller, and should not be
            below `fillet`.
        fillet: radius between wall and floor, length.
        lip: radius between wall and flange, length; not for a plug.
        draft: angle between wall and z axis, degrees.
        mouth: z of the mouth, length.
        plug: True for the plug, which extends upwards.

    Returns:
        The tool.

    Raises:
        InputError: sizes that do not fit each other, or a plug with a lip.

    >>> tray = fx.tools.box(half=(60.0, 40.0), depth=20.0, corner=15.0, fillet=5.0)
    >>> tray.signed_distance([[0.0, 0.0, -18.0]]).tolist()
    [-2.0]
    """
    a, b = (positive("box: half", value) for value in pair("box: half", half))
    depth, corner, fillet = positive("box: depth", depth), non_negative("box: corner", corner), non_negative(
        "box: fillet", fillet)
    if corner > min(a, b):
        raise InputError(f"box: corner = {corner!r}: must be at most the smaller half width, {min(a, b):g}")
    r = min(a, b)
    floor = r - depth * np.tan(np.radians(non_negative("box: draft", draft)))
    if floor <= fillet:
        raise InputError(f"box: draft = {draft!r} degrees and fillet = {fillet!r}: leave no floor at depth {depth:g}")
    points = [(3 * r + lip, mouth), (r, mouth), (floor, mouth - depth), (0.0, mouth - depth)]
    if plug:
        if lip:
            raise InputError(f"box: lip = {lip!r}: a plug has no flange: must be left out")
        return Swept(Tool([*points[:1:-1], (r, mouth), (r, mouth + depth)], [0.0, fillet, 0.0, 0.0]), "box", (a, b),
                     corner)
    return Swept(Tool(points, [0.0, non_negative("box: lip", lip), fillet, 0.0]), "box", (a, b), corner)
