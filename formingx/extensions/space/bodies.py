"""The bodies of a closed surface of triangles: which triangles hang together, and which bodies may be looked at as one.

Where bodies overlap, each has faces inside the other, to which a distance means nothing: that of their union is the
largest of theirs (positive inside), exact outside. So each body that may overlap another is looked at by itself.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...io.stl import volume


def apart(points: np.ndarray, triangles: np.ndarray, who: str) -> list[np.ndarray]:
    """Groups of triangles: bodies whose boxes do not overlap, each with the hollows in it.

    Raises:
        InputError: a body is inside out: a hollow that is in no other body.
    """
    bodies = [triangles[part] for part in _parts(triangles)]
    boxes = np.array([[points[body].min((0, 1)), points[body].max((0, 1))] for body in bodies])
    volumes = np.array([volume(points, body) for body in bodies])
    full = [k for k in np.argsort(-volumes) if volumes[k] > 0]
    whole = {k: [bodies[k]] for k in full}
    for k in np.flatnonzero(volumes <= 0):
        around = [i for i in full if (boxes[i, 0] <= boxes[k, 0]).all() and (boxes[k, 1] <= boxes[i, 1]).all()]
        if not around:
            at = "(" + ", ".join(f"{x:.6g}" for x in boxes[k].mean(0)) + ")"
            raise InputError(f"{who} has a body around {at} that is inside out: its triangles look inward: turn them in"
                             f" the program that wrote the file")
        whole[around[-1]].append(bodies[k])                        # the smallest
    groups: list[list[int]] = []
    for k in full:
        free = [group for group in groups if not any(_overlap(boxes[k], boxes[i]) for i in group)]
        if free:
            free[0].append(k)
        else:
            groups.append([k])
    return [np.concatenate([part for k in group for part in whole[k]]) for group in groups]


def _parts(triangles: np.ndarray) -> list[np.ndarray]:
    """Numbers of the triangles of each body: what hangs together by edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    n = len(triangles)
    ends = np.sort(np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    edges, edge = np.unique(ends, axis=0, return_inverse=True)
    graph = coo_array((np.ones(3 * n), (np.tile(np.arange(n), 3), n + edge.ravel())), shape=(n + len(edges),) * 2)
    number, body = connected_components(graph, directed=False)
    order = np.argsort(body[:n], kind="stable")
    return np.split(order, np.searchsorted(body[order], np.arange(1, number)))


def _overlap(one: np.ndarray, other: np.ndarray) -> bool:
    return bool((one[0] <= other[1]).all() and (other[0] <= one[1]).all())
