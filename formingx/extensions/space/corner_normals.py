r"""Normals of a smooth surface at the corners of the triangles of an STL file, which has none.

A curve of constant curvature from a to b, with the unit normals N at its ends, satisfies

.. math:: (N_a + N_b) \cdot (x_b - x_a) = 0.

On planes, cylinders and spheres, and on fillets between them, all edges satisfy this with the exact normals. So the
normals are fitted to these equations by least squares. Edges at which triangles meet at more than a crease angle are
sharp, and have different normals on their two sides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ...mesh.edges import edges_of
from .patches import area_vectors, sides_of_edges, unit

_REDUCTION = 0.95          # of a crease angle, over the largest turn of the edges at a normal that tilts too much
_COPLANAR = 1e-4           # angle between triangles below which they are coplanar, radians
_FILE_PRECISION = 2e-7     # error of coordinates in a file of 32-bit numbers, over the largest coordinate
_ACROSS = 1e-2             # weight of a pair of vertices across an edge, over that of an edge
_TIKHONOV = 1e-3           # weight of the mean normals of the triangles around a corner
_ITERATIONS = 12           # of the least-squares fit
_CONVERGED = 1e-8          # largest change of a normal at which the fit ends
_SLOW = 0.2                # ratio of two successive changes above which the equations are factorised again
_HALF_TURN = 0.1           # of the ratio of two turns from 1/2, at which a plane ends in a curved surface
_AHEAD = 0.7               # cosine of the largest angle between edges that count as parallel
_TIP_ANGLE = 0.15          # angle of triangles to the mean normal at a vertex from which it may be a tip, radians
_TIP_SPREAD = 0.2          # least ratio of the spreads of normals in two directions at a tip
_PAIRS = 5_000_000         # pairs of edges that are compared at once


class Borders(NamedTuple):
    """Edges between regions of coplanar triangles, seen from one side.

    Attributes:
        side: number of the side, k m + t for edge k of triangle t, shape (b,).
        region: region on this side, shape (b,).
        beyond: region on the other side, shape (b,).
        turn: angle between the two triangles, shape (b,), radians.
        away: unit vectors out of the region, in its plane and across the edge, shape (b, 3).
    """

    side: np.ndarray
    region: np.ndarray
    beyond: np.ndarray
    turn: np.ndarray
    away: np.ndarray


def corner_normals(points: np.ndarray, triangles: np.ndarray, crease: float) -> np.ndarray:
    """Return unit normals of a smooth surface at the corners of triangles, shape (m, 3, 3).

    crease: angle from which an edge is sharp, degrees; 0: flat triangles. It is reduced until no normal tilts from that
    of its triangle by more than this angle, as beside an edge that is just below it.
    """
    facet, limit = unit(area_vectors(points, triangles))[:, None], np.radians(crease)
    i, j = (side % len(triangles) for side in sides_of_edges(triangles))
    turn = turns(facet[:, 0], i, j)
    while limit > _COPLANAR:
        groups = corner_groups(points, triangles, limit)
        normals = fitted_normals(points, triangles, groups, limit)[groups]
        tilted = np.linalg.norm(normals - facet, axis=2) > 2 * np.sin(np.radians(crease) / 2)
        if not tilted.any():
            return normals
        touched = np.zeros(len(points), dtype=bool)           # vertices of such triangles
        touched[triangles[tilted]] = True
        near = touched[triangles].any(1)
        limit = _REDUCTION * turn[(near[i] | near[j]) & (turn < limit)].max(initial=0.0)
    return np.repeat(facet, 3, axis=1)


def misfit(points: np.ndarray, triangles: np.ndarray, normals: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the misfit of normals, shape (m, 3, 3), to smooth edges over the turns there, and its worst place.

    Both are root mean squares, weighted with the areas of the triangles. The place has the shape (3,), length.
    """
    m, area = len(triangles), area_vectors(points, triangles)
    i, j = sides_of_edges(triangles)
    s, k, t, l = i % m, i // m, j % m, j // m
    turn = turns(unit(area), s, t)
    ends = normals[s, k], normals[s, (k + 1) % 3]
    jump = np.linalg.norm(ends[0] - normals[t, (l + 1) % 3], axis=1) + np.linalg.norm(ends[1] - normals[t, l], axis=1)
    a, b = points[triangles[s, k]], points[triangles[s, (k + 1) % 3]]
    found = np.abs(((ends[0] + ends[1]) * unit(b - a)).sum(1)) / 2
    size = np.linalg.norm(area, axis=1)
    weight = np.where((jump < _CONVERGED) & (turn > _COPLANAR), size[s] + size[t], 0.0)
    if not weight.any():
        return 0.0, points.mean(0)
    worst = int(np.argmax(weight * found**2))
    return float(np.sqrt(weight @ found**2 / (weight @ turn**2))), (a[worst] + b[worst]) / 2


def turns(facet: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Return the angles between pairs (i, j) of triangles, shape (k,), radians, exact for small angles."""
    return np.asarray(2 * np.arcsin(np.clip(np.linalg.norm(facet[i] - facet[j], axis=1) / 2, 0, 1)))


def corner_groups(points: np.ndarray, triangles: np.ndarray, crease: float) -> np.ndarray:
    """Return the number of the group of each corner of each triangle, shape (m, 3).

    crease: radians. The corners of a group are at one vertex and have one normal: edges that are not sharp connect
    their triangles. At a tip, such as that of a cone, each corner is a group.
    """
    m, facet = len(triangles), unit(area_vectors(points, triangles))
    i, j = sides_of_edges(triangles)
    smooth = turns(facet, i % m, j % m) < crease
    i, j = i[smooth], j[smooth]
    groups = _connected(m, i, j, np.zeros(len(points), dtype=bool), triangles)
    tips = _tips(points, triangles, groups, facet, i, j)
    return _connected(m, i, j, tips, triangles) if tips.any() else groups


def _connected(m: int, i: np.ndarray, j: np.ndarray, tips: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return groups (m, 3) of corners that smooth edges, sides i and j (k,), connect, except at `tips`, mask (n,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    s, k, t, l = i % m, i // m, j % m, j // m
    a = np.concatenate([3 * s + k, 3 * s + (k + 1) % 3])
    b = np.concatenate([3 * t + (l + 1) % 3, 3 * t + l])
    kept = ~tips[triangles.ravel()[a]]
    graph = coo_array((np.ones(kept.sum()), (a[kept], b[kept])), shape=(3 * m, 3 * m))
    return np.asarray(connected_components(graph, directed=False)[1].reshape(m, 3))


def _tips(points: np.ndarray, triangles: np.ndarray, groups: np.ndarray, facet: np.ndarray, i: np.ndarray,
          j: np.ndarray) -> np.ndarray:
    """Return the mask of the vertices that are tips, shape (n,).

    groups: shape (m, 3). i, j: sides of smooth edges, shape (k,). At a tip normals differ from their mean in all
    directions, and the triangles turn against the next by less than half that angle; at the pole of a sphere by that
    angle or more.
    """
    m, n = len(triangles), int(groups.max()) + 1
    turn = np.zeros(3 * m)                                    # at side k m + t, 0 at a crease
    turn[i] = turn[j] = turns(facet, i % m, j % m)
    N = mean_normals(points, triangles, groups)
    tilt = np.repeat(facet[:, None], 3, axis=1) - N[groups]
    away = np.linalg.norm(tilt, axis=2)
    ahead = turn.reshape(3, m).T[:, [1, 2, 0]]                # across the edge opposite to each corner
    count = np.bincount(groups.ravel(), minlength=n)
    straight = np.bincount(groups.ravel(), (ahead < away / 2).ravel(), n) > 0.9 * count
    least = np.full(n, np.inf)
    np.minimum.at(least, groups.ravel(), away.ravel())
    spread = np.zeros((n, 3, 3))
    np.add.at(spread, groups.ravel(), np.einsum("mki,mkj->mkij", tilt, tilt).reshape(-1, 3, 3))
    value = np.linalg.eigvalsh(spread)
    tip = straight & (least > _TIP_ANGLE) & (value[:, 1] > _TIP_SPREAD * value[:, 2])
    found = np.zeros(len(points), dtype=bool)
    found[triangles[tip[groups]]] = True
    return found


def mean_normals(points: np.ndarray, triangles: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return for each group of corners the mean normal of its triangles, weighted with their angles, shape (groups, 3).
    """
    corners, facet = points[triangles], unit(area_vectors(points, triangles))
    N = np.zeros((int(groups.max()) + 1, 3))
    for k in range(3):
        p, q = unit(corners[:, (k + 1) % 3] - corners[:, k]), unit(corners[:, (k + 2) % 3] - corners[:, k])
        angle = np.arccos(np.clip((p * q).sum(1), -1, 1))
        np.add.at(N, groups[:, k], angle[:, None] * facet)
    return unit(N)


def flat_directions(points: np.ndarray, triangles: np.ndarray, crease: float
                    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the plane of each triangle, or -1, shape (m,), and the k edges across which a region is straight.

    For each edge: triangle, number (0, 1, 2), direction across it in the plane, (k, 3). A region is connected and
    coplanar. A facet of a curved surface turns as much against one neighbour as against the next. A plane beside a
    fillet turns half as much against its first facet as this one against the second; so does a cylinder along its
    rulings, where a torus follows: a region of two triangles or more is straight where this ratio is near 1/2. crease:
    radians.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    m, area = len(triangles), area_vectors(points, triangles)
    facet, corners = unit(area), points[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2).max(1)
    error = _FILE_PRECISION * np.abs(points).max() * longest / np.maximum(np.linalg.norm(area, axis=1), 1e-300)
    i, j = sides_of_edges(triangles)
    s, t = i % m, j % m
    turn = turns(facet, s, t)
    same = turn < np.maximum(_COPLANAR, 2 * (error[s] + error[t]))
    graph = coo_array((np.ones(same.sum()), (s[same], t[same])), shape=(m, m))
    region = connected_components(graph, directed=False)[1]
    borders = _borders(points, triangles, facet, region, turn, (i, j), ~same & (turn < crease))
    large = np.bincount(region) > 1
    rows = np.flatnonzero(large[borders.region])
    ratio = borders.turn[rows] / _turn_ahead(borders, rows)
    straight = np.zeros(len(borders.side), dtype=bool)
    straight[rows] = np.abs(ratio - 0.5) < _HALF_TURN
    bent = np.zeros(len(large), dtype=bool)
    bent[borders.region[~straight]] = True
    ends = _borders(points, triangles, facet, region, turn, (i, j), ~same & (turn >= crease))
    ruled = np.flatnonzero(large[ends.region] & bent[ends.region])
    ruled = ruled[~_bends_behind(borders._replace(turn=np.where(straight, 0.0, borders.turn)), ends, ruled)]
    side = np.concatenate([borders.side[straight], ends.side[ruled]])
    return (np.where((large & ~bent)[region], region, -1), side % m, side // m,
            np.concatenate([borders.away[straight], ends.away[ruled]]))


def _borders(points: np.ndarray, triangles: np.ndarray, facet: np.ndarray, region: np.ndarray, turn: np.ndarray,
             sides: tuple[np.ndarray, np.ndarray], kept: np.ndarray) -> Borders:
    """Return some edges between regions, from both sides.

    region: of each triangle, shape (m,). turn: angles at k edges, shape (k,), radians. sides: both sides, shape (k,)
    each. kept: mask, shape (k,).
    """
    m, (i, j) = len(triangles), sides
    side, opposite = np.concatenate([i[kept], j[kept]]), np.concatenate([j[kept], i[kept]])
    k, own = side // m, side % m
    way = unit(points[triangles[own, (k + 1) % 3]] - points[triangles[own, k]])
    return Borders(side, region[own], region[opposite % m], np.tile(turn[kept], 2), np.cross(way, facet[own]))


def _turn_ahead(borders: Borders, rows: np.ndarray) -> np.ndarray:
    """Return the largest turn at the far side of the regions beyond borders `rows`, shape (k,), radians, or inf."""
    found = np.zeros(len(rows))
    for near, far in _pairs(borders.beyond[rows], borders.region):
        row = rows[near]
        ahead = (borders.beyond[far] != borders.region[row]) & (
            np.einsum("ni,ni->n", borders.away[far], borders.away[row]) > _AHEAD)
        np.maximum.at(found, near[ahead], borders.turn[far[ahead]])
    return np.where(found > 0, found, np.inf)


def _bends_behind(borders: Borders, ends: Borders, rows: np.ndarray) -> np.ndarray:
    """Return the mask of sharp edges from which their region leads to a curved surface at its far side, shape (k,).

    Between two sharp edges, as a facet of a cone, it has no curvature from one to the other. `borders` are smooth.
    """
    found = np.zeros(len(rows), dtype=bool)
    for near, far in _pairs(ends.region[rows], borders.region):
        behind = (borders.turn[far] > 0) & (
            np.einsum("ni,ni->n", borders.away[far], ends.away[rows[near]]) < -_AHEAD)
        found[near[behind]] = True
    return found


def _pairs(wanted: np.ndarray, regions: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield all pairs (p, q) with wanted[p] equal to regions[q], shapes (k,) and (b,), in moderate blocks."""
    order = np.argsort(regions, kind="stable")
    first = np.searchsorted(regions[order], wanted)
    count, begin = np.searchsorted(regions[order], wanted, side="right") - first, 0
    ends = np.cumsum(count)
    while begin < len(wanted):
        end = max(begin + 1, int(np.searchsorted(ends, (ends[begin - 1] if begin else 0) + _PAIRS)))
        part = np.arange(begin, end)
        near = np.repeat(part, count[part])
        start = first[part] - (ends[part] - count[part] - ends[begin] + count[begin])
        yield near, order[np.arange(len(near)) + np.repeat(start, count[part])]
        begin = end


def fitted_normals(points: np.ndarray, triangles: np.ndarray, groups: np.ndarray, crease: float) -> np.ndarray:
    """Return the normals of the groups of corners, fitted to edges of constant curvature, shape (groups, 3).

    These equations leave modes of alternating tilt and bulging planes. So normals of planes are given, normals have no
    part along straight directions (`flat_directions`), and pairs across an edge have equations of small weight.
    """
    from scipy.sparse import coo_array, diags_array
    area, n = area_vectors(points, triangles), int(groups.max()) + 1
    facet, N = unit(area), mean_normals(points, triangles, groups)
    plane, tri, side, way = flat_directions(points, triangles, crease)
    given = np.zeros((n, 3))
    for k in range(3):
        np.add.at(given, groups[plane >= 0, k], area[plane >= 0])
    fixed = given.any(1)
    N[fixed] = unit(given[fixed])
    flat = np.ones(n, dtype=bool)                             # corners whose triangles are all coplanar
    for k in range(3):
        np.logical_and.at(flat, groups[:, k], np.linalg.norm(facet - N[groups[:, k]], axis=1) < _COPLANAR)
    fixed |= flat
    if fixed.all():
        return N
    free, column = np.flatnonzero(~fixed), np.full(n, -1)
    column[free] = np.arange(len(free))
    rows, weight, e = _equations(points, triangles, groups)
    ends = np.concatenate([groups[tri, side], groups[tri, (side + 1) % 3]])       # N . way = 0
    rows, weight = np.vstack([rows, np.column_stack([ends, ends])]), np.append(weight, np.ones(len(ends)))
    e = np.concatenate([e, way, way])
    used = (column[rows] >= 0).any(1)
    rows, weight, e = rows[used], weight[used], e[used]
    start, ends, i = N.copy(), rows.ravel(), np.repeat(np.arange(len(rows)), 2)
    inside, before, factors = column[ends] >= 0, np.inf, None
    for _ in range(_ITERATIONS):
        if factors is None:
            t1 = unit(np.cross(np.eye(3)[np.abs(N).argmin(1)], N))
            t2 = np.cross(N, t1)
            blocks = [coo_array(((np.einsum("ij,ij->i", np.repeat(e, 2, 0), t[ends]) * np.repeat(weight, 2))[inside],
                                 (i[inside], column[ends][inside] + s * len(free))), shape=(len(rows), 2 * len(free)))
                      for s, t in enumerate((t1, t2))]
            J = (blocks[0] + blocks[1]).tocsr()
            factors = _factorised((J.T @ J + diags_array(np.full(2 * len(free), _TIKHONOV**2))).tocsr())
        off = (N - start)[free]
        tilt = np.concatenate([(off * t1[free]).sum(1), (off * t2[free]).sum(1)])
        residual = weight * ((N[rows[:, 0]] + N[rows[:, 1]]) * e).sum(1)
        step = factors(-J.T @ residual - _TIKHONOV**2 * tilt)
        N[free] = unit(N[free] + step[:len(free), None] * t1[free] + step[len(free):, None] * t2[free])
        size = np.abs(step).max()
        if size < _CONVERGED:
            break
        if size > _SLOW * before:                             # the factors of an earlier iteration are too far off
            factors = None
        before = size
    return N


def _factorised(matrix: Any) -> Callable[[np.ndarray], np.ndarray]:
    """Return the solver for right-hand sides (n,) of a symmetric positive definite scipy matrix, by MUMPS factors."""
    from petsc4py import PETSc
    first, columns = (part.astype(PETSc.IntType) for part in (matrix.indptr, matrix.indices))
    A = PETSc.Mat().createAIJ(matrix.shape, csr=(first, columns, matrix.data), comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    factors = PETSc.PC().create(PETSc.COMM_SELF)
    factors.setOperators(A)
    factors.setType("cholesky")
    factors.setFactorSolverType("mumps")
    factors.setUp()
    x, b = A.createVecs()

    def solve(right: np.ndarray) -> np.ndarray:
        """Return the solution for a right-hand side, shape (n,)."""
        b.setArray(right)
        factors.apply(b, x)
        return np.array(x.array_r)
    return solve


def _equations(points: np.ndarray, triangles: np.ndarray, groups: np.ndarray
               ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the equations N_a.e + N_b.e = 0 of groups: pairs (k, 2), weights (k,) and unit vectors e (k, 3)."""
    x = np.zeros((int(groups.max()) + 1, 3))
    x[groups.ravel()] = points[triangles.ravel()]
    apex = np.concatenate([groups[:, (i + 2) % 3] for i in range(3)])
    edges = edges_of(groups)[1]
    across = np.column_stack([apex[side] for side in sides_of_edges(groups)])
    across = across[across[:, 0] != across[:, 1]]
    rows = np.vstack([edges, across])
    weight = np.concatenate([np.ones(len(edges)), np.full(len(across), _ACROSS)])
    return rows, weight, unit(x[rows[:, 1]] - x[rows[:, 0]])
