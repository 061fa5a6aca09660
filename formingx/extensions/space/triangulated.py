"""Rigid tools in three dimensions from STL and STEP files: closed smooth surfaces through triangles."""

from __future__ import annotations

import os
from functools import cached_property

import numpy as np

from ...errors import InputError, check_type, direction, file_path, finite, positive
from ...io.stl import volume
from .bodies import separate_bodies
from .corner_normals import corner_normals, misfit
from .patches import PatchSurface, area_vectors
from .solid_tool import SolidTool, nearest_of
from .step_reader import read_step
from .stl_reader import check_closed, check_simple, read_stl

CREASE = 40.0
"""Angle between triangles from which on their edge is sharp, degrees, without a `crease`."""

_STEP_ENDINGS = (".step", ".stp")


class Triangulated(SolidTool):
    """Rigid tool bounded by a closed surface through triangles, whose normals point out of the tool.

    The surface is smooth: a curved patch on each triangle, with common tangent planes of neighbours
    (`formingx.extensions.space.patches`), except at sharp edges.

    Args:
        points: vertices, shape (n, 3), length.
        triangles: vertex numbers, shape (m, 3), counter-clockwise seen from outside.
        name: name of the file from which the surface was read.
        normals: unit normals at the corners of the triangles, out of the tool, shape (m, 3, 3); None: they are fitted
            to the triangles.
        crease: angle between triangles from which on their edge is sharp, degrees. 0: the surface is the flat
            triangles.

    Attributes:
        name: name of the file from which the surface was read.
        triangles: number of triangles.
        volume: volume inside the flat triangles, length^3. If the surface consists of several bodies that overlap, the
            common volume counts twice.
        middle: mean of the vertices, shape (3,), length.
        crease: angle between triangles from which on their edge is sharp, degrees.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, name: str, normals: np.ndarray | None = None,
                 crease: float = CREASE):
        self._points, self._triangles, self.name, self.crease = points, triangles, name, crease
        self._bodies = separate_bodies(points, triangles, f"solid: {name!r}")
        for rows in self._bodies:
            check_simple(points, triangles[rows], f"solid: {name!r}")
        self._exact_normals = normals is not None and crease > 0
        if normals is None or crease == 0:
            normals = corner_normals(points, triangles, crease)
        self._normals = normals
        self.surfaces = [PatchSurface(points, triangles[rows], normals[rows]) for rows in self._bodies]
        self.triangles, self.volume = len(triangles), round(volume(points, triangles), 12)
        self.middle = points.mean(0)

    def _distance(self, x):
        """Return the signed distances from the unmoved tool, positive inside, shape (n,), length."""
        return np.max([surface.distance(x) for surface in self.surfaces], axis=0, initial=-np.inf)

    def _distances(self, x):
        """Return distances, normals and Hessians at positions x relative to the unmoved tool, shape (n, 3), length."""
        return nearest_of([surface.distances(x) for surface in self.surfaces])

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
        way, normal = direction("undercuts: along", along), area_vectors(self._points, self._triangles)
        area, middle = np.linalg.norm(normal, axis=1) / 2, self._points[self._triangles].mean(1)
        hull = ConvexHull(self._points).equations
        depth = -(middle @ hull[:, :3].T + hull[:, 3]).max(1)
        near = 1e-6 * np.ptp(self._points, axis=0).max()
        inner = (depth > near) & ~self._covered(middle + near * normal / (2 * area[:, None]))
        draft = np.degrees(np.arcsin(np.clip(normal @ way / (2 * area), -1, 1)))
        under = inner & (draft < -0.01)
        return {"undercut_area": float(area[under].sum()),
                "min_draft": float(draft[inner & ~under].min(initial=90.0))}

    @cached_property
    def roughness(self) -> tuple[float, np.ndarray]:
        """Misfit of the normals of an STL file, over the angles between triangles, and the place of the largest one.

        The misfit is that of the equation of smooth edges (`formingx.extensions.space.corner_normals`), as a root mean
        square over their area. It is 0 for flat triangles and for exact normals.
        """
        if self._exact_normals or self.crease == 0:
            return 0.0, self.middle
        ratio, place = misfit(self._points, self._triangles, self._normals)
        return ratio, place + self.shift

    def _covered(self, middle: np.ndarray) -> np.ndarray:
        """Return the mask (m,) of triangles inside another body; middle: points just outside each, (m, 3), length."""
        found = np.zeros(self.triangles, dtype=bool)
        for k, rows in enumerate(self._bodies):
            for other in (*self.surfaces[:k], *self.surfaces[k + 1:]):
                found[rows] |= other.distance(middle[rows]) > 0
        return found

    def __repr__(self) -> str:
        return f"solid({self.name!r})"


def solid(file: str | os.PathLike, *, scale: float = 1.0, inverted: bool = False, crease: float = CREASE,
          size: float | None = None, angle: float = 15.0) -> Triangulated:
    """Read a rigid tool with a smooth surface from an STL file, binary or text, or from a STEP file.

    The surface passes through the vertices of the triangles, and is smooth except at sharp edges. An STL file has one
    or more closed surfaces of triangles, whose normals are fitted. A STEP file has one or more solids. gmsh makes
    triangles on them, with exact normals, and converts their lengths to mm.

    Args:
        file: path of the file; a name that ends in .step or .stp is that of a STEP file.
        scale: unit of length of the file over the unit of the scene: 25.4 for an STL file in inches and a sheet in mm,
            0.1 for a STEP file and a sheet in cm.
        inverted: True if the triangles of an STL file look inward.
        crease: angle between triangles from which on their edge is sharp, degrees. 0: the surface is the flat
            triangles. With a STEP file edges are sharp where they are drawn so, for every crease above 0.
        size: largest edge length of the triangles on a STEP file, in the unit of the scene; None: a quarter of the
            largest extent. Curved surfaces have smaller triangles.
        angle: largest angle that a curved surface of a STEP file turns within one triangle, degrees.

    Returns:
        The tool.

    Raises:
        InputError: the file cannot be read, its surface is open or passes through itself (the message says where), or
            its triangles look inward.

    >>> cup = fx.tools.revolved(fx.tools.cup(radius=30.0, depth=20.0, draft=5.0).mirrored())
    >>> cup.to_stl("mould.stl", wall=5.0)
    >>> mould = fx.tools.solid("mould.stl")
    >>> mould.triangles, round(mould.undercuts()["min_draft"], 1)
    (768, 5.0)
    """
    name, scale = os.fspath(file_path("solid: file", file)), positive("solid: scale", scale)
    crease = finite("solid: crease", crease)
    if not 0 <= crease < 90:
        raise InputError(f"solid: crease = {crease!r}: must be an angle from 0 to less than 90 degrees")
    normals = None
    if name.lower().endswith(_STEP_ENDINGS):
        if not 0 < finite("solid: angle", angle) <= 45:
            raise InputError(f"solid: angle = {angle!r}: must be above 0 and at most 45 degrees")
        points, triangles, normals = read_step(name, None if size is None else positive("solid: size", size) / scale,
                                               angle)
    else:
        points, triangles = read_stl(name)
    check_closed(points, triangles, f"solid: {name!r}")
    if check_type("solid: inverted", inverted, bool, "True or False"):
        triangles, normals = triangles[:, ::-1], None
    if volume(points, triangles) <= 0:
        raise InputError(f"solid: {name!r} is inside out: its triangles look inward: use inverted={not inverted}")
    return Triangulated(scale * points, triangles, os.path.basename(name), normals, crease)
