"""Stresses and stretches at points: Cauchy and Piola-Kirchhoff stresses, principal values, tractions on faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np


class FaceStress(NamedTuple):
    """Cauchy stress on faces through n points, in the deformed body.

    With the unit normal (n_r, n_z) of a face, its tangent is (n_z, -n_r).

    Attributes:
        normal: normal traction, positive in tension, continuous across an interface, shape (n,), stress.
        shear: traction along the tangent, continuous across an interface, shape (n,), stress.
        meridional: normal stress in the direction of the tangent, shape (n,), stress.
        hoop: hoop stress, in plane strain the stress out of plane, shape (n,), stress.
    """

    normal: np.ndarray
    shear: np.ndarray
    meridional: np.ndarray
    hoop: np.ndarray


@dataclass(frozen=True)
class Stress:
    """Stresses and stretches at n points.

    Tensor components are ordered r, z, hoop; in plane strain r, z, out of plane.

    Attributes:
        points: reference positions (R, Z), shape (n, 2), length.
        deformation_gradient: deformation gradient F, shape (n, 3, 3).
        second_piola: second Piola-Kirchhoff stress S, shape (n, 3, 3), stress.

    >>> pole = path.stress().at_points([(0.0, 0.15)])
    >>> pole.principal_stretches.round(1).tolist(), pole.principal_stresses[:, 0].round(1).tolist()
    ([[2.3, 0.2, 2.3]], [4.0])
    """

    points: np.ndarray
    deformation_gradient: np.ndarray
    second_piola: np.ndarray

    @cached_property
    def first_piola(self) -> np.ndarray:
        """First Piola-Kirchhoff stress P = F S, shape (n, 3, 3), stress.

        P N is the force per reference area on a face with the unit normal N in the reference configuration.
        """
        return self.deformation_gradient @ self.second_piola

    @cached_property
    def cauchy(self) -> np.ndarray:
        """Cauchy stress sigma = F S F^T / J, J = det F, positive in tension, shape (n, 3, 3), stress."""
        F = self.deformation_gradient
        return self.first_piola @ F.transpose(0, 2, 1) / (_det(F) * F[:, 2, 2])[:, None, None]

    @property
    def hydrostatic_pressure(self) -> np.ndarray:
        """Hydrostatic pressure -tr(sigma) / 3, sigma: Cauchy stress; positive in compression, shape (n,), stress."""
        return -np.trace(self.cauchy, axis1=1, axis2=2) / 3

    @property
    def principal_stretches(self) -> np.ndarray:
        """Larger and smaller principal stretch in the section, then the hoop stretch, shape (n, 3).

        In plane strain the third stretch is the one out of plane, 1.
        """
        F = self.deformation_gradient
        larger = (np.hypot(F[:, 0, 0] + F[:, 1, 1], F[:, 0, 1] - F[:, 1, 0])
                  + np.hypot(F[:, 0, 0] - F[:, 1, 1], F[:, 0, 1] + F[:, 1, 0])) / 2
        return np.column_stack([larger, np.abs(_det(F)) / larger, F[:, 2, 2]])

    @property
    def principal_stresses(self) -> np.ndarray:
        """Principal Cauchy stresses in descending order, shape (n, 3), stress."""
        s = self.cauchy
        mean, radius = (s[:, 0, 0] + s[:, 1, 1]) / 2, np.hypot((s[:, 0, 0] - s[:, 1, 1]) / 2, s[:, 0, 1])
        return np.sort(np.column_stack([mean + radius, mean - radius, s[:, 2, 2]]))[:, ::-1]

    def on_face(self, normal: Any) -> FaceStress:
        """Return the Cauchy stress on material faces through the points.

        The unit normal n of a deformed face follows from its reference normal N (Nanson's formula):

        .. math::
            n = F^{-T} N / |F^{-T} N|

        Args:
            normal: normals (N_R, N_Z) of the faces in the reference configuration, of any length, shape (2,) or (n, 2).

        Returns:
            The stress on the deformed faces.
        """
        N = np.broadcast_to(np.asarray(normal, dtype=float), self.points.shape)
        n = np.linalg.solve(self.deformation_gradient[:, :2, :2].transpose(0, 2, 1), N[..., None])[..., 0]
        n /= np.linalg.norm(n, axis=1)[:, None]
        m = np.column_stack([n[:, 1], -n[:, 0]])
        s = self.cauchy[:, :2, :2]

        def component(a, b):
            return np.einsum("ni,nij,nj->n", a, s, b)
        return FaceStress(component(n, n), component(m, n), component(m, m), self.cauchy[:, 2, 2])


def _det(F: np.ndarray) -> np.ndarray:
    """Return the determinants of the upper left 2 x 2 blocks of deformation gradients F (n, 3, 3), shape (n,)."""
    return F[:, 0, 0] * F[:, 1, 1] - F[:, 0, 1] * F[:, 1, 0]
