"""Report on one or several runs: one HTML file that needs no network.

It shows findings, the process as animated drawings, key numbers, curves, tools and inputs. Sections with numerical
details open by a click. A report is made from paths, or from checkpoints without the scene. The file contains plotly.js
and the data in compressed form.
"""

import datetime
import html
import importlib.metadata
import re
from collections.abc import Callable, Sequence
from functools import partial
from importlib import resources
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError, as_list
from ...findings import Finding, percent
from ...units import NONE, Units
from .. import files
from ..evaluate.part import Part, part
from ..evaluate.wall import Wall
from . import interactive, page
from .attempts import Attempts
from .report_data import CONTROLS, ReportData, of_checkpoint, of_path, words


def report(runs: Sequence[Any], file: Any = "report.html", title: str = "", *, names: Sequence[str] | None = None,
           units: Units = NONE, density: float | None = None, trim: Any = None) -> FilePath:
    """Write one HTML file that shows runs side by side (rank 0 writes).

    Args:
        runs: paths, or folders of checkpoints.
        file: its name ends in .html.
        title: heading of the page.
        names: names of the runs; default 1, 2, ...
        units: units of the scripts, for the labels.
        density: density in g/cm3, for the weights in grams.
        trim: radius at which parts are cut off, or ("height", h), length; default not cut.

    Returns:
        The path of the file.

    Raises:
        InputError: there is no run, or the number of names differs. The name of the file has another ending, a folder
            is no checkpoint, or plotly is not installed.
        OSError: the file cannot be written.

    >>> fx.report([path], "report.html", "A disc inflated", units=fx.Units(length="mm", stress="MPa")).name
    'report.html'
    """
    from ..files import checkpoint_data
    runs = as_list("report: runs", runs, "paths or folders of checkpoints")
    names = [f"run {k}" for k in range(1, len(runs) + 1)] if names is None else as_list("report: names", names, "words")
    if not runs or len(names) != len(runs):
        raise InputError(f"report: {len(runs)} runs and {len(names)} names: give at least one run, and a name for each")
    records = [of_path(run) if hasattr(run, "problem") else of_checkpoint(*checkpoint_data.contents(run))
               for run in runs]
    comm = next((run.problem.comm for run in runs if hasattr(run, "problem")), MPI.COMM_WORLD)
    return write(records, file, title or "Runs side by side", None, comm, units, density, trim, names)


def write(records: ReportData | list[ReportData], file: Any, title: str, failure: Any, comm: Any, units: Units = NONE,
          density: float | None = None, trim: Any = None, names: list[str] | None = None) -> FilePath:
    """Write the report of one or several records, and return its path (`report`, `Path.report`).

    The density is in g/cm3, a trim is a radius or ("height", h), length. Another ending, no plotly, or a density
    without a sheet is an InputError, a failed file an OSError.
    """
    records = [records] if isinstance(records, ReportData) else records
    names, file = names or [title or "run"], files.named("report", file, ".html", ".htm")

    units = units.per_depth() if all(record.per_depth for record in records) else units

    def make():
        refusing = Attempts(InputError)
        parts = [refusing.make("the table of key numbers", partial(_part, record, units, density, trim), None)
                 for record in records]
        text = _page(records, names, parts, title or "Report of a run", failure, units, refusing.findings)
        files.replace(file, lambda stream: stream.write(text))
    files.on_root(comm, make)
    return FilePath(file)


def _part(record: ReportData, units: Units, density: float | None, trim: Any) -> Part | None:
    """Return the key numbers of a section's last state, else None or, with density or trim, an InputError."""
    if record.profiles[-1] is None:
        if density is not None or trim is not None:
            raise InputError(f"report: {'density' if density is not None else 'trim'}: "
                             + (_NO_MESH if record.space else "the mesh is not a sheet: it has no wall and no part"))
        return None
    return part(Wall(record.profiles[-1], record.layers, None), record.axisymmetric, density, trim, (), units,
                record.planes)


def _page(records: list[ReportData], names: list[str], parts: list, title: str, failure: Any, units: Units,
          findings: list[Finding]) -> str:
    """Return the report as an HTML page.

    `parts`: `Part` or None of each run; `failure`: the error that ended it, or None; `findings`: on failed parts.
    """
    alone, attempts = len(records) == 1, Attempts()
    body = [f"<h1>{html.escape(title)}</h1>", f"<p class=lead>{introduction(records[0], units)}</p>"]
    for record, name in zip(records, names):
        body += _trouble(failure or record.failure, "" if alone else f"{name}: ", attempts)
    body += [_warnings(record, "" if alone else f"{name}: ") for record, name in zip(records, names)]
    place = len(body)
    body.append(PROCESS)
    if alone:
        body.append(attempts.make("the main numbers", lambda: _cards(records[0], parts[0], units), ""))
    body += ["<h2>Key numbers</h2>", attempts.make(
        "the table of key numbers", lambda: _answers(records, names, parts, units), ""),
             "<h2>Curves</h2><div id=charts class=grid></div>"]
    for record, name in zip(records, names):
        body += [] if alone else [f"<h2>{html.escape(name)}</h2>"]
        body += _details(record, units, attempts)
    body += ["<h2>Made with</h2>", page.table(["", ""], versions(records))]
    drawn = interactive.data(records, names, units, attempts)
    body[place:place] = map(finding_element, [*findings, *attempts.findings])
    return page.page(title, body, scripts(drawn))


def scripts(data: str) -> str:
    """Return the scripts at the end of a page as HTML, which draw the JSON text of `interactive.data`."""
    packed = (("library", interactive.library()), ("data", interactive.packed(data)))
    code = resources.files(__package__).joinpath("report.js").read_text()
    tail = "".join(f"\n<script type='text/plain' id={name}>{text}</script>" for name, text in packed)
    return f"{tail}\n<script>{code}</script>"


_NO_MESH = ("the checkpoint of a sheet in three dimensions holds no mesh: its part and pictures are in the report of"
            " the path, fx.load(folder, scene).report()")
PROCESS = """<p id=trouble class='note bad' hidden>This browser cannot draw what follows (it needs DecompressionStream
and WebGL: Chrome 80, Firefox 113, Safari 16.4 or later); the tables need nothing.</p>
<div id=process><div class=controls><button id=play>Play</button>
<label>Colour: <select id=colour></select></label>
<label>Run: <select id=run></select></label></div>
<input id=slider type=range min=0 max=1000 value=1000 aria-label='progress of the process'>
<div id=marks></div><div id=now></div>
<div class=views><div id=section></div><div id=solid></div></div></div>"""


def _trouble(failure: Any, lead: str, attempts: Attempts) -> list[str]:
    """Return the error message of a failed run as HTML, with a picture of its last admissible state.

    `lead` is the text before the heading, such as the name of the run. `attempts` collects the error of a picture.
    """
    if not failure:
        return []
    found = [f"<div class='note bad'><h2>{html.escape(lead)}The run could not go on</h2>"
             f"<p>{page.lines(str(failure))}</p></div>"]
    shape = attempts.make("the picture of the last good state", lambda: _drawn(failure.diagnosis.picture), None
                          ) if getattr(failure, "diagnosis", None) else None
    return found + ([page.picture(shape, "The last good state, its elements coloured by J.", "small")] if shape else [])


def _details(record: ReportData, units: Units, attempts: Attempts) -> list[str]:
    """Return the page's sections below the curves: stages, tools, inputs, output quantities, convergence and states."""
    def table(name: str, make: Callable[[ReportData, Units], str]) -> str:
        """Return a table of the run as HTML, or "" if it fails; name: name for the finding."""
        return attempts.make(name, lambda: make(record, units), "")

    found = []
    if any(record.stages):
        found += ["<h2>Stages</h2>", table("the table of stages", _stages)]
    if record.tooling.contacts:
        found += ["<h2>Tools</h2>", table("the table of tools", _tools)]
    found.append(attempts.make("the table of jumps", lambda: jumps(record), ""))
    found += ["<h2>Inputs</h2>", page.table(["", ""], [[k, v] for k, v in record.summary.items()])]
    found.append(page.details("All output quantities at limit points and at the end",
                              table("the table of output quantities", _key_numbers)))
    if record.limits:
        found.append("<p>Reasons for shorter or failed steps: " + html.escape(", ".join(
            f"{reason} ({times} times)" for reason, times in record.limits.items())) + ".</p>")
    found.append(page.details("Convergence", attempts.make("the picture of convergence", lambda: _convergence(record),
                                                           "") + table("the table of iterations", _iterations)))
    shown = "States that are drawn" if len(record.frames) < len(record.kinds) else "All states"
    found.append(page.details(shown, table("the table of states", _states)))
    return found


def _warnings(record: ReportData, lead: str = "") -> str:
    """Return findings on a run, or that there are none, as HTML: two lines, after `lead`, the rest by a click."""
    findings = record.all_findings()
    if record.space:
        lead = f"<p class=note>{html.escape(lead)}Only curves and inputs are shown: {_NO_MESH}.</p>"
        return lead + "".join(map(finding_element, findings))
    if not findings:
        return (f"<p class=good>{html.escape(lead)}No warnings: the target was met. Mass, volume of the elements and"
                f" penetration are within bounds. No face crosses another or the axis.</p>")
    return "".join(finding_element(found._replace(text=lead + found.text)) for found in findings)


def finding_element(found: Finding) -> str:
    """Return a finding as an HTML element; the page shows two lines, and after a click the whole text."""
    return (f"<details class='note{' bad' if found.severity != 'note' else ''}'><summary><b>{found.severity}</b>:"
            f" {html.escape(found.text)}</summary></details>")


def versions(records: list[ReportData]) -> list[list[str]]:
    """Return rows (name, value): date of the report, scripts of the runs, and versions of programs."""
    try:
        version = importlib.metadata.version("formingx")
    except importlib.metadata.PackageNotFoundError:
        version = "source tree, not installed"
    scripts = dict.fromkeys(record.script for record in records if record.script)
    return [["date", datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")],
            *([["script", ", ".join(scripts)]] if scripts else []), ["formingx", version],
            *([k, v] for k, v in records[0].versions.items())]


def _cards(record: ReportData, found: Part | None, units: Units) -> str:
    """Return the main numbers of the part and of the run as HTML, in large digits."""
    cards = []
    if found is not None:
        length = f" {units.length}" if units.length else ""
        walls = [(f"{found.min_wall:.4g}{length}", f"minimum wall, at r = {found.min_wall_at[0]:.4g}{length}"),
                 (f"{found.uniformity:.3g}", "minimum over mean wall")]
        cards = [*(walls if found.min_wall == found.min_wall else []),
                 (f"{found.weight:.4g} {found.units.weight}", found.weight_label) if found.weight is not None else
                 (f"{found.volume:.{4 if found.volume < 1e4 else 6}g} {units.volume}", "volume of the part")]
    cards += [(value, what) for what, value in _peaks(record, units)]
    return "<div class=cards>" + "".join(f"<div class=card><b>{html.escape(value.strip())}</b><span>{html.escape(what)}"
                                         f"</span></div>" for value, what in cards) + "</div>"


def _peaks(record: ReportData, units: Units) -> list[tuple[str, str]]:
    """Return a row (name, value of largest magnitude in the run) for the force on each tool and for each pressure."""
    found = [(f"largest force on {name}", force, units.force) for name, force in record.forces.items()]
    found += [(f"largest {words(c)}", v, units.unit_of(c)) for c, v in record.measures.items()
              if c.endswith("pressure")]
    return [(name, f"{v[np.argmax(np.abs(v))]:.4g} {unit}".rstrip()) for name, v, unit in found]


def _answers(records: list[ReportData], names: list[str], parts: list, units: Units) -> str:
    """Return an HTML table of key numbers of parts (or None), forces and pressures, one column per run."""
    columns = [dict((found.rows if found is not None else []) + _peaks(record, units))
               for record, found in zip(records, parts)]
    rows = [[what, *(column.get(what, "") for column in columns)] for what in dict.fromkeys(
        what for column in columns for what in column)]
    return page.table(["", *names] if len(records) > 1 else ["", ""], rows)


def introduction(record: ReportData, units: Units) -> str:
    """Return sentences on states, iterations, kinematics and units of a run, as HTML."""
    counts = record.counts
    size = f"{len(record.kinds) - 1} states after the start"
    if counts:
        size += f", {counts['iterations']} Newton iterations, {counts['seconds']:.1f} s"
    jumps = record.kinds.count("jump")
    if jumps:
        size += f", {jumps} jump{'s' * (jumps > 1)}, where the body snapped to its next equilibrium"
    names = f"Lengths in {units.length}, stresses in {units.stress}, forces in {units.force}." if units.force else \
        "Units are those of the script."
    kind = "Sheet in three dimensions" if record.space else "Axisymmetric" if record.axisymmetric else "Plane strain"
    basis = record.planes.basis((units.length or "unit") if record.per_depth else None)
    basis = f" Forces, energies, volumes and areas are given for {basis}." if basis else ""
    return html.escape(f"{size}. {kind}. {names}{basis}")


def _key_numbers(record: ReportData, units: Units) -> str:
    """Return an HTML table of quantities and extreme walls over the original in limit points and the last state."""
    chosen = [k for k, kind in enumerate(record.kinds) if kind == "limit point"]
    head = ["", *(f"limit point {n}" for n in range(1, len(chosen) + 1)), "last state"]
    chosen.append(len(record.kinds) - 1)
    rows = [[units.label(name), *(page.number(values[k]) for k in chosen)] for name, values in record.measures.items()]
    if record.profiles[-1] is not None:
        ratios = [record.profiles[k].wall_ratio for k in chosen]
        rows.append(["smallest wall / original thickness", *(page.number(r.min()) for r in ratios)])
        rows.append(["largest wall / original thickness", *(page.number(r.max()) for r in ratios)])
    return page.table(head, rows)


def _stages(record: ReportData, units: Units) -> str:
    """Return an HTML table of stages: states, iterations, final controls, largest forces and gap, smallest wall."""
    columns = [c for end in CONTROLS for c in record.measures if c.endswith(end)]
    columns += ["process_time"] * record.timed
    rows, extra = [], [units.label("force", f"largest force on {name}") for name in record.forces]
    for stage in dict.fromkeys(record.stages):
        mine = [k for k, s in enumerate(record.stages) if s == stage]
        iterations = sum(max(len(record.histories[k]) - 1, 0) for k in mine)
        last = record.profiles[mine[-1]]
        gap = max((v[0] for v in record.gaps([mine[-1]]).values()), default=None) if last is not None else None
        rows.append([words(stage), str(len(mine) - 1), str(iterations), *(page.number(record.measures[c][mine[-1]])
                     for c in columns), *(page.number(max(f[mine], key=abs), np.abs(f).max()) for f in
                     record.forces.values()), "" if gap is None else page.number(gap),
                     "" if last is None else page.number(last.wall_ratio.min())])
    return page.table(["stage", "states", "iterations of accepted steps",
                       *(units.label(c, f"{words(c)} at its end") for c in columns), *extra,
                       units.label("gap", "largest gap in a corner"), "smallest wall / original thickness"], rows)


def jumps(record: ReportData) -> str:
    """Return an HTML explanation of the jumps of a run, with a row for each; "" without any."""
    columns = [c for c in record.measures if not c.endswith(("error", "process_time"))]
    ranges = {c: float(np.ptp(record.measures[c])) for c in columns}
    rows = []
    for k, kind in enumerate(record.kinds):
        if kind == "jump" and k:
            changes = {c: abs(float(record.measures[c][k] - record.measures[c][k - 1])) / ranges[c]
                       for c in columns if ranges[c] > 0}
            column = max(changes, key=lambda c: changes[c], default="")
            rows.append([str(k), words(record.stages[k]), record.control_text(k),
                         f"{words(column)}, by {percent(changes[column])} of its range" if column else ""])
    if not rows:
        return ""
    text = ("In a jump the control is constant, and the body moves to its next equilibrium, because none is near. A"
            " sheet snaps so past a limit point. In contact, points that leave a tool or slide off an edge cause jumps,"
            " which are small. The last column says how far each jump went in the run.")
    return page.details(f"{'The jump' if len(rows) == 1 else f'The {len(rows)} jumps'}: what happened, and where",
                        f"<p>{text}</p>" + page.table(["state", "stage", "control", "largest change"], rows))


def _tools(record: ReportData, units: Units) -> str:
    """Return an HTML table of the contacts, with the travel of each tool and the force on it in the last state."""
    rows = []
    for contact, name, travel in zip(record.tooling.contacts, record.tooling.names, record.travels[-1]):
        force = record.forces.get(name)
        along = ", ".join(f"{x:g}" for x in contact.direction or ())
        motion = f"moves along ({along})" if along else "fixed"
        where = "inactive" if travel is None else page.number(travel) if contact.direction else ""
        rows.append([contact.name or "", contact.on, re.sub(r"^Tool\((.*)\)$", r"\1", repr(contact.tool)),
                     f"{contact.friction}{'' if contact.separates else ', no separation'}",
                     page.number(contact.penalty), motion, where, "" if force is None else page.number(force[-1])])
        if record.heat:
            conductance, warm = record.heat.get(contact.name or "", (0.0, "no heat transfer"))
            rows[-1] += [warm, page.number(conductance)]
    head = ["tool", "face", "profile", "friction", "penalty", "motion", units.label("travel", "travel at the end"),
            units.label("force", "force at the end")]
    head += [f"temperature, {record.unit}", "conductance"] if record.heat else []
    return page.table(head, rows) + (
        "<p class=lead>The force on a moving tool is positive if it resists the travel. The force on a fixed tool is"
        " its z component.</p>")


def _drawn(draw: Callable[[Any], Any]) -> bytes | None:
    """Return a PNG picture as bytes; None if there is nothing to draw or a library is missing."""
    with TemporaryDirectory() as folder:
        file = FilePath(folder) / "picture.png"
        try:
            draw(file)
        except (InputError, ImportError):
            return None
        return file.read_bytes()


def _convergence(record: ReportData) -> str:
    """Return an HTML figure of the relative correction over Newton iterations, a line per state; "" without any."""
    lines = [[row[1] for row in history if row[1] > 0] for history in record.histories]
    return page.logarithmic(lines, "Newton iteration", "correction |\u0394x|/|x|",
                            "Correction of every Newton iteration, one line per state.") if any(lines) else ""


def _iterations(record: ReportData, units: Units) -> str:
    """Return an HTML table of the Newton iterations of each state that the report draws.

    A row has the control, the relative correction of the unknowns in each iteration, and the last residual.
    """
    controls = {k: record.control(k) for k in record.frames}
    rows, columns = [], list(dict.fromkeys(controls.values()))
    for k, control in controls.items():
        kind, history = record.kinds[k], record.histories[k]
        corrections = ", ".join(f"{row[1]:.1e}" for row in history[:-1])
        rows.append([str(k), kind, *(page.number(record.measures[c][k]) if c == control else "" for c in columns),
                     str(max(len(history) - 1, 0)), corrections, f"{history[-1][0]:.1e}" if history else ""])
    head = ["state", "kind", *map(units.label, columns), "iterations", "corrections", "last residual"]
    return page.table(head, rows)


def _states(record: ReportData, units: Units) -> str:
    """Return an HTML table of all output quantities (columns) in the drawn states."""
    rows = [[str(k), record.kinds[k], *(page.number(v[k]) for v in record.measures.values())] for k in record.frames]
    return page.table(["state", "kind", *map(units.label, record.measures)], rows)


