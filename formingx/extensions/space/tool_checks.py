"""Checks of what the triangles of a tool's file, and of a sheet, cannot resolve."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...contact.tooling import Tooling
from ...findings import Finding, coordinates, percent, register
from ...ranks import gathered
from ...tools.pieces import Arc
from ...values.tolerances import LARGE_ERROR
from .intersection import Intersection
from .passed_tools import surface_points
from .solid_tool import Swept
from .triangulated import Triangulated
from .union import Union
from .wall import nearest_triangles, wall_of

_FILLET_SHARE = 2e-3       # of the points of a tool over the sheet, from which on a concave fillet is reported
_RIDGE, _RIDGE_POINTS = 0.02, 41                            # smallest relative size of a ridge; points on a piece
_NEAR_RIDGE = 3.0          # distance of a node from a ridge, over its longest edge, within which the ridge counts
_ON_SURFACE = 5e-3         # of a point from the tool, over its size
_COARSE_WALL = 0.02        # error of the volume of a sheet by its triangles that is reported


def _members(tool: Any) -> list[Any]:
    """Return the tools that a union or an intersection combines, relative to it; an empty list for another tool."""
    if isinstance(tool, Intersection):
        return [tool.first, tool.second]
    return tool.parts if isinstance(tool, Union) else []


def _parts(tool: Any) -> list[Any]:
    """Return the parts of unions and intersections of tools, or the tool itself, as a list."""
    return [piece for part in _members(tool) for piece in _parts(part.moved(*tool.shift))] or [tool]


def files_of(tool: Any) -> list[Triangulated]:
    """Return the parts of a tool that were read from files."""
    return [part for part in _parts(tool) if isinstance(part, Triangulated)]


@register("start")
def unresolved_files(body: Any) -> Iterator[Finding]:
    """Yield a finding for each STL file that does not resolve its surface: sharp edges across triangles, or noise.

    The fitted normals then satisfy the equations of smooth edges badly (`Triangulated.roughness`).
    """
    for contact in body.scene.contacts:
        for tool in files_of(contact.tool):
            ratio, place = tool.roughness
            if ratio > LARGE_ERROR:
                position = coordinates(place)
                yield Finding("warning", repr(contact), f"the triangles of {tool.name!r} do not resolve its surface:"
                              f" their normals miss those of a smooth surface by {percent(ratio)} of the angles"
                              f" between triangles, most at (x, y, z) = {position}. Edges cross the triangles, or"
                              f" the points are noisy: a sheet that slides may stop there. Write the file with"
                              f" triangles along its edges, or as STEP, or use crease=0 for its flat triangles")


@register("start")
def coarse_fillets(body: Any) -> Iterator[Finding]:
    """Yield a finding for each tool with a concave fillet below the median edge of the sheet's triangles; collective.

    The sheet then turns by about a radian from triangle to triangle.
    """
    scene = body.scene
    if scene.kinematics.components != 3:
        return
    length = _median_edge(scene.mesh)
    nodes = gathered(scene.mesh.comm, scene.mesh.domain.geometry.x) if scene.mesh.flat else None
    for contact in scene.contacts:
        radius, place = min((_smallest_fillet(part, nodes, length) for part in _parts(contact.tool)),
                            key=lambda found: found[0])
        edge = _smallest_edge(contact.tool, convex=not contact.sticks)
        if edge < radius:
            radius, place = edge, None
        if radius < length:
            position = "" if place is None else f", as at (x, y, z) = {coordinates(place)}"
            slides = "" if contact.sticks else ", and a sheet that slides may not converge"
            yield Finding("warning", repr(contact), f"it has fillets of radius {radius:.3g}{position}, and half of the"
                          f" edges of the triangles are longer than {length:.4g}: the wall there will be too thick or"
                          f" too thin by tens of per cent{slides}. Use triangles of size {radius:.3g} or less, or"
                          f" adapt_mesh=True.")


def _smallest_edge(tool: Any, convex: bool) -> float:
    """Return the smallest fillet of the edges where parts of a tool meet, length; inf without one.

    convex: True to count the edges of intersections, which are convex, with the concave ones of unions.
    """
    parts = _members(tool)
    own = [tool.fillet] if parts and tool.fillet > 0 and (convex or isinstance(tool, Union)) else []
    return float(min([*own, *(_smallest_edge(part, convex) for part in parts)], default=np.inf))


def _smallest_fillet(tool: Any, nodes: np.ndarray | None, length: float) -> tuple[float, np.ndarray | None]:
    """Return the radius of the smallest concave fillet of a tool, length, and a place there, shape (3,), or None.

    nodes: of a flat sheet, (n, 3), else None: files are not examined. length: median edge. Without fillet: inf.
    """
    if isinstance(tool, Swept):
        arcs = (piece for piece in tool.profile.pieces if isinstance(piece, Arc) and piece.radius > 0)
        concave = [arc.radius for arc in arcs if tool.profile.signed_distance(arc.centre[None])[0] < 0]
        return min(concave, default=np.inf), None
    if not isinstance(tool, Triangulated) or nodes is None:
        return np.inf, None
    from scipy.spatial import cKDTree
    points = surface_points(tool, length / 3, nodes, 0.0)
    i, j = cKDTree(points).query_pairs(length / 2, output_type="ndarray").T
    apart = points[j] - points[i]
    square = (apart**2).sum(1)
    kept = square > (length / 6) ** 2
    normal = tool.distances(points).normal
    bend = ((normal[j] - normal[i])[kept] * apart[kept]).sum(1) / square[kept]     # concave: positive
    small = bend * length > 1
    if not small.mean() > _FILLET_SHARE:
        return np.inf, None
    return 1 / float(np.median(bend[small])), points[i[kept][int(np.argmax(bend))]]


@register("start")
def sharp_ridges(body: Any) -> Iterator[Finding]:
    """Yield a finding for each contact that slides into a sharp ridge between the sides of a tool round a rectangle.

    The sides meet sharply where the profile is narrower than the corners: the normal of the tool jumps there.
    """
    for contact in body.scene.contacts:
        for _, places, advice in _ridges(contact):
            ends = " to ".join(map(coordinates, places[[0, -1]]))
            yield Finding("serious", repr(contact), f"its sides meet at a sharp ridge from (x, y, z) = {ends}. A sheet"
                          f" that slides stops where a node meets it. Round it: {advice}")


@register("failure")
def stopped_at_a_ridge(failure: Any) -> Iterator[Finding]:
    """Yield a finding if the largest out-of-balance force is within three triangles of a sharp ridge; collective."""
    problem, last, worst = failure.problem, failure.last, failure.facts.get("worst")
    if last is None or worst is None or problem.scene.kinematics.components != 3:
        return
    tooling, wall = Tooling.of_problem(problem), None
    for contact, travel in zip(tooling.contacts, tooling.travels(last.setting, last.control), strict=True):
        for part, places, advice in () if travel is None else _ridges(contact):
            wall = wall or wall_of(SimpleNamespace(problem=problem), last)
            node, triangles = nearest_triangles(wall, worst.position)
            corners, position = wall.deformed_points[wall.triangles[triangles]], wall.deformed_points[node]
            relative, on_ridge = position - (travel or 0.0) * contact.travel_vector - part.shift, places - part.shift
            away = relative - on_ridge
            away[:, :2] = np.abs(relative[:2]) - np.abs(on_ridge[:, :2])                   # of the four ridges
            distance = float(np.linalg.norm(away, axis=1).min())
            if distance < _NEAR_RIDGE * np.linalg.norm(corners - position, axis=2).max():
                yield Finding("serious", "contact", f"the sheet slides near a sharp ridge of the tool"
                              f" {contact.label!r}: the largest out-of-balance force is {distance:.2g} away from it, at"
                              f" {worst}. The normal jumps on the ridge, and in fillets which it meets",
                              f"a rounded ridge: {advice}")


def _ridges(contact: Any) -> Iterator[tuple[Swept, np.ndarray, str]]:
    """Yield each part with a sharp ridge of a tool on which a sheet slides, its points, (k, 3), length, and advice."""
    for part in _parts(contact.tool) if contact.lagged and not contact.sticks else ():
        if isinstance(part, Swept) and part.kind == "box" and len(places := ridge(part, contact.tool)):
            yield part, places, (f"corner = {min(part.half) - _inner_radius(places, part):.4g} or more, or take the"
                                 f" union of two extruded profiles, fx.tools.union(a, b, fillet=...), with a fillet"
                                 f" above the size of the triangles")


def ridge(part: Swept, tool: Any) -> np.ndarray:
    """Return points on the ridge of a cavity round a rectangle, those on the surface of the whole tool, (k, 3), length.
    """
    inner = min(part.half) - part.corner
    points = part.profile.outline()
    s = np.linspace(0.0, 1.0, _RIDGE_POINTS)[:, None]
    line = np.concatenate([(1 - s) * a + s * b for a, b in zip(points[:-1], points[1:])])
    normal = part.profile.nearest(line).normal
    line = line[(line[:, 0] < (1 - _RIDGE) * inner) & (line[:, 0] > 0) & (normal[:, 0] > _RIDGE)]
    out = np.array(part.half) - part.corner + line[:, :1] - inner
    found = np.column_stack([out, line[:, 1]]) + part.shift
    near = _ON_SURFACE * np.ptp(points, axis=0).max()
    return found[np.abs(tool.signed_distance(found)) < near]


def _inner_radius(places: np.ndarray, part: Swept) -> float:
    """Return the smallest profile coordinate r of points on a ridge, shape (k, 3), length."""
    return float(places[:, 0].min() - part.shift[0] - part.half[0] + min(part.half))


@register("start")
def rough_thickness(body: Any) -> Iterator[Finding]:
    """Yield a finding for each layer whose thickness the triangles of the sheet do not resolve; collective.

    The membrane uses linear thickness in each triangle, the wall the value in its middle. Both must agree.
    """
    scene = body.scene
    if scene.kinematics.components != 3:
        return
    points, triangles = scene.mesh.whole()
    corners = points[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    for name, thickness in scene.thickness.items():
        linear = np.mean([thickness(*corners[:, k].T) for k in range(3)], axis=0) + np.zeros(len(area))
        middle = np.asarray(thickness(*corners.mean(1).T)) + np.zeros(len(area))
        error = np.abs(linear - middle)
        share = float(area @ error / (area @ middle))
        if share > _COARSE_WALL:
            k = int(np.argmax(error))
            position = coordinates(corners[k].mean(0))
            yield Finding("warning", f"thickness of {name!r}", f"the thickness varies within the triangles: its mean at"
                          f" their corners misses that in their middle by {percent(share)} on average, most at (x, y,"
                          f" z) = {position}. Use smaller triangles, or a smoother thickness")


def _median_edge(mesh: Any) -> float:
    """Return the median length of the edges of the triangles of a sheet; collective."""
    points, triangles = mesh.whole()
    corners = points[triangles]
    return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
