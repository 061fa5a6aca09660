"""Meshes of curved surfaces in three dimensions: tubes, surfaces of revolution, and surfaces given as triangles."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError, as_list, as_points, check_name, count, file_path, finite_array, positive
from ...mesh.edges import edges_of
from ...mesh.grid import Grid
from ...mesh.nodes import SAME_PLACE
from .stl_reader import read_stl
from .surface_mesh import SurfaceMesh, surface_mesh

_ANGLES = {"whole": (0.0, 360.0), "half": (-90.0, 90.0), "quarter": (0.0, 90.0)}
"""First and last angle of each part, degrees."""

FACES = ("inner", "outer")
"""Faces of a curved surface, first the one opposite to the normals of its triangles."""


def tube(*, radius: float, length: float, elements: tuple[Any, Any], part: str = "whole", end: str = "open",
         z: float = 0.0, layers: Sequence[str] = ("sheet",), comm: MPI.Comm = MPI.COMM_WORLD) -> SurfaceMesh:
    """Mesh the middle surface of a tube about the z axis, which hangs down from its neck.

    The nodes lie a little outside the radius, so that each ring encloses the area of its circle (`revolved`).

    Args:
        radius: radius of the middle surface, length.
        length: length of the tube along z, with a closed end included, length.
        elements: number of rows of triangles along the meridian, and of columns round the modelled part; or lists of
            their places (`revolved`).
        part: modelled part: "whole"; "half" with x > 0; "quarter" with x > 0 and y > 0.
        end: "open", or "closed" by a hemisphere.
        z: coordinate z of the neck, length.
        layers: names of the layers; `Scene(thickness=...)` gives their thickness.
        comm: MPI communicator.

    Returns:
        Mesh of the tube with the boundaries "neck" and, if it is open, "end"; the cuts of a part are "x0" and "y0". Its
        faces are "inner" and "outer".

    Raises:
        InputError: a size that is not positive, an unknown part or end, or a closed tube shorter than its radius.

    >>> print(fx.mesh.tube(radius=16.0, length=190.0, elements=(24, 6), part="quarter", end="closed"))
    282 triangles, x from 0 to 16.0919, y from 0 to 16.0919, z from -190 to 0
    layers: sheet
    boundaries: neck, x0, y0, inner, outer
    """
    R, L = positive("tube: radius", radius), positive("tube: length", length)
    check_name("tube: end", end, ("open", "closed"))
    if end == "open":
        return revolved([(R, z), (R, z - L)], elements=elements, part=part, layers=layers, comm=comm)
    if L < R:
        raise InputError(f"tube: length = {length!r}: must be at least the radius {R:g} of its closed end")
    rows, columns = _both("tube: elements", elements)
    s = (L - R + np.pi / 2 * R) * _divisions("tube: elements: along", rows, (0.0, 1.0))
    angle = np.maximum(s - (L - R), 0.0) / R
    line = np.column_stack([R * np.cos(angle), z - np.minimum(s, L - R) - R * np.sin(angle)])
    line[-1, 0] = 0.0
    meridian = [(float(r), float(h)) for r, h in line]
    return revolved(meridian, elements=(None, columns), part=part, layers=layers, comm=comm)


def revolved(meridian: Sequence[tuple[float, float]], *, elements: tuple[Any, Any], part: str = "whole",
             layers: Sequence[str] = ("sheet",), comm: MPI.Comm = MPI.COMM_WORLD) -> SurfaceMesh:
    r"""Mesh a surface of revolution about the z axis, such as the middle surface of a preform or a closed parison.

    A ring of chords has the area of its circle of radius r if its nodes have the radius

    .. math:: r \sqrt{\frac{2 a}{\sin 2 a}}

    with the angle 2 a between two columns. With nodes on the circle the limit pressure of a tube would be too large by
    a^2/2. It is too large by a^2/6.

    Args:
        meridian: points (r, z) of the middle surface from the neck on, length. The last point may lie on the axis, then
            the surface is closed there.
        elements: number of rows of triangles along the meridian, at equal arc lengths, and of columns round the
            modelled part. None for the rows: one between two successive points of the meridian. Small triangles where
            the mould has edges need lists: the ends of the rows as shares of the arc length, from 0 to 1, and the ends
            of the columns as angles in degrees, from 0 to 90 for a quarter, from -90 to 90 for a half.
        part: modelled part: "whole"; "half" with x > 0; "quarter" with x > 0 and y > 0.
        layers: names of the layers; `Scene(thickness=...)` gives their thickness.
        comm: MPI communicator.

    Returns:
        Mesh of the surface with the boundaries "neck" (the first point) and, unless it is closed, "end"; the cuts of a
        part are "x0" and "y0". Its faces are "inner" and "outer".

    Raises:
        InputError: fewer than two points, a point with r <= 0 other than the last, or an unknown part.

    >>> preform = fx.mesh.revolved([(10, 0), (10, -80), (7, -88), (0, -91)], elements=(30, 16))
    >>> list(preform.boundaries), round(preform.enclosed_volume())
    (['neck', 'inner', 'outer'], 27079)
    """
    check_name("revolved: part", part, tuple(_ANGLES))
    rows, columns = _both("revolved: elements", elements)
    angles = _divisions("revolved: elements: round", columns, _ANGLES[part])
    line = as_points("revolved: meridian", meridian, 2).astype(float)
    if len(line) < 2 or np.any(np.linalg.norm(np.diff(line, axis=0), axis=1) == 0):
        raise InputError("revolved: meridian: must be at least two points (r, z), and each another")
    if rows is not None:
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        at = s[-1] * _divisions("revolved: elements: along", rows, (0.0, 1.0))
        line = np.column_stack([np.interp(at, s, column) for column in line.T])
    if line[:-1, 0].min() <= 0 or line[-1, 0] < 0:
        raise InputError(f"revolved: meridian: the radius {line[:, 0].min():g} is not allowed: only the last point may"
                         f" lie on the axis, and none beyond it")
    # the triangles look away from the axis and the inside if the meridian leads down
    return surface_mesh(lambda: _grid(line, np.radians(angles), part), comm, "revolved", FACES, layers, meridian=line)


def surface(points: Any, triangles: Any, boundaries: Mapping[str, Any] | None = None, *,
            layers: Sequence[str] = ("sheet",), comm: MPI.Comm = MPI.COMM_WORLD) -> SurfaceMesh:
    """Return the mesh of a surface that is given as triangles.

    Args:
        points: vertices (x, y, z), shape (n, 3), length.
        triangles: vertex numbers, shape (m, 3), counter-clockwise seen from the face "outer".
        boundaries: {name: vertex numbers of its edges, shape (k, 2)}. Default: open edges in the planes x = 0 and y = 0
            of a surface on one side of the plane are "x0" and "y0", the highest other line of edges is "neck", the
            lowest "end". Lines between these are "edge_2", "edge_3" and so on.
        layers: names of the layers; `Scene(thickness=...)` gives their thickness.
        comm: MPI communicator.

    Returns:
        Mesh of the surface, with the faces "inner" and "outer".

    Raises:
        InputError: the surface is no valid mesh, or an edge of a boundary is no edge of a triangle.

    >>> p = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, -1)]
    >>> list(fx.mesh.surface(p, [(4, 1, 0), (4, 2, 1), (4, 3, 2), (4, 0, 3)]).boundaries)
    ['neck', 'inner', 'outer']
    """
    X, cells = as_points("surface: points", points, 3).astype(float), np.asarray(triangles)
    if cells.ndim != 2 or cells.shape[1] != 3 or not np.issubdtype(cells.dtype, np.integer) or not len(cells) \
            or cells.min() < 0 or cells.max() >= len(X):
        raise InputError(f"surface: triangles: must be three numbers of points each, from 0 to {len(X) - 1}")
    named = open_edges(X, cells) if boundaries is None else {
        name: np.asarray(edges, dtype=np.int64).reshape(-1, 2) for name, edges in boundaries.items()}
    for name in named:
        if name in FACES or not isinstance(name, str) or not name:
            raise InputError(f"surface: boundaries: name = {name!r}: must be a word, not that of a face")
    return surface_mesh(lambda: Grid(X, np.arange(1, len(X) + 1), {"sheet": cells.astype(np.int64)}, named), comm,
                        "surface", FACES, layers)


def stl_grid(file: str | os.PathLike) -> Grid:
    """Return the triangles of an STL file, with its open edges as boundaries (`surface`), or raise `InputError`."""
    points, triangles = read_stl(os.fspath(file_path("mesh.read: file", file)), "mesh.read")
    return Grid(points, np.arange(1, len(points) + 1), {"sheet": triangles}, open_edges(points, triangles))


def open_edges(points: np.ndarray, triangles: np.ndarray) -> dict[str, np.ndarray]:
    """Return {name: edges, shape (k, 2)} of the open edges of a surface, named as `surface` says."""
    _, edges, _, times = edges_of(triangles)
    rest, found = edges[times == 1], {}
    used = points[np.unique(triangles)]
    near = SAME_PLACE * float(np.ptp(used, axis=0).max())
    for name, axis in (("x0", 0), ("y0", 1)):
        one_side = used[:, axis].min() > -near or used[:, axis].max() < near
        inside = (np.abs(points[rest][:, :, axis]) < near).all(1) & one_side
        if inside.any():
            found[name], rest = rest[inside], rest[~inside]
    lines = []
    while len(rest):
        mine, size = np.zeros(len(rest), dtype=bool), 0
        mine[0] = True
        while mine.sum() > size:
            size = int(mine.sum())
            mine |= np.isin(rest, rest[mine]).any(1)
        lines.append(rest[mine])
        rest = rest[~mine]
    lines.sort(key=lambda line: -points[line][..., 2].mean())
    names = ["neck", *(f"edge_{k}" for k in range(2, len(lines))), "end"]
    return {**dict(zip(names if len(lines) > 1 else names[:1], lines)), **found}


def _divisions(name: str, given: Any, ends: tuple[float, float]) -> np.ndarray:
    """Return n + 1 increasing places between two ends, from their number n or from a list of them, shape (n + 1,)."""
    if not isinstance(given, list | tuple | np.ndarray):
        return np.linspace(*ends, count(name, given) + 1)
    found = finite_array(name, given)
    if found.ndim != 1 or len(found) < 2 or np.any(np.diff(found) <= 0) or not np.allclose(found[[0, -1]], ends):
        raise InputError(f"{name} = {given!r}: must be a number, or a list that increases from {ends[0]:g} to"
                         f" {ends[1]:g}")
    return np.concatenate([ends[:1], found[1:-1], ends[1:]])


def _both(name: str, elements: Any) -> list[Any]:
    """Return the divisions along the meridian and round the axis; raise `InputError` unless they are two."""
    found = as_list(name, elements, "two numbers, or of lists of places")
    if len(found) != 2:
        raise InputError(f"{name} = {elements!r}: must be two numbers, or lists of places: along the meridian, and"
                         f" round the axis")
    return found


def _grid(line: np.ndarray, angles: np.ndarray, part: str) -> Grid:
    """Return a surface of revolution from a meridian (r, z), neck first, shape (n, 2), length.

    Triangles are counter-clockwise from outside, in columns between the angles round the part "whole", "half" or
    "quarter", shape (columns + 1,), radians. Each ring of chords encloses the area of its circle.
    """
    columns, closed, whole = len(angles) - 1, line[-1, 0] == 0, part == "whole"
    rings, n = line[:-1] if closed else line, columns if whole else columns + 1
    if whole and columns < 3:
        raise InputError(f"revolved: elements: round = {columns}: must be at least 3 for the whole")
    if np.diff(angles).max() > np.pi / 1.5 + 1e-9:
        raise InputError(f"revolved: elements: round: a column is {np.degrees(np.diff(angles).max()):.4g} degrees wide:"
                         f" must be at most 120")
    larger = np.sqrt((angles[-1] - angles[0]) / np.sin(np.diff(angles)).sum())
    cos, sin = (larger * np.round(f(angles[:n]), 15) for f in (np.cos, np.sin))
    points = np.concatenate([np.column_stack([r * cos, r * sin, np.full(n, z)]) for r, z in rings]
                            + [np.array([[0.0, 0.0, line[-1, 1]]])] * int(closed))
    row = np.arange(len(rings) * n).reshape(len(rings), n)
    left, right = (row, np.roll(row, -1, axis=1)) if whole else (row[:, :-1], row[:, 1:])
    a, b, c, d = left[:-1], right[:-1], right[1:], left[1:]                          # a, b above; d, c below
    odd = np.add.outer(np.arange(len(rings) - 1), np.arange(columns)) % 2 == 1       # diagonals alternate
    pairs = np.where(odd[..., None, None], np.stack([np.stack([a, d, c], -1), np.stack([a, c, b], -1)], -2),
                     np.stack([np.stack([a, d, b], -1), np.stack([d, c, b], -1)], -2))
    cells: np.ndarray = pairs.reshape(-1, 3)
    if closed:
        tip = np.full(columns, len(points) - 1)
        cells = np.vstack([cells, np.column_stack([left[-1], tip, right[-1]])])
    boundaries = {"neck": np.column_stack([left[0], right[0]])}
    if not closed:
        boundaries["end"] = np.column_stack([left[-1], right[-1]])
    cuts = {"whole": (), "half": ("x0", "x0"), "quarter": ("y0", "x0")}[part]
    for name, column in zip(cuts, (row[:, 0], row[:, -1])):
        side = np.append(column, len(points) - 1) if closed else column
        edges = np.column_stack([side[:-1], side[1:]])
        boundaries[name] = np.vstack([boundaries[name], edges]) if name in boundaries else edges
    order = [name for name in ("neck", "end", "x0", "y0") if name in boundaries]
    return Grid(points, np.arange(1, len(points) + 1), {"sheet": cells}, {name: boundaries[name] for name in order})
