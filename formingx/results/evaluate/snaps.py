"""Check of snap-through with history variables: the state reached after a jump depends on the path to it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...findings import Finding

_WALL = 0.05
"""Relative change of the wall in one jump above which later walls are uncertain."""


class Snap(NamedTuple):
    """Snap-through of a run in which the wall changed most.

    Attributes:
        jumps: number of snap-throughs in the run.
        state: number of the state after this one, in the path.
        before: wall over original thickness before it, where the wall changed most.
        after: wall over original thickness after it, at the same place.
        point: reference radius of this place, length.
    """

    jumps: int
    state: int
    before: float
    after: float
    point: float

    @property
    def change(self) -> float:
        """Change of the wall over the wall before the jump."""
        return abs(self.after / self.before - 1)


def largest(path: Any) -> Snap | None:
    """Return the snap-through of a path in which the wall changed most; collective.

    Only paths with friction or a viscoelastic material are examined. There the state after a snap-through depends on
    the history.

    Returns:
        The snap-through, or None if there was none or the body has no wall.
    """
    jumps = [k for k, state in enumerate(path.states) if state.kind == "jump" and k]
    if not jumps or not path.problem.has_history:
        return None
    found = []
    for k in jumps:
        try:
            profile = path.profile(path.states[k])
            before, after = path.profile(path.states[k - 1]).wall_ratio, profile.wall_ratio
        except InputError:                                  # no sheet
            return None
        change = np.abs(after / before - 1)
        if not np.isfinite(change).all():                   # no wall: a block whose sides roll over
            return None
        i = int(np.argmax(change))
        found.append(Snap(len(jumps), k, float(before[i]), float(after[i]), float(profile.reference_radius[i])))
    return max(found, key=lambda snap: snap.change)


def findings(snap: Snap | None) -> list[Finding]:
    """Return a warning on the largest jump of the wall."""
    if snap is None or snap.change < _WALL:
        return []
    times = f"{snap.jumps} times, most" if snap.jumps > 1 else "once,"
    return [Finding("warning", "snap-through", f"The body snapped {times} in state {snap.state}: there the wall went"
                    f" from {snap.before:.4g} to {snap.after:.4g} of the original at R = {snap.point:.5g}. With"
                    f" friction or relaxing material where it comes to rest depends on the way there, so all that"
                    f" follows is only as certain as runs with other steps agree: compare StepControl(target=4) and"
                    f" StepControl(target=8).")]
