"""Profiles of tools from drawings and meshes. The files are read as data: nothing in them is executed."""

import math
import os
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from ..errors import InputError, as_list, check_name, count, file_path, finite, pair, positive
from ..findings import coordinates
from ..mesh import msh
from ..units import LENGTHS, Units
from . import cad, dxf, geo
from .arcs import in_plane, piece_through
from .pieces import Arc, Line
from .profile import Tool

_HEADERS = {"step": (b"ISO-10303-21",), "brep": (b"DBRep_DrawableShape", b"CASCADE Topology", b"Open CASCADE Topology")}
_KINDS = {".geo": "geo", ".msh": "msh", ".dxf": "dxf", ".step": "step", ".stp": "step", ".brep": "brep"}

_Curves = dict[int, Callable[[], list[Line | Arc]]]
"""{number of a curve: function that returns its lines and arcs, or raises an InputError}."""


def read(file: str | os.PathLike, curves: Sequence[int] | None = None, closed: bool = False, *,
         tolerance: float | None = None, body: Any = None, units: str | float | Units | None = None) -> Tool:
    """Return a tool from curves of a file.

    The ending of the name gives the format: .step or .stp, .brep, .dxf, .msh or .geo. The curves lie in the plane
    z = 0. Lines and circular arcs are exact; in a mesh (.msh) the nodes of a curve must lie on one of them.

    A .geo file is a script, but it is not run. It may contain points, lines, circles and named numbers; loops, surfaces
    and physical groups are skipped. Invisible curves of a .dxf file are skipped, too.

    Args:
        file: name of the file.
        curves: numbers of the curves in order; a negative one reverses a curve. In a .dxf file curves are counted from
            1. Default: all curves of the file, joined at their ends.
        closed: True to join the last point to the first.
        tolerance: largest distance between a spline or an ellipse and the arcs that replace it, length.
        body: a point (R, Z) outside the tool, or the mesh of the body. It selects the side of the solid. Default: the
            solid lies to the left of the profile.
        units: unit of length of the script ("mm", "cm", "m", "um", "in", "ft"), its `formingx.Units`, or a factor.
            Lengths of a file with a unit are converted: .step in mm, .dxf by its $INSUNITS. Default: no conversion.

    Raises:
        InputError: the file cannot be read, or its content does not fit its ending. A .geo file contains another
            statement, or the file states no unit. A curve lies outside the plane, or needs a tolerance. The curves do
            not follow one another, or the body lies on both sides of the profile.

    >>> with open("plug.geo", "w") as file:
    ...     print("Point(1) = {9, 0, 0}; Point(2) = {4, 0, 0}; Point(3) = {0, 2, 0};"
    ...           "Line(1) = {1, 2}; Line(2) = {2, 3};", file=file)
    >>> fx.tools.read("plug.geo", body=(0.0, -1.0))                             # the solid above
    Tool(2 lines from (0, 2) to (9, 0))
    """
    name = os.fspath(file_path("tools.read: file", file))
    tags = None if curves is None else [_tag(t) for t in as_list("tools.read: curves", curves, "numbers of curves")]
    if tags == []:
        raise InputError("tools.read: curves = []: must name at least one curve")
    if tolerance is not None:
        tolerance = positive("tools.read: tolerance", tolerance)
    if not os.path.isfile(name):
        raise InputError(f"tool file {name!r} is not there")
    kind = _KINDS.get(os.path.splitext(name)[1].lower())
    if kind is None:
        raise InputError(f"tool file {name!r}: its ending must be one of {', '.join(_KINDS)}")
    with open(name, "rb") as stream:
        head = stream.read(200).lstrip()
    if kind in _HEADERS and not head.startswith(_HEADERS[kind]):
        raise InputError(f"tool file {name!r} cannot be read: it does not begin as a {kind.upper()} file does")
    factor = 1.0 if units is None else _factor(units, kind, name)
    file_tolerance = None if tolerance is None else tolerance / factor
    found = ({"geo": _geo_curves, "msh": _mesh_curves}[kind](name) if kind in ("geo", "msh") else
             dxf.curves(name, file_tolerance) if kind == "dxf" else cad.curves(name, kind, file_tolerance))
    for tag in tags or []:
        if abs(tag) not in found:
            raise InputError(f"tool file {name!r} has no curve {abs(tag)}; it has {sorted(found)}")
    if tags is None:
        pieces, closed = _end_to_end([found[tag]() for tag in sorted(found)], name)
    else:
        pieces = [piece for tag in tags for piece in _directed(found[abs(tag)](), tag)]
    tool = Tool.of_pieces([_scaled(piece, factor) for piece in pieces], closed)
    return tool if body is None else _outside_body(tool, body, name)


def _outside_body(tool: Tool, body: Any, file: str) -> Tool:
    """Return the tool, reversed if a point or mesh lies inside; a body on both sides is an InputError."""
    if hasattr(body, "nodes_of"):
        points = np.concatenate([body.nodes_of(name) for name in body.boundaries])
    else:
        points = np.array([pair("tools.read: body", body)])
    depth, tolerance = tool.signed_distance(points), 1e-6 * tool.size
    if depth.max() > tolerance and depth.min() < -tolerance:
        large = float(np.ptp(points, axis=0).max())
        one_unit = len(points) == 1 or tool.size / 100 < large < 100 * tool.size
        remedy = ("move the tool or the body" if one_unit else
                  f"the tool is {tool.size:.3g} large and the body {large:.3g}: give the unit of your script,"
                  f" units=...")
        raise InputError(f"tool file {file!r}: the body is on both sides of the profile, up to {depth.max():.6g} and"
                         f" {-depth.min():.6g} away from it: {remedy}")
    return tool.reversed() if depth.max() > tolerance else tool


def _directed(pieces: list[Line | Arc], tag: int) -> list[Line | Arc]:
    """Return the lines and arcs of curve `tag`, in reverse order and direction if `tag` is negative."""
    return pieces if tag > 0 else [piece.reversed for piece in reversed(pieces)]


def _end_to_end(curves: list[list[Line | Arc]], file: str) -> tuple[list[Line | Arc], bool]:
    """Return the pieces of all curves in order along the profile, and True if the profile is closed.

    An open profile begins at a free end; curves are reversed where needed. No single line is an InputError.
    """
    from scipy.spatial import cKDTree
    curves = [pieces for pieces in curves if pieces]
    if not curves:
        raise InputError(f"tool file {file!r} has no curves")
    ends = np.array([[pieces[0].ends[0], pieces[-1].ends[1]] for pieces in curves]).reshape(-1, 2)
    if not np.abs(ends).max() < 1e50:                       # squares and products are still numbers
        raise InputError(f"tool file {file!r}: a curve ends {np.abs(ends).max():.3g} away: must be below 1e50")
    tolerance = 1e-6 * max(float(np.ptp(ends, axis=0).max()), 1e-300)
    neighbours: list[list[int]] = [[] for _ in ends]             # other ends at the same point
    for a, b in cKDTree(ends).query_pairs(tolerance, output_type="ndarray").tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    number = np.array([1 + len(others) for others in neighbours])
    if number.max() > 2 or len(curves) > 1 and any(k ^ 1 in others for k, others in enumerate(neighbours)):
        place = coordinates(ends[np.argmax(number)], 6)
        raise InputError(f"tool file {file!r}: more than two ends of curves meet near {place}, or a curve"
                         f" closes in itself: name the curves of the profile, curves=[...]")
    free = np.flatnonzero(number == 1)
    if len(free) not in (0, 2):
        raise InputError(f"tool file {file!r}: its curves have {len(free)} free ends: a profile has two, or none if it"
                         f" is closed; name the curves of the profile, curves=[...]")
    if len(curves) == 1:
        return curves[0], not len(free)
    first, found = int(free[0]) if len(free) else 0, list[Line | Arc]()       # ends 2 k and 2 k + 1 belong to curve k
    for k in range(len(curves)):
        found += _directed(curves[first // 2], -1 if first % 2 else 1)
        last = first ^ 1
        following = neighbours[last]
        if k < len(curves) - 1 and (not following or not len(free) and following[0] == 0):
            raise InputError(f"tool file {file!r}: its curves are in several parts: name those of the profile,"
                             f" curves=[...]")
        first = following[0] if following else first
    return found, not len(free)


def _tag(tag: Any) -> int:
    """Return the integer number of a curve, negative for a reversed one; 0 and others are an InputError."""
    number = finite("tools.read: number of a curve", tag)
    return int(math.copysign(count("tools.read: number of a curve", abs(number)), number))


def _factor(units: Any, kind: str, file: str) -> float:
    """Return the factor of a file's lengths; an unknown unit, or none in the file, is an InputError."""
    units = units.length if isinstance(units, Units) else units
    if not isinstance(units, str):
        return positive("tools.read: units (of length, or a factor)", units)
    check_name("tools.read: units", units, LENGTHS)
    own_unit = {"step": "mm", "dxf": dxf.unit(file) if kind == "dxf" else None}.get(kind)
    if own_unit is None:
        raise InputError(f"tools.read: units = {units!r}: tool file {file!r} does not state its own: give a factor")
    return LENGTHS[own_unit] / LENGTHS[units]


def _scaled(piece: Line | Arc, factor: float) -> Line | Arc:
    """Return the line or arc with its coordinates and radius multiplied by a factor."""
    return (Line(piece.a * factor, piece.b * factor) if isinstance(piece, Line)
            else piece._replace(centre=piece.centre * factor, radius=piece.radius * factor))


def _geo_curves(file: str) -> _Curves:
    """Return {curve: function that returns [its line or arc]} of a .geo file, or raises an InputError."""
    def pieces(tag: int, piece: Line | Arc | str) -> list[Line | Arc]:
        if isinstance(piece, str):
            raise InputError(f"tool file {file!r}: curve {tag} is a {piece}, which is read from no .geo file: export it"
                             f" as .step or .brep and give a tolerance")
        return [piece]
    return {tag: partial(pieces, tag, piece) for tag, piece in geo.curves(file).items()}


def _mesh_curves(file: str) -> _Curves:
    """Return {number of a curve: function that returns the line or arc through its nodes, in a list} for a .msh file.

    The function raises an InputError if the nodes lie on no line or circle, or the elements are not in order.
    """
    found = msh.content(file)
    points = dict(zip(map(int, found.numbers), found.points))
    lines: dict[int, list[tuple[int, int]]] = {}
    for block in found.blocks:
        if block.kind in (1, 8):
            lines.setdefault(block.entity, []).extend((int(a), int(b)) for a, b in block.nodes[:, :2])

    def piece(tag: int) -> list[Line | Arc]:
        ends = list(dict.fromkeys(lines[tag]))           # an element of two groups occurs twice
        nodes = [ends[0][0], *(end for _, end in ends)]
        if any(a[1] != b[0] for a, b in zip(ends, ends[1:])) or not all(n in points for n in nodes):
            raise InputError(f"tool file {file!r}: the elements of curve {tag} do not follow one another")
        name = f"tool file {file!r}: curve {tag}"
        return [piece_through(in_plane(np.array([points[n] for n in nodes]), name), name)]
    return {tag: partial(piece, tag) for tag in lines}
