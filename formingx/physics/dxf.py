"""The curves of a DXF drawing: lines, arcs, circles, polylines with bulges, ellipses and splines."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..errors import InputError
from .arcs import arcs_along
from .profile import TURN, Arc, Line


def curves(file: str | os.PathLike, tolerance: float | None) -> dict[int, Callable[[], list[Line | Arc]]]:
    """{number: what makes its pieces} of the curves of a drawing's model space, counted from 1 in its order.

    Texts, dimensions, hatches and points count as nothing. Ellipses and splines become arcs within `tolerance`
    (length).

    Raises:
        InputError: ezdxf is not there, the file cannot be read, a curve of another kind or outside the plane, a spline
            without tolerance.
    """
    try:
        import ezdxf
    except ImportError as error:
        raise InputError(f"a DXF file needs ezdxf (Debian: python3-ezdxf): {error}") from None
    file = os.fspath(file)
    found: dict[int, Callable[[], list[Line | Arc]]] = {}
    try:
        for entity in ezdxf.readfile(file).modelspace():
            if entity.dxftype() in _READERS or entity.dxftype() in _NO_TOOL:
                number = len(found) + 1
                found[number] = partial(_pieces, entity, tolerance, f"tool file {file!r}: curve {number}")
    except Exception as error:      # whatever a damaged file makes of the reader
        raise InputError(f"tool file {file!r} cannot be read: {type(error).__name__}: {error}") from None
    return found


def _pieces(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    try:
        return _read(entity, tolerance, name)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{name} cannot be read: {type(error).__name__}: {error}") from None


def _read(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    kind = entity.dxftype()
    if kind in _NO_TOOL:
        raise InputError(f"{name} is a {kind}, which is no curve of a section: draw it as lines, arcs, polylines or"
                         f" splines")
    if tuple(entity.dxf.get("extrusion", (0, 0, 1))) != (0, 0, 1):
        raise InputError(f"{name}: its plane is not that of the drawing (extrusion {tuple(entity.dxf.extrusion)})")
    return _READERS[kind](entity, tolerance, name)


def _line(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    return [Line(_flat(entity.dxf.start), _flat(entity.dxf.end))]


def _arc(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    start, end = math.radians(entity.dxf.start_angle), math.radians(entity.dxf.end_angle)
    return [Arc(_flat(entity.dxf.center), float(entity.dxf.radius), start, (end - start) % TURN or TURN)]


def _circle(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    return [Arc(_flat(entity.dxf.center), float(entity.dxf.radius), 0.0, TURN)]


def _polyline(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Bulges (the tangent of a quarter of the angle) become arcs; one with a negative bulge runs clockwise."""
    if entity.dxftype() == "POLYLINE" and not entity.is_2d_polyline:
        raise InputError(f"{name} is a polyline in space or a mesh: draw it as a plane polyline")
    if entity.dxftype() == "POLYLINE":
        rows = [(*_flat(v.dxf.location), v.dxf.get("bulge", 0.0)) for v in entity.vertices]
    else:
        rows = [tuple(row) for row in entity.get_points("xyb")]
    closed = entity.is_closed if entity.dxftype() == "POLYLINE" else entity.closed
    pieces: list[Line | Arc] = []
    for (x, y, bulge), (x1, y1, _) in zip(rows, rows[1:] + (rows[:1] if closed else [])):
        p, q = np.array([x, y], float), np.array([x1, y1], float)
        if math.dist(p, q) == 0:
            continue
        if abs(bulge) < 1e-12:
            pieces.append(Line(p, q))
            continue
        sweep = 4 * math.atan(bulge)
        to_centre = (1 / bulge - bulge) / 4 * np.array([-(q - p)[1], (q - p)[0]])
        centre = (p + q) / 2 + to_centre
        pieces.append(Arc(centre, math.dist(p, centre), math.atan2(*(p - centre)[::-1]), sweep))
    return pieces


def _ellipse(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    tool = entity.construction_tool()
    low, high = tool.start_param, tool.end_param
    high += TURN if high <= low else 0.0

    def curve(t):
        at = (low + (high - low) * t).tolist()
        return _rows(tool.vertices(at)), _rows(tool.tangents(at))
    return arcs_along(curve, _needed(tolerance, name), name)


def _spline(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Between its knots it is smooth: each part for itself."""
    tool = entity.construction_tool()
    knots = sorted({float(k) for k in tool.knots() if tool.knots()[tool.order - 1] <= k <= tool.max_t})
    pieces: list[Line | Arc] = []
    for low, high in zip(knots, knots[1:]):
        def curve(t, low=low, high=high):
            inner = np.clip(low + (high - low) * t, low, high - 1e-12 * (high - low))
            both = [tool.derivative(at, 1) for at in inner.tolist()]
            return _rows(b[0] for b in both), _rows(b[1] for b in both)
        pieces += arcs_along(curve, _needed(tolerance, name), name)
    return pieces


_READERS = {"LINE": _line, "ARC": _arc, "CIRCLE": _circle, "LWPOLYLINE": _polyline, "POLYLINE": _polyline,
            "ELLIPSE": _ellipse, "SPLINE": _spline}
_NO_TOOL = ("3DFACE", "3DSOLID", "BODY", "HELIX", "INSERT", "MESH", "MLINE", "RAY", "REGION", "SURFACE", "XLINE")


def _flat(point: Any) -> np.ndarray:
    if abs(point[2]) > 1e-9 * max(abs(point[0]), abs(point[1]), 1e-300):
        raise InputError(f"a DXF drawing has the point ({point[0]:.6g}, {point[1]:.6g}, {point[2]:.6g}): z must be 0")
    return np.array([float(point[0]), float(point[1])])


def _rows(points: Any) -> np.ndarray:
    return np.array([(p[0], p[1]) for p in points], float)


def _needed(tolerance: float | None, name: str) -> float:
    if tolerance is None:
        raise InputError(f"{name} is neither a straight line nor a circular arc: give tolerance=..., a length, and it"
                         f" is taken for arcs that close to it")
    return tolerance
