"""Accepted states of a run in order, their output quantities, and states between them."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import ConvergenceError, InputError, check_name, finite
from ..measures import columns as standard_columns
from ..measures.quantities import Quantity
from ..measures.targets import Target, is_met, process_time
from ..solve.branches import branch_points
from ..solve.newton import Failure
from ..solve.path_following import Run
from ..solve.record import Counts, Record, Segment
from ..solve.state import State
from ..solve.stepping import StepControl
from .evaluate.admissibility import AdmissibilityCheck
from .evaluate.dissipation import dissipated_energy
from .evaluate.profile import Profiles
from .evaluate.stress import Stresses

_ROUNDING_ERROR = 0.5 * 10.0 ** (1 - 6)
"""Largest relative error of a number that is rounded to six digits."""


class _View:
    """Objects that evaluate the states of one problem.

    Attributes:
        columns: {name of a column: its quantity}.
        profiles: computes the `Profile` of a state.
        stresses: computes the `StressField` of a state.
        admissibility: checks whether a state is admissible.
    """

    def __init__(self, problem: Any, timed: bool, columns: Mapping[str, Any]):
        self.columns = standard_columns.standard(problem, timed)
        self.columns |= standard_columns.user_defined(problem, columns, self.columns)
        self.profiles, self.stresses = Profiles(problem), Stresses(problem)
        self.admissibility = AdmissibilityCheck(problem)


class States:
    """Base class of `Path`: the states of a run from the unloaded body to the target.

    Args:
        record: the solver's record of the run (`formingx.solve.record.Record`).
        timed: True if the process time is a column.
        columns: {name: quantity} of further columns that the user asked for (`formingx.trace(record=)`); default none.
        other: another path on the same problems, or None. If it has the same columns, its compiled forms are used.

    Attributes:
        record: the solver's record of the run.
    """

    def __init__(self, record: Record, timed: bool = False, columns: Mapping[str, Any] | None = None,
                 other: States | None = None):
        self.record, self._timed, self._columns = record, timed, {} if columns is None else columns
        self._views: dict[int, _View] = {}                  # by id(problem)
        if other is not None and (other._timed, other._columns) == (timed, self._columns):
            self._views = other._views
        self._view(record.segments[-1])                      # compiles the forms before the run
        record.hooks.on_state.append(self._measure)
        record.judge = lambda state: self._view(record.segments[-1]).admissibility.reason(state)

    @property
    def segments(self) -> list[Segment]:
        """Segments of the run in order, each with the problem on one mesh and its states; one without remeshing."""
        return self.record.segments

    @property
    def states(self) -> list[State]:
        """All accepted states, in order along the path."""
        return self.record.states

    @property
    def counts(self) -> Counts:
        """Cost of the run: steps, iterations, factorisations (`formingx.solve.record.Counts`)."""
        return self.record.counts

    @property
    def scene(self) -> Any:
        """The `Scene` as it was given to the run, on its first mesh."""
        return self.problem.scene.first

    @property
    def problem(self) -> Any:
        """The discretised `Problem` on the last mesh; evaluate it within `problem.state_context(state)`."""
        return self.record.problem

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, name: str) -> np.ndarray:
        """Return an output quantity in all states, shape (len(path),), in the units of the script.

        Args:
            name: name of a column (`columns`).

        Raises:
            InputError: there is no such column.
        """
        self._check(name)
        return np.array([state.measures[name] for state in self.states])

    @property
    def columns(self) -> list[str]:
        """Names of the output quantities (columns) that both the first and the last state have.

        A run that was continued from a checkpoint may add columns. Earlier states lack them, so they are not named.
        """
        return [name for name in self.states[0].measures if name in self.last.measures] if self.states else []

    @property
    def limit_points(self) -> list[State]:
        """States at which the load parameter (control) has a maximum or a minimum along the path."""
        return [state for state in self.states if state.kind == "limit point"]

    @property
    def branch_points(self) -> list[tuple[State, State]]:
        """Pairs of successive states between which the path has a branch point (bifurcation).

        There the determinant of the tangent stiffness changes its sign without a limit point. So only modes in the
        section (axisymmetric, n = 0) and only an odd number of them are found; `Path.stability` finds all. The list is
        empty for materials with history variables.
        """
        return [pair for segment in self.segments for pair in branch_points(segment.curve, segment.states)]

    @property
    def jumps(self) -> list[State]:
        """States that the body reached by snap-through; see `State.jump`."""
        return [state for state in self.states if state.kind == "jump"]

    @property
    def ended(self) -> str:
        """Reason why the run ended before its targets; "" if it reached them."""
        return self.record.ended

    @property
    def last(self) -> State:
        """The last accepted state."""
        return self.record.last

    def target_state(self, target: Target) -> State | None:
        """Return the state in which the run met one of its targets exactly, or None if no state met it.

        Args:
            target: a target of the run (`until` or `intermediate`), or an equal one.
        """
        return next((state for state in self.states if state.target and state.target[:2] == target[:2]), None)

    def value(self, measure: str | Quantity, state: State) -> float:
        """Return an output quantity in a state, in the units of the script.

        Args:
            measure: name of a column, or an output quantity of the problem of the state (from `Target.bind`).
            state: a state of this path, or one that `Path.state_at` solved for.

        Raises:
            InputError: there is no such column.
        """
        segment = self.segment(state)
        if isinstance(measure, str):
            self._check(measure)
            measure = self._view(segment).columns[measure]
        with segment.problem.state_context(state) as problem:
            return measure.value(problem.x, state.control)

    def state(self, stage: str | None = None, time: float | None = None) -> State:
        """Return the state of a stage or of a process time; the last state of the run without arguments.

        Args:
            stage: name of a stage; default any.
            time: process time; default the end of the stage or run. If no state has this time, one is solved for.

        Raises:
            InputError: there is no such stage, or it does not reach that time.
            ConvergenceError: the state at that time could not be solved for (`Path.state_at`).
        """
        if stage is not None:
            stages = list(dict.fromkeys(state.stage for state in self.states))
            if stages == [""]:
                raise InputError(f"Path.state: stage {stage!r}: the run has no stages; its states by number are"
                                 f" Path.states[k]")
            check_name("Path.state: stage", stage, stages)
        candidates = [state for state in self.states if stage in (None, state.stage)]
        if time is None:
            return candidates[-1]
        time = finite("Path.state: time", time)
        first, last = candidates[0].time, candidates[-1].time
        if not first <= time <= last:
            where = f"stage {stage!r}" if stage else "the run"
            raise InputError(f"Path.state: time = {time:g}: {where} goes from {first:g} to {last:g}")
        exact = next((state for state in candidates if state.time == time), None)
        return exact or self.state_at(process_time(time), after=candidates[0])

    def state_at(self, target: Target, after: State | None = None) -> State:
        """Return the first state of the path that meets a target.

        It is solved for between two states of the path, not interpolated, and is not added to the path. The target may
        be a rounded value, which lies beyond the last state by less than 5e-6 of its value.

        Args:
            target: the target, for example `pressure(0.4)`.
            after: a state of the path; only the path beyond it is searched, for example beyond a limit point.

        Raises:
            InputError: the path does not pass through that value, the stage controls an output quantity in time, or
                `after` is not a state of the path.
            ConvergenceError: two states enclose the value, but the solver did not converge between them.
        """
        if after is not None and after not in self.states:
            raise InputError("Path.state_at: after: must be a state of this path")
        values: list[float] = []
        refused: list[InputError] = []
        piece: tuple[Segment, State, State, Quantity] | None = None
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
        if piece is not None and piece[2] is self.last and (
                0 < (target.value - b) * np.sign(b - a) < _ROUNDING_ERROR * abs(b)):
            segment, left, right, bound = piece
            with segment.problem.state_context(left), contextlib.suppress(ConvergenceError):
                found = self._between(segment, left, right, target, bound)
                if segment.curve.distance(right, found) < segment.curve.distance(left, right):
                    return found
        if refused and not values:
            raise refused[0]
        raise InputError(f"the path does not pass {target.name.replace('_', ' ')} = {target.value:.9g}: " + (
            f"its values lie between {min(values):.9g} and {max(values):.9g}" if values else "it has one state there"))

    def _between(self, segment: Segment, left: State, right: State, target: Target, bound: Quantity) -> State:
        """Return the state that meets a target between two successive states, with its output quantities.

        `bound` is the quantity of the target in the problem. A stage that controls one is an InputError, no convergence
        a ConvergenceError.
        """
        if segment.problem.has_history:                      # states between them depend on the history
            found = self._run_to(segment, left, right, target, bound)
        else:
            found = segment.curve.state_at_target(left, right, bound, target)
            found.stage, found.setting = left.stage, left.setting
            found.measures = self._measures(segment, found)
        segment.curve.spent()
        return found

    def _run_to(self, segment: Segment, left: State, right: State, target: Target, bound: Quantity) -> State:
        """Return the state between two successive states that meets a target, by a run from the first of them, `left`.

        The steps of this run update the history variables. `right` is the second state, `segment` contains both, and
        `bound` is the output quantity of the target. An InputError is raised if the stage controls an output quantity,
        a ConvergenceError if no state is found.
        """
        if left.time < right.time and not left.setting["rate"][-1]:
            raise InputError(f"the path passes {target} between two of its states, in a stage that controls an output"
                             f" quantity: no state can be solved for there afterwards; run with intermediate=[...] to"
                             f" have one")
        record = Record(segment.problem, segment.curve)
        record.segments[-1].states.append(replace(left, target=None))
        record.stage = left.stage
        before = segment.states[: segment.states.index(left) + 1]
        data: dict[str, Any] = next((s.stepping for s in reversed(before) if s.stepping and s.setting == left.setting),
                                    {})
        step, given = StepControl(**data.get("step", {})), {k: v for k, v in data.items() if k == "accuracy"}
        try:
            Run(record, [(target, bound)], step, **given).follow(200, False, None)
        except (ConvergenceError, Failure) as error:
            raise ConvergenceError(f"the path passes {target} between two of its states, but no state was found there:"
                                   f" {error}; run with intermediate=[...] to have one") from None
        for k in range(2, len(record.states) + 1):
            self._fill(segment, record.states[:k])
        return record.last

    def interpolate(self, a: State, b: State, fraction: float) -> State:
        """Return a state interpolated between two successive states, for drawing; it is not in equilibrium.

        Unknowns and control follow the cubic through both states and their tangents; the rest is copied from `b`. If
        `b` begins another stage, it is returned unchanged.

        Args:
            a: a state of the path.
            b: the next state.
            fraction: position between them, 0 at `a`, 1 at `b`.
        """
        if a.setting != b.setting:                           # a stage begins
            return b
        x, control = self.segment(b).curve.interpolate(a, b, fraction)
        return replace(b, x=x, control=control)

    def distance(self, a: State, b: State) -> float:
        """Return the distance from a state to the next one in the metric of arc length, dimensionless.

        The difference of both states is projected on the tangent of the path. Between two stages the distance is 0.

        Args:
            a: a state of the path.
            b: the next state.
        """
        return self.segment(b).curve.progress(a, b) if a.setting == b.setting else 0.0

    def curve(self, *columns: str, points: int = 12) -> list[np.ndarray]:
        """Return the values of columns at m points along a smooth curve through the states, for drawing.

        Smooth functions of displacements and control, such as a height, are evaluated on the cubic path between two
        states. Other columns, such as forces and energies, follow a monotone cubic in arc length through their values.

        Args:
            columns: names of columns.
            points: number of intervals from one state to the next.

        Returns:
            For each column its values, shape (m,), in the units of the script.

        Raises:
            InputError: there is no such column.
        """
        self._check(*columns)
        rows = []
        for segment in self.segments:
            for states in _pieces(segment.states):
                rows.append([states[0].measures[c] for c in columns])
                rows += self._smooth(segment, states, columns, points) if len(states) > 1 else []
        return list(np.array(rows).T)

    def _smooth(self, segment: Segment, states: list[State], columns: Any, points: int) -> list[list[float]]:
        """Return the values of columns on a smooth curve through successive states of one stage (`curve`).

        A row has the values of the columns at a point; the first state gets no row. `columns` are names of columns,
        `points` is the number of points from one state to the next, and `segment` contains the states.
        """
        from scipy.interpolate import PchipInterpolator
        known_columns = self._view(segment).columns
        arc_lengths = np.concatenate([[0.0], np.cumsum([max(segment.curve.distance(a, b), 1e-300)
                                                        for a, b in zip(states, states[1:])])])
        smooth = {c: known_columns[c] for c in columns if c in known_columns and known_columns[c].smooth}
        interpolants = {c: PchipInterpolator(arc_lengths, [s.measures[c] for s in states])
                        for c in columns if c not in smooth}
        rows = []
        with segment.problem.state_context(states[0]):
            for k, (a, b) in enumerate(zip(states, states[1:])):
                for fraction in np.arange(1, points) / points:
                    point = segment.curve.interpolate(a, b, fraction)
                    s = arc_lengths[k] + fraction * (arc_lengths[k + 1] - arc_lengths[k])
                    rows.append([segment.curve.value(smooth[c], *point) if c in smooth else float(interpolants[c](s))
                                 for c in columns])
                rows.append([b.measures[c] for c in columns])
        return rows

    def describe(self, state: State) -> str:
        """Return the main numbers of a state as one line of text."""
        return self.record.describe(state)

    def _check(self, *names: str) -> None:
        """Check that columns of these names exist; an InputError names the first that does not."""
        for name in names:
            if name not in self.columns:
                raise InputError(f"Path: column {name!r} is not known; known: {', '.join(self.columns)}")

    def _measure(self, state: State) -> None:
        """Compute `State.measures` of a newly accepted state; the run calls this function (`RunHooks.on_state`)."""
        segment = self.segments[-1]
        self._fill(segment, self.states if len(segment.states) == 1 else segment.states)

    def _fill(self, segment: Segment, states: list[State]) -> None:
        """Compute `State.measures` of the last of successive states of a segment, the dissipated energy included."""
        state = states[-1]
        state.measures = self._measures(segment, state)
        if "dissipated_power" in state.measures:
            state.measures["dissipated_energy"] = 0.0 if len(states) == 1 else (
                states[-2].measures["dissipated_energy"]
                + dissipated_energy(segment, states, self._view(segment).columns["dissipated_power"]))

    def _measures(self, segment: Segment, state: State) -> dict[str, float]:
        """Return {column: value} of a state in the units of the script, without the dissipated energy."""
        columns = self._view(segment).columns
        with segment.problem.state_context(state) as problem:
            return {name: bound.value(problem.x, state.control) for name, bound in columns.items()}

    def segment(self, state: State | None = None) -> Segment:
        """Return the segment of the run with the mesh of a state; default the mesh of the last state."""
        mesh = (state or self.last).setting.get("mesh", 0)
        return next((s for s in self.segments if s.states and s.states[0].setting.get("mesh", 0) == mesh),
                    self.segments[-1])

    def same_mesh(self, state: State) -> Any:
        """Return a path of the states on the mesh of a given state; this path itself if the run has one mesh."""
        if len(self.segments) == 1:
            return self
        segment = self.segment(state)
        record = Record(segment.problem, segment.curve)
        record.segments, record.counts = [segment], self.counts
        return type(self)(record, self._timed, self._columns, self)

    @property
    def admissibility(self) -> AdmissibilityCheck:
        """Object that checks whether states on the last mesh are admissible."""
        return self._view(self.segments[-1]).admissibility

    def _view(self, segment: Segment) -> _View:
        """Return the objects that evaluate columns, profiles, stresses and admissibility of the states of a segment."""
        key = id(segment.problem)
        if key not in self._views:
            self._views[key] = _View(segment.problem, self._timed, self._columns)
        return self._views[key]


def _pieces(states: list[State]) -> list[list[State]]:
    """Return the states in groups of successive states with equal step data."""
    return [list(group) for _, group in itertools.groupby(states, key=lambda state: state.setting)]
