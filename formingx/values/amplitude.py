"""Approximation of a function of time by a table with few points."""

from collections.abc import Callable

import numpy as np

from ..errors import InputError, finite, positive, values
from .tolerances import CURVE_POINTS


def amplitude(function: Callable, until: float, start: float = 0.0, *, tolerance: float = 1e-3,
              ) -> list[tuple[float, float]]:
    """Return a table of a function of time, as `Stage(amplitudes={item: ...})` needs it.

    Points are added until the table, linear between its points, agrees with the function between them.

    Args:
        function: function of the time that returns the value of a load, support or tool. It is called with an array of
            times, or with a number if it does not accept arrays.
        until: last time of the table.
        start: first time of the table.
        tolerance: largest difference between function and table, over the range of the function's values.

    Returns:
        The table: pairs (time, value) in ascending order of time.

    Raises:
        InputError: `until` is not after `start`, a value is not finite, or more than 2000 points are needed.

    >>> stroke = fx.amplitude(lambda t: 20 * (1 - np.cos(np.pi * t)), until=1.0)
    >>> len(stroke), stroke[0], round(stroke[-1][1], 6)
    (29, (0.0, 0.0), 40.0)
    """
    start, until = finite("amplitude: start", start), finite("amplitude: until", until)
    tolerance = positive("amplitude: tolerance", tolerance)
    if not start < until:
        raise InputError(f"amplitude: until = {until:g}: must be after start = {start:g}")
    t = np.linspace(start, until, 9)
    f = _evaluate(function, t)
    while len(t) <= CURVE_POINTS:
        middle = (t[:-1] + t[1:]) / 2
        samples = _evaluate(function, middle)
        bent = np.abs(samples - (f[:-1] + f[1:]) / 2) > tolerance * max(np.ptp(np.append(f, samples)), 1e-300)
        if not bent.any():
            return [(float(a), float(b)) for a, b in zip(t, f)]
        t, f = np.append(t, middle[bent]), np.append(f, samples[bent])
        order = np.argsort(t)
        t, f = t[order], f[order]
    raise InputError(f"amplitude: the function is not smooth near t = {middle[bent][0]:.6g}: {CURVE_POINTS} points do"
                     f" not follow it to {tolerance:g} of its range: give Stage a table")


def _evaluate(function: Callable, t: np.ndarray) -> np.ndarray:
    """Return the values of the user's function at n times t, shape (n,)."""
    return values("amplitude: function", function, {"t": t})
