"""Record of a run: its accepted states, and the cost of the run."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from ..errors import ConvergenceError
from ..findings import Finding
from ..measures.targets import Target
from .arc_length import Curve
from .equations import Equations
from .state import State
from .stepping import StepControl

log = logging.getLogger("formingx")


@dataclass
class Counts:
    """Cost of a run.

    Attributes:
        steps: number of accepted states without the start.
        failures: number of rejected attempts of steps.
        iterations: number of all Newton iterations, chord iterations and failed attempts included.
        seconds: duration of the run by the clock, s.
        limits: {reason for a shorter or failed step: number of such steps}.
    """

    steps: int = 0
    failures: int = 0
    iterations: int = 0
    seconds: float = 0.0
    limits: dict[str, int] = field(default_factory=dict)


@dataclass(eq=False)
class Segment:
    """States of one problem, in order. A run that changes its problem (a remeshing) continues in a new segment.

    Attributes:
        problem: the `Equations`, with the full interface of its class (`Problem`).
        curve: the solver of the states (`Curve`).
        states: the accepted states, list of `State`.
    """

    problem: Any
    curve: Curve
    states: list[State] = field(default_factory=list)


class InadmissibleState(ConvergenceError):
    """Error of a run that found a state which no body can have, such as one with self-penetration."""


class RunHooks:
    """Functions that a run calls.

    Attributes:
        on_state: functions called with every accepted state, while the problem has its unknowns and history variables.
            They fill `State.measures` and `State.inadmissible_reason`.
        on_step: functions called without arguments whenever a step is complete.
        on_end: functions called when the run ends; their arguments are the text of the failure, or "", and the
            findings.
        renew: function of two functions `part` and `done`. It calls `part`, which continues the run from its last
            state. With remeshing it calls `part` again on each new mesh, until done() is True.
    """

    def __init__(self) -> None:
        self.on_state: list[Callable[[State], None]] = []
        self.on_step: list[Callable[[], None]] = []
        self.on_end: list[Callable[[str, list[Finding]], None]] = []
        self.renew: Callable[[Callable[[], None], Callable[[], bool]], None] = lambda part, done: part()


class Record:
    """Record of a run: its accepted states, in order.

    Attributes:
        segments: list of `Segment`; accepted states are added to the last one.
        counts: cost of the run (`Counts`).
        stage: name of the current stage of a process, or "".
        ended: reason for which the run ended before its targets, as a result and not as an error; "" if it did not.
        hooks: functions that the run calls (`RunHooks`).
        findings: findings of the checks before the run.
        allow_inadmissible: True if the run keeps states that no body can have.
    """

    def __init__(self, problem: Equations, curve: Curve):
        self.segments = [Segment(problem, curve)]
        self.counts, self.stage, self.ended = Counts(), "", ""
        self.hooks = RunHooks()
        self.findings: list[Finding] = []
        self.allow_inadmissible = False

    @property
    def problem(self) -> Any:
        """Current problem, with the full interface of its class."""
        return self.segments[-1].problem

    @property
    def curve(self) -> Curve:
        """Solver of the current problem."""
        return self.segments[-1].curve

    @property
    def states(self) -> list[State]:
        """All accepted states of the run, in order."""
        if len(self.segments) == 1:
            return self.segments[0].states
        return [state for segment in self.segments for state in segment.states]

    @property
    def last(self) -> State:
        """Last accepted state of the run."""
        return self.segments[-1].states[-1]

    def segment(self, state: State | None = None) -> Segment:
        """Return the segment of the run with the mesh of a state; default the mesh of the last state."""
        mesh = (state or self.last).setting.get("mesh", 0)
        return next((s for s in self.segments if s.states and s.states[0].setting.get("mesh", 0) == mesh),
                    self.segments[-1])

    def restore(self) -> int:
        """Restore the last accepted state in the problem; return the number of last states with its step data.

        The first of these is restored before it, since constrained values and fading forces follow from it.
        """
        setting = self.last.setting
        states = list(itertools.takewhile(lambda s: s.setting == setting, reversed(self.segments[-1].states)))
        for state in (states[-1], self.last):
            self.curve.problem.restore(state)
        return len(states)

    def continue_from(self, other: Record) -> None:
        """Begin this record with the states and the costs of another record, which is not changed."""
        mine = self.segments[-1]
        *earlier, last = other.segments
        self.segments = [*earlier, Segment(mine.problem, mine.curve, list(last.states))]
        self.counts = replace(other.counts, limits=dict(other.counts.limits))

    def accept(self, state: State) -> None:
        """Accept a converged state: update the history variables, append it and call the functions in `hooks.on_state`.

        Raise `InadmissibleState` if no body can have this state; the record is then unchanged.
        """
        problem = self.curve.problem
        variables = problem.history.variables
        problem.history.advance(state.x, state.control)
        state.history_variables, state.history_variables_before = problem.history.variables, variables
        state.stage, state.setting = self.stage, asdict(problem.setting)
        state.time = problem.history.time_at(state.control)
        self.segments[-1].states.append(state)
        try:
            for listener in self.hooks.on_state:
                listener(state)
            if state.inadmissible_reason and not self.allow_inadmissible:
                raise InadmissibleState(state.inadmissible_reason)
        except BaseException:
            self.segments[-1].states.pop()
            problem.history.variables = variables
            raise
        if state.inadmissible_reason and not any(s.inadmissible_reason for s in self.states[-2:-1]):
            log.warning("beyond %s: %s", self.describe(state), state.inadmissible_reason)
        self.counts.steps += state.kind != "start"

    def complete_step(self, step: StepControl, until: Target, **entries: Any) -> None:
        """Store data to continue with, numbers, lists and dicts, in the last state; call `hooks.on_step`."""
        self.last.stepping = {"step": asdict(step), "counts": asdict(self.counts), "until": [until.name, until.value],
                              "column": self.curve.problem.description.shown(0.0)[0].replace(" ", "_"), **entries}
        for listener in self.hooks.on_step:
            listener()

    def describe(self, state: State) -> str:
        """Return the main output quantities of a state as one line, without values that no body can have."""
        return f"stage {state.stage!r}, " * bool(state.stage) + ", ".join(
            f"{k.replace('_', ' ')} {state.measures[k]:.6g}" for k in self.curve.problem.description.main_columns
            if abs(state.measures.get(k, math.inf)) < 1e100)
