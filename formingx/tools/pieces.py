"""Lines and circular arcs of a profile, and the fillets between the lines of a polyline."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..errors import InputError, finite, pair, positive
from ..findings import coordinates
from ..values.tolerances import ROUND_OFF

TURN = 2 * math.pi
"""Angle of a full circle, radians."""

_ON_PROFILE = 1e-6
"""Largest distance of a point that lies on a profile, over the size of the profile."""


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
        """First and last point (R, Z) of the line, shape (2,) each, length."""
        return self.a, self.b

    @property
    def angles(self) -> tuple[float, float]:
        """Polar angles of the direction of the line at its first and last point, which are equal, radians."""
        angle = math.atan2(self.b[1] - self.a[1], self.b[0] - self.a[0])
        return angle, angle

    @property
    def reversed(self) -> Line:
        """The line from its last point to its first."""
        return Line(self.b, self.a)


class Arc(NamedTuple):
    """Circular piece of a profile.

    Attributes:
        centre: centre (R, Z), length.
        radius: radius, length; 0 for a sharp corner.
        start: polar angle of the first point as seen from the centre, radians.
        sweep: angle of the arc, positive if it turns left, radians.
    """

    centre: np.ndarray
    radius: float
    start: float
    sweep: float

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last point (R, Z) of the arc, shape (2,) each, length."""
        first, last = (self.centre + self.radius * np.array([math.cos(a), math.sin(a)])
                       for a in (self.start, self.start + self.sweep))
        return first, last

    @property
    def angles(self) -> tuple[float, float]:
        """Polar angles of the direction along the arc at its first and last point, radians."""
        quarter = math.copysign(math.pi / 2, self.sweep)
        return self.start + quarter, self.start + self.sweep + quarter

    @property
    def reversed(self) -> Arc:
        """The arc from its last point to its first."""
        return self._replace(start=self.start + self.sweep, sweep=-self.sweep)


def rounded(points: np.ndarray, radii: list[float], closed: bool, each: bool) -> list[Line | Arc]:
    """Return the lines and tangent arcs of a polyline (n, 2), length, with a fillet radius for each corner.

    `closed` joins the last corner to the first; `each` refuses a fillet at a straight point. A fillet without corner or
    too large is an InputError.
    """
    n, size = len(points), float(np.ptp(points, axis=0).max())
    edges = [(i, (i + 1) % n) for i in range(n if closed else n - 1)]
    lengths = {e: math.dist(points[e[0]], points[e[1]]) for e in edges}
    for (i, j), length in lengths.items():
        if length <= ROUND_OFF * size:
            raise InputError(f"Tool: points {i} and {j} are the same, {coordinates(points[i], 6)}")
    angle = {e: math.atan2(*(points[e[1]] - points[e[0]])[::-1]) for e in edges}
    before = {j: (i, j) for i, j in edges}
    after = {i: (i, j) for i, j in edges}
    cut, arcs = [0.0] * n, {}
    for i, radius in enumerate(radii):
        if radius == 0:
            continue
        outgoing = angle[after[i]] if i in after else None
        incoming = angle[before[i]] if i in before else None
        if outgoing is None or incoming is None:
            if abs(points[i][0]) > ROUND_OFF * size:
                raise InputError(f"Tool: fillet at point {i} = {radius!r}: an open end has no corner to round")
            outgoing, incoming = (-incoming if outgoing is None else outgoing,             # type: ignore[operator]
                                  -outgoing if incoming is None else incoming)             # type: ignore[operator]
        turn = turn_angle(incoming, outgoing)
        if abs(turn) < ROUND_OFF:
            if each:
                raise InputError(f"Tool: fillet at point {i} = {radius!r}: the profile runs straight on there: it has"
                                 f" no corner to round")
            continue
        cut[i] = radius * math.tan(abs(turn) / 2)
        arcs[i] = _fillet(points[i], radius, cut[i], incoming, turn, i in before, i in after)
    _check_fit(points, radii, lengths, cut)
    pieces: list[Line | Arc] = [arcs[0]] if 0 in arcs and not closed else []
    for i, j in edges:
        direction = (points[j] - points[i]) / lengths[i, j]
        if lengths[i, j] - cut[i] - cut[j] > ROUND_OFF * size:
            pieces.append(Line(points[i] + cut[i] * direction, points[j] - cut[j] * direction))
        if j in arcs:
            pieces.append(arcs[j])
    return pieces


def with_polyline(pieces: tuple[Line | Arc, ...], points: np.ndarray, radii: list[float], size: float
                  ) -> list[Line | Arc]:
    """Return a profile whose part between two places is replaced by a polyline with fillets (`Tool.with_piece`).

    points, shape (n, 2), and radii: corners (R, Z) and fillets; size: of the profile; lengths.
    """
    first, last = (_places(pieces, point, size) for point in (points[0], points[-1]))
    if first[0] > last[0]:
        points, radii, first, last = points[::-1], radii[::-1], last, first
    (i, u), (j, v) = first[0], last[-1]
    if math.dist(points[0], points[-1]) <= ROUND_OFF * size:
        raise InputError(f"Tool.with_piece: the first and the last point are the same, {coordinates(points[0], 6)}")
    corners, begin, end = list(points), pieces[i].ends[0], pieces[j].ends[1]
    if u > -math.inf and math.dist(begin, points[0]) > _ON_PROFILE * size:
        corners, radii = [begin, *corners], [0.0, *radii]
    if v < math.inf and math.dist(end, points[-1]) > _ON_PROFILE * size:
        corners, radii = [*corners, end], [*radii, 0.0]
    return [*pieces[:i], *rounded(np.array(corners), radii, False, True), *pieces[j + 1:]]


def _places(pieces: tuple[Line | Arc, ...], point: np.ndarray, size: float) -> list[tuple[int, float]]:
    """Return number and arc length of the lines of a profile on which a point lies.

    A point on R = 0 stands for an end of the profile on R = 0, with the arc length -inf or inf.
    """
    if abs(point[0]) <= _ON_PROFILE * size:
        ends = [(math.dist(end, point), place) for end, place in (
            (pieces[0].ends[0], (0, -math.inf)), (pieces[-1].ends[1], (len(pieces) - 1, math.inf)))
            if abs(end[0]) <= _ON_PROFILE * size]
        if ends:
            return [min(ends)[1]]
    found, nearest = [], []
    for k, piece in enumerate(pieces):
        if isinstance(piece, Line):
            length = math.dist(*piece.ends)
            along = float(np.clip((point - piece.a) @ (piece.b - piece.a) / length, 0.0, length))
            foot = piece.a + along / length * (piece.b - piece.a)
            nearest.append((math.dist(foot, point), foot))
            if nearest[-1][0] <= _ON_PROFILE * size:
                found.append((k, along))
    if not found:
        near = min(nearest, key=lambda entry: entry[0], default=None)
        raise InputError(f"Tool.with_piece: the point {coordinates(point, 6)} is on no line of the profile"
                         + (f": the nearest one is {coordinates(near[1], 6)}" if near else ", which has arcs alone"))
    return found


def _fillet(corner: np.ndarray, radius: float, cut: float, incoming: float, turn: float, first: bool,
            second: bool) -> Arc:
    """Return the arc that rounds a corner, (2,), between two edges, each shortened by `cut`, length.

    Angles are in radians, the turn positive to the left. At an end on the axis one edge is the mirror image, and half
    of the arc is returned.
    """
    side = math.copysign(1.0, turn)
    start = corner - cut * np.array([math.cos(incoming), math.sin(incoming)])
    centre = start + side * radius * np.array([-math.sin(incoming), math.cos(incoming)])
    begin = incoming - side * math.pi / 2 + (0.0 if first else turn / 2)
    return Arc(centre, radius, begin, turn if first and second else turn / 2)


def _check_fit(points: np.ndarray, radii: list[float], lengths: dict, cut: list[float]) -> None:
    """Raise an InputError if two fillets are together longer than their edge.

    Corners have shape (n, 2); `cut` is the length by which a fillet shortens its edges.
    """
    for (i, j), length in lengths.items():
        if cut[i] + cut[j] > length * (1 + ROUND_OFF):
            k = i if cut[i] >= cut[j] else j
            corner, a, b = (coordinates(points[n], 6) for n in (k, i, j))
            raise InputError(f"Tool: fillet at point {k} = {radii[k]:g} is too large for its corner {corner}:"
                             f" the edge from {a} to {b} is {length:.6g} long and its"
                             f" fillets take {cut[i] + cut[j]:.6g}; at most"
                             f" {radii[k] * max(length - cut[i] - cut[j] + cut[k], 0) / cut[k]:.6g} fits")


def checked(piece: Line | Arc, i: int) -> Line | Arc:
    """Return piece number i with floats; one that is no line or arc, not finite or of length 0 is an InputError."""
    caller = f"Tool: piece {i}"
    if isinstance(piece, Line):
        a, b = (np.array(pair(f"{caller}: an end", p)) for p in piece)
        if not math.dist(a, b) > 1e-12 * max(np.abs(a).max(), np.abs(b).max()):
            raise InputError(f"{caller}: a line from {coordinates(a, 6)} to {coordinates(b, 6)} has no length")
        return Line(a, b)
    if not isinstance(piece, Arc):
        raise InputError(f"{caller} = {piece!r}: must be a Line or an Arc")
    centre = np.array(pair(f"{caller}: centre", piece.centre))
    arc = Arc(centre, positive(f"{caller}: radius", piece.radius), finite(f"{caller}: start", piece.start),
              finite(f"{caller}: sweep", piece.sweep))
    if not ROUND_OFF < abs(arc.sweep) <= TURN * (1 + 1e-12):
        raise InputError(f"{caller}: sweep = {arc.sweep!r}: must be an angle in radians, not 0, at most a full turn")
    return arc


def turn_angle(incoming: float, outgoing: float) -> float:
    """Return the angle between polar angles of directions, positive to the left, radians, in (-pi, pi]."""
    return math.pi - (math.pi - (outgoing - incoming)) % TURN


def sampled(piece: Line | Arc, n: int) -> np.ndarray:
    """Return n + 1 evenly spaced points on an arc, shape (n + 1, 2), or the ends of a line, shape (2, 2), length."""
    if isinstance(piece, Line):
        return np.array([piece.a, piece.b])
    angles = piece.start + piece.sweep * np.linspace(0, 1, n + 1)
    return piece.centre + piece.radius * np.column_stack([np.cos(angles), np.sin(angles)])


def number_of_chords(piece: Line | Arc) -> int:
    """Return the number of chords that replace a piece in the search for crossings: 64 per 90 degrees, at least 4."""
    return 1 if isinstance(piece, Line) else max(4, math.ceil(256 * abs(piece.sweep) / TURN))
