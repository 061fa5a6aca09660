"""Approximation of a smooth curve by circular arcs that have its points and tangents at their ends (biarcs)."""

import math
from collections.abc import Callable

import numpy as np

from ..errors import InputError
from ..findings import coordinates
from ..values.tolerances import CURVE_POINTS
from .pieces import Arc, Line

_MIN_TOLERANCE = 1e-7  # smallest tolerance over the size of a curve


def arcs_along(curve: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], tolerance: float,
               name: str) -> list[Line | Arc]:
    """Return successive arcs and lines that approximate a curve, with equal tangents at their joints.

    The curve maps parameters from 0 to 1, (n,), to points and derivatives, (n, 2) each; `tolerance` is the largest
    distance, length. A kink or a small tolerance is an InputError.
    """
    size = float(np.ptp(curve(np.linspace(0, 1, 17))[0], axis=0).max())
    if tolerance < _MIN_TOLERANCE * size:
        raise InputError(f"{name}: tolerance = {tolerance:g}: must be at least {_MIN_TOLERANCE:g} of the curve's size,"
                         f" {_MIN_TOLERANCE * size:.3g}")
    made = 0

    def between(low: float, high: float) -> list[Line | Arc]:
        nonlocal made
        points, derivatives = curve(np.linspace(low, high, 17))
        lengths = np.hypot(*derivatives.T)
        if not np.all(np.isfinite(points)) or not lengths[[0, -1]].min() > 0:
            raise InputError(f"{name}: it has a corner or no direction near {coordinates(points[0], 6)}")
        found = _biarc(points[0], derivatives[0] / lengths[0], points[-1], derivatives[-1] / lengths[-1])
        if found and np.min([_distance_to(points, piece) for piece in found], axis=0).max() <= tolerance:
            made += len(found)
            return found
        # a corner is still farther away from a piece so short than the tolerance
        if size * (high - low)**1.5 < tolerance or made > CURVE_POINTS:
            raise InputError(f"{name}: {CURVE_POINTS} arcs, or one of {high - low:.2g} of the curve, are not within"
                             f" tolerance = {tolerance:g} of it")
        middle = (low + high) / 2
        return between(low, middle) + between(middle, high)
    return between(0.0, 1.0)


def in_plane(points: np.ndarray, name: str) -> np.ndarray:
    """Return (x, y) of points (n, 3) in the plane z = 0, length; another point is an InputError with `name`."""
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    outside = ~(np.abs(points[:, 2]) <= 1e-9 * max(np.abs(points[:, :2]).max(initial=0.0), 1e-300))
    if np.any(outside):
        x, y, z = points[np.argmax(outside)]
        raise InputError(f"{name} has the point {coordinates((x, y, z), 6)}: z must be 0: a profile is drawn in the"
                         f" x-y plane, x for R and y for Z")
    return points[:, :2]


def piece_through(points: np.ndarray, name: str) -> Line | Arc:
    """Return the line or the circular arc through points (R, Z) in their order, shape (n, 2), length.

    Points on neither, in another order, or fewer than four of an arc, are an InputError.
    """
    if not np.all(np.isfinite(points)):
        raise InputError(f"{name}: its coordinates are not all finite numbers")
    n, tolerance = len(points), _MIN_TOLERANCE * max(np.ptp(points, axis=0).max(initial=0.0), 1e-300)
    a, b = points[[0, -1]] if n > 1 else (np.zeros(2), np.zeros(2))
    chord = b - a
    distance = (points - a) @ (-chord[1], chord[0]) / max(math.hypot(*chord), tolerance)
    if n > 1 and math.hypot(*chord) > tolerance and np.abs(distance).max() <= tolerance:
        return Line(a, b)
    if n > 3:                                              # three points always lie on a circle
        p, q, r = points[[0, n // 3, 2 * n // 3]]
        centre = p + np.linalg.lstsq(2 * np.array([q - p, r - p]), [(q - p) @ (q - p), (r - p) @ (r - p)])[0]
        radius = math.dist(p, centre)
        if np.abs(np.hypot(*(points - centre).T) - radius).max() <= tolerance:
            angles = np.unwrap([math.atan2(*(x - centre)[::-1]) for x in points])
            if np.all(np.diff(angles) * (angles[-1] - angles[0]) > 0):
                return Arc(centre, radius, float(angles[0]), float(angles[-1] - angles[0]))
    raise InputError(f"{name} is neither a straight line nor a circular arc"
                     + (f" (of a mesh, {n} nodes; four are needed to know an arc)" if n < 4 else
                        "; give tolerance=..., a length, and one of .step, .brep or .dxf is taken for arcs that close"))


def _biarc(p: np.ndarray, t: np.ndarray, q: np.ndarray, s: np.ndarray) -> list[Line | Arc]:
    """Return two tangent arcs from p with the unit tangent t to q with the unit tangent s; [] if there are none.

    The joint is the midpoint of the control points p + d t and q - d s.
    """
    v, tangents = q - p, t + s
    a, b, c = 2 * (1 - t @ s), 2 * (v @ tangents), v @ v
    if a > 1e-12:
        d = (-b + math.sqrt(b * b + 4 * a * c)) / (2 * a)
    elif b > 0:
        d = c / b
    else:
        return []
    joint = (p + d * t + q - d * s) / 2
    first, last = _arc_from(p, t, joint), _arc_from(q, -s, joint)
    return [first, last.reversed] if d > 0 and first is not None and last is not None else []


def _arc_from(p: np.ndarray, t: np.ndarray, q: np.ndarray) -> Line | Arc | None:
    """Return the arc or the line from p with the unit tangent t to q; None if q lies at p or straight behind it."""
    w = q - p
    normal_distance, tangent_distance, length = t[0] * w[1] - t[1] * w[0], float(t @ w), math.hypot(*w)
    if not length > 0:
        return None
    if abs(normal_distance) < 1e-9 * length:
        return Line(p, q) if tangent_distance > 0 else None
    radius = length**2 / (2 * normal_distance)                      # to the left if positive
    centre = p + radius * np.array([-t[1], t[0]])
    return Arc(centre, abs(radius), math.atan2(*(p - centre)[::-1]), 2 * math.atan2(normal_distance, tangent_distance))


def _distance_to(points: np.ndarray, piece: Line | Arc) -> np.ndarray:
    """Return the distances of points, shape (n, 2), from the infinite line or full circle of `piece`, shape (n,)."""
    if isinstance(piece, Arc):
        return np.abs(np.hypot(*(points - piece.centre).T) - piece.radius)
    direction = (piece.b - piece.a) / math.dist(piece.a, piece.b)
    return np.abs((points - piece.a) @ (-direction[1], direction[0]))
