"""Symmetric tensors with one principal direction normal to the section, as entries 11, 22, 12, 33 (UFL or NumPy)."""

from typing import Any

from ..physics import kinematics

Entries = tuple[Any, Any, Any, Any]
IDENTITY = (1.0, 1.0, 0.0, 1.0)


def isochoric(F: Any) -> Entries:
    """Return J^(-2/3) F^T F (UFL) of F, shape (3, 3): entries (11, 22, 12, 33), axis 3 normal to the others."""
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
    """Return A : B = tr(A B) of two symmetric tensors with the entries (11, 22, 12, 33)."""
    return A[0] * B[0] + A[1] * B[1] + 2 * A[2] * B[2] + A[3] * B[3]


def determinant(A: Entries) -> Any:
    """Return det A = A33 (A11 A22 - A12^2) of a tensor with the entries (11, 22, 12, 33)."""
    return A[3] * (A[0] * A[1] - A[2] ** 2)


def cofactor(A: Entries) -> Entries:
    """Return det(A) A^-1 of a symmetric tensor, its inverse if det A = 1; entries (11, 22, 12, 33)."""
    return A[1] * A[3], A[0] * A[3], -A[2] * A[3], A[0] * A[1] - A[2] ** 2


def deviator_squared(C: Entries, B: Entries) -> Any:
    """Return |dev(F B F^T)|^2 = tr (C B)^2 - (tr C B)^2/3 for C = F^T F; entries (11, 22, 12, 33)."""
    t = C[0] * B[0] + C[1] * B[1] + 2 * C[2] * B[2]
    d = (C[0] * C[1] - C[2] ** 2) * (B[0] * B[1] - B[2] ** 2)
    third = C[3] * B[3]
    return (t**2 - 4 * d) / 2 + (t - 2 * third) ** 2 / 6
