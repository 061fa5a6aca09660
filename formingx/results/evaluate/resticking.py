"""Check of sticking points that separate and stick elsewhere: the wall between them depends on the step lengths."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...findings import Finding, percent
from ...ranks import gathered
from ...values.tolerances import WALL_ERROR

LARGE_SHIFT = 0.1
"""Shift from which the finding is a warning: points that move so far change the forces on their neighbours, too."""


class Resticking(NamedTuple):
    """Contact point whose sticking position shifted most when it separated from its tool and stuck again.

    Attributes:
        tool: name of the `Contact` with the tool, or of its boundary if it has no name.
        points: number of points on this tool that separated and stuck again.
        shift: sum of the distances between successive sticking positions on the tool, over the tributary length of the
            point.
        point: reference position (R, Z) of the point, length.
    """

    tool: str
    points: int
    shift: float
    point: tuple[float, float]


def furthest(path: Any) -> Resticking | None:
    """Return the contact point that separates and sticks elsewhere with the largest shift, or None; collective.

    Only points of the last mesh count. The shift over its tributary length is an upper bound of the wall error by step
    lengths.
    """
    found = []
    for number, contact in enumerate(c for c in path.problem.contacts if c.has_history):   # contacts come first
        definition = contact.contact
        if definition.lagged or not (definition.sticks and definition.separates):
            continue
        touches = [state.history_variables[number].history for state in path.record.segments[-1].states
                   if state.kind != "start"                 # points that touch there do not stick: they carry no force
                   and len(state.history_variables) > number and state.history_variables[number] is not None]
        rows = gathered(contact.comm, np.column_stack([contact.points, _shifts(contact, touches)]))
        again = rows[rows[:, 2] > 0]
        if len(again):
            r, z, shift = again[np.argmax(again[:, 2])]
            found.append(Resticking(definition.label, len(again), float(shift), (float(r), float(z))))
    return max(found, key=lambda item: item.shift, default=None)


def _shifts(contact: Any, touches: list[Any]) -> np.ndarray:
    """Return summed shifts of sticking positions of owned points, (n,), over tributary lengths, by histories."""
    last, total = np.full(contact.points.shape, np.nan), np.zeros(len(contact.points))
    stuck = np.zeros(len(total), dtype=bool)
    for history in touches:
        touching = history.distance > -contact.law.theta
        again = touching & ~stuck & ~np.isnan(last[:, 0])
        total[again] += np.linalg.norm(history.position[again] - last[again], axis=1)
        last[touching], stuck = history.position[touching], touching
    return np.divide(total, contact.rule.lengths, out=np.zeros(len(total)), where=contact.rule.lengths > 0)


def findings(item: Resticking | None) -> list[Finding]:
    """Return a note or a warning in a list if a sticking position shifted by 0.003 tributary lengths or more; else [].

    The numbers of the note are results of benchmarks/steps_in_moulds.py.
    """
    if item is None or item.shift < WALL_ERROR:
        return []
    count = f"{item.points} points that stuck" if item.points > 1 else "A point that stuck"
    found = f"{count} to {item.tool!r} lifted off and stuck again elsewhere, most near R = {item.point[0]:.5g}: walls"
    if item.shift < LARGE_SHIFT:
        return [Finding("note", item.tool, f"{found} near there depend on the steps. In 57 random moulds they did by"
                                           f" 0.05 % in the median and 0.6 % at most")]
    return [Finding("warning", item.tool, f"{found} near there may depend on the steps (that point moved by"
                    f" {percent(item.shift)} of its tributary length). Compare StepControl(target=4) and"
                    f" StepControl(target=8).")]
