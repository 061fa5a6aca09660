"""Reading of STL files, and checks that their triangles bound a solid.

numpy reads both kinds of file. `vtkSTLReader` and meshio merge or drop triangles, and trimesh repairs them, without a
word about what was wrong.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...findings import coordinates
from ...mesh.edges import edges_of
from .bodies import merged
from .crossing import crossings

_NEGLIGIBLE_CROSSING = 1e-5
"""Depth of an edge beyond another triangle that is round-off of a file, over the extent of the surface."""


def read_stl(name: str, caller: str = "solid") -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) and triangles (m, 3) of an STL file, binary or text; another file is an InputError."""
    try:
        with open(name, "rb") as stream:
            data = stream.read()
    except OSError as error:
        raise InputError(f"{caller}: {name!r} cannot be read: {error}") from None
    n = int(np.frombuffer(data[80:84], "<u4")[0]) if len(data) >= 84 else -1
    if len(data) == 84 + 50 * n:
        rows = np.frombuffer(data[84:], dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
        points = rows["corners"].astype(float).reshape(-1, 3)
    else:
        words = data.split()
        at = [k for k, word in enumerate(words) if word.lower() == b"vertex"]
        try:
            points = np.array([[float(w) for w in words[k + 1:k + 4]] for k in at]).reshape(-1, 3)
        except ValueError:
            raise InputError(f"{caller}: {name!r} is no STL file: a vertex is not three numbers") from None
    if len(points) < 12 or len(points) % 3 or not np.isfinite(points).all():
        raise InputError(f"{caller}: {name!r} is no STL file of a surface: it has {len(points)} corners of triangles,"
                         f" which must be finite and at least 12")
    return merged(points, np.arange(len(points)).reshape(-1, 3))


def check_closed(points: np.ndarray, triangles: np.ndarray, caller: str) -> None:
    """Raise an InputError unless triangles (m, 3) have each edge as often in one direction as in the other."""
    directed, edges, numbers, times = edges_of(triangles)
    sense = np.zeros(len(edges))
    np.add.at(sense, numbers, np.where(directed[:, 0] < directed[:, 1], 1.0, -1.0))
    for bad, words in ((times == 1, "is open: {n} edges have a triangle on one side only, one at {at}: close the holes"
                                    " where it was drawn"),
                       (times % 2 == 1, "has {n} edges with an odd number of triangles, one at {at}: it crosses itself,"
                                        " or holds a sheet without thickness"),
                       (sense != 0, "has triangles that look the other way than their neighbours, at {n} edges, one at"
                                    " {at}: let the program that wrote it unify its normals")):
        if bad.any():
            x = points[edges[np.argmax(bad)]].mean(0)
            at = coordinates(x, 6)
            raise InputError(f"{caller} {words.format(n=int(bad.sum()), at=at)}")


def check_simple(points: np.ndarray, triangles: np.ndarray, caller: str) -> None:
    """Raise an `InputError` if the surface of a body passes through itself; triangles: shape (m, 3)."""
    size = float(np.ptp(points[triangles], axis=(0, 1)).max())
    found = crossings(points, triangles, _NEGLIGIBLE_CROSSING * size)
    if len(found):
        *x, depth = found[np.argmax(found[:, 3])]
        at = coordinates(x, 6)
        raise InputError(f"{caller} passes through itself at {len(found)} places, an edge by {depth:.3g} at {at}:"
                         f" inside and outside are not defined there: unite or trim its parts where it was drawn")
