"""A process: stages in order, each with its own control, which go on where the one before ended.

Everything is created once. A stage sets how the things of the scene follow the control (`Setting`): what it drives has
the control as its amplitude; what else can be driven keeps the value that it has. Tables against time make the time
the control, piece by piece between their knots. What a stage leaves out (a grip that opens, a plug that is not there
yet) leaves forces without balance: they are taken away gradually, which is one more path to follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .. import clearance
from ..errors import ConvergenceError, InputError, count, finite, instance, several
from ..problem import Problem
from ..results import measures
from ..results.path import Path, State
from ..scene import Scene
from ..setting import Setting
from .bordered import UNLOADED, Failure, Tolerances
from .branch import Branch
from .continuation import Run, is_met
from .stepping import StepControl

_SOON = 1e-12          # relative: times that are the same


class Stage:
    """One stage of a process: it drives one thing to a target, follows tables, or only changes what takes part.

    Args:
        name: what the stage is called.
        drive: the load, support or tool to drive, itself or its name.
        until: the target that ends the stage, hit exactly, from either side; with `follow` a `process_time`, or
            None: the end of the tables.
        through: more targets to hit exactly on the way; those that are not met are left out.
        follow: instead of `drive`: {thing: [(time, value), ...]}, piecewise linear, values in the user's units (the
            last one stays). A table that begins later than the stage is reached in a straight line from
            where the thing stands. Process time is 0 at first and runs in such stages only.
        without: what takes no part in this stage: a support that is open, a tool that is away, a load that is off. A
            support takes hold of the body where it is then.
        step: step control; default `StepControl()`.
        max_steps: accepted states before the stage gives up.

    Raises:
        InputError: no target, both `drive` and `follow`, a table that goes back in time, an argument not allowed.
    """

    def __init__(self, name: str, *, drive: Any = None, until: measures.Target | None = None,
                 through: Sequence[measures.Target] = (), follow: Mapping[Any, Sequence] | None = None,
                 without: Sequence[Any] = (), step: StepControl | None = None, max_steps: int = 200):
        if not isinstance(name, str) or not name:
            raise InputError(f"Stage: name = {name!r}: must be a word")
        who = self.who = f"Stage {name!r}"
        self.name, self.drive, self.until = name, drive, until
        self.through = several(f"{who}: through", through, "targets, such as pole_stretch(3)")
        self.without = several(f"{who}: without", without, "things of the scene")
        self.step = instance(f"{who}: step", step, StepControl | None, "a StepControl or None")
        self.max_steps = count(f"{who}: max_steps", max_steps)
        for target in (*([] if until is None else [until]), *self.through):
            instance(f"{who}: target", target, measures.Target, "a target, such as pole_stretch(3)")
        if drive is not None and follow is not None:
            raise InputError(f"{who}: both drive and follow are given: a stage has one control")
        if drive is not None and until is None:
            raise InputError(f"{who}: drives {drive!r} without a target: give it until=..., such as travel(3)")
        if drive is None and follow is None and (until is not None or self.through):
            raise InputError(f"{who}: has a target but drives nothing: give it drive=... or follow=...")
        if follow is not None and until is not None and until.name != "process_time":
            raise InputError(f"{who}: until = {until}: tables are followed until a process_time, or to their end")
        self.tables = [] if follow is None else self._tables(follow)

    def _tables(self, follow: Any) -> list[tuple[Any, np.ndarray]]:
        """[(thing, knots, shape (n, 2))]."""
        if not isinstance(follow, Mapping) or not follow:
            raise InputError(f"{self.who}: follow = {follow!r}: must be {{thing: [(time, value), ...]}}")
        tables = []
        for thing, knots in follow.items():
            table = f"{self.who}: the table of {thing!r}"
            rows = [several(table, row, "two numbers") for row in several(table, knots, "(time, value)")]
            if not rows or any(len(row) != 2 for row in rows):
                raise InputError(f"{table}: must be [(time, value), ...]")
            numbers = [(finite(f"{table}: time", t), finite(f"{table}: value", v)) for t, v in rows]
            for (a, _), (b, _) in zip(numbers, numbers[1:]):
                if b <= a:
                    raise InputError(f"{table} goes back in time, or stands still: {b:g} after {a:g}; times must"
                                     f" grow")
            tables.append((thing, np.array(numbers)))
        return tables

    def __repr__(self) -> str:
        return f"Stage({self.name!r})"


class Process:
    """Stages of a scene, in order.

    Args:
        scene: with any number of things that can be driven.
        stages: list of `Stage`.

    Raises:
        InputError: a stage drives or leaves out something that the scene does not have, leaves the body free to move,
            or lets tools overlap; a moving tool does not meet its face within the rim.
    """

    def __init__(self, scene: Scene, stages: Sequence[Stage]):
        self.scene = instance("Process: scene", scene, Scene, "a formingx.Scene")
        self.stages = several("Process: stages", stages, "stages, such as Stage('plug', drive=..., until=...)")
        if not self.stages:
            raise InputError("Process: it has no stage")
        for stage in self.stages:
            instance("Process: stage", stage, Stage, "a formingx.Stage")
            if sum(other.name == stage.name for other in self.stages) > 1:
                raise InputError(f"Process: two stages are called {stage.name!r}: names must differ")
        self.plans = [self._plan(stage) for stage in self.stages]
        clearance.check(scene, self.plans)

    def _plan(self, stage: Stage) -> _Plan:
        scene, who = self.scene, stage.who
        off = sorted({scene.number(f"{who}: without", thing) for thing in stage.without})
        driven = [stage.drive] if stage.drive is not None else [thing for thing, _ in stage.tables]
        numbers = [scene.number(who, thing) for thing in driven]
        for number in numbers:
            if not any(scene.things[number] is thing for thing in scene.drivable):
                raise InputError(f"{who}: {scene.things[number]!r} cannot be driven: a Pressure without value, a Displaced"
                                 f" support, or a Contact that moves can")
            if number in off and not hasattr(scene.things[number], "moves"):    # a tool may go home while it is away
                raise InputError(f"{who}: {scene.things[number]!r} is both driven and left out")
        if len(set(numbers)) < len(numbers):
            raise InputError(f"{who}: one thing has two tables")
        there = [thing for i, thing in enumerate(scene.things) if i not in off]
        try:
            scene.check_held([t for t in there if hasattr(t, "constraints")], any(t in there for t in scene.contacts))
        except InputError as error:
            raise InputError(f"{who}: {error}") from None
        tables = [(number, table) for number, (_, table) in zip(numbers, stage.tables)]
        return _Plan(stage, None if stage.drive is None else numbers[0], tables, off)

    def run(self, *, tolerances: Tolerances | None = None, progress: bool = True,
            start: Path | State | None = None) -> Path:
        """Run the stages; one path holds the states of all of them, every stage from a state of kind "start" on.

        Args:
            tolerances: when a state counts as converged; default `Tolerances()`.
            progress: show a progress bar on what takes more than two seconds (rank 0).
            start: a path of this process to go on from, or a state of one; what it has done is not done again.

        Raises:
            InputError: a target does not fit its stage, a table does not begin where its thing stands, a tool comes in
                where the body is.
            ConvergenceError: a target was not reached. It carries the path so far and says what to try.
        """
        instance("Process: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
        instance("Process: start", start, Path | State | None, "a path, a state or None")
        execution = _Execution(self, Problem(self.scene), tolerances or Tolerances(), progress)
        if isinstance(start, State):
            state, start = start, Path(execution.problem, execution.branch)
            start.states = [state]
        if start is not None:
            execution.go_on_from(start)
        return execution.run()


class _Plan(NamedTuple):
    """A stage with the things of the scene by their numbers: what it drives, [(number, its table)], what is left out."""

    stage: Stage
    number: int | None
    tables: list[tuple[int, np.ndarray]]
    off: list[int]


class _Execution:
    """One run of a process: from where it stands, stage by stage."""

    def __init__(self, process: Process, problem: Problem, tolerances: Tolerances, progress: bool):
        self.scene, self.plans, self.problem, self.progress = process.scene, process.plans, problem, progress
        self.branch, self._balanced = Branch(problem, tolerances), tolerances.residual
        self.path = Path(problem, self.branch, timed=any(plan.tables for plan in self.plans))
        self._rest = np.zeros(problem.x.getLocalSize())
        self._targets = [self._bind(plan) for plan in self.plans]   # so that nothing is compiled between stages
        problem.enter(Setting.first(process.scene), self._rest, 0.0)

    def go_on_from(self, start: Path) -> None:
        """Take up the states of a path."""
        last, problem, path = start.last, self.problem, self.path
        if len(last.x) != len(self._rest) or not last.setting or last.setting["stage"] >= len(self.plans):
            raise InputError("Process: start: must be a path of this process")
        path.states, path.counts = list(start.states), replace(start.counts)
        path.go_to(last)
        problem.advance(last.x, last.control)
        problem.memory = last.memory

    def run(self) -> Path:
        """All stages that are left."""
        states, first = self.path.states, self.path.states[-1].setting["stage"] if self.path.states else 0
        for k, plan in enumerate(self.plans[first:], first):
            begun = bool(states) and states[-1].setting["stage"] == k and states[-1].setting["piece"] > 0
            self.path.stage, self._stage, self._off, self._k = plan.stage.name, plan.stage, plan.off, k
            if not begun:
                self._change()
            if plan.tables:
                self._follow(plan.tables, begun)
            elif plan.number is not None:
                self._drive(plan.number, begun)
            elif not begun:
                before, _, control = self._standing()
                self._enter(before.standing(k, 1, self._off, control), 0.0)
                self.path.record(self._resumed(0.0))
        return self.path

    def _bind(self, plan: _Plan) -> list[tuple[measures.Target, measures.Bound]]:
        """The targets of a stage and their measures; where it drives one thing the last is `until`."""
        stage, n = plan.stage, len(self.scene.things)
        moving = {plan.number, *(i for i, _ in plan.tables)}
        rate = [float(i in moving) for i in range(n)] + [float(bool(plan.tables))]
        self.problem.enter(Setting([0.0] * (n + 1), rate, plan.off), self._rest, 0.0)
        found = []
        for target in (*stage.through, *([stage.until] if plan.number is not None else [])):
            try:
                bound = target.bind(self.problem)
            except InputError as error:
                raise InputError(f"{stage.who}: {error}") from None
            if isinstance(bound, measures.Amplitude) and not bound.moves:
                raise InputError(f"{stage.who}: target {target}: this stage does not drive that")
            found.append((target, bound))
        return found

    def _standing(self) -> tuple[Setting, np.ndarray, float]:
        """The setting, the unknowns and the control where the process stands now."""
        last = self.path.states[-1] if self.path.states else None
        return self.problem.setting, last.x if last else self._rest, last.control if last else 0.0

    def _enter(self, setting: Setting, control: float) -> None:
        self.problem.enter(setting, self._standing()[1], control)

    def _resumed(self, control: float) -> State:
        """Where the process stands, as the start of a piece."""
        if not self.path.states:
            return self.branch.start()
        try:
            return self.branch.resume(self.path.last.x, control)
        except Failure as failure:
            raise ConvergenceError(f"{self._stage.who} cannot begin: {failure.reason}", self.path) from None

    def _trace(self, targets: list, control: float, turns: bool = True, sense: State | None = None) -> list:
        """Follow the path under the setting of now to the last target; returns the targets that are still open.

        `sense`: a state whose tangent says which way to go; None: the way of the target.
        """
        run = Run(self.path, self.branch, targets, self._stage.step, turns)
        run.trace(self._stage.max_steps, self.progress, self._resumed(control), sense)
        return run.open

    def _change(self) -> None:
        """Piece 0: what takes part changes. What that leaves without balance is taken away gradually."""
        before, x, control = self._standing()
        if not self.path.states:
            self._enter(before.standing(self._k, 0, self._off, control), control)
            return
        for i in set(before.off) - set(self._off):
            self._bring_in(self.scene.things[i], x, control)
        if before.off == self._off:
            return
        self._enter(before.standing(self._k, 0, self._off, control, fading=True), 0.0)
        if self._out_of_balance(x):
            target = measures.changed()
            self._trace([(target, target.bind(self.problem))], 0.0)

    def _bring_in(self, thing: Any, x: np.ndarray, control: float) -> None:
        """A tool that was away remembers nothing, and must not stand in the body."""
        for contact in self.problem.contacts:
            if contact.contact is thing:
                contact.forget(x, control)
                depth = contact.largest_penetration(x, control)
                if depth > 1e-6 * self.problem.forms.length:
                    raise InputError(f"{self._stage.who}: {thing!r} comes in where the body is: {depth:.6g} of the body is"
                                     f" inside the tool")

    def _out_of_balance(self, x: np.ndarray) -> bool:
        self.problem.x.array_w[:] = x
        self.problem.residual(self.problem.x, 1.0, self.branch.newton.F)
        return self.branch.newton.F.norm() > self._balanced * (self.problem.force_scale + UNLOADED)

    def _drive(self, number: int, begun: bool) -> None:
        """Piece 1: one thing is the control."""
        targets = self._targets[self._k]
        before, _, control = self._standing()
        last = self.path.last if begun else None
        if last and is_met(*targets[-1], self.path.value(targets[-1][1], last)):
            return
        setting, control = before.driving(number, self._k, 1, self._off, control)
        self._enter(setting, control)
        self._trace(targets, control, sense=last)

    def _follow(self, tables: list[tuple[int, np.ndarray]], begun: bool) -> None:
        """Pieces 1, 2, ...: from knot to knot of the tables, the time being the control."""
        before, _, control = self._standing()
        now, stage, through = before.amplitude(-1, control), self._stage, self._targets[self._k]
        end = stage.until.value if stage.until else max(table[-1, 0] for _, table in tables)
        if not begun:
            self._check_beginning(tables, now, end)
        piece = before.piece if begun else 0
        while now < end - _SOON * abs(end):
            knots = [t for _, table in tables for t in table[:, 0] if now + _SOON * abs(t) < t < end]
            then, piece = min([*knots, end]), piece + 1
            through = self._line(tables, now, then, piece, through)
            now = then

    def _line(self, tables: list, now: float, then: float, piece: int, through: list) -> list:
        """One piece of all tables; returns the targets that are still open."""
        before, _, control = self._standing()
        base = [before.amplitude(i, control) for i in range(len(before.base))]
        rate, scales = [0.0] * len(base), self.problem.forms.scales
        for i, table in tables:
            first, value = table[0]
            ahead = np.interp(then, *table.T) / scales[i]
            if first > then:                                # still on the way from where it stands to its first knot
                ahead = base[i] + (value / scales[i] - base[i]) * (then - now) / (first - now)
            rate[i] = float(ahead - base[i])
        most = max(map(abs, rate)) or 1.0
        moves = any(abs(r) > 1e-14 for r in rate)
        base[-1], rate[-1] = now, then - now
        self._enter(Setting(base, [r / most for r in rate], self._off, False, self._k, piece), 0.0)
        if moves:
            target = measures.process_time(then)
            return self._trace([*through, (target, target.bind(self.problem))], 0.0, turns=False)
        self.path.record(self._resumed(0.0))
        self.path.record(replace(self.path.last, control=most, kind="target", measures={}, history=[]))
        return through

    def _check_beginning(self, tables: list[tuple[int, np.ndarray]], now: float, end: float) -> None:
        who, (before, _, control) = self._stage.who, self._standing()
        if end <= now:
            raise InputError(f"{who}: ends at time {end:g}, but the process time is {now:g} already: time cannot go back")
        for i, table in tables:
            name, first = repr(self.scene.things[i]), table[0]
            if first[0] < now - _SOON * abs(now):
                raise InputError(f"{who}: the table of {name} begins at time {first[0]:g}, but the process time is {now:g}"
                                 f" already: it goes back in time")
            stands = before.amplitude(i, control) * self.problem.forms.scales[i]
            if first[0] <= now + _SOON * abs(now) and abs(stands - first[1]) > 1e-9 * max(abs(stands), abs(first[1])):
                raise InputError(f"{who}: the table of {name} begins with {first[1]:g} at time {first[0]:g}, but it stands"
                                 f" at {stands:g} then")
