"""How the volume is kept: which unknowns, which energy, which quadrature.

Both ways are the penalty of Song (1993), eq. (3.4.1), W + (mu/eps) (I3 - 1)^2, with eps dimensionless (mu is the
layer's shear modulus). Where it keeps the pressure as an unknown p (tension positive), the same penalty reads
W + p (J - 1) - p^2/(2 k), k = 8 mu/eps: equal for small J - 1, and a Newton method that is far better behaved, as
the linearised constraint carries no wrong stress k (J - 1).
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError, finite, non_negative, positive


class MixedPressure:
    """The pressure is an unknown: P2 displacement, continuous P1 pressure in each layer (Taylor-Hood).

    The pressure jumps across the interface of two materials.

    Args:
        eps: dimensionless penalty parameter; 0 keeps the volume exactly (weakly, in the P1 space).
    """

    pressure_degree = 1
    stress_free = True

    def __init__(self, *, eps: float = 0.0):
        self.eps = non_negative("MixedPressure: eps", eps)
        if self.eps > 1:
            raise InputError(f"MixedPressure: eps = {eps!r}: must be at most 1 (thesis: 2e-2 to 1e-7)")

    def terms(self, J, p, modulus, eps):
        """[(energy density, quadrature metadata)] for J = det F, pressure p and the layer's shear modulus."""
        density = p * (J - 1)
        if self.eps > 0:
            density = density - eps * p**2 / (16 * modulus)
        return [(density, {})]


class DisplacementPenalty:
    """The thesis' own way: displacements only, the penalty integrated by a reduced rule (section 3.4).

    Args:
        eps: dimensionless penalty parameter, above 0 (thesis: 2e-2 to 1e-7).
        points: 3 (interior, degree 2: the usable rule), 4 (degree 3, one weight negative: the tangent
            becomes indefinite in bending for eps <= 1e-3) or 7 (full: locks).
        stress_free: False leaves the energy as printed in (3.4.1), not free of stress at rest: the unloaded body
            then swells or shrinks to I3 - 1 of the order of eps.
    """

    pressure_degree = None

    def __init__(self, *, eps: float = 1e-3, points: int = 3, stress_free: bool = True):
        self.stress_free = bool(stress_free)
        self.eps = positive("DisplacementPenalty: eps", eps)
        if points not in _RULES:
            raise InputError(f"DisplacementPenalty: points = {points!r}: must be one of {sorted(_RULES)}")
        finite("DisplacementPenalty: points", points)
        self.points = points

    def terms(self, J, p, modulus, eps):
        """[(energy density, quadrature metadata)] for J = det F and the layer's shear modulus; p is not used."""
        rule = _RULES[self.points]
        metadata = {} if rule is None else {
            "quadrature_rule": "custom", "quadrature_points": rule[0], "quadrature_weights": rule[1]}
        return [(modulus / eps * (J**2 - 1) ** 2, metadata)]


_RULES = {
    3: (np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.array([1, 1, 1]) / 6),
    4: (np.array([[1 / 3, 1 / 3], [0.6, 0.2], [0.2, 0.6], [0.2, 0.2]]), np.array([-27, 25, 25, 25]) / 96),
    7: None,
}
