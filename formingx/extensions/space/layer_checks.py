"""Check of moving tools against the opposite layer of a tube, which a membrane cannot touch."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...findings import Finding, coordinates, register


@register("start")
def tools_that_reach_the_opposite_layer(body: Any) -> Iterator[Finding]:
    """Yield a finding for each tool whose travel ends beyond the opposite layer of a tube by more than the wall.

    The travel is along the normal of this layer, in the reference configuration: the layer in front of the tool is
    pushed into it. A plane of symmetry or a parting plane between them ends the travel before.
    """
    scene = body.scene
    if scene.kinematics.components != 3 or scene.mesh.flat:
        return
    for contact in scene.contacts:
        travels = [entry.value for entry in body.prescribed if entry.item is contact and entry.quantity == "travel"]
        if contact.direction is None or max(travels, default=0.0) <= 0:
            continue
        travel = max(travels)
        points, normals = scene.mesh.outward(contact.on)
        wall = sum(given(*points.T) for given in scene.thickness.values())
        depth = contact.tool.signed_distance(points - travel * contact.travel_vector)
        opposite = normals @ contact.travel_vector > 0
        k = int(np.argmax(np.where(opposite, depth - wall, -np.inf)))
        if opposite[k] and depth[k] > wall[k]:
            yield Finding("warning", repr(contact), f"its travel of {body.format(travel, 'travel')} ends"
                          f" {body.format(float(depth[k]), 'travel', 3)} beyond the opposite layer of the tube at"
                          f" (x, y, z) = {coordinates(points[k])}: a membrane has no contact with itself, and the run"
                          f" ends where the layers pass through each other. Give the tool a parting plane between the"
                          f" layers (fx.tools.half), or model one half with Symmetry there, or let it travel less")
