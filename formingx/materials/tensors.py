"""Symmetric tensors with one principal direction normal to the plane, as entries 11, 22, 12, 33 (UFL or NumPy)."""

from typing import Any

from ..physics import kinematics

Entries = tuple[Any, Any, Any, Any]
IDENTITY = (1.0, 1.0, 0.0, 1.0)


def isochoric(F: Any) -> Entries:
    r"""Return the isochoric right Cauchy-Green tensor.

    .. math:: \bar C = J^{-2/3} F^T F

    Args:
        F: deformation gradient, shape (3, 3).

    Returns:
        Its entries.
    """
    C, scale = F.T * F, kinematics.volume_ratio(F) ** (-2 / 3)
    return scale * C[0, 0], scale * C[1, 1], scale * C[0, 1], scale * C[2, 2]


def entries(vector: Any) -> Entries:
    """Return the entries of a vector.

    Args:
        vector: vector, shape (4,).

    Returns:
        Its entries.
    """
    return vector[0], vector[1], vector[2], vector[3]


def plus(A: Entries, B: Entries, factor: Any) -> Entries:
    """Return A + factor B.

    Args:
        A: entries of a tensor.
        B: entries of a tensor.
        factor: factor of B.

    Returns:
        Entries of the sum.
    """
    return tuple(a + factor * b for a, b in zip(A, B))              # type: ignore[return-value]


def inner(A: Entries, B: Entries) -> Any:
    """Return A : B.

    Args:
        A: entries of a tensor.
        B: entries of a tensor.

    Returns:
        The inner product.
    """
    return A[0] * B[0] + A[1] * B[1] + 2 * A[2] * B[2] + A[3] * B[3]


def determinant(A: Entries) -> Any:
    """Return the determinant of a tensor.

    Args:
        A: its entries.

    Returns:
        The determinant.
    """
    return A[3] * (A[0] * A[1] - A[2] ** 2)


def cofactor(A: Entries) -> Entries:
    """Return the cofactor of a tensor, which is its inverse if its determinant is 1.

    Args:
        A: its entries.

    Returns:
        Entries of the cofactor.
    """
    return A[1] * A[3], A[0] * A[3], -A[2] * A[3], A[0] * A[1] - A[2] ** 2


def deviator_squared(C: Entries, B: Entries) -> Any:
    r"""Return the squared norm of the deviator of F B F^T.

    .. math:: \mathrm{tr}\,(C B)^2 - \tfrac{1}{3} (\mathrm{tr}\, C B)^2

    Args:
        C: entries of the right Cauchy-Green tensor.
        B: entries of a tensor.

    Returns:
        The squared norm.
    """
    t = C[0] * B[0] + C[1] * B[1] + 2 * C[2] * B[2]
    d = (C[0] * C[1] - C[2] ** 2) * (B[0] * B[1] - B[2] ** 2)
    third = C[3] * B[3]
    return (t**2 - 4 * d) / 2 + (t - 2 * third) ** 2 / 6
