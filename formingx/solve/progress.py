"""How far a run has come: a bar, and now and then a line in the log."""

from __future__ import annotations

import logging
import time
from collections import Counter
from typing import Any

log = logging.getLogger("formingx")

SILENCE = 30.0
"""Seconds of processor time after which a line says where a run stands."""


class Progress:
    """Of a run to its target, on rank 0: a bar after two seconds, and a line after each `SILENCE`.

    Args:
        comm: of the run. words: what it is about. shown: False: no bar, and lines are of the level INFO.
    """

    def __init__(self, comm: Any, words: str, shown: bool):
        from tqdm import tqdm
        self._words, self._here = words, comm.rank == 0
        self._level = logging.WARNING if shown else logging.INFO          # INFO is not seen unless asked for
        self._bar = tqdm(total=1.0, desc=words, delay=2, disable=not shown or comm.rank != 0, leave=False,
                         bar_format="{desc}: {percentage:3.0f}% |{bar}| {elapsed}{postfix}")
        self._gained, self._states, self._length = 0.0, 0, 0.0
        self._limits: Counter[str] = Counter()
        self._began = self._said = time.process_time()
        self._gained_then = 0.0

    def show(self, gained: float, states: int, length: float) -> None:
        """A step is complete: part of the way, from 0 to 1, in so many states; length: of the next step."""
        self._gained, self._states, self._length = gained, states, length
        if not self._bar.disable:
            self._bar.n = min(max(gained, 0.0), 1.0)
            self._bar.set_postfix_str(f"state {states}", refresh=False)
            self._bar.update(0)
        self._speak()

    def limited(self, by: str, length: float) -> None:
        """A step was made shorter, or failed, for a reason; length: what is tried next."""
        self._limits[by] += 1
        self._length = length
        self._speak()

    def close(self) -> None:
        """The run is over."""
        self._bar.close()

    def _speak(self) -> None:
        now = time.process_time()
        if not self._here or now - self._said < SILENCE:
            return
        spent, won = now - self._said, self._gained - self._gained_then
        left = f"about {_in_words((1 - self._gained) * spent / won)} left" if won > 0 else "no nearer than then"
        limits = ", ".join(f"{by} ({n} times)" for by, n in self._limits.most_common(2)) or "nothing but its size"
        self._bar.clear()
        log.log(self._level, "%s: %.3g %% of the way in %d states and %s of processor time; since the last line steps"
                " of %.2g, limited by %s; %s", self._words, 100 * self._gained, self._states,
                _in_words(now - self._began), self._length, limits, left)
        self._said, self._gained_then = now, self._gained
        self._limits.clear()


def _in_words(seconds: float) -> str:
    """A duration to two digits."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
