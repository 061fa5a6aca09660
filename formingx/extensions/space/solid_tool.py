"""Rigid tools in three dimensions: profiles swept about an axis, along a line or round a box, and closed surfaces of
triangles.

Distances to swept profiles are exact where the profile's are, off the edges at which a profile ends.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ...errors import InputError, as_points, direction, instance, known, non_negative, pair, place, positive, triple
from ...io.stl import volume, write_stl
from ...physics.contact import Contact
from ...physics.contact_law import ContactLaw
from ...tools.profile import Tool
from .bodies import apart
from .lagged_friction import LaggedFriction, Near
from .lagged_stick import LaggedStick

_ON_AXIS = 1e-9             # distance from the axis, over the size of a profile, that counts as 0
_PER_CORNER = 24           # straight pieces of a rounded corner in `surface`


class SolidTool:
    """Rigid tool in three dimensions: `signed_distance` (positive inside), `bounds`, `surface`, `moved` (by `shift`).
    """

    components = 3
    sized = True
    """False for a plane, whose drawing has no size."""
    shift: tuple[float, ...] = (0.0, 0.0, 0.0)

    def signed_distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distance of points from the surface, positive inside the tool.

        Returns:
            Distances, shape (n,), length.
        """
        return self._distance(as_points("signed_distance: x", x, 3) - self.shift)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest coordinates of the triangles of `surface`, shape (2, 3), length."""
        points = self.surface()[0]
        return np.array([points.min(0), points.max(0)])

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the surface as triangles, for drawing.

        Returns:
            Points, shape (n, 3), length, and triangles, shape (m, 3).
        """
        points, triangles = self._surface()
        return points + self.shift, triangles

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
        """Return the tool displaced by (x, y, z), length.

        Returns:
            The tool.
        """
        import copy
        found = copy.copy(self)
        found.shift = tuple(a + b for a, b in zip(self.shift, triple("moved", (x, y, z))))
        return found

    def contact_law(self, contact: Contact, k: np.ndarray | float, thickness: float) -> ContactLaw:
        """Return the contact law of a sheet on this tool.

        Args:
            contact: its friction and regularisation.
            k: penalty, stress/length, shape () or (n,).
            thickness: of the sheet, length.

        Returns:
            The law.
        """
        theta = contact.ramp * thickness
        if contact.sticks:
            return LaggedStick(self, k, theta, contact.separates)
        return LaggedFriction(self, contact.mu, k, theta, contact.elastic_slip * thickness)

    def _distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distance of points x from the tool in its initial position, shape (n,), length."""
        raise NotImplementedError

    def _surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points and triangles of the unmoved tool."""
        raise NotImplementedError


class Swept(SolidTool):
    """A profile (r, z) swept along a curve in the plane of x and y, to which r is a distance.

    Args:
        profile: the solid to its left; kind: "revolved" (r from the axis x = y = 0), "extruded" (r = x, or y: `along`)
            or "box" (r from the middle line of a rounded rectangle of half widths `half`, across, the corners' radius
            at the widest `corner`).
    """

    def __init__(self, profile: Tool, kind: str, half: tuple[float, float] = (0.0, 0.0), corner: float = 0.0,
                 along: str = "y"):
        self.profile, self.kind, self.half, self.corner, self.along = profile, kind, half, corner, along
        self.sized = len(profile.pieces) > 1

    def near(self, x: np.ndarray) -> Near:
        """Return the distance of positions x, shape (n, 3), with its first and second derivatives, exactly.

        Returns:
            The geometry relative to the tool.

        >>> found = fx.tools.revolved(fx.tools.sphere(radius=10.0, z=-10.0)).near([[0.0, 0.0, -8.0]])
        >>> found.distance.tolist(), found.normal.tolist()
        ([2.0], [[0.0, 0.0, 1.0]])
        """
        x = as_points("near: x", x, 3) - self.shift
        r, way, bend = self._across(x)
        found = self.profile.nearest(np.column_stack([r, x[:, 2]]))
        normal, tangent = (v[:, :1] * way + v[:, 1:] * [0.0, 0.0, 1.0] for v in (found.normal, found.tangent))
        hessian = found.curvature[:, None, None] * tangent[:, :, None] * tangent[:, None]
        across = np.column_stack([-way[:, 1], way[:, 0], np.zeros(len(x))])         # where the curve of `r` bends
        turn = found.normal[:, 0] * bend
        if self.kind == "revolved":                          # on the axis both curvatures are one
            turn = np.where(r > _ON_AXIS * self._size, turn, found.curvature)
        return Near(found.distance, normal, hessian + turn[:, None, None] * across[:, :, None] * across[:, None])

    def _distance(self, x):
        """Return the signed distance of points x from the tool in its initial position, shape (n,), length."""
        return self.profile.signed_distance(np.column_stack([self._across(x)[0], x[:, 2]]))

    def _across(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return r of points, its gradient, shape (n, 3), and the curvature of the curve of constant r, shape (n,)."""
        way = np.zeros((len(x), 3))
        if self.kind == "extruded":
            axis = "yx".index(self.along)
            way[:, axis] = 1.0
            return x[:, axis], way, np.zeros(len(x))
        half = np.array(self.half) - self.corner if self.kind == "box" else np.zeros(2)
        sign, u = np.where(x[:, :2] < 0, -1.0, 1.0), np.abs(x[:, :2]) - half
        least = min(self.half) - self.corner if self.kind == "box" else 0.0
        outside = np.hypot(*np.maximum(u, 0.0).T)
        flat = (u.min(1) < 0) | (outside == 0)
        way[:, :2] = sign * np.maximum(u, 0.0) / np.maximum(outside, 1e-300)[:, None]
        way[flat, :2] = (sign * (np.arange(2) == u.argmax(1)[:, None]))[flat]
        bend = np.where(flat, 0.0, 1 / np.maximum(outside, 1e-300))
        return least + outside + np.minimum(u.max(1), 0.0), way, bend

    @property
    def _size(self) -> float:
        """Size of the profile, length."""
        return float(np.ptp(self.profile.bounds, axis=0).max()) if self.sized else 1.0

    def _surface(self):
        """Return points and triangles of the unmoved tool."""
        return self._swept(self.profile.outline())

    def to_stl(self, file: Any, wall: float) -> None:
        """Write the tool as a closed solid, binary STL: a mould with a wall below its lowest point.

        An extruded tool cannot be written.

        Args:
            file: path of the file.
            wall: thickness of the mould below its lowest point, length.

        Raises:
            InputError: the profile is not open, from r > 0 to r = 0.
        """
        outline, wall = self.profile.outline(), positive("to_stl: wall", wall)
        if self.kind == "extruded" or outline[-1, 0] != 0 or outline[0, 0] <= 0:
            raise InputError(f"to_stl: {self!r}: must be a mould revolved or round a box, its profile to end at r = 0")
        low = outline[:, 1].min() - wall
        (top, upper), (back, lower) = (self._swept(np.array(line)) for line in (
            outline, [[0.0, low], [outline[0, 0], low], outline[0]]))
        points, triangles = merged(np.vstack([top, back]), np.vstack([upper, lower + len(top)]))
        write_stl(points + self.shift, triangles if volume(points, triangles) > 0 else triangles[:, ::-1], file)

    def _swept(self, outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the surface over points (r, z) of a profile."""
        rings = np.array([np.insert(self._ring(r), 2, z, axis=1) for r, z in outline])
        m, n = rings.shape[:2]
        row = np.arange(m * n).reshape(m, n)
        a, b, c, d = row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]
        return rings.reshape(-1, 3), np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], -2).reshape(-1, 3)

    def _ring(self, r: float) -> np.ndarray:
        """Return the curve at r, shape (n, 2)."""
        turn = np.linspace(0, np.pi / 2, _PER_CORNER + 1)
        if self.kind == "extruded":
            ends = np.array([-1.0, 1.0]) * np.ptp(self.profile.bounds, axis=0).max() / 2
            line = np.column_stack([np.full(2, r), ends])
            return line if self.along == "y" else line[:, ::-1]
        offset = r - (min(self.half) if self.kind == "box" else 0.0)
        radius = max(self.corner + offset, 0.0)
        middle = np.array(self.half) + (offset if self.kind == "box" else 0.0) - radius
        middle = middle if self.kind == "box" else np.zeros(2)
        found = [np.column_stack([sx * middle[0] + radius * np.cos(turn + q),
                                  sy * middle[1] + radius * np.sin(turn + q)])
                 for sx, sy, q in ((1, 1, 0), (-1, 1, np.pi / 2), (-1, -1, np.pi), (1, -1, 1.5 * np.pi))]
        ring = np.concatenate(found)
        return np.vstack([ring, ring[:1]])

    def __repr__(self) -> str:
        options = f", half={self.half}, corner={self.corner:g}" if self.kind == "box" else ""
        return f"{self.kind}({self.profile!r}{options})"


class Triangulated(SolidTool):
    """Closed surface of triangles that look outward; the distance is VTK's exact one, its sign from the normals.

    Args:
        points: vertices, shape (n, 3), length.
        triangles: vertex numbers, shape (m, 3).
        name: name of its file.

    Attributes:
        name: name of its file.
        triangles: number of triangles.
        volume: volume of its bodies, length^3; a volume that two bodies share counts twice.
        middle: mean of its points, shape (3,), length.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, name: str):
        self._points, self._triangles, self.name = points, triangles, name
        self._groups = apart(points, triangles, f"solid: {name!r}")
        self._implicit: list[Any] = []
        self.triangles, self.volume = len(triangles), round(volume(points, triangles), 12)
        self.middle = points.mean(0)

    def _distance(self, x):
        """Return the signed distance of points x from the tool in its initial position, shape (n,), length."""
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
        """Return points and triangles of the unmoved tool."""
        return self._points, self._triangles

    def undercuts(self, along: tuple[float, float, float] = (0, 0, 1)) -> dict[str, float]:
        """Compute undercuts and draft of a mould along a direction.

        Faces that look into the hull of the tool, and lie in no other of its bodies, are examined.

        Args:
            along: the direction, shape (3,).

        Returns:
            {"undercut_area": area of faces that look against the direction, length^2, "least_draft": smallest angle of
            the others to it, degrees (90 for a floor)}.
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
                "least_draft": float(draft[inner & ~under].min(initial=90.0))}

    def __repr__(self) -> str:
        return f"solid({self.name!r})"


def revolved(profile: Tool) -> Swept:
    """Return the tool of revolution of a profile about the axis x = y = 0.

    Returns:
        The tool.

    >>> ball = fx.tools.revolved(fx.tools.sphere(radius=10.0, z=0.0))
    >>> ball.bounds.round(6).tolist()
    [[-10.0, -10.0, 0.0], [10.0, 10.0, 20.0]]
    """
    return Swept(instance("revolved: profile", profile, Tool, "a Tool"), "revolved")


def extruded(profile: Tool, along: str = "y") -> Swept:
    """Return the tool of a profile (r, z) extruded along y, with r = x, or along x, with r = y.

    Returns:
        The tool.

    >>> fx.tools.extruded(fx.tools.sphere(radius=10.0)).signed_distance([[0.0, 55.0, -1.0]]).tolist()
    [-1.0]
    """
    known("extruded: along =", along, ("x", "y"))
    return Swept(instance("extruded: profile", profile, Tool, "a Tool"), "extruded", along=along)


def box(*, half: tuple[float, float], depth: float, corner: float = 0.0, fillet: float = 0.0, lip: float = 0.0,
        draft: float = 0.0, mouth: float = 0.0, plug: bool = False) -> Swept:
    """Return a box-shaped mould with rounded corners, open upwards, centred at x = y = 0; or the plug that fits it.

    Args:
        half: half widths along x and y at the mouth (for a plug: at its upper end), length.
        depth: depth from the mouth to the floor, length.
        corner: radius in plan at the mouth, length; with draft the radius at the floor is smaller, and must not be
            below `fillet`.
        fillet: radius between wall and floor, length.
        lip: radius between wall and flange, length; not for a plug.
        draft: angle between wall and z axis, degrees.
        mouth: z of the mouth, length.
        plug: True for the plug, which extends upwards.

    Returns:
        The tool.

    Raises:
        InputError: sizes that do not fit each other.

    >>> tray = fx.tools.box(half=(60.0, 40.0), depth=20.0, corner=15.0, fillet=5.0)
    >>> tray.signed_distance([[0.0, 0.0, -18.0]]).tolist()
    [-2.0]
    """
    a, b = (positive("box: half", value) for value in pair("box: half", half))
    depth, corner, fillet = positive("box: depth", depth), non_negative("box: corner", corner), non_negative(
        "box: fillet", fillet)
    if corner > min(a, b):
        raise InputError(f"box: corner = {corner!r}: must be at most the smaller half width, {min(a, b):g}")
    r = min(a, b)
    floor = r - depth * np.tan(np.radians(non_negative("box: draft", draft)))
    if floor <= fillet:
        raise InputError(f"box: draft = {draft!r} degrees and fillet = {fillet!r}: leave no floor at depth {depth:g}")
    points = [(3 * r + lip, mouth), (r, mouth), (floor, mouth - depth), (0.0, mouth - depth)]
    if plug:
        return Swept(Tool([*points[:1:-1], (r, mouth), (r, mouth + depth)], [0.0, fillet, 0.0, 0.0]), "box", (a, b),
                     corner)
    return Swept(Tool(points, [0.0, non_negative("box: lip", lip), fillet, 0.0]), "box", (a, b), corner)


def solid(file: str | os.PathLike, *, scale: float = 1.0, inverted: bool = False) -> Triangulated:
    """Return a tool from an STL file, binary or text, with one or more closed surfaces.

    Args:
        file: path of the file.
        scale: file's unit of length over the sheet's: 25.4 for a file in inches and a sheet in mm.
        inverted: True if the triangles look inward.

    Returns:
        The tool.

    Raises:
        InputError: the file cannot be read, or is no closed surface whose triangles look outward; the message says
            where it is open.

    >>> cup = fx.tools.revolved(fx.tools.cup(radius=30.0, depth=20.0, draft=5.0).mirrored())
    >>> cup.to_stl("mould.stl", wall=5.0)
    >>> mould = fx.tools.solid("mould.stl")
    >>> mould.triangles, round(mould.undercuts()["least_draft"], 1)
    (768, 5.0)
    """
    name = os.fspath(place("solid: file", file))
    points, triangles = merged(*_read(name))
    points = points * positive("solid: scale", scale)
    _check_closed(points, triangles, f"solid: {name!r}")
    if instance("solid: inverted", inverted, bool, "True or False"):
        triangles = triangles[:, ::-1]
    if volume(points, triangles) <= 0:
        raise InputError(f"solid: {name!r} is inside out: its triangles look inward: use inverted={not inverted}")
    return Triangulated(points, triangles, os.path.basename(name))


def merged(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge coincident vertices (to 1e-7 of the extent) and drop the triangles that become degenerate.

    Returns:
        Points and triangles.
    """
    size = max(float(np.ptp(points, axis=0).max(initial=0.0)), 1e-300)
    _, first, same = np.unique(np.round(points / size, 7), axis=0, return_index=True, return_inverse=True)
    triangles = same.ravel()[triangles]
    a, b, c = triangles.T
    return points[first], triangles[(a != b) & (b != c) & (c != a)]


def _read(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return points and triangles of an STL file."""
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
    """Raise an InputError unless each edge belongs to two triangles with opposite directions."""
    ends = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    edges, which, times = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    sense = np.zeros(len(edges))
    np.add.at(sense, which.ravel(), np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0))
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
    """Return VTK's distance from the surface, negative inside."""
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
