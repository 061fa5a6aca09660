"""Total Lagrangian kinematics of a meridional (or cross-sectional) plane; the only home of 2 pi R.

Coordinates X = (R, Z), displacement u = (u_r, u_z), in the mesh's unit of length.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl


class Kinematics:
    """What the motion of a section of the body means in space.

    Attributes:
        axisymmetric: True if the section turns about R = 0.
        dimension_of_volume: 3; of a volume per unit depth 2.
    """

    axisymmetric = False
    dimension_of_volume = 3

    def deformation_gradient(self, u: Any, X: Any) -> Any:
        """F, shape (3, 3), of the displacement u at the reference point X, both shape (2,)."""
        raise NotImplementedError

    def weight(self, X: Any) -> Any:
        """Reference volume per unit area of the plane, and reference area per unit length of a line."""
        raise NotImplementedError

    def area_vector(self, u: Any, X: Any, N: Any) -> Any:
        """Nanson: J F^-T N with its weight, the current area vector per unit reference length, shape (2,)."""
        raise NotImplementedError

    def rigid_motions(self) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
        """{name: displacements, shape (n, 2), of points, shape (n, 2)} of the motions that strain nothing."""
        raise NotImplementedError


class Axisymmetric(Kinematics):
    """Rotational symmetry about R = 0 without twist.

    F = [[1 + u_r,R, u_r,Z, 0], [u_z,R, 1 + u_z,Z, 0], [0, 0, 1 + u_r/R]]; quadrature points never lie on the
    axis, so u_r/R needs no guard.
    """

    axisymmetric = True

    def deformation_gradient(self, u, X):
        return _block(ufl.Identity(2) + ufl.grad(u), 1 + u[0] / X[0])

    def weight(self, X):
        return 2 * ufl.pi * X[0]

    def area_vector(self, u, X, N):
        """See `Kinematics`; a polynomial of degree 3 in P2 displacements: no division by R."""
        return 2 * ufl.pi * (X[0] + u[0]) * _cofactor(ufl.Identity(2) + ufl.grad(u)) * N

    def rigid_motions(self):
        return {"translation along Z": _along_z}


class PlaneStrain(Kinematics):
    """A long body, unit depth: F33 = 1, forces and volumes per unit depth."""

    dimension_of_volume = 2

    def deformation_gradient(self, u, X):
        return _block(ufl.Identity(2) + ufl.grad(u), 1)

    def weight(self, X):
        return 1

    def area_vector(self, u, X, N):
        return _cofactor(ufl.Identity(2) + ufl.grad(u)) * N

    def rigid_motions(self):
        return {"translation along R": lambda X: np.stack([1 + 0 * X[:, 0], 0 * X[:, 0]], 1),
                "translation along Z": _along_z,
                "rotation": lambda X: np.stack([-X[:, 1], X[:, 0]], 1)}


def _along_z(X):
    return np.stack([0 * X[:, 0], 1 + 0 * X[:, 0]], 1)


def volume_ratio(F):
    """J = det F of an F with the block structure of this module."""
    return F[2, 2] * (F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])


def invariants(F):
    """(I1, I2) of C = F^T F: I1 = tr C, I2 = (I1^2 - tr C^2)/2."""
    C = F.T * F
    I1 = ufl.tr(C)
    return I1, (I1**2 - ufl.inner(C, C)) / 2


def sum_of_powers(F, alpha):
    """lambda_1^alpha + lambda_2^alpha + lambda_3^alpha, smooth where in-plane stretches coincide.

    With m and d >= 0 the mean and half difference of the in-plane eigenvalues of C, and a = alpha/2, the in-plane
    part is even in d. Near d = 0 its series in x = (d/m)^2 replaces it, so that value and derivatives have no 0/0;
    beyond, the small eigenvalue is det C / (m + d), which unlike m - d loses no digits in a thin sheet. At the switch,
    x = 1e-4, five terms and round-off both leave second derivatives exact to some 1e-14 of their norm (alpha from -5
    to 10).
    """
    C = F.T * F
    a = alpha / 2
    m = (C[0, 0] + C[1, 1]) / 2
    x = (((C[0, 0] - C[1, 1]) / 2) ** 2 + C[0, 1] * C[1, 0]) / m**2
    near = ufl.lt(x, 1e-4)
    term, series = 2, 2
    for k in (2, 4, 6, 8):
        term = term * (a - k + 2) * (a - k + 1) / (k * (k - 1)) * x
        series = series + term
    large = 1 + ufl.sqrt(ufl.conditional(near, 1e-4, x))        # the branch not taken must be finite too
    small = ((F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]) / m) ** 2 / large
    return m**a * ufl.conditional(near, series, large**a + small**a) + C[2, 2] ** a


def _block(F2, F33):
    return ufl.as_tensor([[F2[0, 0], F2[0, 1], 0], [F2[1, 0], F2[1, 1], 0], [0, 0, F33]])


def _cofactor(F2):
    return ufl.as_tensor([[F2[1, 1], -F2[1, 0]], [-F2[0, 1], F2[0, 0]]])
