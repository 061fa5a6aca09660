"""Data of the drawings in a report: sections, surfaces and curves. The script `report.js` draws them with plotly.js."""

import base64
import functools
import gzip
import json
from collections.abc import Callable, Sequence
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import Units
from .attempts import Attempts
from .report_data import FRAMES, ReportData, words

DIGITS = 5
"""Significant digits of drawn numbers."""


@functools.cache
def library() -> str:
    """Return the source of plotly.js, compressed and in base64; InputError without plotly."""
    try:
        package = resources.files("plotly")
    except ImportError:
        raise InputError("report: needs plotly (Debian: python3-plotly; pip: 'plotly<6'), which is not installed"
                         ) from None
    for file in (package / "package_data" / "plotly.min.js", Path("/usr/share/python3-plotly/plotly.js")):
        if file.is_file():
            return packed(file.read_text("utf-8"))
    from plotly.offline import get_plotlyjs
    return packed(get_plotlyjs())


def packed(text: str) -> str:
    """Return a text compressed by gzip and encoded in base64, so that an HTML page can hold it."""
    # level 6 takes twice the time to save 6 %
    return base64.b64encode(gzip.compress(text.encode(), 4, mtime=0)).decode()


def data(records: list[ReportData], names: list[str], units: Units, attempts: Attempts,
         extra: dict[str, Any] | None = None, charts: Sequence[dict[str, Any]] = ()) -> str:
    """Return all that `report.js` draws as JSON, `charts` first, `extra` in each run, without failed drawings."""
    runs = [_run(record, name, units, attempts) | (extra or {}) for record, name in zip(records, names)]
    kinds: list[tuple[str, Callable[[], list]]] = [
        ("the curves of forces and pressures", lambda: _loading(records, names, units)),
        ("the curves over time", lambda: _in_time(records, names, units)),
        ("the chart of corners", lambda: [_filling(records, names, units)]),
        ("the charts of the wall", lambda: _walls(records, names, units))]
    found = [one for name, draw in kinds for one in attempts.make(name, partial(_finite_of, draw), [])]
    drawn = [one for one in (*charts, *found) if one]
    return json.dumps({"runs": runs, "charts": drawn, "length": units.length or ""}, allow_nan=False,
                      separators=(",", ":"))


def _finite_of(draw: Callable[[], Any]) -> Any:
    """Return the data of a drawing that a function makes; raise `ValueError` if a number is not finite."""
    content = draw()
    json.dumps(content, allow_nan=False)
    return content


def _run(record: ReportData, name: str, units: Units, attempts: Attempts) -> dict[str, Any]:
    """Return one run's data for `report.js`: stages, and main columns, tools and sheet in each drawn state."""
    progress, frames = record.progress, record.frames
    stages = [{"name": words(record.stages[a]), "from": float(progress[a]), "to": float(progress[b - 1])}
              for a, b in record.stage_ranges]
    shown = [c for c in record.measures if c.endswith(("pressure", "travel", "pole_height", "process_time"))]
    found = {"name": name, "axisymmetric": record.axisymmetric, "stages": stages, "progress": rounded(progress[frames]),
             "stage": [record.stages[k] for k in frames],
             "numbers": {units.label(c): rounded(record.measures[c][frames]) for c in shown},
             "images": [[*scale, *shift] for scale, shift in record.planes.images(3 if record.space else 2)],
             "sheet": None, "tools": attempts.make("the drawing of the tools", partial(_tools, record), [])}
    if record.profiles[-1] is not None:
        draw = partial(_finite_of, partial(_sheet, record, units))
        found["sheet"] = attempts.make("the drawing of the section", draw, None)
    return found


def _sheet(record: ReportData, units: Units) -> dict[str, Any]:
    """Return the data of a sheet for `report.js`, at no more than 101 stations along it and in the drawn states.

    With m stations: "from" (R or Z), "material" (m,); "bottom", "top" (states, 2, m), "start", "end" (states, 2, k),
    "weights" (2, m); "fields" {label: (states, m)}.
    """
    n = len(record.profiles[-1].bottom)
    stations = np.unique(np.linspace(0, n - 1, min(n, FRAMES + 1)).round().astype(int))
    fields: dict[str, list] = {}
    frames = record.frames
    profiles = [record.profiles[k] for k in frames]
    for profile, fields_of_state in zip(profiles, [record.fields[k] for k in frames]):
        wall = profile.wall_thickness
        values = {units.label("wall"): wall, "wall / original": wall / profile.original_thickness}
        values |= {_label(record, units, key): v for key, v in fields_of_state.items()}
        for key, v in values.items():
            fields.setdefault(key, []).append(rounded(v[stations], each=True))
    last = record.profiles[-1]
    column = int(np.argmax(np.ptp(last.reference_bottom, axis=0)))          # of a parison: Z
    return {"from": "RZ"[column], "material": rounded(last.reference_bottom[stations, column]), "fields": fields,
            "bottom": [rounded(p.bottom[stations].T) for p in profiles],
            "top": [rounded(p.top[stations].T) for p in profiles],
            "start": [rounded(_edge(p, 0).T) for p in profiles], "end": [rounded(_edge(p, -1).T) for p in profiles],
            "weights": rounded(last.end_weights[:, stations])}


def _edge(profile: Any, k: int) -> np.ndarray:
    """Return the deformed edge through the wall at the start (k = 0) or end (k = -1), shape (m, 2), length."""
    edge = profile.end if k else profile.start
    return np.array([profile.bottom[k], profile.top[k]]) if edge is None else edge


def _label(record: ReportData, units: Units, key: str) -> str:
    """Return the label of a field, such as "contact pressure", with its unit."""
    return f"{key}, {record.unit}" if key == "temperature" and record.unit else units.label(key.replace(" ", "_"), key)


def _tools(record: ReportData) -> list[dict[str, Any]]:
    """Return the data of each tool of a section for `report.js`.

    "line" and, moved inwards, "shell": (2, n); "moves": displacement per travel; "travel": of each state, or None.
    """
    shapes = [p for p in record.profiles if p is not None]
    size = max((np.ptp(np.vstack([p.bottom, p.top]), axis=0).max() for p in shapes), default=1.0)
    found, frames = [], record.frames
    for k, (contact, name) in enumerate(zip(record.tooling.contacts, record.tooling.names)):
        if contact.tool.components == 3:                    # nothing of it is in a section
            continue
        line = contact.tool.surface()[0]
        shell = line + 0.02 * size * contact.tool.nearest(line).normal
        found.append({"name": name, "line": rounded(line.T), "shell": rounded(shell.T),
                      "moves": contact.travel_vector.tolist(),
                      "travel": [None if t[k] is None else float(f"{t[k]:.7g}")
                                 for t in (record.travels[i] for i in frames)]})
    return found


def _loading(records: list[ReportData], names: list[str], units: Units) -> list[dict[str, Any]]:
    """Return plotly charts of loading curves, force over travel or pressure over pole height, by run and stage."""
    pairs: dict[tuple[str, str], list[dict]] = {}
    for record, name in zip(records, names):
        for a, b in record.stage_ranges:
            of_stage = slice(a, b)
            for x, y, xs, ys in _driven(record, of_stage):
                label = " ".join(w for w in (name if len(records) > 1 else "", words(record.stages[a])) if w)
                pairs.setdefault((x, y), []).append(_trace(xs, ys, label or words(y)))
    drawn = [chart(f"{words(y).capitalize()} against {words(x)}", units.label(x), units.label(y), traces)
             for (x, y), traces in pairs.items()]
    return [chart for chart in drawn if chart]


def _driven(record: ReportData, stage: slice) -> list[tuple[str, str, np.ndarray, np.ndarray]]:
    """Return (name of x, name of y, x, y), (n,) each, for each travel and pressure that changes in a stage."""
    found, measures = [], record.measures
    for column, values in measures.items():
        if np.ptp(values[stage]) <= 1e-9 * (np.ptp(values) or 1.0):
            continue
        if column.endswith("travel"):
            name = column.removesuffix("travel").rstrip("_")
            moving = {n for n, c in zip(record.tooling.names, record.tooling.contacts) if c.direction is not None}
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


def _in_time(records: list[ReportData], names: list[str], units: Units) -> list[dict[str, Any] | None]:
    """Return plotly charts of pressures, travels, tool forces and temperatures of runs over their process time."""
    drawn: dict[str, tuple[str, list]] = {}
    for record, name in zip(records, names):
        if not record.timed:
            continue
        time, lead = record.measures["process_time"], f"{name}: " if len(records) > 1 else ""
        columns = {"Pressure": [c for c in record.measures if c.endswith("pressure")],
                   "Travel": [c for c in record.measures if c.endswith(("travel", "displacement"))]}
        for kind, found in columns.items():
            for c in found:
                drawn.setdefault(kind, (units.label(c, kind.lower()), []))[1].append(
                    _trace(time, record.measures[c], lead + words(c)))
        for tool, force in record.forces.items():
            drawn.setdefault("Force", (units.label("force"), []))[1].append(_trace(time, force, lead + tool))
        warm = [k for k in record.frames if "temperature" in record.fields[k]]
        for which, reduce in (("hottest", np.max), ("mean", np.mean), ("coldest", np.min)) if warm else ():
            values = np.array([reduce(record.fields[k]["temperature"]) for k in warm])
            drawn.setdefault("Temperature", (_label(record, units, "temperature"), []))[1].append(
                _trace(time[warm], values, lead + which))
    return [chart(f"{kind} over time", units.label("process_time"), label, traces)
            for kind, (label, traces) in drawn.items()]


def _trace(x: np.ndarray, y: np.ndarray, name: str) -> dict[str, Any]:
    """Return a curve (n,) as data of plotly, with dots at the states if there are at most 60."""
    return {"x": rounded(x), "y": rounded(y), "name": name, "marker": {"size": 4},
            "mode": "lines+markers" if len(x) <= 60 else "lines"}


def _filling(records: list[ReportData], names: list[str], units: Units) -> dict[str, Any] | None:
    """Return a plotly chart of the remaining gap in each corner of the fixed tools, or None without corners.

    The gaps are drawn over the process time if all runs have one, or else over the pressure in the last stage. `names`
    has the name of each run, for the legend.
    """
    traces, timed = [], all(record.timed for record in records)
    for record, name in zip(records, names):
        abscissa = record.measures["process_time"] if timed else next(
            (v for c, v in record.measures.items() if c.endswith("pressure")), None)
        if abscissa is None:
            continue
        drawn = [k for k in record.shown if timed or record.stages[k] == record.stages[-1]]
        for label, gaps in record.gaps(drawn).items():
            traces.append(_trace(abscissa[drawn], gaps, f"{name}: {label}" if len(records) > 1 else label))
    return chart("Gap left in the corners " + ("over time" if timed else "against pressure"),
                  units.label("process_time" if timed else "pressure"), units.label("gap"), traces)


def _walls(records: list[ReportData], names: list[str], units: Units) -> list[dict[str, Any] | None]:
    """Return two plotly charts of the wall thickness in the last state: over the height, and over the arc length.

    Both show the whole wall and, if there are several, each layer. A chart is None if no run has a profile. `names` has
    the name of each run, for the legend.
    """
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
            by_height.append({"x": rounded(values), "y": rounded(wall.height), "name": label, "mode": "lines"})
            by_length.append({"x": rounded(wall.arc_length), "y": rounded(values), "name": label, "mode": "lines"})
    label = units.label("wall")
    return [chart("Wall against height (distance in z from the pole, or from the lowest point)", label,
                   units.label("height"), by_height, zero="x"),
            chart("Wall against arc length from the axis", units.label("arc_length"), label, by_length, zero="y")]


def chart(title: str, x: str, y: str, traces: list[dict], zero: str = "", equal: bool = False) -> dict[str, Any] | None:
    """Return a chart for `report.js`, None without curves; zero: axes ("x", "y") from 0; equal: one scale."""
    if not traces:
        return None
    return {"title": title, "x": x, "y": y, "zero": zero, **({"equal": True} if equal else {}),
            "traces": [{"type": "scatter", **trace} for trace in traces]}


def rounded(values: Any, each: bool = False) -> list:
    """Return an array as nested lists, rounded to five digits of the largest number of a row, or of each."""
    values = np.asarray(values, dtype=float)
    size = np.abs(values) if each else np.abs(values).max(initial=0.0)
    unit = 10.0 ** (np.floor(np.log10(np.where(size > 0, size, 1.0))) + 1 - DIGITS)
    return [float(f"{v:.{DIGITS + 1}g}") for v in (np.round(values / unit) * unit).tolist()] if values.ndim == 1 else [
        rounded(row, each) for row in values]
