"""Time steps by TR-BDF2, which is of second order and L-stable, with an error estimate.

Bank et al., IEEE Trans. CAD 4 (1985) 436-451; as a Runge-Kutta method with an embedded one of third order: Hosea and
Shampine, Appl. Numer. Math. 20 (1996) 21-37. A jump of temperature at a face decays in the first steps. The trapezoidal
rule would oscillate instead.
"""

from typing import NamedTuple

import numpy as np

from .conduction import Conduction

_D, _W = 1 - np.sqrt(0.5), np.sqrt(0.125)
WEIGHTS = np.array([_W, _W, _D])
_ERROR = WEIGHTS - np.array([1 - _W, 3 * _W + 1, _D]) / 3


class Step(NamedTuple):
    """Result of a trial step.

    Attributes:
        state: [T, *lines] at its end.
        error: estimated error of the step, degrees.
        stored: heat that the body stores in the step.
        heats: heat through each boundary and source, in the order of `Conduction.names`.
    """

    state: list[np.ndarray]
    error: float
    stored: float
    heats: np.ndarray


def step(body: Conduction, state: list[np.ndarray], dt: float) -> Step:
    """Take one step of TR-BDF2 from a state.

    Args:
        body: the heat equation.
        state: [T, *lines].
        dt: length of the step, time.

    Returns:
        Result of the step.

    Raises:
        ConvergenceError: Newton's method found no solution in a stage.
    """
    c = dt * _D
    first, heats_first = body.rates(state)
    second = body.stage(state, [c * r for r in first], c, np.zeros_like(state[0]))
    known = [dt * _W * (a + b) for a, b in zip(first, second.rates)]
    third = body.stage(state, known, c, second.changes[0])
    rates = (first, second.rates, third.rates)
    errors = [dt * sum(w * r for w, r in zip(_ERROR, parts)) for parts in zip(*rates)]
    error = body.difference(errors, c)
    change = third.changes
    missing = body.mass(change[0]) - dt * sum(w * r[0] for w, r in zip(WEIGHTS, rates))
    through = dt * (WEIGHTS @ np.array([heats_first, second.heats, third.heats]))
    return Step([a + b for a, b in zip(state, change)], error, body.stored(change[0]),
                np.concatenate([through, body.through_fixed_faces(missing)]))


def next_length(dt: float, error: float, tolerance: float) -> float:
    """Return the length of the step that just meets the tolerance, with a safety factor, at most five times the last.

    Args:
        dt: length of the last step, time.
        error: its estimated error, degrees.
        tolerance: largest allowed error, degrees.

    Returns:
        Length, time.
    """
    return dt * float(np.clip(0.9 * (tolerance / max(error, 1e-300)) ** (1 / 3), 0.1, 5.0))


def fitted(dt: float, left: float) -> float:
    """Return the length of a step that leaves no short remainder before a time that must be hit.

    Args:
        dt: length that the error allows, time.
        left: time until then.

    Returns:
        Length, about `dt`.
    """
    return left if dt >= left * (1 - 1e-9) else min(dt, left / 2)

