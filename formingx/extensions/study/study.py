"""Parameter studies: many runs of one script with different values, in parallel and resumable.

The results are tables, main effects, and the best run.

    def pot(depth, radius):                                  # importable: a function of a script or of a module
        ...
        return fx.trace(...)                                 # a path

    def evenness(path):
        return path.part().uniformity

    if __name__ == "__main__":                               # processes read the script again
        found = fx.study(pot, {"depth": [30, 40, 50], "radius": [18, 22]}, {"evenness": evenness},
                         goal={"evenness": "max"}, folder="results/pots")
        print(found); found.to_csv("pots.csv"); found.plot_effects("evenness")
"""

from __future__ import annotations

import json
import logging
import math
import os
import pickle
import re
import threading
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent import futures
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...errors import InputError, count, known, place
from ...results.files import replace
from ...results.files.sheet import Sheet
from . import effects
from .variables import design

Measure = Callable[[Any], float] | str

_AT_EDGE = 1e-3        # of the range of a variable


@dataclass(frozen=True)
class StudyRun:
    """One run of a study.

    Attributes:
        values: {variable: value}.
        measures: {name: number}; empty if the run failed.
        error: reason for the failure, or "".
        seconds: duration of the run.
        warnings: texts of its warnings.
    """

    values: dict[str, float]
    measures: dict[str, float] = field(default_factory=dict)
    error: str = ""
    seconds: float = 0.0
    warnings: list[str] = field(default_factory=list)


class _Task(NamedTuple):
    """Task of one process."""

    build: Callable[..., Any]
    measure: dict[str, Measure]

    def __call__(self, values: dict[str, float]) -> StudyRun:
        began, log, names = time.perf_counter(), logging.getLogger("formingx"), _NamesRun(values)
        log.addFilter(names)
        try:
            result = self.build(**values)
            found = {name: float(result.last.measures[of] if isinstance(of, str) else of(result))
                     for name, of in self.measure.items()}
            error = next((f"{name} is not a finite number" for name, v in found.items() if not math.isfinite(v)), "")
        except Exception as failure:                         # the other runs continue after any exception of the script
            found, error = {}, f"{type(failure).__name__}: {failure}"
        finally:
            log.removeFilter(names)
        return StudyRun(values, {} if error else found, error, time.perf_counter() - began, names.warnings)


class _NamesRun(logging.Filter):
    """Log filter that prefixes records with the values of the run and collects warnings; one per thread."""

    def __init__(self, values: dict[str, float]):
        super().__init__()
        self._values, self._thread, self.warnings = values, threading.get_ident(), list[str]()

    def filter(self, record: logging.LogRecord) -> bool:
        if record.thread == self._thread:
            text = record.getMessage()
            record.msg, record.args = f"run {_shown(self._values)}: {text}", ()
            if record.levelno >= logging.WARNING:
                self.warnings.append(text)
        return True


class Study(Sheet):
    """Runs of a parameter study.

    Attributes:
        runs: runs in the order of the design.
        variables: names of the variables.
        measures: names of the measures.
        goal: {measure: "max" or "min"}.
    """

    comm = MPI.COMM_SELF

    def __init__(self, task: _Task, variables: list[str], goal: dict[str, str], folder: FilePath | None):
        self._task, self._folder, self.variables, self.goal = task, folder, variables, goal
        self.measures, self.runs = list(task.measure), list[StudyRun]()

    @property
    def good(self) -> list[StudyRun]:
        """Successful runs."""
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
        if not self.goal or not self.good:
            raise InputError("Study.best: the study has no goal" if not self.goal else "Study.best: all runs failed")
        return min(self.good, key=self._distance)

    def pareto(self, a: str, b: str) -> list[StudyRun]:
        """Return the runs that no other run beats in both measures, sorted by the first.

        Args:
            a: name of the first measure; optimised to its goal, without a goal to the largest value.
            b: name of the second measure, likewise.

        Returns:
            The runs.
        """
        signs = {name: -1 if self.goal.get(name, "max") == "max" else 1 for name in (self._known(a), self._known(b))}
        points = [tuple(sign * run.measures[name] for name, sign in signs.items()) for run in self.good]
        front = [run for run, p in zip(self.good, points)
                 if not any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in points)]
        return sorted(front, key=lambda run: run.measures[a])

    def effects(self, measure: str) -> dict[str, dict[float, float]]:
        """Return the main effects on a measure.

        After failures an additive model is fitted to the other runs by least squares. This keeps a level's mean
        independent of the failed combinations.

        Args:
            measure: name of the measure.

        Returns:
            {variable: {level: mean over the runs at this level}}.
        """
        self._known(measure)
        values = np.array([run.measures[measure] for run in self.good])
        levels = {name: sorted({run.values[name] for run in self.good}) for name in self.variables}
        masks = {name: np.array([[run.values[name] == level for level in of] for run in self.good], dtype=float)
                 for name, of in levels.items()}
        parts = np.split(np.linalg.lstsq(np.hstack(list(masks.values())), values)[0],
                         np.cumsum([len(of) for of in levels.values()])[:-1])
        usual = [float(mask.mean(0) @ part) for mask, part in zip(masks.values(), parts)]
        return {name: {level: float(value + sum(usual) - own) for level, value in zip(of, part)}
                for (name, of), part, own in zip(levels.items(), parts, usual)}

    def plot_effects(self, measure: str) -> Any:
        """Draw the main effects on a measure, and every run.

        Args:
            measure: name of the measure.

        Returns:
            The matplotlib figure.
        """
        return effects.main_effects(self.good, self.effects(measure), measure)

    def plot_pareto(self, a: str, b: str) -> Any:
        """Draw two measures of all runs, with the Pareto front.

        Args:
            a: name of the first measure.
            b: name of the second measure.

        Returns:
            The matplotlib figure.
        """
        return effects.pareto(self.good, self.pareto(a, b), a, b)

    def report(self, file: Any, title: str = "Study") -> None:
        """Write an HTML report: best run, main effects, Pareto fronts of the goals, all runs."""
        replace(file, lambda stream: stream.write(effects.page(self, title)))

    def refine(self, evaluations: int = 30, within: Mapping[str, tuple[float, float]] | None = None,
               executor: futures.Executor | None = None) -> StudyRun:
        """Improve the best run by the Nelder-Mead method with bounds; all runs are kept.

        Nelder and Mead, Computer Journal 7 (1965) 308 (doi:10.1093/comjnl/7.4.308), as in SciPy. It suits few
        variables with a smooth effect. A failed run counts as worse than all others.

        Args:
            evaluations: maximum number of further runs, one after the other.
            within: {variable: (lowest, highest)}; a variable without a range keeps its best value. Default: all varied
                variables, within the ranges of the study.
            executor: as in `study`; default: a new process.

        Returns:
            The best run.

        Raises:
            InputError: no goal, no successful run, or an unknown variable.
        """
        from scipy.optimize import minimize
        start, evaluations = self.best, count("refine: evaluations", evaluations)
        within = within if within is not None else {
            name: (min(levels), max(levels)) for name in self.variables
            if len(levels := {run.values[name] for run in self.runs}) > 1}
        for name in within:
            known("refine: variable", name, self.variables)
        low, high = np.array(list(within.values()), dtype=float).T
        worst = max(map(self._distance, self.good))

        def objective(x):
            values = start.values | dict(zip(within, (low + np.clip(x, 0, 1) * (high - low)).tolist()))
            run = next((run for run in self.runs if run.values == values), None) or pool.submit(
                self._task, values).result()
            if run not in self.runs:
                self._keep(run)
            return worst + abs(worst) if run.error else self._distance(run)
        first = (np.array([start.values[name] for name in within]) - low) / (high - low)
        simplex = np.vstack([first, *(first + np.eye(len(first))[k] * (0.2 if first[k] < 0.5 else -0.2)
                                      for k in range(len(first)))])
        with _pool(executor, 1) as pool:
            minimize(objective, first, method="Nelder-Mead", bounds=[(0, 1)] * len(first),
                     options={"maxfev": evaluations, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-6})
        return self.best

    def __str__(self) -> str:
        failed = len(self.runs) - len(self.good)
        lines = [f"{len(self.runs)} runs" + f", of which {failed} failed" * bool(failed)
                 + f", {sum(run.seconds for run in self.runs):.1f} s in all"]
        if self.goal and self.good:
            shown = _shown({**self.best.values, **self.best.measures})
            lines.append(f"best ({', '.join(f'{way} {name}' for name, way in self.goal.items())}): {shown}")
            lines += self._edges()
        lines += [f"failed: {_shown(run.values)}: {run.error.splitlines()[0]}" for run in self.runs if run.error]
        return "\n".join([*lines, *(f"warning: {_shown(run.values)}: {text}" for run in self.runs
                                    for text in run.warnings)])

    def _edges(self) -> list[str]:
        """Return the variables whose best value is the first or last one tried, as text."""
        found = []
        for name in self.variables:
            values = [run.values[name] for run in self.runs]
            low, high, best = min(values), max(values), self.best.values[name]
            near = _AT_EDGE * (high - low)
            if low < high and not low + near < best < high - near:
                found.append(f"the best is at the edge of {name}, which was run from {low:g} to {high:g}: a better one"
                             f" may lie {'below' if best <= low + near else 'above'}")
        return found

    def _distance(self, run: StudyRun) -> float:
        name, way = next(iter(self.goal.items()))
        return run.measures[name] * (1 if way == "min" else -1)

    def _known(self, measure: str) -> str:
        known("Study: measure", measure, self.measures)
        return measure

    def _keep(self, run: StudyRun) -> None:
        """Add a run, and write it to the folder."""
        if self._folder is not None:
            # the number is one above the largest; the checksum tells files of one number by two processes apart
            last = max((int(file.name[4:9]) for file in _files(self._folder)), default=-1)
            values = zlib.crc32(json.dumps(run.values, sort_keys=True).encode())
            file = self._folder / f"run-{last + 1:05d}-{values:08x}.json"
            replace(file, lambda stream: json.dump(asdict(run), stream, indent=1))
        self.runs.append(run)


def study(build: Callable[..., Any], variables: Mapping[str, Sequence[float]] | Sequence[Mapping[str, float]],
          measure: Mapping[str, Measure], *, goal: Mapping[str, str] | None = None, folder: Any = None,
          executor: futures.Executor | None = None, workers: int | None = None, progress: bool = True) -> Study:
    """Run a script with many sets of values, and measure each run.

    The first run goes alone, so that the forms are compiled only once. The others run in parallel.

    Args:
        build: function of the variables, by name, that returns a path. Under an MPI executor it must make its mesh on
            `MPI.COMM_SELF`.
        variables: {name: values} for all combinations, or a list of {name: value}, one for each run.
        measure: {name: a function of the path that returns a number, or the name of a column, at the last state}.
        goal: {measure: "max" or "min"}; the first one defines the best run.
        folder: folder for the results of the runs. Runs stored there are not repeated.
        executor: an executor of `concurrent.futures`, or `mpi4py.futures.MPIPoolExecutor`. Default: processes of this
            machine. Functions run in other processes must be importable: no lambda, no function inside another.
        workers: number of parallel processes; default one per core.
        progress: show a progress bar.

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
    cases = design(variables)
    task, ways = _Task(build, _measures(build, measure)), dict(goal or {})
    for name, way in ways.items():
        known("study: goal", name, task.measure)
        known(f"study: goal of {name}: way", way, ("max", "min"))
    place_of = None if folder is None else _folder(place("study: folder", folder), task, list(cases[0]))
    found = Study(task, list(cases[0]), ways, place_of)
    found.runs += [] if place_of is None else _there(place_of, found.variables)
    todo = [case for case in cases if not any(run.values == case for run in found.runs)]
    with _pool(executor, min(workers or os.cpu_count() or 1, max(len(todo), 1))) as pool:
        if isinstance(pool, futures.ProcessPoolExecutor):
            _check_importable(task)
        runs = _finished(pool, task, todo)
        for run in tqdm(runs, total=len(todo), disable=not (progress and todo), desc="study", unit="run"):
            found._keep(run)
    order = {tuple(case.items()): k for k, case in enumerate(cases)}
    found.runs.sort(key=lambda run: order.get(tuple(run.values.items()), len(order)))
    return found


def _shown(numbers: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.4g}" for name, value in numbers.items())


def _finished(pool: Any, task: _Task, cases: list[dict]) -> Iterator[StudyRun]:
    """Yield the runs as they finish; the first one runs alone."""
    for some in (cases[:1], cases[1:]):
        jobs: dict[Any, dict] = {pool.submit(task, case): case for case in some}
        for job in futures.as_completed(jobs):
            failure = job.exception()
            yield job.result() if failure is None else StudyRun(jobs[job], error=f"{type(failure).__name__}: {failure}")


def _pool(executor: futures.Executor | None, workers: int) -> Any:
    """Return a context of the user's executor, which stays open, or of processes, which end with the block."""
    if executor:
        return nullcontext(executor)
    from multiprocessing import get_context  # costs time, which others do not spend
    return futures.ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def _measures(build: Any, measure: Any) -> dict[str, Measure]:
    if not callable(build):
        raise InputError(f"study: build = {build!r}: must be a function of the variables that gives back a path")
    if not isinstance(measure, Mapping) or not measure or not all(callable(m) or isinstance(m, str)
                                                                  for m in measure.values()):
        raise InputError(f"study: measure = {measure!r}: must be {{name: function of the path, or a column's name}}")
    return dict(measure)


def _check_importable(task: _Task) -> None:
    try:
        pickle.dumps(task)
    except Exception as error:
        raise InputError(f"study: what is run in processes must be importable by name, no lambda and no function inside"
                         f" another: {error}; or give an executor that runs here") from None


def _folder(folder: FilePath, task: _Task, variables: list[str]) -> FilePath:
    """Return the folder, made or checked.

    Raises:
        InputError: a folder of another study.
    """
    about = {"study": 1, "build": getattr(task.build, "__qualname__", ""), "variables": variables,
             "measures": list(task.measure)}
    file = folder / "study.json"
    if file.exists():
        stored = _read(file)
        if stored != about:
            raise InputError(f"study: folder {str(folder)!r} holds another study: {stored}; here: {about}")
    elif folder.exists() and any(folder.iterdir()):
        raise InputError(f"study: folder {str(folder)!r} is there already and holds no study")
    else:
        replace(file, lambda stream: json.dump(about, stream, indent=1))
    return folder


def _there(folder: FilePath, variables: list[str]) -> list[StudyRun]:
    """Return the runs stored in a folder, one for each set of values.

    Raises:
        InputError: a file that cannot be read.
    """
    found: list[StudyRun] = []
    for file in sorted(_files(folder)):
        try:
            run = StudyRun(**_read(file))
            right = (set(run.values) == set(variables) and isinstance(run.error, str)
                     and all(math.isfinite(v) for v in (*run.values.values(), *run.measures.values(), run.seconds)))
        except (TypeError, AttributeError):
            right = False
        if not right:
            raise InputError(f"study: {str(file)!r} is damaged: it holds no run of this study; remove it, and the run"
                             f" is made again")
        found += [run] if all(run.values != other.values for other in found) else []
    return found


def _files(folder: FilePath) -> list[FilePath]:
    return [file for file in folder.glob("run-*.json") if re.match(r"run-[0-9]{5}[-.]", file.name)]


def _read(file: FilePath) -> Any:
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"study: {str(file)!r} is damaged or cannot be read: {error}; remove it, and what it held is"
                         f" made again") from None
