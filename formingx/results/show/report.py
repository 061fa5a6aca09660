"""One HTML file that shows a run and opens without a network: made from a path, or from a checkpoint alone."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np

from ... import figures
from ...discrete.tooling import Tooling
from ...errors import InputError
from .. import files
from ..compare import Smooth
from ..evaluate.profile import Profile
from . import plots

PENETRATION = 0.05
"""Penetration over the smallest thickness above which a report warns."""

MASS = 1e-3
"""Relative error of the mass above which a report warns."""


@dataclass
class Record:
    """A run as plain data.

    Attributes:
        summary: {part of the scene: one line}; versions: {program: version}; axisymmetric: else plane strain.
        kinds: of the states; stages: their names, "" in a run without; measures: {column: shape (n,)}.
        histories: of the n states, rows (residual, correction, work) of Newton's iterations.
        profiles: of the n states, each a `Profile`, or None.
        counts: what the run cost; until: (measure, value) that it aimed at, or None.
        tooling: the `Tooling` of the scene; travels: of the n states, `Tooling.travels`.
    """

    summary: dict[str, str]
    versions: dict[str, str]
    axisymmetric: bool
    kinds: list[str]
    stages: list[str]
    measures: dict[str, np.ndarray]
    histories: list[list]
    profiles: list[Any]
    counts: dict[str, Any]
    until: tuple[str, float] | None
    tooling: Tooling
    travels: list[list[float | None]]

    @property
    def control(self) -> str:
        """The column of what is driven."""
        return next(iter(self.measures))

    def warnings(self) -> list[str]:
        """What a reader should know before trusting the numbers."""
        found = []
        if self.until is not None and self.until[0] in self.measures:
            last, (name, value) = self.measures[self.until[0]][-1], self.until
            if abs(last - value) > 1e-6 * abs(value):
                found.append(f"The path ended early: it aimed at {_words(name)} {value:g}; its last state has"
                             f" {last:.6g}.")
        if "penetration" in self.measures:
            deep, thickness = self.measures["penetration"].max(), self._smallest_thickness()
            if thickness is not None and deep > PENETRATION * thickness:
                found.append(f"The body penetrates a tool by {deep:.3g}, {100 * deep / thickness:.2g} % of its smallest"
                             f" thickness: a larger contact penalty makes that less.")
        worst = np.abs(self.measures["mass_error"]).max()
        if worst > MASS:
            found.append(f"The mass changes by up to {100 * worst:.2g} %: a smaller eps, or a finer mesh, keeps it.")
        if self.counts.get("failures", 0) > len(self.kinds):
            found.append(f"{self.counts['failures']} attempts at a step failed and were repeated with half its length.")
        return found

    def _smallest_thickness(self) -> float | None:
        last = self.profiles[-1]
        return float(last.thickness.min()) if last is not None else None


def of_path(path: Any) -> Record:
    """The record of a `Path`; collective."""
    from ..files.description import summary
    try:
        profiles = [path.profile(state) for state in path.states]
    except InputError:
        profiles = [None] * len(path)
    problem = path.problem
    stepping: dict = next((s.stepping for s in reversed(path.states) if s.stepping), {})
    tooling = Tooling.of_problem(problem)
    return Record(summary(problem.scene), files.versions(), problem.scene.kinematics.dimension_of_volume == 3,
                  [s.kind for s in path.states], [s.stage for s in path.states], {c: path[c] for c in path.columns},
                  [list(s.history) for s in path.states], profiles, vars(path.counts), stepping.get("until"), tooling,
                  [tooling.travels(s.setting, s.control) for s in path.states])


def of_checkpoint(about: dict, states: list[dict]) -> Record:
    """The record of what `formingx.checkpoint.contents` gives."""
    stepping: dict = next((s["stepping"] for s in reversed(states) if s["stepping"]), {})
    tooling = Tooling.of_description(about["scene"])
    profiles = [s["profile"] and Profile(**{k: np.array(v) for k, v in s["profile"].items()}) for s in states]
    return Record(about["summary"], about["versions"], about["scene"]["kinematics"]["kind"] == "Axisymmetric",
                  [s["kind"] for s in states], [s["stage"] for s in states],
                  {c: np.array([s["measures"][c] for s in states]) for c in states[0]["measures"]},
                  [s["history"] for s in states], profiles, stepping.get("counts", {}), stepping.get("until"), tooling,
                  [tooling.travels(s.get("setting", {}), s["control"]) for s in states])


def write(record: Record, file: Any, title: str, failure: Any, comm: Any) -> None:
    """See `Path.report`."""
    def make():
        text = _page(record, title or "Report of a run", failure)
        files.replace(file, lambda stream: stream.write(text))
    files.on_root(comm, make)


def _page(record: Record, title: str, failure: Any) -> str:
    warnings, contacts = record.warnings(), record.tooling.contacts
    parts = [f"<h1>{html.escape(title)}</h1>", f"<p class=lead>{_lead(record)}</p>"]
    if failure is not None:
        parts.append(f"<div class='note bad'><h2>The run could not go on</h2><p>{_lines(str(failure))}</p></div>")
        shape = _drawn(lambda file: failure.diagnosis.picture(file)) if getattr(failure, "diagnosis", None) else None
        if shape:
            parts.append(_picture(shape, "The last good state, its elements coloured by J.", "small"))
    if warnings:
        parts.append("<div class=note><h2>Warnings</h2><ul>"
                     + "".join(f"<li>{html.escape(w)}</li>" for w in warnings) + "</ul></div>")
    else:
        parts.append("<p class=good>No warnings: the target was met, mass and penetration are within bounds.</p>")
    parts += ["<h2>Results</h2>", _key_numbers(record)]
    if any(record.stages):
        parts += ["<h2>Stages</h2>", _stages(record),
                  _figure(_course(record), "What is driven, and the forces on the tools, from state to state.")]
    if len(record.kinds) > 1:
        parts.append(_figure(_curves(record), "The states (dots), limit points (rings), and the path through them."))
    if record.profiles[-1] is not None:
        parts += ["<h2>Shape and thickness</h2>",
                  _figure(_shapes(record), f"Sections of the sheet{' and the tools' * bool(contacts)} along the path,"
                                           " and thickness over original thickness against the length of its deformed"
                                           " middle line from the axis.")]
        view = _view(record)
        if view:
            parts.append(_picture(view, "The last state, cut open.", "small"))
    if contacts:
        parts += ["<h2>Tools</h2>", _tools(record)]
    parts += ["<h2>Inputs</h2>", _table(["", ""], [[k, v] for k, v in record.summary.items()])]
    parts += ["<h2>Convergence</h2>"]
    if any(len(h) > 1 for h in record.histories):
        parts.append(_figure(_convergence(record), "Correction of every Newton iteration, one line a state.",
                             "small"))
    parts.append(_details("Newton's iterations, state by state", _iterations(record)))
    parts.append(_details("All states", _states(record)))
    parts += ["<h2>Made with</h2>", _table(["", ""], [[k, v] for k, v in record.versions.items()])]
    return (f"<!doctype html>\n<html lang=en><head><meta charset=utf-8><title>{html.escape(title)}</title>"
            f"<meta name=viewport content='width=device-width, initial-scale=1'><style>{_STYLE}</style></head>\n<body>"
            + "\n".join(parts) + "</body></html>\n")


_STYLE = """
body { font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; color: #1d2530;
       max-width: 60rem; margin: 2.5rem auto; padding: 0 1.2rem; }
h1 { font-size: 1.9rem; margin: 0 0 .3rem; } h2 { font-size: 1.25rem; margin: 2.2rem 0 .6rem; }
.lead { color: #55606e; margin-top: 0; }
.note { background: #fff6e0; border-left: 4px solid #e0a100; padding: .4rem 1rem; margin: 1rem 0; }
.note.bad { background: #fdeaea; border-color: #c93434; } .note h2 { margin: .3rem 0; font-size: 1.05rem; }
.good { background: #e9f6ec; border-left: 4px solid #2f9e4f; padding: .4rem 1rem; }
figure { margin: 1rem 0; } figure img { width: 100%; } figure.small img { width: 65%; display: block; margin: auto; }
figcaption { color: #55606e; font-size: .9rem; text-align: center; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92rem; }
td, th { padding: .25rem .8rem .25rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #e6e9ed; }
th { font-weight: 600; } td.number, th.number { text-align: right; }
.scroll { overflow-x: auto; } summary { cursor: pointer; margin: .6rem 0; font-weight: 600; }
@media print { details > * { display: block; } }
"""


def _lead(record: Record) -> str:
    counts = record.counts
    how = f"{len(record.kinds) - 1} states after the start"
    if counts:
        how += f", {counts['iterations']} Newton iterations, {counts['seconds']:.1f} s"
    return html.escape(f"{how}. {'Axisymmetric' if record.axisymmetric else 'Plane strain'}. Units are those of the"
                       f" script.")


def _key_numbers(record: Record) -> str:
    """The last state and the limit points, measure by measure; the thinnest place."""
    chosen = [k for k, kind in enumerate(record.kinds) if kind == "limit point"]
    head = ["", *(f"limit point {n}" for n in range(1, len(chosen) + 1)), "last state"]
    chosen.append(len(record.kinds) - 1)
    rows = [[_words(name), *(_number(values[k]) for k in chosen)] for name, values in record.measures.items()]
    if record.profiles[-1] is not None:
        ratios = [record.profiles[k].wall_ratio for k in chosen]
        rows.append(["smallest thickness / original", *(_number(r.min()) for r in ratios)])
        rows.append(["largest thickness / original", *(_number(r.max()) for r in ratios)])
    return _table(head, rows)


def _course_columns(record: Record) -> list[list[str]]:
    """Columns of what is driven, and of forces, of one kind each."""
    kinds = [[c for c in record.measures if c.endswith(end)] for end in ("pressure", "travel", "displacement", "force")]
    return [columns for columns in kinds if columns]


def _stages(record: Record) -> str:
    """Every stage: its states and iterations, and where it ended."""
    columns = [c for kind in _course_columns(record) for c in kind]
    rows = []
    for stage in dict.fromkeys(record.stages):
        mine = [k for k, s in enumerate(record.stages) if s == stage]
        iterations = sum(max(len(record.histories[k]) - 1, 0) for k in mine)
        profile = record.profiles[mine[-1]]
        ends = [_number(record.measures[c][mine[-1]]) for c in columns]
        rows.append([stage, str(len(mine) - 1), str(iterations), *ends,
                     "" if profile is None else _number(profile.wall_ratio.min())])
    return _table(["stage", "states", "iterations", *(f"{_words(c)} at its end" for c in columns),
                   "smallest thickness / original"], rows)


def _course(record: Record) -> Any:
    """What is driven, and forces, against the number of the state; stages in turn white and grey."""
    kinds = _course_columns(record)
    ends = [k for k in range(1, len(record.stages)) if record.stages[k] != record.stages[k - 1]]
    figure, axes = plots.figure(len(kinds), width=11 / len(kinds), height=3.4)
    for ax, columns in zip(np.atleast_1d(axes), kinds):
        for column in columns:
            ax.plot(record.measures[column], ".-", linewidth=1, label=_words(column))
        for a, b in zip(ends[::2], [*ends[1::2], len(record.stages)]):
            ax.axvspan(a - 0.5, b - 0.5, color="0.94", zorder=0)
        ax.set(xlabel="state")
        ax.legend(frameon=False, fontsize=8)
    return figure


def _curves(record: Record) -> Any:
    pairs = [plots.main_columns(list(record.measures))]
    others = [c for c in ("pole_stretch", "pole_height", "enclosed_volume")
              if c in record.measures and c != pairs[0][0]]
    pairs += [(c, pairs[0][1]) for c in others[:1]]
    starts, rings = ([k for k, kind in enumerate(record.kinds) if kind == which and k] for which in
                     ("start", "limit point"))             # a stage may set out in another direction
    figure, axes = plots.figure(len(pairs))
    for ax, (x, y) in zip(np.atleast_1d(axes), pairs):
        a, b = record.measures[x], record.measures[y]
        scale = [np.ptp(v) or 1.0 for v in (a, b)]
        for points in np.split(np.column_stack([a, b]) / scale, starts):
            if np.ptp(points, axis=0).any():
                ax.plot(*(Smooth(points).line * scale).T, color="C0")
        ax.plot(a, b, ".", color="C0")
        ax.plot(a[rings], b[rings], "o", color="C0", fillstyle="none", markersize=9)
        ax.set(xlabel=_words(x), ylabel=_words(y))
    return figure


def _shapes(record: Record) -> Any:
    from matplotlib import colormaps
    n = len(record.kinds)
    chosen = sorted({int(round(k)) for k in np.linspace(0, n - 1, min(n, 6))})
    figure, (left, right) = plots.figure(2)
    driven = [c for c in record.measures if c.endswith(("pressure", "travel"))]
    colours = [colormaps["viridis"](0.9 * i / max(len(chosen) - 1, 1)) for i in range(len(chosen))]
    for k, colour in zip(chosen, colours):
        profile = record.profiles[k]
        label = ", ".join(f"{_words(c)} {record.measures[c][k]:.4g}" for c in driven)
        plots.outline(profile, left, color=colour, label=label)
        right.plot(profile.arc_length, profile.wall_ratio, color=colour, label=label)
    left.set(xlabel="r", ylabel="z")
    if record.tooling.contacts:
        _draw_tools(record, left, chosen, colours)
    right.set(xlabel="arc length", ylabel="thickness / original", ylim=(0, None))
    right.legend(frameon=False, fontsize=8, loc="best")
    return figure


def _draw_tools(record: Record, axes: Any, chosen: list[int], colours: list[Any]) -> None:
    """Tools that stay, in grey; those that move, in the colours of the states, grey in the last."""
    low, high = plots.span([record.profiles[k] for k in chosen])
    mirror = all(record.profiles[k].bottom[:, 0].min() > -1e-9 * high[0] for k in chosen)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    end = record.travels[chosen[-1]]
    for k, colour in zip(chosen[:-1], colours):
        elsewhere = [travel if travel != there else None for travel, there in zip(record.travels[k], end)]
        figures.tools(axes, record.tooling.placed(elsewhere), low, high, mirror, colour, filled=False)
    figures.tools(axes, record.tooling.placed(end), low, high, mirror)


def _tools(record: Record) -> str:
    """Every contact, and where its tool is in the last state."""
    contacts, rows = record.tooling.contacts, []
    for contact, travel in zip(contacts, record.travels[-1]):
        force = record.measures.get("tool_force" if len(contacts) == 1 else f"{contact.name}_force")
        moves = "stays" if contact.moves is None else "moves along ({:g}, {:g})".format(*contact.moves)
        where = "takes no part" if travel is None else _number(travel) if contact.moves else ""
        rows.append([contact.name or "", contact.on, repr(contact.tool)[5:-1],
                     f"{contact.friction}{'' if contact.separates else ', holds what has touched'}",
                     _number(contact.penalty), moves, where, "" if force is None else _number(force[-1])])
    return _table(["tool", "face", "profile", "friction", "penalty", "motion", "travel at the end",
                   "force along z at the end"], rows)


def _view(record: Record) -> bytes | None:
    from mpi4py import MPI

    from . import views
    draw = views.revolved if record.axisymmetric else views.extruded
    return _drawn(lambda file: draw(record.profiles[-1], file, MPI.COMM_SELF))


def _drawn(draw: Callable[[Any], Any]) -> bytes | None:
    """The picture that `draw` makes as a file, or None where there is nothing to draw, or nothing to draw it with."""
    with TemporaryDirectory() as folder:
        file = FilePath(folder) / "picture.png"
        try:
            draw(file)
        except (InputError, ImportError):
            return None
        return file.read_bytes()


def _convergence(record: Record) -> Any:
    states = [SimpleNamespace(history=[SimpleNamespace(correction=row[1]) for row in h]) for h in record.histories]
    return plots.convergence(SimpleNamespace(states=states)).figure


def _iterations(record: Record) -> str:
    rows = []
    for k, (kind, history) in enumerate(zip(record.kinds, record.histories)):
        corrections = ", ".join(f"{row[1]:.1e}" for row in history[:-1])
        rows.append([str(k), kind, _number(record.measures[record.control][k]), str(max(len(history) - 1, 0)),
                     corrections, f"{history[-1][0]:.1e}" if history else ""])
    return _table(["state", "kind", _words(record.control), "iterations", "corrections", "last residual"], rows)


def _states(record: Record) -> str:
    rows = [[str(k), kind, *(_number(v[k]) for v in record.measures.values())] for k, kind in enumerate(record.kinds)]
    return _table(["state", "kind", *map(_words, record.measures)], rows)


def _table(head: list[str], rows: list[list[str]]) -> str:
    """A table; columns of numbers stand to the right; with a head of empty words: two columns of words, without it."""
    numbers = [any(head) and all(_is_number(row[k]) for row in rows) for k in range(len(head))]

    def line(tag, row):
        return "".join(f"<{tag}{' class=number' if number else ''}>{html.escape(text)}</{tag}>"
                       for text, number in zip(row, numbers))
    lines = [line("th", head)] if any(head) else []
    lines += [line("td", row) for row in rows]
    return "<div class=scroll><table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table></div>"


def _is_number(text: str) -> bool:
    try:
        float(text or 0)
    except ValueError:
        return False
    return True


def _details(title: str, content: str) -> str:
    return f"<details><summary>{html.escape(title)}</summary>{content}</details>"


def _figure(figure: Any, caption: str, kind: str = "wide") -> str:
    stream = io.BytesIO()
    figure.savefig(stream, dpi=140)
    return _picture(stream.getvalue(), caption, kind)


def _picture(png: bytes, caption: str, kind: str) -> str:
    text = html.escape(caption, quote=True)
    return (f"<figure class={kind}><img alt='{text}' src='data:image/png;base64,{base64.b64encode(png).decode()}'>"
            f"<figcaption>{text}</figcaption></figure>")


def _lines(text: str) -> str:
    return html.escape(text).replace("\n", "<br>")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _number(value: float) -> str:
    return f"{value:.6g}"
