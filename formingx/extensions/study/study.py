"""Parameter studies: many runs of one script with different values, in parallel and resumable.

The results are tables, main effects, and the best run.

    def pot(depth, radius):                                  # importable: a function of a script or of a module
        ...
        return fx.trace(...)                                 # a path

    def uniformity(path):
        return path.part().uniformity

    if __name__ == "__main__":                               # other processes import the script
        found = fx.study(pot, {"depth": [30, 40, 50], "radius": [18, 22]}, {"uniformity": uniformity},
                         goal={"uniformity": "max"}, folder="results/pots")
        print(found); found.to_csv("pots.csv"); found.plot_effects("uniformity")
"""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent import futures
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError, check_name, check_type, count, file_path
from ...results.files import replace
from ...results.files.column_table import ColumnTable
from ...units import NONE, Units
from ...values.tolerances import NEGLIGIBLE
from . import effects, stored_runs
from .response import Sensitivities, sobol
from .task import Measure, StudyRun, Task, as_text, check_importable, completed_runs, executor_context
from .variables import sets_of_values


class Study(ColumnTable):
    """Runs of a parameter study; prints a summary with the best run.

    Attributes:
        runs: runs in the order of the sets of values.
        variables: names of the variables.
        measures: names of the measures.
        goal: {measure: "max" or "min"}; the first one defines the best run.
    """

    comm = MPI.COMM_SELF

    def __init__(self, task: Task, variables: list[str], goal: dict[str, str], folder: FilePath | None):
        self._task, self._folder, self.variables, self.goal = task, folder, variables, goal
        self.measures, self.runs = list(task.measures), list[StudyRun]()

    @property
    def successful(self) -> list[StudyRun]:
        """Runs without failure."""
        return [run for run in self.runs if not run.error]

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the table, {name: values, shape (runs,)}: variables, measures (nan if failed), seconds, error."""
        found: dict[str, Any] = {name: [run.values[name] for run in self.runs] for name in self.variables}
        found |= {name: [run.measures.get(name, math.nan) for run in self.runs] for name in self.measures}
        found |= {"seconds": [run.seconds for run in self.runs], "error": [run.error for run in self.runs]}
        return {name: np.array(values) for name, values in found.items()}

    @property
    def best(self) -> StudyRun:
        """Run with the best value of the first goal.

        Raises:
            InputError: the study has no goal, or all runs failed.
        """
        if not self.goal or not self.successful:
            raise InputError("Study.best: the study has no goal" if not self.goal else "Study.best: all runs failed")
        return min(self.successful, key=self._cost)

    def _measures_of_goal(self, a: str | None, b: str | None) -> tuple[str, str]:
        """Return two measures' names, default the goal's first two; one, or too few there, is an InputError."""
        if a is not None and b is not None:
            return a, b
        if a is not None or b is not None or len(self.goal) < 2:
            raise InputError(f"Study.pareto: needs two measures, pareto('a', 'b'), or a goal with two; the goal has"
                             f" {', '.join(self.goal) or 'none'}, the study {', '.join(self.measures)}")
        first, second = list(self.goal)[:2]
        return first, second

    def pareto(self, a: str | None = None, b: str | None = None) -> list[StudyRun]:
        """Return the runs that no other run beats in two measures, sorted by the first measure.

        A measure without a goal is best where it is largest.

        Args:
            a: name of the first measure; default the first of the goal.
            b: name of the second measure; default the second of the goal.

        Returns:
            The runs.

        Raises:
            InputError: an unknown measure, or a goal with fewer than two.
        """
        a, b = self._measures_of_goal(a, b)
        names = self._checked_measure(a), self._checked_measure(b)
        signs = {name: -1 if self.goal.get(name, "max") == "max" else 1 for name in names}
        points = [tuple(sign * run.measures[name] for name, sign in signs.items()) for run in self.successful]
        front = [run for run, p in zip(self.successful, points)
                 if not any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in points)]
        return sorted(front, key=lambda run: run.measures[a])

    def effects(self, measure: str) -> dict[str, dict[float, float]]:
        """Return the main effects of the variables on a measure: its mean at each level of each variable.

        After failures an additive model is fitted to the other runs by least squares. This keeps the mean at a level
        independent of the failed combinations.

        Args:
            measure: name of the measure.

        Returns:
            {variable: {level: mean over the runs at this level}}.

        Raises:
            InputError: an unknown measure, or no successful run.
        """
        self._checked_measure(measure)
        if not self.successful:
            raise InputError("Study.effects: no run succeeded: print(study) says why")
        values = np.array([run.measures[measure] for run in self.successful])
        levels = {name: sorted({run.values[name] for run in self.successful}) for name in self.variables}
        masks = {name: np.array([[run.values[name] == level for level in tried] for run in self.successful], float)
                 for name, tried in levels.items()}
        parts = np.split(np.linalg.lstsq(np.hstack(list(masks.values())), values)[0],
                         np.cumsum([len(tried) for tried in levels.values()])[:-1])
        means = [float(mask.mean(0) @ part) for mask, part in zip(masks.values(), parts)]
        return {name: {level: float(value + sum(means) - mean) for level, value in zip(tried, part)}
                for (name, tried), part, mean in zip(levels.items(), parts, means)}

    def plot_effects(self, measure: str, units: Units = NONE) -> Any:
        """Draw the main effects on a measure, with every successful run as a dot.

        Args:
            measure: name of the measure.
            units: units of the script, for the labels.

        Returns:
            The matplotlib figure.
        """
        return effects.main_effects(self.successful, self.effects(measure), measure, self._labels(units))

    def plot_pareto(self, a: str | None = None, b: str | None = None, units: Units = NONE) -> Any:
        """Draw two measures of all successful runs as dots, with the Pareto front as a line that ends at gaps.

        Args:
            a: name of the first measure; default the first of the goal.
            b: name of the second measure; default the second of the goal.
            units: units of the script, for the labels.

        Returns:
            The matplotlib figure.
        """
        a, b = self._measures_of_goal(a, b)
        return effects.pareto(self.successful, self.pareto(a, b), a, b, self._labels(units))

    def sensitivities(self, measure: str) -> Sensitivities:
        """Return the Sobol indices of a measure: the parts of its variance that the variables cause, largest first.

        They belong to a polynomial of second order that is fitted to the runs (`scipy.stats.sobol_indices`).

        Args:
            measure: name of the measure.

        Raises:
            InputError: an unknown measure, or too few runs.
        """
        self._checked_measure(measure)
        return sobol(self.successful, self.variables, measure)

    def report(self, file: Any, title: str = "Study", units: Units = NONE,
               labels: Mapping[str, str] | None = None) -> None:
        """Write an HTML page with the best run, main effects, Pareto fronts of the goals, and all runs.

        Args:
            file: path of the HTML file.
            title: heading of the page.
            units: units of the script, for the labels. The end of a name determines its unit, as in "rim_radius" or
                "plug_force"; a measure that is a column has the unit of the column.
            labels: {name of a variable or measure: another label, such as "modulus, MPa"}.

        Raises:
            InputError: a name in `labels` is unknown.
        """
        check_type("Study.report: units", units, Units, "a formingx.Units")
        found = self._labels(units)
        for name, label in dict(labels or {}).items():
            check_name("Study.report: labels:", name, found)
            found[name] = check_type("Study.report: label", label, str, "text")
        replace(file, lambda stream: stream.write(effects.page(self, title, found)))

    def refine(self, evaluations: int = 30, within: Mapping[str, tuple[float, float]] | None = None,
               executor: futures.Executor | None = None) -> StudyRun:
        """Search for a better run, from the best one, by the Nelder-Mead method with bounds; all runs join the study.

        Nelder and Mead, Computer Journal 7 (1965) 308 (doi:10.1093/comjnl/7.4.308), as in SciPy. It suits few variables
        with a smooth effect. A failed run counts as worse than all others.

        Args:
            evaluations: maximum number of further runs, one after the other.
            within: {variable: (lowest, highest)}; a variable without a range keeps its best value. Default: all varied
                variables, within the ranges of the study.
            executor: executor of `concurrent.futures` in which the runs take place; default: a new process.

        Returns:
            The best run.

        Raises:
            InputError: no goal, no successful run, no range, or an unknown variable.
        """
        from scipy.optimize import minimize
        start, evaluations = self.best, count("refine: evaluations", evaluations)
        within = within if within is not None else {
            name: (min(levels), max(levels)) for name in self.variables
            if len(levels := {run.values[name] for run in self.runs}) > 1}
        for name in within:
            check_name("refine: variable", name, self.variables)
        if not within:
            raise InputError("refine: no variable was varied: give ranges, as within={name: (lowest, highest)}")
        low, high = np.array(list(within.values()), dtype=float).T
        worst = max(map(self._cost, self.successful))

        def objective(x):
            """Return the measure to be minimised at a point x of the unit cube, from a stored or a new run."""
            values = start.values | dict(zip(within, (low + np.clip(x, 0, 1) * (high - low)).tolist()))
            run = next((run for run in self.runs if run.values == values), None) or pool.submit(
                self._task, values).result()
            if run not in self.runs:
                self._store(run)
            return worst + abs(worst) if run.error else self._cost(run)
        first = (np.array([start.values[name] for name in within]) - low) / (high - low)
        simplex = np.vstack([first, *(first + np.eye(len(first))[k] * (0.2 if first[k] < 0.5 else -0.2)
                                      for k in range(len(first)))])
        with executor_context(executor, 1) as pool:
            minimize(objective, first, method="Nelder-Mead", bounds=[(0, 1)] * len(first),
                     options={"maxfev": evaluations, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-6})
        return self.best

    def __str__(self) -> str:
        return self.text({name: name for name in (*self.variables, *self.measures)})

    def text(self, names: Mapping[str, str]) -> str:
        """Return a summary of the runs as text: their number, the best run, failures and warnings.

        Args:
            names: {name of a variable or measure: name in the text}.
        """
        def renamed(values: Mapping[str, float]) -> str:
            """Return numbers with the names in the text."""
            return as_text({names[name]: value for name, value in values.items()})
        failed = len(self.runs) - len(self.successful)
        lines = [f"{len(self.runs)} runs" + f", of which {failed} failed" * bool(failed)
                 + f", {sum(run.seconds for run in self.runs):.1f} s in all"]
        if self.goal and self.successful:
            shown = renamed({**self.best.values, **self.best.measures})
            lines.append(f"best ({', '.join(f'{direction} {names[name]}' for name, direction in self.goal.items())}):"
                         f" {shown}")
            lines += self._edge_warnings(names)
        lines += [f"failed: {renamed(run.values)}: {run.error.splitlines()[0]}" for run in self.runs if run.error]
        return "\n".join([*lines, *(f"warning: {renamed(run.values)}: {text}" for run in self.runs
                                    for text in run.warnings)])

    def _labels(self, units: Units) -> dict[str, str]:
        """Return {name of a variable or measure: its label with unit}."""
        columns = {name: found for name, found in self._task.measures.items() if isinstance(found, str)}
        return {name: units.label(columns.get(name, name), name.replace("_", " "))
                for name in (*self.variables, *self.measures)}

    def _edge_warnings(self, names: Mapping[str, str]) -> list[str]:
        """Return a line of text for each variable whose value in the best run is the lowest or highest one tried."""
        found = []
        for name in self.variables:
            values = [run.values[name] for run in self.runs]
            low, high, best = min(values), max(values), self.best.values[name]
            margin = NEGLIGIBLE * (high - low)
            if low < high and not low + margin < best < high - margin:
                found.append(f"the best is at the edge of {names[name]}, which was run from {low:g} to {high:g}: a"
                             f" better one may lie {'below' if best <= low + margin else 'above'}")
        return found

    def _cost(self, run: StudyRun) -> float:
        """Return the measure of the first goal in a run, times -1 for the goal "max"; the best run has the lowest."""
        name, direction = next(iter(self.goal.items()))
        return run.measures[name] * (1 if direction == "min" else -1)

    def _checked_measure(self, measure: str) -> str:
        """Return the name of a measure; raise an InputError if the study does not have it."""
        check_name("Study: measure", measure, self.measures)
        return measure

    def _store(self, run: StudyRun) -> None:
        """Add a run to the study, and write it to the folder, if there is one."""
        if self._folder is not None:
            stored_runs.write(self._folder, run)
        self.runs.append(run)


def study(build: Callable[..., Any], variables: Mapping[str, Sequence[float]] | Sequence[Mapping[str, float]],
          measures: Mapping[str, Measure], *, goal: Mapping[str, str] | None = None, folder: Any = None,
          executor: futures.Executor | None = None, workers: int | None = None, progress: bool = True) -> Study:
    """Run the function `build` for many sets of values, and evaluate measures of each run.

    The first run goes alone, so that the forms are compiled only once. The others run in parallel.

    Args:
        build: function of the variables, by name, that returns a path. Under an MPI executor it must make its mesh on
            `MPI.COMM_SELF`.
        variables: {name: values} for all combinations, or a list of {name: value}, one for each run.
        measures: {name: function of the path that returns a number, or name of a column of the path}. Of a column the
            value in the last state counts.
        goal: {measure: "max" or "min"}; the first one defines the best run.
        folder: folder for the results of the runs. Runs stored there are not repeated, unless they failed by another
            error than a `ConvergenceError`.
        executor: an executor of `concurrent.futures`, of Dask (`Client(...).get_executor()`) or of mpi4py
            (`MPICommExecutor`). Default: processes of this
            machine. Functions run in other processes must be importable: no lambda, no function inside another.
        workers: number of parallel processes; default one per core.
        progress: True for a progress bar.

    Returns:
        The `Study`, with the failed runs.

    Raises:
        InputError: an argument that is not allowed, or a folder of another study.

    >>> from concurrent.futures import ThreadPoolExecutor
    >>> def build(c10):
    ...     stiff = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=c10), loads=scene.loads, supports=scene.supports)
    ...     return fx.trace(stiff, until=fx.pole_height(3.0), progress=False)
    >>> found = fx.study(build, {"c10": [0.2, 0.4]}, {"p": "pressure"}, goal={"p": "min"}, progress=False,
    ...                  executor=ThreadPoolExecutor(1))
    >>> found.best.values
    {'c10': 0.2}
    """
    from tqdm import tqdm
    cases = sets_of_values(variables)
    task, goals = Task(build, _measures(build, measures)), dict(goal or {})
    for name, direction in goals.items():
        check_name("study: goal", name, task.measures)
        check_name(f"study: goal of {name}:", direction, ("max", "min"))
    names = list(cases[0])
    try:
        inspect.signature(build).bind(**dict.fromkeys(names))
    except TypeError as error:
        raise InputError(f"study: variables {', '.join(map(repr, names))}: build{inspect.signature(build)} cannot be"
                         f" called with these: {error}") from None
    workers = (os.cpu_count() or 1) if workers is None else count("study: workers", workers)
    folder = None if folder is None else stored_runs.prepare_folder(file_path("study: folder", folder), task, names)
    found = Study(task, names, goals, folder)
    stored = [] if folder is None else stored_runs.read(folder, names)
    found.runs += [run for run in stored if run.is_final or run.values not in cases]
    missing = [case for case in cases if not any(run.values == case for run in found.runs)]
    with executor_context(executor, min(workers, max(len(missing), 1))) as pool:
        if isinstance(pool, futures.ProcessPoolExecutor):
            check_importable(task)
        runs = completed_runs(pool, task, missing)
        for run in tqdm(runs, total=len(missing), disable=not (progress and missing), desc="study", unit="run"):
            found._store(run)
    order = {tuple(case.items()): k for k, case in enumerate(cases)}
    found.runs.sort(key=lambda run: order.get(tuple(run.values.items()), len(order)))
    return found


def _measures(build: Any, measures: Any) -> dict[str, Measure]:
    """Return `measures` as a new dict; `build` or one that is no function or column is an InputError."""
    if not callable(build):
        raise InputError(f"study: build = {build!r}: must be a function of the variables that gives back a path")
    if not isinstance(measures, Mapping) or not measures or not all(callable(m) or isinstance(m, str)
                                                                    for m in measures.values()):
        raise InputError(f"study: measures = {measures!r}: must be {{name: function of the path, or a column's name}}")
    return dict(measures)
