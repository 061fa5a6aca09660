"""Estimated error of the stresses of a state: cell by cell, in all, and at their peak."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...errors import InputError

RESOLVED = 0.05
"""Relative amount by which sigma_1 and its estimated error may exceed the stress peak of a converged result."""


class StressError(NamedTuple):
    """Estimated errors of the Cauchy stress of n cells of all ranks; |.| is the root of the sum of all squares.

    Volumes are reference volumes (axisymmetric: of the whole ring; plane strain: of unit depth); those of the deformed
    cells are the same as far as the volume is kept.

    Attributes:
        points: reference points (R, Z) in the middle of the cells, shape (n, 2), length.
        volume: of the cells, shape (n,).
        cells: root of the integral of |sigma* - sigma_h|^2 over each cell, shape (n,), stress * volume^(1/2).
        stress: root of the integral of |sigma_h|^2 over each cell, shape (n,), stress * volume^(1/2).
    """

    points: np.ndarray
    volume: np.ndarray
    cells: np.ndarray
    stress: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Root mean square of |sigma* - sigma_h| in each cell, shape (n,), stress."""
        return self.cells / np.sqrt(self.volume)

    @property
    def total(self) -> float:
        """Root of the integral of |sigma* - sigma_h|^2 over all cells, stress * volume^(1/2)."""
        return float(np.linalg.norm(self.cells))

    @property
    def relative(self) -> float:
        """`total` over the root of the integral of |sigma_h|^2 + |sigma* - sigma_h|^2; 0 without any stress."""
        whole = np.hypot(np.linalg.norm(self.stress), self.total)
        return float(self.total / whole) if whole > 0 else 0.0


class StressPeak(NamedTuple):
    """The largest principal Cauchy stress, and where the estimated errors leave room for a larger one.

    Attributes:
        value: the largest sigma_1 of the fitted stress sigma* at a corner of a cell, stress.
        point: the reference point (R, Z) where it is, shape (2,), length.
        error: the largest |sigma* - sigma_h| at a quadrature point of the cells there, stress.
        doubtful: sigma_1 in the cell where sigma_1 and such an error add up to most, stress.
        doubtful_point: the corner (R, Z) of that cell where it is, shape (2,), length.
        doubtful_error: the error of that cell, stress.
    """

    value: float
    point: np.ndarray
    error: float
    doubtful: float
    doubtful_point: np.ndarray
    doubtful_error: float

    @classmethod
    def among(cls, sigma: np.ndarray, at: np.ndarray, error: np.ndarray) -> StressPeak:
        """Return the peak of n cells: largest sigma_1, shape (n,), the corner where it is, (n, 2), largest error,
        (n,)."""
        top, worst = int(np.argmax(sigma)), int(np.argmax(sigma + error))
        there = np.hypot(*(at - at[top]).T) <= 1e-9 * np.abs(at).max()
        return cls(float(sigma[top]), at[top], float(error[there].max()), float(sigma[worst]), at[worst],
                   float(error[worst]))

    @property
    def converged(self) -> bool:
        """True if nowhere sigma_1 and its error add up to more than 1.05 times the largest sigma_1."""
        return self.doubtful + self.doubtful_error - self.value <= RESOLVED * abs(self.value)

    def __str__(self) -> str:
        largest = f"the largest sigma_1 is {self.value:.4g} at {_show(self.point)}, estimated error {self.error:.2g}"
        if self.converged:
            return largest
        return (f"the stress peak at {_show(self.doubtful_point)} has not converged: sigma_1 is {self.doubtful:.4g}"
                f" there, its estimated error {self.doubtful_error:.2g} ({largest}). Refine the mesh there; where a"
                f" tool has a sharp edge, a clamp begins or sticking contact ends, stress has no limit")


def _show(point: np.ndarray) -> str:
    return f"(R, Z) = ({point[0]:.4g}, {point[1]:.4g})"


class Fitted(NamedTuple):
    """Recovered F and S of m locally owned cells, at q quadrature points of each.

    Attributes:
        points: reference points (R, Z), shape (m, q, 2), length.
        volume: reference volumes that belong to them, shape (m, q).
        raw, smooth: sigma_h and sigma*, shape (m, q, 3, 3), stress.
        cubics: the cubics of the fit (`Patches`), shape (m, 10, k).
    """

    points: np.ndarray
    volume: np.ndarray
    raw: np.ndarray
    smooth: np.ndarray
    cubics: np.ndarray

    def error(self, exact: Callable | None = None) -> StressError:
        """See `StressField.error`."""
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
