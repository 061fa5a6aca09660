"""Rigid tools in three dimensions from STL files: closed surfaces of triangles."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ...errors import InputError, check_type, direction, file_path, positive
from ...io.stl import volume
from ...mesh.edges import edges_of
from .bodies import merged, separate_bodies
from .solid_tool import SolidTool


class Triangulated(SolidTool):
    """Rigid tool bounded by a closed surface of triangles, whose normals point out of the tool.

    VTK computes the exact distance to the triangles. The normal at the nearest point gives the sign.

    Args:
        points: vertices, shape (n, 3), length.
        triangles: vertex numbers, shape (m, 3).
        name: name of the file from which the surface was read.

    Attributes:
        name: name of the file from which the surface was read.
        triangles: number of triangles.
        volume: volume inside the surface, length^3. If it consists of several bodies that overlap, the common volume
            counts twice.
        middle: mean of the vertices, shape (3,), length.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, name: str):
        self._points, self._triangles, self.name = points, triangles, name
        self._groups = separate_bodies(points, triangles, f"solid: {name!r}")
        self._implicit: list[Any] = []
        self.triangles, self.volume = len(triangles), round(volume(points, triangles), 12)
        self.middle = points.mean(0)

    def _distance(self, x):
        """Return the signed distances of points from the unmoved tool, positive inside the tool, shape (n,), length.

        x: positions, shape (n, 3), length.
        """
        from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkDoubleArray
        if not self._implicit:
            self._implicit = [_implicit(self._points, group) for group in self._groups]
        if not len(x):
            return np.zeros(0)
        given, found = numpy_to_vtk(np.ascontiguousarray(x), deep=True), np.full(len(x), -np.inf)
        for implicit in self._implicit:
            out = vtkDoubleArray()
            implicit.FunctionValue(given, out)
            np.maximum(found, -vtk_to_numpy(out), out=found)
        return found

    def _surface(self):
        """Return vertices, shape (n, 3), length, and vertex numbers of triangles, shape (m, 3), of the unmoved tool."""
        return self._points, self._triangles

    def undercuts(self, along: tuple[float, float, float] = (0, 0, 1)) -> dict[str, float]:
        """Compute the undercut area and the smallest draft of a mould for a direction of demoulding.

        Only the triangles of the cavity count, which lie inside the convex hull of the tool. Triangles inside another
        body of the tool do not count.

        Args:
            along: direction in which the part leaves the mould, shape (3,), of any length.

        Returns:
            {"undercut_area": area of the triangles whose outward normal points against the direction, length^2,
            "min_draft": smallest angle between the direction and the plane of a triangle that is no undercut, degrees;
            90 if there is none}.
        """
        from scipy.spatial import ConvexHull
        way = direction("undercuts: along", along)
        corners = self._points[self._triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normal, axis=1) / 2
        hull = ConvexHull(self._points).equations
        depth = -(corners.mean(1) @ hull[:, :3].T + hull[:, 3]).max(1)
        near = 1e-6 * np.ptp(self._points, axis=0).max()
        inner = (depth > near) & (self._distance(corners.mean(1) + near * normal / (2 * area[:, None])) <= 0)
        draft = np.degrees(np.arcsin(np.clip(normal @ way / (2 * area), -1, 1)))
        under = inner & (draft < -0.01)
        return {"undercut_area": float(area[under].sum()),
                "min_draft": float(draft[inner & ~under].min(initial=90.0))}

    def __repr__(self) -> str:
        return f"solid({self.name!r})"


def solid(file: str | os.PathLike, *, scale: float = 1.0, inverted: bool = False) -> Triangulated:
    """Read a rigid tool from an STL file, binary or text, with one or more closed surfaces of triangles.

    Args:
        file: path of the STL file.
        scale: unit of length of the file over the unit of the scene: 25.4 for a file in inches and a sheet in mm.
        inverted: True if the triangles of the file look inward.

    Returns:
        The tool.

    Raises:
        InputError: the file cannot be read, its surface is open (the message says where), or its triangles look inward.

    >>> cup = fx.tools.revolved(fx.tools.cup(radius=30.0, depth=20.0, draft=5.0).mirrored())
    >>> cup.to_stl("mould.stl", wall=5.0)
    >>> mould = fx.tools.solid("mould.stl")
    >>> mould.triangles, round(mould.undercuts()["min_draft"], 1)
    (768, 5.0)
    """
    name = os.fspath(file_path("solid: file", file))
    points, triangles = merged(*_read(name))
    points = points * positive("solid: scale", scale)
    _check_closed(points, triangles, f"solid: {name!r}")
    if check_type("solid: inverted", inverted, bool, "True or False"):
        triangles = triangles[:, ::-1]
    if volume(points, triangles) <= 0:
        raise InputError(f"solid: {name!r} is inside out: its triangles look inward: use inverted={not inverted}")
    return Triangulated(points, triangles, os.path.basename(name))


def _read(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the m triangles of an STL file, shape (3 m, 3), and their corner numbers, shape (m, 3).

    name: path of the file.

    Raises:
        InputError: the file cannot be read, or is no STL file of a solid.
    """
    try:
        with open(name, "rb") as stream:
            data = stream.read()
    except OSError as error:
        raise InputError(f"solid: {name!r} cannot be read: {error}") from None
    n = int(np.frombuffer(data[80:84], "<u4")[0]) if len(data) >= 84 else -1
    if len(data) == 84 + 50 * n:
        rows = np.frombuffer(data[84:], dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
        points = rows["corners"].astype(float).reshape(-1, 3)
    else:
        words = data.split()
        at = [k for k, word in enumerate(words) if word.lower() == b"vertex"]
        try:
            points = np.array([[float(w) for w in words[k + 1:k + 4]] for k in at]).reshape(-1, 3)
        except ValueError:
            raise InputError(f"solid: {name!r} is no STL file: a vertex is not three numbers") from None
    if len(points) < 12 or len(points) % 3 or not np.isfinite(points).all():
        raise InputError(f"solid: {name!r} is no STL file of a solid: it has {len(points)} corners of triangles, which"
                         f" must be finite and at least 12")
    return points, np.arange(len(points)).reshape(-1, 3)


def _check_closed(points: np.ndarray, triangles: np.ndarray, caller: str) -> None:
    """Raise an InputError unless the triangles of a surface are closed and oriented alike.

    Each edge must belong to as many triangles in one direction as in the other.

    Args:
        points: vertices, shape (n, 3), length.
        triangles: vertex numbers, shape (m, 3).
        caller: name of the caller, for messages.
    """
    directed, edges, numbers, times = edges_of(triangles)
    sense = np.zeros(len(edges))
    np.add.at(sense, numbers, np.where(directed[:, 0] < directed[:, 1], 1.0, -1.0))
    for bad, words in ((times == 1, "is open: {n} edges have a triangle on one side only, one at {at}: close the holes"
                                    " where it was drawn"),
                       (times % 2 == 1, "has {n} edges with an odd number of triangles, one at {at}: it crosses itself,"
                                        " or holds a sheet without thickness"),
                       (sense != 0, "has triangles that look the other way than their neighbours, at {n} edges, one at"
                                    " {at}: let the program that wrote it unify its normals")):
        if bad.any():
            x = points[edges[np.argmax(bad)]].mean(0)
            at = "(" + ", ".join(f"{v:.6g}" for v in x) + ")"
            raise InputError(f"{caller} {words.format(n=int(bad.sum()), at=at)}")


def _implicit(points: np.ndarray, triangles: np.ndarray) -> Any:
    """Return VTK's function of the signed distance from a surface of triangles, negative inside.

    Args:
        points: vertices, shape (n, 3), length.
        triangles: vertex numbers, shape (m, 3).
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance
    where, cells, surface, found = vtkPoints(), vtkCellArray(), vtkPolyData(), vtkImplicitPolyDataDistance()
    where.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    rows = np.column_stack([np.full(len(triangles), 3), triangles]).astype(np.int64).ravel()
    cells.SetCells(len(triangles), numpy_to_vtkIdTypeArray(rows, deep=True))
    surface.SetPoints(where)
    surface.SetPolys(cells)
    found.SetInput(surface)
    return found
