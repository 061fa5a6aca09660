"""HTML reports of a design run and of a search: walls, profiles, derivatives."""

import datetime
import html
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...contact.tooling import Tooling
from ...figures import figure, tools
from ...findings import alarming
from ...results import files
from ...results.show import page, plots
from ...units import Units
from .scatter import covariance_of
from .scatter import deviations as deviations_of


def of_answer(answer: Any, file: Any, title: str, deviations: Any, units: Units) -> FilePath:
    """Write the report of a search; see `Answer.report`.

    Args:
        answer: result of the search.
        file: path of the file.
        title: heading of the page.
        deviations: standard deviations of the parameters, or None.
        units: units of the labels.

    Returns:
        Path of the file.
    """
    units = _of_scene(answer.best, units)
    before, best, (a, b) = answer.before, answer.best, answer.cv
    effects, spread = best.sensitivities("wall"), best.spread(deviations) if deviations else None
    attainable, met, absent = answer.attainable(), answer.at_bounds(), answer.without_effect()
    walls = [run.wall[answer.inside] for run in (before, best)]
    off = abs(answer.predicted - best.wall)[answer.inside].max() / walls[1].mean()
    cards = [(f"{a:.3g} → {b:.3g}", "unevenness, standard deviation over mean of the wall"),
             (f"{walls[0].min():.4g} → {walls[1].min():.4g}", units.label("wall", "minimum wall")),
             (f"{before.volume:.4g} → {best.volume:.4g}", units.label("volume", "volume of the whole part at rest")),
             (str(answer.paths), "runs were taken")]
    said = [("bad", text) for text in [answer.lack, *(f.text for f in alarming(best.path.findings()))]]
    said += [("", f"A run failed: {text}") for text in answer.failed]
    said += [("", f"At bounds: {', '.join(met)}.")] * bool(met)
    said += [("", f"Without effect on the wall: {', '.join(absent)}.")] * bool(absent)
    how = [f"Why it ended: {answer.why}.",
           f"The run before the best predicted its wall to {100 * off:.2g} %.",
           f"By the derivatives of the best run, these parameters could bring the unevenness to {attainable:.3g},"
           f" whatever the volume; it is {b:.3g}."]
    rows = [[str(k), *(page.number(v) for v in (run.wall[answer.inside].std() / run.wall[answer.inside].mean(),
             run.wall[answer.inside].min(), run.wall[answer.inside].mean(), run.volume))]
            for k, run in enumerate(answer.runs, 1)]
    runs = page.table(["run", "unevenness", units.label("wall", "minimum wall"), units.label("wall", "mean wall"),
                       units.label("volume")], rows)

    def pictures() -> list[str]:
        """Return the pictures of a search as HTML."""
        return [_sections([before, best], ["before", "after"], units),
                _walls(answer, spread, deviations, units), _patterns(before, best), _heat_map(effects, units)]
    tail = [*_sure(best, deviations, units), "<h2>Runs of the search</h2>", runs]
    return _write(file, title or "Report of a design", how, cards, said, pictures,
                  _effects(best, effects, units, before), tail, best.path.problem.comm)


def of_run(run: Any, file: Any, title: str, deviations: Any, units: Units) -> FilePath:
    """Write the report of a run; see `DesignRun.report`.

    Args:
        run: the run.
        file: path of the file.
        title: heading of the page.
        deviations: standard deviations of the parameters, or None.
        units: units of the labels.

    Returns:
        Path of the file.
    """
    units = _of_scene(run, units)
    effects, spread = run.sensitivities("wall"), run.spread(deviations) if deviations else None
    wall = run.wall
    cards = [(f"{wall.std() / wall.mean():.3g}", "unevenness, standard deviation over mean of the wall"),
             (f"{wall.min():.4g}", units.label("wall", "minimum wall")),
             (f"{run.volume:.4g}", units.label("volume", "volume of the whole part at rest"))]
    said = [("bad", found.text) for found in alarming(run.path.findings())]

    def pictures() -> list[str]:
        """Return the pictures of a run as HTML."""
        drawing, axes = figure(1, width=9, height=4)
        _line(axes, run, "C0", "wall", spread, deviations, units)
        return [_sections([run], ["the part"], units), page.figure(drawing, "Wall over the reference length."),
                _heat_map(effects, units)]
    return _write(file, title or "Report of a run", ["One run and what changes it."], cards, said, pictures,
                  _effects(run, effects, units), _sure(run, deviations, units), run.path.problem.comm)


def _of_scene(run: Any, units: Units) -> Units:
    """Return the units of the labels, per unit depth in plane strain."""
    return units.per_depth() if run.path.scene.kinematics.dimension_of_volume == 2 else units


def _write(file: Any, title: str, how: list[str], cards: list, said: list, pictures: Any, table: str, tail: list[str],
           comm: Any) -> FilePath:
    """Write an HTML page on rank 0."""
    def make() -> None:
        """Write the page."""
        body = [f"<h1>{html.escape(title)}</h1>", f"<p class=lead>{html.escape(' '.join(how))}</p>"]
        body += [f"<div class='note{' bad' * (kind == 'bad')}'>{page.lines(text)}</div>" for kind, text in said if text]
        body.append("<div class=cards>" + "".join(
            f"<div class=card><b>{html.escape(value)}</b><span>{html.escape(what)}</span></div>"
            for value, what in cards) + "</div>")
        body += [*pictures(), "<h2>Parameters and their effects</h2>", table, *tail, "<h2>Made with</h2>", page.table(
            ["", ""], [["date", datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")],
                       *([k, str(v)] for k, v in files.versions().items())])]
        files.replace(file, lambda stream: stream.write(page.page(title, body)))
    files.on_root(comm, make)
    return FilePath(file)


def _sections(runs: list[Any], names: list[str], units: Units) -> str:
    """Draw the parts side by side, coloured by their wall."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    shapes = [run.profile for run in runs]
    low, high = plots.span(shapes)
    colours = Normalize(min(s.wall_thickness.min() for s in shapes), max(s.wall_thickness.max() for s in shapes))
    wide = float(np.clip(5 * (high - low)[0] / (high - low)[1], 3.0, 9.0))
    drawing, axes = figure(len(runs), width=wide, height=max(5 * wide / 9, 3.2) if wide == 9 else 5.4)
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
    """Draw a wall over the reference length, with its standard deviation."""
    s = run.profile.reference_length
    axes.plot(s, run.wall, color=colour, label=label)
    if spread is not None:
        sizes = np.sqrt(np.diag(covariance_of("report", run.parameters, deviations)))
        said = ", ".join(f"{name} ± {size:.3g}" for name, size in zip(run.parameters.names, sizes) if size)
        axes.fill_between(s, run.wall - spread, run.wall + spread, color=colour, alpha=0.2, linewidth=0,
                          label=f"± standard deviation, of {said}")
    axes.set(xlabel=units.label("reference_length"), ylabel=units.label("wall"), ylim=(0, None))
    axes.legend()


def _walls(answer: Any, spread: Any, deviations: Any, units: Units) -> str:
    """Draw the walls of a search."""
    drawing, axes = figure(1, width=9, height=4)
    s = answer.best.profile.reference_length
    axes.plot(s, answer.before.wall, color="0.6", label="before")
    axes.plot(s, answer.predicted, "--", color="C1", linewidth=1, label="predicted by the run before the best")
    if answer.wanted is not None:
        axes.plot(s[answer.inside], answer.wanted, "k--", linewidth=1, label="wanted")
    if not np.all(answer.inside):
        axes.axvspan(*s[answer.inside][[0, -1]], color="0.96", zorder=0, label="what counts")
    _line(axes, answer.best, "C0", "after", spread, deviations, units)
    return "<h2>The wall</h2>" + page.figure(drawing, "Wall over the reference length, before and after.")


def _patterns(before: Any, best: Any) -> str:
    """Draw every profile over its knots."""
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
    """Draw the effects of the parameters on the wall."""
    drawing, axes = figure(1, width=9, height=float(np.clip(1.6 + 0.28 * len(effects.names), 2.6, 9)))
    effects.plot(axes)
    return "<h2>What changes the wall, and where</h2>" + page.figure(
        drawing, f"Change of the wall{f' in {units.length}' if units.length else ''} that the derivatives predict where"
                 f" a parameter changes by a tenth of its range.")


def _sure(run: Any, deviations: Any, units: Units) -> list[str]:
    """Return a table of the standard deviations of walls, volume, pressures and forces; empty without uncertainties."""
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
    table = [[name, page.number(value), f"{size:.3g}", f"{100 * size / abs(value):.2g} %" if value else ""]
             for name, value, slope in rows for size in [deviations_of(slope[None], covariance)[0]]]
    return ["<h2>How sure</h2>", page.table(["", "value", "standard deviation", ""], table),
            "<p class=lead>To first order in the uncertain parameters. The volume times the density is the weight. The"
            " covariance of a fit is that of scattered measurements: where a law misses the tests, it is off by more."
            "</p>"]


def _effects(run: Any, effects: Any, units: Units, before: Any = None) -> str:
    """Return a table with a row for every parameter."""
    p, tenth = run.parameters, effects.jacobian * effects.sizes / 10
    thin, grows = int(np.argmin(effects.value)), run.derivative("volume")[1][0] * p.size / 10
    head = ["", *(["before", "after"] if before else ["value"]), "least", "most", units.label("wall", "mean wall"),
            units.label("wall", "minimum wall"), units.label("wall", "largest change"), units.label("volume")]
    most = tenth[abs(tenth).argmax(0), np.arange(len(p))]
    rows = [[name, *([page.number(before.vector[k])] if before else []),
             *(page.number(v) for v in (run.vector[k], p.low[k], p.high[k])),
             *(f"{v:.3g}" for v in (tenth[:, k].mean(), tenth[thin, k], most[k], grows[k]))]
            for k, name in enumerate(p.names)]
    return page.table(head, rows) + ("<p class=lead>Changes that a tenth of the range of a parameter makes, to first"
                                     " order: of the mean and of the minimum wall, the largest anywhere, of the volume."
                                     "</p>")
