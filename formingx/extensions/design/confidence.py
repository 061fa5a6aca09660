"""Confidence of parameters fitted to a measured wall, and parameters that the wall leaves undetermined."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from ...values.intervals import UNDETERMINED, t_intervals

_INDISTINGUISHABLE = 0.9
"""Correlation above which two undetermined parameters cannot be distinguished."""


@dataclass(frozen=True)
class Confidence:
    """Uncertainty of design parameters that were fitted to a measured wall, to first order; its text is a report.

    A parameter that is a profile counts as several parameters, one for each knot.

    Attributes:
        names: names of the n parameters.
        values: fitted values, shape (n,).
        covariance: covariance of the values, shape (n, n).
        sizes: ranges of the parameters between their bounds, shape (n,).
        points: number of measured points.
    """

    names: list[str]
    values: np.ndarray
    covariance: np.ndarray
    sizes: np.ndarray
    points: int

    @property
    def errors(self) -> dict[str, float]:
        """Standard error of each fitted parameter: {parameter: standard error}."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist()))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation matrix of the n fitted parameters, shape (n, n)."""
        size = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(size, size)

    def intervals(self, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return the confidence interval of each fitted parameter by Student's t distribution.

        Args:
            confidence: confidence level, between 0 and 1.

        Returns:
            {parameter: (lowest, highest)}.

        Raises:
            InputError: a confidence outside (0, 1).
        """
        values = {name: float(value) for name, value in zip(self.names, self.values)}
        return t_intervals(values, self.errors, self.points, confidence)

    @property
    def undetermined(self) -> list[str]:
        """Names of the parameters that the measured wall does not determine.

        Their standard error exceeds a quarter of their range.
        """
        return [name for (name, error), size in zip(self.errors.items(), self.sizes) if error > UNDETERMINED * size / 2]

    @property
    def indistinguishable(self) -> list[tuple[str, str, float]]:
        """Pairs of undetermined parameters with similar effects on the wall: (name, name, correlation).

        The absolute value of the correlation exceeds 0.9.
        """
        n, C, undetermined = len(self.names), self.correlation, self.undetermined
        return [(self.names[i], self.names[j], float(C[i, j])) for i in range(n) for j in range(i)
                if abs(C[i, j]) > _INDISTINGUISHABLE and {self.names[i], self.names[j]} <= {*undetermined}]

    def __str__(self) -> str:
        lines = [f"{'':16}{'value':>10}{'error':>10}{'95 % from':>12}{'to':>10}"]
        lines += [f"{name:16}{value:10.4g}{error:10.2g}{low:12.4g}{high:10.4g}" for value, (name, error), (low, high)
                  in zip(self.values, self.errors.items(), self.intervals().values())]
        lines += [f"the measured wall does not determine {name}" for name in self.undetermined]
        lines += [f"{a} and {b} cannot be distinguished: correlation {c:.2f}" for a, b, c in self.indistinguishable]
        return "\n".join(lines)

    __repr__ = __str__


def confidence(run: Any, measured: Any) -> Confidence:
    r"""Return the uncertainty of design parameters that were fitted to a measured wall.

    With the computed walls h and the measured walls w at m points, and the n parameters p, the covariance is

    .. math:: C = s^2 (J^T J)^{-1}, \quad J_{ij} = \frac{1}{w_i} \frac{\partial h_i}{\partial p_j}, \quad
        s^2 = \frac{1}{m - n} \sum_i \left(\frac{h_i}{w_i} - 1\right)^2

    The measured wall has m points; an InputError says if m is no larger than n, or if the run has no derivative.
    """
    wall, jacobian = run.derivative(measured.of_path)
    residual, size = wall / measured.wall - 1, run.parameters.size
    J = jacobian / measured.wall[:, None] * run.parameters.size
    m, n = J.shape
    if m <= n:
        raise InputError(f"confidence: {m} measured walls for {n} parameters: their scatter is not known; measure more"
                         f" points than there are parameters")
    _, s, V = np.linalg.svd(J, full_matrices=False)
    half = V / np.maximum(s, 1e-12 * max(s.max(), 1e-300))[:, None] * size
    return Confidence(run.parameters.names, run.vector, float(residual @ residual) / (m - n) * (half.T @ half), size, m)
