"""States predicted from those before: in time by Lagrange's polynomial, along a smooth path by a parabola."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .equations import Array
from .state import State

CUBIC, QUADRATIC = 4, 3                             # states that a cubic, and a parabola, go through


def before(states: Sequence[State], time: float, most: int, close: float = 0.1) -> list[State]:
    """Return the last states, at most `most`, to extrapolate to a time: in order, from the last jump on.

    States closer in time than the part `close` of the step ahead are left out, since their errors would be magnified.
    """
    found: list[State] = []
    for state in reversed(states):
        if not found or state.time < found[0].time - close * (time - states[-1].time):
            found.insert(0, state)
        if len(found) == most or state.kind == "jump":
            break
    return found


def behind(states: Sequence[State], length: float, distance: Callable[[State, State], float]) -> State | None:
    """Return an earlier state that gives, with the last one and its tangent, a parabola for a step of a length;
    None: none.

    It is one of the last few, at least half the step away, with no jump since.
    """
    for before, after in zip(states[-2:-6:-1], states[:-6:-1]):
        if after.kind == "jump":
            return None
        if length <= 2 * distance(before, states[-1]):
            return before
    return None


def weights(states: Sequence[State], time: float) -> Array:
    """Return the weight of each state, with growing times, in the value at a time; shape (states,)."""
    t = np.array([state.time for state in states])
    apart, ahead = t[:, None] - t, np.tile(time - t, (len(t), 1))
    np.fill_diagonal(apart, 1.0)
    np.fill_diagonal(ahead, 1.0)
    return np.prod(ahead / apart, axis=1)
