"""Checks of the size of fixed tools against a sheet in three dimensions."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...checks.mould_side import free_distance, moulds
from ...findings import Finding, coordinates, percent, register
from ...materials.inflation import FreeInflation, first_peak
from ...mesh.nodes import nearest
from ...physics.contact import Contact
from ...physics.supports import Symmetry
from ...scene.contact_checks import OTHER_UNIT
from .scene_checks import EXTENT_RATIO
from .triangulated import Triangulated

_NEAR = 0.1                # of a point to the middle or the rim of a tool, over its largest distance from the middle
_INSIDE = 0.01             # distance of a held edge inside the mouth of a mould that is reported, over the width

@register("start")
def sizes(body: Any) -> Iterator[Finding]:
    """Yield a finding for each fixed tool over 4 times wider or narrower than the sheet, as in another unit.

    A wide STL file is always reported, a wide swept profile, whose flange is arbitrary, if it is farther from the sheet
    than this is wide. A narrow tool is reported if it is a cavity.
    """
    for contact in fixed_tools(body.scene):
        tool, sheet = contact.tool, whole_extent(body.scene)
        file = isinstance(tool, Triangulated)
        wide, whole = float(_widths(tool).max()), float(sheet.max())
        points, ahead = nodes_and_direction(body.scene, contact)
        gap = float(-tool.signed_distance(points).max())
        narrow = wide * OTHER_UNIT < whole and is_cavity(tool, ahead)
        if narrow or wide > OTHER_UNIT * whole and (file or gap > whole / 2):
            advice = "is its file in another unit of length? Give solid a scale=..." if file else \
                "are the units of length the same (mm and cm)?"
            yield Finding("warning", repr(contact),
                          f"the tool is {wide / whole:.3g} times as wide as the sheet: {advice}")


@register("start")
def small_pushers(body: Any) -> Iterator[Finding]:
    """Yield a finding for each tool that moves and is over 9 times smaller than the sheet, as in another unit."""
    if body.scene.kinematics.components != 3:
        return
    whole = float(whole_extent(body.scene).max())
    for contact in body.scene.contacts:
        size = float(np.ptp(contact.tool.bounds, axis=0).max()) if contact.tool.sized else np.inf
        if contact.direction is not None and size * EXTENT_RATIO < whole:
            yield Finding("warning", repr(contact), f"the tool is {size:.4g} large, the sheet {whole:.4g}: are the"
                          f" units of length the same? If they are, use triangles smaller than the tool where it"
                          f" touches")


@register("scene")
def narrow_sheets(body: Any) -> Iterator[Finding]:
    """Yield a finding for each mould in whose mouth a sheet ends, farther than 1 % of its width from the wall."""
    scene = body.scene
    for contact in moulds(scene) if scene.kinematics.components == 3 and scene.mesh.flat else ():
        tool = contact.tool
        if not tool.sized:
            continue
        points, ahead = nodes_and_direction(scene, contact)
        gap = float(_distances_at_mouth(tool, points, ahead).min())
        if gap > _INSIDE * whole_extent(scene).max():
            yield Finding("warning", repr(contact), f"the mould is wider than the sheet: its mouth is"
                          f" {body.format(gap, 'travel', 3)} or more away from the sheet on all sides, so the edge of"
                          f" the sheet is held in the air: use a wider sheet, or a narrower mould")


@register("start")
def narrow_moulds(body: Any) -> Iterator[Finding]:
    """Yield a finding for a face of the sheet with moulds past whose end it hangs, if a pressure is too large for it.

    The overhang bears about as much as a disc. Its radius is the largest distance of a node without a tool straight
    ahead from nodes with one, and from the edges that are held.
    """
    scene = body.scene
    pressures = body.pressures() if scene.kinematics.components == 3 else []
    if not pressures or any(material.varies for material in scene.materials.values()):
        return
    held = [scene.mesh.nodes_of(s.on) for s in scene.supports if not isinstance(s, Symmetry)]
    for face in dict.fromkeys(contact.on for contact in fixed_tools(scene)):
        contacts = [c for c in scene.contacts if c.direction is None and c.on == face]
        points, ahead = nodes_and_direction(scene, contacts[0])
        ways = np.tile([0.0, 0.0, ahead], (len(points), 1))
        met = np.any([np.isfinite(free_distance(c.tool, points, ways, 100 * body.length)) for c in contacts], axis=0)
        if met.all() or not met.any():
            continue
        mouths = [_distances_at_mouth(c.tool, points[~met], ahead) for c in contacts if c.tool.sized]
        distance = np.min([nearest(np.vstack([points[met], *held]), points[~met])[0], *mouths], axis=0)
        layers = [(material, float(np.mean(scene.thickness[name](*points.T))))
                  for name, material in scene.materials.items()]
        peak = first_peak(FreeInflation(layers, float(distance.max())).disc) if distance.any() else None
        excessive = [entry for entry in pressures if peak is not None and abs(entry.value) > peak.pressure]
        if excessive and peak is not None:
            x, y, _ = points[~met][np.argmax(distance)]
            yield Finding("warning", repr(contacts[0]), f"the sheet hangs past the end of the mould:"
                          f" {percent(1 - met.mean())} of its nodes, as at (x, y) = {coordinates((x, y))}, have no tool"
                          f" straight ahead, and {excessive[0].text} is more than the"
                          f" {body.format(peak.pressure, 'pressure')} that a sheet of this overhang bears: it would be"
                          f" blown past the mould. Use a smaller sheet, or a mould with a wider flange")


def fixed_tools(scene: Any) -> list[Contact]:
    """Return the contacts of a flat sheet in three dimensions with fixed tools of finite size."""
    return [c for c in scene.contacts if scene.kinematics.components == 3 and scene.mesh.flat and c.direction is None
            and c.tool.sized]


def whole_extent(scene: Any) -> np.ndarray:
    """Return the extent along x and y of the whole sheet, of which a half or a quarter is modelled, shape (2,)."""
    cut = [any(plane.axis == axis for plane in scene.symmetry.planes) for axis in (0, 1)]
    return (1 + np.array(cut)) * scene.extent[:2]


def _widths(tool: Any) -> np.ndarray:
    """Return the widths of a tool along x and y, shape (2,), length; the arbitrary one of an extruded tool is 0."""
    widths = np.ptp(tool.bounds, axis=0)[:2]
    if getattr(tool, "kind", "") == "extruded":
        widths["xy".index(tool.along)] = 0.0
    return widths


def nodes_and_direction(scene: Any, contact: Contact) -> tuple[np.ndarray, float]:
    """Return the nodes of the sheet, shape (n, 3), length, and the z of the unit normal out of a contact's face."""
    return np.unique(scene.mesh.nodes_of(contact.on), axis=0), scene.mesh.faces[contact.on]


def _distances_at_mouth(tool: Any, points: np.ndarray, ahead: float) -> np.ndarray:
    """Return the distances of points, shape (n, 3), moved along z to the tool's end next to the sheet, shape (n,)."""
    mouth = tool.bounds[0 if ahead > 0 else 1, 2]
    return -tool.signed_distance(np.column_stack([points[:, :2], np.full(len(points), mouth)]))


def is_cavity(tool: Any, ahead: float) -> bool:
    """Return True if the middle of a tool is farther from the sheet than its rim; `ahead` is the z towards the tool."""
    points = tool.surface()[0]
    away, depth = np.hypot(*(points[:, :2] - points[:, :2].mean(0)).T), ahead * points[:, 2]
    middle, rim = away <= away.min() + _NEAR * np.ptp(away), away >= away.max() - _NEAR * np.ptp(away)
    return bool(depth[middle].min() > depth[rim].min())     # on the side next to the sheet
