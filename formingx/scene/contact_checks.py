"""Checks of the contacts of a scene: tools at the start, and the travel of a tool."""

from typing import Any

import numpy as np

from ..errors import InputError
from ..findings import coordinates
from ..mesh.nodes import node_positions
from ..physics.contact import Contact
from ..physics.supports import Constrained
from ..ranks import gathered
from . import tool_width

OTHER_UNIT = 4.0
"""Ratio of the sizes of body and tool above which a body inside a tool probably has another unit of length."""


def check_start(scene: Any, contact: Contact) -> None:
    """Check that the body starts outside a tool, and that the contact face is its boundary nearest to the tool.

    Friction must be known at the temperatures of the face, no controlled pressure may act there, and the points must be
    dense (`tool_width.check`). A violation is an InputError.
    """
    contact.friction_at(None if scene.temperature is None else scene.temperature.at_boundary(contact.on))
    mesh, near = scene.mesh, 1e-6 * max(scene.extent)
    if scene.kinematics.components != contact.tool.components:
        raise InputError(f"{contact!r}: a section takes tools drawn in its plane, a sheet in three dimensions"
                         f" takes fx.tools.solid, box, revolved or extruded")
    if contact.tool.components == 3:
        scene.kinematics.scene_checks.check_contact(scene, contact)
        return
    if scene.kinematics.axisymmetric and contact.direction and contact.direction[0] \
            and contact.tool.bounds[0, 0] <= near:
        raise InputError(f"{contact!r}: it moves along R, but its tool covers the axis: no rigid tool of revolution"
                         f" does that; must be direction=(0, ...), or PlaneStrain()")
    face = mesh.nodes_of(contact.on)
    comm = mesh.comm
    points = gathered(comm, node_positions(mesh.domain))
    depth = contact.tool.signed_distance(points)
    worst = int(np.argmax(depth))
    if depth[worst] > near:
        free = contact.tool.reversed().signed_distance(points).max() <= near
        size, length = np.ptp(contact.tool.bounds, axis=0).max(), max(scene.extent)
        why = ("; the other side of its profile is free of it: use tool.reversed()" if free else
               "; on this side it must stand upside down: use tool.mirrored(), and moved(z=...) to its place"
               if _fits_upside_down(contact, face, points, near) else "; move it away from the body (tool.moved)")
        if getattr(contact.tool, "sized", True) and not length < OTHER_UNIT * size:
            why = (f"; the tool is {size:.4g} large, the body {length:.4g}: are the units of length the same (mm"
                   f" and cm)?")
        raise InputError(f"{contact!r}: the body starts inside the tool: {depth[worst]:.6g} deep at (R, Z) ="
                         f" {coordinates(points[worst], 6)}{why}")
    if depth[worst] > contact.tool.signed_distance(face).max() + near:
        raise InputError(f"{contact!r}: the tool is behind this face of the body: another face is closer to it;"
                         f" boundaries are {list(mesh.boundaries)}")
    if any(load is scene.driven and load.on == contact.on for load in scene.loads) and all(
            other.on == contact.on for other in scene.contacts):
        raise InputError(f"{contact!r}: the driven pressure acts on the same face and pushes it away from the tool:"
                         f" no tool faces the pressure")
    tool_width.check(mesh, contact, scene.kinematics.axisymmetric)


def _fits_upside_down(contact: Contact, face: np.ndarray, points: np.ndarray, near: float) -> bool:
    """Return True if a tool mirrored in Z, at the face (m, 2), is free of the body (n, 2) up to `near`, length."""
    tool = contact.tool.mirrored()
    low, high = tool.bounds[:, 1]
    below = tool.moved(z=face[:, 1].min() - high)
    above = tool.moved(z=face[:, 1].max() - low)
    return any(moved.signed_distance(points).max() <= near for moved in (below, above))


def check_travel(scene: Any, contact: Contact, travel: float) -> None:
    """Raise an InputError if all nodes of a constrained boundary lie inside a tool after a travel, length."""
    moves = contact.travel_vector
    for support in scene.supports:
        for constraint in scene.kinematics.in_axes(support, support.constraints()):
            if not isinstance(constraint, Constrained) or constraint.on is None or moves[constraint.component] == 0:
                continue
            depth = contact.tool.signed_distance(scene.mesh.nodes_of(constraint.on) - travel * moves)
            if depth.min() >= 0:
                raise InputError(f"travel = {travel:g}: {contact!r} would go through the whole height of the"
                                 f" body to {constraint.on!r}, which is held: the travel must be less than"
                                 f" {travel - depth.max() / np.linalg.norm(moves):.6g}")
