"""Whether elements keep their volumes: what a reader of a run should know of J."""

from __future__ import annotations

from typing import Any

BOUND = 5e-3
"""Root mean square of J - 1 above which a report warns, and above four times which a run does: elements have
other volumes, though the mass is kept."""

_FURTHEST = 2.0
"""J, or 1/J, at a point beside the quadrature points above which a report warns."""


def doubts(error: float, where: str) -> list[tuple[str, str]]:
    """(how bad: "serious" or "minor"; what) of a root mean square of J - 1, in the state that is named by `where`."""
    if error <= BOUND:
        return []
    return [("serious" if error > 4 * BOUND else "minor",
             f"The elements do not keep their volumes: the root mean square of J - 1 is up to {100 * error:.2g} %"
             f" ({where}): use a finer mesh; the corner of a clamped rim is singular.")]


def doubts_of_point(furthest: Any) -> list[tuple[str, str]]:
    """The same of a `Least`, where J is furthest from 1 in the last state, or None."""
    J = 1.0 if furthest is None else furthest.value
    if 1 / _FURTHEST < J < _FURTHEST:
        return []
    return [("minor" if J > 0 else "serious",
             f"J is {J:.3g} in the last state at (R, Z) = ({furthest.point[0]:.5g}, {furthest.point[1]:.5g}): the"
             f" stress in that element is meaningless.")]
