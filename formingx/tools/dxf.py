"""Curves of a DXF drawing: lines, arcs, circles, polylines with bulges, ellipses and splines."""

import math
import os
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..errors import InputError
from . import dxf_tags
from .arcs import arcs_along, in_plane
from .pieces import TURN, Arc, Line


def curves(file: str | os.PathLike, tolerance: float | None) -> dict[int, Callable[[], list[Line | Arc]]]:
    """Return {number from 1: function that returns its lines and arcs} of the curves in the model space of a drawing.

    Texts, dimensions, hatches, points and invisible entities are skipped. The function raises an InputError outside the
    plane or, for splines and ellipses, without a tolerance; so does a missing ezdxf or unreadable file.
    """
    try:
        import ezdxf
    except ImportError as error:
        raise InputError(f"a DXF file needs ezdxf (Debian: python3-ezdxf): {error}") from None
    file = os.fspath(file)
    found: dict[int, Callable[[], list[Line | Arc]]] = {}
    try:
        expected = dxf_tags.check(file, _SKIPPED)
        drawing = ezdxf.readfile(file)
        _check_counts(expected, Counter(e.dxftype() for layout in drawing.layouts for e in layout))
        for entity in drawing.modelspace():
            if (entity.dxftype() in _READERS or entity.dxftype() in _SKIPPED) and _is_visible(entity, drawing):
                number = len(found) + 1
                found[number] = partial(_pieces, entity, tolerance, f"tool file {file!r}: curve {number}")
    except Exception as error:      # any error of the reader on a damaged file
        raise InputError(f"tool file {file!r} cannot be read: {error or type(error).__name__}") from None
    return found


def _check_counts(expected: Counter, found: Counter) -> None:
    """Raise a ValueError if ezdxf found fewer curves of a kind than the file has."""
    for kind in _READERS:
        if found[kind] != expected[kind]:
            raise ValueError(f"{expected[kind]} {kind} stand in it, {found[kind]} can be read")


def _pieces(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Return lines and arcs of an ezdxf curve; damage, or a spline without `tolerance`, is an InputError."""
    try:
        return _read(entity, tolerance, name)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{name} cannot be read: {type(error).__name__}: {error}") from None


def _read(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Return lines and arcs of a DXF entity by its kind; other kinds and planes are an InputError."""
    kind = entity.dxftype()
    if kind in _SKIPPED:
        raise InputError(f"{name} is a {kind}, which is no curve of a section: draw it as lines, arcs, polylines or"
                         f" splines")
    if tuple(entity.dxf.get("extrusion", (0, 0, 1))) != (0, 0, 1):
        raise InputError(f"{name}: its plane is not that of the drawing (extrusion {tuple(entity.dxf.extrusion)})")
    return _READERS[kind](entity, tolerance, name)


def _line(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Return the line of a DXF entity LINE, as a list; `name` begins error messages, `tolerance` is not used."""
    return [Line(_in_plane(entity.dxf.start, name), _in_plane(entity.dxf.end, name))]


def _arc(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Return the arc of a DXF entity ARC, as a list; `name` begins error messages, `tolerance` is not used."""
    start, end = math.radians(entity.dxf.start_angle), math.radians(entity.dxf.end_angle)
    return [Arc(_in_plane(entity.dxf.center, name), float(entity.dxf.radius), start, (end - start) % TURN or TURN)]


def _circle(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Return the arc of 360 degrees of a DXF entity CIRCLE, as a list."""
    return [Arc(_in_plane(entity.dxf.center, name), float(entity.dxf.radius), 0.0, TURN)]


def _polyline(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Return the lines and arcs of a DXF polyline; `name` begins error messages, `tolerance` is not used.

    A bulge is the tangent of a quarter of the angle of the arc that follows, negative if clockwise. Three-dimensional,
    mesh or spline polylines are an InputError.
    """
    if entity.dxftype() == "POLYLINE" and not entity.is_2d_polyline:
        raise InputError(f"{name} is a three-dimensional polyline or a mesh: draw it as a plane polyline")
    if entity.dxftype() == "POLYLINE":
        if entity.dxf.flags & 4:
            raise InputError(f"{name} is a polyline that was fitted with a spline: draw it as a spline")
        rows = [(*_in_plane(v.dxf.location, name), v.dxf.get("bulge", 0.0)) for v in entity.vertices]
    else:
        elevation = entity.dxf.get("elevation", 0.0)
        rows = [(*_in_plane((x, y, elevation), name), bulge) for x, y, bulge in entity.get_points("xyb")]
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
    """Return arcs within `tolerance`, length, of a DXF ellipse; none, or a bad ratio of axes, is an InputError."""
    _in_plane(entity.dxf.center, name), _in_plane(entity.dxf.major_axis, name)
    if not 0 < entity.dxf.ratio <= 1:
        raise InputError(f"{name}: its axes have the ratio {entity.dxf.ratio:g}: must be above 0, at most 1")
    tool = entity.construction_tool()
    low, high = tool.start_param, tool.end_param
    high += TURN if high <= low else 0.0

    def curve(t):
        parameters = (low + (high - low) * t).tolist()
        return _rows(tool.vertices(parameters)), _rows(tool.tangents(parameters))
    return arcs_along(curve, _required(tolerance, name), name)


def _spline(entity: Any, tolerance: float | None, name: str) -> list[Line | Arc]:
    """Return arcs within a tolerance, length, of the smooth parts of a plane DXF spline, else an InputError."""
    for point in (*entity.control_points, *entity.fit_points):
        _in_plane(point, name)
    tool = entity.construction_tool()
    knots = sorted({float(k) for k in tool.knots() if tool.knots()[tool.order - 1] <= k <= tool.max_t})
    pieces: list[Line | Arc] = []
    for low, high in zip(knots, knots[1:]):
        def curve(t, low=low, high=high):
            inner = np.clip(low + (high - low) * t, low, high - 1e-12 * (high - low))
            found = [tool.derivative(parameter, 1) for parameter in inner.tolist()]
            return _rows(point for point, _ in found), _rows(derivative for _, derivative in found)
        pieces += arcs_along(curve, _required(tolerance, name), name)
    return pieces


_READERS = {"LINE": _line, "ARC": _arc, "CIRCLE": _circle, "LWPOLYLINE": _polyline, "POLYLINE": _polyline,
            "ELLIPSE": _ellipse, "SPLINE": _spline}
_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 13: "um"}
_SKIPPED = ("3DFACE", "3DSOLID", "BODY", "HELIX", "INSERT", "MESH", "MLINE", "RAY", "REGION", "SURFACE", "XLINE")


def _is_visible(entity: Any, drawing: Any) -> bool:
    """Return True if an entity and its layer in the drawing are visible."""
    layer = drawing.layers.get(entity.dxf.layer) if entity.dxf.layer in drawing.layers else None
    return not (entity.dxf.get("invisible", 0) or layer is not None and (layer.is_off() or layer.is_frozen()))


def unit(file: str) -> str | None:
    """Return the unit of length of a DXF file ($INSUNITS), or None; unreadable or unknown: InputError."""
    import ezdxf
    try:
        code = ezdxf.readfile(file).header.get("$INSUNITS", 0)
    except Exception as error:      # any error of the reader on a damaged file
        raise InputError(f"tool file {file!r} cannot be read: {type(error).__name__}: {error}") from None
    if code and code not in _UNITS:
        raise InputError(f"tool file {file!r}: its unit, $INSUNITS = {code!r}, is not one of"
                         f" {', '.join(_UNITS.values())}: give a factor as units")
    return _UNITS.get(code)


def _in_plane(point: Any, name: str) -> np.ndarray:
    """Return (x, y) of a point (x, y, 0), shape (2,); name: beginning of the message if z is not 0."""
    return in_plane(np.array([tuple(point)]), name)[0]


def _rows(points: Any) -> np.ndarray:
    """Return the coordinates (x, y) of points of ezdxf as an array, shape (n, 2)."""
    return np.array([(p[0], p[1]) for p in points], float)


def _required(tolerance: float | None, name: str) -> float:
    """Return the tolerance for a curve that arcs must replace; None is an InputError by name."""
    if tolerance is None:
        raise InputError(f"{name} is neither a straight line nor a circular arc: give tolerance=..., a length, and it"
                         f" is taken for arcs that close to it")
    return tolerance
