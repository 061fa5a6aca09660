"""Validity of the mesh of a surface in three dimensions: one connected layer of triangles that look to one side."""

import numpy as np

from ..errors import InputError
from ..values.tolerances import FAR, ROUND_OFF
from .check import check_elements, connected_pieces, show
from .edges import edges_of

_FOLD = -0.9
"""Cosine of the angle between the normals of two neighbouring triangles, below which the surface is folded over."""


def check_surface(points: np.ndarray, triangles: np.ndarray, what: str) -> None:
    """Raise an InputError, with the position, for invalid triangles of a surface; a flat one is checked in its plane.

    Nodes have shape (n, 3), length, triangles (m, 3). Elements must not be flat or folded, two may share an edge, and
    the surface is in one piece without coincident nodes.
    """
    middle = points.mean(0)
    plane = np.linalg.svd(points - middle, full_matrices=False)[2] if np.isfinite(points).all() else np.eye(3)
    size = float(np.ptp(points, axis=0).max())
    if np.ptp(points[:, 2]) == 0 or not np.isfinite(points).all():
        check_elements(points[:, :2], triangles, what)
        return
    if np.ptp((points - middle) @ plane[2]) <= ROUND_OFF * size:
        check_elements((points - middle) @ plane[:2].T, triangles, what)
        return
    if not 1 / FAR < size < FAR or np.abs(points).max() > FAR:
        raise InputError(f"{what}: it is {size:.3g} large: must be between {1 / FAR:g} and {FAR:g}")
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    longest = np.max([((corners[:, i] - corners[:, i - 1]) ** 2).sum(1) for i in range(3)], axis=0)
    flat = area <= ROUND_OFF * longest
    if flat.any():
        raise InputError(f"{what}: {flat.sum()} elements are flat, their corners lie on one line, one at"
                         f" {show(corners[flat][0].mean(0))}")
    _, first, number = np.unique(np.round(points / size, 10), axis=0, return_index=True, return_counts=True)
    if (number > 1).any():
        raise InputError(f"{what}: two nodes lie at {show(points[first[number > 1][0]])}: elements that meet share"
                         f" their nodes")
    directed, edges, numbers, times = edges_of(triangles)
    sense = np.zeros(len(edges))
    np.add.at(sense, numbers, np.where(directed[:, 0] < directed[:, 1], 1.0, -1.0))
    for bad, words in ((times > 2, "more than two elements share an edge"),
                       ((times == 2) & (sense != 0), "neighbouring elements look to different sides of the surface")):
        if bad.any():
            raise InputError(f"{what}: {words} at {show(points[edges[bad][0]].mean(0))}: each edge must have at most"
                             f" two elements, with their nodes in the same sense of rotation")
    order, owner = np.argsort(numbers, kind="stable"), np.tile(np.arange(len(triangles)), 3)
    same = numbers[order[1:]] == numbers[order[:-1]]
    pairs = owner[np.column_stack([order[:-1][same], order[1:][same]])]
    unit = normal / area[:, None]
    folded = np.einsum("ij,ij->i", *unit[pairs.T]) < _FOLD
    if folded.any():
        raise InputError(f"{what}: the surface is folded over at {show(corners[pairs[folded][0]].mean((0, 1)))}: a"
                         f" node is out of place")
    piece = connected_pieces(triangles)
    if piece.max() > 0:
        one, other = (show(corners[np.argmax(piece == k)].mean(0)) for k in (0, piece.max()))
        raise InputError(f"{what}: the body is in pieces: no elements lead from {one} to {other}; bodies apart need a"
                         f" scene each")
