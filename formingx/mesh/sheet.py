"""Flat sheets in space, z = 0: triangles within an outline, by gmsh."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ..errors import InputError, instance, known, non_negative, pair, positive, several
from . import with_gmsh
from .grid import Grid, counter_clockwise, to_mesh
from .mesh import Mesh

_MOST = 500_000            # triangles
_PARTS = ("whole", "half", "quarter")


@dataclass(frozen=True)
class Sheet(Mesh):
    """A sheet in space: plane triangles at rest, coordinates (x, y, z). Its layers are all over it.

    Beside the boundaries that its outline names there are its faces, "bottom" and "top" (towards +z): as a boundary
    each has all edges. A membrane has one surface only; on which face a pressure acts says which way it pushes.

    Attributes:
        of_size: the same sheet of triangles of another size (or function of x and y).
    """

    of_size: Callable[[Any], Sheet] | None = None

    def __str__(self) -> str:
        x, n = self.domain.geometry.x, self.domain.topology.index_map(2).size_global
        span = ", ".join(f"{a} from {x[:, k].min():.6g} to {x[:, k].max():.6g}" for k, a in enumerate("xy"))
        return "\n".join([f"{n} triangles" + f", {span}" * (self.comm.size == 1),
                          f"layers: {', '.join(self.layers)}", f"boundaries: {', '.join(self.boundaries)}"])

    def facets_of(self, boundary: str) -> np.ndarray:
        if boundary in ("bottom", "top"):
            edges = self.domain.topology
            edges.create_entities(1)
            return np.arange(edges.index_map(1).size_local + edges.index_map(1).num_ghosts, dtype=np.int32)
        return super().facets_of(boundary)


class Edge(NamedTuple):
    """One piece of an outline: its ends (x, y), the centre of an arc or None, the name of its boundary."""

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float] | None
    name: str


def rectangle(width: float, height: float, *, corner: float = 0.0, part: str = "whole") -> list[Edge]:
    """The outline of a rectangle about (0, 0), for `sheet`.

    Args:
        width, height: along x and y, of the whole, length; corner: radius of its corners.
        part: "whole"; "half": where x > 0; "quarter": where y > 0 too. Where it is cut it is called "x0" and "y0".
    """
    a, b = positive("rectangle: width", width) / 2, positive("rectangle: height", height) / 2
    r = non_negative("rectangle: corner", corner)
    known("rectangle: part", part, _PARTS)
    if r > min(a, b):
        raise InputError(f"rectangle: corner = {corner!r}: must be at most half the shorter side, {min(a, b):g}")
    found: list[Edge] = []
    last, names = (0.0, -b) if part == "half" else (a, 0.0), "rim"

    def to(point: tuple[float, float], centre: tuple[float, float] | None = None, name: str = names) -> None:
        nonlocal last
        if math.dist(last, point) > 1e-12 * (a + b):
            found.append(Edge(last, point, centre, name))
        last = point
    if part != "quarter":
        start = 0.0 if part == "half" else -a + r
        last = (start, -b)
        to((a - r, -b))
        to((a, -b + r), (a - r, -b + r))
    to((a, b - r))
    to((a - r, b), (a - r, b - r))
    if part == "whole":
        to((-a + r, b))
        to((-a, b - r), (-a + r, b - r))
        to((-a, -b + r))
        to((-a + r, -b), (-a + r, -b + r))
        return found
    to((0.0, b))
    to((0.0, 0.0 if part == "quarter" else -b), name="x0")
    if part == "quarter":
        to((a, 0.0), name="y0")
    return found


def circle(radius: float, *, part: str = "whole") -> list[Edge]:
    """The outline of a circle about (0, 0), for `sheet`; see `rectangle`."""
    return rectangle(2 * positive("circle: radius", radius), 2 * radius, corner=radius, part=part)


def sheet(outline: Sequence[Any], size: float | Callable[[Any, Any], Any], *, names: Sequence[str] | None = None,
          layers: Sequence[str] = ("sheet",), comm: MPI.Comm = MPI.COMM_WORLD) -> Sheet:
    """A flat sheet within an outline, of triangles of a size, by gmsh.

    Args:
        outline: `rectangle(...)`, `circle(...)`, or the corners (x, y) of a polygon, length.
        size: of the triangles' edges, length; or a function of (x, y).
        names: of the polygon's edges, from the first corner on; default "rim".
        layers: their names; `Scene(thickness=...)` says how thick they are.

    Raises:
        InputError: an outline that is none or crosses itself, a size that is not above 0, more than 500,000 triangles.

    >>> import formingx as fx
    >>> print(fx.mesh.sheet(fx.mesh.rectangle(300, 200, corner=20, part="quarter"), size=40))
    35 triangles, x from 0 to 150, y from 0 to 100
    layers: sheet
    boundaries: rim, x0, y0, bottom, top
    """
    edges = several("sheet: outline", outline, "corners (x, y), or what fx.mesh.rectangle gives")
    if not all(isinstance(edge, Edge) for edge in edges):
        corners = [pair("sheet: outline: corner", point) for point in edges]
        if len(corners) < 3:
            raise InputError(f"sheet: outline = {outline!r}: must have at least three corners")
        called = list(names) if names is not None else ["rim"] * len(corners)
        if len(called) != len(corners):
            raise InputError(f"sheet: names: {len(called)} names for {len(corners)} edges: must be one for each")
        edges = [Edge(a, b, None, name) for a, b, name in zip(corners, [*corners[1:], corners[0]], called)]
    elif names is not None:
        edges = [edge._replace(name=name) for edge, name in zip(edges, names, strict=True)]
    for edge in edges:
        if instance("sheet: names: name", edge.name, str, "a word") in ("bottom", "top", ""):
            raise InputError(f"sheet: names: name = {edge.name!r}: must be a word, not that of a face")
    x = np.array([edge.start for edge in edges])
    area = abs(np.sum(x[:, 0] * np.roll(x[:, 1], -1) - x[:, 1] * np.roll(x[:, 0], -1))) / 2
    if not callable(size) and area / (0.4 * positive("sheet: size", size) ** 2) > _MOST:
        raise InputError(f"sheet: size = {size!r}: would make more than {_MOST} triangles of the sheet, whose area is"
                         f" {area:.4g}")
    words = several("sheet: layers", layers, "names")
    plain = to_mesh(lambda: _grid(edges, size), comm, "sheet")
    return Sheet(**{**vars(plain), "layers": dict.fromkeys(words, 1),
                    "boundaries": plain.boundaries | {"bottom": (), "top": ()},
                    "of_size": lambda size: sheet(edges, size, layers=words, comm=comm)})


def _grid(edges: list[Edge], size: Any) -> Grid:
    """The triangles, on one rank."""
    options = {"General.NumThreads": 1, "Mesh.MeshSizeExtendFromBoundary": 0}
    if not callable(size):
        options |= {"Mesh.MeshSizeMin": size, "Mesh.MeshSizeMax": size}
    with with_gmsh.model("sheet", options) as gmsh:
        geo, points = gmsh.model.geo, {}

        def point(at: tuple[float, float]) -> int:
            key = tuple(np.round(at, 12))
            if key not in points:
                points[key] = geo.addPoint(*at, 0.0)
            return points[key]
        tags = [geo.addLine(point(e.start), point(e.end)) if e.centre is None
                else geo.addCircleArc(point(e.start), point(e.centre), point(e.end)) for e in edges]
        geo.addPlaneSurface([geo.addCurveLoop(tags)])
        geo.synchronize()
        for name in dict.fromkeys(e.name for e in edges):
            group = gmsh.model.addPhysicalGroup(1, [t for t, e in zip(tags, edges) if e.name == name])
            gmsh.model.setPhysicalName(1, group, name)
        if callable(size):
            gmsh.model.mesh.setSizeCallback(
                lambda dim, tag, x, y, z, lc: positive(f"sheet: size at ({x:g}, {y:g})", float(size(x, y))))
        try:
            gmsh.model.mesh.generate(2)
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"sheet: gmsh makes no mesh of this outline: {error}") from None
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
        return Grid(X, np.arange(1, len(X) + 1), {"sheet": counter_clockwise(X, cells)}, boundaries)
