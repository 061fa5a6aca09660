"""Transfer of fields and history variables from one mesh of a body to another mesh of the same body."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from .. import _compat
from ..mesh.nodes import cell_node_positions, own_cells
from ..ranks import gathered
from .probes import Probe

_FITTED_POINTS = 12
"""Number of points of a fit: twice the six coefficients of a quadratic polynomial in the plane."""


class MovingLeastSquares:
    r"""Interpolating moving least squares from source points, shape (m, c), to target points, shape (n, c), length.

    A quadratic polynomial p is fitted around each target point y to the k nearest values :math:`f_i` at :math:`x_i`
    (Lancaster and Salkauskas, Mathematics of Computation 37, 1981):

    .. math:: \min_p \sum_{i=1}^{k} \frac{(p(x_i) - f_i)^2}{|x_i - y|^4}

    Quadratic functions are reproduced exactly; other functions have an error of third order in the distance of the
    points. A value at a point of both sets is kept. At a discontinuity the fit overshoots by less than a tenth of the
    jump. Points are locally owned, and the constructor is collective.

    Attributes:
        nearest: index of the source point nearest to each target point, shape (n,), for values at the source points of
            all ranks (`source_values`).
    """

    def __init__(self, comm: Any, source: np.ndarray, target: np.ndarray):
        from scipy.spatial import cKDTree
        self._comm = comm
        points = gathered(comm, source)
        k = min(_FITTED_POINTS, len(points))
        away, self._rows = (found.reshape(len(target), k) for found in cKDTree(points).query(target, k))
        self.nearest = self._rows[:, 0]
        scale = np.maximum(away[:, -1:], 1e-300)
        offset = (points[self._rows] - target[:, None]) / scale[..., None]
        i, j = np.triu_indices(points.shape[1])
        basis = np.concatenate([np.ones_like(offset[..., :1]), offset, offset[..., i] * offset[..., j]], axis=-1)
        weight = 1 / np.maximum(away / scale, 1e-7) ** 2                # root of the weights
        self._share = np.linalg.pinv(weight[..., None] * basis, rcond=1e-9)[:, 0] * weight

    def fitted(self, values: np.ndarray) -> np.ndarray:
        """Interpolate values at owned source points, shape (m, ...), to target points, (n, ...); collective."""
        return np.einsum("nk,nk...->n...", self._share, self.source_values(values)[self._rows])

    def source_values(self, values: np.ndarray) -> np.ndarray:
        """Return the values at the source points of all ranks, as `nearest` counts them; collective."""
        return gathered(self._comm, values)


def restrict_fields(source: Any, state: Any, problem: Any) -> None:
    """Set fields on part of a mesh from a state on the whole mesh, exactly, cell by cell; collective."""
    whole, part = source.forms, problem.forms
    domain = whole.domain
    with source.state_context(state):
        fields = [whole.u / part.length] + [whole.stress / part.stress * p for p in ufl.split(whole.w)[1:]]
        known = [in_own_cells(domain, f, _PLACES) for f in fields]
    corners = gathered(source.comm, cell_node_positions(domain, own_cells(domain))[:, :3])
    rows = {key: k for k, key in enumerate(map(_key, corners))}
    known = [gathered(source.comm, values) for values in known]
    mine = cell_node_positions(part.domain, slice(None))[:, :3]
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
"""Corners, midpoints of the opposite edges, centroid of the reference triangle."""


def in_own_cells(domain: Any, expression: Any, where: np.ndarray) -> np.ndarray:
    """Return a UFL expression with c components at q places of owned cells, shape (cells, q, c)."""
    cells = own_cells(domain)
    shape = len(cells), len(where), int(np.prod(expression.ufl_shape, dtype=int))
    found = _compat.compile_expression(expression, where)
    return found.eval(domain, cells).reshape(shape) if len(cells) else np.zeros(shape)


def _shapes(barycentric: np.ndarray) -> np.ndarray:
    """Return the seven shape functions of corners, opposite midpoints and centroid at barycentric (..., 3)."""
    a, b, c = np.moveaxis(barycentric, -1, 0)
    bubble = 27 * a * b * c
    corners = [s * (2 * s - 1) + bubble / 9 for s in (a, b, c)]
    middles = [4 * s * t - 4 * bubble / 9 for s, t in ((b, c), (a, c), (a, b))]
    return np.stack([*corners, *middles, bubble], axis=-1)


def _key(corners: np.ndarray) -> frozenset[tuple[float, float]]:
    """Return the positions of the three corners of a cell, shape (3, 2), as a set that identifies the cell."""
    return frozenset((float(r), float(z)) for r, z in corners)


def transfer_histories(source: Any, state: Any, problem: Any, x: np.ndarray, control: float,
                       moved: bool = False) -> None:
    """Set the history variables of a problem from a state on another mesh of the body; collective.

    x: unknowns on the mesh of `problem`, shape (n,). Those of contact are left out if the numbers of histories differ,
    or if `moved` is True: the mesh is one of the deformed body.
    """
    problem.set_fields(x, control)
    with source.state_context(state):
        def on_this_mesh(points: np.ndarray) -> np.ndarray:
            """Map reference points of the mesh of `source`, shape (n, 2), to the mesh of `problem`."""
            return points + Probe(source, points).displacement_in(state) if moved else points
        same = len(problem.history.parts) == len(source.history.parts) and not moved
        n = len(problem.history.parts) if same else len(problem.forms.histories)
        pairs = zip(problem.history.parts[-n:], source.history.parts[-n:], state.history_variables[-n:], strict=True)
        for mine, other, kept in pairs if n else ():
            mine.put(mine.transfer(other, kept, x[: problem.n_owned], control, on_this_mesh))


def fitted_tensors(interpolation: MovingLeastSquares, values: np.ndarray, source_F: np.ndarray,
                   target_F: np.ndarray) -> np.ndarray:
    r"""Interpolate symmetric positive definite C, entries 11, 22, 12, 33, from (m, 4) to (n, 4); collective.

    The interpolated quantity is the logarithm relative to the current configuration, so stresses stay continuous:

    .. math:: \ln(F^{-T} C F^{-1})
    """
    seen = np.linalg.solve(np.swapaxes(source_F, 1, 2), _matrices(values))
    w, v = np.linalg.eigh(np.swapaxes(np.linalg.solve(np.swapaxes(source_F, 1, 2), np.swapaxes(seen, 1, 2)), 1, 2))
    w, v = np.linalg.eigh(interpolation.fitted(np.einsum("nij,nj,nkj->nik", v, np.log(w), v)))
    C = np.einsum("nji,njl,nl,nml,nmk->nik", target_F, v, np.exp(w), v, target_F, optimize=True)
    return np.stack([C[:, 0, 0], C[:, 1, 1], C[:, 0, 1], C[:, 2, 2]], axis=1)


def _matrices(entries: np.ndarray) -> np.ndarray:
    """Return symmetric tensors as matrices, shape (n, 3, 3), from their entries 11, 22, 12, 33, shape (n, 4)."""
    found = np.zeros((len(entries), 3, 3))
    found[:, 0, 0], found[:, 1, 1], found[:, 0, 1], found[:, 2, 2] = entries.T
    found[:, 1, 0] = found[:, 0, 1]
    return found


def isochoric_gradients(forms: Any, cells: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return F without expansion, det F = 1, (cells q, 3, 3), at places (q, dimension) of cells; collective."""
    F = forms.elastic_F
    expression = _compat.compile_expression(ufl.as_vector([F[i, j] for i in range(3) for j in range(3)]), places)
    found = (expression.eval(forms.domain, cells) if len(cells) else np.zeros(0)).reshape(-1, 3, 3)
    return found / np.cbrt(np.linalg.det(found))[:, None, None]
