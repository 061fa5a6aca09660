"""Rigid tools: profiles of straight lines and circular arcs with a signed distance.

The solid of a tool lies to the left of its profile, seen along the order of the points. Curved edges stay curved: a
fillet is an arc, a sharp corner an arc of radius 0, so a profile is smooth up to its corners and the distance to it
is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError, as_points, finite, instance, non_negative, pair, positive, several
from ..mesh.boxes import overlapping
from .nearest import nearest

_FLAT = 1e-9          # radians: a joint that turns less is smooth
TURN = 2 * math.pi


class Line(NamedTuple):
    """A straight piece from `a` to `b`."""

    a: np.ndarray
    b: np.ndarray

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last point."""
        return self.a, self.b

    @property
    def angles(self) -> tuple[float, float]:
        """Direction of travel at both ends, radians."""
        angle = math.atan2(self.b[1] - self.a[1], self.b[0] - self.a[0])
        return angle, angle

    @property
    def backwards(self) -> Line:
        """The same from its last point to its first."""
        return Line(self.b, self.a)


class Arc(NamedTuple):
    """A circular piece about `centre` from polar angle `start`, `sweep` radians long, to the left if positive."""

    centre: np.ndarray
    radius: float
    start: float
    sweep: float

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last point."""
        first, last = (self.centre + self.radius * np.array([math.cos(a), math.sin(a)])
                       for a in (self.start, self.start + self.sweep))
        return first, last

    @property
    def angles(self) -> tuple[float, float]:
        """Direction of travel at both ends, radians."""
        quarter = math.copysign(math.pi / 2, self.sweep)
        return self.start + quarter, self.start + self.sweep + quarter

    @property
    def backwards(self) -> Arc:
        """The same from its last point to its first."""
        return self._replace(start=self.start + self.sweep, sweep=-self.sweep)


class Nearest(NamedTuple):
    """Surface of a profile at the closest points to n given points.

    distance: signed, positive inside the tool, shape (n,), length; normal: its gradient, into the tool, shape (n, 2);
    curvature: its second derivative is curvature t t^T, t the tangent (`tangent`), shape (n,), 1/length.
    """

    distance: np.ndarray
    normal: np.ndarray
    curvature: np.ndarray

    @property
    def tangent(self) -> np.ndarray:
        """The normal turned left by a right angle, shape (n, 2)."""
        return self.normal[:, ::-1] * (-1.0, 1.0)


class Tool:
    """A rigid tool, given by its profile in the (R, Z) plane.

    An open profile goes on beyond its ends as its end pieces do; an end on R = 0 is mirrored there instead.

    Args:
        points: corners (R, Z), shape (n, 2), in the mesh's unit of length, the solid to their left.
        fillets: radius at each point, 0 leaves it sharp; or one for all corners. Ends of an open profile have none,
            but an end on R = 0 may (the tip of a cone).
        closed: the last point is joined to the first.

    Raises:
        InputError: fewer than two different points, a fillet without a corner or too large for it, a profile that
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
        self._set(pieces, closed)

    @classmethod
    def of_pieces(cls, pieces: Sequence[Line | Arc], closed: bool = False) -> Tool:
        """Return a tool from lines and arcs that follow one another; joints need not be smooth.

        Raises:
            InputError: a piece that is neither, is not finite or has no length, pieces that do not follow one another,
                a profile that doubles back or crosses itself.
        """
        tool = cls.__new__(cls)
        instance("Tool.of_pieces: closed", closed, bool, "True or False")
        tool._set(several("Tool.of_pieces: pieces", pieces, "Line(...) and Arc(...)"), closed)
        return tool

    def _set(self, pieces: list[Line | Arc], closed: bool) -> None:
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
        """Distance of points x, shape (n, 2), to the profile, positive inside the tool, shape (n,)."""
        return self.nearest(x).distance

    def nearest(self, x: np.ndarray) -> Nearest:
        """Signed distance of points x, shape (n, 2), its gradient and its curvature."""
        return Nearest(*nearest(as_points("Tool: x", x), self._table, self._lines))

    def moved(self, r: float = 0.0, z: float = 0.0) -> Tool:
        """Return the tool shifted by (r, z), lengths."""
        by = np.array([finite("Tool.moved: r", r), finite("Tool.moved: z", z)])
        return self._with([Line(p.a + by, p.b + by) if isinstance(p, Line) else p._replace(centre=p.centre + by)
                           for p in self.pieces])

    def turned(self, angle: float) -> Tool:
        """Return the tool turned about the origin, counter-clockwise, degrees (plane strain)."""
        a = math.radians(finite("Tool.turned: angle", angle))
        Q = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
        return self._with([Line(Q @ p.a, Q @ p.b) if isinstance(p, Line)
                           else p._replace(centre=Q @ p.centre, start=p.start + a) for p in self.pieces])

    def mirrored(self) -> Tool:
        """Return the tool upside down: Z becomes -Z."""
        flip = np.array([1.0, -1.0])
        return self._with([Line(p.b * flip, p.a * flip) if isinstance(p, Line)
                           else Arc(p.centre * flip, p.radius, -p.start - p.sweep, p.sweep)
                           for p in reversed(self.pieces)])

    def reversed(self) -> Tool:
        """Return the tool whose solid is on the other side of the profile."""
        return self._with([p.backwards for p in reversed(self.pieces)])

    def outline(self, per_arc: int = 24) -> np.ndarray:
        """Points along the profile for drawing, shape (n, 2)."""
        parts = [_sampled(p, per_arc) for p in self.pieces]
        return np.vstack([parts[0], *(part[1:] for part in parts[1:])])

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """See `RigidTool.surface`: the points of `outline`, and the numbers of the ends of each of its pieces."""
        points = self.outline()
        numbers = np.arange(len(points))
        return points, np.stack([numbers[:-1], numbers[1:]], 1)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest (R, Z) of the outline, shape (2, 2)."""
        points = self.outline()
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def __repr__(self) -> str:
        arcs = sum(isinstance(p, Arc) for p in self.pieces)
        numbers = ((len(self.pieces) - arcs, "line"), (arcs, "arc"))
        kinds = " and ".join(f"{n} {kind}{'s' * (n > 1)}" for n, kind in numbers if n)
        ends = np.array([self.pieces[0].ends[0], self.pieces[-1].ends[1]])
        first, last = np.where(np.abs(ends) < 1e-12 * self.size, 0.0, ends)
        return f"Tool({kinds}{', closed, from' if self.closed else ' from'} {_show(first)} to {_show(last)})"

    def _with(self, pieces: list) -> Tool:
        return Tool.of_pieces(pieces, self.closed)

    def _tabulate(self) -> None:
        """One row per piece and per sharp corner, for `nearest`: lines, then arcs and corners, arcs of no radius."""
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
                whole, sign = abs(p.sweep) >= TURN - _FLAT, math.copysign(1.0, p.sweep)
                start = p.start - sign * (math.pi / 2 * opens[0] + _FLAT)
                sweep = abs(p.sweep) + math.pi / 2 * (opens[0] + opens[1])
                arcs.append((*p.centre, 0.0, 0.0, sign, 0.0,
                             math.inf if whole or sweep >= TURN else sweep + 2 * _FLAT, p.radius, start))
        joints = list(zip(self.pieces, self.pieces[1:] + (self.pieces[:1] if self.closed else ())))
        corners = [(p.ends[1], _turn(p.angles[1], q.angles[0])) for p, q in joints] + [e for e in ends if e is not None]
        arcs += [(*c, 0.0, 0.0, math.copysign(1.0, turn), 0.0, math.inf, 0.0, 0.0)
                 for c, turn in corners if abs(turn) > _FLAT]
        self._lines = len(rows)
        self._table = np.array([(*row, 0.0, 0.0) for row in rows] + arcs)

    def _ends(self) -> tuple:
        """For both ends: (point, turn of the mirrored corner) on R = 0, else None: the profile goes on."""
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
        parts = [_sampled(p, _straight_pieces(p)) for p in self.pieces]
        a = np.concatenate([part[:-1] for part in parts])
        b = np.concatenate([part[1:] for part in parts])
        near, n = 1e-9 * self.size, len(a)
        closes = self.closed or math.dist(a[0], b[-1]) < near
        for i, j in overlapping(np.minimum(a, b) - near, np.maximum(a, b) + near):
            i, j = np.minimum(i, j), np.maximum(i, j)
            apart = (j - i > 1) & ~((i == 0) & (j == n - 1) & closes)
            i, j = i[apart], j[apart]
            u, v, w = b[i] - a[i], b[j] - a[j], a[j] - a[i]
            det = _cross(u, v)
            with np.errstate(divide="ignore", invalid="ignore"):
                s, t = _cross(w, v) / det, _cross(w, u) / det
            hit = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1) & np.isfinite(s)
            if hit.any():
                k = int(np.argmax(hit))
                raise InputError(f"Tool: the profile crosses itself near (R, Z) = {_show(a[i[k]] + s[k] * u[k])}")
            length = np.maximum(np.hypot(*u.T), 1e-300)
            both = np.stack([w, b[j] - a[i]])                                # parallel: one along the other
            across, lies = np.abs(_cross(u, both)) / length, (u * both).sum(-1) / length
            over = (across.max(0) < near) & (lies.max(0) > near) & (lies.min(0) < length - near)
            if over.any():
                raise InputError(f"Tool: the profile doubles back at (R, Z) = {_show(a[j[np.argmax(over)]])}")


def _rounded(points: np.ndarray, radii: list[float], closed: bool, each: bool) -> list[Line | Arc]:
    """Lines and tangent arcs through corners with fillets; each: a point with a fillet must be a corner."""
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
    """Return the arc that rounds a corner, which takes `cut` of its edges; at an open end only one half of it."""
    left = math.copysign(1.0, turn)
    start = corner - cut * np.array([math.cos(come), math.sin(come)])
    centre = start + left * radius * np.array([-math.sin(come), math.cos(come)])
    begin = come - left * math.pi / 2 + (0.0 if first else turn / 2)
    return Arc(centre, radius, begin, turn if first and second else turn / 2)


def _check_fit(points: np.ndarray, radii: list[float], lengths: dict, cut: list[float]) -> None:
    """Raise an InputError if two fillets take more of an edge than there is."""
    for (i, j), length in lengths.items():
        if cut[i] + cut[j] > length * (1 + 1e-9):
            k = i if cut[i] >= cut[j] else j
            raise InputError(f"Tool: fillet at point {k} = {radii[k]:g} is too large for its corner {_show(points[k])}:"
                             f" the edge from {_show(points[i])} to {_show(points[j])} is {length:.6g} long and its"
                             f" fillets take {cut[i] + cut[j]:.6g}; at most"
                             f" {radii[k] * max(length - cut[i] - cut[j] + cut[k], 0) / cut[k]:.6g} fits")


def _checked(piece: Line | Arc, i: int) -> Line | Arc:
    """Return a piece of a profile, its numbers as floats."""
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
    """Angle from one direction of travel to the next, in (-pi, pi]."""
    return math.pi - (math.pi - (out - come)) % TURN


def _sampled(piece: Line | Arc, n: int) -> np.ndarray:
    if isinstance(piece, Line):
        return np.array([piece.a, piece.b])
    angles = piece.start + piece.sweep * np.linspace(0, 1, n + 1)
    return piece.centre + piece.radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _straight_pieces(piece: Line | Arc) -> int:
    """Return the number of straight pieces in a search for crossings: 64 for a quarter of a turn, at least 4."""
    return 1 if isinstance(piece, Line) else max(4, math.ceil(256 * abs(piece.sweep) / TURN))


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _show(point: np.ndarray) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"
