"""Prediction of a state from earlier ones: in time by Lagrange's polynomial, along a smooth path by a parabola."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .equations import Array
from .state import State


def recent_states(states: Sequence[State], time: float, degree: int, close: float = 0.1) -> list[State]:
    """Return the last degree + 1 states, fewer after a jump, for an extrapolation by a polynomial to a later time.

    States closer in time than `close` times the step are left out, since they would magnify errors.
    """
    found: list[State] = []
    for state in reversed(states):
        if not found or state.time < found[0].time - close * (time - states[-1].time):
            found.insert(0, state)
        if len(found) > degree or state.kind == "jump":
            break
    return found


def parabola_state(states: Sequence[State], length: float, distance: Callable[[State, State], float]) -> State | None:
    """Return one of the four states before, half a step away or more and no jump between, for a parabola; or None."""
    for before, after in zip(states[-2:-6:-1], states[:-6:-1]):
        if after.kind == "jump":
            return None
        if length <= 2 * distance(before, states[-1]):
            return before
    return None


def weights(states: Sequence[State], time: float) -> Array:
    """Return the weights, shape (states,), of states with increasing times in Lagrange's polynomial at a time."""
    t = np.array([state.time for state in states])
    apart, ahead = t[:, None] - t, np.tile(time - t, (len(t), 1))
    np.fill_diagonal(apart, 1.0)
    np.fill_diagonal(ahead, 1.0)
    return np.prod(ahead / apart, axis=1)
