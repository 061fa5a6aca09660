"""Division of a closed surface of triangles into bodies, and of the bodies into groups that do not overlap.

A body is a set of triangles connected by edges. The signed distance to a face that lies inside another body is
meaningless. The signed distance to a union of bodies is the largest of their signed distances (positive inside), which
is exact outside. Bodies whose bounding boxes overlap therefore belong to different groups.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...io.stl import volume
from ...mesh.edges import edges_of


def separate_bodies(points: np.ndarray, triangles: np.ndarray, caller: str) -> list[np.ndarray]:
    """Return the bodies of a closed surface, in groups: row numbers of their triangles, shape (k,) each.

    Groups have disjoint bounding boxes; a cavity belongs to the body around it. points: shape (n, 3), length;
    triangles: shape (m, 3). Triangles that look inward and are no cavity are an InputError.
    """
    parts = _parts(points, triangles)
    bodies = [triangles[part] for part in parts]
    boxes = np.array([[points[body].min((0, 1)), points[body].max((0, 1))] for body in bodies])
    volumes = np.array([volume(points, body) for body in bodies])
    full = [k for k in np.argsort(-volumes) if volumes[k] > 0]
    whole = {k: [parts[k]] for k in full}
    for k in np.flatnonzero(volumes <= 0):
        around = [i for i in full if (boxes[i, 0] <= boxes[k, 0]).all() and (boxes[k, 1] <= boxes[i, 1]).all()]
        if not around:
            place = "(" + ", ".join(f"{x:.6g}" for x in boxes[k].mean(0)) + ")"
            raise InputError(f"{caller} has a body around {place} that is inside out: its triangles look inward: turn"
                             f" them in"
                             f" the program that wrote the file")
        whole[around[-1]].append(parts[k])                        # the smallest
    groups: list[list[int]] = []
    for k in full:
        free = [group for group in groups if not any(_overlap(boxes[k], boxes[i]) for i in group)]
        if free:
            free[0].append(k)
        else:
            groups.append([k])
    return [np.sort(np.concatenate([part for k in group for part in whole[k]])) for group in groups]


def merged(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices (n, 3) within 1e-7 of the extent; return them (k, 3), and the triangles not degenerate (l, 3)."""
    size = max(float(np.ptp(points, axis=0).max(initial=0.0)), 1e-300)
    _, first, same = np.unique(np.round(points / size, 7), axis=0, return_index=True, return_inverse=True)
    triangles = same.ravel()[triangles]
    a, b, c = triangles.T
    return points[first], triangles[(a != b) & (b != c) & (c != a)]


def _parts(points: np.ndarray, triangles: np.ndarray) -> list[np.ndarray]:
    """Return for each body the indices of its k triangles in `triangles`, shape (k,).

    A body is a set of triangles, shape (m, 3), connected by edges. At an edge of more than two triangles, only the two
    with the solid between them are connected.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    n, (directed, edges, edge, times) = len(triangles), edges_of(triangles)
    link, count = edge.copy(), len(edges)
    for k in np.flatnonzero(times > 2):
        sides = np.flatnonzero(edge == k)
        for wedge in _wedges(points, triangles[sides % n], directed[sides], edges[k]):
            link[sides[wedge]], count = count, count + 1
    graph = coo_array((np.ones(3 * n), (np.tile(np.arange(n), 3), n + link)), shape=(n + count,) * 2)
    number, body = connected_components(graph, directed=False)
    order = np.argsort(body[:n], kind="stable")
    return [part for part in np.split(order, np.searchsorted(body[order], np.arange(1, number))) if len(part)]


def _wedges(points: np.ndarray, triangles: np.ndarray, directed: np.ndarray, edge: np.ndarray) -> list[np.ndarray]:
    """Return the pairs of triangles at a common edge with solid between them, as row numbers of `triangles`, (2,) each.

    Triangles, shape (m, 3), counter-clockwise from outside, are sorted by their angle about the edge. Solid lies after
    one with the edge as (edge[1], edge[0]), up to the next with the opposite order (`directed`, shape (m, 2)). At equal
    angles the one that ends the solid comes first.
    """
    forward = directed[:, 0] == edge[0]
    along = points[edge[1]] - points[edge[0]]
    along /= np.linalg.norm(along)
    tips = points[triangles.sum(1) - edge.sum()] - points[edge[0]]
    tips -= np.outer(tips @ along, along)
    across = tips[0] / np.linalg.norm(tips[0])
    angle = np.round(np.arctan2(tips @ np.cross(along, across), tips @ across) % (2 * np.pi), 6)
    order = np.lexsort((~forward, np.where(angle > 6.283185, 0.0, angle)))
    begin = int(np.argmin(forward[order]))                   # the first that begins a wedge
    order = np.roll(order, -begin)
    return [order[k:k + 2] for k in range(0, len(order) - 1, 2)]


def _overlap(box: np.ndarray, other: np.ndarray) -> bool:
    """Return True if the bounding boxes `box` and `other` overlap: (lowest, highest) corner, shape (2, 3), length."""
    return bool((box[0] <= other[1]).all() and (other[0] <= box[1]).all())
