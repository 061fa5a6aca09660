"""Check that the tools of a process do not overlap, before anything is solved."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import InputError
from ..physics.contact import Contact
from ..values.tolerances import CURVE_POINTS, PIECE_POINTS
from .contact_checks import check_travel
from .scene import Scene


def check(scene: Scene, plans: list[Any], travels: dict[int, float] | None = None) -> list[Any]:
    """Check that tools do not overlap in the stages of a process, and that none passes a constrained boundary.

    Travels are {number in `Scene.items`: length}, None: all 0. Stages from which on a travel is unknown are returned,
    to be checked when the run reaches them. A violation is an InputError.
    """
    tools = {i: item for i, item in enumerate(scene.items) if isinstance(item, Contact)}
    outlines = {i: _outline(tool) for i, tool in tools.items()}
    travels, unknown = travels or dict.fromkeys(tools, 0.0), []
    for plan in plans:
        if not all(map(np.isfinite, travels.values())):
            unknown.append(plan)
        present = {i: tool for i, tool in tools.items() if i not in plan.inactive}
        for ends in _break_points(plan, travels):
            for i in (i for i in present if ends[i] != travels[i] and np.isfinite(ends[i])):
                try:
                    check_travel(scene, tools[i], ends[i])
                except InputError as error:
                    raise InputError(f"{plan.stage.label}: {error}") from None
            _check_motion(scene, plan.stage.label, present, outlines, (travels, ends))
            travels = ends
    return unknown


def check_target(scene: Scene, target: Any) -> None:
    """Raise an InputError if the tool that `trace` drives overlaps another one on its way to a target travel."""
    if target.name != "travel" or not isinstance(scene.driven, Contact):
        return
    tools = {i: item for i, item in enumerate(scene.items) if isinstance(item, Contact)}
    outlines = {i: _outline(tool) for i, tool in tools.items()}
    start, end = ({i: travel * tool.driven for i, tool in tools.items()} for travel in (0.0, target.value))
    _check_motion(scene, str(target), tools, outlines, (start, end))


def _check_motion(scene: Scene, label: str, tools: dict[int, Contact], outlines: dict[int, Any],
                  travels: tuple[dict[int, float], dict[int, float]]) -> None:
    """Raise an InputError, with the label of stage or target, if tools overlap in a motion between travels."""
    start, end = travels
    for part in np.linspace(0, 1, PIECE_POINTS) if end != start else [1.0]:
        current = {i: start[i] + part * (end[i] - start[i]) for i in start}
        _check_overlap(scene, label, tools, outlines, current)


def _break_points(plan: Any, travels: dict[int, float]) -> Iterator[dict[int, float]]:
    """Yield the travels {number in `Scene.items`: length} at the break points of a stage, or at its end.

    Between points of its tables they are linear. A travel that is known only in the run is nan.
    """
    if plan.tables:
        for time in sorted({t for _, table in plan.tables for t in table[:, 0]}):
            yield travels | {i: float(np.interp(time, *table.T)) for i, table in plan.tables
                            if i in travels and time >= table[0, 0]}
    else:
        until = plan.stage.until
        end = until.value if until is not None and until.name.endswith("travel") else np.nan
        yield travels | {i: end for i in plan.numbers if i in travels}


def _check_overlap(scene: Scene, caller: str, present: dict[int, Contact], outlines: dict[int, np.ndarray],
                   travels: dict[int, float]) -> None:
    """Raise an InputError, begun by `caller`, if active tools overlap at travels, {number in `Scene.items`: length}."""
    near = 1e-6 * max(scene.extent)
    for i, a in present.items():
        for j, b in present.items():
            if j <= i or j in scene.same_tool(i) or not np.isfinite(travels[i] + travels[j]):
                continue
            shift = travels[i] * a.travel_vector - travels[j] * b.travel_vector
            for points, other, back in ((outlines[i] + shift, b, 0.0), (outlines[j], a, shift)):
                depth = other.tool.signed_distance(points - back)
                worst = int(np.argmax(depth))
                if depth[worst] > near:
                    position = ", ".join(f"{x:.6g}" for x in points[worst] + travels[j] * b.travel_vector)
                    axes = ", ".join(scene.kinematics.axes).replace("r, z", "R, Z")
                    raise InputError(f"{caller}: tools overlap: {_with_travel(a, travels[i])} and"
                                     f" {_with_travel(b, travels[j])} reach {depth[worst]:.6g} into each other at"
                                     f" ({axes}) = ({position}); leave one out with inactive=[...], or end the travel"
                                     f" earlier")


def _outline(contact: Contact, pieces: int = 20) -> np.ndarray:
    """Return points on the profile of a tool without travel, shape (n, 2), length, `pieces` of them on each line.

    In three dimensions they are at most about 4000 vertices of the surface of the tool, shape (n, 3).
    """
    points, lines = contact.tool.surface()
    if contact.tool.components == 3:
        return points[:: max(1, len(points) // CURVE_POINTS)]
    (a, b), parts = points[lines.T][..., None, :], np.linspace(0, 1, pieces, endpoint=False)[:, None]
    return np.concatenate([*(a + parts * (b - a)), points[-1:]])


def _with_travel(contact: Contact, travel: float) -> str:
    """Return a contact and the travel of its tool as text."""
    return f"{contact!r}" + (f" at travel {travel:g}" if contact.direction else "")
