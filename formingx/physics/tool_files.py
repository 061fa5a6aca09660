"""Profiles of tools from files: drawings and meshes, read as data, so that nothing in a file runs."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import InputError, count, finite, place, several
from ..mesh import msh
from . import geo
from .profile import Arc, Line, Tool

_HEADERS = {"step": (b"ISO-10303-21",), "brep": (b"DBRep_DrawableShape", b"CASCADE Topology", b"Open CASCADE Topology")}
_KINDS = {".geo": "geo", ".msh": "msh", ".step": "step", ".stp": "step", ".brep": "brep"}


def read(file: str | os.PathLike, curves: Sequence[int], closed: bool = False) -> Tool:
    """A tool from curves of a file, in order; a negative number runs a curve backwards.

    A curve is taken for the line or the arc that it is, exactly; the curves of a mesh (.msh) by their nodes. The ending
    says what a file is: .step or .stp, .brep, .msh, or .geo. A .geo file is a script, which is not run: it may hold
    points, lines, circles, numbers with a name, and what a tool does not need (loops, surfaces, physical groups).

    Raises:
        InputError: the file is not what its ending says or cannot be read, a statement that a .geo file may not hold,
            or a curve that is neither a line nor a circular arc.
    """
    name = os.fspath(place("tools.read: file", file))
    tags = [_tag(tag) for tag in several("tools.read: curves", curves, "numbers of curves")]
    if not tags:
        raise InputError("tools.read: curves = []: must name at least one curve")
    if not os.path.isfile(name):
        raise InputError(f"tool file {name!r} is not there")
    kind = _KINDS.get(os.path.splitext(name)[1].lower())
    if kind is None:
        raise InputError(f"tool file {name!r}: its ending must be one of {', '.join(_KINDS)}")
    pieces: list[Line | Arc] = []
    with open(name, "rb") as stream:
        head = stream.read(200).lstrip()
    if kind in _HEADERS and not head.startswith(_HEADERS[kind]):
        raise InputError(f"tool file {name!r} cannot be read: it does not begin as a {kind.upper()} file does")
    for piece in {"geo": _of_geo, "msh": _of_mesh}.get(kind, _of_solid)(name, tags):
        pieces += piece
    return Tool.of_pieces(pieces, closed)


def _tag(tag: Any) -> int:
    number = finite("tools.read: number of a curve", tag)
    return int(math.copysign(count("tools.read: number of a curve", abs(number)), number))


def _of_geo(file: str, tags: list[int]) -> list[list[Line | Arc]]:
    known = geo.curves(file)
    _check_known(file, tags, known)
    return [known[tag] if tag > 0 else [_backwards(p) for p in reversed(known[-tag])] for tag in tags]


def _of_mesh(file: str, tags: list[int]) -> list[list[Line | Arc]]:
    found = msh.content(file)
    points = dict(zip(found.numbers.tolist(), found.points[:, :2]))
    lines: dict[int, list[list[int]]] = {}
    for block in found.blocks:
        if block.kind in (1, 8):
            lines.setdefault(block.entity, []).extend(block.nodes[:, :2].tolist())
    _check_known(file, tags, lines)

    def along(tag: int) -> np.ndarray:
        ends = list(dict.fromkeys(map(tuple, lines[tag])))           # an element of two groups is there twice
        nodes = [ends[0][0], *(end for _, end in ends)]
        if any(a[1] != b[0] for a, b in zip(ends, ends[1:])) or not all(n in points for n in nodes):
            raise InputError(f"tool file {file!r}: the elements of curve {tag} do not follow one another")
        return np.array([points[n] for n in nodes])
    return _through(file, tags, along)


def _of_solid(file: str, tags: list[int]) -> list[list[Line | Arc]]:
    """Of a STEP or BREP file, which Open CASCADE reads: it knows no commands."""
    import gmsh
    ours = not gmsh.isInitialized()
    if ours:
        gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("formingx tool")
        kind = _KINDS[os.path.splitext(file)[1].lower()]
        try:
            gmsh.model.occ.importShapes(file, highestDimOnly=False, format=kind)
            gmsh.model.occ.synchronize()
        except Exception as error:
            raise InputError(f"tool file {file!r} cannot be read: {error}") from None
        _check_known(file, tags, [tag for _, tag in gmsh.model.getEntities(1)])

        def along(tag: int) -> np.ndarray:
            (low,), (high,) = gmsh.model.getParametrizationBounds(1, tag)
            return np.array(gmsh.model.getValue(1, tag, np.linspace(low, high, 9))).reshape(-1, 3)[:, :2]
        return _through(file, tags, along)
    finally:
        gmsh.model.remove()
        if ours:
            gmsh.finalize()


def _check_known(file: str, tags: list[int], known: Any) -> None:
    for tag in tags:
        if abs(tag) not in known:
            raise InputError(f"tool file {file!r} has no curve {abs(tag)}; it has {sorted(known)}")


def _through(file: str, tags: list[int], along: Callable[[int], np.ndarray]) -> list[list[Line | Arc]]:
    """The line or arc through the points of each curve, backwards if its number is negative."""
    found = []
    for tag in tags:
        piece = _piece_through(along(abs(tag)), f"tool file {file!r}: curve {abs(tag)}")
        found.append([piece if tag > 0 else _backwards(piece)])
    return found


def _backwards(piece: Line | Arc) -> Line | Arc:
    if isinstance(piece, Line):
        return Line(piece.b, piece.a)
    return piece._replace(start=piece.start + piece.sweep, sweep=-piece.sweep)


def _piece_through(points: np.ndarray, name: str) -> Line | Arc:
    """The line or the arc on which all points lie, in their order, shape (n, 2)."""
    n, near = len(points), 1e-7 * max(np.ptp(points, axis=0).max(initial=0.0), 1e-300)
    a, b = points[[0, -1]] if n > 1 else (np.zeros(2), np.zeros(2))
    chord = b - a
    off = (points - a) @ (-chord[1], chord[0]) / max(math.hypot(*chord), near)
    if n > 1 and math.hypot(*chord) > near and np.abs(off).max() <= near:
        return Line(a, b)
    if n > 3:                                              # three points always lie on a circle
        p, q, r = points[[0, n // 3, 2 * n // 3]]
        centre = p + np.linalg.lstsq(2 * np.array([q - p, r - p]), [(q - p) @ (q - p), (r - p) @ (r - p)])[0]
        radius = math.dist(p, centre)
        if np.abs(np.hypot(*(points - centre).T) - radius).max() <= near:
            angles = np.unwrap([math.atan2(*(x - centre)[::-1]) for x in points])
            if np.all(np.diff(angles) * (angles[-1] - angles[0]) > 0):
                return Arc(centre, radius, float(angles[0]), float(angles[-1] - angles[0]))
    raise InputError(f"{name} is neither a straight line nor a circular arc"
                     + (f" (of a mesh, {n} nodes; four are needed to know an arc)" if n < 4 else ""))

