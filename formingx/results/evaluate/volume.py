"""Findings on elements that do not keep their volumes; J = det F is the volume ratio at a point."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...findings import Finding, percent
from ...physics.supports import Clamped
from ...values.tolerances import NOTICEABLE

_CORNER_DISTANCE = 2.0
"""Distance from a clamped face, over the length of the face, within which its singular corners affect J."""

_MAX_VOLUME_RATIO = 2.0
"""Largest J, and largest 1/J, at the quadrature points and between them; beyond it a report warns."""


def findings(error: float, where: str, far_error: float | None = None) -> list[Finding]:
    """Return a finding in a list if the root mean square of J - 1 exceeds 0.005 in a state; else an empty list.

    The finding is a warning above 0.02, else a note. It is a note as well if only the corners of clamped faces
    contribute to the error.

    Args:
        error: root mean square of J - 1 over the body.
        where: name of the state, for the message.
        far_error: root mean square of J - 1 away from clamped faces (`away_from_clamps`); None if it is unknown or
            nothing is clamped.
    """
    if error <= NOTICEABLE:
        return []
    if far_error is not None and far_error <= 4 * NOTICEABLE:
        return [Finding("note", "volume", f"The elements at the corner of a clamped face do not keep their volumes: the"
                        f" root mean square of J - 1 is {percent(error)} ({where}), and {percent(far_error)} from"
                        f" {_CORNER_DISTANCE:g} lengths of that face on. The corner is singular: take no stresses from"
                        " there.")]
    return [Finding("warning" if error > 4 * NOTICEABLE else "note", "volume",
                    f"The elements do not keep their volumes: the root mean square of J - 1 is up to"
                    f" {percent(error)} ({where}): use a finer mesh.")]


def away_from_clamps(path: Any) -> float | None:
    """Return the root mean square of J - 1 in the last state of a path away from clamped faces; collective.

    The effect of the singular corners of a clamped face decays over the length of the face, which is the wall of a
    sheet (Saint-Venant). Points nearer to a clamped face than twice this length are left out.

    Args:
        path: the computed `Path`.

    Returns:
        The root mean square, or None without clamped faces.
    """
    faces, reach = _clamped(path)
    return path.problem.volume_error_away(path.last, faces, reach) if len(faces) else None


def _clamped(path: Any) -> tuple[np.ndarray, float]:
    """Return the nodes of the clamped faces of a solid, and the distance within which their corners affect J.

    Args:
        path: the computed `Path`.

    Returns:
        Reference positions, shape (n, 2), length; twice the length of the longest clamped face, length. Without a
        clamped face n and the length are 0.
    """
    scene = path.problem.scene
    clamped = [support.on for support in scene.supports if isinstance(support, Clamped)] if scene.model.solid else []
    faces = [scene.mesh.nodes_of(name) for name in clamped]
    reach = max((float(np.hypot(*np.ptp(face, axis=0))) for face in faces), default=0.0)
    return np.vstack([np.zeros((0, 2)), *faces]), _CORNER_DISTANCE * reach


def extreme_ratio(path: Any) -> list[Finding]:
    """Return a finding in a list if J is not between 1/2 and 2 somewhere in the last state; else an empty list.

    J is examined at the quadrature points, at the points of the rule of the next higher degree, and at the middles of
    the edges. The finding is a warning for J <= 0 away from clamped faces, else a note. Collective.

    Args:
        path: the computed `Path`.
    """
    furthest = path.problem.extreme_volume_ratio(path.last)
    J = 1.0 if furthest is None else furthest.value
    if 1 / _MAX_VOLUME_RATIO < J < _MAX_VOLUME_RATIO:
        return []
    faces, reach = _clamped(path)
    singular = len(faces) and np.hypot(*(faces - furthest.point).T).min() < reach
    return [Finding("note" if J > 0 or singular else "warning", "element",
                    f"The volume ratio J is {J:.3g} in the last state at (R, Z) = ({furthest.point[0]:.5g},"
                    f" {furthest.point[1]:.5g}): the stress in that element is meaningless.")]
