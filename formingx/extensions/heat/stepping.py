"""Time steps by TR-BDF2, which is of second order and L-stable, with an error estimate.

Bank et al., IEEE Trans. CAD 4 (1985) 436-451; as a Runge-Kutta method with an embedded one of third order: Hosea and
Shampine, Appl. Numer. Math. 20 (1996) 21-37. A jump of temperature at a face decays in the first steps. The trapezoidal
rule would oscillate instead.
"""

from typing import NamedTuple

import numpy as np

from ...errors import ConvergenceError
from .conduction import Conduction

_D, _W = 1 - np.sqrt(0.5), np.sqrt(0.125)
WEIGHTS = np.array([_W, _W, _D])
_ERROR = WEIGHTS - np.array([1 - _W, 3 * _W + 1, _D]) / 3


class Step(NamedTuple):
    """Result of a trial time step of the heat equation.

    Attributes:
        state: temperatures of the body at the end of the step, shape (n,). Then for each tool in contact its excess
            temperatures over its back, at m nodes along the depth, shape (contact nodes, m).
        error: estimated time integration error of the step, degrees.
        stored: heat that the whole body stores in the step.
        heats: heat that enters the body in the step through each boundary and from each source, shape (names,), in the
            order of `Conduction.names`.
    """

    state: list[np.ndarray]
    error: float
    stored: float
    heats: np.ndarray


def step(body: Conduction, state: list[np.ndarray], dt: float) -> Step:
    """Take a TR-BDF2 step of the heat equation from a temperature state; the error is inf if Newton's method fails."""
    c = dt * _D
    first, heats_first = body.rates(state)
    try:
        second = body.stage(state, [c * r for r in first], c, np.zeros_like(state[0]))
        known = [dt * _W * (a + b) for a, b in zip(first, second.rates)]
        third = body.stage(state, known, c, second.changes[0])
    except ConvergenceError:
        return Step(state, np.inf, 0.0, 0 * heats_first)
    rates = (first, second.rates, third.rates)
    errors = [dt * sum(w * r for w, r in zip(_ERROR, parts)) for parts in zip(*rates)]
    error, _ = body.difference(errors, c)
    change = third.changes
    missing = body.mass(change[0]) - dt * sum(w * r[0] for w, r in zip(WEIGHTS, rates))
    through = dt * (WEIGHTS @ np.array([heats_first, second.heats, third.heats]))
    return Step([a + b for a, b in zip(state, change)], error, body.stored(change[0]),
                np.concatenate([through, body.heat_through_fixed_faces(missing)]))


def next_length(dt: float, error: float, tolerance: float) -> float:
    """Return dt min(max(0.9 (tolerance/error)^(1/3), 0.1), 5), the length of the next step."""
    return dt * float(np.clip(0.9 * (tolerance / max(error, 1e-300)) ** (1 / 3), 0.1, 5.0))


def fitted(dt: float, left: float) -> float:
    """Return `left` if dt reaches an output time; otherwise the smaller of dt and left / 2, so no short step stays."""
    return left if dt >= left * (1 - 1e-9) else min(dt, left / 2)

