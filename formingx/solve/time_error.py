"""How far off a step in time is: what the materials remember, against its smooth course through the states before.

The local error of the second-order rules is that of the trapezoidal one, h^3 y'''/12 (Hairer, Norsett and Wanner 1993,
section II.7), with y''' from the third divided difference of an internal variable y over the last four states. At the
beginning of a stage, where y has too short a past, it is taken as |h y'/y|^3 |y|/12, then as |h^2 y''/y|^(3/2) |y|/12.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError, finite
from .state import State

ACCURACY = {"draft": 1e-2, "standard": 2e-3, "fine": 3e-4}
"""Error of stress and thickness that each promises."""

_OF_A_STEP = 0.5
"""Local error allowed over the promised one to the power 3/2: steps of the third root of it add up to the promise."""

_FLOOR = 0.05
"""Entries of a tensor smaller than this part of its largest are measured against that."""


def allowed(who: str, accuracy: str | float) -> float:
    """The error promised by a word or a number, or an InputError."""
    if isinstance(accuracy, str):
        if accuracy not in ACCURACY:
            raise InputError(f"{who}: accuracy = {accuracy!r}: must be one of {', '.join(map(repr, ACCURACY))}, or an"
                             f" error such as 1e-4")
        return ACCURACY[accuracy]
    if not 0 < finite(f"{who}: accuracy", accuracy) < 1:
        raise InputError(f"{who}: accuracy = {accuracy!r}: must be between 0 and 1")
    return float(accuracy)


class TimeError:
    """Measures steps in time.

    Args:
        problem: the `Problem`. accuracy: the error promised.
    """

    def __init__(self, problem: Any, accuracy: float):
        self._problem, self._allowed = problem, _OF_A_STEP * accuracy**1.5

    def of(self, past: list[State], x: np.ndarray, control: float) -> float:
        """Error of the step from the last of some states to (x, control) over what is allowed; 0: nothing relaxes."""
        problem, worst = self._problem, 0.0
        for k, after in problem.foretell(x, control).items():
            before = [state.memory[k] for state in past[-3:]]
            first = next((i for i in reversed(range(1, len(before))) if not before[i - 1].time < before[i].time), 0)
            points = [*before[first:], after]
            if not points[-2].time < after.time:
                continue
            times = np.array([point.time for point in points])
            divided = _divided(times)
            for name, weight in problem.histories[k].weights.items():
                if weight:
                    worst = max(worst, weight * self._local(times, divided, [p.values[name] for p in points]))
        return worst / self._allowed

    def _local(self, times: np.ndarray, weights: np.ndarray, values: list[np.ndarray]) -> float:
        """Root mean square of the relative local error of an internal variable, all ranks."""
        y, n = np.abs(values[-1]), len(times) - 1
        size = y + _FLOOR * y.max(axis=-1, keepdims=True, initial=1e-300)
        ratio = sum(w * v for w, v in zip(weights, values)) / size
        comm = self._problem.comm
        total, number = (comm.allreduce(v, MPI.SUM) for v in (float(np.sum(ratio**2)), y.size))
        derivative = [1.0, 2.0, 6.0][n - 1] * np.sqrt(total / max(number, 1)) * (times[-1] - times[-2]) ** n
        return float(derivative ** (3 / n)) / 12


def _divided(times: np.ndarray) -> np.ndarray:
    """Of values at these times, their weights in the divided difference."""
    apart = times[:, None] - times
    np.fill_diagonal(apart, 1.0)
    return 1 / apart.prod(axis=1)
