"""Stability of the states of a run: unstable modes, critical points, and mode shapes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError, as_list, count, finite
from ...mesh.nodes import without_round_off
from ...ranks import gathered
from ...results.extend import method_of
from ...results.path import Path
from ...results.reader import section_only
from ...results.show.picture import Picture
from ...run_hooks import RunExtension
from ...solve.record import Record
from ...solve.state import State
from .modes import LocatedPoint, ModeClass, Modes


@dataclass(eq=False, repr=False)
class CriticalPoint:
    """Point of a path at which one mode becomes unstable, or stable again.

    The mode is u_r = U cos(n theta), u_z = W cos(n theta), u_theta = V sin(n theta). In plane
    strain k x3 replaces n theta.

    Attributes:
        path: the computed `Path`.
        located: the located point, a `formingx.extensions.stability.modes.LocatedPoint`.
        number: circumferential wave number n; in plane strain the wave number k along the depth, 1/length.
        antisymmetric_about: name of the symmetry plane about which the mode is antisymmetric, or None.
        left: last state of the path before the point.
        right: first state of the path behind the point.
        state: state at the point, with its output quantities `measures`.
        becomes_unstable: True if the mode becomes unstable, False if it becomes stable again.
        control: value of the controlled quantity (pressure, travel, time), the user's units.
        driven: name of the controlled quantity.
        limit_point: True if the point is a limit point of the controlled quantity (n = 0). No branch begins there.
        solved: True if `state` is a converged solution, False if it is interpolated between `left` and `right`.
        points: reference positions (R, Z) of the m nodes of all ranks, shape (m, 2), length.
        amplitudes: (U, W, V) of the mode at these nodes, shape (m, 3); the largest displacement is 1.
    """

    path: Any
    located: LocatedPoint
    control: float
    driven: str
    limit_point: bool
    points: np.ndarray
    amplitudes: np.ndarray

    @property
    def number(self) -> float:
        """Wave number of the mode: n round the axis; in plane strain k along the depth, 1/length."""
        return self.located.kind.number

    @property
    def antisymmetric_about(self) -> str | None:
        """Name of the symmetry plane about which the mode is antisymmetric, or None."""
        return self.located.kind.antisymmetric_about

    left = property(lambda self: self.located.left)
    right = property(lambda self: self.located.right)
    state = property(lambda self: self.located.state)
    becomes_unstable = property(lambda self: self.located.becomes_unstable)
    solved = property(lambda self: self.located.solved)

    @property
    def position(self) -> tuple[float, ...]:
        """Reference position (R, Z) of the node with the largest displacement in the mode, length."""
        return without_round_off(self.points[np.argmax(np.linalg.norm(self.amplitudes, axis=1))], self.points)

    def branch(self, sense: int) -> Any:
        """Return a path that ends at this bifurcation, with its tangent along the mode.

        `trace(scene, start=...)` continues it on the bifurcated branch (n = 0).

        Args:
            sense: 1 for the direction of the mode, -1 for the opposite one.

        Returns:
            The path up to this point.

        Raises:
            InputError: the mode varies round the axis (its branch is three-dimensional), or the point is a limit point.
        """
        if sense not in (1, -1):
            raise InputError(f"CriticalPoint.branch: sense = {sense!r}: must be 1 or -1")
        if self.number or self.antisymmetric_about or self.limit_point:
            why = "is a limit point, through which the path itself goes on" if self.limit_point else (
                "varies round the body, or is antisymmetric about a mirror plane: its branch leaves this scene")
            raise InputError(f"CriticalPoint.branch: the mode {why}; branches of n = 0 can be followed")
        segment = self.path.record.segment(self.left)
        curve, problem = segment.curve, segment.problem
        start = State(self.state.x.copy(), self.state.control, self.located.x, 0.0, kind="branch point",
                      history_variables=self.left.history_variables, stage=self.left.stage,
                      setting=self.left.setting, time=self.state.time)
        zero = State(0 * start.x, 0.0, 0 * start.x, 0.0)
        start.direction = sense * self.located.x / curve.moved(zero, State(self.located.x, 0.0, zero.x, 0.0))
        record = Record(problem, curve)
        states = segment.states
        record.segments[-1].states += [*states[: states.index(self.left) + 1], start]
        start.stepping = dict(self.left.stepping)
        path = type(self.path)(record)
        start.measures = path._measures(record.segments[-1], start)
        return path

    def view3d(self, file: Any, scale: float | None = None) -> Picture:
        """Draw the deformed body with the mode to a PNG file (rank 0 draws).

        Args:
            file: path of the PNG file.
            scale: largest displacement of the mode over the size of the body; default 0.15, and less for short waves.

        Returns:
            The picture.

        Raises:
            InputError: the name does not end in .png, the scale is not positive, or neither a screen nor Xvfb is
                available.
        """
        from . import show
        show.draw(self, file, scale)
        return Picture(file)

    def __repr__(self) -> str:
        return f"CriticalPoint(n={self.number:g}, {_description(self)})"


class Stability:
    """Stability of the examined states of a path, created by `Path.stability`; `print` shows a table.

    Attributes:
        path: the computed `Path`.
        numbers: examined wave numbers.
        states: examined states, in order.
        counts: {(wave number, symmetry plane or None): number of unstable modes in each state, shape (states,)}. Modes
            with a symmetry plane are antisymmetric about it.
        critical_points: points at which a mode becomes unstable or stable again, in order along the path.
    """

    def __init__(self, path: Any, numbers: list[float], states: list[State], counts: dict[ModeClass, list[int]],
                 critical_points: list[CriticalPoint]):
        self.path, self.numbers, self.states, self.critical_points = path, numbers, states, critical_points
        self.counts = {tuple(kind): np.array(found) for kind, found in counts.items()}

    @property
    def bifurcations(self) -> list[CriticalPoint]:
        """Critical points at which a mode becomes unstable, without limit points."""
        return [point for point in self.critical_points if point.becomes_unstable and not point.limit_point]

    @property
    def first(self) -> CriticalPoint | None:
        """First bifurcation on the path, or None if the path has none."""
        return next(iter(self.bifurcations), None)

    def first_of(self, number: float) -> CriticalPoint | None:
        """Return the first bifurcation whose mode has a given wave number.

        Args:
            number: wave number: n round the axis; in plane strain k along the depth, 1/length.

        Returns:
            The critical point, or None.
        """
        return next((point for point in self.bifurcations if point.number == number), None)

    def __str__(self) -> str:
        problem = self.path.problem
        name, unit = problem.description.shown(0.0)[0], "n" if problem.scene.kinematics.axisymmetric else "k"
        head = (f"stability: {unit} = {', '.join(f'{n:g}' for n in self.numbers)}, {len(self.states)} states; elastic,"
                f" at fixed {name}")
        if any(entry.history.rate_dependent for entry in (s.problem for s in self.path.record.segments)):
            head += "; relaxing materials with their stiffness of the instant"
        unstable = [f"{unit} = {n:g}" for (n, _), found in self.counts.items() if found[0]]
        lines = [head, *([f"  unstable from the first state on: {', '.join(unstable)}"] if unstable else [])]
        lines += [f"  {unit} = {point.number:g}: {_description(point)}" for point in self.critical_points]
        return "\n".join(lines if len(lines) > 1 else [*lines, "  no mode is unstable"])

    __repr__ = __str__


def _description(point: CriticalPoint) -> str:
    """Return kind, control and position of a critical point as a line of text."""
    states = point.path.states
    what = "limit point" if point.limit_point else "lost" if point.becomes_unstable else "regained"
    R, Z = point.position
    parts = [f"{what} at {point.driven} {point.control:.6g}",
             f"between states {states.index(point.left)} and {states.index(point.right)}",
             f"largest at R = {R:.4g}, Z = {Z:.4g}", "solved for" if point.solved else "interpolated"]
    return ", ".join(parts + [f"antisymmetric about {point.antisymmetric_about!r}"] * bool(point.antisymmetric_about))


class StabilityAnalysis:
    """Stability analysis of the states of a path; keeps the matrix and the factors of each mesh for further calls."""

    def __init__(self, path: Any):
        self._path, self._modes = path, {}                              # type: ignore[var-annotated]

    def modes_of(self, segment: Any) -> Modes:
        """Return the `Modes` on the mesh of a segment of the path, created at the first call."""
        key = id(segment.problem)
        if key not in self._modes:
            self._modes[key] = Modes(segment.curve)
        return self._modes[key]

    def examine(self, modes: Iterable[float], states: Any) -> Stability:
        """Count modes of wave numbers in states (a number, "all", a list), and locate critical points between."""
        numbers = wave_numbers(self._path.problem.scene, modes)
        chosen = _selected_states(self._path, states)
        counts: dict[ModeClass, list[int]] = {}
        critical_points: list[CriticalPoint] = []
        counted: dict[tuple[int, ModeClass], int] = {}

        def unstable_modes(state: State, kind: ModeClass) -> int:
            """Return the number of unstable modes in a state, computed once."""
            key = id(state), kind
            if key not in counted:
                counted[key] = self.modes_of(self._path.record.segment(state)).count(state, kind)
            return counted[key]
        kinds = [ModeClass(n, plane) for n in numbers
                 for plane in (None, *self.modes_of(self._path.record.segments[-1]).variation.mirrors)]
        for kind in kinds:
            counts[kind] = [unstable_modes(state, kind) for state in chosen]
            for a, b in zip(chosen, chosen[1:]):
                critical_points += self._locate(a, b, kind, unstable_modes)
        order = self._path.states
        critical_points.sort(key=lambda point: (order.index(point.left),
                                                abs(point.state.control - point.left.control)))
        return Stability(self._path, numbers, chosen, counts, critical_points)

    def _locate(self, a: State, b: State, kind: ModeClass, unstable_modes: Any) -> list[CriticalPoint]:
        """Return the critical points of one kind of modes between two states, each located between neighbouring states.

        `unstable_modes` is a function of state and kind that returns the number of unstable modes.
        """
        if unstable_modes(a, kind) == unstable_modes(b, kind):
            return []
        segment = self._path.record.segment(a)
        states = [s for s in segment.states if s.kind != "limit point" or kind.number]
        if b not in states or a not in states:
            return []
        i, j = states.index(a), states.index(b)
        if j > i + 1:
            middle = states[(i + j) // 2]
            return self._locate(a, middle, kind, unstable_modes) + self._locate(middle, b, kind, unstable_modes)
        if a.setting != b.setting:
            return []
        low, high = sorted((unstable_modes(a, kind), unstable_modes(b, kind)))
        expected = not kind.number and not kind.antisymmetric_about and a.slope * b.slope < 0
        found = [self.modes_of(segment).locate(a, b, kind, index) for index in range(low, high)]
        limits = [self._is_limit_point(segment, entry) for entry in found] if expected else [False] * len(found)
        return [self._critical_point(segment, entry, limit) for entry, limit in zip(found, limits, strict=True)]

    def _is_limit_point(self, segment: Any, found: LocatedPoint) -> bool:
        """Return True if the mode of a located point is nearly parallel to the path tangent in its `Segment`."""
        x, direction, problem = found.x, found.left.direction, segment.problem
        a, b = problem.x.duplicate(), problem.x.duplicate()
        a.array_w[:], b.array_w[:] = x, direction
        cosine = abs(problem.inner(a, b)) / np.sqrt(problem.inner(a, a) * problem.inner(b, b))
        for vector in (a, b):
            vector.destroy()
        return bool(cosine > 0.5)

    def _critical_point(self, segment: Any, found: LocatedPoint, limit: bool) -> CriticalPoint:
        """Return the `CriticalPoint` of a located point, with the mode at all ranks' nodes; limit: a limit point."""
        comm, nodes = segment.problem.comm, self.modes_of(segment).variation.nodes
        points, amplitudes = gathered(comm, nodes), gathered(comm, found.mode)
        size = np.linalg.norm(amplitudes, axis=1)
        amplitudes = amplitudes / size.max()
        if found.solved and not found.state.measures:
            found.state.measures = self._path._measures(segment, found.state)
        elif not found.state.measures:                      # no equilibrium: it has no reaction forces
            before, behind = found.left.measures, found.right.measures
            found.state.measures = {name: before[name] + found.fraction * (behind[name] - before[name])
                                    for name in before.keys() & behind.keys()}
        with segment.problem.state_context(found.left):
            driven, control = segment.problem.description.shown(found.state.control)
        return CriticalPoint(self._path, found, float(control), driven, limit, points, amplitudes)


@method_of(Path)
def stability(path: Path, modes: Any = range(9), states: Any = 20) -> Stability:
    """Examine states of a path for stability, and locate the critical points between them; collective.

    Args:
        path: the path of a solid; the second variation of all its loads must be known.
        modes: circumferential wave numbers; in plane strain wave numbers along the depth, 1/length.
        states: number of states, evenly spaced on the path; "all"; or a list of states of the path.

    Returns:
        Counts of unstable modes and critical points; `print` shows them as a table.

    Raises:
        InputError: a membrane, an elastic support, or a load without a second variation.
    """
    section_only(path.scene, "stability")
    analysis = vars(path).setdefault("_stability_analysis", StabilityAnalysis(path))        # keeps its matrices
    return analysis.examine(modes, states)


class InstabilityCondition(RunExtension):
    """Stopping condition of a run: more modes are unstable than at the first state; see `instability`.

    Args:
        modes: wave numbers: n round the axis; in plane strain k along the depth, 1/length.
    """

    argument = "stop_at"

    def __init__(self, modes: Any):
        self.modes = modes

    def attach(self, path: Any) -> None:
        """Let the run count unstable modes in its last state after each step, and end when one has become unstable."""
        analysis, numbers = StabilityAnalysis(path), wave_numbers(path.problem.scene, self.modes)
        first: dict[ModeClass, int] = {}

        def examine() -> None:
            """End the run if the last state has more unstable modes of a wave number than the first state."""
            state = path.last
            modes = analysis.modes_of(path.record.segment(state))
            for kind in (ModeClass(n, plane) for n in numbers for plane in (None, *modes.variation.mirrors)):
                unstable = modes.count(state, kind)
                if not (kind.number or kind.antisymmetric_about):
                    unstable -= state.slope * path.states[0].slope < 0      # a limit point is expected
                if unstable > first.setdefault(kind, unstable):
                    path.record.ended = (f"{kind.number:g} waves become unstable before {path.record.describe(state)}:"
                                         f" path.stability(modes=[{kind.number:g}]) finds where")
                    return
        path.record.hooks.on_step.append(examine)


def instability(modes: Iterable[float] = range(9)) -> InstabilityCondition:
    """Return a condition for `trace(stop_at=...)` that ends a run when more modes are unstable than at its first state.

    It costs about two iterations per mode and state. A limit point does not end the run. `Path.ended` names the mode,
    and is "" if there is none. `Path.stability` locates the critical point.

    Args:
        modes: circumferential wave numbers; in plane strain wave numbers along the depth, 1/length.

    Returns:
        The condition.

    >>> fx.trace(scene, until=fx.pole_height(12.0), stop_at=fx.instability([0, 1]), progress=False).ended
    ''
    """
    return InstabilityCondition(modes)


def wave_numbers(scene: Any, modes: Any) -> list[float]:
    """Return the wave numbers of a user once each; none, negative, fractional or too short ones are an InputError."""
    try:
        numbers = [finite("stability: modes", n) for n in modes]
    except TypeError:
        raise InputError(f"stability: modes = {modes!r}: must be several numbers of waves, such as range(9)") from None
    axisymmetric, largest = scene.kinematics.axisymmetric, max_wave_number(scene)
    for n in numbers:
        if n < 0 or axisymmetric and n != int(n):
            raise InputError(f"stability: modes: {n:g}: must be at least 0" + ", and whole: waves round the axis"
                             * axisymmetric)
        if n > largest:
            raise InputError(f"stability: modes: {n:g}: waves that are shorter than the shortest edge of an element"
                             f" have no shape on this mesh: must be at most {largest:.4g}")
    if not numbers:
        raise InputError("stability: modes: must be at least one")
    return list(dict.fromkeys(numbers))


def _selected_states(path: Any, states: Any) -> list[State]:
    """Return the states to examine, in order along the path, without limit points unless they are given.

    `states` is a number of evenly spaced states with both ends of the path, "all", or states of the path.
    """
    regular = [s for s in path.states if s.kind != "limit point"]
    if isinstance(states, State | list | tuple):
        given = as_list("stability: states", [states] if isinstance(states, State) else states, "states of the path")
        if any(all(s is not entry for entry in path.states) for s in given):
            raise InputError("stability: states: must be of this path")
        if not given:
            raise InputError("stability: states: must be at least one")
        return sorted(given, key=path.states.index)
    everything = isinstance(states, str) and states == "all"
    number = len(regular) if everything else min(count("stability: states", states), len(regular))
    picked = np.unique(np.round(np.linspace(0, len(regular) - 1, max(number, 2))).astype(int)) if regular else []
    return [regular[k] for k in picked]


def max_wave_number(scene: Any) -> float:
    """Return the largest wave number: waves at the largest radius are as long as the shortest edge of an element."""
    domain, comm = scene.mesh.domain, scene.mesh.comm
    domain.topology.create_connectivity(1, domain.topology.dim)
    edges = np.arange(domain.topology.index_map(1).size_local, dtype=np.int32)
    shortest = comm.allreduce(float(domain.h(1, edges).min(initial=np.inf)), MPI.MIN)
    widest = comm.allreduce(float(domain.geometry.x[:, 0].max(initial=0.0)), MPI.MAX)
    return 2 * np.pi / shortest * (widest if scene.kinematics.axisymmetric else 1.0)
