"""Derivatives of a run by differences of whole runs, for runs without exact derivatives."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent import futures
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError
from ..study.task import executor_context

log = logging.getLogger("formingx")

_CHANGE = 0.02
"""Change of a parameter, over its range, or over its start value without a range.

Walls of runs with lagged contact scatter by some 1e-4 with the lengths of the steps, so smaller changes are less
accurate.
"""

Outputs = dict[Any, np.ndarray]
"""{name of an output quantity, or function of a path: values in a run, shape (m,)}."""


class WholeRuns:
    """Whole runs of a design at changed parameters, `workers` at a time.

    One runs in this process, several in the `executor` or in own processes. `count`: number of runs so far.
    """

    def __init__(self, workers: int, executor: futures.Executor | None):
        self._workers, self._executor, self.count = workers, executor, 0
        self._functions: list[Callable[[Any], Any]] = []
        self._pool: futures.Executor | None = None           # its processes end with this object

    def since(self, before: int) -> tuple[int, str]:
        """Return the number of runs after the first `before` ones, and a text on them; "" without any."""
        number = self.count - before
        where = "by the executor" if self._executor else (
            f"{self._workers} at a time" if self._workers > 1 else "one after the other")
        return number, f"{number} for differences of whole runs, {where}" if number else ""

    def neighbours(self, design: Any, vector: np.ndarray, measure: Any) -> list[tuple[Outputs, float]]:
        """Return the outputs of a run with each parameter changed, shape (n,), and the change, by parameter.

        The design must be importable in other processes. Outputs have the quantity `measure`; functions of a path are
        kept for later calls.
        """
        if callable(measure) and measure not in self._functions:
            self._functions.append(measure)
        p = design.parameters
        steps = _CHANGE * p.size * np.where(vector + _CHANGE * p.size > p.high, -1.0, 1.0)
        tasks = [(design, vector + step * np.eye(len(p))[k], self._functions) for k, step in enumerate(steps)]
        self.count += len(tasks)
        found: list[Outputs | str]
        if self._workers == 1 and self._executor is None:
            found = [_outputs(*task) for task in tasks]
        else:
            if self._pool is None:
                self._pool = self._executor or executor_context(None, self._workers)
            found = list(self._pool.map(_outputs, *zip(*tasks)))
        pairs = []
        for name, value, step, outputs in zip(p.names, vector, steps, found):
            if isinstance(outputs, str):
                raise InputError(f"Design: no derivative by {name}: the run at {value + step:.6g}, next to"
                                 f" {value:.6g}, fails: {outputs}")
            pairs.append((outputs, float(step)))
        log.info("design: runs: %s", self.since(self.count - len(tasks))[1])
        return pairs


def _outputs(design: Any, vector: np.ndarray, functions: list[Callable[[Any], Any]]) -> Outputs | str:
    """Return all output quantities of a run of a design at parameters, shape (n,), or the reason for its failure."""
    try:
        run = design.run(design.parameters.values(vector))
    except (ConvergenceError, InputError) as error:
        return str(error).splitlines()[0]
    return {measure: run.value(measure) for measure in ("wall", "volume", *run.path.columns, *functions)}
