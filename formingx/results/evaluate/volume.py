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

    Above 0.02 it is a warning, unless `far_error`, away from clamped faces, is small; `where` names the state.
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
    """Return the root mean square of J - 1 in the last state away from clamps, or None without; collective."""
    faces, reach = _clamped(path)
    return path.problem.volume_error_away(path.last, faces, reach) if len(faces) else None


def _clamped(path: Any) -> tuple[np.ndarray, float]:
    """Return the nodes of clamped faces, (n, 2), and twice the length of the longest face, length."""
    scene = path.problem.scene
    clamped = [support.on for support in scene.supports if isinstance(support, Clamped)] if scene.model.solid else []
    faces = [scene.mesh.nodes_of(name) for name in clamped]
    reach = max((float(np.hypot(*np.ptp(face, axis=0))) for face in faces), default=0.0)
    return np.vstack([np.zeros((0, 2)), *faces]), _CORNER_DISTANCE * reach


def extreme_ratio(path: Any) -> list[Finding]:
    """Return a finding in a list if J is not between 1/2 and 2 somewhere in the last state; collective.

    J is examined at quadrature points, also of the next higher degree, and at middles of edges. J <= 0 away from clamps
    is a warning.
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
