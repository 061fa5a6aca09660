"""Figures of a parameter study: main effects, Pareto fronts, and an HTML page of both."""

import html
import itertools
from typing import Any

import numpy as np

from ...figures import figure
from ...results.show import page as pages

_GAP = 3.0
"""Distance of two runs of a Pareto front, over the median distance, above which no line is drawn between them."""


def main_effects(runs: list[Any], effects: dict[str, dict[float, float]], measure: str,
                 labels: dict[str, str]) -> Any:
    """Return a figure of the main effects on a measure: one panel per variable, runs as dots, the means as a line."""
    drawing, axes = figure(len(effects), width=3.8, height=3.4)
    for ax, (variable, levels) in zip([axes] if len(effects) == 1 else axes, effects.items()):
        ax.plot([run.values[variable] for run in runs], [run.measures[measure] for run in runs], ".", color="0.75")
        ax.plot(list(levels), list(levels.values()), "o-", color="C0")
        ax.set(xlabel=labels[variable], ylabel=labels[measure])
        ax.locator_params("x", nbins=6)                     # or the numbers of a single level run into each other
    return drawing


def pareto(runs: list[Any], front: list[Any], a: str, b: str, labels: dict[str, str]) -> Any:
    """Return a figure of two measures, a and b, of all runs as dots, with the ordered Pareto front as a line."""
    drawing, axes = figure()
    axes.plot([run.measures[a] for run in runs], [run.measures[b] for run in runs], ".", color="0.75")
    points = np.array([(run.measures[a], run.measures[b]) for run in front])
    spans = np.maximum(np.ptp([(run.measures[a], run.measures[b]) for run in runs], axis=0), 1e-300)
    steps = np.hypot(*(np.diff(points, axis=0) / spans).T)
    gaps = np.flatnonzero(steps > _GAP * (np.median(steps) if len(steps) else 0.0)) + 1
    axes.plot(*np.insert(points, gaps, np.nan, axis=0).T, "o-", color="C3")
    axes.set(xlabel=labels[a], ylabel=labels[b])
    return drawing


def page(study: Any, title: str, labels: dict[str, str]) -> str:
    """Return the HTML page of `Study.report`: best run, main effects, Pareto fronts, all runs."""
    names = {name: label.rpartition(", ")[0] or label for name, label in labels.items()}
    body = [f"<h1>{html.escape(title)}</h1>", f"<p class=lead>{pages.lines(study.text(names))}</p>"]
    if study.goal and study.successful:
        best = study.best
        body += ["<h2>Best</h2>", pages.table(["", ""], [[labels[k], pages.number(v)] for k, v in
                                                         {**best.values, **best.measures}.items()])]
    for measure in study.measures if study.successful else ():
        caption = f"Main effects on {names[measure]}: runs (dots), means at each level."
        body.append(pages.figure(main_effects(study.successful, study.effects(measure), measure, labels),
                                 caption))
    for a, b in itertools.combinations(study.goal, 2) if study.successful else ():
        body.append(pages.figure(pareto(study.successful, study.pareto(a, b), a, b, labels),
                                 f"{names[a]} and {names[b]}: no run beats the red ones in both.", "small"))
    columns = study.columns
    rows = [[v if isinstance(v, str) else pages.number(v) for v in row] for row in zip(*columns.values())]
    head = [{**labels, "seconds": "run time, s", "error": "failure"}[name] for name in columns]
    return pages.page(title, [*body, "<h2>All runs</h2>", pages.table(head, rows)])
