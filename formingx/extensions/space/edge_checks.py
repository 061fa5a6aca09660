"""Checks of the held edge of a flat sheet against the tools: a mould below it or beside it, a plug that meets it."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...checks.mould_side import free_distance
from ...findings import Finding, coordinates, register
from ...physics.supports import Symmetry
from .mould_checks import fixed_tools, nodes_and_direction, whole_extent
from .tool_checks import files_of

_LOW_MOULD = 5e-3          # distance of a mould below the held edge that is reported, over the width of the sheet
_LEVEL = 1e-2              # difference of heights that is negligible, over the width of the sheet
_DEEP = 0.05               # depth of a mould under the held edge that is reported, over the width of the sheet


@register("start")
def moulds_off_the_held_edge(body: Any) -> Iterator[Finding]:
    """Yield a finding for each mould below the held edge of a sheet, beside the sheet, or upside down."""
    scene = body.scene
    held = _held_nodes(scene)
    if not len(held):
        return
    width = float(whole_extent(scene).max())
    for contact in fixed_tools(scene):
        tool, (points, ahead) = contact.tool, nodes_and_direction(scene, contact)
        gap = ahead * (tool.bounds[0 if ahead > 0 else 1, 2] - points[0, 2])
        free, under = (_free(tool, x, ahead, body.length) for x in (points, held))
        deepest = float(free[np.isfinite(free)].max(initial=0.0))
        if deepest > gap + _LEVEL * width and gap > _LOW_MOULD * width:
            yield Finding("warning", repr(contact), f"the mould lies {body.format(gap, 'travel', 3)} beyond the held"
                          f" edge of the sheet: the sheet is blown out between them, and its wall there may become"
                          f" very thin: move the mould to the sheet (moved)")
        elif files_of(tool) and np.isfinite(free).all() and free.max() < gap + _LEVEL * width:
            yield Finding("warning", repr(contact), "the side of the tool next to the sheet is flat, so the sheet will"
                          " not be formed: is its file upside down?")
        elif getattr(tool, "kind", "") != "extruded" and np.isfinite(under).any() and under.min() < _LEVEL * width:
            deep = np.isfinite(under) & (under > _DEEP * width)
            if deep.any():
                place = coordinates(held[int(np.argmax(np.where(deep, under, 0.0))), :2])
                yield Finding("warning", repr(contact), f"a part of the held edge, as at (x, y) = {place},"
                              f" lies over the cavity of the mould, whose other parts lie beside the sheet: move the"
                              f" mould or the sheet, or use a wider sheet")


@register("start")
def plugs_that_meet_the_held_edge(body: Any) -> Iterator[Finding]:
    """Yield a finding for each tool that meets the held edge of a sheet in its travel; it cannot give way."""
    scene = body.scene
    held = _held_nodes(scene)
    travels = [abs(entry.value) for entry in body.prescribed if entry.quantity == "travel"]
    if not len(held) or not travels:
        return
    for contact in scene.contacts:
        if contact.direction is None or not contact.tool.sized:
            continue
        way = contact.travel_vector / np.linalg.norm(contact.travel_vector)
        free = free_distance(contact.tool, held, np.tile(-way, (len(held), 1)), 10 * body.length)
        k = int(np.argmin(free))
        if free[k] < max(travels):
            x, y, z = held[k]
            yield Finding("warning", repr(contact), f"after a travel of {body.format(free[k], 'travel', 3)} the tool"
                          f" meets the held edge of the sheet at (x, y, z) = {coordinates((x, y, z))}, which cannot"
                          f" give way: use a smaller tool, a wider sheet or a shorter travel")


def _held_nodes(scene: Any) -> np.ndarray:
    """Return the nodes of a flat sheet whose displacement along z is constrained, shape (n, 3), length."""
    if scene.kinematics.components != 3 or not scene.mesh.flat:
        return np.zeros((0, 3))
    held = [scene.mesh.nodes_of(support.on) for support in scene.supports if not isinstance(support, Symmetry)
            and any(scene.kinematics.axes[c.component] == "z"
                    for c in scene.kinematics.in_axes(support, support.constraints()))]
    return np.unique(np.vstack(held), axis=0) if held else np.zeros((0, 3))


def _free(tool: Any, points: np.ndarray, ahead: float, length: float) -> np.ndarray:
    """Return the distances of points, shape (n, 3), from a tool along z, shape (n,), length, or inf."""
    return free_distance(tool, points, np.tile([0.0, 0.0, ahead], (len(points), 1)), 10 * length)
