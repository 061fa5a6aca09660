"""Uncertainty of fitted constants: covariance, standard errors, and constants that the tests do not determine."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...values.intervals import UNDETERMINED
from ...values.tolerances import MEASURED_ACCURACY

_MIN_STRESS_CHANGE = 1e-6
"""Change of some stress, over its size in the fit, that the step of a difference quotient must reach."""


class Uncertainty(NamedTuple):
    """Uncertainty of the p constants of a least-squares fit.

    Attributes:
        errors: {constant: standard error}.
        undetermined: names of the constants that the tests do not determine.
        covariance: covariance of the constants, shape (p, p), in the order of `errors`.
        slopes: derivatives of the n stresses by the constants, each over the divisor of its misfit, shape (n, p); None
            if they are not known.
    """

    errors: dict[str, float]
    undetermined: tuple[str, ...]
    covariance: np.ndarray
    slopes: np.ndarray | None = None


def uncertainty(stress: Callable, constants: dict[str, float], measured: np.ndarray, sizes: np.ndarray) -> Uncertainty:
    r"""Return the uncertainty of a least-squares fit of stresses whose misfits are divided by given sizes.

    .. math:: \mathrm{cov} = s^2 (J^T J)^{-1}, \quad J_{ij} = \frac{1}{d_i} \frac{\partial P_i}{\partial c_j}, \quad
        s^2 = \frac{1}{n - p} \sum_i \left(\frac{P_i - M_i}{d_i}\right)^2

    with the computed stresses P, the measured ones M, their divisors d and the fitted constants c (Seber and Wild 1989,
    chapter 5). A standard error is nan if there are no more points than constants. It is infinite if doubling the
    constant changes no stress by more than 1e-6 of its divisor. The function `stress` maps constants (p,) to stresses
    (n,); measured stresses and sizes d have shape (n,).
    """
    values = np.array(list(constants.values()), float)
    first = stress(values)
    slopes = np.stack([_slope(stress, first, values, i, sizes) for i in range(len(values))], axis=1)
    lengths = np.linalg.norm(slopes, axis=0)
    effective = lengths > 0
    inverse = np.diag(np.where(effective, 0.0, np.inf)) if not effective.all() else np.zeros((len(values), len(values)))
    if effective.any():
        _, s, V = np.linalg.svd(slopes[:, effective] / lengths[effective], full_matrices=False)
        half = (V / np.maximum(s, 1e-8)[:, None]) / lengths[effective]
        inverse[np.ix_(effective, effective)] = half.T @ half
    unit_errors = np.sqrt(np.diag(inverse))
    squares, freedom = float(np.sum(((first - measured) / sizes) ** 2)), len(measured) - len(values)
    error = math.sqrt(squares / freedom) if freedom > 0 else math.nan
    noise = max(MEASURED_ACCURACY, math.sqrt(squares / len(measured)))
    undetermined = tuple(name for name, value, unit_error in zip(constants, values, unit_errors)
                         if noise * unit_error > UNDETERMINED * abs(value))
    with np.errstate(invalid="ignore"):
        covariance = np.where(inverse == 0, 0.0, error**2 * inverse)
    errors = {name: float(error * unit_error) for name, unit_error in zip(constants, unit_errors)}
    return Uncertainty(errors, undetermined, covariance, slopes)


def _slope(stress: Callable, first: np.ndarray, values: np.ndarray, i: int, sizes: np.ndarray) -> np.ndarray:
    """Return the derivative of the stresses over their sizes, (n,), by constant i of (p,) values.

    The step grows until a stress changes by over 1e-6 of its size; if it exceeds the constant, the result is 0.
    """
    step = math.copysign(max(1e-4 * abs(values[i]), 1e-30), values[i])
    largest = abs(values[i]) or math.inf        # a larger step of an exponent without effect would have one
    for _ in range(50):
        if abs(step) > largest:
            break
        for change in (step, -step)[:1 + (abs(step) < abs(values[i]))]:             # it may be at the upper bound
            moved = (stress(values + change * np.eye(len(values))[i]) - first) / sizes
            if np.all(np.isfinite(moved)) and np.abs(moved).max() > _MIN_STRESS_CHANGE:
                return moved / change
        step *= 10
    return np.zeros(len(first))
