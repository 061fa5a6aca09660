"""Path of a run: its states in order, with methods that evaluate, draw and write them."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ConvergenceError, InputError, as_points, check_name, check_type, count, finite
from ..figures import Axes
from ..findings import Finding, findings_at, worst_first
from ..measures import columns as standard_columns
from ..measures.quantities import Quantity
from ..measures.targets import Target, is_met, process_time
from ..solve.branches import branch_points
from ..solve.newton import Failure
from ..solve.path_following import Run
from ..solve.record import Counts, Record, Segment
from ..solve.state import State
from ..solve.stepping import StepControl
from ..units import NONE, Units
from .evaluate.admissibility import AdmissibilityCheck
from .evaluate.dissipation import dissipated_energy
from .evaluate.profile import Profile, Profiles, whole_part
from .evaluate.stress import Stresses, StressField
from .reader import Reader, SectionReader, section_only
from .show.picture import Picture

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


class Path:
    """Equilibrium path of a run: its states from the unloaded body to the target.

    Args:
        record: the solver's record of the run (`formingx.solve.record.Record`).
        timed: True if the process time is a column.
        columns: {name: quantity} of further columns that the user asked for (`formingx.trace(record=)`); default none.
        other: another path on the same problems, or None. If it has the same columns, its compiled forms are used.

    Attributes:
        record: the solver's record of the run (`formingx.solve.record.Record`).
        pilot: the path of the first run, from which `trace(..., adapt_mesh=True)` adapted the mesh; else None.

    >>> path
    Path(9 states, to State('target', pressure=0.045088, pole_height=12, pole_stretch=2.26198, enclosed_volume=2895.08,
         strain_energy=85.9012, ...))
    >>> round(float(path["pressure"].max()), 4), path.last.kind
    (0.0451, 'target')
    """

    pilot: Path | None = None

    if TYPE_CHECKING:
        def __getattr__(self, name: str) -> Any:
            """Let type checkers accept the methods that extensions add (`formingx.results.extend`)."""

    def __init__(self, record: Record, timed: bool = False, columns: Mapping[str, Any] | None = None,
                 other: Path | None = None):
        self.record, self._timed, self._columns = record, timed, {} if columns is None else columns
        self._views: dict[int, _View] = {}                  # by id(problem)
        if other is not None and (other._timed, other._columns) == (timed, self._columns):
            self._views = other._views
        self._view(record.segments[-1])                      # compiles the forms before the run
        record.hooks.on_state.append(self._measure)

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
        return [pair for segment in self.record.segments for pair in branch_points(segment.curve, segment.states)]

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
        segment = self.record.segment(state)
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
        for segment in self.record.segments:
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
        try:
            if segment.problem.history.path_dependent:                  # states between them depend on the history
                found = self._run_to(segment, left, right, target, bound)
            else:
                found = segment.curve.state_at_value(left, right, bound, target.value)
                found.stage, found.setting = left.stage, left.setting
                found.measures = self._measures(segment, found)
        except (ConvergenceError, Failure) as error:
            raise ConvergenceError(f"the path passes {target} between two of its states, but no state was found there:"
                                   f" {error}; run with intermediate=[...] to have one") from None
        segment.curve.spent()
        return found

    def _run_to(self, segment: Segment, left: State, right: State, target: Target, bound: Quantity) -> State:
        """Return the state between two successive states that meets a target, by a run from the first of them, `left`.

        The steps of this run update the history variables. `right` is the second state, `segment` contains both, and
        `bound` is the output quantity of the target. A stage that controls one is an InputError.
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
        Run(record, [(target, bound)], step, **given).follow(200, False, None)
        for k in range(2, len(record.states) + 1):
            self._fill(segment, record.states[:k])
        return record.last

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
        for segment in self.record.segments:
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

    def __repr__(self) -> str:
        return f"Path({len(self.states)} states{f', to {self.last!r}' if self.states else ''})"

    def findings(self) -> list[Finding]:
        """Return the findings of the checks before and after the run, the worst first; collective.

        A `formingx.findings.Finding` has a severity, a subject and a text. The severities are:

        "serious": do not use the results as they are.
        "warning": the scene may differ from the intended one, or a result is less accurate than usual.
        "note": the accuracy is as usual.

        >>> path.findings()
        []
        """
        return worst_first([*self.record.findings, *(findings_at("end", self) if self.states else [])])

    def profile(self, state: State | None = None) -> Profile:
        """Return the deformed outline and the thickness of a sheet; collective.

        Args:
            state: a state of the path; default the last.

        Raises:
            InputError: the mesh has no two faces of a sheet, or the sheet is in three dimensions.
        """
        state = state or self.last
        return self._view(self.record.segment(state)).profiles.evaluate(state)

    def stress(self, state: State | None = None, *, depth: float | None = None) -> Any:
        """Return the stresses of the body in a state; collective.

        Args:
            state: a state of the path; default the last.
            depth: depth in a sheet in three dimensions, from 0 at its bottom (inner) face to 1 at its top (outer) face;
                None: means over the thickness. A section takes no depth.

        Returns:
            Of a solid the stress field (`StressField`), layer by layer; its `at_points` gives the stresses at reference
            positions. Of a sheet in three dimensions the principal stresses of its triangles (`SheetStress`).

        Raises:
            InputError: the body is a membrane in a section, the material of a sheet is of K-BKZ type, or the depth is
                not from 0 to 1.
        """
        return self._reader.stress(state or self.last, depth)

    def stress_field(self, state: State) -> StressField:
        """Return the stress field of a solid in a state (`Path.stress`); collective.

        Args:
            state: a state of the path.

        Raises:
            InputError: the body is a membrane.
        """
        return self._view(self.record.segment(state)).stresses.evaluate(state)

    def to_csv(self, file: Any, units: Units | None = None) -> None:
        """Write a CSV file with one row per state (rank 0 writes).

        The columns are the stage (of a process), the kind of state, the number of Newton iterations, and every output
        quantity.

        Args:
            file: its name ends in .csv.
            units: units for the header, as in "tool_force [N]"; in plane strain "tool_force [N/mm]"; default none.

        Raises:
            InputError: the name has another ending.
            OSError: the file cannot be written.
        """
        from . import files
        files.write_path(self, file, units or NONE)

    def save(self, folder: Any) -> None:
        """Write every state to a checkpoint folder, from which `formingx.load` reads the path; collective.

        Args:
            folder: a new folder, or one that holds the first states of this run.

        Raises:
            InputError: the folder holds another run.
            OSError: the folder cannot be written.
        """
        from .files.checkpoint import Checkpoint
        writer = Checkpoint(folder, self)
        writer.write()
        writer.end("", self.findings())

    def to_vtk(self, file: Any, states: Any = None) -> None:
        """Write displacements, stresses and other fields of states for ParaView, one time step per state.

        The fields are displacement, stretches, stresses and their estimated error, elastic stretches of relaxing
        branches, contact pressure and thickness, as far as the body has them. For the file run.pvd, state 3 of the path
        is written to run-3.vtu; run.pvd lists the time steps. The time in ParaView is the number of the state. States
        of a remeshed run have their own meshes.

        Args:
            file: its name ends in .pvd.
            states: a state, a sequence of states, or "all"; default the last. States that `Path.state_at` solved for
                are numbered in the given order.

        Raises:
            InputError: the name has another ending, or `states` has an entry that is not a `State`.
            OSError: a file cannot be written.
        """
        from .files import fields
        fields.to_vtk(self, file, states)

    def animate(self, file: Any, frames: int = 60, seconds: float = 5.0, *, units: Units | None = None) -> Picture:
        """Draw an animation of the forming (rank 0 writes).

        A section is drawn with its loading curve, a sheet in three dimensions as a picture coloured by its wall, with
        its tools.

        The frames are evenly spaced over the process time, and over the change of the controls in stages without time.
        In a run without time they are evenly spaced over the motion of the controls and the sheet.
        Between states the body follows the cubic path through them. The last frame is shown for one second more.

        Args:
            file: its name ends in .gif or .mp4.
            frames: number of frames.
            seconds: duration without that last second, s.
            units: units for the labels; default none.

        Returns:
            The file, which a notebook shows.

        Raises:
            InputError: the name of the file has another ending, or ffmpeg is missing for an MP4. `frames` or `seconds`
                is not positive, the body is not a sheet, the path has one state only, or a picture in three dimensions
                has no screen and no Xvfb.
        """
        from .show import animation
        animation.animate(self, file, frames, seconds, units or NONE)
        return Picture(file)

    def report(self, file: Any = "report.html", title: str = "", failure: Any = None, *, units: Units | None = None,
               density: float | None = None, trim: Any = None) -> FilePath:
        """Write an HTML file on the run: part, process, curves, inputs and warnings (rank 0 writes).

        Args:
            file: its name ends in .html.
            title: heading of the page.
            failure: the `ConvergenceError` that ended the run, or None.
            units: units of the script, for the labels; default none.
            density: density of the material for the weight of the part, g/cm3.
            trim: radius at which the part is cut off, or ("height", h), length; in three dimensions a z coordinate
                beyond which the part lies.

        Returns:
            The path of the file.

        Raises:
            InputError: plotly is not installed, the name has another ending, or a density or trim is given for a body
                that is not a sheet.
            OSError: the file cannot be written.
        """
        return self._reader.report(file, title, failure, units or NONE, density, trim)

    def plot(self, y: str, x: str, axes: Axes | None = None, **style: Any) -> Any:
        """Draw column `y` (first, vertical axis) over column `x` (horizontal axis), with a dot at each state.

        Args:
            y: name of the column on the vertical axis.
            x: name of the column on the horizontal axis.
            axes: matplotlib axes; default new ones.
            style: keyword arguments of matplotlib's `plot`.

        Returns:
            The matplotlib axes.
        """
        from .show import plots
        return plots.curve(self, y, x, axes, **style)

    def plot_convergence(self, axes: Axes | None = None) -> Any:
        r"""Draw the relative correction of the unknowns x in every Newton iteration, one line per state.

        It is the measure of convergence of Song 1993, eq. (3.5.1):

        .. math::
            |\Delta x| / |x|

        Args:
            axes: matplotlib axes; default new ones.

        Returns:
            The matplotlib axes.
        """
        from .show import plots
        return plots.convergence(self, axes)

    def view3d(self, file: Any, state: State | None = None, grid: float | None = None, camera: Any = None) -> Picture:
        """Draw the deformed sheet as a PNG file, coloured by its wall thickness over the original thickness.

        An axisymmetric sheet is revolved about the axis, a sheet in plane strain is extruded.

        Args:
            file: its name ends in .png.
            state: a state of the path; default the last.
            grid: for a sheet in three dimensions: size of the squares of a grid that is printed on the flat sheet,
                length; default no grid.
            camera: "front", "side", "top" or "bottom", or the direction (x, y, z) from the part to the camera; default
                a direction in which the part is seen from all sides.

        Returns:
            The picture, which a notebook shows.

        Raises:
            InputError: the name has another ending, the body is not a sheet, an unknown camera, or there is neither a
                screen nor Xvfb.
        """
        self._reader.view(file, state or self.last, grid, camera)
        return Picture(file)

    def wall(self, state: State | None = None) -> Any:
        """Return the wall thickness of the part as a table; collective.

        Args:
            state: a state of the path; default the last.

        Returns:
            A `Wall`, from the axis to the rim. In three dimensions a `SheetWall`, triangle by triangle. Both have
            `to_csv` and `to_excel`.

        Raises:
            InputError: the body is not a sheet, or its layers do not lie above each other.
        """
        return self._reader.wall(state or self.last)

    def part(self, state: State | None = None, *, density: float | None = None, trim: Any = None, heights: Any = (),
             units: Units | None = None) -> Any:
        """Return the key numbers of the formed part: volume, weight, area, minimum wall, uniformity.

        They belong to the whole part, also if a half or a quarter is modelled. In plane strain they are per unit depth.

        Args:
            state: a state of the path; default the last.
            density: density of the material, g/cm3, for the weight in grams. It refers to the reference configuration,
                under `ThermalExpansion` to the temperature of zero thermal strain. Give `units`, too: lengths without a
                unit count as cm.
            trim: radius at which the part is cut off, or ("height", h), length. The cut lies where the middle line
                passes this radius or height for the last time on its way from the axis to the rim. In three dimensions
                a z coordinate beyond which the part lies.
            heights: heights (`Wall.height`) at which the wall is listed in `Part.walls`, length.
            units: units of the script.

        Returns:
            The numbers as a `Part`, which prints as a table.

        Raises:
            InputError: the mesh is not a sheet, or the part does not reach the trim or a height.
        """
        check_type("Path.part: units", units, Units | None, "a formingx.Units or None")
        return self._reader.part(state or self.last, density, trim, heights, units or NONE)

    def filling(self, tool: Any = None) -> Any:
        """Return the remaining gap between the body and each corner of a tool, state by state; collective.

        Args:
            tool: name of the tool, the `Tool` or the `Contact`; may be left out if there is only one tool.

        Returns:
            A `Filling`; its `pressure_at` gives the pressure at which a gap is reached.

        Raises:
            InputError: there is no such tool, it has no corner that the body must fill, or the run has several meshes.
        """
        from .evaluate.contact_face import contact_of
        return self._reader.filling(contact_of(self, tool, "filling")[0])

    def contact(self, tool: Any = None, state: State | None = None) -> Any:
        """Return the contact pressure, friction and gap along the face that touches a tool; collective.

        Args:
            tool: name of the tool, the `Tool` or the `Contact`; may be left out if there is only one tool.
            state: a state of the path; default the last.

        Returns:
            A `ContactTable`, with `to_csv` and `to_excel`.

        Raises:
            InputError: there is no such tool, or the body is a sheet in three dimensions.
        """
        section_only(self.scene, "contact", "use tool_forces(), or filling()")
        from .evaluate.contact_face import ContactFace, contact_of
        on_mesh = self._same_mesh(state or self.last)
        return ContactFace(on_mesh, contact_of(on_mesh, tool, "contact")[0]).evaluate(state or self.last)

    def temperature(self, points: ArrayLike, state: State | None = None, *,
                    depth: ArrayLike | None = None) -> np.ndarray:
        """Return the temperature of material points in a state; collective.

        Args:
            points: reference positions (R, Z), of a flat sheet in three dimensions (X, Y), shape (n, 2), length; of
                another surface (X, Y, Z), shape (n, 3).
            state: a state of the path; default the last.
            depth: depths of the points in a sheet in three dimensions, shape () or (n,), from 0 at its bottom (inner)
                face to 1 at its top (outer) face; None: 0.5, the middle. A section takes no depth.

        Returns:
            Temperatures, shape (n,), in the unit of the scene.

        Raises:
            InputError: the scene has no temperature, a point lies outside the body, or a depth is not from 0 to 1.
        """
        if self.problem.temperature is None:
            raise InputError("temperature: the scene has no temperature: give Scene temperature=...")
        state = state or self.last
        in_space = self.scene.kinematics.components == 3
        flat = not in_space or self.scene.mesh.flat
        at = as_points("Path.temperature: points", points, 2 if flat else 3)
        depths = None if depth is None else np.asarray(depth, dtype=float)
        if depths is not None and not (in_space and depths.shape in ((), (len(at),))
                                       and np.all((depths >= 0) & (depths <= 1))):
            raise InputError(f"Path.temperature: depth = {depth!r}: must be numbers from 0 to 1, one or one for each"
                             f" point, of a sheet in three dimensions")
        with self.record.segment(state).problem.state_context(state) as problem:
            at = problem.forms.nearest(at) if in_space else problem.followed(at)       # triangles are chords
            return problem.temperature.at_points(at, depths)

    def tool_forces(self) -> dict[str, np.ndarray]:
        """Return the force of the body on each tool in all states.

        The force on a moving tool is taken along its travel, positive if it resists the travel. The force on a fixed
        tool is taken along Z, positive if the body pushes the tool up. Forces belong to the whole tool, also if a half
        or a quarter is modelled.

        Returns:
            {tool: forces, shape (states,)}, stress length^2; in plane strain stress length.
        """
        from .evaluate.contact_face import tool_forces
        return tool_forces(self)

    def work(self) -> dict[str, np.ndarray]:
        """Return the energy balance of the whole part, state by state; collective.

        The balance is: work + other energies added = stored + lost + unbalanced. It belongs to the whole part, also if
        a half or a quarter is modelled. The entries are:

        Work of each load, each driven support and each moving tool, under the name of its column. The work of a fixed
        load is "pressure_on_bottom" or similar; a support without a name is "support".

        "change": work of forces left unbalanced at the beginning of a stage, which fade over the stage. "new_meshes":
        energy added by remeshing. "heat": energy added by changes of temperature.

        Stored: "strain_energy" minus its first value. Lost: "dissipated_energy" and "damage_energy" of materials,
        "friction", "jumps" (in snap-through), and "bonds" to adhesive tools. Entries that a run cannot have are left
        out: without friction `path.work().get("friction", 0.0)` is 0.

        "unbalanced": the rest, an error of the integrals and of the run. Above 0.5 % of the largest entry a warning is
        logged and added to the `findings`.

        Returns:
            {entry: energy up to each state, shape (states,)}, stress length^3; in plane strain stress length^2.

        Raises:
            InputError: a material is of K-BKZ type.
        """
        from .evaluate.work import work
        return work(self)

    def to_stl(self, file: Any, state: State | None = None) -> None:
        """Write the part in a state as the triangles of its surface, in binary STL (rank 0 writes).

        Args:
            file: its name ends in .stl.
            state: a state of the path; default the last.

        Raises:
            InputError: the name has another ending, or the body is not a sheet.
            OSError: the file cannot be written.
        """
        from .files.solid import to_stl
        to_stl(self._reader.solid(state or self.last), file, self.problem.comm)

    def to_inp(self, file: Any, state: State | None = None, parts: int = 60) -> None:
        """Write the part as shell elements with the wall as thickness, for CalculiX or Abaqus (rank 0 writes).

        The elements are S8R, at the axis S6, on the middle surface. The element set is WALL, the node sets are ALL and
        RIM, the outer end of the part; both ends, if only a half between them is modelled. The file contains no
        material.

        Args:
            file: its name ends in .inp.
            state: a state of the path; default the last.
            parts: number of elements round the axis.

        Raises:
            InputError: the name has another ending, the body is not an axisymmetric sheet, or `parts` is below 3.
            OSError: the file cannot be written.
        """
        from .files.shells import to_inp
        section_only(self.scene, "to_inp", "use shell_model")
        if not self.problem.scene.kinematics.axisymmetric or count("to_inp: parts", parts) < 3:
            raise InputError(f"to_inp: parts = {parts!r}: must be at least 3, of an axisymmetric body")
        to_inp(whole_part(self.profile(state), self.scene.symmetry), parts, file, self.problem.comm)

    def to_gltf(self, file: Any, state: State | None = None, *, units: Units | None = None) -> None:
        """Write the part in a state as binary glTF, coloured by its wall (rank 0 writes).

        Args:
            file: its name ends in .glb.
            state: a state of the path; default the last.
            units: units of the script; glTF is in metres, and lengths without a unit count as metres.

        Raises:
            InputError: the name has another ending, or the body is not a sheet.
            OSError: the file cannot be written.
        """
        from .files.solid import to_gltf
        to_gltf(self._reader.solid(state or self.last), file, self.problem.comm, units or NONE)

    @cached_property
    def _reader(self) -> Reader:
        """Object that evaluates walls, parts, pictures and reports for the kinematics of the scene."""
        return (self.scene.kinematics.reader or SectionReader)(self)

    def _check(self, *names: str) -> None:
        """Check that columns of these names exist; an InputError names the first that does not."""
        for name in names:
            if name not in self.columns:
                raise InputError(f"Path: column {name!r} is not known; known: {', '.join(self.columns)}")

    def _measure(self, state: State) -> None:
        """Compute measures and admissibility of a newly accepted state; the run calls it (`RunHooks.on_state`)."""
        segment = self.record.segments[-1]
        self._fill(segment, self.states if len(segment.states) == 1 else segment.states)
        state.inadmissible_reason = next(self._view(segment).admissibility.reasons(state), "")

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

    def _same_mesh(self, state: State) -> Any:
        """Return a path of the states on the mesh of a given state; this path itself if the run has one mesh."""
        if len(self.record.segments) == 1:
            return self
        segment = self.record.segment(state)
        record = Record(segment.problem, segment.curve)
        record.segments, record.counts = [segment], self.counts
        return type(self)(record, self._timed, self._columns, self)

    def _view(self, segment: Segment) -> _View:
        """Return the objects that evaluate columns, profiles, stresses and admissibility of the states of a segment."""
        key = id(segment.problem)
        if key not in self._views:
            self._views[key] = _View(segment.problem, self._timed, self._columns)
        return self._views[key]


def _pieces(states: list[State]) -> list[list[State]]:
    """Return the states in groups of successive states with equal step data."""
    return [list(group) for _, group in itertools.groupby(states, key=lambda state: state.setting)]
