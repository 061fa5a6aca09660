"""Check of points that stick to a tool that hardly presses on them, as where air peels a sheet off a rough plug."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...contact.face import FaceContact
from ...findings import Finding, register
from ...ranks import combined
from ...values.tolerances import LARGEST_FRICTION


class Peeling(NamedTuple):
    """Tool from which a sticking sheet is peeled.

    Attributes:
        tool: name of the `Contact` with the tool, or of its boundary if it has no name.
        ratio: sum of the magnitudes of the tangential contact forces of all points over the sum of their normal
            forces, the largest ratio of the examined states.
    """

    tool: str
    ratio: float


def strongest(problem: Any, states: Sequence[Any]) -> Peeling | None:
    """Return the tool with the largest ratio of tangential to normal contact forces; collective.

    None if no sheet sticks to a tool from which it may separate.
    """
    found = []
    for state in states:
        with problem.state_context(state):
            for face in (face for face in problem.contact.faces if isinstance(face, FaceContact)):
                if face.contact.sticks and face.contact.separates and not face.contact.lagged:
                    tractions = face.tractions(state.x[:problem.n_owned], state.control)
                    both = np.array([face.area @ np.abs(tractions.tangential), face.area @ tractions.normal])
                    along, normal = combined(face.comm, both, MPI.SUM)
                    if normal > 0:
                        found.append(Peeling(face.contact.label, float(along / normal)))
    return max(found, key=lambda item: item.ratio, default=None)


def findings(item: Peeling | None) -> list[Finding]:
    """Return a warning in a list if no real friction could hold the sheet, else []; item: result of `strongest`."""
    if item is None or item.ratio < LARGEST_FRICTION:
        return []
    return [Finding("warning", item.tool, f"the sheet is peeled off {item.tool!r}, to which it sticks: the tangential"
                    f" contact forces are {item.ratio:.2g} times the normal ones; the friction of real tools is 0.05 to"
                    f" 1 times the normal force. Each point that separates moves suddenly; with a coefficient of"
                    f" friction, such as friction=1, the points slide before they separate",
                    "friction=1 in place of 'stick'")]


@register("failure")
def peeled(failure: Any) -> list[Finding]:
    """Find a sheet that was peeled off a tool to which it sticks, in a failed run's last state; collective."""
    return findings(strongest(failure.problem, [failure.last])) if failure.last else []
