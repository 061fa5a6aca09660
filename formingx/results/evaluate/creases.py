"""Check of the faces of a sheet for creases, at which its wall depends on the elements.

Material between two parts of a face that stick to a tool has no other place: on its inner bend the face is compressed,
and creases.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...findings import Finding, coordinates
from .profile import FACES

_CREASED = 3 / 4
"""Stretch of a face between neighbouring nodes, below which it creases. A free face of a neo-Hookean block does at 0.65
in plane strain (Hong, Zhao and Suo, Appl. Phys. Lett. 95 (2009) 111901). The stretch is a mean over the crease and
the face beside it."""


class Crease(NamedTuple):
    """Most compressed part of a face between two neighbouring nodes.

    Attributes:
        stretch: deformed over undeformed distance of the two nodes.
        face: name of the boundary.
        point: deformed position (r, z) half-way between the nodes, length.
    """

    stretch: float
    face: str
    point: tuple[float, float]


def deepest(path: Any) -> Crease | None:
    """Return the most compressed part of the faces that stick to tools in the last state; collective.

    Parts nearer than a thickness to the outer end are left out, since the corner of a clamp is singular. None without a
    sticking contact in a section.
    """
    scene = path.problem.scene
    names = {contact.on for contact in scene.contacts if contact.sticks}
    pair = next((pair for pair in FACES if all(name in scene.mesh.boundaries for name in pair)), None)
    if pair is None or not names & set(pair) or not scene.model.solid or scene.kinematics.components == 3:
        return None
    profile = path.profile()
    middle = profile.reference_length
    far = middle[1:] <= middle[-1] - profile.original_thickness[-1]
    found = []
    for name, undeformed, deformed in zip(pair, (profile.reference_bottom, profile.reference_top),
                                          (profile.bottom, profile.top)):
        if name in names and far.any():
            lengths = np.hypot(*np.diff(undeformed, axis=0)[far].T)
            stretch = np.divide(np.hypot(*np.diff(deformed, axis=0)[far].T), lengths, out=np.ones(len(lengths)),
                                where=lengths > 0)
            k = int(np.argmin(stretch))
            r, z = (deformed[k] + deformed[k + 1]) / 2
            found.append(Crease(float(stretch[k]), name, (float(r), float(z))))
    return min(found, default=None)


def findings(crease: Crease | None) -> list[Finding]:
    """Return a warning in a list if a face creases; else an empty list."""
    if crease is None or crease.stretch >= _CREASED:
        return []
    return [Finding("warning", crease.face, f"Near (r, z) = {coordinates(crease.point, 5)} the face"
                    f" {crease.face!r} is compressed to {crease.stretch:.2g} of its length between parts that stick to"
                    " the tool: it creases. Walls near there depend on the elements and do not converge on finer"
                    " meshes. Use a larger fillet there, or a contact that slides.")]
