"""HTML reports of a run of a design and of a search: walls, profiles, and effects of the parameters."""

import datetime
import html
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...contact.tooling import Tooling
from ...figures import figure, tools
from ...findings import percent, without_notes
from ...results import files
from ...results.show import page, plots
from ...results.show.attempts import Attempts
from ...results.show.report import finding_element
from ...units import Units
from .scatter import covariance_of
from .scatter import deviations as deviations_of

_RANGE = "its range, or of its start value if a bound is missing"


def of_search(result: Any, file: Any, title: str, deviations: Any, units: Units) -> FilePath:
    """Write the HTML report of a search on rank 0, and return its path; deviations: as in `covariance_of`, or None."""
    units = _units_of(result.best, units)
    before, best, (a, b) = result.before, result.best, result.cv
    effects, spread = best.sensitivities("wall"), best.spread(deviations) if deviations else None
    attainable, met, absent = result.attainable(), result.at_bounds(), result.without_effect()
    walls = [run.wall[result.inside] for run in (before, best)]
    deviation = abs(result.predicted - best.wall)[result.inside].max() / walls[1].mean()
    cards = [(f"{a:.3g} → {b:.3g}", "unevenness, standard deviation over mean of the wall"),
             (f"{walls[0].min():.4g} → {walls[1].min():.4g}", units.label("wall", "minimum wall")),
             (f"{before.volume:.4g} → {best.volume:.4g}", units.label("volume", "volume of the whole part at rest")),
             (str(result.paths), "runs were taken")]
    notes = [("bad", text) for text in [result.missed, *(f.text for f in without_notes(best.path.findings()))]]
    notes += [("", f"A run failed: {text}") for text in result.failed]
    notes += [("", f"At bounds: {', '.join(met)}.")] * bool(met)
    notes += [("", f"Without effect on the wall: {', '.join(absent)}.")] * bool(absent)
    summary = [f"Why it ended: {result.reason}.",
           f"The run before the best predicted its wall to {percent(deviation)}.",
           f"By the derivatives of the best run, these parameters could bring the unevenness to {attainable:.3g},"
           f" whatever the volume; it is {b:.3g}."]
    rows = [[str(k), *(page.number(v) for v in (run.wall[result.inside].std() / run.wall[result.inside].mean(),
             run.wall[result.inside].min(), run.wall[result.inside].mean(), run.volume))]
            for k, run in enumerate(result.runs, 1)]
    runs = page.table(["run", "unevenness", units.label("wall", "minimum wall"), units.label("wall", "mean wall"),
                       units.label("volume")], rows)

    pictures = _parts([before, best], ["before", "after"], units) | {
                "the picture of the walls": lambda: _walls(result, spread, deviations, units),
                "the picture of the profiles": lambda: _profiles(before, best),
                "the picture of the effects": lambda: _heat_map(effects, units)}
    sections = [*_uncertainties(best, deviations, units), "<h2>Runs of the search</h2>", runs]
    return _write(file, title or "Report of a design", summary, cards, notes, pictures,
                  _effects(best, effects, units, before), sections, best.path.problem.comm)


def of_run(run: Any, file: Any, title: str, deviations: Any, units: Units) -> FilePath:
    """Write the HTML report of a run on rank 0, and return its path; deviations: as in `covariance_of`, or None."""
    units = _units_of(run, units)
    effects, spread = run.sensitivities("wall"), run.spread(deviations) if deviations else None
    wall = run.wall
    cards = [(f"{wall.std() / wall.mean():.3g}", "unevenness, standard deviation over mean of the wall"),
             (f"{wall.min():.4g}", units.label("wall", "minimum wall")),
             (f"{run.volume:.4g}", units.label("volume", "volume of the whole part at rest"))]
    notes = [("bad", found.text) for found in without_notes(run.path.findings())]

    def wall_over_length() -> str:
        """Return an HTML element with the picture of the wall."""
        drawing, axes = figure(1, width=9, height=4)
        _line(axes, run, "C0", "wall", spread, deviations, units)
        return page.figure(drawing, "Wall over the reference length.")

    pictures = _parts([run], ["the part"], units) | {
                "the picture of the wall": wall_over_length,
                "the picture of the effects": lambda: _heat_map(effects, units)}
    return _write(file, title or "Report of a run", ["One run and what changes it."], cards, notes, pictures,
                  _effects(run, effects, units), _uncertainties(run, deviations, units), run.path.problem.comm)


def _units_of(run: Any, units: Units) -> Units:
    """Return the units of the labels of a run; in plane strain volumes and forces are per unit depth."""
    return units.per_depth() if run.path.scene.kinematics.dimension_of_volume == 2 else units


def _write(file: Any, title: str, summary: list[str], cards: list, notes: list, pictures: dict[str, Callable[[], str]],
           table: str, sections: list[str], comm: Any) -> FilePath:
    """Write the page of a report on rank 0, and return its path.

    Cards are (value, description) of large numbers, notes (kind, text) with the kind "bad" for warnings. `pictures` has
    functions that return HTML elements.
    """
    def make() -> None:
        """Draw the pictures and write the file."""
        attempts = Attempts()
        drawn = [attempts.make(name, draw, "") for name, draw in pictures.items()]
        body = [f"<h1>{html.escape(title)}</h1>", f"<p class=lead>{html.escape(' '.join(summary))}</p>"]
        body += [f"<div class='note{' bad' * (kind == 'bad')}'>{page.lines(text)}</div>"
                 for kind, text in notes if text]
        body.append("<div class=cards>" + "".join(
            f"<div class=card><b>{html.escape(value)}</b><span>{html.escape(what)}</span></div>"
            for value, what in cards) + "</div>")
        body += [*map(finding_element, attempts.findings), *drawn, "<h2>Parameters and their effects</h2>", table,
                 *sections, "<h2>Made with</h2>"]
        body += [page.table(
            ["", ""], [["date", datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")],
                       *([k, str(v)] for k, v in files.versions().items())])]
        files.replace(file, lambda stream: stream.write(page.page(title, body)))
    files.on_root(comm, make)
    return FilePath(file)


def _parts(runs: list[Any], names: list[str], units: Units) -> dict[str, Callable[[], str]]:
    """Return {name: function that draws the sections}; {} for parts in three dimensions, which `Path.view3d` draws."""
    return {} if runs[0].in_space else {"the picture of the part": lambda: _sections(runs, names, units)}


def _sections(runs: list[Any], names: list[str], units: Units) -> str:
    """Return an HTML figure of titled sections of `DesignRun` objects side by side, coloured by the wall thickness."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    shapes = [run.profile for run in runs]
    low, high = plots.span(shapes)
    colours = Normalize(min(s.wall_thickness.min() for s in shapes), max(s.wall_thickness.max() for s in shapes))
    aspect = (high - low)[0] / (high - low)[1]
    wide = float(np.clip(5 * aspect, 3.0, 9.0 if len(runs) == 1 else 5.5))
    drawing, axes = figure(len(runs), width=wide, height=float(np.clip(wide / aspect + 0.7, 2.4, 5.4)))
    for panel, run, shape, name in zip(np.atleast_1d(axes), runs, shapes, names):
        tooling, last = Tooling.of_problem(run.path.problem), run.path.last
        tools(panel, tooling.placed(tooling.travels(last.setting, last.control)), low, high)
        plots.section(panel, shape, (1, 1), colormaps["viridis_r"](colours(shape.wall_thickness)))
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal",
                  xlabel=units.label("r"), ylabel=units.label("z"), title=name)
    bar = drawing.colorbar(ScalarMappable(colours, "viridis_r"), ax=axes, shrink=0.8, label=units.label("wall"))
    bar.outline.set_visible(False)
    return "<h2>The part</h2>" + page.figure(drawing, "Sections, coloured by the wall.")


def _line(axes: Any, run: Any, colour: str, label: str, spread: Any, deviations: Any, units: Units) -> None:
    """Draw the wall of a run with a band of its deviation `spread` (k,), length, or None; `deviations` name it."""
    s = run.reference_length
    axes.plot(s, run.wall, "." if run.in_space else "-", color=colour, label=label)
    if spread is not None:
        sizes = np.sqrt(np.diag(covariance_of("report", run.parameters, deviations)))
        parameters = ", ".join(f"{name} ± {size:.3g}" for name, size in zip(run.parameters.names, sizes) if size)
        axes.fill_between(s, run.wall - spread, run.wall + spread, color=colour, alpha=0.2, linewidth=0,
                          label=f"± standard deviation, of {parameters}")
    axes.set(xlabel=units.label("reference_length"), ylabel=units.label("wall"), ylim=(0, None))
    axes.legend()


def _walls(result: Any, spread: Any, deviations: Any, units: Units) -> str:
    """Return an HTML figure of walls, first, best, predicted and wanted, with a band `spread` (k,), length, or None."""
    drawing, axes = figure(1, width=9, height=4)
    s = result.best.reference_length
    line, dashed = (".", ".") if result.best.in_space else ("-", "--")
    axes.plot(s, result.before.wall, line, color="0.6", label="before")
    axes.plot(s, result.predicted, dashed, color="C1", linewidth=1, label="predicted by the run before the best")
    if result.target_wall is not None:
        axes.plot(s[result.inside], result.target_wall, "k--", linewidth=1, label="wanted")
    if not np.all(result.inside):
        axes.axvspan(*s[result.inside][[0, -1]], color="0.96", zorder=0, label="what counts")
    _line(axes, result.best, "C0", "after", spread, deviations, units)
    return "<h2>The wall</h2>" + page.figure(drawing, "Wall over the reference length, before and after.")


def _profiles(before: Any, best: Any) -> str:
    """Return an HTML figure of parameters that are splines along the body, of first and best run; "" without any."""
    found = best.parameters.profiles
    if not found:
        return ""
    drawing, axes = figure(len(found), width=9 if len(found) == 1 else 5.5, height=3.6)
    for panel, (name, (low, high)) in zip(np.atleast_1d(axes), found.items()):
        s = np.linspace(0, 1, 201)
        for run, colour, label in ((before, "0.6", "before"), (best, "C0", "after")):
            profile = run.values[name]
            panel.plot(s, profile(s), color=colour, label=label)
            panel.plot(profile.coordinates, profile.values, "o", color=colour, markersize=4)
        for bound in (low, high):
            if np.isfinite(bound):
                panel.axhline(bound, color="0.5", linestyle=":", linewidth=1)
        panel.set(xlabel="part of the length", ylabel=name)
        panel.legend()
    return "<h2>The pattern</h2>" + page.figure(drawing, "Profiles and their knots, before and after; dotted: bounds.")


def _heat_map(effects: Any, units: Units) -> str:
    """Return an HTML figure: a heat map of the derivatives of the wall by all parameters, an `Effects`."""
    drawing, axes = figure(1, width=9, height=float(np.clip(1.6 + 0.28 * len(effects.names), 2.6, 9)))
    effects.plot(axes)
    axes.set(xlabel=units.label("reference_length"))
    return "<h2>What changes the wall, and where</h2>" + page.figure(
        drawing, f"Change of the wall{f' in {units.length}' if units.length else ''} that the derivatives predict where"
                 f" a parameter changes by a tenth of {_RANGE}.")


def _uncertainties(run: Any, deviations: Any, units: Units) -> list[str]:
    """Return HTML elements with standard deviations of wall, volume, pressures and forces; none without `deviations`.
    """
    if not deviations:
        return []
    covariance = covariance_of("report", run.parameters, deviations)
    wall, jacobian = run.derivative("wall")
    thin = int(np.argmin(wall))
    rows = [(units.label("wall", "mean wall"), wall.mean(), jacobian.mean(0)),
            (units.label("wall", "minimum wall"), wall[thin], jacobian[thin])]
    names = [name for name in run.path.columns if name.endswith(("force", "pressure"))]
    for name in ("volume", *names):
        value, slope = run.derivative(name)
        if np.all(np.isfinite([value[0], *slope[0]])):
            rows.append((units.label(name), value[0], slope[0]))
    table = [[name, page.number(value), f"{size:.3g}", percent(size / abs(value)) if value else ""]
             for name, value, slope in rows for size in [deviations_of(slope[None], covariance)[0]]]
    return ["<h2>How sure</h2>", page.table(["", "value", "standard deviation", ""], table),
            "<p class=lead>To first order in the uncertain parameters. The volume times the density is the weight. The"
            " covariance of a fit is that of scattered measurements: where a law misses the tests, it is off by more."
            "</p>"]


def _effects(run: Any, effects: Any, units: Units, before: Any = None) -> str:
    """Return an HTML table with the value, the bounds and the effects of every parameter.

    `before`, the first run of a search or None, adds a column with its values.
    """
    p, tenth = run.parameters, effects.jacobian * effects.sizes / 10
    thin, volume_change = int(np.argmin(effects.value)), run.derivative("volume")[1][0] * p.size / 10
    head = ["", *(["before", "after"] if before else ["value"]), "lower bound", "upper bound",
            units.label("wall", "mean wall"), units.label("wall", "minimum wall"),
            units.label("wall", "largest change"), units.label("volume")]
    most = tenth[abs(tenth).argmax(0), np.arange(len(p))]
    rows = [[name, *([page.number(before.vector[k])] if before else []),
             page.number(run.vector[k]), *(page.number(v) if np.isfinite(v) else "" for v in (p.low[k], p.high[k])),
             *(f"{v:.3g}" for v in (tenth[:, k].mean(), tenth[thin, k], most[k], volume_change[k]))]
            for k, name in enumerate(p.names)]
    return page.table(head, rows) + (f"<p class=lead>Changes when a parameter changes by a tenth of {_RANGE}, to first"
                                     f" order: of the mean and of the minimum wall, the largest anywhere, of the"
                                     f" volume.</p>")
