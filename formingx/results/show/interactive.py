"""The drawings of a report as data for plotly.js: sections, surfaces and curves; `report.js` puts them on the page."""

from __future__ import annotations

import base64
import gzip
import json
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import Units
from ..evaluate.filling import corners_of
from ..evaluate.profile import distance_to_line, fine
from .record import Record, words

DIGITS = 5
"""Significant digits of what is drawn."""
STATIONS = 101
"""At most so many places along a sheet are drawn."""


def library() -> str:
    """plotly.js, packed.

    Raises:
        InputError: plotly is not installed.
    """
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise InputError("report: needs plotly (Debian: python3-plotly; pip: 'plotly<6'), which is not installed"
                         ) from None
    return packed(get_plotlyjs())


def packed(text: str) -> str:
    """A text, compressed, in letters that a page can hold."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


def data(records: list[Record], names: list[str], units: Units) -> str:
    """Everything that `report.js` draws, as JSON."""
    runs = [_run(record, name, units) for record, name in zip(records, names)]
    charts = [chart for chart in (*_loading(records, names, units), _filling(records, names, units),
                                  *_walls(records, names, units)) if chart]
    return json.dumps({"runs": runs, "charts": charts, "length": units.length or ""}, allow_nan=False,
                      separators=(",", ":"))


def _run(record: Record, name: str, units: Units) -> dict[str, Any]:
    """One run: the section and what colours it, frame by frame."""
    ends = [k for k in range(1, len(record.stages)) if record.stages[k] != record.stages[k - 1]]
    at = record.progress
    stages = [{"name": words(record.stages[a]), "from": float(at[a]), "to": float(at[b - 1])}
              for a, b in zip([0, *ends], [*ends, len(at)])]
    shown = [c for c in record.measures if c.endswith(("pressure", "travel", "pole_height", "process_time"))]
    found = {"name": name, "axisymmetric": record.axisymmetric, "stages": stages, "progress": _rounded(at),
             "stage": record.stages,
             "numbers": {units.label(c): _rounded(record.measures[c]) for c in shown},
             "tools": _tools(record), "sheet": None}
    if record.profiles[-1] is not None:
        found["sheet"] = _sheet(record, units)
    return found


def _sheet(record: Record, units: Units) -> dict[str, Any]:
    n = len(record.profiles[-1].bottom)
    some = np.unique(np.linspace(0, n - 1, min(n, STATIONS)).round().astype(int))
    fields: dict[str, list] = {}
    for profile, more in zip(record.profiles, record.fields):
        wall = profile.wall_thickness
        values = {units.label("wall"): wall, "wall / original": wall / profile.original_thickness}
        values |= {units.label(key.replace(" ", "_"), key): v for key, v in more.items()}
        for key, v in values.items():
            fields.setdefault(key, []).append(_rounded(v[some], each=True))
    last = record.profiles[-1]
    return {"material": _rounded(last.reference_radius[some]), "bottom": [_rounded(p.bottom[some].T) for p in
            record.profiles], "top": [_rounded(p.top[some].T) for p in record.profiles], "fields": fields}


def _tools(record: Record) -> list[dict[str, Any]]:
    """Outlines of the tools, with a shell on their solid side, and how far each has come in every state."""
    shapes = [p for p in record.profiles if p is not None]
    size = max((np.ptp(np.vstack([p.bottom, p.top]), axis=0).max() for p in shapes), default=1.0)
    found = []
    for k, (contact, name) in enumerate(zip(record.tooling.contacts, record.tooling.names)):
        line = contact.tool.outline()
        shell = line + 0.02 * size * contact.tool.nearest(line).normal
        found.append({"name": name, "line": _rounded(line.T), "shell": _rounded(shell.T),
                      "moves": list(contact.moves or (0.0, 0.0)),
                      "travel": [None if t[k] is None else float(f"{t[k]:.7g}") for t in record.travels]})
    return found


def _loading(records: list[Record], names: list[str], units: Units) -> list[dict[str, Any]]:
    """What is driven, stage by stage: a tool's own force against its travel, a pressure against the pole's height."""
    pairs: dict[tuple[str, str], list[dict]] = {}
    for record, name in zip(records, names):
        ends = [k for k in range(1, len(record.stages)) if record.stages[k] != record.stages[k - 1]]
        for a, b in zip([0, *ends], [*ends, len(record.stages)]):
            of_stage = slice(a, b)
            for x, y, xs, ys in _driven(record, of_stage):
                label = " ".join(w for w in (name if len(records) > 1 else "", words(record.stages[a])) if w)
                pairs.setdefault((x, y), []).append({"x": _rounded(xs), "y": _rounded(ys), "name": label or words(y),
                                                     "mode": "lines+markers", "marker": {"size": 4}})
    drawn = [_chart(f"{words(y).capitalize()} against {words(x)}", units.label(x), units.label(y), traces)
             for (x, y), traces in pairs.items()]
    return [chart for chart in drawn if chart]


def _driven(record: Record, stage: slice) -> list[tuple[str, str, np.ndarray, np.ndarray]]:
    """(x, y, their values) of what a stage drives."""
    found, measures = [], record.measures
    for column, values in measures.items():
        if np.ptp(values[stage]) <= 1e-9 * (np.ptp(values) or 1.0):
            continue
        if column.endswith("travel"):
            name = column.removesuffix("travel").rstrip("_")
            moving = {n for n, c in zip(record.tooling.names, record.tooling.contacts) if c.moves is not None}
            force = record.forces.get(name or min(moving, default=""))      # one travel without a name: one tool moves
            if force is None:
                force = measures.get(f"{name}_force" if name else "support_force")
            if force is not None:
                found.append((column, f"{name}_force" if name else "force", values[stage], force[stage]))
        elif column.endswith("pressure"):
            x = next((c for c in ("pole_height", "enclosed_volume") if c in measures), None)
            if x:
                found.append((x, column, measures[x][stage], values[stage]))
    return found


def _filling(records: list[Record], names: list[str], units: Units) -> dict[str, Any] | None:
    """The gap left in every corner of the tools that stay, against the pressure, in the last stage."""
    traces = []
    for record, name in zip(records, names):
        pressure = next((v for c, v in record.measures.items() if c.endswith("pressure")), None)
        first = next(k for k, stage in enumerate(record.stages) if stage == record.stages[-1])
        for contact in record.tooling.contacts:
            if contact.moves is not None or pressure is None or record.profiles[-1] is None \
                    or contact.on not in ("top", "bottom", "inner", "outer"):
                continue
            for k, (_, points) in enumerate(corners_of(contact.tool), 1):
                lines = (p.top if contact.on in ("top", "outer") else p.bottom for p in record.profiles[first:])
                gaps = np.array([distance_to_line(points, fine(line)).max() for line in lines])
                label = f"{contact.name or 'tool'}, corner {k}"
                traces.append({"x": _rounded(pressure[first:]), "y": _rounded(gaps), "mode": "lines+markers",
                               "name": f"{name}: {label}" if len(records) > 1 else label, "marker": {"size": 4}})
    return _chart("Gap left in the corners against pressure", units.label("pressure"), units.label("gap"), traces)


def _walls(records: list[Record], names: list[str], units: Units) -> list[dict[str, Any] | None]:
    """The wall at the end against height and against arc length, in all and of each layer."""
    from ..evaluate.wall import Wall
    by_height, by_length = [], []
    for record, name in zip(records, names):
        if record.profiles[-1] is None:
            continue
        wall = Wall(record.profiles[-1], record.layers, None)
        lines = {name if len(records) > 1 else "wall": wall.wall}
        if len(record.layers) > 1:
            lines |= {f"{name}: {layer}" if len(records) > 1 else layer: share * wall.wall
                      for layer, share in record.layers.items()}
        for label, values in lines.items():
            by_height.append({"x": _rounded(values), "y": _rounded(wall.height), "name": label, "mode": "lines"})
            by_length.append({"x": _rounded(wall.arc_length), "y": _rounded(values), "name": label, "mode": "lines"})
    label = units.label("wall")
    return [_chart("Wall against height above the base", label, units.label("height"), by_height, zero="x"),
            _chart("Wall against arc length from the axis", units.label("arc_length"), label, by_length, zero="y")]


def _chart(title: str, x: str, y: str, traces: list[dict], zero: str = "") -> dict[str, Any] | None:
    if not traces:
        return None
    return {"title": title, "x": x, "y": y, "zero": zero,
            "traces": [{"type": "scatter", **trace} for trace in traces]}


def _rounded(values: Any, each: bool = False) -> list:
    """Numbers with `DIGITS` digits, `each` or those of the largest of them, as lists."""
    values = np.asarray(values, dtype=float)
    size = np.abs(values) if each else np.abs(values).max(initial=0.0)
    unit = 10.0 ** (np.floor(np.log10(np.where(size > 0, size, 1.0))) + 1 - DIGITS)
    return [float(f"{v:.{DIGITS + 1}g}") for v in (np.round(values / unit) * unit).tolist()] if values.ndim == 1 else [
        _rounded(row, each) for row in values]
