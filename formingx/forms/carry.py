"""Transfer of values from points of a body to points of another mesh of the same body."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from .. import _compat
from ..mesh.nodes import of_cells, own_cells
from ..ranks import gathered
from .probes import Probe

_NEIGHBOURS = 12
"""Points of a fit: twice the six coefficients of a quadratic polynomial in the plane."""


class Carrier:
    """Local fits of quadratic polynomials to values at scattered points: exact for quadratics, else of third order.

    Weights are the inverse fourth power of the distance, so values at a point that both meshes have stay as they are
    (interpolating moving least squares: Lancaster and Salkauskas, Mathematics of Computation 37, 1981). At a jump of
    the values a fit overshoots by less than a tenth of it.

    Args:
        comm: communicator; source, target: locally owned points, shapes (m, components), (n, components), length;
            collective.
    """

    def __init__(self, comm: Any, source: np.ndarray, target: np.ndarray):
        from scipy.spatial import cKDTree
        self._comm = comm
        points = gathered(comm, source)
        k = min(_NEIGHBOURS, len(points))
        away, self._rows = (found.reshape(len(target), k) for found in cKDTree(points).query(target, k))
        self.nearest = self._rows[:, 0]
        scale = np.maximum(away[:, -1:], 1e-300)
        offset = (points[self._rows] - target[:, None]) / scale[..., None]
        i, j = np.triu_indices(points.shape[1])
        basis = np.concatenate([np.ones_like(offset[..., :1]), offset, offset[..., i] * offset[..., j]], axis=-1)
        weight = 1 / np.maximum(away / scale, 1e-7) ** 2                # root of the weights
        self._share = np.linalg.pinv(weight[..., None] * basis, rcond=1e-9)[:, 0] * weight

    def fitted(self, values: np.ndarray) -> np.ndarray:
        """Return the fit at `target`, shape (n, ...), of owned values at `source`, shape (m, ...); collective."""
        return np.einsum("nk,nk...->n...", self._share, self.all(values)[self._rows])

    def all(self, values: np.ndarray) -> np.ndarray:
        """Return the values at `source` of all ranks, which `nearest` numbers; collective."""
        return gathered(self._comm, values)


def take_fields(source: Any, state: Any, problem: Any) -> None:
    """Set the fields of a problem on a part of a mesh to those of a solid in a state on the whole mesh; collective.

    Exact, cell by cell: a displacement is quadratic with a bubble, a pressure linear.

    Args:
        source, state: the problem on the whole mesh, and its state.
        problem: the problem on the part, whose `forms.w` is set.
    """
    whole, part = source.forms, problem.forms
    domain = whole.domain
    with source.state_context(state):
        fields = [whole.u / part.length] + [whole.stress / part.stress * p for p in ufl.split(whole.w)[1:]]
        known = [in_own_cells(domain, f, _PLACES) for f in fields]
    corners = gathered(source.comm, of_cells(domain, own_cells(domain))[:, :3])
    rows = {key: k for k, key in enumerate(map(_key, corners))}
    known = [gathered(source.comm, values) for values in known]
    mine = of_cells(part.domain, slice(None))[:, :3]
    found = np.array([rows[_key(c)] for c in mine], dtype=int)
    order = np.array([[np.flatnonzero(np.all(c == corner, axis=1))[0] for corner in corners[k]]
                      for c, k in zip(mine, found, strict=True)], dtype=int).reshape(-1, 3)
    for number, values in enumerate(known):
        space, dofs = part.space.sub(number).collapse()
        places = _compat.interpolation_points(space)
        barycentric = np.column_stack([1 - places.sum(1), places])[:, order].transpose(1, 0, 2)    # (cells, points, 3)
        shapes = _shapes(barycentric)
        all_values = np.einsum("cpk,ckd->cpd", shapes, values[found])
        f = fem.Function(space)
        f.interpolate(lambda x, v=all_values: v.reshape(-1, v.shape[-1]).T)
        part.w.x.array[dofs] = f.x.array
    part.w.x.scatter_forward()


_PLACES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0], [1 / 3, 1 / 3]])
"""Corners, middles of the edges opposite to them, centre of a cell."""


def in_own_cells(domain: Any, expression: Any, where: np.ndarray) -> np.ndarray:
    """Return a UFL expression in this rank's own cells at places of the reference cell, shape (cells, places,
    components)."""
    cells = own_cells(domain)
    shape = len(cells), len(where), int(np.prod(expression.ufl_shape, dtype=int))
    found = _compat.compile_expression(expression, where)
    return found.eval(domain, cells).reshape(shape) if len(cells) else np.zeros(shape)


def _shapes(barycentric: np.ndarray) -> np.ndarray:
    """Return the shape functions of `_PLACES`, shape (..., 7), at barycentric coordinates, shape (..., 3)."""
    a, b, c = np.moveaxis(barycentric, -1, 0)
    bubble = 27 * a * b * c
    corners = [s * (2 * s - 1) + bubble / 9 for s in (a, b, c)]
    middles = [4 * s * t - 4 * bubble / 9 for s, t in ((b, c), (a, c), (a, b))]
    return np.stack([*corners, *middles, bubble], axis=-1)


def _key(corners: np.ndarray) -> frozenset[tuple[float, float]]:
    return frozenset((float(r), float(z)) for r, z in corners)


def carry(source: Any, state: Any, problem: Any, x: np.ndarray, control: float, moved: bool = False) -> None:
    """Set the history variables of a problem from a state of the same body on another mesh; collective.

    Contact histories are left out if the problems have different numbers of histories, or if `moved`.

    Args:
        source, state: the problem on the other mesh, and its state.
        problem: the problem whose history variables are set.
        x, control: the same state on the mesh of `problem`, locally owned entries.
        moved: True if the mesh of `problem` is a mesh of the deformed body in `state`.
    """
    problem.look_at(x, control)
    with source.state_context(state):
        def on_this_mesh(points: np.ndarray) -> np.ndarray:
            return points + Probe(source, points).displacement_in(state) if moved else points
        same = len(problem.histories) == len(source.histories) and not moved
        n = len(problem.histories) if same else len(problem.forms.histories)
        for mine, other, kept in zip(problem.histories[-n:], source.histories[-n:], state.memory[-n:],
                                     strict=True) if n else ():
            mine.put(mine.carry(other, kept, x[: problem.n_owned], control, on_this_mesh))


def fitted_shapes(carrier: Carrier, values: np.ndarray, there: np.ndarray, here: np.ndarray) -> np.ndarray:
    """Return the fit of positive tensors, as C, entries 11, 22, 12, 33, at the targets, shape (n, 4); collective.

    The fit is of the logarithm of F^-T C F^-1, the tensor relative to the present configuration. So the stresses
    continue, independently of a fit of F.

    Args:
        values: the tensors at the source points, shape (m, 4).
        there, here: deformation gradients at the source points and at the targets, shapes (m, 3, 3), (n, 3, 3).
    """
    seen = np.linalg.solve(np.swapaxes(there, 1, 2), _matrices(values))
    w, v = np.linalg.eigh(np.swapaxes(np.linalg.solve(np.swapaxes(there, 1, 2), np.swapaxes(seen, 1, 2)), 1, 2))
    w, v = np.linalg.eigh(carrier.fitted(np.einsum("nij,nj,nkj->nik", v, np.log(w), v)))
    C = np.einsum("nji,njl,nl,nml,nmk->nik", here, v, np.exp(w), v, here, optimize=True)
    return np.stack([C[:, 0, 0], C[:, 1, 1], C[:, 0, 1], C[:, 2, 2]], axis=1)


def _matrices(entries: np.ndarray) -> np.ndarray:
    found = np.zeros((len(entries), 3, 3))
    found[:, 0, 0], found[:, 1, 1], found[:, 0, 1], found[:, 2, 2] = entries.T
    found[:, 1, 0] = found[:, 0, 1]
    return found


def shapes_of(forms: Any, cells: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the deformation gradient that materials see, scaled to det F = 1, at places in some cells, shape (n, 3,
    3); collective."""
    F = forms.elastic_F
    expression = _compat.compile_expression(ufl.as_vector([F[i, j] for i in range(3) for j in range(3)]), places)
    found = (expression.eval(forms.domain, cells) if len(cells) else np.zeros(0)).reshape(-1, 3, 3)
    return found / np.cbrt(np.linalg.det(found))[:, None, None]
