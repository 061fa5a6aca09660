"""Confidence intervals of fitted constants."""

from collections.abc import Mapping

from ..errors import fraction


def t_intervals(constants: Mapping[str, float], errors: Mapping[str, float], points: int, confidence: float
                ) -> dict[str, tuple[float, float]]:
    """Return the confidence intervals of constants of a least-squares fit by Student's t distribution.

    Args:
        constants: {constant: fitted value}.
        errors: {constant: standard error}.
        points: number of measured points.
        confidence: confidence level, between 0 and 1.

    Returns:
        {constant: (lowest, highest)}.

    Raises:
        InputError: a confidence outside (0, 1).
    """
    from scipy.stats import t
    width = t.ppf((1 + fraction("intervals: confidence", confidence)) / 2, max(points - len(constants), 1))
    return {name: (value - width * errors[name], value + width * errors[name]) for name, value in constants.items()}
