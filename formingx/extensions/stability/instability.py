"""Stability of the states of a run: unstable modes, critical points, and mode shapes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError, count, finite, several
from ...ranks import gathered
from ...results.extend import method_of
from ...results.numbers import without_round_off
from ...results.path import Path
from ...results.show.picture import Picture
from ...run_hooks import RunExtension
from ...solve.record import Record
from ...solve.state import State
from .modes import Kind, Located, Modes


@dataclass(eq=False, repr=False)
class CriticalPoint:
    """Point of a path at which one mode becomes unstable, or stable again.

    Attributes:
        path: the computed `Path`.
        found: the located point, see `Located`.
        number: circumferential wave number n, cos(n theta); in plane strain the wave number along the depth, 1/length.
        flipped: name of the symmetry plane under which the mode is antisymmetric, or None.
        left: state of the path before the point.
        right: state of the path behind the point.
        state: the state at the critical point, with its output quantities `measures`.
        gained: False if the body is stable again behind this point.
        control: value of the controlled quantity (pressure, travel, time), the user's units.
        driven: name of the controlled quantity.
        limit_point: True if the point is a limit point of the controlled quantity (n = 0). No branch begins there.
        solved: True if `state` is a converged solution, False if it is interpolated between its neighbours.
        points: reference positions (R, Z) of the m nodes of all ranks, shape (m, 2), length.
        amplitudes: mode (U, W, V) at these nodes, shape (m, 3): u_r = U cos, u_z = W cos, u_hoop = V sin; the largest
            is 1.
    """

    path: Any
    found: Located
    control: float
    driven: str
    limit_point: bool
    points: np.ndarray
    amplitudes: np.ndarray

    @property
    def number(self) -> float:
        """Wave number of the mode, see the class."""
        return self.found.kind.number

    @property
    def flipped(self) -> str | None:
        """Symmetry plane under which the mode is antisymmetric, or None."""
        return self.found.kind.flipped

    left = property(lambda self: self.found.left)
    right = property(lambda self: self.found.right)
    state = property(lambda self: self.found.state)
    gained = property(lambda self: self.found.gained)
    solved = property(lambda self: self.found.solved)

    @property
    def at(self) -> tuple[float, ...]:
        """Reference position (R, Z) of the largest amplitude, length."""
        return without_round_off(self.points[np.argmax(np.linalg.norm(self.amplitudes, axis=1))], self.points)

    def branch(self, sense: int) -> Any:
        """Return a path that ends at this bifurcation, with its tangent along the mode.

        `trace(scene, start=...)` continues it on the bifurcated branch (n = 0).

        Args:
            sense: 1 or -1, along the mode or against it.

        Returns:
            The path.

        Raises:
            InputError: the mode varies round the axis (its branch is three-dimensional), or the point is a limit point.
        """
        if sense not in (1, -1):
            raise InputError(f"CriticalPoint.branch: sense = {sense!r}: must be 1 or -1")
        if self.number or self.flipped or self.limit_point:
            why = "is a limit point, through which the path itself goes on" if self.limit_point else (
                "varies round the body, or is antisymmetric about a mirror plane: its branch leaves this scene")
            raise InputError(f"CriticalPoint.branch: the mode {why}; branches of n = 0 can be followed")
        segment = self.path.segment(self.left)
        curve, problem = segment.curve, segment.problem
        start = State(self.state.x.copy(), self.state.control, self.found.x, 0.0, kind="branch point",
                      memory=self.left.memory, stage=self.left.stage, setting=self.left.setting, time=self.state.time)
        rest = State(0 * start.x, 0.0, 0 * start.x, 0.0)
        start.direction = sense * self.found.x / curve.moved(rest, State(self.found.x, 0.0, rest.x, 0.0))
        record = Record(problem, curve)
        states = segment.states
        record.segments[-1].states += [*states[: states.index(self.left) + 1], start]
        start.stepping = dict(self.left.stepping)
        path = type(self.path)(record)
        start.measures = path._measures(record.segments[-1], start)
        return path

    def view3d(self, file: Any, scale: float = 0.15) -> Picture:
        """Draw the body with the mode as a PNG (rank 0 draws).

        Args:
            file: path of the PNG file.
            scale: largest amplitude of the mode over the size of the body.

        Returns:
            The picture.

        Raises:
            InputError: neither a screen nor Xvfb is available, or the mesh is no sheet.
        """
        from . import show as modes
        modes.draw(self, file, scale)
        return Picture(file)

    def __repr__(self) -> str:
        return f"Loss(n={self.number:g}, {_shown(self)})"


class Stability:
    """Stability of states of a path.

    Attributes:
        numbers: the wave numbers examined.
        states: the states examined, in order.
        counts: {(number, flipped): number of unstable modes in each state, shape (states,)}.
        critical_points: the `CriticalPoint` objects, in order along the path.
    """

    def __init__(self, path: Any, numbers: list[float], states: list[State], counts: dict[Kind, list[int]],
                 losses: list[CriticalPoint]):
        self.path, self.numbers, self.states, self.critical_points = path, numbers, states, losses
        self.counts = {tuple(kind): np.array(found) for kind, found in counts.items()}

    @property
    def bifurcations(self) -> list[CriticalPoint]:
        """Critical points that are no limit points."""
        return [loss for loss in self.critical_points if loss.gained and not loss.limit_point]

    @property
    def first(self) -> CriticalPoint | None:
        """First bifurcation on the path, or None if there is none."""
        return next(iter(self.bifurcations), None)

    def first_of(self, number: float) -> CriticalPoint | None:
        """Return the first bifurcation with a wave number, or None.

        Args:
            number: wave number.

        Returns:
            The critical point, or None.
        """
        return next((loss for loss in self.bifurcations if loss.number == number), None)

    def __str__(self) -> str:
        problem = self.path.problem
        name, unit = problem.shown(0.0)[0], "n" if problem.scene.kinematics.axisymmetric else "k"
        head = (f"stability: {unit} = {', '.join(f'{n:g}' for n in self.numbers)}, {len(self.states)} states; elastic,"
                f" at fixed {name}")
        if any(entry.relaxes for entry in (s.problem for s in self.path.segments)):
            head += "; relaxing materials with their stiffness of the instant"
        unstable = [f"{unit} = {n:g}" for (n, _), found in self.counts.items() if found[0]]
        lines = [head, *([f"  unstable from the first state on: {', '.join(unstable)}"] if unstable else [])]
        lines += [f"  {unit} = {loss.number:g}: {_shown(loss)}" for loss in self.critical_points]
        return "\n".join(lines if len(lines) > 1 else [*lines, "  no mode is unstable"])

    __repr__ = __str__


def _shown(loss: CriticalPoint) -> str:
    """Return a critical point as a line of text."""
    states = loss.path.states
    what = "limit point" if loss.limit_point else "lost" if loss.gained else "regained"
    R, Z = loss.at
    parts = [f"{what} at {loss.driven} {loss.control:.6g}",
             f"between states {states.index(loss.left)} and {states.index(loss.right)}",
             f"largest at R = {R:.4g}, Z = {Z:.4g}", "solved for" if loss.solved else "interpolated"]
    return ", ".join(parts + [f"antisymmetric about {loss.flipped!r}"] * bool(loss.flipped))


class Watch:
    """Stability examination of the states of one path; created once.

    Args:
        path: the `Path`.
    """

    def __init__(self, path: Any):
        self._path, self._modes = path, {}                              # type: ignore[var-annotated]

    def of(self, segment: Any) -> Modes:
        """Return the modes of a segment's problem.

        Args:
            segment: part of the path on one mesh.

        Returns:
            The modes.
        """
        key = id(segment.problem)
        if key not in self._modes:
            self._modes[key] = Modes(segment.curve)
        return self._modes[key]

    def look(self, modes: Iterable[float], states: Any) -> Stability:
        """Examine states of the path; see `Path.stability`.

        Args:
            modes: wave numbers.
            states: see `Path.stability`.

        Returns:
            The stability of the states.
        """
        numbers = wave_numbers(self._path.problem.scene, modes)
        chosen = _chosen(self._path, states)
        counts: dict[Kind, list[int]] = {}
        losses: list[CriticalPoint] = []
        known: dict[tuple[int, Kind], int] = {}

        def count_at(state: State, kind: Kind) -> int:
            """Return the number of unstable modes in a state, computed once."""
            key = id(state), kind
            if key not in known:
                known[key] = self.of(self._path.segment(state)).count(state, kind)
            return known[key]
        kinds = [Kind(n, flipped) for n in numbers
                 for flipped in (None, *self.of(self._path.segments[-1]).variation.mirrors)]
        for kind in kinds:
            counts[kind] = [count_at(state, kind) for state in chosen]
            for a, b in zip(chosen, chosen[1:]):
                losses += self._between(a, b, kind, count_at)
        order = self._path.states
        losses.sort(key=lambda loss: (order.index(loss.left), abs(loss.state.control - loss.left.control)))
        return Stability(self._path, numbers, chosen, counts, losses)

    def _between(self, a: State, b: State, kind: Kind, count_at: Any) -> list[CriticalPoint]:
        """Return the critical points between two states, located between neighbours of the path."""
        if count_at(a, kind) == count_at(b, kind):
            return []
        segment = self._path.segment(a)
        states = [s for s in segment.states if s.kind != "limit point" or kind.number]
        if b not in states or a not in states:
            return []
        i, j = states.index(a), states.index(b)
        if j > i + 1:
            middle = states[(i + j) // 2]
            return self._between(a, middle, kind, count_at) + self._between(middle, b, kind, count_at)
        if a.setting != b.setting:
            return []
        low, high = sorted((count_at(a, kind), count_at(b, kind)))
        expected = not kind.number and not kind.flipped and a.slope * b.slope < 0
        found = [self.of(segment).locate(a, b, kind, index) for index in range(low, high)]
        folds = [self._is_fold(segment, entry) for entry in found] if expected else [False] * len(found)
        return [self._loss(segment, entry, fold) for entry, fold in zip(found, folds, strict=True)]

    def _is_fold(self, segment: Any, found: Located) -> bool:
        """Return True if the mode is nearly parallel to the tangent of the path, as at a limit point."""
        x, direction = found.x, found.left.direction
        problem = segment.problem
        a, b, c = problem.x.duplicate(), problem.x.duplicate(), problem.x.duplicate()
        a.array_w[:], b.array_w[:] = x, direction
        alike = abs(problem.inner(a, b)) / np.sqrt(problem.inner(a, a) * problem.inner(b, b))
        for vector in (a, b, c):
            vector.destroy()
        return bool(alike > 0.5)

    def _loss(self, segment: Any, found: Located, fold: bool) -> CriticalPoint:
        """Return a located critical point with its mode on the nodes of all ranks."""
        comm, nodes = segment.problem.comm, self.of(segment).variation.nodes
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
            driven, control = segment.problem.shown(found.state.control)
        return CriticalPoint(self._path, found, float(control), driven, fold, points, amplitudes)


@method_of(Path)
def stability(path: Path, modes: Any = range(9), states: Any = 20) -> Stability:
    """Examine states of a path for stability, and locate the critical points between them.

    Args:
        path: the path of a solid; the second variation of all its loads must be known.
        modes: circumferential wave numbers; in plane strain wave numbers along the depth, 1/length.
        states: number of states, evenly spaced on the path; "all"; or a list of states of the path.

    Returns:
        The `Stability`, which prints a table.

    Raises:
        InputError: a membrane, or a load without a second variation.
    """
    path.section_only("stability")
    watch: Watch = vars(path).setdefault("_stability_watch", Watch(path))      # keeps its matrices
    return watch.look(modes, states)


class InstabilityCondition(RunExtension):
    """Stopping condition of a run: a mode becomes unstable that was stable at the first state; see `instability`.

    Args:
        modes: wave numbers.
    """

    def __init__(self, modes: Any):
        self.modes = modes

    def attach(self, path: Any) -> None:
        """Examine the last state whenever a step of the path is complete.

        Args:
            path: the `Path`.
        """
        watch, numbers = Watch(path), wave_numbers(path.problem.scene, self.modes)
        first: dict[Kind, int] = {}

        def look() -> None:
            state = path.last
            modes = watch.of(path.segment(state))
            for kind in (Kind(n, flipped) for n in numbers for flipped in (None, *modes.variation.mirrors)):
                count = modes.count(state, kind)
                if not (kind.number or kind.flipped):
                    count -= state.slope * path.states[0].slope < 0      # a limit point is expected
                if count > first.setdefault(kind, count):
                    path.record.ended = (f"{kind.number:g} waves become unstable before {path.describe(state)}:"
                                         f" path.stability(modes=[{kind.number:g}]) finds where")
                    return
        path.record.hooks.on_step.append(look)


def instability(modes: Iterable[float] = range(9)) -> InstabilityCondition:
    """Return a condition for `trace(stop_at=...)`: stop once a mode is unstable that was stable at the first state.

    It costs about two iterations per mode and state. `Path.ended` names the mode, `Path.stability` locates the critical
    point.

    Args:
        modes: circumferential wave numbers; in plane strain wave numbers along the depth, 1/length.

    Returns:
        The condition.

    >>> fx.trace(scene, until=fx.pole_height(12.0), stop_at=fx.instability([0, 1]), progress=False).ended
    ''
    """
    return InstabilityCondition(modes)


def wave_numbers(scene: Any, modes: Any) -> list[float]:
    """Return the wave numbers of `Path.stability` as a list without duplicates.

    Args:
        scene: the `Scene`.
        modes: the user's argument.

    Returns:
        Wave numbers.

    Raises:
        InputError: wave numbers that are not allowed.
    """
    try:
        numbers = [finite("stability: modes", n) for n in modes]
    except TypeError:
        raise InputError(f"stability: modes = {modes!r}: must be several numbers of waves, such as range(9)") from None
    axisymmetric, most = scene.kinematics.axisymmetric, _most_waves(scene)
    for n in numbers:
        if n < 0 or axisymmetric and n != int(n):
            raise InputError(f"stability: modes: {n:g}: must be at least 0" + ", and whole: waves round the axis"
                             * axisymmetric)
        if n > most:
            raise InputError(f"stability: modes: {n:g}: waves that are shorter than the shortest edge of an element"
                             f" have no shape on this mesh: must be at most {most:.4g}")
    if not numbers:
        raise InputError("stability: modes: must be at least one")
    return list(dict.fromkeys(numbers))


def _chosen(path: Any, states: Any) -> list[State]:
    """Return the states to examine: evenly spaced ones with both ends of the path, or the given states."""
    regular = [s for s in path.states if s.kind != "limit point"]
    if isinstance(states, State | list | tuple):
        given = several("stability: states", [states] if isinstance(states, State) else states, "states of the path")
        if any(all(s is not entry for entry in path.states) for s in given):
            raise InputError("stability: states: must be of this path")
        if not given:
            raise InputError("stability: states: must be at least one")
        return sorted(given, key=path.states.index)
    everything = isinstance(states, str) and states == "all"
    number = len(regular) if everything else min(count("stability: states", states), len(regular))
    picked = np.unique(np.round(np.linspace(0, len(regular) - 1, max(number, 2))).astype(int)) if regular else []
    return [regular[k] for k in picked]


def _most_waves(scene: Any) -> float:
    """Return the number of waves as long as the shortest edge of an element, at the largest radius."""
    domain = scene.mesh.domain
    domain.topology.create_connectivity(1, domain.topology.dim)
    edges = np.arange(domain.topology.index_map(1).size_local, dtype=np.int32)
    shortest = domain.comm.allreduce(float(domain.h(1, edges).min(initial=np.inf)), MPI.MIN)
    widest = domain.comm.allreduce(float(domain.geometry.x[:, 0].max(initial=0.0)), MPI.MAX)
    return 2 * np.pi / shortest * (widest if scene.kinematics.axisymmetric else 1.0)
