"""Rigid tools with a profile of straight lines and circular arcs.

The solid of a tool lies to the left of its profile, in the order of the points. A fillet is an arc, a sharp corner an
arc of radius 0. So the profile is smooth between corners, and the distance to it is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError, as_points, finite, instance, non_negative, pair, positive, several
from ..mesh.boxes import overlapping
from .nearest import nearest

_FLAT = 1e-9  # radians: a joint that turns less is smooth
TURN = 2 * math.pi


class Line(NamedTuple):
    """Straight piece of a profile.

    Attributes:
        a: first point (R, Z), length.
        b: last point (R, Z), length.
    """

    a: np.ndarray
    b: np.ndarray

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last point (R, Z), length."""
        return self.a, self.b

    @property
    def angles(self) -> tuple[float, float]:
        """Angle between the line and the R axis at its first and last point (both equal), radians."""
        angle = math.atan2(self.b[1] - self.a[1], self.b[0] - self.a[0])
        return angle, angle

    @property
    def backwards(self) -> Line:
        """The line from its last point to its first."""
        return Line(self.b, self.a)


class Arc(NamedTuple):
    """Circular piece of a profile.

    Attributes:
        centre: centre (R, Z), length.
        radius: radius, length; 0 for a sharp corner.
        start: polar angle of the first point, radians.
        sweep: angle of the arc, positive if it turns left, radians.
    """

    centre: np.ndarray
    radius: float
    start: float
    sweep: float

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last point (R, Z), length."""
        first, last = (self.centre + self.radius * np.array([math.cos(a), math.sin(a)])
                       for a in (self.start, self.start + self.sweep))
        return first, last

    @property
    def angles(self) -> tuple[float, float]:
        """Angle between the tangent and the R axis at the first and the last point, radians."""
        quarter = math.copysign(math.pi / 2, self.sweep)
        return self.start + quarter, self.start + self.sweep + quarter

    @property
    def backwards(self) -> Arc:
        """The arc from its last point to its first."""
        return self._replace(start=self.start + self.sweep, sweep=-self.sweep)


class Nearest(NamedTuple):
    """Geometry of a profile at the closest points to n given points.

    Attributes:
        distance: signed distance, positive inside the tool, shape (n,), length.
        normal: its gradient, pointing into the tool, shape (n, 2).
        curvature: curvature of the level line; the second derivative is curvature t t^T with the tangent t, shape (n,),
            1/length.
    """

    distance: np.ndarray
    normal: np.ndarray
    curvature: np.ndarray

    @property
    def tangent(self) -> np.ndarray:
        """Tangent: the normal rotated left by 90 degrees, shape (n, 2)."""
        return self.normal[:, ::-1] * (-1.0, 1.0)


class Tool:
    """Rigid tool defined by its profile in the (R, Z) plane.

    Beyond its ends, an open profile continues along its end pieces. At an end on R = 0 it is mirrored instead.

    Args:
        points: corners (R, Z), shape (n, 2), length; the solid lies to their left.
        fillets: fillet radius of each corner, 0 for a sharp one, or one radius for all corners, length. Ends of an open
            profile have none, except on R = 0 (the tip of a cone).
        closed: True to join the last point to the first.

    Raises:
        InputError: fewer than two different points, a fillet without a corner or too large for it, or a profile that
            crosses itself.

    >>> step = fx.Tool([(0, 2), (3, 2), (4, 0), (9, 0)], fillets=[0, 0.5, 0.2, 0])
    >>> step.signed_distance([(0.0, 2.1), (8.0, -0.3)]).round(6).tolist()          # above 0: inside
    [0.1, -0.3]
    """

    components = 2

    def __init__(self, points: Sequence[Sequence[float]], fillets: float | Sequence[float] = 0.0, closed: bool = False):
        instance("Tool: closed", closed, bool, "True or False")
        corners = np.array([pair("Tool: points", p) for p in several("Tool: points", points, "points (R, Z)")])
        if len(corners) < (3 if closed else 2):
            raise InputError(f"Tool: {len(corners)} points: a{' closed' if closed else 'n open'} profile needs at least"
                             f" {3 if closed else 2}")
        n = len(corners)
        each = np.ndim(fillets) > 0
        radii: list = list(np.asarray(fillets)) if each else [
            fillets if closed or 0 < i < n - 1 else 0.0 for i in range(n)]
        if len(radii) != n:
            raise InputError(f"Tool: {len(radii)} fillets for {n} points: give one number, or one for each point")
        radii = [non_negative(f"Tool: fillet at point {i}", r) for i, r in enumerate(radii)]
        pieces = _rounded(corners, radii, closed, each)
        if not each and non_negative("Tool: fillets", fillets) > 0 and not any(isinstance(p, Arc) for p in pieces):
            raise InputError(f"Tool: fillets = {fillets!r}: the profile has no corner to round (an end on R = 0 is"
                             f" rounded by a list with a radius for each point)")
        self._set_pieces(pieces, closed)

    @classmethod
    def of_pieces(cls, pieces: Sequence[Line | Arc], closed: bool = False) -> Tool:
        """Return a tool from successive lines and arcs; their joints may be corners.

        Args:
            pieces: the lines and arcs.
            closed: True if the last point is the first.

        Raises:
            InputError: a piece is of another type, not finite or of no length. The pieces do not follow one another, or
                the profile doubles back or crosses itself.
        """
        tool = cls.__new__(cls)
        instance("Tool.of_pieces: closed", closed, bool, "True or False")
        tool._set_pieces(several("Tool.of_pieces: pieces", pieces, "Line(...) and Arc(...)"), closed)
        return tool

    def _set_pieces(self, pieces: list[Line | Arc], closed: bool) -> None:
        """Store the pieces, and check that the profile does not cross itself.

        Raises:
            InputError: there is no piece, the pieces do not follow one another, or the profile doubles back.
        """
        pieces = [_checked(piece, i) for i, piece in enumerate(pieces)]
        if not pieces:
            raise InputError("Tool: a profile needs at least one piece, a Line or an Arc")
        self.pieces, self.closed = tuple(pieces), closed
        ends = np.array([e for p in pieces for e in p.ends])
        self.size = float(max(np.ptp(ends, axis=0).max(), max((p.radius for p in pieces if isinstance(p, Arc)),
                                                              default=0.0)))
        for i, (p, q) in enumerate(zip(pieces, pieces[1:] + (pieces[:1] if closed else []))):
            if math.dist(p.ends[1], q.ends[0]) > 1e-6 * self.size:
                raise InputError(f"Tool: piece {i} ends at {_show(p.ends[1])}, the next begins at {_show(q.ends[0])}:"
                                 f" the pieces of a profile must follow one another")
            if math.pi - abs(_turn(p.angles[1], q.angles[0])) < 1e-6:
                raise InputError(f"Tool: the profile doubles back at (R, Z) = {_show(p.ends[1])}")
        self._check_crossing()
        self._tabulate()

    def signed_distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distance of points from the profile.

        Args:
            x: points, shape (n, 2), length.

        Returns:
            Distances, positive inside the tool, shape (n,), length.
        """
        return self.nearest(x).distance

    def nearest(self, x: np.ndarray) -> Nearest:
        """Return the signed distance of points x, shape (n, 2), its gradient and its curvature."""
        return Nearest(*nearest(as_points("Tool: x", x), self._table, self._lines))

    def moved(self, r: float = 0.0, z: float = 0.0) -> Tool:
        """Return the tool shifted by (r, z), length."""
        shift = np.array([finite("Tool.moved: r", r), finite("Tool.moved: z", z)])
        return self._with_pieces([Line(p.a + shift, p.b + shift) if isinstance(p, Line)
                                  else p._replace(centre=p.centre + shift) for p in self.pieces])

    def turned(self, angle: float) -> Tool:
        """Return the tool rotated counter-clockwise about the origin by an angle in degrees (plane strain)."""
        a = math.radians(finite("Tool.turned: angle", angle))
        Q = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
        return self._with_pieces([Line(Q @ p.a, Q @ p.b) if isinstance(p, Line)
                                  else p._replace(centre=Q @ p.centre, start=p.start + a) for p in self.pieces])

    def mirrored(self) -> Tool:
        """Return the tool upside down: Z becomes -Z."""
        flip = np.array([1.0, -1.0])
        return self._with_pieces([Line(p.b * flip, p.a * flip) if isinstance(p, Line)
                           else Arc(p.centre * flip, p.radius, -p.start - p.sweep, p.sweep)
                           for p in reversed(self.pieces)])

    def reversed(self) -> Tool:
        """Return the tool with its solid on the other side of the profile."""
        return self._with_pieces([p.backwards for p in reversed(self.pieces)])

    def outline(self, per_arc: int = 24) -> np.ndarray:
        """Return points along the profile for drawing, shape (n, 2), length.

        Args:
            per_arc: number of straight pieces per arc.
        """
        parts = [_sampled(p, per_arc) for p in self.pieces]
        return np.vstack([parts[0], *(part[1:] for part in parts[1:])])

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points of the profile and its straight pieces (`RigidTool.surface`).

        Returns:
            Points of `outline`, shape (n, 2), length, and numbers of the ends of each piece, shape (m, 2).
        """
        points = self.outline()
        numbers = np.arange(len(points))
        return points, np.stack([numbers[:-1], numbers[1:]], 1)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest (R, Z) of the outline, shape (2, 2), length."""
        points = self.outline()
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def __repr__(self) -> str:
        arcs = sum(isinstance(p, Arc) for p in self.pieces)
        numbers = ((len(self.pieces) - arcs, "line"), (arcs, "arc"))
        kinds = " and ".join(f"{n} {kind}{'s' * (n > 1)}" for n, kind in numbers if n)
        ends = np.array([self.pieces[0].ends[0], self.pieces[-1].ends[1]])
        first, last = np.where(np.abs(ends) < 1e-12 * self.size, 0.0, ends)
        return f"Tool({kinds}{', closed, from' if self.closed else ' from'} {_show(first)} to {_show(last)})"

    def _with_pieces(self, pieces: list) -> Tool:
        """Return a tool of the same kind from other pieces."""
        return Tool.of_pieces(pieces, self.closed)

    def _tabulate(self) -> None:
        """Fill the table for `nearest`: lines, then arcs and sharp corners (arcs of radius 0)."""
        rows, arcs = [], []     # origin, travel, sign (0: line), low, high; of arcs radius, start
        tol = 1e-9 * self.size
        ends = self._ends()
        for i, p in enumerate(self.pieces):
            opens = (i == 0 and ends[0] is None, i == len(self.pieces) - 1 and ends[1] is None)
            if isinstance(p, Line):
                length = math.dist(p.a, p.b)
                rows.append((*p.a, *(p.b - p.a) / length, 0.0, -math.inf if opens[0] else -tol,
                             math.inf if opens[1] else length + tol))
            else:
                full, sign = abs(p.sweep) >= TURN - _FLAT, math.copysign(1.0, p.sweep)
                start = p.start - sign * (math.pi / 2 * opens[0] + _FLAT)
                sweep = abs(p.sweep) + math.pi / 2 * (opens[0] + opens[1])
                arcs.append((*p.centre, 0.0, 0.0, sign, 0.0,
                             math.inf if full or sweep >= TURN else sweep + 2 * _FLAT, p.radius, start))
        joints = list(zip(self.pieces, self.pieces[1:] + (self.pieces[:1] if self.closed else ())))
        corners = [(p.ends[1], _turn(p.angles[1], q.angles[0])) for p, q in joints] + [e for e in ends if e is not None]
        arcs += [(*c, 0.0, 0.0, math.copysign(1.0, turn), 0.0, math.inf, 0.0, 0.0)
                 for c, turn in corners if abs(turn) > _FLAT]
        self._lines = len(rows)
        self._table = np.array([(*row, 0.0, 0.0) for row in rows] + arcs)

    def _ends(self) -> tuple:
        """Return for both ends (point, turn of the mirrored corner) on R = 0, or None if the profile continues."""
        if self.closed:
            return (np.zeros(2), 0.0), (np.zeros(2), 0.0)
        found = []
        for point, angle, last in ((self.pieces[0].ends[0], self.pieces[0].angles[0], False),
                                   (self.pieces[-1].ends[1], self.pieces[-1].angles[1], True)):
            on_axis = abs(point[0]) < 1e-9 * self.size
            turn = _turn(angle, -angle) if last else _turn(-angle, angle)
            found.append((point, turn) if on_axis and abs(turn) > _FLAT and abs(abs(turn) - math.pi) > _FLAT else None)
        return tuple(found)

    def _check_crossing(self) -> None:
        """Check that the profile does not cross itself.

        Raises:
            InputError: two pieces cross.
        """
        parts = [_sampled(p, _straight_pieces(p)) for p in self.pieces]
        a = np.concatenate([part[:-1] for part in parts])
        b = np.concatenate([part[1:] for part in parts])
        tolerance, n = 1e-9 * self.size, len(a)
        closes = self.closed or math.dist(a[0], b[-1]) < tolerance
        for i, j in overlapping(np.minimum(a, b) - tolerance, np.maximum(a, b) + tolerance):
            i, j = np.minimum(i, j), np.maximum(i, j)
            separate = (j - i > 1) & ~((i == 0) & (j == n - 1) & closes)
            i, j = i[separate], j[separate]
            u, v, w = b[i] - a[i], b[j] - a[j], a[j] - a[i]
            det = _cross(u, v)
            with np.errstate(divide="ignore", invalid="ignore"):
                s, t = _cross(w, v) / det, _cross(w, u) / det
            hit = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1) & np.isfinite(s)
            if hit.any():
                k = int(np.argmax(hit))
                raise InputError(f"Tool: the profile crosses itself near (R, Z) = {_show(a[i[k]] + s[k] * u[k])}")
            length = np.maximum(np.hypot(*u.T), 1e-300)
            both = np.stack([w, b[j] - a[i]])                                # parallel pieces that overlap
            across, lies = np.abs(_cross(u, both)) / length, (u * both).sum(-1) / length
            over = (across.max(0) < tolerance) & (lies.max(0) > tolerance) & (lies.min(0) < length - tolerance)
            if over.any():
                raise InputError(f"Tool: the profile doubles back at (R, Z) = {_show(a[j[np.argmax(over)]])}")


def _rounded(points: np.ndarray, radii: list[float], closed: bool, each: bool) -> list[Line | Arc]:
    """Return lines and tangent arcs through corners with fillets.

    Args:
        each: True if every point with a fillet must be a corner.

    Raises:
        InputError: a fillet has no corner, or is too large.
    """
    n, size = len(points), float(np.ptp(points, axis=0).max())
    edges = [(i, (i + 1) % n) for i in range(n if closed else n - 1)]
    lengths = {e: math.dist(points[e[0]], points[e[1]]) for e in edges}
    for (i, j), length in lengths.items():
        if length <= 1e-9 * size:
            raise InputError(f"Tool: points {i} and {j} are the same, {_show(points[i])}")
    angle = {e: math.atan2(*(points[e[1]] - points[e[0]])[::-1]) for e in edges}
    before = {j: (i, j) for i, j in edges}
    after = {i: (i, j) for i, j in edges}
    cut, arcs = [0.0] * n, {}
    for i, radius in enumerate(radii):
        if radius == 0:
            continue
        out = angle[after[i]] if i in after else None
        come = angle[before[i]] if i in before else None
        if out is None or come is None:
            if abs(points[i][0]) > 1e-9 * size:
                raise InputError(f"Tool: fillet at point {i} = {radius!r}: an open end has no corner to round")
            out, come = (-come if out is None else out), (-out if come is None else come)   # type: ignore[operator]
        turn = _turn(come, out)
        if abs(turn) < _FLAT:
            if each:
                raise InputError(f"Tool: fillet at point {i} = {radius!r}: the profile runs straight on there: it has"
                                 f" no corner to round")
            continue
        cut[i] = radius * math.tan(abs(turn) / 2)
        arcs[i] = _fillet(points[i], radius, cut[i], come, turn, i in before, i in after)
    _check_fit(points, radii, lengths, cut)
    pieces: list[Line | Arc] = [arcs[0]] if 0 in arcs and not closed else []
    for i, j in edges:
        way = (points[j] - points[i]) / lengths[i, j]
        if lengths[i, j] - cut[i] - cut[j] > 1e-9 * size:
            pieces.append(Line(points[i] + cut[i] * way, points[j] - cut[j] * way))
        if j in arcs:
            pieces.append(arcs[j])
    return pieces


def _fillet(corner: np.ndarray, radius: float, cut: float, come: float, turn: float, first: bool, second: bool) -> Arc:
    """Return the arc that rounds a corner and shortens its edges by `cut`; only half of it at an open end."""
    left = math.copysign(1.0, turn)
    start = corner - cut * np.array([math.cos(come), math.sin(come)])
    centre = start + left * radius * np.array([-math.sin(come), math.cos(come)])
    begin = come - left * math.pi / 2 + (0.0 if first else turn / 2)
    return Arc(centre, radius, begin, turn if first and second else turn / 2)


def _check_fit(points: np.ndarray, radii: list[float], lengths: dict, cut: list[float]) -> None:
    """Check the fillets at the two ends of each edge.

    Raises:
        InputError: together they are longer than the edge.
    """
    for (i, j), length in lengths.items():
        if cut[i] + cut[j] > length * (1 + 1e-9):
            k = i if cut[i] >= cut[j] else j
            raise InputError(f"Tool: fillet at point {k} = {radii[k]:g} is too large for its corner {_show(points[k])}:"
                             f" the edge from {_show(points[i])} to {_show(points[j])} is {length:.6g} long and its"
                             f" fillets take {cut[i] + cut[j]:.6g}; at most"
                             f" {radii[k] * max(length - cut[i] - cut[j] + cut[k], 0) / cut[k]:.6g} fits")


def _checked(piece: Line | Arc, i: int) -> Line | Arc:
    """Return a piece of a profile with its numbers as floats.

    Raises:
        InputError: it is neither a line nor an arc, is not finite, or has no length.
    """
    caller = f"Tool: piece {i}"
    if isinstance(piece, Line):
        a, b = (np.array(pair(f"{caller}: an end", p)) for p in piece)
        if not math.dist(a, b) > 1e-12 * max(np.abs(a).max(), np.abs(b).max()):
            raise InputError(f"{caller}: a line from {_show(a)} to {_show(b)} has no length")
        return Line(a, b)
    if not isinstance(piece, Arc):
        raise InputError(f"{caller} = {piece!r}: must be a Line or an Arc")
    centre = np.array(pair(f"{caller}: centre", piece.centre))
    arc = Arc(centre, positive(f"{caller}: radius", piece.radius), finite(f"{caller}: start", piece.start),
              finite(f"{caller}: sweep", piece.sweep))
    if not 1e-9 < abs(arc.sweep) <= TURN * (1 + 1e-12):
        raise InputError(f"{caller}: sweep = {arc.sweep!r}: must be an angle in radians, not 0, at most a full turn")
    return arc


def _turn(come: float, out: float) -> float:
    """Return the angle from one direction of travel to the next, in (-pi, pi]."""
    return math.pi - (math.pi - (out - come)) % TURN


def _sampled(piece: Line | Arc, n: int) -> np.ndarray:
    """Return n + 1 points on a piece."""
    if isinstance(piece, Line):
        return np.array([piece.a, piece.b])
    angles = piece.start + piece.sweep * np.linspace(0, 1, n + 1)
    return piece.centre + piece.radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _straight_pieces(piece: Line | Arc) -> int:
    """Return the number of straight pieces in a search for crossings: 64 per quarter turn, and 4 or more."""
    return 1 if isinstance(piece, Line) else max(4, math.ceil(256 * abs(piece.sweep) / TURN))


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the cross products of vectors in the plane."""
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _show(point: np.ndarray) -> str:
    """Return a point as text."""
    return f"({point[0]:.6g}, {point[1]:.6g})"
