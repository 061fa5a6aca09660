"""Whether a formed sheet lies over itself or beyond the axis: shapes that a body cannot have."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mesh.check import crossing
from .profile import Profile

_NEAR = 1e-6               # of the thickness: closer to the axis is on it


def fold(profile: Profile, axisymmetric: bool) -> tuple[str, np.ndarray] | None:
    """(what the faces of a sheet do: "cross the axis" or "cross each other or themselves", (r, z) there) or None."""
    line = np.vstack([profile.bottom, profile.top[::-1]])
    beyond = int(np.argmin(line[:, 0]))
    if axisymmetric and line[beyond, 0] < -_NEAR * profile.original_thickness.max():
        return "cross the axis", line[beyond]
    ends = np.arange(len(line))
    place = crossing(line, np.column_stack([ends, np.roll(ends, -1)]))
    return None if place is None else ("cross each other or themselves", place)


def first_fold(profiles: list[Any], axisymmetric: bool) -> tuple[int, str, np.ndarray] | None:
    """(number of the first of some states whose faces do so, what, (r, z) there), or None."""
    for k, profile in enumerate(profiles):
        found = fold(profile, axisymmetric) if profile is not None else None
        if found is not None:
            return k, *found
    return None
