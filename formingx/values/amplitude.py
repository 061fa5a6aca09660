"""A function of time as a table that a machine can follow."""

from collections.abc import Callable

import numpy as np

from ..errors import InputError, finite, positive, values

_MOST = 2000           # points: a function that jumps, or rattles, has no table


def amplitude(function: Callable, until: float, start: float = 0.0, *, tolerance: float = 1e-3,
              ) -> list[tuple[float, float]]:
    """[(time, value), ...] of a function of time, for `Stage(amplitudes={item: ...})`; straight between its points.

    Args:
        function: f(t), called with an array of times, or made of numbers; the value of the controlled quantity then.
        until, start: process times.
        tolerance: how far a straight piece may be off f, over the span of its values.

    Raises:
        InputError: times in the wrong order, a value that is not finite, a function that needs more than 2000 points.

    >>> stroke = fx.amplitude(lambda t: 20 * (1 - np.cos(np.pi * t)), until=1.0)
    >>> len(stroke), stroke[0], round(stroke[-1][1], 6)
    (29, (0.0, 0.0), 40.0)
    """
    start, until = finite("amplitude: start", start), finite("amplitude: until", until)
    tolerance = positive("amplitude: tolerance", tolerance)
    if not start < until:
        raise InputError(f"amplitude: until = {until:g}: must be after start = {start:g}")
    t = np.linspace(start, until, 9)
    f = _at(function, t)
    while len(t) <= _MOST:
        middle = (t[:-1] + t[1:]) / 2
        there = _at(function, middle)
        bent = np.abs(there - (f[:-1] + f[1:]) / 2) > tolerance * max(np.ptp(np.append(f, there)), 1e-300)
        if not bent.any():
            return [(float(a), float(b)) for a, b in zip(t, f)]
        t, f = np.append(t, middle[bent]), np.append(f, there[bent])
        order = np.argsort(t)
        t, f = t[order], f[order]
    raise InputError(f"amplitude: the function is not smooth near t = {middle[bent][0]:.6g}: {_MOST} points do not"
                     f" follow it to {tolerance:g} of its range: give Stage a table")


def _at(function: Callable, t: np.ndarray) -> np.ndarray:
    return values("amplitude: function", function, {"t": t})
