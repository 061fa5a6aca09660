"""Deformation and shape quality of the elements of a body in a state."""

from __future__ import annotations

from typing import Any, NamedTuple

import basix
import numpy as np
import ufl

from ..mesh.triangles import shape_quality
from ..physics.kinematics import BLOCK
from ..ranks import gathered
from .transfer import in_own_cells

_OUTLINE = [0, 5, 1, 3, 2, 4]          # nodes of a P2 triangle around its edge, DOLFINx order


class Body(NamedTuple):
    """Elements of a solid in one state, all ranks: m elements with k quadrature points each.

    Attributes:
        points: reference quadrature points, shape (m, k, 2), length.
        deformed_points: deformed quadrature points, shape (m, k, 2), length.
        J: det F at the quadrature points, shape (m, k).
        I1: tr F^T F at the quadrature points, shape (m, k).
        section: in-plane part of F at the quadrature points, shape (m, k, 2, 2).
        layers: tag of the layer of each element, shape (m,).
        outline: deformed nodes around each element, shape (m, 6, 2), length.
        quality: shape quality of the deformed corner triangle of each element (`shape_quality`), shape (m,): 1 if
            equilateral, 0 if flat.
        initial_quality: shape quality of the reference corner triangle of each element, shape (m,).
    """

    points: np.ndarray
    deformed_points: np.ndarray
    J: np.ndarray
    I1: np.ndarray
    section: np.ndarray
    layers: np.ndarray
    outline: np.ndarray
    quality: np.ndarray
    initial_quality: np.ndarray


def body(problem: Any, x: Any, control: float) -> Body | None:
    """Return the elements of a solid in a state, with deformation and shape; None for a membrane; collective."""
    forms = problem.forms
    domain = forms.domain
    if domain.topology.dim != 2 or domain.geometry.dim != 2:
        return None
    problem.set_state(x, control)
    gauss = basix.make_quadrature(basix.CellType.triangle, problem.scene.quadrature_degree)[0]
    nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
    where = forms.X
    F = ufl.as_vector([forms.F[i] for i in BLOCK])
    F, X, points = (in_own_cells(domain, f, np.asarray(gauss)) for f in (F, where, where + forms.u))
    rest, moved = (in_own_cells(domain, f, nodes) for f in (where, where + forms.u))
    tags = np.zeros(len(X), dtype=np.int64)
    for tag in problem.scene.mesh.layers.values():
        found = problem.scene.mesh.cells.find(tag)
        tags[found[found < len(tags)]] = tag
    J = (F[..., 0] * F[..., 3] - F[..., 1] * F[..., 2]) * F[..., 4]
    turned = np.sign(shape_quality(rest[:, :3]))                     # cells may be numbered clockwise
    section = F[..., :4].reshape(*F.shape[:-1], 2, 2)
    local = (X, points, J, (F**2).sum(-1), section, tags, moved[:, _OUTLINE], turned * shape_quality(moved[:, :3]),
             turned * shape_quality(rest[:, :3]))
    return Body(*(gathered(problem.comm, part) for part in local))
