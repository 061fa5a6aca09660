"""Prediction of a state from earlier ones: in time by Lagrange's polynomial, along a smooth path by a parabola."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .equations import Array
from .state import State

CUBIC, QUADRATIC = 4, 3                             # states that a cubic, and a parabola, go through


def recent_states(states: Sequence[State], time: float, most: int, close: float = 0.1) -> list[State]:
    """Return the last states that are suitable for an extrapolation to a later time, in order.

    Args:
        states: the accepted states, in order.
        time: the later time.
        most: largest number of states to return.
        close: smallest distance in time of two states, over the length of the step to `time`. Closer states are left
            out, since they would magnify errors.

    Returns:
        At most `most` states, none of them before the last jump.
    """
    found: list[State] = []
    for state in reversed(states):
        if not found or state.time < found[0].time - close * (time - states[-1].time):
            found.insert(0, state)
        if len(found) == most or state.kind == "jump":
            break
    return found


def parabola_state(states: Sequence[State], length: float, distance: Callable[[State, State], float]) -> State | None:
    """Return an earlier state that gives, with the last state and its tangent, a parabola as predictor of a step.

    It is one of the four states before the last one, at least half the step away from the last one, and no jump lies
    between them.

    Args:
        states: the accepted states, in order.
        length: arc length of the step.
        distance: function that returns the arc length between two states.

    Returns:
        The earlier state, or None if no state is suitable.
    """
    for before, after in zip(states[-2:-6:-1], states[:-6:-1]):
        if after.kind == "jump":
            return None
        if length <= 2 * distance(before, states[-1]):
            return before
    return None


def weights(states: Sequence[State], time: float) -> Array:
    """Return the weights of states in Lagrange's polynomial at a time.

    Args:
        states: states with increasing times.
        time: the time at which the polynomial is evaluated.

    Returns:
        Weights, shape (states,), dimensionless.
    """
    t = np.array([state.time for state in states])
    apart, ahead = t[:, None] - t, np.tile(time - t, (len(t), 1))
    np.fill_diagonal(apart, 1.0)
    np.fill_diagonal(ahead, 1.0)
    return np.prod(ahead / apart, axis=1)
