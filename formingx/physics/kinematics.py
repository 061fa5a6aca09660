"""Total Lagrangian kinematics of a meridional (or cross-sectional) plane; the only home of 2 pi R.

Coordinates X = (R, Z), displacement u = (u_r, u_z), in the mesh's unit of length.
"""

from __future__ import annotations

import ufl


class Axisymmetric:
    """Rotational symmetry about R = 0 without twist.

    F = [[1 + u_r,R, u_r,Z, 0], [u_z,R, 1 + u_z,Z, 0], [0, 0, 1 + u_r/R]]; quadrature points never lie on the
    axis, so u_r/R needs no guard.
    """

    dimension_of_volume = 3

    def deformation_gradient(self, u, X):
        """F, shape (3, 3), of the displacement u, shape (2,), at the reference point X, shape (2,)."""
        return _block(ufl.Identity(2) + ufl.grad(u), 1 + u[0] / X[0])

    def weight(self, X):
        """Reference volume per unit area of the plane, and reference area per unit length of a line."""
        return 2 * ufl.pi * X[0]

    def area_vector(self, u, X, N):
        """Nanson: J F^-T N with its weight, the current area vector per unit reference length, shape (2,).

        A polynomial of degree 3 in P2 displacements: no division by R.
        """
        return 2 * ufl.pi * (X[0] + u[0]) * _cofactor(ufl.Identity(2) + ufl.grad(u)) * N


class PlaneStrain:
    """A long body, unit depth: F33 = 1, forces and volumes per unit depth."""

    dimension_of_volume = 2

    def deformation_gradient(self, u, X):
        """F, shape (3, 3), of the displacement u, shape (2,)."""
        return _block(ufl.Identity(2) + ufl.grad(u), 1)

    def weight(self, X):
        """1: everything is per unit depth."""
        return 1

    def area_vector(self, u, X, N):
        """Nanson: J F^-T N, the current area vector per unit reference length and depth, shape (2,)."""
        return _cofactor(ufl.Identity(2) + ufl.grad(u)) * N


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
