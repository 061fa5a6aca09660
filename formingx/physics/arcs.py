"""A smooth curve as circular arcs that touch it at their ends, with its tangents there (biarcs), to a tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..errors import InputError
from .profile import Arc, Line

_DEEPEST = 14              # halvings of a curve


def arcs_along(curve: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], tolerance: float,
               name: str) -> list[Line | Arc]:
    """Arcs (and lines) within `tolerance` (length) of a curve.

    Args:
        curve: gives points and derivatives, both of shape (n, 2), at parameters from 0 to 1, shape (n,).
        name: begins the message.

    Raises:
        InputError: the curve is not smooth enough for it, or too long for the tolerance.
    """
    def between(low: float, high: float, depth: int) -> list[Line | Arc]:
        points, along = curve(np.linspace(low, high, 17))
        lengths = np.hypot(*along.T)
        if not np.all(np.isfinite(points)) or not lengths[[0, -1]].min() > 0:
            raise InputError(f"{name}: it has a corner or no direction near ({points[0, 0]:.6g}, {points[0, 1]:.6g})")
        found = _biarc(points[0], along[0] / lengths[0], points[-1], along[-1] / lengths[-1])
        if found and np.min([_away(points, piece) for piece in found], axis=0).max() <= tolerance:
            return found
        if depth == _DEEPEST:
            raise InputError(f"{name}: 2^{_DEEPEST} arcs are not within tolerance = {tolerance:g} of it")
        middle = (low + high) / 2
        return between(low, middle, depth + 1) + between(middle, high, depth + 1)
    return between(0.0, 1.0, 0)


def _biarc(p: np.ndarray, t: np.ndarray, q: np.ndarray, s: np.ndarray) -> list[Line | Arc]:
    """Two arcs from p with the unit tangent t to q with s, with one tangent where they meet; [] if there are none.

    The joint is midway between p + d t and q - d s, the control points at one distance d from the ends.
    """
    v, both = q - p, t + s
    a, b, c = 2 * (1 - t @ s), 2 * (v @ both), v @ v
    if a > 1e-12:
        d = (-b + math.sqrt(b * b + 4 * a * c)) / (2 * a)
    elif b > 0:
        d = c / b
    else:
        return []
    joint = (p + d * t + q - d * s) / 2
    first, last = _arc_from(p, t, joint), _arc_from(q, -s, joint)
    return [first, last.backwards] if d > 0 and first is not None and last is not None else []


def _arc_from(p: np.ndarray, t: np.ndarray, q: np.ndarray) -> Line | Arc | None:
    """The arc from p with the unit tangent t to q; a line if it is one; None if it is neither."""
    w = q - p
    across, ahead, length = t[0] * w[1] - t[1] * w[0], float(t @ w), math.hypot(*w)
    if not length > 0:
        return None
    if abs(across) < 1e-9 * length:
        return Line(p, q) if ahead > 0 else None
    radius = length**2 / (2 * across)                      # to the left if positive
    centre = p + radius * np.array([-t[1], t[0]])
    return Arc(centre, abs(radius), math.atan2(*(p - centre)[::-1]), 2 * math.atan2(across, ahead))


def _away(points: np.ndarray, piece: Line | Arc) -> np.ndarray:
    """Distance of points, shape (n, 2), from the line or circle of a piece, shape (n,)."""
    if isinstance(piece, Arc):
        return np.abs(np.hypot(*(points - piece.centre).T) - piece.radius)
    way = (piece.b - piece.a) / math.dist(piece.a, piece.b)
    return np.abs((points - piece.a) @ (-way[1], way[0]))
