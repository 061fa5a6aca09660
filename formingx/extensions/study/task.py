"""Runs of a parameter study, in this or other processes."""

from __future__ import annotations

import logging
import math
import pickle
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent import futures
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ...errors import ConvergenceError, InputError, check_name

Measure = Callable[[Any], float] | str
"""A function of the path that returns a number, or the name of a column of the path."""


@dataclass(frozen=True)
class StudyRun:
    """One run of a parameter study.

    Attributes:
        values: {variable: value}.
        measures: {name of the measure: number}; empty if the run failed.
        error: reason for the failure, or "".
        seconds: duration of the run, s.
        warnings: texts of the warnings of the run.
    """

    values: dict[str, float]
    measures: dict[str, float] = field(default_factory=dict)
    error: str = ""
    seconds: float = 0.0
    warnings: list[str] = field(default_factory=list)

    @property
    def is_final(self) -> bool:
        """True if a study does not repeat the run: it succeeded, or it found no equilibrium."""
        return not self.error or self.error.startswith(f"{ConvergenceError.__name__}: ")


class Task(NamedTuple):
    """Task of one process: the user's function `build`, and `measures`, {name: function of the path, or column}."""

    build: Callable[..., Any]
    measures: dict[str, Measure]

    def __call__(self, values: dict[str, float]) -> StudyRun:
        """Run `build` with {variable: value}; return its measures, or the reason for its failure."""
        began, log, log_filter = time.perf_counter(), logging.getLogger("formingx"), _RunLogFilter(values)
        log.addFilter(log_filter)
        try:
            result = self.build(**values)
            for name, measure in self.measures.items():
                if isinstance(measure, str):
                    check_name(f"measure {name!r}: column", measure, result.last.measures)
            found = {name: float(result.last.measures[measure] if isinstance(measure, str) else measure(result))
                     for name, measure in self.measures.items()}
            error = next((f"{name} is not a finite number" for name, v in found.items() if not math.isfinite(v)), "")
        except Exception as failure:                         # the other runs continue after any exception of the script
            found, error = {}, f"{type(failure).__name__}: {failure}"
        finally:
            log.removeFilter(log_filter)
        return StudyRun(values, {} if error else found, error, time.perf_counter() - began, log_filter.warnings)


class _RunLogFilter(logging.Filter):
    """Log filter for one thread that adds {variable of the study: value} to its records and collects warnings."""

    def __init__(self, values: dict[str, float]):
        super().__init__()
        self._values, self._thread, self.warnings = values, threading.get_ident(), list[str]()

    def filter(self, record: logging.LogRecord) -> bool:
        """Prefix a record of this thread with the run's values of the study's variables; return True: it is logged."""
        if record.thread == self._thread:
            text = record.getMessage()
            record.msg, record.args = f"run {as_text(self._values)}: {text}", ()
            if record.levelno >= logging.WARNING:
                self.warnings.append(text)
        return True


def as_text(numbers: Mapping[str, float]) -> str:
    """Return numbers and their names as text, such as "depth = 30, radius = 18"."""
    return ", ".join(f"{name} = {value:.4g}" for name, value in numbers.items())


def completed_runs(pool: Any, task: Task, cases: list[dict]) -> Iterator[StudyRun]:
    """Run a task with sets of values in an executor, the first alone; yield runs as they finish, failed ones too."""
    for batch in (cases[:1], cases[1:]):
        jobs: dict[Any, dict] = {pool.submit(task, case): case for case in batch}
        for job in futures.as_completed(list(jobs)):
            case, failure = jobs.pop(job), job.exception()             # a cluster forgets a run that nobody holds
            run = job.result() if failure is None else StudyRun(case, error=f"{type(failure).__name__}: {failure}")
            del job
            yield run


def executor_context(executor: futures.Executor | None, workers: int) -> Any:
    """Return a context of an executor for the runs of a study: the user's, which stays open, or new processes."""
    if executor:
        return nullcontext(executor)
    from multiprocessing import get_context  # a slow import that only this call needs
    return futures.ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def check_importable(task: Task) -> None:
    """Raise an InputError if a function of a task cannot be imported by name in another process."""
    try:
        pickle.dumps(task)
    except Exception as error:
        raise InputError(f"study: what is run in processes must be importable by name, no lambda and no function inside"
                         f" another: {error}; or give an executor that runs here") from None
