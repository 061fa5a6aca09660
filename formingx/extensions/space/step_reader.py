"""Reading of STEP files by gmsh: triangles with the exact normals of the drawn surfaces at their corners."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ...errors import InputError
from ...io.stl import volume
from ...mesh import with_gmsh
from .patches import area_vectors, sides_of_edges, unit

_LARGEST_TRIANGLE = 0.25   # edge of a triangle over the largest extent of the solid, without a `size`

_SMALLEST_TRIANGLE = 2e-3  # the same; at the tip of a cone the curvature would ask for triangles of size 0


def read_step(name: str, size: float | None, angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, shape (n, 3), mm, triangles, shape (m, 3), and exact normals, shape (m, 3, 3), of a STEP file.

    Triangles are counter-clockwise from outside, normals point out of the solid, and gmsh converts lengths to mm. size:
    largest edge, mm; None: a quarter of the extent. angle: largest turn within a triangle, degrees. Raise `InputError`
    if gmsh cannot read the file, or if it has no solid.
    """
    options = {"General.NumThreads": 1.0, "Mesh.MeshSizeFromCurvature": 360.0 / angle,
               "Mesh.MeshSizeExtendFromBoundary": 0.0}
    if not os.path.isfile(name):
        raise InputError(f"solid: {name!r} cannot be read: there is no such file")
    with with_gmsh.model("tool", options) as gmsh:
        try:
            gmsh.model.occ.importShapes(name)
            gmsh.model.occ.synchronize()
            low, high = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
            extent = float((high - low).max())
            gmsh.option.setNumber("Mesh.MeshSizeMax", size or _LARGEST_TRIANGLE * extent)
            gmsh.option.setNumber("Mesh.MeshSizeMin", _SMALLEST_TRIANGLE * extent)
            gmsh.model.mesh.generate(2)
        except Exception as error:
            raise InputError(f"solid: {name!r}: gmsh cannot read or mesh it: {error}") from None
        bodies = [_body(gmsh, entity) for entity in gmsh.model.getEntities(3)]
    if not bodies:
        raise InputError(f"solid: {name!r} contains no solid: must be a closed volume, not surfaces or curves alone")
    begin = np.cumsum([0, *(len(points) for points, _, _ in bodies)])
    return (np.concatenate([points for points, _, _ in bodies]),
            np.concatenate([triangles + k for (_, triangles, _), k in zip(bodies, begin)]),
            np.concatenate([normals for _, _, normals in bodies]))


def _body(gmsh: Any, entity: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, triangles and normals of a meshed solid (dimension, tag), as `read_step`.

    gmsh is asked for normals at the parameters of its own nodes: it may find other parameters for a given point.
    """
    tags, X, _ = gmsh.model.mesh.getNodes()
    row = np.zeros(int(tags.max()) + 1, dtype=int)
    row[tags.astype(int)] = np.arange(len(tags))
    X, cells, normals = X.reshape(-1, 3), [], []
    for _, tag in gmsh.model.getBoundary([entity], oriented=False):
        triangles = row[gmsh.model.mesh.getElementsByType(2, tag)[1].astype(int)].reshape(-1, 3)
        own, _, parameters = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True, returnParametricCoord=True)
        place = np.zeros(len(X), dtype=int)
        place[row[own.astype(int)]] = np.arange(len(own))
        N = unit(np.array(gmsh.model.getNormal(tag, parameters)).reshape(-1, 3)[place[triangles]])
        facet = unit(area_vectors(X, triangles))
        N *= np.sign(np.einsum("mki,mi->mk", N, facet).sum(1))[:, None, None]
        degenerate = np.einsum("mki,mi->mk", N, facet) < 0.1               # at a pole, or the tip of a cone
        N[degenerate] = np.broadcast_to(facet[:, None], N.shape)[degenerate]
        cells.append(triangles)
        normals.append(N)
    used, back = np.unique(np.concatenate(cells), return_inverse=True)
    points, triangles, N = X[used], back.reshape(-1, 3), np.concatenate(normals)
    turned = _turned(triangles)
    if volume(points, np.where(turned[:, None], triangles[:, ::-1], triangles)) < 0:
        turned = ~turned
    triangles[turned], N[turned] = triangles[turned][:, ::-1], -N[turned][:, ::-1]
    return points, triangles, N


def _turned(triangles: np.ndarray) -> np.ndarray:
    """Return the mask of the triangles to turn, so that all are oriented like their neighbours, shape (m,).

    Each triangle has two nodes in a graph, as it is and turned. Two neighbours are connected as they fit.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    m = len(triangles)
    directed = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    i, j = sides_of_edges(triangles)
    flip = (directed[i, 0] == directed[j, 0]).astype(int)
    s, t = i % m, j % m
    a, b = np.concatenate([2 * s, 2 * s + 1]), np.concatenate([2 * t + flip, 2 * t + 1 - flip])
    component = connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(2 * m, 2 * m)), directed=False)[1]
    return np.asarray(component[0::2] > component[1::2])
