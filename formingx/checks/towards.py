"""Moulds in front of a face, and the side on which a pressure acts."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..physics.contact import Contact
from ..scene.scene import Scene
from ..tools.tool import RigidTool

_OPPOSITE = {"top": "bottom", "bottom": "top", "inner": "outer", "outer": "inner"}
_BEFORE = 0.5              # share of a face that has the tool in front of it, from which on the tool is its mould


def moulds(scene: Scene) -> list[Contact]:
    """Return the contacts whose fixed tool lies in front of at least half of their undeformed face."""
    return [contact for contact in scene.contacts if contact.direction is None and _is_before(scene, contact)]


def sign_towards(contact: Contact, load: Any) -> float:
    """Return 1 if a positive pressure pushes the body towards the tool of a contact, -1 if away, 0 if not known."""
    if contact.on not in _OPPOSITE or load.on not in _OPPOSITE:
        return 0.0
    return {contact.on: -1.0, _OPPOSITE[contact.on]: 1.0}.get(load.on, 0.0)


def free_way(tool: RigidTool, points: np.ndarray, way: np.ndarray, far: float) -> np.ndarray:
    """Return how far points, shape (n, c), go along unit vectors until they are in a tool; infinity beyond `far`."""
    gone = np.zeros(len(points))
    for _ in range(1000):                                    # the distance to the tool is a safe advance
        free = -tool.signed_distance(points + gone[:, None] * way)
        if not np.any((free > 1e-6 * far / 100) & (gone < far)):
            break
        gone = np.minimum(gone + np.maximum(free, 0.0), far)
    return np.where(gone < far, gone, np.inf)


def through(points: np.ndarray, opposite: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points of a face, and the unit vectors out of the body there, away from the opposite face.

    Args:
        points, opposite: of the two faces, shape (n, 2) and (m, 2). Points that both have are left out.
    """
    way = points - opposite[np.argmin(np.hypot(*(points[:, None] - opposite).transpose(2, 0, 1)), axis=1)]
    size = np.hypot(*way.T)
    return points[size > 0], way[size > 0] / size[size > 0, None]


def _is_before(scene: Scene, contact: Contact) -> bool:
    other = _OPPOSITE.get(contact.on)
    if other is None or other not in scene.mesh.boundaries:
        return False
    points = np.unique(scene.mesh.nodes_of(contact.on), axis=0)
    if scene.kinematics.components == 3:
        points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
        way = np.tile([0.0, 0.0, 1.0 if contact.on == "top" else -1.0], (len(points), 1))
    else:
        points, way = through(points, scene.mesh.nodes_of(other))
    if not len(points):
        return False
    free = free_way(contact.tool, points, way, 100 * float(np.ptp(points, axis=0).max()))
    return bool(np.mean(np.isfinite(free)) >= _BEFORE)
