"""Whether a tool is so narrow that it fits between two contact points of a face."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx.mesh import entities_to_geometry

from ..errors import InputError
from ..physics.contact import Contact
from ..ranks import gathered

_DIRECTIONS = 90


def check(mesh: Any, contact: Contact, axisymmetric: bool) -> None:
    """An InputError if a closed tool is narrower than the way between contact points, where it is next to the face.

    It would pass between them and not be felt.
    """
    if not contact.tool.closed:
        return
    outline = contact.tool.outline()
    if axisymmetric and outline[:, 0].min() <= 1e-9 * contact.tool.size:         # it goes on beyond the axis
        outline = np.concatenate([outline, outline * (-1, 1)])
    angles = np.linspace(0, np.pi, _DIRECTIONS, endpoint=False)
    width = float(np.ptp(outline @ np.array([np.cos(angles), np.sin(angles)]), axis=0).min())
    mesh.domain.topology.create_connectivity(1, 2)
    facets = mesh.facets_of(contact.on)
    nodes = entities_to_geometry(mesh.domain, 1, facets) if len(facets) else np.zeros((0, 2), dtype=int)
    ends = gathered(mesh.comm, mesh.domain.geometry.x[nodes][:, :2, :2])
    nearest = ends[np.argmax(contact.tool.signed_distance(ends.mean(1)))]
    points = 2 if contact.points == "nodes" else int(contact.points)
    edge = float(np.hypot(*(nearest[1] - nearest[0])))
    if width < edge / points:
        raise InputError(f"{contact!r}: the tool is {width:.4g} wide, less than the {edge / points:.4g} from one"
                         f" contact point of {contact.on!r} to the next: it would pass between them; use elements of"
                         f" {points * width:.4g} or less there (they are {edge:.4g} long)")
