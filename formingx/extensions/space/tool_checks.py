"""Checks of what the triangles of a tool's file, and of a sheet, cannot resolve."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...findings import Finding, percent, register
from ...ranks import gathered
from ...values.tolerances import LARGE_ERROR
from .triangulated import Triangulated
from .union import Union

_FILLET_SHARE = 2e-3       # of the points of a tool over the sheet, from which on a concave fillet is reported
_COARSE_WALL = 0.02        # error of the volume of a sheet by its triangles that is reported


def files_of(tool: Any) -> list[Triangulated]:
    """Return the parts of a tool that were read from files."""
    parts = tool.parts if isinstance(tool, Union) else [tool]
    return [part for part in parts if isinstance(part, Triangulated)]


@register("start")
def unresolved_files(body: Any) -> Iterator[Finding]:
    """Yield a finding for each STL file that does not resolve its surface: sharp edges across triangles, or noise.

    The fitted normals then satisfy the equations of smooth edges badly (`Triangulated.roughness`).
    """
    for contact in body.scene.contacts:
        for tool in files_of(contact.tool):
            ratio, place = tool.roughness
            if ratio > LARGE_ERROR:
                position = ", ".join(f"{v:.4g}" for v in place)
                yield Finding("warning", repr(contact), f"the triangles of {tool.name!r} do not resolve its surface:"
                              f" their normals miss those of a smooth surface by {percent(ratio)} of the angles"
                              f" between triangles, most at (x, y, z) = ({position}). Edges cross the triangles, or"
                              f" the points are noisy: a sheet that slides may stop there. Write the file with"
                              f" triangles along its edges, or as STEP, or use crease=0 for its flat triangles")


@register("start")
def coarse_fillets_of_files(body: Any) -> Iterator[Finding]:
    """Yield a finding for each tool with a concave fillet smaller than the triangles of the sheet; collective."""
    scene = body.scene
    if scene.kinematics.components != 3 or not scene.mesh.flat:
        return
    from scipy.spatial import cKDTree

    from .passed_tools import surface_points
    nodes, length = gathered(scene.mesh.comm, scene.mesh.domain.geometry.x), _median_edge(scene.mesh)
    for contact in scene.contacts:
        if not files_of(contact.tool):
            continue
        points = surface_points(contact.tool, length / 3, nodes, 0.0)
        i, j = cKDTree(points).query_pairs(length / 2, output_type="ndarray").T
        apart = points[j] - points[i]
        square = (apart**2).sum(1)
        kept = square > (length / 6) ** 2
        normal = contact.tool.distances(points).normal
        bend = ((normal[j] - normal[i])[kept] * apart[kept]).sum(1) / square[kept]     # concave: positive
        small = bend * length > 1
        if small.mean() > _FILLET_SHARE:
            place = points[i[kept][int(np.argmax(bend))]]
            radius, position = 1 / float(np.median(bend[small])), ", ".join(f"{v:.4g}" for v in place)
            yield Finding("warning", repr(contact), f"it has fillets of radius {radius:.3g}, as at (x, y, z) ="
                          f" ({position}), and half of the edges of the triangles are longer than {length:.4g}: the"
                          f" wall there will be too thick or too thin by tens of per cent. Use triangles of size"
                          f" {radius:.3g} or less, or adapt_mesh=True.")


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
            position = ", ".join(f"{v:.4g}" for v in corners[k].mean(0))
            yield Finding("warning", f"thickness of {name!r}", f"the thickness varies within the triangles: its mean at"
                          f" their corners misses that in their middle by {percent(share)} on average, most at (x, y,"
                          f" z) = ({position}). Use smaller triangles, or a smoother thickness")


def _median_edge(mesh: Any) -> float:
    """Return the median length of the edges of the triangles of a sheet; collective."""
    points, triangles = mesh.whole()
    corners = points[triangles]
    return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
