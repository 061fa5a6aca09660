"""Admissibility of a body: hoop stretches and in-plane determinants are positive.

det F > 0 at the quadrature points is not enough. Beyond the axis the hoop stretch and the in-plane determinant are both
negative, so their product is positive. A strongly bent edge may also invert an element between these points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import basix
import basix.ufl
import numpy as np

from .. import _compat
from ..mesh.nodes import cell_node_positions, own_cells
from ..ranks import listed

_MIDDLES = {basix.CellType.triangle: [[0.5, 0.5], [0, 0.5], [0.5, 0]], basix.CellType.interval: [[0.5]]}
"""Midpoints of the edges. Corners are left out: where a free side turns onto a plate, the determinant has no limit."""


class WorstValue(NamedTuple):
    """Worst value of the checked quantities in a body.

    Attributes:
        quantity: "hoop stretch", "in-plane determinant" or "volume ratio".
        value: value of the quantity (dimensionless).
        point: reference position (R, Z) of the value, length.
    """

    quantity: str
    value: float
    point: tuple[float, float]


class Admissible:
    r"""Admissibility check of a deformed body: its hoop stretches and in-plane determinants must be positive.

    They are evaluated at the quadrature points of the energy, at points of the next degree, and at edge midpoints.

    .. math:: \lambda_\theta = 1 + u_r / R, \qquad
              d = \left(1 + \frac{\partial u_r}{\partial R}\right) \left(1 + \frac{\partial u_z}{\partial Z}\right)
                  - \frac{\partial u_r}{\partial Z} \frac{\partial u_z}{\partial R}

    On the axis the hoop stretch is its limit, :math:`1 + \partial u_r / \partial R`. A membrane has a hoop stretch
    only. The constructor computes all arrays that do not depend on the state.

    Attributes:
        dofs: unknowns of each displacement component in the locally owned cells, list of arrays of shape (cells, n).
    """

    def __init__(self, forms: Any):
        self._forms, domain = forms, forms.domain
        self._known: tuple[np.ndarray, dict[str, np.ndarray]] = np.zeros(0), {}     # fields, and their quantities
        self._solid = domain.topology.dim == 2
        self._has_hoop = forms.scene.kinematics.axisymmetric
        cell = basix.CellType[domain.topology.cell_name()]
        scene = forms.scene
        rule: Any = basix.make_quadrature(cell, scene.quadrature_degree)
        inside, self._weights = rule
        beside: Any = basix.make_quadrature(cell, scene.quadrature_degree + 1)[0]
        self._n = len(inside)
        points = np.concatenate([inside, beside, np.array(_MIDDLES[cell], dtype=float)])
        n = len(own := own_cells(domain))
        self.dofs = [forms.space.sub(0).sub(i).dofmap.list[:n] for i in range(scene.kinematics.components)]
        shapes: Any = forms.displacement_element.tabulate(1, points)                    # (1 + dim, points, dofs)
        geometry = basix.ufl.element("Lagrange", domain.basix_cell(), _compat.coordinate_map(domain).degree)
        map_shapes: Any = geometry.tabulate(1, points)
        nodes = cell_node_positions(domain, own)
        self._X = np.einsum("pk,ckx->cpx", map_shapes[0], nodes)
        self._values, self._on_axis = shapes[0], np.abs(self._X[..., 0]) <= 1e-12 * forms.length
        self._R = np.where(self._on_axis, 1.0, self._X[..., 0])
        if self._solid:
            jacobian = np.einsum("dpk,ckx->cpxd", map_shapes[1:], nodes)
            self._sizes = np.abs(np.linalg.det(jacobian[:, : self._n])) * self._weights
            gradients = np.einsum("dpa,cpdx->cpxa", shapes[1:], np.linalg.inv(jacobian))
            self._gradients = gradients.reshape(n, -1, shapes.shape[2])            # (cells, points x 2, dofs)

    def minimum(self) -> WorstValue:
        """Return the field's smallest hoop stretch or in-plane determinant, or the first not finite; collective."""
        found = [WorstValue("in-plane determinant", np.inf, (0.0, 0.0))]
        for quantity, values in self.quantities().items():
            if values.size:
                k = np.unravel_index(np.argmin(np.where(np.isfinite(values), values, -np.inf)), values.shape)
                found.append(WorstValue(quantity, float(values[k]), tuple(self._X[k].tolist())))
        parts = [part for parts in listed(self._forms.comm, found) for part in parts]
        return min(parts, key=lambda part: part.value if np.isfinite(part.value) or part.value > 0 else -np.inf)

    def extreme_volume_ratio(self) -> WorstValue | None:
        """Return the volume ratio J with the largest |ln J| and its position; None for a membrane; collective."""
        if not self._solid:
            return None
        found = WorstValue("volume ratio", 1.0, (0.0, 0.0))
        J = np.prod(list(self.quantities().values()), axis=0)
        if J.size:
            k = np.unravel_index(np.argmax(np.abs(np.log(np.maximum(J, 1e-300)))), J.shape)
            found = WorstValue("volume ratio", float(J[k]), tuple(self._X[k].tolist()))
        return max(listed(self._forms.comm, found), key=lambda part: abs(np.log(max(part.value, 1e-300))))

    def volume_error_away(self, places: np.ndarray, distance: float) -> float:
        """Return the root mean square of J - 1 in elements over `distance` from places (k, 2), length; collective."""
        X, n = self._X[:, : self._n], self._n
        J = np.prod(list(self.quantities().values()), axis=0)[:, :n]
        near = np.min([np.hypot(*(X - place).transpose(2, 0, 1)).min(1) for place in places], axis=0) < distance
        size = np.where(near[:, None], 0.0, self._sizes * (self._R[:, :n] if self._has_hoop else 1.0))
        sums = listed(self._forms.comm, (float((size * (J - 1) ** 2).sum()), float(size.sum())))
        squares, total = map(sum, zip(*sums))
        return float(np.sqrt(squares / total)) if total else 0.0

    def volume_ratios(self) -> tuple[float, float]:
        """Return the smallest and largest volume ratio J at the quadrature points of the energy; collective."""
        J = np.prod(list(self.quantities().values()), axis=0)[:, :self._n]
        found = listed(self._forms.comm, (J.min(initial=np.inf), J.max(initial=-np.inf)))
        return float(min(low for low, _ in found)), float(max(high for _, high in found))

    def holds(self) -> bool:
        """Return True if no point has crossed the axis and no element is inverted, for the current field; collective.

        In-plane determinants are checked at quadrature points of the energy only. Between them a sharp edge may invert
        a bent element without harm, as under a plug. `minimum` finds such points.
        """
        found = self.quantities()
        mine = all([bool(np.all((values if quantity == "hoop stretch" else values[:, :self._n]) > 0))
                    for quantity, values in found.items()])
        return all(listed(self._forms.comm, mine))

    def inverted_elements(self) -> tuple[int, int, tuple[float, float]]:
        """Return the numbers of inverted and of all elements of a solid, and (R, Z) of the smallest J; collective."""
        J = np.prod(list(self.quantities().values()), axis=0)
        mine = (np.inf, (0.0, 0.0))
        if J.size:
            k = np.unravel_index(np.argmin(J), J.shape)
            mine = float(J[k]), tuple(self._X[k].tolist())
        bad, cells, smallest = zip(*listed(self._forms.comm, (int((J <= 0).any(1).sum()), len(J), mine)))
        return sum(bad), sum(cells), min(smallest)[1]

    def quantities(self) -> dict[str, np.ndarray]:
        """Return {"in-plane determinant": values, "hoop stretch": values} in owned cells, shape (cells, points) each.

        A membrane has no determinant, plane strain no hoop stretch.
        """
        w, size = self._forms.w.x.array, self._forms.length
        if np.array_equal(w, self._known[0]):               # checks of a state follow each other
            return self._known[1]
        u = np.stack([w[dofs] for dofs in self.dofs], -1) * size                  # (cells, dofs, 2)
        found, along = {}, np.ones(())
        if self._solid:
            d_R, d_Z = np.moveaxis((self._gradients @ u).reshape(*self._X.shape, len(self.dofs)), 2, 0)
            along = 1 + d_R[..., 0]
            found["in-plane determinant"] = along * (1 + d_Z[..., 1]) - d_Z[..., 0] * d_R[..., 1]
        if self._has_hoop:
            hoop = 1 + (u[..., 0] @ self._values.T) / self._R
            found["hoop stretch"] = np.where(self._on_axis, along, hoop)
        self._known = w.copy(), found
        return found
