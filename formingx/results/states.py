"""The accepted states of a run in order: their columns, and states between them."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import ConvergenceError, InputError, finite, known
from ..measures import columns as standard_columns
from ..measures.targets import Bound, Target, is_met, process_time
from ..solve import predictor
from ..solve.branches import branch_points
from ..solve.newton import Failure
from ..solve.path_following import Run
from ..solve.record import Counts, Record, Segment
from ..solve.state import State
from ..solve.stepping import StepControl
from .evaluate.profile import Profiles
from .evaluate.stress import Stresses
from .evaluate.verdict import Verdict

_WRITTEN = 5e-6
"""Largest difference of a number from the same one written with six digits, over the number."""


class _View:
    """Evaluation of the states of one problem: created once."""

    def __init__(self, problem: Any, timed: bool, columns: Mapping[str, Any]):
        self.columns = standard_columns.standard(problem, timed)
        self.columns |= standard_columns.own(problem, columns, self.columns)
        self.profiles, self.stresses, self.verdict = Profiles(problem), Stresses(problem), Verdict(problem)


class States:
    """The states of a run, from the unloaded body to the target: base class of `Path`.

    Attributes:
        record: the solver's record of the run (`formingx.solve.record.Record`).
    """

    def __init__(self, record: Record, timed: bool = False, columns: Mapping[str, Any] | None = None,
                 views: dict[int, _View] | None = None):
        self.record, self._timed, self._own = record, timed, {} if columns is None else columns
        self._views = {} if views is None else views         # by id(problem)
        self._view(record.segments[-1])                      # so that nothing is compiled on the way
        record.on_state.append(self._measure)
        record.judge = lambda state: self._view(record.segments[-1]).verdict.of(state)

    @property
    def segments(self) -> list[Segment]:
        """(problem, states) one after the other: one, unless the run changed its problem on the way."""
        return self.record.segments

    @property
    def states(self) -> list[State]:
        """All accepted states, in order along the path."""
        return self.record.states

    @property
    def counts(self) -> Counts:
        """Cost of the run."""
        return self.record.counts

    @property
    def scene(self) -> Any:
        """The scene as it was given: on the mesh that the run began with."""
        return self.problem.scene.first

    @property
    def problem(self) -> Any:
        """The (last) `Problem`, for further evaluation at a state, within its `at(state)`."""
        return self.record.problem

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, name: str) -> np.ndarray:
        """One measure over all states, shape (len(path),), in the user's units."""
        self._check(name)
        return np.array([state.measures[name] for state in self.states])

    @property
    def columns(self) -> list[str]:
        """Names of the measures that every state has (a run that went on may record others)."""
        return [name for name in self.states[0].measures if name in self.last.measures] if self.states else []

    @property
    def limit_points(self) -> list[State]:
        """States at which the control has a maximum or a minimum along the path."""
        return [state for state in self.states if state.kind == "limit point"]

    @property
    def branch_points(self) -> list[tuple[State, State]]:
        """Neighbours between which another path branches off: the tangent's determinant changes its sign without
        limit point.

        Branch points of which the run warns, from the determinants that its states carry. Modes n = 0 alone, and an
        odd number of them between two states; `Path.stability` sees all. None with a history.
        """
        return [pair for segment in self.segments for pair in branch_points(segment.curve, segment.states)]

    @property
    def jumps(self) -> list[State]:
        """States that the body snapped to; see `State.jump`."""
        return [state for state in self.states if state.kind == "jump"]

    @property
    def ended(self) -> str:
        """Reason for which the run ended before its targets, as a result; "" if it did not."""
        return self.record.ended

    @property
    def last(self) -> State:
        """The last accepted state."""
        return self.record.last

    def met(self, target: Target) -> State | None:
        """Return the state that hit a target of the run, or None."""
        return next((state for state in self.states if state.met and state.met[:2] == target[:2]), None)

    def value(self, measure: str | Bound, state: State) -> float:
        """Return a column, by its name, or a measure bound to the state's problem (`Target.bind`), at a state."""
        segment = self.segment(state)
        if isinstance(measure, str):
            self._check(measure)
            measure = self._view(segment).columns[measure]
        with segment.problem.state_context(state) as problem:
            return measure.value(problem.x, state.control)

    def state(self, stage: str | None = None, time: float | None = None) -> State:
        """Return the last state (of a stage), or the one at a process time (in a stage): solved for where none lies
        there.

        Raises:
            InputError: there is no such stage, or it does not pass that time.
            ConvergenceError: see `at`.
        """
        if stage is not None:
            stages = list(dict.fromkeys(state.stage for state in self.states))
            if stages == [""]:
                raise InputError(f"Path.state: stage {stage!r}: the run has no stages; its states by number are"
                                 f" Path.states[k]")
            known("Path.state: stage", stage, stages)
        there = [state for state in self.states if stage in (None, state.stage)]
        if time is None:
            return there[-1]
        time = finite("Path.state: time", time)
        first, last = there[0].time, there[-1].time
        if not first <= time <= last:
            raise InputError(f"Path.state: time = {time:g}: {f'stage {stage!r}' if stage else 'the run'} goes from"
                             f" {first:g} to {last:g}")
        exact = next((state for state in there if state.time == time), None)
        return exact or self.at(process_time(time), after=there[0])

    def at(self, target: Target, after: State | None = None) -> State:
        """Return the first state of the path that meets the target: solved for, not interpolated; the path stays as
        it is.

        A value just beyond the path's last state, as one written with six digits may lie, is solved for there.

        Args:
            target: for example `pressure(0.4)`.
            after: look only beyond this state of the path, for example beyond a limit point.

        Raises:
            InputError: the path does not pass through that value there.
            ConvergenceError: it does, between two states, but no state was found there.
        """
        if after is not None and after not in self.states:
            raise InputError("Path.at: after: must be a state of this path")
        values: list[float] = []
        refused: list[InputError] = []
        piece: tuple[Segment, State, State, Bound] | None = None
        started = after is None
        for segment in self.segments:
            for left, right in zip(segment.states, segment.states[1:]):
                started = started or left is after
                if not started or left.setting != right.setting:
                    continue
                with segment.problem.state_context(left):  # a travel belongs to the control of the stage
                    try:
                        bound = target.bind(segment.problem)
                    except InputError as error:
                        refused.append(error)
                        continue
                    a, b = ends = [segment.curve.value(bound, s.x, s.control) for s in (left, right)] \
                        if bound.smooth else [self.value(bound, s) for s in (left, right)]
                    for value, state in zip(ends, (left, right)):
                        if is_met(target, bound.size, value):
                            return state
                    if (a - target.value) * (b - target.value) < 0:
                        return self._between(segment, left, right, target, bound)
                    values += ends
                    piece = segment, left, right, bound
        if piece is not None and piece[2] is self.last and 0 < (target.value - b) * np.sign(b - a) < _WRITTEN * abs(b):
            segment, left, right, bound = piece
            with segment.problem.state_context(left), contextlib.suppress(ConvergenceError):
                found = self._between(segment, left, right, target, bound)
                if segment.curve.distance(right, found) < segment.curve.distance(left, right):
                    return found
        if refused and not values:
            raise refused[0]
        raise InputError(f"the path does not pass {target.name.replace('_', ' ')} = {target.value:.9g}: " + (
            f"its values lie between {min(values):.9g} and {max(values):.9g}" if values else "it has one state there"))

    def _between(self, segment: Segment, left: State, right: State, target: Target, bound: Bound) -> State:
        """Return the state between two neighbours that meets a target; the problem stands at the first."""
        if segment.problem.has_history:                      # states between depend on the way to them
            found = self._run_to(segment, left, right, target, bound)
        else:
            found = segment.curve.find(left, right, bound, target)
            found.stage, found.setting = left.stage, left.setting
            found.measures = self._measures(segment, found)
        segment.curve.spent()
        return found

    def _run_to(self, segment: Segment, left: State, right: State, target: Target, bound: Bound) -> State:
        """Return the state that a run would reach that continues from `left` to the target."""
        if left.time < right.time and not left.setting["rate"][-1]:
            raise InputError(f"the path passes {target} between two of its states, in a stage that follows or holds a"
                             f" measure: none can be solved for there afterwards; run with intermediate=[...]"
                             f" to have one")
        record = Record(segment.problem, segment.curve)
        record.segments[-1].states.append(replace(left, met=None))
        record.stage = left.stage
        before = segment.states[: segment.states.index(left) + 1]
        kept: dict[str, Any] = next((s.stepping for s in reversed(before) if s.stepping and s.setting == left.setting),
                                    {})
        step, given = StepControl(**kept.get("step", {})), {k: v for k, v in kept.items() if k == "accuracy"}
        try:
            Run(record, [(target, bound)], step, **given).follow(200, False, None)
        except (ConvergenceError, Failure) as error:
            raise ConvergenceError(f"the path passes {target} between two of its states, but no state was found there:"
                                   f" {error}; run with intermediate=[...] to have one") from None
        for k in range(2, len(record.states) + 1):
            self._fill(segment, record.states[:k])
        return record.last

    def between(self, a: State, b: State, fraction: float) -> State:
        """Return a body on the smooth (cubic) path from a state to the next; for drawing: it is no solution."""
        if a.setting != b.setting:                           # a stage begins
            return b
        x, control = self.segment(b).curve.interpolate(a, b, fraction)
        return replace(b, x=x, control=control)

    def distance(self, a: State, b: State) -> float:
        """Arc length from a state to the next along the tangent (dimensionless)."""
        return self.segment(b).curve.progress(a, b) if a.setting == b.setting else 0.0

    def curve(self, *columns: str, points: int = 12) -> list[np.ndarray]:
        """Columns along the smooth path through the states, `points` to each piece; for drawing.

        Values at the states themselves are theirs. Between them, quantities of displacements and control alone
        follow the cubic path; other columns (forces, energies) follow a monotone cubic through their values, by arc
        length.
        """
        self._check(*columns)
        rows = []
        for segment in self.segments:
            for states in _pieces(segment.states):
                rows.append([states[0].measures[c] for c in columns])
                rows += self._smooth(segment, states, columns, points) if len(states) > 1 else []
        return list(np.array(rows).T)

    def _smooth(self, segment: Segment, states: list[State], columns: Any, points: int) -> list[list[float]]:
        """Rows of columns after the first, to the last, of states with one setting."""
        from scipy.interpolate import PchipInterpolator
        known_columns = self._view(segment).columns
        at = np.concatenate([[0.0], np.cumsum([max(segment.curve.distance(a, b), 1e-300)
                                               for a, b in zip(states, states[1:])])])
        smooth = {c: known_columns[c] for c in columns if c in known_columns and known_columns[c].smooth}
        through = {c: PchipInterpolator(at, [s.measures[c] for s in states]) for c in columns if c not in smooth}
        rows = []
        with segment.problem.state_context(states[0]):
            for k, (a, b) in enumerate(zip(states, states[1:])):
                for fraction in np.arange(1, points) / points:
                    there, s = segment.curve.interpolate(a, b, fraction), at[k] + fraction * (at[k + 1] - at[k])
                    rows.append([segment.curve.value(smooth[c], *there) if c in smooth else float(through[c](s))
                                 for c in columns])
                rows.append([b.measures[c] for c in columns])
        return rows

    def describe(self, state: State) -> str:
        """Return a state's main numbers in one line."""
        return self.record.describe(state)

    def _check(self, *names: str) -> None:
        for name in names:
            if name not in self.columns:
                raise InputError(f"Path: column {name!r} is not known; known: {', '.join(self.columns)}")

    def _measure(self, state: State) -> None:
        """Fill the columns of an accepted state."""
        segment = self.segments[-1]
        self._fill(segment, self.states if len(segment.states) == 1 else segment.states)

    def _fill(self, segment: Segment, states: list[State]) -> None:
        """Fill the columns of the last of some states, which may be the first of all."""
        state = states[-1]
        state.measures = self._measures(segment, state)
        if "dissipated_power" in state.measures:
            state.measures["dissipated_energy"] = 0.0 if len(states) == 1 else (
                states[-2].measures["dissipated_energy"] + self._dissipated(segment, states))

    def _dissipated(self, segment: Segment, states: list[State]) -> float:
        """Energy that materials have dissipated between the last two of some states, by Simpson's rule.

        Half way in time the body is on the curve that the run takes it along; its history variables are advanced to
        there.
        """
        before, state = states[-2:]
        if not before.time < state.time:                     # as where a mesh is made again
            return 0.0
        column, time = self._view(segment).columns["dissipated_power"], (before.time + state.time) / 2
        if state.setting["rate"][-1]:
            x, control = segment.curve.interpolate(before, state, 0.5)
        else:                                                # a flow, whose tangents are at a fixed time
            past = [*predictor.before(states[:-1], time, predictor.CUBIC - 1), state]
            weights = predictor.weights(past, time)
            x, control = weights @ [s.x for s in past], float(weights @ [s.control for s in past])
        with segment.problem.state_context(before) as problem:
            if not state.setting["rate"][-1]:
                problem.clock = time
            time = problem.forms.time_at(control)
            problem.x.array_w[:] = x
            problem.look_at(x, control)
            for history in problem.materials:
                history.advance(x, control)
            half = column.value(problem.x, control)
        a, b = (s.measures["dissipated_power"] for s in (before, state))
        # the parabola through the three powers, at times that need not be even
        share = (time - before.time) / (state.time - before.time)
        return (state.time - before.time) * (
            a * (3 - 1 / share) + half / (share * (1 - share)) + b * (3 - 1 / (1 - share))) / 6

    def _measures(self, segment: Segment, state: State) -> dict[str, float]:
        columns = self._view(segment).columns
        with segment.problem.state_context(state) as problem:
            return {name: bound.value(problem.x, state.control) for name, bound in columns.items()}

    def segment(self, state: State | None = None) -> Segment:
        """Return the segment that a state (None: the last) is of, or lies in."""
        mesh = (state or self.last).setting.get("mesh", 0)
        return next((s for s in self.segments if s.states and s.states[0].setting.get("mesh", 0) == mesh),
                    self.segments[-1])

    def alone(self, state: State) -> Any:
        """Return the part of the path on the mesh that a state is on: all of it, unless the mesh was made again on
        the way."""
        if len(self.segments) == 1:
            return self
        segment = self.segment(state)
        record = Record(segment.problem, segment.curve)
        record.segments, record.counts = [segment], self.counts
        return type(self)(record, self._timed, self._own, self._views)

    @property
    def admissibility(self) -> Verdict:
        """Admissibility check of the states of the last segment."""
        return self._view(self.segments[-1]).verdict

    def _view(self, segment: Segment) -> _View:
        key = id(segment.problem)
        if key not in self._views:
            self._views[key] = _View(segment.problem, self._timed, self._own)
        return self._views[key]


def _pieces(states: list[State]) -> list[list[State]]:
    """Neighbours with the same setting."""
    return [list(group) for _, group in itertools.groupby(states, key=lambda state: state.setting)]
