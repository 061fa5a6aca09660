"""What a run gives back: the accepted states in order, and what can be read off them."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ..discrete.schedule import Setting
from ..errors import InputError
from ..solve import targets
from ..solve.targets import Target
from . import columns
from .evaluate.profile import Profile, Profiles
from .evaluate.stress import Stresses, StressField


@dataclass
class State:
    """One converged state.

    Attributes:
        x: the unknowns, this rank's part (dimensionless).
        control: the dimensionless control.
        direction, slope: dx and dcontrol by arc length: the unit tangent of the path.
        measures: {name: value} in the user's units.
        history: the Newton iterations that led to it (`formingx.solve.bordered.Iteration`).
        kind: "start", "step", "target" or "limit point".
        met: the target that it hits, or None.
        memory: what the problem remembers from here on (friction).
        stage: name of the stage of a process; setting: what the stage had set, as plain data (`Setting`).
        stepping: what a run goes on with: its next step, its counts and its target; empty inside a step.
    """

    x: np.ndarray
    control: float
    direction: np.ndarray
    slope: float
    measures: dict[str, float] = field(default_factory=dict)
    history: list = field(default_factory=list)
    kind: str = "step"
    met: Target | None = None
    memory: list = field(default_factory=list)
    stage: str = ""
    setting: dict = field(default_factory=dict)
    stepping: dict = field(default_factory=dict)


@dataclass
class Counts:
    """What a run cost: accepted states (without the start), failed attempts, all Newton iterations, seconds."""

    steps: int = 0
    failures: int = 0
    iterations: int = 0
    seconds: float = 0.0


class Path:
    """The states of a run, from the unloaded body to the target.

    Attributes:
        states: all accepted states, in order along the path.
        counts: what the run cost (`Counts`).
        problem: the `Problem`, for further evaluation.
        stage: name of the stage that is being recorded.
    """

    def __init__(self, problem: Any, branch: Any, start: Path | None = None, timed: bool = False):
        self.problem, self._branch, self.stage = problem, branch, ""
        self._recorded = columns.standard(problem, timed)
        self._profiles, self._stresses = Profiles(problem), Stresses(problem)
        self.states: list[State] = list(start.states) if start else []
        self.counts: Counts = replace(start.counts) if start else Counts()
        branch.iterations += self.counts.iterations

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, name: str) -> np.ndarray:
        """One measure over all states, shape (len(path),), in the user's units."""
        self._check(name)
        return np.array([state.measures[name] for state in self.states])

    def _check(self, *names: str) -> None:
        for name in names:
            if name not in self.columns:
                raise InputError(f"Path: column {name!r} is not known; known: {', '.join(self.columns)}")

    @property
    def columns(self) -> list[str]:
        """Names of the recorded measures."""
        return list(self.states[0].measures) if self.states else []

    @property
    def limit_points(self) -> list[State]:
        """States at which the control has a maximum or a minimum along the path."""
        return [state for state in self.states if state.kind == "limit point"]

    @property
    def last(self) -> State:
        """The last accepted state."""
        return self.states[-1]

    def met(self, target: Target) -> State | None:
        """The state that hit a target of the run, or None."""
        return next((state for state in self.states if state.met and state.met[:2] == target[:2]), None)

    def record(self, state: State) -> None:
        """Take up a state: what has a history goes on from it; evaluate the measures there."""
        self.problem.advance(state.x, state.control)
        state.memory, state.stage, state.setting = self.problem.memory, self.stage, asdict(self.problem.setting)
        state.measures = {name: self.value(bound, state) for name, bound in self._recorded.items()}
        self.states.append(state)
        self.counts.steps += state.kind != "start"

    def value(self, bound: Any, state: State) -> float:
        """A measure bound to this problem (`Target.bind`) at a state."""
        self.go_to(state)
        return self._branch.value(bound, state.x, state.control)

    def go_to(self, state: State) -> None:
        """Make the problem that of the state's stage."""
        if state.setting:
            self.problem.enter(Setting(**state.setting), state.x, state.control)

    def at(self, target: Target, after: State | None = None) -> State:
        """The first state of the path that meets the target: solved for, not interpolated; the path stays as it is.

        Args:
            target: for example `pressure(0.4)`.
            after: look only beyond this state of the path, for example beyond a limit point.

        Raises:
            InputError: the path does not pass through that value there.
            ConvergenceError: it does, between two states, but no state was found there.
        """
        first = next((i for i, s in enumerate(self.states) if s is after), 0 if after is None else None)
        if first is None:
            raise InputError("Path.at: after: must be a state of this path")
        states = self.states[first:]
        values: list[float] = []
        refused: list[InputError] = []
        for left, right in zip(states, states[1:]):
            if left.setting != right.setting:
                continue
            self.go_to(left)                                 # a travel is that of what the stage drives
            try:
                bound = target.bind(self.problem)
            except InputError as error:
                refused.append(error)
                continue
            a, b = ends = [self.value(bound, state) for state in (left, right)]
            for value, state in zip(ends, (left, right)):
                if targets.is_met(target, bound, value):
                    return state
            if (a - target.value) * (b - target.value) < 0:
                now, self.problem.memory = self.problem.memory, left.memory
                try:
                    found = self._branch.find(left, right, bound, target)
                finally:
                    self.problem.memory = now
                found.stage, found.setting = left.stage, left.setting
                found.measures = {name: self.value(m, found) for name, m in self._recorded.items()}
                return found
            values += ends
        if refused and not values:
            raise refused[0]
        raise InputError(f"the path does not pass {target}: " + (
            f"its values lie between {min(values):.6g} and {max(values):.6g}" if values else "it has one state there"))

    def between(self, a: State, b: State, fraction: float) -> tuple[np.ndarray, float]:
        """(x, control) on the smooth (cubic) path from a state to the next; for drawing."""
        if a.setting != b.setting:                           # a stage begins
            return b.x, b.control
        return self._branch.interpolate(a, b, fraction)

    def distance(self, a: State, b: State) -> float:
        """Arc length from a state to the next along the tangent (dimensionless)."""
        return self._branch.progress(a, b) if a.setting == b.setting else 0.0

    def measured(self, at: Any, *columns: str) -> list[float]:
        """Columns at anything that has x, control and setting."""
        return [self.value(self._recorded[c], at) for c in columns]

    def curve(self, *columns: str, points: int = 12) -> list[np.ndarray]:
        """Columns along the smooth (cubic) path through the states, `points` to each piece; for drawing.

        Values at the states themselves are theirs; between them they are interpolated, not solved for.
        """
        self._check(*columns)
        rows = [[self.states[0].measures[c] for c in columns]]
        for a, b in zip(self.states, self.states[1:]):
            self.go_to(b)
            for k in range(1, points if a.setting == b.setting else 0):
                at = self._branch.interpolate(a, b, k / points)
                rows.append([self._branch.value(self._recorded[c], *at) for c in columns])
            rows.append([b.measures[c] for c in columns])
        return list(np.array(rows).T)

    def profile(self, state: State | None = None) -> Profile:
        """Deformed outline and thickness of a sheet at a state (default: the last)."""
        return self._profiles.of(state or self.last)

    def stress(self, state: State | None = None) -> StressField:
        """Stresses and stretches at a state (default: the last), layer by layer."""
        return self._stresses.of(state or self.last)

    def describe(self, state: State) -> str:
        """A state's main numbers in one line."""
        scene = self.problem.scene
        columns = ("process_time", *map(scene.column, scene.drivable), "pole_height", "pole_stretch")
        return f"stage {state.stage!r}, " * bool(state.stage) + ", ".join(
            f"{k.replace('_', ' ')} {state.measures[k]:.6g}" for k in columns if k in state.measures)

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
        """Write fields of states (default: the last) for ParaView, one time step each; see `formingx.results.fields`.

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

    def animate(self, file: Any, frames: int = 60, seconds: float = 5.0) -> None:
        """Draw the forming as a moving picture, a GIF or an MP4: the sheet's section and the loading curve (rank 0).

        The frames are evenly spread over the process (`formingx.results.show.record.progress`), on the (cubic) path
        through the states; the last one stands for a second more.

        Raises:
            InputError: the name ends neither in .gif nor in .mp4, there is no ffmpeg to make an MP4, a number is not
                allowed, or the mesh is no sheet.
        """
        from .show import animation
        animation.animate(self, file, frames, seconds)

    def report(self, file: Any, title: str = "", failure: Any = None, *, units: Any = None,
               density: float | None = None, trim: Any = None) -> None:
        """Write one HTML file that shows the run: the part, the process, curves, inputs, warnings (rank 0 writes).

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
        report.write(report.of_path(self), file, title, failure, self.problem.comm, units or NONE, density, trim)

    def plot(self, y: str, x: str, axes: Any = None, **style: Any) -> Any:
        """Draw column `y` over column `x`; returns the matplotlib axes."""
        from .show import plots
        return plots.curve(self, y, x, axes, **style)

    def plot_convergence(self, axes: Any = None) -> Any:
        """Draw the correction (3.5.1) of every Newton iteration of every state; returns the matplotlib axes."""
        from .show import plots
        return plots.convergence(self, axes)

    def view3d(self, file: Any, state: State | None = None) -> None:
        """Draw the sheet of a state (default: the last), coloured by thickness, as PNG.

        It is revolved about the axis, or, in plane strain, extruded.
        """
        from .show import views
        axisymmetric = self.problem.scene.kinematics.dimension_of_volume == 3
        (views.revolved if axisymmetric else views.extruded)(self.profile(state), file, self.problem.comm)

    def wall(self, state: State | None = None) -> Any:
        """The wall of the part at a state (default: the last), place by place (`Wall`): to_csv, to_excel."""
        from .evaluate.wall import Walls
        self._walls = getattr(self, "_walls", None) or Walls(self)
        return self._walls.of(state or self.last)

    def part(self, state: State | None = None, *, density: float | None = None, trim: Any = None, heights: Any = (),
             units: Any = None) -> Any:
        """The formed part in numbers (`Part`): volume, weight, area, least wall and where, evenness; print it.

        Args:
            state: default the last.
            density: in g/cm3, for the weight in grams; say the unit of length with `units` (without, it is cm).
            trim: the radius at which the part is cut off, or ("height", h), lengths: the last place from the axis where
                the middle line goes beyond it.
            heights: give the wall at these heights too (`Wall.height`).
            units: a `formingx.Units`.

        Raises:
            InputError: the mesh is no sheet, or the part does not reach the trim or a height.
        """
        from ..units import NONE
        from .evaluate.part import part
        axisymmetric = self.problem.scene.kinematics.dimension_of_volume == 3
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

    def tool_forces(self) -> dict[str, np.ndarray]:
        """{tool: its force at all states}: positive when it resists its travel; of a tool that stays, along Z."""
        from .evaluate.contact_face import tool_forces
        return tool_forces(self)

    def work(self) -> dict[str, np.ndarray]:
        """{what: work done on the body up to each state}: by the pressure, by tools; and the energy that it holds."""
        from .evaluate.work import work
        return work(self)

    def to_stl(self, file: Any, state: State | None = None) -> None:
        """Write the part at a state (default: the last) as a solid of triangles, STL (rank 0 writes)."""
        from .files.solid import to_stl
        to_stl(self.profile(state), self.problem.scene.kinematics.dimension_of_volume == 3, file, self.problem.comm)

    def to_gltf(self, file: Any, state: State | None = None) -> None:
        """Write the part at a state (default: the last) as binary glTF (.glb), coloured by its wall (rank 0 writes)."""
        from .files.solid import to_gltf
        to_gltf(self.profile(state), self.problem.scene.kinematics.dimension_of_volume == 3, file, self.problem.comm)
