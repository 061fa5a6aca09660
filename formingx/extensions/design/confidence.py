"""Confidence of parameters fitted to a measured wall, and parameters that the wall leaves undetermined."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, finite

_OPEN = 0.25
"""Standard error over the range of a parameter above which the wall leaves it undetermined."""
_ALIKE = 0.9
"""Correlation above which two undetermined parameters cannot be told apart."""


@dataclass(frozen=True)
class Confidence:
    """Uncertainty of the best design of a fit to a measured wall, to first order; print it.

    Attributes:
        names: names of the n numbers of the design.
        values: values of the best design, shape (n,).
        covariance: their covariance, shape (n, n).
        sizes: ranges of the parameters, shape (n,).
        points: number of measured points.
    """

    names: list[str]
    values: np.ndarray
    covariance: np.ndarray
    sizes: np.ndarray
    points: int

    @property
    def errors(self) -> dict[str, float]:
        """Standard error of each parameter, by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist()))

    @property
    def correlation(self) -> np.ndarray:
        """Correlations of the parameters, shape (n, n)."""
        size = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(size, size)

    def intervals(self, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return the confidence interval of each parameter by Student's t distribution.

        Args:
            confidence: confidence level, between 0 and 1.

        Returns:
            {parameter: (lowest, highest)}.

        Raises:
            InputError: a confidence outside (0, 1).
        """
        from scipy.stats import t
        if not 0 < (confidence := finite("intervals: confidence", confidence)) < 1:
            raise InputError(f"intervals: confidence = {confidence!r}: must be between 0 and 1")
        width = t.ppf((1 + confidence) / 2, max(self.points - len(self.names), 1))
        return {name: (value - width * error, value + width * error)
                for value, (name, error) in zip(self.values.tolist(), self.errors.items())}

    @property
    def not_told(self) -> list[str]:
        """Parameters that the wall leaves undetermined: the standard error exceeds a quarter of the range."""
        return [name for (name, error), size in zip(self.errors.items(), self.sizes) if error > _OPEN * size]

    @property
    def not_told_apart(self) -> list[tuple[str, str, float]]:
        """Pairs of undetermined parameters with like effects on the wall: (parameter, parameter, correlation)."""
        n, C, open_ = len(self.names), self.correlation, self.not_told
        return [(self.names[i], self.names[j], float(C[i, j])) for i in range(n) for j in range(i)
                if abs(C[i, j]) > _ALIKE and {self.names[i], self.names[j]} <= {*open_}]

    def __str__(self) -> str:
        lines = [f"{'':16}{'value':>10}{'error':>10}{'95 % from':>12}{'to':>10}"]
        lines += [f"{name:16}{value:10.4g}{error:10.2g}{low:12.4g}{high:10.4g}" for value, (name, error), (low, high)
                  in zip(self.values, self.errors.items(), self.intervals().values())]
        lines += [f"the measured wall does not tell {name}" for name in self.not_told]
        lines += [f"{a} and {b} cannot be told apart: correlation {c:.2f}" for a, b, c in self.not_told_apart]
        return "\n".join(lines)

    __repr__ = __str__


def confidence(run: Any, measured: Any) -> Confidence:
    r"""Return the confidence of a run fitted to a measured wall, from its derivatives.

    With the m measured walls w and the n parameters p:

    .. math:: C = s^2 (J^T J)^{-1}, \quad J_{ij} = \frac{1}{w_i} \frac{\partial w_i}{\partial p_j}, \quad
        s^2 = \frac{1}{m - n} \sum_i r_i^2

    where r are the relative deviations of the walls.

    Args:
        run: the run.
        measured: the `MeasuredWall`.

    Returns:
        The confidence.

    Raises:
        InputError: the wall has no more points than there are parameters.
    """
    wall, jacobian = run.derivative(measured.of_path)
    left, size = wall / measured.wall - 1, run.parameters.size
    J = jacobian / measured.wall[:, None] * run.parameters.size
    m, n = J.shape
    if m <= n:
        raise InputError(f"confidence: {m} measured walls for {n} parameters: their scatter is not known; measure more"
                         f" points than there are parameters")
    _, s, V = np.linalg.svd(J, full_matrices=False)
    half = V / np.maximum(s, 1e-12 * max(s.max(), 1e-300))[:, None] * size
    return Confidence(run.parameters.names, run.vector, float(left @ left) / (m - n) * (half.T @ half), size, m)
