"""Where a run stands that writes a checkpoint: read from its last states, while it goes on."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ...errors import InputError, non_negative, positive
from . import checkpoint

_RECENT = 20
"""Of so many steps the pace is taken."""


@dataclass(frozen=True)
class Status:
    """The last complete step of a run.

    Attributes:
        states: in the checkpoint. stage: its name, or "". verdict: `State.verdict`.
        target: (measure, the value that ends the stage, its value now), or None.
        spent, left: seconds that the run has worked, and about how many it takes to the end of the stage at the pace of
            its last steps; None: it came no nearer in them.
        limits: {what made steps shorter: how often}, in the whole run.
    """

    states: int
    stage: str
    verdict: str
    target: tuple[str, float, float] | None
    spent: float
    left: float | None
    limits: dict[str, int]

    def __str__(self) -> str:
        lines = [f"{self.states} states" + f", stage {self.stage!r}" * bool(self.stage)]
        if self.target:
            name, goal, now = self.target
            lines[0] += f": {name.replace('_', ' ')} {now:.6g} of {goal:.6g}"
        spent = f"{self.spent:.0f} s" if self.spent >= 10 else f"{self.spent:.2g} s"
        left = "no nearer to the target in the last steps" if self.left is None else \
            "the target is met" if self.left == 0 else f"about {self.left:.2g} s to the end of the stage"
        limits = ", ".join(f"{why} ({n} times)" for why, n in sorted(self.limits.items(), key=lambda one: -one[1])[:3])
        lines += [f"after {spent}: {left}", f"steps limited by: {limits or 'their own control only'}",
                  f"verdict: {self.verdict or 'good'}"]
        return "\n".join(lines)


def of_folder(folder: Any) -> Status:
    """The status of the run that writes to a checkpoint.

    Raises:
        InputError: there is no checkpoint, it holds no state, or it is damaged.
    """
    n, states = checkpoint.latest(folder, _RECENT)
    last = states[-1]
    done = [s for s in states if s["stepping"] and s["stage"] == last["stage"]]
    kept: dict[str, Any] = done[-1]["stepping"] if done else {}
    counts = kept.get("counts", {})
    name, goal = kept.get("until", ("", 0.0))
    if name not in last["measures"]:
        return Status(n, last["stage"], last["verdict"], None, counts.get("seconds", 0.0), None,
                      counts.get("limits", {}))
    now, before = done[-1]["measures"][name], done[0]["measures"][name]
    won = 1 - abs(goal - now) / abs(goal - before) if goal != before else 0.0
    took = counts["seconds"] - done[0]["stepping"]["counts"]["seconds"]
    left = 0.0 if now == goal else took * (1 - won) / won if won > 0 else None
    return Status(n, last["stage"], last["verdict"], (name, goal, now), counts["seconds"], left,
                  counts.get("limits", {}))


def watch(folder: Any, every: float = 5.0, patience: float = 600.0) -> Iterator[Status]:
    """The status now, and whenever there are new states, until there have been none for `patience` seconds.

    A folder that is not there yet, or holds no state, is waited for as long.

    Args:
        every: seconds between two looks.
    """
    every, patience = positive("watch: every", every), non_negative("watch: patience", patience)
    seen, since = -1, time.monotonic()
    while True:
        try:
            found = of_folder(folder)
        except InputError:
            if time.monotonic() - since >= patience:
                raise
            found = None
        if found is not None and found.states != seen:
            yield found
            seen, since = found.states, time.monotonic()
        if time.monotonic() - since >= patience:
            return
        time.sleep(min(every, patience))
