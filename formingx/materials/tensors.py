"""Symmetric tensors with one principal direction normal to the section, as entries 11, 22, 12, 33 (UFL or NumPy)."""

from typing import Any

from ..physics import kinematics

Entries = tuple[Any, Any, Any, Any]
IDENTITY = (1.0, 1.0, 0.0, 1.0)


def isochoric(F: Any) -> Entries:
    r"""Return the isochoric right Cauchy-Green tensor.

    .. math:: \bar C = J^{-2/3} F^T F

    F (UFL) has shape (3, 3); the result has the entries (11, 22, 12, 33), with the axis of 33 normal to the others.
    """
    F = kinematics.in_section_order(F)
    C, scale = F.T * F, kinematics.volume_ratio(F) ** (-2 / 3)
    return scale * C[0, 0], scale * C[1, 1], scale * C[0, 1], scale * C[2, 2]


def entries(vector: Any) -> Entries:
    """Return the entries of a tensor stored as a vector 11, 22, 12, 33, shape (4,), as a tuple."""
    return vector[0], vector[1], vector[2], vector[3]


def plus(A: Entries, B: Entries, factor: Any) -> Entries:
    """Return A + c B with the factor c, entries (11, 22, 12, 33) each."""
    return tuple(a + factor * b for a, b in zip(A, B))              # type: ignore[return-value]


def inner(A: Entries, B: Entries) -> Any:
    r"""Return the inner product of two symmetric tensors.

    .. math:: A : B = \mathrm{tr}(A B) = A_{11} B_{11} + A_{22} B_{22} + 2 A_{12} B_{12} + A_{33} B_{33}

    Both have the entries (11, 22, 12, 33).
    """
    return A[0] * B[0] + A[1] * B[1] + 2 * A[2] * B[2] + A[3] * B[3]


def determinant(A: Entries) -> Any:
    r"""Return the determinant of a tensor.

    .. math:: \det A = A_{33} (A_{11} A_{22} - A_{12}^2)

    The tensor has the entries (11, 22, 12, 33).
    """
    return A[3] * (A[0] * A[1] - A[2] ** 2)


def cofactor(A: Entries) -> Entries:
    r"""Return the cofactor of a symmetric tensor, which equals its inverse if the determinant is 1.

    .. math:: \mathrm{cof} \, A = \det(A) \, A^{-1}

    Both have the entries (11, 22, 12, 33).
    """
    return A[1] * A[3], A[0] * A[3], -A[2] * A[3], A[0] * A[1] - A[2] ** 2


def deviator_squared(C: Entries, B: Entries) -> Any:
    r"""Return the squared norm of the deviator of F B F^T, for C = F^T F.

    .. math:: |\mathrm{dev}(F B F^T)|^2 = \mathrm{tr}\,(C B)^2 - \tfrac{1}{3} (\mathrm{tr}\, C B)^2

    Both have the entries (11, 22, 12, 33).
    """
    t = C[0] * B[0] + C[1] * B[1] + 2 * C[2] * B[2]
    d = (C[0] * C[1] - C[2] ** 2) * (B[0] * B[1] - B[2] ** 2)
    third = C[3] * B[3]
    return (t**2 - 4 * d) / 2 + (t - 2 * third) ** 2 / 6
