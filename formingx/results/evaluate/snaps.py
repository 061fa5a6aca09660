"""Check of snap-through of bodies with history variables: the state after a jump depends on the way to it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...findings import Finding
from ...values.tolerances import LARGE_ERROR


class Snap(NamedTuple):
    """Snap-through of a run in which the wall changed most, and the place where it changed most.

    Attributes:
        jumps: number of snap-throughs in the run.
        state: number of the first state of the path after this snap-through.
        ratio_before: wall over original thickness at this place before the snap-through.
        ratio_after: wall over original thickness at this place after the snap-through.
        point: reference radius R of this place, length.
    """

    jumps: int
    state: int
    ratio_before: float
    ratio_after: float
    point: float

    @property
    def change(self) -> float:
        """Relative change of the wall in the snap-through, |ratio_after / ratio_before - 1|."""
        return abs(self.ratio_after / self.ratio_before - 1)


def largest(path: Any) -> Snap | None:
    """Return the snap-through that changed the wall most, of problems with history variables, or None; collective."""
    jumps = [k for k, state in enumerate(path.states) if state.kind == "jump" and k]
    if not jumps or not path.problem.history.path_dependent:
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
    """Return a warning in a list if the wall changed by 5 % or more in a snap-through; else an empty list."""
    if snap is None or snap.change < LARGE_ERROR:
        return []
    times = f"{snap.jumps} times, most" if snap.jumps > 1 else "once,"
    return [Finding("warning", "snap-through", f"The body snapped {times} in state {snap.state}: there the wall"
                    f" went from {snap.ratio_before:.4g} to {snap.ratio_after:.4g} of the original at"
                    f" R = {snap.point:.5g}. With friction or a relaxing material, the equilibrium where it"
                    f" comes to rest depends on the motion to it. Later states are certain only if runs with"
                    f" other steps agree: compare StepControl(target=4) and StepControl(target=8).")]
