"""The elements of a body in a state: determinants, shapes, and where their worst places are."""

from __future__ import annotations

from typing import Any, NamedTuple

import basix
import numpy as np
import ufl
from dolfinx import fem

from ..mesh import Mesh

_OUTLINE = [0, 5, 1, 3, 2, 4]          # nodes of a P2 triangle around its edge, DOLFINx order


class Place(NamedTuple):
    """A point of the body: reference (R, Z), length; the layer it is in ("" if that is not known); the nearest named
    boundary and its distance, length."""

    R: float
    Z: float
    layer: str
    boundary: str
    distance: float

    def __str__(self) -> str:
        layer = f" in layer {self.layer!r}" if self.layer else ""
        if not self.boundary:
            return f"(R, Z) = ({self.R:.6g}, {self.Z:.6g}){layer}"
        near = f", {self.distance:.3g} from boundary {self.boundary!r}" if self.distance else f", on {self.boundary!r}"
        return f"(R, Z) = ({self.R:.6g}, {self.Z:.6g}){layer}{near}"


def place(mesh: Mesh, point: Any, layer: str = "") -> Place:
    """A point, shape (2,), the same on all ranks, with the nearest boundary of the mesh; collective."""
    best, size = ("", np.inf), 0.0
    for name in mesh.boundaries:
        nodes = mesh.nodes_of(name)
        if len(nodes):
            away = float(np.hypot(*(nodes - point).T).min())
            best, size = (name, away) if away < best[1] else best, max(size, float(np.abs(nodes).max()))
    R, Z, distance = (0.0 if abs(v) < 1e-9 * size else float(v) for v in (*point, best[1]))
    return Place(R, Z, layer, best[0], distance)


def shape_quality(corners: np.ndarray) -> np.ndarray:
    """4 sqrt(3) area / (sum of squared edges) of triangles, corners (n, 3, 2): 1 equilateral, 0 flat, < 0 inverted."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    squares = sum(((p - q) ** 2).sum(1) for p, q in ((a, b), (b, c), (c, a)))
    return 4 * np.sqrt(3) * area / squares


class Body(NamedTuple):
    """A solid in one state, all ranks: m elements with k quadrature points each.

    points, moved: reference and deformed, shape (m, k, 2), length; J, I1: det F and tr F^T F there, shape (m, k);
    layers: tag of each element, shape (m,); outline: deformed nodes around each, shape (m, 6, 2), length; quality,
    at_rest: shape of its corner triangle deformed and at rest (`shape_quality`), shape (m,).
    """

    points: np.ndarray
    moved: np.ndarray
    J: np.ndarray
    I1: np.ndarray
    layers: np.ndarray
    outline: np.ndarray
    quality: np.ndarray
    at_rest: np.ndarray


def body(problem: Any, x: Any, control: float) -> Body | None:
    """The elements of a solid at a state (None: a membrane has no elements across its thickness); collective."""
    forms = problem.forms
    domain = forms.domain
    if domain.topology.dim != 2:
        return None
    problem.set_state(x, control)
    gauss = basix.make_quadrature(basix.CellType.triangle, problem.scene.quadrature_degree)[0]
    nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
    where = ufl.as_vector([forms.X[0], forms.X[1]])
    F = ufl.as_vector([forms.F[i] for i in ((0, 0), (0, 1), (1, 0), (1, 1), (2, 2))])
    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)

    def at(expression, points, n):
        if not len(cells):
            return np.zeros((0, len(points), n))
        return fem.Expression(expression, points).eval(domain, cells).reshape(len(cells), len(points), n)
    F, X = at(F, gauss, 5), at(where, gauss, 2)
    rest, moved, points = at(where, nodes, 2), at(where + forms.u, nodes, 2), at(where + forms.u, gauss, 2)
    tags = np.zeros(len(cells), dtype=np.int64)
    for tag in problem.scene.mesh.layers.values():
        found = problem.scene.mesh.cells.find(tag)
        tags[found[found < len(cells)]] = tag
    J = (F[..., 0] * F[..., 3] - F[..., 1] * F[..., 2]) * F[..., 4]
    turned = np.sign(shape_quality(rest[:, :3]))                     # cells may be numbered clockwise
    local = (X, points, J, (F**2).sum(-1), tags, moved[:, _OUTLINE], turned * shape_quality(moved[:, :3]),
             turned * shape_quality(rest[:, :3]))
    return Body(*(np.concatenate(part) for part in zip(*problem.comm.allgather(local), strict=True)))
