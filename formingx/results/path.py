"""What a run gives back: the accepted states in order, and what can be read off them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ConvergenceError, InputError, as_points, finite, known
from ..measures import columns as standard_columns
from ..measures.targets import Bound, Target, is_met, process_time
from ..solve import predictor
from ..solve.newton import Failure
from ..solve.path_following import Run
from ..solve.record import Counts, Record, Segment
from ..solve.state import State
from ..solve.stepping import StepControl
from .evaluate.profile import Profile, Profiles
from .evaluate.stress import Stresses, StressField
from .evaluate.verdict import Verdict
from .show.picture import Picture


class _View:
    """What is read off the states of one problem: created once."""

    def __init__(self, problem: Any, timed: bool, columns: Mapping[str, Any]):
        self.columns = standard_columns.standard(problem, timed)
        self.columns |= standard_columns.own(problem, columns, self.columns)
        self.profiles, self.stresses, self.verdict = Profiles(problem), Stresses(problem), Verdict(problem)


class Path:
    """The states of a run, from the unloaded body to the target.

    Attributes:
        record: what the solver keeps of the run (`formingx.solve.record.Record`).
    """

    def __init__(self, record: Record, timed: bool = False, columns: Mapping[str, Any] | None = None):
        self.record, self._timed, self._own = record, timed, {} if columns is None else columns
        self._views: dict[int, _View] = {}
        self._walls: Any = None
        self._watch: Any = None
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
        """What the run cost."""
        return self.record.counts

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
    def jumps(self) -> list[State]:
        """States that the body snapped to; see `State.jump`."""
        return [state for state in self.states if state.kind == "jump"]

    @property
    def ended(self) -> str:
        """Why the run ended before its targets, as a result: the body snaps, and no state follows; "" if it did not."""
        return self.record.ended

    @property
    def last(self) -> State:
        """The last accepted state."""
        return self.record.last

    def met(self, target: Target) -> State | None:
        """The state that hit a target of the run, or None."""
        return next((state for state in self.states if state.met and state.met[:2] == target[:2]), None)

    def value(self, measure: str | Bound, state: State) -> float:
        """A column, by its name, or a measure bound to the state's problem (`Target.bind`), at a state."""
        segment = self._segment(state)
        if isinstance(measure, str):
            self._check(measure)
            measure = self._view(segment).columns[measure]
        with segment.problem.at(state) as problem:
            return measure.value(problem.x, state.control)

    def state(self, stage: str | None = None, time: float | None = None) -> State:
        """The last state (of a stage), or the one at a process time (in a stage): solved for where none lies there.

        Raises:
            InputError: there is no such stage, or it does not pass that time.
            ConvergenceError: see `at`.
        """
        if stage is not None:
            known("Path.state: stage", stage, list(dict.fromkeys(state.stage for state in self.states)))
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
        """The first state of the path that meets the target: solved for, not interpolated; the path stays as it is.

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
        started = after is None
        for segment in self.segments:
            for left, right in zip(segment.states, segment.states[1:]):
                started = started or left is after
                if not started or left.setting != right.setting:
                    continue
                with segment.problem.at(left):              # a travel is that of what the stage drives
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
        if refused and not values:
            raise refused[0]
        raise InputError(f"the path does not pass {target}: " + (
            f"its values lie between {min(values):.6g} and {max(values):.6g}" if values else "it has one state there"))

    def _between(self, segment: Segment, left: State, right: State, target: Target, bound: Bound) -> State:
        """The state between two neighbours that meets a target; the problem stands at the first."""
        if segment.problem.has_history:                      # what lies between depends on how it is come to
            found = self._run_to(segment, left, right, target, bound)
        else:
            found = segment.curve.find(left, right, bound, target)
            found.stage, found.setting = left.stage, left.setting
            found.measures = self._measures(segment, found)
        segment.curve.spent()
        return found

    def _run_to(self, segment: Segment, left: State, right: State, target: Target, bound: Bound) -> State:
        """The state that a run would come to that goes on from `left` to the target."""
        if left.time < right.time and not left.setting["rate"][-1]:
            raise InputError(f"the path passes {target} within a flow, between two of its states: run with"
                             f" through=[...] to have a state there")
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
                                   f" {error}; run with through=[...] to have one") from None
        for k in range(2, len(record.states) + 1):
            self._fill(segment, record.states[:k])
        return record.last

    def between(self, a: State, b: State, fraction: float) -> State:
        """A body on the smooth (cubic) path from a state to the next; for drawing: it is no solution."""
        if a.setting != b.setting:                           # a stage begins
            return b
        x, control = self._segment(b).curve.interpolate(a, b, fraction)
        return replace(b, x=x, control=control)

    def distance(self, a: State, b: State) -> float:
        """Arc length from a state to the next along the tangent (dimensionless)."""
        return self._segment(b).curve.progress(a, b) if a.setting == b.setting else 0.0

    def curve(self, *columns: str, points: int = 12) -> list[np.ndarray]:
        """Columns along the smooth path through the states, `points` to each piece; for drawing.

        Values at the states themselves are theirs. Between them, what follows from displacements and control alone is
        that of the cubic path; other columns (forces, energies) follow a monotone cubic through their values, by arc
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
        with segment.problem.at(states[0]):
            for k, (a, b) in enumerate(zip(states, states[1:])):
                for fraction in np.arange(1, points) / points:
                    there, s = segment.curve.interpolate(a, b, fraction), at[k] + fraction * (at[k + 1] - at[k])
                    rows.append([segment.curve.value(smooth[c], *there) if c in smooth else float(through[c](s))
                                 for c in columns])
                rows.append([b.measures[c] for c in columns])
        return rows

    def doubts(self) -> list[tuple[str, str]]:
        """(how bad: "serious" or "minor"; what) of contact in the last state; collective."""
        return self._view(self.segments[-1]).verdict.doubts(self.last)

    def profile(self, state: State | None = None) -> Profile:
        """Deformed outline and thickness of a sheet at a state (default: the last)."""
        state = state or self.last
        return self._view(self._segment(state)).profiles.of(state)

    def stress(self, state: State | None = None) -> StressField:
        """Stresses and stretches at a state (default: the last), layer by layer."""
        state = state or self.last
        return self._view(self._segment(state)).stresses.of(state)

    def describe(self, state: State) -> str:
        """A state's main numbers in one line."""
        return self.record.describe(state)

    def _check(self, *names: str) -> None:
        for name in names:
            if name not in self.columns:
                raise InputError(f"Path: column {name!r} is not known; known: {', '.join(self.columns)}")

    def _measure(self, state: State) -> None:
        """Fill the columns of an accepted state."""
        segment = self.segments[-1]
        self._fill(segment, segment.states)

    def _fill(self, segment: Segment, states: list[State]) -> None:
        """Fill the columns of the last of some states, which may be the first of all."""
        state = states[-1]
        state.measures = self._measures(segment, state)
        if "dissipated_power" in state.measures:
            state.measures["dissipated_energy"] = 0.0 if len(states) == 1 else (
                states[-2].measures["dissipated_energy"] + self._dissipated(segment, states))

    def _dissipated(self, segment: Segment, states: list[State]) -> float:
        """Energy that materials have dissipated between the last two of some states, by Simpson's rule.

        Half way in time the body is on the curve that the run takes it along; what it remembers is advanced to there.
        """
        before, state = states[-2:]
        if not before.time < state.time:
            return 0.0
        column, time = self._view(segment).columns["dissipated_power"], (before.time + state.time) / 2
        if state.setting["rate"][-1]:
            x, control = segment.curve.interpolate(before, state, 0.5)
        else:                                                # a flow, whose tangents are at a fixed time
            past = [*predictor.before(states[:-1], time, predictor.CUBIC - 1), state]
            weights = predictor.weights(past, time)
            x, control = weights @ [s.x for s in past], float(weights @ [s.control for s in past])
        with segment.problem.at(before) as problem:
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
        with segment.problem.at(state) as problem:
            return {name: bound.value(problem.x, state.control) for name, bound in columns.items()}

    def _segment(self, state: State) -> Segment:
        """The segment that a state is of; the last one if it is of none."""
        if len(self.segments) > 1:
            return next((s for s in self.segments if any(state is one for one in s.states)), self.segments[-1])
        return self.segments[-1]

    def _view(self, segment: Segment) -> _View:
        key = id(segment.problem)
        if key not in self._views:
            self._views[key] = _View(segment.problem, self._timed, self._own)
        return self._views[key]

    def to_csv(self, file: Any) -> None:
        """Write one row per state: stage (of a process), kind, iterations and every measure (rank 0 writes)."""
        from . import files
        files.write_path(self, file)

    def save(self, folder: Any) -> None:
        """Write every state to a checkpoint folder, to look at later or to go on from (`formingx.load`).

        Raises:
            InputError: the folder holds another run.
            OSError: it cannot be written.
        """
        from .files.checkpoint import Checkpoint
        Checkpoint(folder, self).write()

    def to_vtx(self, folder: Any, states: Any = None) -> None:
        """Write fields of states (default: the last) for ParaView, a time step each: `formingx.results.files.fields`.

        Args:
            folder: its name ends in .bp.
            states: a state, several in order, or "all".
        """
        from .files import fields
        fields.to_vtx(self, folder, states)

    def to_xdmf(self, file: Any, states: Any = None) -> None:
        """The same fields as `to_vtx`, for programs that do not read VTX; the name ends in .xdmf."""
        from .files import fields
        fields.to_xdmf(self, file, states)

    def animate(self, file: Any, frames: int = 60, seconds: float = 5.0, *, units: Any = None) -> Picture:
        """Draw the forming as a moving picture, a GIF or an MP4: the sheet's section and the loading curve (rank 0).

        Returns the file, which a notebook shows. units: a `formingx.Units`, for the labels.

        The frames are evenly spread over the process (`formingx.results.show.record.progress`), on the (cubic) path
        through the states; the last one stands for a second more.

        Raises:
            InputError: the name ends neither in .gif nor in .mp4, there is no ffmpeg to make an MP4, a number is not
                allowed, or the mesh is no sheet.
        """
        from ..units import NONE
        from .show import animation
        animation.animate(self, file, frames, seconds, units or NONE)
        return Picture(file)

    def report(self, file: Any = "report.html", title: str = "", failure: Any = None, *, units: Any = None,
               density: float | None = None, trim: Any = None) -> FilePath:
        """Write one HTML file that shows the run: the part, the process, curves, inputs, warnings (rank 0 writes).

        Returns where it is.

        Args:
            title: its heading.
            failure: the `ConvergenceError` that ended the run, if one did.
            units: a `formingx.Units`, for the labels; density, trim: see `Path.part`.

        Raises:
            InputError: plotly is not installed.
            OSError: the file cannot be written.
        """
        from ..units import NONE
        from .show import report
        return report.write(report.of_path(self), file, title, failure, self.problem.comm, units or NONE, density, trim)

    def plot(self, y: str, x: str, axes: Any = None, **style: Any) -> Any:
        """Draw column `y` over column `x`; returns the matplotlib axes."""
        from .show import plots
        return plots.curve(self, y, x, axes, **style)

    def plot_convergence(self, axes: Any = None) -> Any:
        """Draw the correction (3.5.1) of every Newton iteration of every state; returns the matplotlib axes."""
        from .show import plots
        return plots.convergence(self, axes)

    def view3d(self, file: Any, state: State | None = None) -> Picture:
        """Draw the sheet of a state (default: the last), coloured by thickness, as PNG; returns it, for a notebook.

        It is revolved about the axis, or, in plane strain, extruded.
        """
        from .show import views
        axisymmetric = self.problem.scene.kinematics.axisymmetric
        (views.revolved if axisymmetric else views.extruded)(self.profile(state), file, self.problem.comm)
        return Picture(file)

    def stability(self, modes: Any = range(9), states: Any = 20) -> Any:
        """Which modes that vary round the body are unstable, and where the path loses them (`Stability`); print it.

        modes: waves round the axis; in plane strain wave numbers along the depth. states: how many, "all", or those.
        An InputError for a membrane, and for a load that does not say how it changes with a mode.
        """
        from .stability import Watch
        self._watch = self._watch or Watch(self)
        return self._watch.look(modes, states)

    def formed(self, state: State | None = None) -> Any:
        """The body of a state (default: the last) as a new `Mesh`, free of stress; an InputError if it is none."""
        from .formed import formed
        return formed(self._segment(state or self.last).problem, state or self.last)

    def wall(self, state: State | None = None) -> Any:
        """The wall of the part at a state (default: the last), place by place (`Wall`): to_csv, to_excel."""
        from .evaluate.wall import Walls
        self._walls = self._walls or Walls(self)
        return self._walls.of(state or self.last)

    def part(self, state: State | None = None, *, density: float | None = None, trim: Any = None, heights: Any = (),
             units: Any = None) -> Any:
        """The formed part in numbers (`Part`): volume, weight, area, least wall and where, evenness; print it.

        Args:
            state: default the last.
            density: of the material at rest (under `ThermalExpansion` where it is free of stress), in g/cm3, for the
                weight in grams; say the unit of length with `units` (without, it is cm).
            trim: the radius at which the part is cut off, or ("height", h), lengths: the last place from the axis where
                the middle line goes beyond it.
            heights: give the wall at these heights too (`Wall.height`).
            units: a `formingx.Units`.

        Raises:
            InputError: the mesh is no sheet, or the part does not reach the trim or a height.
        """
        from ..units import NONE
        from .evaluate.part import part
        axisymmetric = self.problem.scene.kinematics.axisymmetric
        return part(self.wall(state), axisymmetric, density, trim, heights, units or NONE)

    def filling(self, tool: Any = None) -> Any:
        """The gap that is left in each corner of a tool, state by state (`Filling`), and the pressure to fill it.

        Args:
            tool: its name, the `Tool` or the `Contact`; may be left out where there is one.

        Raises:
            InputError: there is no such tool, or it has no corner that the body must fill.
        """
        from .evaluate.contact_face import contact_of
        from .evaluate.filling import filling
        return filling(self, contact_of(self, tool, "filling")[0])

    def contact(self, tool: Any = None, state: State | None = None) -> Any:
        """Contact pressure, friction and gap along the face that meets a tool (`ContactTable`): to_csv, to_excel."""
        from .evaluate.contact_face import ContactFace, contact_of
        return ContactFace(self, contact_of(self, tool, "contact")[0]).of(state or self.last)

    def temperature(self, points: ArrayLike, state: State | None = None) -> np.ndarray:
        """Of the body in a state (default: the last) at reference points (R, Z), shape (n, 2), length: shape (n,)."""
        if self.problem.temperature is None:
            raise InputError("temperature: the scene has none: give Scene a temperature=...")
        with self.problem.at(state or self.last) as problem:
            return problem.temperature.at(as_points("Path.temperature: points", points))

    def tool_forces(self) -> dict[str, np.ndarray]:
        """{tool: its force at all states}: positive when it resists its travel; of a tool that stays, along Z."""
        from .evaluate.contact_face import tool_forces
        return tool_forces(self)

    def work(self) -> dict[str, np.ndarray]:
        """The ledger: {what: energy up to each state, shape (states,)}, stress length^3 (per depth: length^2).

        Work done on the body by each load (its column; of a fixed one "pressure_on_bottom"), each driven support (its
        name, or "support") and each tool that moves; by forces that a stage leaves without balance, as they fade
        ("change"). Energy of changes of temperature ("heat"). Where it went: "strain_energy", above that at first;
        "dissipated_energy" in materials; "friction"; "jumps". "unbalanced": the error of the integrals, and of the run.
        """
        from .evaluate.work import work
        return work(self)

    def to_stl(self, file: Any, state: State | None = None) -> None:
        """Write the part at a state (default: the last) as a solid of triangles, STL (rank 0 writes)."""
        from .files.solid import to_stl
        to_stl(self.profile(state), self.problem.scene.kinematics.axisymmetric, file, self.problem.comm)

    def to_gltf(self, file: Any, state: State | None = None) -> None:
        """Write the part at a state (default: the last) as binary glTF (.glb), coloured by its wall (rank 0 writes)."""
        from .files.solid import to_gltf
        to_gltf(self.profile(state), self.problem.scene.kinematics.axisymmetric, file, self.problem.comm)


def _pieces(states: list[State]) -> list[list[State]]:
    """Neighbours with the same setting."""
    return [list(group) for _, group in itertools.groupby(states, key=lambda state: state.setting)]
