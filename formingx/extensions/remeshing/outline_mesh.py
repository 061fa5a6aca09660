"""Mesh of the interior of a closed curved outline, made by gmsh: small elements at corners, boundary names kept."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import InputError
from ...findings import coordinates
from ...forms.outline import FINE_PIECES
from ...mesh import with_gmsh
from ...mesh.check import crossing_point
from ...mesh.grid import Grid, to_mesh
from ...mesh.mesh import Mesh
from ...mesh.nodes import without_round_off

_SIZE_GROWTH = 0.3
"""Growth of the element size per distance from a corner."""


def mesh_of_outline(edges: np.ndarray, names: Sequence[frozenset[str]], corners: np.ndarray, size: float, corner: float,
             layer: str, axisymmetric: bool, comm: Any, volume: float | None = None,
             outside: Callable[[np.ndarray, frozenset[str]], np.ndarray] = lambda points, names: points) -> Mesh:
    """Return a mesh of six-node triangles inside an outline, with second-order geometry along it; on one rank.

    Edges, counter-clockwise, have ends and midpoint, shape (m, 3, 2), length, each with the `names` of its boundaries.
    Elements have `size`, and `corner` at `corners`, shape (k, 2). R is scaled to give `volume` (length^3, or length^2
    in plane strain). `outside` moves new outline points, shape (n, 2), out of tools. A crossing outline, or no mesh by
    gmsh, is an InputError.
    """
    turns = [k for k in range(len(edges)) if names[k] != names[k - 1] or (corners == edges[k, 0]).all(1).any()] or [0]
    ends, middles, named = [], [], []
    for first, last in zip(turns, [*turns[1:], turns[0] + len(edges)]):
        part = edges[np.arange(first, last) % len(edges)]
        points, between = _nodes_along(part, corners, size, corner)
        boundary = names[first % len(edges)]
        ends += [outside(points[:1], boundary | names[first - 1]), outside(points[1:-1], boundary)]
        middles.append(outside(between, boundary))
        named += [boundary] * len(between)
    ring, middle = np.concatenate(ends), np.concatenate(middles)
    n = len(ring)
    following = np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])
    if (place := crossing_point(ring, following)) is not None:          # gmsh might not end
        r, z = without_round_off(place, ring)
        raise InputError(f"remesh: the outline of the body crosses itself with elements of this size near (r, z) ="
                         f" {coordinates((r, z), 5)}: take a smaller Remesh(corner=) or Remesh(size=)")
    try:
        with with_gmsh.model("body") as gmsh:
            geo = gmsh.model.geo
            tags = [geo.addPoint(r, z, 0) for r, z in ring]
            lines = [geo.addLine(tags[k], tags[(k + 1) % n]) for k in range(n)]
            for line in lines:
                geo.mesh.setTransfiniteCurve(line, 2)
            geo.addPlaneSurface([geo.addCurveLoop(lines)])
            geo.synchronize()
            gmsh.model.mesh.generate(2)
            numbers, positions, _ = gmsh.model.mesh.getNodes()
            _, triangles = gmsh.model.mesh.getElementsByType(2)
    except Exception as error:
        raise InputError(f"remesh: gmsh made no mesh of the body: {error}") from None
    points = np.asarray(positions).reshape(-1, 3)[:, :2]
    points_at = {int(number): k for k, number in enumerate(numbers)}
    cells = np.array([points_at[int(t)] for t in triangles]).reshape(-1, 3)
    from scipy.spatial import cKDTree
    on_ring = np.asarray(cKDTree(points).query(ring)[1])
    curved = {tuple(sorted((int(on_ring[k]), int(on_ring[(k + 1) % n])))): middle[k] for k in range(n)}
    known: dict[tuple[int, ...], int] = {}
    extra: list[np.ndarray] = []

    def between_nodes(i: int, j: int) -> int:
        """Return the number of the node between nodes i and j, created at the first call."""
        key = (min(i, j), max(i, j))
        if key not in known:
            known[key] = len(points) + len(extra)
            extra.append(curved.get(key, (points[i] + points[j]) / 2))
        return known[key]
    six = np.array([[a, b, c, between_nodes(a, b), between_nodes(b, c), between_nodes(c, a)] for a, b, c in cells])
    nodes = np.concatenate([points, extra])
    boundaries: dict[str, Any] = {name: [] for name in sorted(frozenset().union(*named))}
    for k, edge_names in enumerate(named):
        i, j = int(on_ring[k]), int(on_ring[(k + 1) % n])
        for name in edge_names:
            boundaries[name].append([i, j, between_nodes(i, j)])
    new = np.stack([nodes[on_ring], nodes[np.roll(on_ring, -1)],
                    nodes[[between_nodes(int(i), int(j)) for i, j in zip(on_ring, np.roll(on_ring, -1))]]], 1)
    share = (volume or enclosed_volume(edges, axisymmetric)) / enclosed_volume(new, axisymmetric)
    nodes[:, 0] *= np.sqrt(share) if axisymmetric else share
    return to_mesh(lambda: Grid(nodes, np.arange(1, len(nodes) + 1), {layer: six},
                                {name: np.array(rows) for name, rows in boundaries.items()}), comm, "remesh")


def enclosed_volume(edges: np.ndarray, axisymmetric: bool) -> float:
    """Return the exact volume of revolution, length^3, or area, inside a closed outline of parabolic edges.

    Edges have first end, second end and midpoint, in counter-clockwise order, shape (m, 3, 2), length.
    """
    xi, weights = np.polynomial.legendre.leggauss(4)
    s = (1 + xi) / 2
    shapes = np.column_stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
    slopes = np.column_stack([4 * s - 3, 4 * s - 1, 4 - 8 * s])
    r, dz = (shapes @ edges)[..., 0], (slopes @ edges)[..., 1]
    return float(((np.pi * r**2 if axisymmetric else r) * dz * weights / 2).sum())


def without_pockets(edges: np.ndarray, touched: np.ndarray, depth: float) -> np.ndarray:
    """Return the edges of the outline, shape (m, 3, 2), with shallow pockets between body and tool closed.

    Nodes between two contact nodes, `touched` (k, 2), move onto their line if all are within `depth`, length.
    """
    nodes, n = edges[:, [0, 2]].reshape(-1, 2).copy(), 2 * len(edges)
    close = 1e-6 * np.ptp(nodes, axis=0).max()
    on = np.flatnonzero(np.linalg.norm(nodes[:, None] - touched[None], axis=2).min(1, initial=np.inf) < close)
    for a, b in zip(on, np.roll(on, -1)):
        between, along = (a + np.arange(1, (b - a) % n)) % n, nodes[b] - nodes[a]
        offsets, length = nodes[between] - nodes[a], np.linalg.norm(along)
        if length > 0 and np.abs(offsets[:, 0] * along[1] - offsets[:, 1] * along[0]).max(initial=0.0) < depth * length:
            nodes[between] = nodes[a] + np.linspace(0, 1, len(between) + 2)[1:-1, None] * along
    return np.stack([nodes[::2], np.roll(nodes[::2], -1, axis=0), nodes[1::2]], axis=1)


def refined_points(edges: np.ndarray, names: list[frozenset[str]],
                    touched: list[tuple[str, np.ndarray]]) -> np.ndarray:
    """Return points (k, 2), length, for small elements: corners between contacts, and ends of areas `touched`."""
    faces = {on for on, _ in touched}
    found = []
    pressed, close = np.zeros(len(edges), dtype=bool), 1e-6 * np.ptp(edges[:, 0], axis=0).max()
    for on, points in touched:
        if len(points):
            distance = np.linalg.norm(edges[:, 2][:, None] - points[None], axis=2).min(1)
            pressed |= np.array([on in boundaries for boundaries in names]) & (distance < close)
    for k in range(len(edges)):
        a, b = names[k - 1] & faces, names[k] & faces
        if a and b and (a != b or pressed[k] != pressed[k - 1]):
            found.append(edges[k, 0])
    return np.array(found).reshape(-1, 2)


def _nodes_along(edges: np.ndarray, corners: np.ndarray, size: float, corner: float) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes of new elements along a line of edges: ends, shape (n + 1, 2), and midpoints, shape (n, 2).

    Edges have shape (m, 3, 2); elements have `size`, and `corner` at the positions `corners`, (k, 2), length.
    """
    parameter = np.linspace(0, len(edges), FINE_PIECES * len(edges) + 1)

    def points_at(t: np.ndarray) -> np.ndarray:
        """Return points of the line at parameters t, shape (n, 2)."""
        k = np.minimum(t.astype(int), len(edges) - 1)
        s = t - k
        shapes = np.column_stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
        return np.einsum("nk,nki->ni", shapes, edges[k])
    x = points_at(parameter)
    distance = np.linalg.norm(x[:, None] - corners[None], axis=2).min(1) if len(corners) else np.full(len(x), np.inf)
    h = np.minimum(size, corner + _SIZE_GROWTH * distance)
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    number = np.concatenate([[0.0], np.cumsum(steps * (1 / h[1:] + 1 / h[:-1]) / 2)])
    n = max(int(np.ceil(number[-1] - 0.3)), 1)
    t = np.interp(number[-1] * np.arange(2 * n + 1) / (2 * n), number, parameter)
    t[0], t[-1] = 0.0, len(edges)
    points = points_at(t)
    return points[::2], points[1::2]
