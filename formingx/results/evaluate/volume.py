"""Whether elements keep their volumes: what a reader of a run should know of J."""

from __future__ import annotations

from typing import Any

from ...findings import Finding

BOUND = 5e-3
"""Root mean square of J - 1 above which a report warns, and above four times which a run does: elements have
other volumes, though the mass is kept."""

_FURTHEST = 2.0
"""J, or 1/J, at a point beside the quadrature points above which a report warns."""


def findings(error: float, where: str) -> list[Finding]:
    """Return the findings on a root mean square of J - 1, in the state that `where` names."""
    if error <= BOUND:
        return []
    return [Finding("warning" if error > 4 * BOUND else "note", "volume",
                    f"The elements do not keep their volumes: the root mean square of J - 1 is up to"
                    f" {100 * error:.2g} % ({where}): use a finer mesh; the corner of a clamped rim is singular.")]


def of_point(furthest: Any) -> list[Finding]:
    """Return the findings on a `Least`, the point at which J is furthest from 1 in the last state, or None."""
    J = 1.0 if furthest is None else furthest.value
    if 1 / _FURTHEST < J < _FURTHEST:
        return []
    return [Finding("note" if J > 0 else "warning", "element",
                    f"J is {J:.3g} in the last state at (R, Z) = ({furthest.point[0]:.5g}, {furthest.point[1]:.5g}):"
                    f" the stress in that element is meaningless.")]
