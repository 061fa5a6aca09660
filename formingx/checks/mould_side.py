"""Moulds in front of a face, and the side on which a pressure acts."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..physics.contact import Contact
from ..scene.scene import Scene
from ..tools.tool import RigidTool

_OPPOSITE = {"top": "bottom", "bottom": "top", "inner": "outer", "outer": "inner"}
_COVERED = 0.5  # fraction of a face with a tool in front of it, above which the tool is its mould


def moulds(scene: Scene) -> list[Contact]:
    """Return the contacts whose fixed tool lies in front of at least half of their undeformed face."""
    return [contact for contact in scene.contacts if contact.direction is None and _is_before(scene, contact)]


def sign_towards(contact: Contact, load: Any) -> float:
    """Return the direction of a positive pressure relative to a tool.

    Args:
        contact: the contact with the tool.
        load: the pressure.

    Returns:
        1 towards the tool, -1 away from it, 0 if unknown.
    """
    if contact.on not in _OPPOSITE or load.on not in _OPPOSITE:
        return 0.0
    return {contact.on: -1.0, _OPPOSITE[contact.on]: 1.0}.get(load.on, 0.0)


def free_distance(tool: RigidTool, points: np.ndarray, directions: np.ndarray, limit: float) -> np.ndarray:
    """Return the distances from points to a tool along given directions.

    Args:
        tool: the tool.
        points: shape (n, c), length.
        directions: unit vectors, shape (n, c).
        limit: largest distance, length.

    Returns:
        The distances, shape (n,), length; infinity beyond `limit`.
    """
    distance = np.zeros(len(points))
    for _ in range(1000):                                    # the gap to the tool is a safe advance
        gap = -tool.signed_distance(points + distance[:, None] * directions)
        if not np.any((gap > 1e-6 * limit / 100) & (distance < limit)):
            break
        distance = np.minimum(distance + np.maximum(gap, 0.0), limit)
    return np.where(distance < limit, distance, np.inf)


def outward_directions(points: np.ndarray, opposite: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points of a face and its outward directions, away from the opposite face.

    Args:
        points: nodes of the face, shape (n, 2), length.
        opposite: nodes of the opposite face, shape (m, 2), length.

    Returns:
        The points that do not lie on both faces, and unit vectors, shape (k, 2) each.
    """
    directions = points - opposite[np.argmin(np.hypot(*(points[:, None] - opposite).transpose(2, 0, 1)), axis=1)]
    size = np.hypot(*directions.T)
    return points[size > 0], directions[size > 0] / size[size > 0, None]


def _is_before(scene: Scene, contact: Contact) -> bool:
    """Return True if the tool lies in front of at least half of the face."""
    opposite = _OPPOSITE.get(contact.on)
    if opposite is None or opposite not in scene.mesh.boundaries:
        return False
    points = np.unique(scene.mesh.nodes_of(contact.on), axis=0)
    if scene.kinematics.components == 3:
        points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
        directions = np.tile([0.0, 0.0, 1.0 if contact.on == "top" else -1.0], (len(points), 1))
    else:
        points, directions = outward_directions(points, scene.mesh.nodes_of(opposite))
    if not len(points):
        return False
    free = free_distance(contact.tool, points, directions, 100 * float(np.ptp(points, axis=0).max()))
    return bool(np.mean(np.isfinite(free)) >= _COVERED)
