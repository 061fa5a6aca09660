"""Clearance between the tools of a process in its stages, checked before anything is solved."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import InputError
from ..physics.contact import Contact
from .scene import Scene

_LOOKS = 50            # number of positions of the tools that are checked in a stage
_MOST = 1000           # largest number of points of a tool in three dimensions that are checked


def check(scene: Scene, plans: list[Any], stands: dict[int, float] | None = None) -> list[Any]:
    """Raise an InputError if tools of a stage overlap, or one goes through a constrained boundary.

    If a travel is not known before the run (a stage that ends at a pole height), its tool is not checked from there on.

    Args:
        plans: plans of the stages, with `stage`, the `numbers` of its controls, `tables` [(number, table)], and the
            numbers of inactive items, `off`.
        stands: travels at the beginning, {number: length}; default 0.

    Returns:
        The plans with an unknown travel at their beginning, to be checked again when the run reaches them.
    """
    tools = {i: item for i, item in enumerate(scene.items) if isinstance(item, Contact)}
    outlines = {i: _outline(tool) for i, tool in tools.items()}
    stands, unsure = stands or dict.fromkeys(tools, 0.0), []
    for plan in plans:
        if not all(map(np.isfinite, stands.values())):
            unsure.append(plan)
        present = {i: tool for i, tool in tools.items() if i not in plan.inactive}
        for where in _legs(plan, stands):
            for i in (i for i in present if where[i] != stands[i] and np.isfinite(where[i])):
                try:
                    scene.check_travel(tools[i], where[i])
                except InputError as error:
                    raise InputError(f"{plan.stage.who}: {error}") from None
            for part in np.linspace(0, 1, _LOOKS) if where != stands else [1.0]:
                now = {i: stands[i] + part * (where[i] - stands[i]) for i in tools}
                _check_overlap(scene, plan.stage.who, present, outlines, now)
            stands = where
    return unsure


def _legs(plan: Any, stands: dict[int, float]) -> Iterator[dict[int, float]]:
    """Yield the travels of all tools at the ends of the straight pieces of a stage, {number: length}."""
    if plan.tables:
        for time in sorted({t for _, table in plan.tables for t in table[:, 0]}):
            yield stands | {i: float(np.interp(time, *table.T)) for i, table in plan.tables
                            if i in stands and time >= table[0, 0]}
    else:
        until = plan.stage.until
        end = until.value if until is not None and until.name.endswith("travel") else np.nan
        yield stands | {i: end for i in plan.numbers if i in stands}


def _check_overlap(scene: Scene, caller: str, present: dict[int, Contact], outlines: dict[int, np.ndarray],
                   where: dict[int, float]) -> None:
    near = 1e-6 * max(scene.extent)
    for i, a in present.items():
        for j, b in present.items():
            if j <= i or j in scene.together(i) or not np.isfinite(where[i] + where[j]):
                continue
            shift = where[i] * a.way - where[j] * b.way
            for points, other, back in ((outlines[i] + shift, b, 0.0), (outlines[j], a, shift)):
                depth = other.tool.signed_distance(points - back)
                worst = int(np.argmax(depth))
                if depth[worst] > near:
                    at = ", ".join(f"{x:.6g}" for x in points[worst] + where[j] * b.way)
                    axes = ", ".join(scene.kinematics.axes).replace("r, z", "R, Z")
                    raise InputError(f"{caller}: tools overlap: {_at(a, where[i])} and {_at(b, where[j])} reach"
                                     f" {depth[worst]:.6g} into each other at ({axes}) = ({at}); leave one out"
                                     f" with inactive=[...], or end the travel earlier")


def _outline(contact: Contact, pieces: int = 20) -> np.ndarray:
    """Points along a tool's profile, shape (n, 2); of one in three dimensions some of its surface, shape (n, 3)."""
    points, lines = contact.tool.surface()
    if contact.tool.components == 3:
        return points[:: max(1, len(points) // _MOST)]
    (a, b), parts = points[lines.T][..., None, :], np.linspace(0, 1, pieces, endpoint=False)[:, None]
    return np.concatenate([*(a + parts * (b - a)), points[-1:]])


def _at(contact: Contact, travel: float) -> str:
    return f"{contact!r}" + (f" at travel {travel:g}" if contact.direction else "")
