"""How well tests fix the constants of a fit: standard errors, and which constants are left open."""

import math
from collections.abc import Callable

import numpy as np

_NOISE = 0.01
"""Share of the largest stress that a measurement is wrong by, where the misfit does not say more."""
_OPEN = 0.5
"""A constant that this leaves so far uncertain, relative, is open."""
_VISIBLE = 1e-6
"""A change of a constant is made larger until the stress changes by this share of the largest."""


def uncertainty(stress: Callable, constants: dict[str, float], measured: np.ndarray
                ) -> tuple[dict[str, float], tuple[str, ...]]:
    """({constant: standard error}, the names of those that are open) of a least-squares fit.

    The covariance is s^2 (J^T J)^-1, J the derivatives of the stresses by the constants at the optimum, s^2 the sum of
    the squared misfits over the points in excess of the constants (Seber and Wild 1989, chapter 5; not a number where
    there are none in excess, infinite where a constant can be doubled unseen).

    Args:
        stress: called with constants, shape (p,); the stresses at all points, shape (n,), not finite beyond a limit.
        constants: {name: value} of the fit, with p entries.
        measured: the measured stresses, shape (n,).
    """
    values, scale = np.array(list(constants.values()), float), np.abs(measured).max()
    first = stress(values)
    slopes = np.stack([_slope(stress, first, values, i, scale) for i in range(len(values))], axis=1)
    sizes = np.linalg.norm(slopes, axis=0)
    matter = sizes > 0
    spread = np.full(len(values), np.inf)
    if matter.any():
        _, s, V = np.linalg.svd(slopes[:, matter] / sizes[matter], full_matrices=False)
        spread[matter] = np.sqrt(np.sum((V / np.maximum(s, 1e-8)[:, None]) ** 2, axis=0)) / sizes[matter]
    squares, excess = float(np.sum((first - measured) ** 2)), len(measured) - len(values)
    error = math.sqrt(squares / excess) if excess > 0 else math.nan
    noise = max(_NOISE * scale, math.sqrt(squares / len(measured)))
    open_ = [name for name, value, each in zip(constants, values, spread) if noise * each > _OPEN * abs(value)]
    return {name: float(error * each) for name, each in zip(constants, spread)}, tuple(open_)


def _slope(stress: Callable, first: np.ndarray, values: np.ndarray, i: int, scale: float) -> np.ndarray:
    """Derivative of the stresses by a constant; 0 where no change of it can be seen."""
    step = math.copysign(max(1e-4 * abs(values[i]), 1e-30), values[i])
    largest = abs(values[i]) or math.inf                    # further, a power that does not matter would come to
    for _ in range(50):
        if abs(step) > largest:
            break
        for change in (step, -step)[:1 + (abs(step) < abs(values[i]))]:             # it may be at the upper bound
            moved = stress(values + change * np.eye(len(values))[i]) - first
            if np.all(np.isfinite(moved)) and np.abs(moved).max() > _VISIBLE * scale:
                return moved / change
        step *= 10
    return np.zeros(len(first))
