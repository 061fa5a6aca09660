"""Moulds in front of a face, and the side on which a pressure acts."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..physics.contact import Contact
from ..scene.scene import Scene
from ..tools.tool import RigidTool

_OPPOSITE = {"top": "bottom", "bottom": "top", "inner": "outer", "outer": "inner"}


def moulds(scene: Scene) -> list[Contact]:
    """Return the contacts with moulds, fixed tools in front of at least half of the undeformed face."""
    return [contact for contact in scene.contacts if contact.direction is None and _covers_face(scene, contact)]


def sign_towards(contact: Contact, load: Any) -> float:
    """Return 1 if a positive pressure pushes a sheet towards a tool, -1 away from it, 0 off its faces."""
    if contact.on not in _OPPOSITE or load.on not in _OPPOSITE:
        return 0.0
    return {contact.on: -1.0, _OPPOSITE[contact.on]: 1.0}.get(load.on, 0.0)


def free_distance(tool: RigidTool, points: np.ndarray, directions: np.ndarray, limit: float) -> np.ndarray:
    """Return distances (n,) of outside points (n, c) from a tool along unit directions, length; inf beyond `limit`."""
    distance = np.zeros(len(points))
    rows: np.ndarray = np.arange(len(points))
    for _ in range(1000):                                    # the gap to the tool is a safe advance
        gap = -tool.signed_distance(points[rows] + distance[rows, None] * directions[rows])
        rows, gap = rows[gap > 1e-6 * limit / 100], gap[gap > 1e-6 * limit / 100]
        distance[rows] = np.minimum(distance[rows] + gap, limit)
        rows = rows[distance[rows] < limit]
        if not len(rows):
            break
    return np.where(distance < limit, distance, np.inf)


def outward_directions(points: np.ndarray, opposite: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the k nodes of a face off the opposite one, (k, 2), and their unit vectors away from it, (k, 2)."""
    directions = points - opposite[np.argmin(np.hypot(*(points[:, None] - opposite).transpose(2, 0, 1)), axis=1)]
    size = np.hypot(*directions.T)
    return points[size > 0], directions[size > 0] / size[size > 0, None]


def _covers_face(scene: Scene, contact: Contact) -> bool:
    """Return True if the tool of a contact lies in front of at least half of the undeformed face of the contact."""
    opposite = _OPPOSITE.get(contact.on)
    if opposite is None or opposite not in scene.mesh.boundaries:
        return False
    if scene.kinematics.components == 3:
        surface: Any = scene.mesh
        points, directions = surface.outward(contact.on)
    else:
        points = np.unique(scene.mesh.nodes_of(contact.on), axis=0)
        points, directions = outward_directions(points, scene.mesh.nodes_of(opposite))
    if not len(points):
        return False
    free = free_distance(contact.tool, points, directions, 100 * float(np.ptp(points, axis=0).max()))
    return bool(2 * np.isfinite(free).sum() >= len(free))
