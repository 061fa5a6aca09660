"""Meshes of flat sheets in three dimensions, in the plane z = 0: triangles within an outline, by gmsh."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...errors import InputError, as_list, check_name, check_type, non_negative, pair, positive
from ...findings import coordinates
from ...mesh import with_gmsh
from ...mesh.check import crossing_point
from ...mesh.divisions import MAX_RECTANGLES
from ...mesh.grid import Grid, counter_clockwise
from .surface_mesh import SurfaceMesh, surface_mesh

_PARTS = ("whole", "half", "quarter")


class Edge(NamedTuple):
    """Straight piece or circular arc of the outline of a sheet.

    Attributes:
        start: start (x, y) of the piece, length.
        end: end (x, y) of the piece, length.
        centre: centre (x, y) of the arc, length, or None for a straight piece.
        name: name of the boundary to which the piece belongs.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float] | None
    name: str


def rectangle(width: float, height: float, *, corner: float = 0.0, part: str = "whole") -> list[Edge]:
    """Return the outline of a rectangle with rounded corners centred at (0, 0), for `sheet`.

    Args:
        width: width of the whole rectangle along x, length.
        height: height of the whole rectangle along y, length.
        corner: radius of the corners, length.
        part: modelled part: "whole"; "half" with x > 0; "quarter" with x > 0 and y > 0. The cuts are the boundaries
            "x0" (on x = 0) and "y0" (on y = 0), the rest is "rim".

    Returns:
        The pieces of the outline, counter-clockwise.

    Raises:
        InputError: a width or height that is not positive, a corner radius above half the shorter side, or an unknown
            part.

    >>> [edge.name for edge in fx.mesh.rectangle(200.0, 100.0, part="quarter")]
    ['rim', 'rim', 'x0', 'y0']
    """
    a, b = positive("rectangle: width", width) / 2, positive("rectangle: height", height) / 2
    r = non_negative("rectangle: corner", corner)
    check_name("rectangle: part", part, _PARTS)
    if r > min(a, b):
        raise InputError(f"rectangle: corner = {corner!r}: must be at most half the shorter side, {min(a, b):g}")
    found: list[Edge] = []
    last, names = (0.0, -b) if part == "half" else (a, 0.0), "rim"

    def add_piece(point: tuple[float, float], centre: tuple[float, float] | None = None, name: str = names) -> None:
        """Append a line, or an arc about `centre`, to a `point` that is not the last, to the boundary `name`."""
        nonlocal last
        if math.dist(last, point) > 1e-12 * (a + b):
            found.append(Edge(last, point, centre, name))
        last = point
    if part != "quarter":
        start = 0.0 if part == "half" else -a + r
        last = (start, -b)
        add_piece((a - r, -b))
        add_piece((a, -b + r), (a - r, -b + r))
    add_piece((a, b - r))
    add_piece((a - r, b), (a - r, b - r))
    if part == "whole":
        add_piece((-a + r, b))
        add_piece((-a, b - r), (-a + r, b - r))
        add_piece((-a, -b + r))
        add_piece((-a + r, -b), (-a + r, -b + r))
        return found
    add_piece((0.0, b))
    add_piece((0.0, 0.0 if part == "quarter" else -b), name="x0")
    if part == "quarter":
        add_piece((a, 0.0), name="y0")
    return found


def circle(radius: float, *, part: str = "whole") -> list[Edge]:
    """Return the outline of a circle centred at (0, 0), for `sheet`.

    Args:
        radius: radius of the circle, length.
        part: modelled part: "whole", "half" or "quarter", with the boundaries of `rectangle`.

    Returns:
        The pieces of the outline, counter-clockwise.

    >>> fx.mesh.circle(100.0, part="quarter")[0].name
    'rim'
    """
    return rectangle(2 * positive("circle: radius", radius), 2 * radius, corner=radius, part=part)


def sheet(outline: Sequence[Any], size: float | Callable[[Any, Any], Any], *, names: Sequence[str] | None = None,
          layers: Sequence[str] = ("sheet",), reflected: Sequence[str] = (),
          comm: MPI.Comm = MPI.COMM_WORLD) -> SurfaceMesh:
    """Mesh a flat sheet in the plane z = 0 with triangles within an outline, by gmsh.

    Args:
        outline: `rectangle(...)`, `circle(...)`, or the corners (x, y) of a polygon, length.
        size: edge length of the triangles: a length, or a function of (x, y) that returns lengths.
        names: name of the boundary of each piece of the outline; of a polygon, the first piece leads from the first
            corner to the second. Default: the names in the outline, "rim" for a polygon.
        layers: names of the layers; `Scene(thickness=...)` gives their thickness.
        reflected: names of straight boundaries at which the mesh and its mirror image are joined. The mesh of a quarter
            with ["y0"] becomes a symmetric mesh of the half.
        comm: MPI communicator.

    Returns:
        Mesh of the sheet.

    Raises:
        InputError: an outline that intersects itself, a size that is not positive, or more than 500,000 triangles. Also
            a reflected boundary that is not straight, or whose straight extension crosses or touches the sheet.

    >>> quarter = fx.mesh.rectangle(300, 200, corner=20, part="quarter")
    >>> print(fx.mesh.sheet(quarter, size=40))
    35 triangles, x from 0 to 150, y from 0 to 100
    layers: sheet
    boundaries: rim, x0, y0, bottom, top
    >>> print(fx.mesh.sheet(quarter, size=40, reflected=["y0"]))
    70 triangles, x from 0 to 150, y from -100 to 100
    layers: sheet
    boundaries: rim, x0, bottom, top
    """
    edges = outline_edges(outline, "sheet: outline")
    if names is not None:
        called = as_list("sheet: names", names, "words")
        if len(called) != len(edges):
            raise InputError(f"sheet: names: {len(called)} names for {len(edges)} edges: must be one for each")
        edges = [edge._replace(name=name) for edge, name in zip(edges, called)]
    for edge in edges:
        if check_type("sheet: names: name", edge.name, str, "a word") in ("bottom", "top", ""):
            raise InputError(f"sheet: names: name = {edge.name!r}: must be a word, not that of a face")
    x = chords(edges, "sheet: outline")
    edge_length = _Size(size)
    areas, sizes = edge_length.area_and_size(x)
    lines = as_list("sheet: reflected", reflected, "names")
    for k, name in enumerate(lines):
        check_name("sheet: reflected: boundary", name, {edge.name for edge in edges} - set(lines[:k]))
    if 2 ** len(lines) * np.sum(areas / (0.4 * sizes**2)) > 2 * MAX_RECTANGLES:
        raise InputError(f"sheet: size = {size!r}: would make more than {2 * MAX_RECTANGLES} triangles of the sheet,"
                         f" whose area is {areas.sum():.4g}")
    words = as_list("sheet: layers", layers, "names")
    return surface_mesh(lambda: reduce(_reflected, lines, _grid(edges, edge_length)), comm, "sheet", ("bottom", "top"),
                        words, of_size=lambda size: sheet(edges, size, layers=words, reflected=lines, comm=comm))


def outline_edges(outline: Any, caller: str) -> list[Edge]:
    """Return the pieces of an outline of pieces or of three corners (x, y) or more, length, else an InputError."""
    edges = as_list(caller, outline, "corners (x, y), or what fx.mesh.rectangle gives")
    if all(isinstance(edge, Edge) for edge in edges):
        return edges
    corners = [pair(f"{caller}: corner", point) for point in edges]
    if len(corners) < 3:
        raise InputError(f"{caller} = {outline!r}: must have at least three corners")
    return [Edge(a, b, None, "rim") for a, b in zip(corners, [*corners[1:], corners[0]])]


def chords(edges: list[Edge], caller: str) -> np.ndarray:
    """Return corners of an outline, arcs in 8 chords, (n, 2), length; two equal or a crossing are an InputError."""
    points = []
    for edge in edges:
        a, b = np.array(edge.start), np.array(edge.end)
        if not np.any(a != b):
            raise InputError(f"{caller}: the corner {coordinates(a, 6)} is there twice, one after the other")
        line = a + np.linspace(0, 1, 2 if edge.centre is None else 9)[:-1, None] * (b - a)
        if edge.centre is not None:
            away = line - edge.centre
            line = edge.centre + away * (math.dist(a, edge.centre) / np.linalg.norm(away, axis=1))[:, None]
        points.append(line)
    x = np.concatenate(points)
    if (place := crossing_point(x, np.column_stack([np.arange(len(x)), np.roll(np.arange(len(x)), -1)]))) is not None:
        raise InputError(f"{caller}: crosses or touches itself near {coordinates(place, 6)}")
    return x


class _Size:
    """Edge length of triangles, a number or a function of (x, y), for gmsh.

    gmsh ignores exceptions: the first is `refused`.
    """

    def __init__(self, size: Any):
        self._size = size
        self.constant = None if callable(size) else positive("sheet: size", size)
        self.refused: InputError | None = None

    def __call__(self, x: float, y: float) -> float:
        """Return the edge length of triangles at a point (x, y), length; raise an InputError unless it is positive."""
        where = f"sheet: size at {coordinates((x, y), 6)}"
        try:
            return positive(where, float(self._size(x, y)))
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"{where}: the function fails: {type(error).__name__}: {error}") from error

    def callback(self, dim: int, tag: int, x: float, y: float, z: float, size: float) -> float:
        """Return the edge length at (x, y) for gmsh, 1e22 where the user's function fails; the rest is not used."""
        try:
            return self(x, y)
        except InputError as error:
            self.refused = self.refused or error
            return 1e22

    def area_and_size(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Divide a polygon (n, 2) into m equal areas, 1 for constant size; return areas and edge lengths, (m,) each."""
        y = np.roll(x, -1, axis=0)
        area = abs(np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])) / 2
        if self.constant:
            return np.array([area]), np.array([self.constant])
        low, high = x.min(0), x.max(0)
        p = np.stack(np.meshgrid(*(a + (b - a) * (np.arange(40) + 0.5) / 40 for a, b in zip(low, high))), -1)
        p = p.reshape(-1, 1, 2)
        above = (x[:, 1] > p[..., 1]) != (y[:, 1] > p[..., 1])              # edges that a line along x crosses
        slope = np.divide(y[:, 0] - x[:, 0], y[:, 1] - x[:, 1], out=np.zeros(len(x)), where=y[:, 1] != x[:, 1])
        inside = np.sum(above & (p[..., 0] < x[:, 0] + (p[..., 1] - x[:, 1]) * slope), axis=1) % 2 == 1
        places = [*p[inside, 0], *x]
        return np.full(len(places), area / len(places)), np.array([self(*place) for place in np.array(places).tolist()])


def _grid(edges: list[Edge], size: _Size) -> Grid:
    """Mesh the inside of an outline with triangles of a given edge length, by gmsh on one rank."""
    options = {"General.NumThreads": 1.0, "Mesh.MeshSizeExtendFromBoundary": 0.0}
    if size.constant:
        options |= {"Mesh.MeshSizeMin": size.constant, "Mesh.MeshSizeMax": size.constant}
    with with_gmsh.model("sheet", options) as gmsh:
        geo, points = gmsh.model.geo, {}
        span = max(abs(v) for e in edges for v in e.start)

        def point(position: tuple[float, float]) -> int:
            """Return gmsh's number of the point at (x, y); equal points have one number."""
            key = tuple(np.round(np.array(position) / span, 12))
            if key not in points:
                points[key] = geo.addPoint(*position, 0.0)
            return points[key]
        tags = [geo.addLine(point(e.start), point(e.end)) if e.centre is None
                else geo.addCircleArc(point(e.start), point(e.centre), point(e.end)) for e in edges]
        geo.addPlaneSurface([geo.addCurveLoop(tags)])
        geo.synchronize()
        for name in dict.fromkeys(e.name for e in edges):
            group = gmsh.model.addPhysicalGroup(1, [t for t, e in zip(tags, edges) if e.name == name])
            gmsh.model.setPhysicalName(1, group, name)
        if not size.constant:
            gmsh.model.mesh.setSizeCallback(size.callback)
        try:
            gmsh.model.mesh.generate(2)
        except Exception as error:
            raise size.refused or InputError(f"sheet: gmsh makes no mesh of this outline: {error}") from None
        if size.refused:
            raise size.refused
        numbers, X, _ = gmsh.model.mesh.getNodes()
        row = np.zeros(int(numbers.max()) + 1, dtype=np.int64)
        row[numbers.astype(np.int64)] = np.arange(len(numbers))
        X = X.reshape(-1, 3)
        cells = row[gmsh.model.mesh.getElementsByType(2)[1].astype(np.int64)].reshape(-1, 3)
        boundaries = {}
        for dim, group in gmsh.model.getPhysicalGroups(1):
            rows = [gmsh.model.mesh.getElementsByType(1, tag)[1] for tag in
                    gmsh.model.getEntitiesForPhysicalGroup(dim, group)]
            boundaries[gmsh.model.getPhysicalName(dim, group)] = row[
                np.concatenate(rows).astype(np.int64)].reshape(-1, 2)
        if not len(cells):
            raise InputError("sheet: the outline holds no triangle: must be closed, and not cross itself")
        return Grid(X, np.arange(1, len(X) + 1), {"sheet": counter_clockwise(X[:, :2], cells)}, boundaries)


def _reflected(grid: Grid, name: str) -> Grid:
    """Return a sheet joined with its mirror image about a straight boundary that it does not cross, else InputError."""
    X, (sheet,) = grid.points, grid.layers.values()
    line = np.unique(grid.boundaries[name])
    middle, size = X[line].mean(0), 1e-9 * float(np.ptp(X, axis=0).max())
    way = X[line][np.argmax(np.linalg.norm(X[line] - middle, axis=1))] - middle
    normal = np.array([-way[1], way[0], 0.0]) / np.linalg.norm(way)
    d = (X - middle) @ normal
    if np.abs(d[line]).max() > size:
        raise InputError(f"sheet: reflected: boundary {name!r} is not straight: must be one line")
    if d.min() < -size < size < d.max() or np.count_nonzero(np.abs(d) < size) > len(line):
        raise InputError(f"sheet: reflected: boundary {name!r}: the sheet meets its line at other places too: must meet"
                         f" it at this boundary alone")
    outside = np.setdiff1d(np.arange(len(X)), line)
    image = np.arange(len(X))
    image[outside] = len(X) + np.arange(len(outside))
    points = np.vstack([X, X[outside] - 2 * d[outside, None] * normal])
    cells = counter_clockwise(points[:, :2], np.vstack([sheet, image[sheet]]))
    boundaries = {other: np.vstack([ends, image[ends]]) for other, ends in grid.boundaries.items() if other != name}
    return Grid(points, np.arange(1, len(points) + 1), {"sheet": cells}, boundaries)
