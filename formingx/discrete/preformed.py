"""A body whose mesh is what it was deformed to: F = grad x . F_old, and how a state goes on from there."""

from __future__ import annotations

from typing import Any, NamedTuple

import basix
import numpy as np
import ufl
from dolfinx import fem

from ..ranks import gathered
from .carry import in_own_cells

_NEIGHBOURS = 30
"""Points that a field is fitted to about an element, at most."""

_FEWEST = 14
"""Of them that lie within its reach, at least."""

_SIX = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
"""Corners of a cell, middles of the edges opposite to them."""

_LEAST = 0.5
"""det F of a point, or of a fit, that is believed."""

_ENTRIES = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 2))


class Preformed(NamedTuple):
    """What a body brings from its mesh before, at n points: the quadrature points there.

    Attributes:
        points: where they are now, shape (n, 2), length.
        F: deformation gradient so far, entries rr, rz, zr, zz, hoop, shape (n, 5).
        pressures: of the pressure fields, shape (n, fields), dimensionless.
        before: the problem of that mesh, and its last state.
    """

    points: np.ndarray
    F: np.ndarray
    pressures: np.ndarray
    before: Any = None

    @classmethod
    def of(cls, problem: Any, state: Any) -> Preformed:
        """What the body of a state brings; collective."""
        forms = problem.forms
        with problem.at(state):
            F, fields = forms.F, ufl.split(forms.w)[1:]
            values = [forms.X[0] + forms.u[0], forms.X[1] + forms.u[1], *(F[i] for i in _ENTRIES), *fields]
            where: Any = basix.make_quadrature(forms.domain.basix_cell(), forms.scene.quadrature_degree)[0]
            rows: Any = in_own_cells(forms.domain, ufl.as_vector(values), where).reshape(-1, len(values))
        J = _det(rows[:, 2:7])
        rows = rows[(J > _LEAST) & (J < 1 / _LEAST)]         # what is crushed tells nothing
        rows[:, 2:7] /= np.cbrt(_det(rows[:, 2:7]))[:, None]
        return cls(rows[:, :2], rows[:, 2:7], rows[:, 7:], (problem, state))

    def gradient(self, forms: Any) -> Any:
        """F_old on the elements of a formulation (UFL, shape (3, 3)): quadratic in each, scaled to det F_old = 1."""
        space = fem.functionspace(forms.domain, ("DG", 2, (5,)))
        field = fem.Function(space)
        fitted = self._fitted(forms, self.F, np.array([1, -1, -1, 1, 1]), _SIX)
        fitted = _without_folds(fitted, self._nearest(forms))
        field.x.array.reshape(-1, 5)[space.dofmap.list[: len(fitted)]] = fitted
        field.x.scatter_forward()
        rr, rz, zr, zz, hoop = ufl.split(field)
        share = ((rr * zz - rz * zr) * hoop) ** (-1 / 3)
        return share * ufl.as_tensor([[rr, rz, 0], [zr, zz, 0], [0, 0, hoop]])

    def unknowns(self, problem: Any) -> np.ndarray:
        """The unknowns of the body as it stands, own part: no displacement, its pressures."""
        x, forms = np.zeros(problem.x.getLocalSize()), problem.forms
        if self.pressures.shape[1]:
            fitted = self._fitted(forms, self.pressures, np.ones(self.pressures.shape[1]), _SIX[:3])
            values = np.zeros(len(forms.w.x.array))
            for k in range(self.pressures.shape[1]):
                values[forms.space.sub(1 + k).dofmap.list[: len(fitted)]] = fitted[..., k]
            x[: problem.n_owned] = values[: problem.n_owned]
        return x

    def _nearest(self, forms: Any) -> np.ndarray:
        """F of the point nearest to the middle of each own cell, shape (cells, 5)."""
        from scipy.spatial import cKDTree
        middle = in_own_cells(forms.domain, forms.X, np.array([[1 / 3, 1 / 3]]))[:, 0]
        return gathered(forms.comm, self.F)[cKDTree(gathered(forms.comm, self.points)).query(middle)[1]]

    def _fitted(self, forms: Any, values: np.ndarray, parity: np.ndarray, places: np.ndarray) -> np.ndarray:
        """What is quadratic in each own cell, fitted to what is near: its values at places of it, shape (n, 2), in
        each, shape (cells, n, components).

        parity: 1 or -1: what becomes of a component beyond the axis, where the body is seen in a mirror; there the
        hoop is stretched as the radius. Quadratic least squares, weights falling with the distance from the middle:
        jumps between the old elements are smoothed.
        """
        from scipy.spatial import cKDTree
        inside = in_own_cells(forms.domain, forms.X, places)
        corners = in_own_cells(forms.domain, forms.X, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        points, values = gathered(forms.comm, self.points), gathered(forms.comm, values)
        if forms.scene.kinematics.axisymmetric:
            near = points[:, 0] < 2 * np.sqrt(np.ptp(points[:, 0]) * np.ptp(points[:, 1]) / max(len(corners), 1))
            points = np.concatenate([points, points[near] * (-1, 1)])
            values = np.concatenate([values, values[near] * parity])
        middle = corners.mean(1)
        away, rows = cKDTree(points).query(middle, min(_NEIGHBOURS, len(points)))
        size = np.maximum(np.linalg.norm(corners - middle[:, None], axis=2).max(1), away[:, _FEWEST - 1])[:, None]
        weight = np.exp(-((away / size) ** 2))
        by, at = (np.stack([np.ones_like(r), r, z, r * r, r * z, z * z], -1) for r, z in (
            np.moveaxis((x - middle[:, None]) / size[..., None], -1, 0) for x in (points[rows], inside)))
        fit = np.linalg.pinv(weight[..., None] * by, rcond=1e-3) * weight[:, None]
        found = at @ (fit @ values[rows])
        if forms.scene.kinematics.axisymmetric and values.shape[1] == 5:
            axis = inside[..., 0] < 1e-9 * forms.length
            found[axis] *= (1, 0, 0, 1, 1)
            found[axis, 0] = found[axis, 4] = (found[axis, 0] + found[axis, 4]) / 2
        return found


def _det(F: np.ndarray) -> np.ndarray:
    """Of entries, shape (..., 5): shape (...)."""
    return (F[..., 0] * F[..., 3] - F[..., 1] * F[..., 2]) * F[..., 4]


def _without_folds(F: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Quadratic fields, by their values at `_SIX`, shape (cells, 6, 5), as near to constant ones, shape (cells, 5), as
    it takes for det F to be believed: where F turns within an element, as beside a corner, its entries are no fit."""
    near, by = near[:, None], F - near[:, None]
    a, b, c = (np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4).T
    shapes = np.column_stack([*(s * (2 * s - 1) for s in (a, b, c)), 4 * b * c, 4 * a * c, 4 * a * b])
    for k in range(12):
        there = near + shapes @ by
        bad = ((_det(there) < _LEAST) | (there[..., 4] <= 0)).any(1)
        if not bad.any():
            break
        by[bad] *= 0.7 if k < 11 else 0.0
    return near + by
