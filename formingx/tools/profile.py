"""Rigid tools with a profile of straight lines and circular arcs.

A fillet is an arc, a sharp corner an arc of radius 0. So the profile is smooth between corners, and the distance to it
is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._jit import CFunctions
from ..errors import InputError, as_list, as_points, check_type, finite, non_negative, pair
from ..findings import coordinates
from ..mesh.boxes import overlapping
from ..values.tolerances import ROUND_OFF
from .pieces import (
    TURN,
    Arc,
    Line,
    checked,
    number_of_chords,
    rounded,
    sampled,
    turn_angle,
    with_polyline,
)

_C = CFunctions("tools/nearest.c")


class Nearest(NamedTuple):
    """Geometry of a profile at the closest points to n given points.

    Attributes:
        distance: signed distance, positive inside the tool, shape (n,), length.
        normal: gradient of the distance, which points into the tool, shape (n, 2).
        curvature: curvature of the level line of the distance, shape (n,), 1/length. The second derivatives of the
            distance are curvature * t t^T with the unit tangent t.
    """

    distance: np.ndarray
    normal: np.ndarray
    curvature: np.ndarray

    @property
    def tangent(self) -> np.ndarray:
        """Unit tangent of the profile: the normal rotated left by 90 degrees, shape (n, 2)."""
        return self.normal[:, ::-1] * (-1.0, 1.0)


class Tool:
    """Rigid tool defined by its profile in the (R, Z) plane.

    Beyond its ends, an open profile continues along its end pieces. At an end on R = 0 it is mirrored instead.

    Args:
        points: corners (R, Z), shape (n, 2), length; the solid lies to their left.
        fillets: fillet radius of each corner, 0 for a sharp one, or one radius for all corners, length. Ends of an open
            profile have none, except on R = 0 (the tip of a cone).
        closed: True to join the last point to the first.

    Attributes:
        pieces: lines and arcs in their order along the profile.
        closed: True if the last point is the first.
        size: largest extent of the profile, or its largest arc radius if that is larger, length.
        table: numbers of the pieces for functions in C, lines first, shape (pieces, 9). A line has origin, direction,
            0, lowest and highest length, 0, 0. An arc has centre, 0, 0, sense (1: left), 0, angle, radius, first polar
            angle.
        lines: number of lines.
        sized: False for a plane, which is a single line and has no end.

    Raises:
        InputError: fewer than two different points, a fillet without a corner or too large for it, or a profile that
            crosses itself.

    >>> step = fx.Tool([(0, 2), (3, 2), (4, 0), (9, 0)], fillets=[0, 0.5, 0.2, 0])
    >>> step.signed_distance([(0.0, 2.1), (8.0, -0.3)]).round(6).tolist()          # above 0: inside
    [0.1, -0.3]
    """

    components = 2

    def __init__(self, points: Sequence[Sequence[float]], fillets: float | Sequence[float] = 0.0, closed: bool = False):
        check_type("Tool: closed", closed, bool, "True or False")
        corners = np.array([pair("Tool: points", p) for p in as_list("Tool: points", points, "points (R, Z)")])
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
        pieces = rounded(corners, radii, closed, each)
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
        check_type("Tool.of_pieces: closed", closed, bool, "True or False")
        tool._set_pieces(as_list("Tool.of_pieces: pieces", pieces, "Line(...) and Arc(...)"), closed)
        return tool

    def _set_pieces(self, pieces: list[Line | Arc], closed: bool) -> None:
        """Store lines and arcs, `closed` or not; none, a gap, reversal or crossing is an InputError."""
        pieces = [checked(piece, i) for i, piece in enumerate(pieces)]
        if not pieces:
            raise InputError("Tool: a profile needs at least one piece, a Line or an Arc")
        self.pieces, self.closed = tuple(pieces), closed
        ends = np.array([e for p in pieces for e in p.ends])
        self.size = float(max(np.ptp(ends, axis=0).max(), max((p.radius for p in pieces if isinstance(p, Arc)),
                                                              default=0.0)))
        for i, (p, q) in enumerate(zip(pieces, pieces[1:] + (pieces[:1] if closed else []))):
            if math.dist(p.ends[1], q.ends[0]) > 1e-6 * self.size:
                raise InputError(f"Tool: piece {i} ends at {coordinates(p.ends[1], 6)}, the next begins at"
                                 f" {coordinates(q.ends[0], 6)}: the pieces of a profile must follow one another")
            if math.pi - abs(turn_angle(p.angles[1], q.angles[0])) < 1e-6:
                raise InputError(f"Tool: the profile doubles back at (R, Z) = {coordinates(p.ends[1], 6)}")
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
        """Return the signed distance of points from the profile, its gradient, and the curvature of its level lines.

        Args:
            x: points, shape (n, 2), length.

        Returns:
            Distances, positive inside the tool, shape (n,), length; gradients, shape (n, 2); curvatures, shape (n,),
            1/length.
        """
        if type(x) is not np.ndarray or x.dtype != float or x.shape[1:] != (2,):
            x = as_points("Tool: x", x)
        n = len(x)
        distance, normal, curvature = np.empty(n), np.empty((n, 2)), np.empty(n)
        _C.nearest(n, x, len(self.table), self.lines, self.table, distance, normal, curvature)
        return Nearest(distance, normal, curvature)

    @property
    def sized(self) -> bool:
        return len(self.pieces) > 1 or isinstance(self.pieces[0], Arc)

    def moved(self, r: float = 0.0, z: float = 0.0) -> Tool:
        """Return the tool shifted in its plane.

        Args:
            r: shift along R, length.
            z: shift along Z, length.
        """
        shift = np.array([finite("Tool.moved: r", r), finite("Tool.moved: z", z)])
        return self._with_pieces([Line(p.a + shift, p.b + shift) if isinstance(p, Line)
                                  else p._replace(centre=p.centre + shift) for p in self.pieces])

    def turned(self, angle: float) -> Tool:
        """Return the tool rotated counter-clockwise about the origin, for plane strain.

        Args:
            angle: angle of the rotation, degrees.
        """
        a = math.radians(finite("Tool.turned: angle", angle))
        Q = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
        return self._with_pieces([Line(Q @ p.a, Q @ p.b) if isinstance(p, Line)
                                  else p._replace(centre=Q @ p.centre, start=p.start + a) for p in self.pieces])

    def mirrored(self) -> Tool:
        """Return the tool upside down, mirrored at Z = 0; its solid is mirrored, too."""
        flip = np.array([1.0, -1.0])
        return self._with_pieces([Line(p.b * flip, p.a * flip) if isinstance(p, Line)
                                  else Arc(p.centre * flip, p.radius, -p.start - p.sweep, p.sweep)
                                  for p in reversed(self.pieces)])

    def reversed(self) -> Tool:
        """Return the tool whose solid lies on the other side of the same profile."""
        return self._with_pieces([p.reversed for p in reversed(self.pieces)])

    def with_piece(self, points: Sequence[Sequence[float]], fillets: float | Sequence[float] = 0.0) -> Tool:
        """Return the tool with a new piece of its profile: a stacking step, a ring of a thread, a chime.

        The new lines replace the part of the profile between the first and the last point. Both lie on straight lines
        of the profile, which the new fillets shorten. A point on R = 0 may lie beside a profile that ends on R = 0: it
        becomes the new end. The order of the points does not matter.

        Args:
            points: corners (R, Z) of the new piece, shape (n, 2), length.
            fillets: fillet radius of each corner, 0 for a sharp one, or one radius for all corners, length. A point
                at an end of the profile has none.

        Raises:
            InputError: fewer than two points, or another number of fillets. The first or the last point is on no line,
                a fillet is too large, or the profile crosses itself.

        >>> mould = fx.tools.cup(radius=30.0, depth=20.0)
        >>> step = mould.with_piece([(30.0, 4.0), (32.0, 4.0), (32.0, 0.0)], fillets=[0.3, 0.5, 0.0])
        >>> step.signed_distance([(31.0, 3.0), (31.0, 5.0)]).round(6).tolist()          # below 0: outside
        [-1.0, 1.0]
        """
        corners = np.array([pair("Tool.with_piece: points", p)
                            for p in as_list("Tool.with_piece: points", points, "points (R, Z)")])
        radii: list = list(np.asarray(fillets)) if np.ndim(fillets) > 0 else [fillets] * len(corners)
        if len(corners) < 2 or len(radii) != len(corners):
            raise InputError(f"Tool.with_piece: {len(corners)} points and {len(radii)} fillets: give at least two"
                             f" points, and one fillet, or one for each point")
        radii = [non_negative(f"Tool.with_piece: fillet at point {i}", r) for i, r in enumerate(radii)]
        return self._with_pieces(with_polyline(self.pieces, corners, radii, self.size))

    def outline(self, per_arc: int = 24) -> np.ndarray:
        """Return points along the profile for drawing, shape (n, 2), length.

        Args:
            per_arc: number of straight pieces per arc.
        """
        parts = [sampled(p, per_arc) for p in self.pieces]
        return np.vstack([parts[0], *(part[1:] for part in parts[1:])])

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return straight pieces that replace the profile, for drawing and for checks: 24 for each arc.

        Returns:
            Points along the profile, shape (n, 2), length; row numbers of the ends of each piece, shape (n - 1, 2).
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
        first, last = (coordinates(end, 6) for end in np.where(np.abs(ends) < 1e-12 * self.size, 0.0, ends))
        return f"Tool({kinds}{', closed, from' if self.closed else ' from'} {first} to {last})"

    def _with_pieces(self, pieces: list) -> Tool:
        """Return a tool of other lines and arcs, closed if this tool is closed."""
        return Tool.of_pieces(pieces, self.closed)

    def _tabulate(self) -> None:
        """Set `table`, shape (pieces, 9), from `pieces`: the lines, then arcs and sharp corners (arcs of radius 0).

        End pieces of an open profile are extended: lines without end, arcs by 90 degrees. Set `lines`, the number of
        lines, too.
        """
        rows, arcs = [], []     # origin, direction, sense (0: line), lowest and highest coordinate; arcs: radius, start
        tol = ROUND_OFF * self.size
        ends = self._ends()
        for i, p in enumerate(self.pieces):
            opens = (i == 0 and ends[0] is None, i == len(self.pieces) - 1 and ends[1] is None)
            if isinstance(p, Line):
                length = math.dist(p.a, p.b)
                rows.append((*p.a, *(p.b - p.a) / length, 0.0, -math.inf if opens[0] else -tol,
                             math.inf if opens[1] else length + tol))
            else:
                full, sign = abs(p.sweep) >= TURN - ROUND_OFF, math.copysign(1.0, p.sweep)
                start = p.start - sign * (math.pi / 2 * opens[0] + ROUND_OFF)
                sweep = abs(p.sweep) + math.pi / 2 * (opens[0] + opens[1])
                arcs.append((*p.centre, 0.0, 0.0, sign, 0.0,
                             math.inf if full or sweep >= TURN else sweep + 2 * ROUND_OFF, p.radius, start))
        joints = list(zip(self.pieces, self.pieces[1:] + (self.pieces[:1] if self.closed else ())))
        corners = [(p.ends[1], turn_angle(p.angles[1], q.angles[0])) for p, q in joints]
        corners += [end for end in ends if end is not None]
        arcs += [(*c, 0.0, 0.0, math.copysign(1.0, turn), 0.0, math.inf, 0.0, 0.0)
                 for c, turn in corners if abs(turn) > ROUND_OFF]
        self.lines = len(rows)
        self.table = np.array([(*row, 0.0, 0.0) for row in rows] + arcs)

    def _ends(self) -> tuple:
        """Return (point (R, Z), angle) of the corner with the mirror image at the axis for both ends, or None each.

        The direction turns by this angle, positive to the left, radians; a closed profile has 0, no corner.
        """
        if self.closed:
            return (np.zeros(2), 0.0), (np.zeros(2), 0.0)
        found = []
        for point, angle, last in ((self.pieces[0].ends[0], self.pieces[0].angles[0], False),
                                   (self.pieces[-1].ends[1], self.pieces[-1].angles[1], True)):
            on_axis = abs(point[0]) < ROUND_OFF * self.size
            turn = turn_angle(angle, -angle) if last else turn_angle(-angle, angle)
            slanted = abs(turn) > ROUND_OFF and abs(abs(turn) - math.pi) > ROUND_OFF
            found.append((point, turn) if on_axis and slanted else None)
        return tuple(found)

    def _check_crossing(self) -> None:
        """Raise an InputError if two pieces of the profile cross."""
        parts = [sampled(p, number_of_chords(p)) for p in self.pieces]
        a = np.concatenate([part[:-1] for part in parts])
        b = np.concatenate([part[1:] for part in parts])
        tolerance, n = ROUND_OFF * self.size, len(a)
        closes = self.closed or math.dist(a[0], b[-1]) < tolerance
        for i, j in overlapping(np.minimum(a, b) - tolerance, np.maximum(a, b) + tolerance):
            i, j = np.minimum(i, j), np.maximum(i, j)
            separate = (j - i > 1) & ~((i == 0) & (j == n - 1) & closes)
            i, j = i[separate], j[separate]
            u, v, w = b[i] - a[i], b[j] - a[j], a[j] - a[i]
            det = _cross(u, v)
            with np.errstate(divide="ignore", invalid="ignore"):
                s, t = _cross(w, v) / det, _cross(w, u) / det
            crosses = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1) & np.isfinite(s)
            if crosses.any():
                k = int(np.argmax(crosses))
                place = coordinates(a[i[k]] + s[k] * u[k], 6)
                raise InputError(f"Tool: the profile crosses itself near (R, Z) = {place}")
            length = np.maximum(np.hypot(*u.T), 1e-300)
            ends = np.stack([w, b[j] - a[i]])                                # parallel pieces that overlap
            distance, position = np.abs(_cross(u, ends)) / length, (u * ends).sum(-1) / length
            overlaps = (distance.max(0) < tolerance) & (position.max(0) > tolerance)
            overlaps &= position.min(0) < length - tolerance
            if overlaps.any():
                place = coordinates(a[j[np.argmax(overlaps)]], 6)
                raise InputError(f"Tool: the profile doubles back at (R, Z) = {place}")


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the cross products u x v of vectors in the plane, shape (...), from shapes (..., 2)."""
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
