r"""Smooth surface through the vertices of triangles: a curved patch on each triangle.

Each triangle with unit normals at its corners becomes a rational quartic Gregory patch, which meets its neighbours with
a common tangent plane (Walton and Meek, Computer-Aided Design 28 (1996) 113, doi 10.1016/0010-4485(95)00046-1). With
barycentric coordinates b and control points Q,

.. math:: S(b) = \sum_{i + j + k = 4} \frac{4!}{i!\,j!\,k!} b_1^i b_2^j b_3^k \, Q_{ijk}.

Each of the three inner control points is the mean of two points, one for each adjacent edge, with weights that depend
on b. An edge where two patches have different normals at their common corners is a crease: the surface is sharp there.
A triangle whose control points lie in its plane and on its straight edges is treated as flat.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..._jit import CFunctions
from ...mesh.edges import edges_of
from .lagged_friction import Distances

_C = CFunctions("extensions/space/patches.c")

_FLAT = 1e-9               # distance of control points from a flat triangle that is round-off, over the tool's size
_SHARP = 1e-3              # sine of the angle between two normals from which on an edge of patches is a crease
_MAX_GUESSES = 50          # numbers of points of which the last nearest triangles are kept, to begin the next search
_LARGEST_BULGE = 0.35      # of control points out of their triangle, over its longest edge: a patch beyond is made flat


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors divided by their lengths, shape (..., 3); a zero vector stays 0."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))


def area_vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return twice the area vectors of triangles, shape (m, 3), length^2."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a))


def sides_of_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two sides of each edge of exactly two triangles, shape (k,) each.

    Side k m + t is the edge of triangle t (of m) from its corner k to the next.
    """
    _, _, number, times = edges_of(triangles)
    order, starts = np.argsort(number, kind="stable"), np.concatenate([[0], np.cumsum(times)])
    two = np.flatnonzero(times == 2)
    return order[starts[two]], order[starts[two] + 1]


class PatchSurface:
    """Closed surface of patches, with its nearest points.

    points: shape (n, 3), length; triangles: shape (m, 3), counter-clockwise seen from outside; normals: unit normals at
    their corners, shape (m, 3, 3), of a flat triangle its own.

    Attributes:
        patches: control points of the patches, shape (m, 18, 3), length. The corners are the rows 0, 4 and 8.
        unresolved: mask of the triangles whose patch would bulge by more than a third of their longest edge, shape
            (m,). They are flat instead.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, normals: np.ndarray):
        m, corners = len(triangles), points[triangles]
        facet = unit(area_vectors(points, triangles))
        self.patches = control_points(corners, normals, _neighbours(triangles, normals))
        bulge = _bulges(self.patches, facet)
        self.unresolved = ~(bulge <= _LARGEST_BULGE * np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2).max(1))
        flat = self.unresolved | (bulge < _FLAT * np.ptp(points, axis=0).max())
        straight = np.repeat(facet[flat, None], 3, axis=1)
        self.patches[flat] = control_points(corners[flat], straight, np.stack([straight, straight], 2))
        self.patches = np.ascontiguousarray(self.patches)
        self._bulges = np.where(flat, 0.0, bulge)
        self._triangles = points, triangles, facet
        self._guesses: dict[int, np.ndarray] = {}            # {number of points: nearest triangles before}
        self._boxes = np.concatenate([self.patches.min(1), self.patches.max(1)], 1)
        nodes, links, self._order = np.zeros((2 * m, 6)), np.zeros((2 * m, 2), dtype=int), np.zeros(m, dtype=int)
        used = _C.build(m, self._boxes, nodes, links, self._order)
        self._nodes, self._links = nodes[:used].copy(), links[:used].copy()

    def distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distances of points, shape (n, 3), positive inside, shape (n,), length."""
        return self._nearest(x, False)[0].distance

    def distances(self, x: np.ndarray) -> Distances:
        """Return the signed distances of points, shape (n, 3), length, with first and second derivatives."""
        return self._nearest(x, True)[0]

    def nearest_triangles(self, x: np.ndarray) -> np.ndarray:
        """Return the numbers of the triangles whose patches are nearest to points, shape (n,)."""
        return self._nearest(x, False)[1]

    def positions(self, triangles: np.ndarray, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return points and outward unit normals, (n, 3) each, at barycentric coordinates of two corners, (n, 2)."""
        out = np.empty((len(triangles), 6, 3))
        _C.evaluate(len(triangles), triangles, self.patches, coordinates, out)
        return out[:, 0], unit(np.cross(out[:, 1], out[:, 2]))

    def _nearest(self, x: np.ndarray, derivatives: bool) -> tuple[Distances, np.ndarray]:
        """Return the distances of points (n, 3), length, optionally with derivatives, and nearest triangles (n,)."""
        n = len(x)
        d, normal, hessian = np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3))
        guess = self._guesses.pop(n, None)
        triangles, edge = np.full(n, -1) if guess is None else guess.copy(), np.zeros(n, dtype=int)
        _C.nearest(n, x, self._nodes, self._links, self._order, self._boxes, self._bulges, self.patches, d,
                   normal if derivatives else None, hessian if derivatives else None, triangles, edge)
        self._guesses[n] = triangles
        if len(self._guesses) > _MAX_GUESSES:
            del self._guesses[next(iter(self._guesses))]
        bulge = self._bulges.max()
        far = np.flatnonzero((d > 2 * bulge) | (d < -2 * bulge) & ((edge > 0) | self._folds[triangles]))
        if len(far) and bulge > 0:                          # patches that fold at an edge can give the wrong sign
            wrong = far[self._flat.distance(np.ascontiguousarray(x[far])) * d[far] < 0]
            for values in (d, normal, hessian)[:3 if derivatives else 1]:
                values[wrong] *= -1
        return Distances(d, normal, hessian), triangles

    @cached_property
    def _folds(self) -> np.ndarray:
        """Mask of the patches whose normal turns against that of their triangle at one of 10 points, shape (m,)."""
        found, rows = np.zeros(len(self.patches), dtype=bool), np.flatnonzero(self._bulges)
        for u, v in ((i / 3, j / 3) for i in range(4) for j in range(4 - i)):
            normal = self.positions(rows, np.tile([u, v], (len(rows), 1)))[1]
            found[rows] |= np.einsum("ni,ni->n", normal, self._triangles[2][rows]) < 0
        return found

    @cached_property
    def _flat(self) -> PatchSurface:
        """The flat triangles. A point farther from the patches than their bulges is on the same side of both."""
        points, triangles, facet = self._triangles
        return PatchSurface(points, triangles, np.repeat(facet[:, None], 3, axis=1))


def _neighbours(triangles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the normals (m, 3, 2, 3) of the neighbour across each edge at both ends; without one, the triangle's."""
    m = len(triangles)
    other = np.stack([np.stack([normals[:, k], normals[:, (k + 1) % 3]], 1) for k in range(3)], 1)
    i, j = sides_of_edges(triangles)
    for p, q in ((i, j), (j, i)):
        t, k, s, l = p % m, p // m, q % m, q // m
        other[t, k, 0], other[t, k, 1] = normals[s, (l + 1) % 3], normals[s, l]
    return other


def _bulges(patches: np.ndarray, facet: np.ndarray) -> np.ndarray:
    """Return the largest distance of the control points, shape (m, 18, 3), from flat triangles or edges, (m,), length.
    """
    corners = patches[:, [0, 4, 8]]
    chord = np.roll(corners, -1, 1) - corners
    off = patches[:, :12].reshape(-1, 3, 4, 3) - corners[:, :, None]
    share = np.einsum("mkji,mki->mkj", off, chord) / np.einsum("mki,mki->mk", chord, chord)[:, :, None]
    off = off - share[..., None] * chord[:, :, None]
    height = np.abs(np.einsum("mki,mi->mk", patches - corners[:, :1], facet)).max(1)
    return np.asarray(np.maximum(height, np.linalg.norm(off, axis=3).max((1, 2))))


def _end_tangent(chord: np.ndarray, normal: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the direction of the boundary curve at an end of each of m edges, shape (m, 3).

    It lies in the tangent plane, along a crease in that of the neighbour too. chord: length.
    """
    inside = unit(chord - (chord * normal).sum(1, keepdims=True) * normal)
    along = np.cross(normal, other)
    size = np.linalg.norm(along, axis=1, keepdims=True)
    along *= np.sign((along * chord).sum(1, keepdims=True))
    return np.where(size > _SHARP, along / np.maximum(size, 1e-300), inside)


def control_points(corners: np.ndarray, normals: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the control points of patches, shape (m, 18, 3), length; corners, normals: shape (m, 3, 3).

    Rows 4 k to 4 k + 3 lie on the boundary curve from corner k. Rows 12 + 2 k and 13 + 2 k are inner ones near corner
    k, for the edges from k to k + 1 and to k. other: normals of the neighbour across edge k at its two ends, shape (m,
    3, 2, 3), equal to `normals` at smooth edges.
    """
    m = len(corners)
    P, curve, leg = np.zeros((m, 18, 3)), np.zeros((m, 3, 5, 3)), np.zeros((m, 3, 3, 3))
    for k in range(3):
        l = (k + 1) % 3
        a, b = corners[:, k], corners[:, l]
        chord = b - a
        length = np.linalg.norm(chord, axis=1, keepdims=True)
        t_a = _end_tangent(chord, normals[:, k], other[:, k, 0])
        t_b = _end_tangent(chord, normals[:, l], other[:, k, 1])
        h_a, h_b = (2 * length / (3 * (1 + np.clip((t * chord).sum(1, keepdims=True) / length, 0.2, 1)))
                    for t in (t_a, t_b))                      # legs of the cubic curve nearest to a circular arc
        c1, c2 = a + h_a * t_a, b - h_b * t_b
        curve[:, k] = np.stack([a, (a + 3 * c1) / 4, (c1 + c2) / 2, (3 * c2 + b) / 4, b], 1)
        leg[:, k] = np.stack([c1 - a, c2 - c1, b - c2], 1)
        P[:, 4 * k:4 * k + 4] = curve[:, k, :4]
    for k in range(3):
        l, o, w = (k + 1) % 3, (k + 2) % 3, leg[:, k]
        A0, A2 = unit(np.cross(normals[:, k], w[:, 0])), unit(np.cross(normals[:, l], w[:, 2]))
        A1 = unit(A0 + A2)
        D0 = curve[:, o, 3] - (curve[:, k, 0] + curve[:, k, 1]) / 2
        D3 = curve[:, l, 1] - (curve[:, k, 3] + curve[:, k, 4]) / 2
        along0, along3 = _dot(D0, w[:, 0]) / _dot(w[:, 0], w[:, 0]), _dot(D3, w[:, 2]) / _dot(w[:, 2], w[:, 2])
        across0, across3 = _dot(D0, A0), _dot(D3, A2)
        D1 = (along0 * 2 * w[:, 1] + along3 * w[:, 0] + across0 * 2 * A1 + across3 * A0) / 3
        D2 = (along0 * w[:, 2] + 2 * along3 * w[:, 1] + across0 * A2 + 2 * across3 * A1) / 3
        P[:, 12 + 2 * k] = (curve[:, k, 1] + curve[:, k, 2]) / 2 + D1
        P[:, 13 + 2 * l] = (curve[:, k, 2] + curve[:, k, 3]) / 2 + D2
    return P


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar products of m pairs of vectors, shape (m, 1), for their shapes (m, 3)."""
    return np.asarray((a * b).sum(1, keepdims=True))
