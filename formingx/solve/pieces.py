"""Step data of a stage: one controlled load, support or contact, or tables of amplitudes against time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .equations import Array
from .stage import Stage
from .stepping import SAME_TIME


def control_step_data(amplitudes: list[float], scales: Sequence[float], numbers: list[int], stage: Stage,
            clocked: bool = True) -> tuple[list[float], list[float], float]:
    """Return base, rate and current value for step data with the amplitude of one item as the control.

    All other amplitudes stay constant. An amplitude is base + rate * control. amplitudes, scales: of all `Scene.items`,
    then the process time; scales are in the user's units. numbers: indices of the item and of the other contacts of its
    tool.
    """
    base, rate = list(amplitudes), [0.0] * len(amplitudes)
    control, scale = base[numbers[0]], scales[numbers[0]]
    for number in numbers:
        base[number], rate[number] = 0.0, 1.0
    until = stage.until
    if clocked and until is not None and (stage.speed or stage.duration):
        goal = until.value / scale if until.name.endswith(("pressure", "travel")) else np.inf
        change = goal - control
        if change and stage.speed:
            rate[-1] = np.sign(change) * scale / stage.speed
        elif change and stage.duration:
            rate[-1] = stage.duration / change
        base[-1] -= rate[-1] * control
    return base, rate, control


def table_step_data(amplitudes: list[float], scales: Sequence[float], tables: list[tuple[int, Array]], now: float,
             then: float) -> tuple[list[float], list[float]]:
    """Return base and rate of each amplitude, then of the process time, between two times with linear tables.

    The control is proportional to the time since `now`. At `then` it equals the largest change of an amplitude, or 1 if
    none changes. tables: [(index in `Scene.items`, knots (time, value) in the user's units, shape (n, 2))].
    """
    base, change = list(amplitudes), [0.0] * len(amplitudes)
    for i, table in tables:
        first, value = table[0]
        if now < first - SAME_TIME * abs(first):            # straight from the current value to the first knot
            part = min((then - now) / (first - now), 1.0)
            change[i] = part * (value / scales[i] - base[i])
        else:                                               # a constant piece inherits no round-off from before
            base[i], ahead = (float(np.interp(t, *table.T)) / scales[i] for t in (now, then))
            change[i] = ahead - base[i]
    most = max(map(abs, change))
    base[-1], change[-1] = now, then - now
    return base, [c / (most or 1.0) for c in change]


def end_time(stage: Stage, tables: list[tuple[int, Array]], now: float) -> float:
    """Return the process time at the end of a stage: of its duration, its target `until` or its longest table."""
    return now + stage.duration if stage.duration else stage.until.value if stage.until else max(
        table[-1, 0] for _, table in tables)


def next_knot(tables: list[tuple[int, Array]], now: float, end: float) -> float:
    """Return the time of the next knot after `now` in any of several tables, each of shape (n, 2); at most `end`."""
    return min([t for _, table in tables for t in table[:, 0] if now + SAME_TIME * abs(t) < t < end] + [end])
