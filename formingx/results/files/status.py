"""Status of a run, read from the last states of its checkpoint while it runs."""

import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import non_negative, positive
from ...findings import Finding, without_notes
from ...values.tolerances import NEGLIGIBLE, ROUND_OFF
from . import checkpoint_data

_RECENT_STEPS = 20
"""Number of last steps from which the remaining time is estimated."""
_MOVES = ("enclosed_volume", "pole_height", "contact_length", "contact_area", "strain_energy")
"""Columns that show that the body moves."""


@dataclass(frozen=True)
class Status:
    """Status of a run, as its checkpoint shows it at the last completed step.

    Attributes:
        states: number of states in the checkpoint.
        stage: name of the present stage, or "".
        inadmissible_reason: reason why the last state is inadmissible, or "" (`State.inadmissible_reason`).
        target: target of the stage: (column, its value at the target, its present value). None without a target, or if
            the target is a value of no column.
        computing_time: computing time up to the last completed step, s.
        remaining_time: computing time to the end of the stage, extrapolated from the last 20 steps, s; 0 if the target
            is met. None without a column of the target, or if the last steps came no nearer to it.
        limits: {reason for a shorter or failed step: count}, over the whole run.
        age: time since the last state was written, s.
        ended: {"failure": error message or "", "findings": [Finding]} of a run that has ended. None if it runs, or
            was killed.
        just_begun: True if the stage has only one completed step.
        moved: (column, earlier value, present value) of the column that changed most over the last steps; None if the
            body does not move. It shows progress while the target does not come nearer, such as the pole height after
            a pressure maximum.
    """

    states: int
    stage: str
    inadmissible_reason: str
    target: tuple[str, float, float] | None
    computing_time: float
    remaining_time: float | None
    limits: dict[str, int]
    age: float
    ended: dict[str, Any] | None
    just_begun: bool = False
    moved: tuple[str, float, float] | None = None

    @property
    def findings(self) -> list[Finding]:
        """Findings of severity "warning" and "serious" on the last state and, if the run has ended, on the run."""
        ended = [] if self.ended is None else without_notes(self.ended["findings"])
        state = [Finding("serious", "state", self.inadmissible_reason)] if self.inadmissible_reason else []
        return state + [finding for finding in ended if not (state and finding.about == "state")]

    def __str__(self) -> str:
        lines = [f"{self.states} state{'s' * (self.states != 1)}" + f", stage {self.stage!r}" * bool(self.stage)]
        if self.target:
            name, goal, now = self.target
            lines[0] += f": {name.replace('_', ' ')} {now:.6g} of {goal:.6g}"
        spent = f"{self.computing_time:.0f} s" if self.computing_time >= 10 else f"{self.computing_time:.2g} s"
        remaining = self._unknown_time() if self.remaining_time is None else "the target is met" \
            if self.remaining_time == 0 else f"about {self.remaining_time:.2g} s to the end of the stage"
        frequent = sorted(self.limits.items(), key=lambda limit: -limit[1])[:3]
        limits = ", ".join(f"{reason} ({n} times)" for reason, n in frequent)
        if self.ended is None:
            remaining += f"; the last state is {_words(self.age)} old"
        elif self.remaining_time != 0:
            remaining = "the run could not go on" if self.ended["failure"] else "the run ended before its target"
        lines += [f"after {spent}: {remaining}", f"steps limited by: {limits or 'their own control only'}"]
        if self.ended is not None and self.ended["failure"]:
            lines.append(self.ended["failure"])
        return "\n".join([*lines, *(map(str, self.findings) if self.findings else ["findings: none"])])

    def _unknown_time(self) -> str:
        """Return the reason why the remaining time is unknown, as text."""
        if self.target is None:
            return "the remaining time is not known, as no column holds the target of the stage"
        if self.just_begun:
            return "the stage has just begun"
        if self.moved is None:
            return "the last steps came no nearer to the target"
        name, before, now = self.moved
        return (f"the body moves, {name.replace('_', ' ')} {before:.5g} to {now:.5g} in the last steps; the remaining"
                f" time is not known, as the target came no nearer")


def of_folder(folder: Any) -> Status:
    """Return the status of a run from its checkpoint. A missing, empty or damaged checkpoint is an InputError."""
    n, states, age = checkpoint_data.latest(folder, _RECENT_STEPS)
    last, ended = states[-1], checkpoint_data.ended(folder)
    done = [s for s in states if s["stepping"] and s["stage"] == last["stage"]]
    stepping: dict[str, Any] = done[-1]["stepping"] if done else {}
    counts = stepping.get("counts", {})
    name, goal = target_column(stepping, last["measures"]) or ("", 0.0)
    met = last["target"] is not None and last["target"][:2] == stepping.get("until")
    if name not in last["measures"]:
        return Status(n, last["stage"], last["inadmissible_reason"], None, counts.get("seconds", 0.0),
                      0.0 if met else None, counts.get("limits", {}), age, ended)
    now, before = done[-1]["measures"][name], done[0]["measures"][name]
    moved = {c: (done[0]["measures"][c], done[-1]["measures"][c]) for c in _MOVES if c in last["measures"]}
    leader = max(moved, key=lambda c: abs(np.subtract(*moved[c])) / (max(map(abs, moved[c])) or 1.0), default=None)
    won = 1 - abs(goal - now) / abs(goal - before) if goal != before else 0.0
    took = counts["seconds"] - done[0]["stepping"]["counts"]["seconds"]
    nearer = won > 0 and abs(goal - now) < abs(goal - done[-2]["measures"][name])
    remaining = 0.0 if met or abs(now - goal) <= ROUND_OFF * abs(goal) else took * (1 - won) / won if nearer else None
    moving = leader if leader and not np.isclose(*moved[leader], rtol=NEGLIGIBLE, atol=0.0) else None
    return Status(n, last["stage"], last["inadmissible_reason"], (name, goal, now), counts["seconds"], remaining,
                  counts.get("limits", {}), age, ended, len(done) == 1, (moving, *moved[moving]) if moving else None)


def target_column(stepping: dict[str, Any], measures: Collection[str]) -> tuple[str, float] | None:
    """Return (column, value) of the target of a run or stage from its `State.stepping`; None without a target.

    A target such as `pressure(0.2)` of one of several loads becomes its column, such as "air_pressure". Without a
    suitable column, the name is that of the target.
    """
    if "until" not in stepping:
        return None
    name, goal = stepping["until"]
    driven = stepping.get("column", "")
    if name in measures:
        return name, goal
    suitable = [column for column in measures if column.endswith(f"_{name}")]
    return (driven if driven.endswith(f"_{name}") else suitable[0] if len(suitable) == 1 else name), goal


def _words(seconds: float) -> str:
    """Return a duration as text with two digits, in days, h, min or s; `seconds` is in s."""
    size, unit = next(((s, u) for s, u in ((86400, "days"), (3600, "h"), (60, "min")) if seconds >= 2 * s), (1, "s"))
    return f"{seconds / size:.2g} {unit}"


def watch(folder: Any, every: float = 5.0, patience: float = 600.0) -> Iterator[Status]:
    """Yield the status of a run now and after each new state, until the run ends.

    It is read every `every` s, until `patience` s pass without a state (0: once). A damaged or other folder is an
    InputError.
    """
    every, patience = positive("watch: every", every), non_negative("watch: patience", patience)
    seen, since = -1, time.monotonic()
    while True:
        waited = time.monotonic() - since >= patience
        found = of_folder(folder) if checkpoint_data.begun(folder) or waited else None
        if found is not None and (found.states != seen or found.ended is not None):
            yield found
            seen, since, waited = found.states, time.monotonic(), patience == 0
        if waited or found is not None and found.ended is not None:
            return
        time.sleep(min(every, patience))
