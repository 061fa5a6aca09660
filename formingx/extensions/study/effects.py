"""Figures of a parameter study: main effects, Pareto fronts, and an HTML page of both."""

import html
import itertools
from typing import Any

from ...figures import figure
from ...results.show import page as pages


def main_effects(runs: list[Any], effects: dict[str, dict[float, float]], measure: str) -> Any:
    """Draw the main effects on a measure: one panel per variable, runs as dots, the mean at each level as a line.

    Args:
        runs: the successful runs (`StudyRun`).
        effects: result of `Study.effects` for this measure.
        measure: name of the measure.

    Returns:
        The matplotlib figure.
    """
    drawing, axes = figure(len(effects), width=3.8, height=3.4)
    for ax, (variable, levels) in zip([axes] if len(effects) == 1 else axes, effects.items()):
        ax.plot([run.values[variable] for run in runs], [run.measures[measure] for run in runs], ".", color="0.75")
        ax.plot(list(levels), list(levels.values()), "o-", color="C0")
        ax.set(xlabel=variable.replace("_", " "), ylabel=measure.replace("_", " "))
        ax.locator_params("x", nbins=6)                     # or the numbers of a single level run into each other
    return drawing


def pareto(runs: list[Any], front: list[Any], a: str, b: str) -> Any:
    """Draw two measures of all runs as dots, with the Pareto front as a line.

    Args:
        runs: the successful runs (`StudyRun`).
        front: runs of the Pareto front, in order.
        a: name of the first measure.
        b: name of the second measure.

    Returns:
        The matplotlib figure.
    """
    drawing, axes = figure()
    axes.plot([run.measures[a] for run in runs], [run.measures[b] for run in runs], ".", color="0.75")
    axes.plot([run.measures[a] for run in front], [run.measures[b] for run in front], "o-", color="C3")
    axes.set(xlabel=a.replace("_", " "), ylabel=b.replace("_", " "))
    return drawing


def page(study: Any, title: str) -> str:
    """Return the HTML page of `Study.report`: best run, main effects, Pareto fronts, all runs.

    Args:
        study: the `Study`.
        title: heading of the page.

    Returns:
        HTML text.
    """
    body = [f"<h1>{html.escape(title)}</h1>", f"<p class=lead>{pages.lines(str(study))}</p>"]
    if study.goal and study.successful:
        best = study.best
        body += ["<h2>Best</h2>", pages.table(["", ""], [[k, pages.number(v)] for k, v in
                                                         {**best.values, **best.measures}.items()])]
    for measure in study.measures if study.successful else ():
        caption = f"Main effects on {measure.replace('_', ' ')}: runs (dots), means at each level."
        body.append(pages.figure(study.plot_effects(measure), caption))
    for a, b in itertools.combinations(study.goal, 2) if study.successful else ():
        body.append(pages.figure(study.plot_pareto(a, b), f"{a} and {b}: no run beats the red ones in both.", "small"))
    head, columns = list(study.columns), list(study.columns.values())
    rows = [[v if isinstance(v, str) else pages.number(v) for v in row] for row in zip(*columns)]
    return pages.page(title, [*body, "<h2>All runs</h2>", pages.table(head, rows)])
