"""Estimated error of the stresses in a state: per cell, in total, and at the stress peak."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...findings import coordinates
from ...values.tolerances import LARGE_ERROR


class StressError(NamedTuple):
    """Estimated errors of the Cauchy stress in n cells of all ranks.

    |.| is the Frobenius norm, sigma_h the computed stress and sigma* the more accurate one: the fitted or the exact
    stress. Volumes belong to the reference configuration and to the whole ring, in plane strain to unit depth.

    Attributes:
        points: mean reference position (R, Z) of the quadrature points of each cell, shape (n, 2), length.
        volume: volumes of the cells, shape (n,), length^3.
        cells: root of the integral of |sigma* - sigma_h|^2 over each cell, shape (n,), stress * volume^(1/2).
        stress: root of the integral of |sigma_h|^2 over each cell, shape (n,), stress * volume^(1/2).
    """

    points: np.ndarray
    volume: np.ndarray
    cells: np.ndarray
    stress: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Root mean square over each cell of the error |sigma* - sigma_h|, shape (n,), stress.

        sigma_h is the computed stress, sigma* the fitted or the exact one.
        """
        return self.cells / np.sqrt(self.volume)

    @property
    def total(self) -> float:
        """Root of the integral of the squared error |sigma* - sigma_h|^2 over all cells, stress * volume^(1/2).

        sigma_h is the computed stress, sigma* the fitted or the exact one.
        """
        return float(np.linalg.norm(self.cells))

    @property
    def relative(self) -> float:
        r"""Relative error of the stress over all cells, between 0 and 1; 0 without stress.

        sigma_h is the computed stress, sigma* the fitted or the exact one.

        .. math::
            \eta = \left(\frac{\int |\sigma^* - \sigma_h|^2 \, dV}
            {\int |\sigma_h|^2 + |\sigma^* - \sigma_h|^2 \, dV}\right)^{1/2}
        """
        scale = np.hypot(np.linalg.norm(self.stress), self.total)
        return float(self.total / scale) if scale > 0 else 0.0


class StressPeak(NamedTuple):
    """Largest principal Cauchy stress of a state, and the cell whose stress may be larger within its estimated error.

    The fitted stress sigma* is smoother than the computed stress sigma_h. The error of a cell is the largest Frobenius
    norm |sigma* - sigma_h| at its quadrature points. The stress of a cell is its largest principal stress, from sigma*
    at its corners. The doubtful cell has the largest sum of stress and error.

    Attributes:
        value: largest stress of all cells, stress.
        point: reference position (R, Z) of the corner with this stress, shape (2,), length.
        error: largest error of the cells that have this corner, stress.
        doubtful: stress of the doubtful cell, stress.
        doubtful_point: reference position (R, Z) of the corner with this stress, shape (2,), length.
        doubtful_error: error of the doubtful cell, stress.
    """

    value: float
    point: np.ndarray
    error: float
    doubtful: float
    doubtful_point: np.ndarray
    doubtful_error: float

    @classmethod
    def among(cls, sigma: np.ndarray, corners: np.ndarray, error: np.ndarray) -> StressPeak:
        """Return the stress peak among n cells.

        Args:
            sigma: largest fitted principal stress at the corners of each cell, shape (n,), stress.
            corners: reference position (R, Z) of the corner of each cell at which it occurs, shape (n, 2), length.
            error: error of each cell, shape (n,), stress.
        """
        top, worst = int(np.argmax(sigma)), int(np.argmax(sigma + error))
        same_corner = np.hypot(*(corners - corners[top]).T) <= 1e-9 * np.abs(corners).max()
        return cls(float(sigma[top]), corners[top], float(error[same_corner].max()), float(sigma[worst]),
                   corners[worst], float(error[worst]))

    @property
    def converged(self) -> bool:
        """True if the doubtful stress plus its error exceeds the largest principal stress `value` by at most 5 %."""
        return self.doubtful + self.doubtful_error - self.value <= LARGE_ERROR * abs(self.value)

    def __str__(self) -> str:
        largest = (f"the largest sigma_1 is {self.value:.4g} at (R, Z) = {coordinates(self.point)}, estimated error"
                   f" {self.error:.2g}")
        if self.converged:
            return largest
        return (f"the stress peak at (R, Z) = {coordinates(self.doubtful_point)} has not converged: sigma_1 is"
                f" {self.doubtful:.4g} there, its estimated error {self.doubtful_error:.2g} ({largest}). Refine the"
                f" mesh there; where a tool has a sharp edge, a clamp begins or sticking contact ends, stress has no"
                f" limit")


class Fitted(NamedTuple):
    """Computed and fitted Cauchy stress at the q quadrature points of each of the m cells that this rank owns.

    The fit is made to the deformation gradient F and the second Piola-Kirchhoff stress S.

    Attributes:
        points: reference positions (R, Z) of the quadrature points, shape (m, q, 2), length.
        volume: reference volumes of the quadrature points (quadrature weights), shape (m, q), length^3.
        raw: computed Cauchy stress sigma_h, shape (m, q, 3, 3), stress.
        smooth: fitted Cauchy stress sigma*, shape (m, q, 3, 3), stress.
        cubics: coefficients of the cubics (`Patches`) fitted to F_rr, F_rz, F_zr, F_zz, F_hoop, S_rr, S_rz, S_zz and
            S_hoop, shape (m, 10, 9); the pressure of the layer is split off S.
        pressures: pressure of the layer of each cell, shape (m,), stress.
    """

    points: np.ndarray
    volume: np.ndarray
    raw: np.ndarray
    smooth: np.ndarray
    cubics: np.ndarray
    pressures: np.ndarray

    def error(self, exact: Callable | None = None) -> StressError:
        """Return the errors of the computed stress in this rank's cells: its differences from a more accurate stress.

        `exact`: function of positions (n, 2) to (n, 3, 3), default the fitted one; others: InputError.
        """
        better = self.smooth
        if exact is not None:
            if not callable(exact):
                raise InputError(f"stress error: exact = {exact!r}: must be a function of points, shape (n, 2)")
            try:
                better = np.asarray(exact(self.points.reshape(-1, self.points.shape[-1])), dtype=float)
            except (TypeError, ValueError) as error:
                raise InputError(f"stress error: exact: the function of points fails: {error}") from error
            if better.shape != (self.volume.size, 3, 3):
                raise InputError(f"stress error: exact gives an array of shape {better.shape} at {self.volume.size}"
                                 f" points: must be {(self.volume.size, 3, 3)}")
        difference = better.reshape(self.raw.shape) - self.raw
        integrals = (np.sqrt((self.volume * (v**2).sum((2, 3))).sum(1)) for v in (difference, self.raw))
        return StressError(self.points.mean(1), self.volume.sum(1), *integrals)
