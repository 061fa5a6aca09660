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

from ..discrete.problem import Problem
from ..discrete.schedule import Setting
from ..errors import ConvergenceError, InputError, count, finite, instance, several
from ..results.files.checkpoint import Checkpoint
from ..results.path import Path, State
from ..scene import clearance
from ..scene.scene import Scene
from . import targets as goals
from .curve import Branch
from .follow import Run, settle
from .newton import UNLOADED, Failure, Tolerances
from .stepping import StepControl

_SAME = 1e-12          # relative: times that are the same


class Stage:
    """One stage of a process: it drives one thing to a target, follows tables, or only changes what takes part.

    Args:
        name: of the stage, in the record.
        drive: the load, support or contact to drive, itself or its name.
        until: the target that ends the stage, hit exactly, from either side, e.g. `travel(6.0)` (from the reference,
            not from here); with `follow` a `process_time`, or None: the end of the tables.
        through: more targets to hit exactly on the way; those that are not met are left out.
        without: what is not there during the stage, itself or its name: a support that is open, a tool that is away, a
            load that is off. A support takes hold of the body where it is when it comes back.
        follow: instead of `drive`: {thing: [(time, value), ...]}, piecewise linear in time, values in the user's units
            (the last one stays). A table that begins later than the stage is reached in a straight line from
            where the thing stands. Process time is 0 at first and runs in such stages only.
        step: step control of this stage; default that of the run.

    Raises:
        InputError: no target, both `drive` and `follow`, a table that goes back in time, an argument not allowed.
    """

    def __init__(self, name: str, drive: Any = None, until: goals.Target | None = None,
                 through: Sequence[goals.Target] = (), without: Sequence[Any] = (), *,
                 follow: Mapping[Any, Sequence] | None = None, step: StepControl | None = None):
        if not isinstance(name, str) or not name:
            raise InputError(f"Stage: name = {name!r}: must be a word")
        who = self.who = f"Stage {name!r}"
        self.name, self.drive, self.until = name, drive, until
        self.through = several(f"{who}: through", through, "targets, such as pole_stretch(3)")
        self.without = several(f"{who}: without", without, "things of the scene")
        self.step = instance(f"{who}: step", step, StepControl | None, "a StepControl or None")
        for target in (*([] if until is None else [until]), *self.through):
            instance(f"{who}: target", target, goals.Target, "a target, such as pole_stretch(3)")
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
    """Stages on one scene, run in order, each from where the one before ended.

    A pressure, support or tool of the scene that can be driven (`Pressure` without value, `Displaced`, `Contact` with
    `moves`) starts at 0, and stays where it is in stages that do not drive it.

    Args:
        scene: with any number of things that can be driven.
    """

    def __init__(self, scene: Scene):
        self.scene = instance("Process: scene", scene, Scene, "a formingx.Scene")

    def run(self, stages: Sequence[Stage], *, step: StepControl | None = None, tolerances: Tolerances | None = None,
            max_steps: int = 200, progress: bool = True, start: Path | State | None = None,
            checkpoint: Any = None) -> Path:
        """Run the stages; one path holds the states of all of them, every stage from a state of kind "start" on.

        Args:
            stages: in order.
            step: step control of the stages that have none of their own, at their start; default `StepControl()`.
            tolerances: when a state counts as converged; default `Tolerances()`.
            max_steps: accepted states of a stage (of a straight piece of its tables) before the run gives up.
            progress: show a progress bar on what takes more than two seconds (rank 0).
            start: a path of these stages to go on from, also one that `formingx.load` read, or a state of one.
            checkpoint: a folder to which every accepted state is written after each step, see `formingx.load`.

        Raises:
            InputError: a stage drives or leaves out something that the scene does not have, leaves the body free to
                move, or lets tools overlap; a target does not fit its stage; a table does not begin where its thing
                stands; a tool comes in where the body is; a moving tool does not meet its face within the rim.
            ConvergenceError: a target was not reached. It carries the path so far and says what to try.
            OSError: the checkpoint cannot be written; the states in it are kept.
        """
        stages = several("Process: stages", stages, "stages, such as Stage('vacuum', drive=vacuum, until=pressure(1))")
        if not stages:
            raise InputError("Process: stages = []: must have at least one Stage")
        for stage in stages:
            instance("Process: stage", stage, Stage, "a formingx.Stage")
        for stage in stages:
            if sum(other.name == stage.name for other in stages) > 1:
                raise InputError(f"Process: two stages are called {stage.name!r}: names must differ")
        instance("Process: step", step, StepControl | None, "a StepControl or None")
        instance("Process: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
        instance("Process: start", start, Path | State | None, "a path, a state or None")
        plans = [self._plan(stage) for stage in stages]
        unsure = clearance.check(self.scene, plans)
        if isinstance(start, Path) and start.problem.scene is not self.scene:
            raise InputError("Process: start: must be a path of this very scene: fx.load(folder, scene), or what run"
                             " gave back")
        problem = start.problem if isinstance(start, Path) else Problem(self.scene)
        for state in [start] if isinstance(start, State) else start.states[-1:] if start else []:
            number = state.setting.get("stage", -1)
            if len(state.x) != problem.x.getLocalSize() or not 0 <= number < len(stages):
                raise InputError("Process: start: must be of this process: its last state is of another scene or stage")
            if stages[number].name != state.stage:
                raise InputError(f"Process: start: its last state is of stage {state.stage!r}, number {number + 1}, but"
                                 f" stage {number + 1} is {stages[number].name!r} now: give the stages of the whole"
                                 f" process, those that are done too")
        execution = _Execution(self.scene, plans, problem, tolerances or Tolerances(), step, checkpoint, start,
                               unsure)
        try:
            return execution.run(count("Process: max_steps", max_steps), progress)
        except InputError as error:
            error.path = execution.path
            raise

    def _plan(self, stage: Stage) -> _Plan:
        scene, who = self.scene, stage.who
        off = sorted({i for thing in stage.without for i in scene.together(scene.number(f"{who}: without", thing))})
        driven = [stage.drive] if stage.drive is not None else [thing for thing, _ in stage.tables]
        numbers = [scene.number(who, thing) for thing in driven]
        for number in numbers:
            thing = scene.things[number]
            if not thing.driven:
                raise InputError(f"{who}: {thing!r} cannot be driven: a Pressure without value, a Displaced support, or"
                                 f" a Contact that moves can")
            if number in off and thing.moves is None:                  # a tool may go home while it is away
                raise InputError(f"{who}: {thing!r} is both driven and left out")
        if len({scene.together(number)[0] for number in numbers}) < len(numbers):
            raise InputError(f"{who}: one thing has two tables")
        there = [thing for i, thing in enumerate(scene.things) if i not in off]
        try:
            supports = [t for t in there if t in scene.supports]
            scene.check_held(supports, any(t in there for t in scene.contacts))
            scene.check_driven(supports)
        except InputError as error:
            raise InputError(f"{who}: {error}") from None
        tables = [(i, table) for number, (_, table) in zip(numbers, stage.tables) for i in scene.together(number)]
        return _Plan(stage, scene.together(numbers[0]) if stage.drive is not None else [], tables, off)


class _Plan(NamedTuple):
    """A stage with the things of the scene by their numbers: what it drives, [(number, table)], what is left out."""

    stage: Stage
    numbers: list[int]
    tables: list[tuple[int, np.ndarray]]
    off: list[int]


class _Execution:
    """One run of a process: from where it stands, stage by stage.

    Piece 0 of a stage changes what takes part, pieces from 1 on drive; each has one `Setting`.
    """

    def __init__(self, scene: Scene, plans: list[_Plan], problem: Problem, tolerances: Tolerances,
                 step: StepControl | None, checkpoint: Any, start: Path | State | None, unsure: list[_Plan]):
        self.scene, self.plans, self.problem, self._step, self._unsure = scene, plans, problem, step, unsure
        self.branch, self._balanced = Branch(problem, tolerances), tolerances.residual
        timed = any(plan.tables for plan in plans)
        self.path = Path(problem, self.branch, start if isinstance(start, Path) else None, timed)
        self.path.states += [start] if isinstance(start, State) else []
        self.checkpoint = None if checkpoint is None else Checkpoint(checkpoint, self.path)
        self._rest = np.zeros(problem.x.getLocalSize())
        self._targets = [self._bind(plan) for plan in plans]    # so that nothing is compiled between stages
        problem.enter(Setting.first(scene), self._rest, 0.0)

    def run(self, max_steps: int, progress: bool) -> Path:
        """All stages that are left."""
        self._max_steps, self._progress = max_steps, progress
        last = self.path.last.setting if self.path.states else {"stage": 0, "piece": -1}
        if self.path.states:
            self.problem.remember(self.path.last)
        for k, plan in enumerate(self.plans[last["stage"]:], last["stage"]):
            self.path.stage, self._stage, self._off, self._k = plan.stage.name, plan.stage, plan.off, k
            piece = last["piece"] if k == last["stage"] else -1     # of this stage, that has begun already
            if piece < 1:
                self._change(piece == 0)
                if any(plan is p for p in self._unsure):     # now its travels are known
                    clearance.check(self.scene, [plan], self._travels())
            if plan.tables:
                self._follow(plan.tables, max(piece, 0))
            elif plan.numbers:
                self._drive(plan.numbers, piece > 0)
            elif not self.path.states or self.path.last.setting["stage"] < k:
                self._record(self._resumed(self._standing()[2]))
        return self.path

    def _bind(self, plan: _Plan) -> list[tuple[goals.Target, goals.Bound]]:
        """The targets of a stage and their measures; where it drives one thing the last is `until`."""
        stage, n = plan.stage, len(self.scene.things)
        moving = {*plan.numbers, *(i for i, _ in plan.tables)}
        rate = [float(i in moving) for i in range(n)] + [float(bool(plan.tables))]
        self.problem.enter(Setting([0.0] * (n + 1), rate, plan.off), self._rest, 0.0)
        found = []
        for target in (*stage.through, *([stage.until] if plan.numbers else [])):
            try:
                bound = target.bind(self.problem)
            except InputError as error:
                raise InputError(f"{stage.who}: {error}") from None
            if isinstance(bound, goals.Amplitude) and not bound.moves:
                raise InputError(f"{stage.who}: target {target}: this stage does not drive that")
            found.append((target, bound))
        return found

    def _standing(self) -> tuple[Setting, np.ndarray, float]:
        """The setting, the unknowns and the control where the process stands now."""
        last = self.path.last if self.path.states else None
        return self.problem.setting, last.x if last else self._rest, last.control if last else 0.0

    def _travels(self) -> dict[int, float]:
        """How far each tool of the scene has come, {number: length}."""
        return {i: self._stands(i) for i, thing in enumerate(self.scene.things) if thing in self.scene.contacts}

    def _stands(self, number: int) -> float:
        """Value of a thing now, in the user's units."""
        setting, _, control = self._standing()
        return setting.amplitude(number, control) * self.problem.forms.scales[number]

    def _enter(self, base: list[float], rate: list[float], piece: int, control: float, fading: bool = False) -> None:
        setting = Setting(base, rate, self._off, fading, self._k, piece)
        self.problem.enter(setting, self._standing()[1], control)

    def _resumed(self, control: float) -> State:
        """Where the process stands, as the start of a piece."""
        if not self.path.states:
            return self.branch.start()
        try:
            return self.branch.resume(self.path.last.x, control)
        except Failure as failure:
            raise ConvergenceError(f"{self._stage.who} cannot begin: {failure.reason}", self.path) from None

    def _record(self, state: State) -> None:
        """Take up a state that needs no solving."""
        self.path.record(state)
        settle(self.path, StepControl(), goals.changed(), self.checkpoint)

    def _trace(self, targets: list, control: float | None, turns: bool = True) -> list:
        """Follow the path from a control (None: on from the last state); returns the targets that are still open."""
        run = Run(self.path, self.branch, targets, self._stage.step or self._step, self.checkpoint, turns)
        start = None if control is None else self._resumed(control)
        run.trace(self._max_steps, self._progress, start)
        return run.open

    def _change(self, begun: bool) -> None:
        """Piece 0: what takes part changes. What that leaves without balance is taken away gradually."""
        before, x, control = self._standing()
        start: float | None = None
        if not begun:
            for i in set(before.off) - set(self._off):
                self._bring_in(self.scene.things[i], x, control)
            still, fading = [0.0] * len(before.base), bool(self.path.states) and before.off != self._off
            start = 0.0 if fading else control
            self._enter(before.standing(control), still, 0, start, fading)
        if self.problem.setting.fading and (begun or self._out_of_balance(x)):
            target = goals.changed()
            self._trace([(target, target.bind(self.problem))], start)

    def _bring_in(self, thing: Any, x: np.ndarray, control: float) -> None:
        """A tool that was away remembers nothing, and must not stand in the body."""
        for contact in self.problem.contacts:
            if contact.contact is thing:
                contact.forget(x, control)
                depth = contact.largest_penetration(x, control)
                if depth > 1e-6 * self.problem.forms.length:
                    raise InputError(f"{self._stage.who}: {thing!r} comes in where the body is, which reaches"
                                     f" {depth:.6g} into the tool")

    def _out_of_balance(self, x: np.ndarray) -> bool:
        self.problem.x.array_w[:] = x
        self.problem.residual(self.problem.x, 1.0, self.branch.newton.F)
        return self.branch.newton.F.norm() > self._balanced * (self.problem.force_scale + UNLOADED)

    def _drive(self, numbers: list[int], begun: bool) -> None:
        """Piece 1: one thing is the control."""
        before, _, control = self._standing()
        if not begun:
            base, rate = before.standing(control), [0.0] * len(before.base)
            control = base[numbers[0]]
            for number in numbers:
                base[number], rate[number] = 0.0, 1.0
            self._enter(base, rate, 1, control)
        self._trace(self._targets[self._k], None if begun else control)

    def _follow(self, tables: list[tuple[int, np.ndarray]], piece: int) -> None:
        """Pieces 1, 2, ...: from knot to knot of the tables, the time being the control."""
        before, _, control = self._standing()
        stage, through = self._stage, self._targets[self._k]
        end = stage.until.value if stage.until else max(table[-1, 0] for _, table in tables)
        now = before.base[-1] if piece else before.amplitude(-1, control)
        if not piece:
            self._check_beginning(tables, now, end)
        begun = piece > 0
        while begun or now < end - _SAME * abs(end):
            then = min([t for _, table in tables for t in table[:, 0] if now + _SAME * abs(t) < t < end] + [end])
            if not begun:
                piece += 1
                self._enter_line(tables, now, then, piece)
            through = self._line(then, through, begun)
            now, begun = then, False

    def _enter_line(self, tables: list, now: float, then: float, piece: int) -> None:
        """All tables are straight between these times; the control is the time, scaled: no amplitude is faster."""
        before, _, control = self._standing()
        base, scales = before.standing(control), self.problem.forms.scales
        change = [0.0] * len(base)
        for i, table in tables:
            first, value = table[0]
            ahead = float(np.interp(then, *table.T)) / scales[i]
            if first > then:                                # still on the way from where it stands to its first knot
                ahead = base[i] + (value / scales[i] - base[i]) * (then - now) / (first - now)
            change[i] = ahead - base[i] if abs(ahead - base[i]) > _SAME * abs(ahead) else 0.0
        most = max(map(abs, change))
        base[-1], change[-1] = now, then - now
        self._enter(base, [c / (most or 1.0) for c in change], piece, 0.0)

    def _line(self, then: float, through: list, begun: bool) -> list:
        """Go to the end of a piece of the tables; returns the targets that are still open."""
        if self.problem.setting.rests:                      # only time goes by
            if not begun:
                self._record(self._resumed(0.0))
            if self.path.last.control < 1.0:
                self._record(replace(self.path.last, control=1.0, kind="target", measures={}, history=[]))
            return through
        target = goals.process_time(then)
        return self._trace([*through, (target, target.bind(self.problem))], None if begun else 0.0, turns=False)

    def _check_beginning(self, tables: list[tuple[int, np.ndarray]], now: float, end: float) -> None:
        who = self._stage.who
        if end <= now:
            raise InputError(f"{who}: ends at time {end:g}, but the process time is {now:g} already: time cannot go"
                             f" back")
        for i, table in tables:
            name, first = repr(self.scene.things[i]), table[0]
            if first[0] < now - _SAME * abs(now):
                raise InputError(f"{who}: the table of {name} begins at time {first[0]:g}, but the process time is"
                                 f" {now:g} already: it goes back in time")
            stands = self._stands(i)
            size = max(np.abs(table[:, 1]).max(), self.problem.forms.scales[i])
            if first[0] <= now + _SAME * abs(now) and abs(stands - first[1]) > 1e-9 * size:
                raise InputError(f"{who}: the table of {name} begins with {first[1]:g} at time {first[0]:g}, but it"
                                 f" stands at {stands:g} then")
