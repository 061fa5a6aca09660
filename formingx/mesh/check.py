"""Validity of a mesh: the elements cover a connected body once, without gaps, and none is degenerate."""

from collections.abc import Iterator

import numpy as np

from .._jit import CFunctions
from ..errors import InputError
from ..findings import coordinates
from ..values.tolerances import FAR, ROUND_OFF
from .boxes import overlapping
from .edges import edges_of

_C = CFunctions("mesh/check.c")


def check_elements(points: np.ndarray, triangles: np.ndarray, what: str) -> None:
    """Raise an InputError, with the position, for invalid triangles in the reference configuration.

    Nodes (n, 2), length, triangles (m, 3 or 6) must be finite, not inverted or overlapping, in one piece.
    """
    bad = np.flatnonzero(~np.isfinite(points).all(1))
    if len(bad):
        raise InputError(f"{what}: a node has the coordinates {show(points[bad[0]])}: must be finite numbers")
    size = float(np.ptp(points, axis=0).max())
    if not 1 / FAR < size < FAR or np.abs(points).max() > FAR:
        raise InputError(f"{what}: it is {size:.3g} large: must be between {1 / FAR:g} and {FAR:g}")
    corners = points[triangles[:, :3]]
    area = _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = np.max([((corners[:, i] - corners[:, i - 1]) ** 2).sum(1) for i in range(3)], axis=0)
    flat = np.abs(area) <= ROUND_OFF * longest
    if flat.any():
        raise InputError(f"{what}: {flat.sum()} elements are flat, their corners lie on one line, one at"
                         f" {show(corners[flat][0].mean(0))}")
    inside_out = inverted(points[triangles])
    if inside_out.any():
        raise InputError(f"{what}: {inside_out.sum()} elements are turned inside out, one at"
                         f" {show(corners[inside_out][0].mean(0))}: a node is out of place, or a curved edge bent too"
                         f" much for them: use smaller elements there")
    _check_middles(points, triangles, what)
    outline = _outline(points, triangles[:, :3], np.sign(area), what)
    place = crossing_point(points, outline)
    if place is not None:
        raise InputError(f"{what}: the body touches or crosses itself near {show(place)}: elements that meet share"
                         f" their nodes, and none may lie over another")
    piece = connected_pieces(triangles[:, :3])
    if piece.max() > 0:
        first, other = (show(corners[np.argmax(piece == k)].mean(0)) for k in (0, piece.max()))
        raise InputError(f"{what}: the body is in pieces: no elements lead from {first} to {other}; bodies apart need a"
                         f" scene each")


def connected_pieces(triangles: np.ndarray) -> np.ndarray:
    """Return the number of the connected piece of each triangle (m, 3), shape (m,), 0 for the lowest node."""
    nodes, corners = np.unique(triangles, return_inverse=True)
    corners, piece = corners.reshape(-1, 3), np.arange(len(nodes))
    while True:
        found = piece[corners]
        if np.array_equal(found.min(1), found.max(1)):
            return found[:, 0]
        np.minimum.at(piece, found.ravel(), np.repeat(found.min(1), 3))
        piece = piece[piece]


def _check_middles(points: np.ndarray, triangles: np.ndarray, what: str) -> None:
    """Raise an InputError unless each edge of triangles (m, 6) has its own mid-edge node in points (n, 2), length."""
    if triangles.shape[1] != 6:
        return
    rows = np.concatenate([np.column_stack([np.sort(triangles[:, [i, j]], axis=1), triangles[:, k]])
                           for i, j, k in ((0, 1, 3), (1, 2, 4), (2, 0, 5))])
    rows = np.unique(rows, axis=0)
    edges, middles = np.unique(rows[:, :2], axis=0, return_counts=True)
    middle, owners = np.unique(rows[:, 2], return_counts=True)
    if np.any(middles > 1):
        raise InputError(f"{what}: the edge at {show(points[edges[middles > 1][0]].mean(0))} has two middle nodes:"
                         f" elements that meet share all three nodes of their edge")
    wrong = (owners > 1) | np.isin(middle, triangles[:, :3])
    if np.any(wrong):
        raise InputError(f"{what}: the node at {show(points[middle[wrong][0]])} is the middle of an edge, and of"
                         f" another one too or a corner")


def inverted(nodes: np.ndarray) -> np.ndarray:
    """Return the mask (m,) of triangles (m, 6, 2) whose Jacobian vanishes or changes sign; (m, 3, 2): False."""
    if nodes.shape[1] != 6:
        return np.zeros(len(nodes), dtype=bool)
    a, b, c, ab, bc, ac = (nodes[:, i] for i in range(6))
    found = []
    for x, y in ((0, 0), (1, 0), (0, 1), (0.5, 0.5), (0, 0.5), (0.5, 0)):
        z = 1 - x - y
        by_x = (1 - 4 * z) * a + (4 * x - 1) * b + 4 * y * (bc - ac) + 4 * (z - x) * ab
        by_y = (1 - 4 * z) * a + (4 * y - 1) * c + 4 * x * (bc - ab) + 4 * (z - y) * ac
        found.append(_cross(by_x, by_y))
    turns = np.array(found)
    return (turns.max(0) >= 0) & (turns.min(0) <= 0)


def _outline(points: np.ndarray, triangles: np.ndarray, turn: np.ndarray, what: str) -> np.ndarray:
    """Return the edges of the outline, which belong to one element only, as node numbers, shape (k, 2).

    `turn` is 1 for counter-clockwise triangles, (m, 3), else -1. Two on one side of an edge are an InputError.
    """
    directed, edges, numbers, times = edges_of(triangles)
    side = np.where(directed[:, 0] < directed[:, 1], 1, -1) * np.tile(turn, 3)           # side of the element
    sides = np.zeros(len(edges))
    np.add.at(sides, numbers, side)
    overlaps = (times > 2) | (times == 2) & (sides != 0)
    if overlaps.any():
        raise InputError(f"{what}: elements lie over each other at {show(points[edges[overlaps][0]].mean(0))}: each"
                         f" edge must have one element on each side")
    return edges[times == 1]


def crossing_point(points: np.ndarray, edges: np.ndarray) -> np.ndarray | None:
    """Return the middle, (2,), of an edge (k, 2) that crosses another or touches it off a common node; or None."""
    pairs = next(crossing_edges(points, edges), None)
    return None if pairs is None else points[edges[pairs[0, 0]]].mean(0)


def crossing_edges(points: np.ndarray, edges: np.ndarray) -> Iterator[np.ndarray]:
    """Yield pairs (m, 2), m > 0, of edges (k, 2) of points (n, 2), length, that cross or touch off a common node."""
    low, high = points[edges].min(1), points[edges].max(1)
    tolerance = ROUND_OFF * float((high - low).max())
    for first, second in overlapping(low - tolerance, high + tolerance):
        crosses = np.zeros(len(first))
        _C.cross(len(first), first, second, points, edges, crosses)
        if crosses.any():
            yield np.column_stack([first, second])[crosses > 0]


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the cross products u x v of vectors in the plane, shape (...), from shapes (..., 2)."""
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def show(point: np.ndarray) -> str:
    """Return a point, shape (2 or 3,), as text for messages."""
    return f"{'(R, Z)' if len(point) == 2 else '(x, y, z)'} = {coordinates(point, 6)}"
