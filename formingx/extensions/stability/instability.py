"""Stability of the states of a run: unstable modes, their critical points, and their shapes."""

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
from ...solve.record import Record
from ...solve.state import State
from .modes import Kind, Located, Modes


@dataclass(eq=False, repr=False)
class CriticalPoint:
    """One mode that begins (or ceases) to be unstable along a path.

    Attributes:
        number: waves round the axis, cos(n theta); in plane strain the wave number along the depth, over length.
        flipped: name of the mirror that turns its image round, or None.
        left, right: the states of the path before and behind; state: where it happens, with `measures`.
        gained: False if the body is stable again behind.
        control, driven: the controlled quantity there, the user's units (pressure, travel, time), and what it is.
        limit_point: True if it is that of the controlled quantity (n = 0): expected, no branch begins there.
        solved: True if `state` is a solution; False if it lies on the smooth path between its neighbours.
        points, amplitudes: reference positions (R, Z) of nodes, shape (m, 2), length, and amplitudes (U, W, V) of
            u_r = U cos, u_z = W cos, u_hoop = V sin there, the largest 1, shape (m, 3); of all ranks.
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
        """See the class."""
        return self.found.kind.number

    @property
    def flipped(self) -> str | None:
        """See the class."""
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
        """A path that ends where another begins, headed along it: for `trace(scene, start=...)` (n = 0).

        sense: 1 or -1, along the mode or against it.

        Raises:
            InputError: the mode varies round the axis (its branch is three-dimensional), or at a limit point.
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
        """Draw the body with the mode, its largest amplitude `scale` of the body's size, as a PNG (rank 0 draws).

        Raises:
            InputError: there is neither a screen nor Xvfb to draw on, or the mesh is no sheet.
        """
        from . import show as modes
        modes.draw(self, file, scale)
        return Picture(file)

    def __repr__(self) -> str:
        return f"Loss(n={self.number:g}, {_shown(self)})"


class Stability:
    """The unstable modes of states of a path.

    Attributes:
        numbers: the waves that were asked for; states: the states looked at, in order.
        counts: {(number, flipped): number of unstable modes in each state, shape (states,)}.
        losses: list of `CriticalPoint` in order along the path.
    """

    def __init__(self, path: Any, numbers: list[float], states: list[State], counts: dict[Kind, list[int]],
                 losses: list[CriticalPoint]):
        self.path, self.numbers, self.states, self.losses = path, numbers, states, losses
        self.counts = {tuple(kind): np.array(found) for kind, found in counts.items()}

    @property
    def bifurcations(self) -> list[CriticalPoint]:
        """Losses that are no limit points."""
        return [loss for loss in self.losses if loss.gained and not loss.limit_point]

    @property
    def first(self) -> CriticalPoint | None:
        """The first alarm on the path, or None: the states looked at are stable."""
        return next(iter(self.bifurcations), None)

    def first_of(self, number: float) -> CriticalPoint | None:
        """The first alarm of modes with so many waves, or None."""
        return next((loss for loss in self.bifurcations if loss.number == number), None)

    def __str__(self) -> str:
        problem = self.path.problem
        name, unit = problem.shown(0.0)[0], "n" if problem.scene.kinematics.axisymmetric else "k"
        head = (f"stability: {unit} = {', '.join(f'{n:g}' for n in self.numbers)}, {len(self.states)} states; elastic,"
                f" at fixed {name}")
        if any(one.relaxes for one in (s.problem for s in self.path.segments)):
            head += "; relaxing materials with their stiffness of the instant"
        unstable = [f"{unit} = {n:g}" for (n, _), found in self.counts.items() if found[0]]
        lines = [head, *([f"  unstable from the first state on: {', '.join(unstable)}"] if unstable else [])]
        lines += [f"  {unit} = {loss.number:g}: {_shown(loss)}" for loss in self.losses]
        return "\n".join(lines if len(lines) > 1 else [*lines, "  no mode is unstable"])

    __repr__ = __str__


def _shown(loss: CriticalPoint) -> str:
    states = loss.path.states
    what = "limit point" if loss.limit_point else "lost" if loss.gained else "regained"
    R, Z = loss.at
    parts = [f"{what} at {loss.driven} {loss.control:.6g}",
             f"between states {states.index(loss.left)} and {states.index(loss.right)}",
             f"largest at R = {R:.4g}, Z = {Z:.4g}", "solved for" if loss.solved else "interpolated"]
    return ", ".join(parts + [f"antisymmetric about {loss.flipped!r}"] * bool(loss.flipped))


class Watch:
    """Looks at states of one path; made once."""

    def __init__(self, path: Any):
        self._path, self._modes = path, {}                              # type: ignore[var-annotated]

    def of(self, segment: Any) -> Modes:
        """The modes of a segment's problem."""
        key = id(segment.problem)
        if key not in self._modes:
            self._modes[key] = Modes(segment.curve)
        return self._modes[key]

    def look(self, modes: Iterable[float], states: Any) -> Stability:
        """See `Path.stability`."""
        numbers = wave_numbers(self._path.problem.scene, modes)
        chosen = _chosen(self._path, states)
        counts: dict[Kind, list[int]] = {}
        losses: list[CriticalPoint] = []
        known: dict[tuple[int, Kind], int] = {}

        def count_at(state: State, kind: Kind) -> int:
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
        folds = [self._is_fold(segment, one) for one in found] if expected else [False] * len(found)
        return [self._loss(segment, one, fold) for one, fold in zip(found, folds, strict=True)]

    def _is_fold(self, segment: Any, found: Located) -> bool:
        """True if the mode is the tangent of the path at its limit point: the driven load does work on it."""
        x, direction = found.x, found.left.direction
        problem = segment.problem
        a, b, c = problem.x.duplicate(), problem.x.duplicate(), problem.x.duplicate()
        a.array_w[:], b.array_w[:] = x, direction
        alike = abs(problem.inner(a, b)) / np.sqrt(problem.inner(a, a) * problem.inner(b, b))
        for vector in (a, b, c):
            vector.destroy()
        return bool(alike > 0.5)

    def _loss(self, segment: Any, found: Located, fold: bool) -> CriticalPoint:
        comm, nodes = segment.problem.comm, self.of(segment).variation.nodes
        points, amplitudes = gathered(comm, nodes), gathered(comm, found.mode)
        size = np.linalg.norm(amplitudes, axis=1)
        amplitudes = amplitudes / size.max()
        if found.solved and not found.state.measures:
            found.state.measures = self._path._measures(segment, found.state)
        elif not found.state.measures:                      # no equilibrium: its forces would be none
            before, behind = found.left.measures, found.right.measures
            found.state.measures = {name: before[name] + found.fraction * (behind[name] - before[name])
                                    for name in before.keys() & behind.keys()}
        with segment.problem.state_context(found.left):
            driven, control = segment.problem.shown(found.state.control)
        return CriticalPoint(self._path, found, float(control), driven, fold, points, amplitudes)


@method_of(Path)
def stability(path: Path, modes: Any = range(9), states: Any = 20) -> Stability:
    """Find the modes of instability of states of a path, and where the path loses its stability in them.

    Args:
        path: the path of a solid; no load on it may depend on the mode in an unknown way.
        modes: circumferential wave numbers; in plane strain wave numbers along the depth, 1/length.
        states: number of states, evenly spaced on the path; "all"; or a list of states of the path.

    Returns:
        The `Stability`, which prints a table.

    Raises:
        InputError: a membrane, or a load that does not say how it changes with a mode.
    """
    path.section_only("stability")
    watch: Watch = vars(path).setdefault("_stability_watch", Watch(path))      # keeps its matrices
    return watch.look(modes, states)


class InstabilityCondition:
    """Ends a run where modes that were stable at its first state are not; see `unstable`."""

    def __init__(self, modes: Any):
        self.modes = modes

    def watch(self, path: Any) -> None:
        """Examine the last state whenever a step of the path is complete."""
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
        path.record.on_step.append(look)


def instability(modes: Iterable[float] = range(9)) -> InstabilityCondition:
    """For `trace(stop_at=...)`: end the run, as a result, once a mode is unstable that was not at its first state.

    modes: waves round the axis; in plane strain wave numbers along the depth. It costs about two iterations a mode and
    state. `Path.ended` says which mode, `Path.stability` finds where.

    >>> fx.trace(scene, until=fx.pole_height(12.0), stop_at=fx.instability([0, 1]), progress=False).ended
    ''
    """
    return InstabilityCondition(modes)


def wave_numbers(scene: Any, modes: Any) -> list[float]:
    """`modes` of `Path.stability` as a list, each once, or an InputError."""
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
    """The states to look at: as many of the path's as asked for, evenly, its ends among them; or those given."""
    there = [s for s in path.states if s.kind != "limit point"]
    if isinstance(states, State | list | tuple):
        given = several("stability: states", [states] if isinstance(states, State) else states, "states of the path")
        if any(all(s is not one for one in path.states) for s in given):
            raise InputError("stability: states: must be of this path")
        if not given:
            raise InputError("stability: states: must be at least one")
        return sorted(given, key=path.states.index)
    everything = isinstance(states, str) and states == "all"
    number = len(there) if everything else min(count("stability: states", states), len(there))
    picked = np.unique(np.round(np.linspace(0, len(there) - 1, max(number, 2))).astype(int)) if there else []
    return [there[k] for k in picked]


def _most_waves(scene: Any) -> float:
    """The number of waves as long as the shortest edge of an element, where the body is widest."""
    domain = scene.mesh.domain
    domain.topology.create_connectivity(1, domain.topology.dim)
    edges = np.arange(domain.topology.index_map(1).size_local, dtype=np.int32)
    shortest = domain.comm.allreduce(float(domain.h(1, edges).min(initial=np.inf)), MPI.MIN)
    widest = domain.comm.allreduce(float(domain.geometry.x[:, 0].max(initial=0.0)), MPI.MAX)
    return 2 * np.pi / shortest * (widest if scene.kinematics.axisymmetric else 1.0)
