"""Confidence intervals of fitted constants."""

from collections.abc import Mapping

from ..errors import fraction

UNDETERMINED = 0.5
"""Standard error, over the value of a constant or half the range of a parameter, from which data leave it open."""


def t_intervals(constants: Mapping[str, float], errors: Mapping[str, float], points: int, confidence: float
                ) -> dict[str, tuple[float, float]]:
    """Return {constant: (low, high)} at c -/+ t s, for values c and standard errors s of least squares.

    Here t is the quantile of Student's t distribution with n - m degrees of freedom, at least one, for n points and m
    constants. A confidence level outside (0, 1) is an InputError.
    """
    from scipy.stats import t
    width = t.ppf((1 + fraction("intervals: confidence", confidence)) / 2, max(points - len(constants), 1))
    return {name: (value - width * errors[name], value + width * errors[name]) for name, value in constants.items()}
