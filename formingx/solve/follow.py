"""Follows the path of a scene through limit points to a target (Riks 1979; Song 1993, eqs. 4.8 to 4.31).

A step predicts along the tangent and corrects in the plane normal to it (Keller), in a norm that knows neither the
mesh nor the units. Targets are hit exactly: within reach, the equation "measure = target" takes the plane's place.
"""

from __future__ import annotations

import itertools
import logging
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ..discrete.problem import Problem
from ..errors import ConvergenceError, InputError, count, instance, several
from ..physics.contact import Contact
from ..results.files.checkpoint import Checkpoint
from ..results.path import Path, State
from ..scene.scene import Scene
from . import targets as goals
from .curve import Branch
from .diagnose import diagnose
from .newton import Failure, Tolerances
from .stepping import StepControl

log = logging.getLogger("formingx")

JUMP_AT = (2, 1e-3)
_TRY = (" Try a target within what was met, a smaller first step (step=StepControl(length=...)), more elements where"
        " the body deforms most, or more max_steps.")


def trace(scene: Scene, *, until: goals.Target, through: Sequence[goals.Target] = (),
          step: StepControl | None = None, tolerances: Tolerances | None = None, max_steps: int = 200,
          progress: bool = True, start: Path | None = None, checkpoint: Any = None) -> Path:
    """Follow the equilibrium path from the unloaded body until a target is reached, through limit points.

    Args:
        scene: with one driven load or support.
        until: the target that ends the run, e.g. `pole_stretch(8.5)`; hit exactly.
        through: more targets to hit exactly on the way; those that are not met are left out.
        step: step control; default `StepControl()`.
        tolerances: when a state counts as converged; default `Tolerances()`.
        max_steps: accepted states before the run gives up.
        progress: show a progress bar on runs of more than two seconds (rank 0).
        start: a path of this scene to go on from, also one that `formingx.load` read; it stays as it is. Its steps go
            on as they were, unless `step` is given; targets that it has met count as met.
        checkpoint: a folder to which every accepted state is written after each step, see `formingx.load`.

    Raises:
        InputError: nothing is driven, a target needs something that the scene does not have, `start` is of another
            scene, or the checkpoint holds another run.
        ConvergenceError: the target was not reached. It carries the path so far and says what to try.
        OSError: the checkpoint cannot be written; the states in it are kept.
    """
    instance("trace: scene", scene, Scene, "a formingx.Scene")
    through = several("trace: through", through, "targets, such as pole_stretch(3)")
    for target in (until, *through):
        instance("trace: target", target, goals.Target, "a target, such as pole_stretch(3)")
        if target.name == "travel" and isinstance(scene.driven, Contact):
            scene.check_travel(scene.driven, target.value)
    instance("trace: step", step, StepControl | None, "a StepControl or None")
    instance("trace: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
    max_steps = count("trace: max_steps", max_steps)
    scene.only_driven("trace")
    if start is not None and (not isinstance(start, Path) or start.problem.scene is not scene or not start.states):
        raise InputError("trace: start: must be a path of this very scene: fx.load(folder, scene), or what trace gave"
                         " back")
    problem = Problem(scene) if start is None else start.problem
    branch = Branch(problem, tolerances or Tolerances())
    path = Path(problem, branch, start)
    targets = [(target, target.bind(problem)) for target in (*through, until)]
    run = Run(path, branch, targets, step, None if checkpoint is None else Checkpoint(checkpoint, path))
    run.trace(max_steps, progress, None if path.states else branch.start())
    return path


class Run:
    """A path that grows with one control, and the targets still open.

    Args:
        path: where the states go; branch: solves for them.
        targets: (target, its measure): the last one ends the run, the others are met on the way.
        step: step control; default that of the path's last states, or `StepControl()`.
        checkpoint: where states are written after each step, or None.
        turns: False: the control must not turn back (it is the time).
    """

    def __init__(self, path: Path, branch: Branch, targets: Sequence[tuple[goals.Target, goals.Bound]],
                 step: StepControl | None, checkpoint: Checkpoint | None, turns: bool = True):
        self.path, self.branch, self.checkpoint, self._turns = path, branch, checkpoint, turns
        self.open = list(targets)
        self.until, self._aim = self.open[-1]
        self._step, self._best, self._began = step, 0.0, time.perf_counter()

    def trace(self, max_steps: int, progress: bool, start: State | None) -> None:
        """Follow the path from a state, or on from the last one, until the last target is met."""
        path, before = self.path, self.path.counts.steps
        kept: dict[str, Any] = {}
        self._first = len(path.states)
        bar = _progress_bar(path.problem.comm, self.until, progress)
        try:
            if start is None:
                self._first -= sum(1 for _ in itertools.takewhile(lambda s: s.setting == path.last.setting,
                                                                  reversed(path.states)))
                kept = next((s.stepping["step"] for s in reversed(self.states) if s.stepping), {})
                path.problem.remember(path.last)
                self._best = max(map(self._gained, self.states))
                met = [s.met[:2] for s in self.states if s.met]
                self.open = [(target, bound) for target, bound in self.open if target[:2] not in met]
            else:
                self._record(self._facing_target(start))
            self.step = replace(self._step or StepControl(**kept))
            self._close_met(path.last)
            self._settle()
            while self._is_open(self.until):
                if path.counts.steps - before >= max_steps:
                    self._give_up(f"{max_steps} states were accepted before it", pace=self._pace(max_steps))
                for state in self._next(path.last):
                    self._record(state)
                    if state.kind == "limit point" and not self._turns:
                        self._give_up("no state follows in time: what the tables drive has a limit point here")
                    if path.problem.memory or not self._is_open(self.until) and state.met is self.until:
                        break                           # with a history, the rest of the step starts from here
                self._settle()
                self._check_direction()
                _show(bar, self.states, self.until)
        except BaseException:
            path.counts.seconds += self._elapsed()
            raise
        finally:
            bar.close()

    @property
    def states(self) -> list[State]:
        """Those of this run."""
        return self.path.states[self._first:]

    def _elapsed(self) -> float:
        """Seconds since this was last asked."""
        before, self._began = self._began, time.perf_counter()
        return self._began - before

    def _settle(self) -> None:
        """A step is complete: note how the run goes on from here, on disk too."""
        self.path.counts.seconds += self._elapsed()
        settle(self.path, self.step, self.until, self.checkpoint)

    def _facing_target(self, start: State) -> State:
        """The start, its tangent turned if the target lies the other way.

        (At rest a target that does not change sign with the control may be reached both ways.)
        """
        if self.until.signed or self.path.states:
            size = 1.0 if self.until.signed else 1e-3
            now = self.branch.value(self._aim, start.x, start.control)
            ahead = self.branch.value(self._aim, start.x + size * start.direction, start.control + size * start.slope)
            if (ahead - now) * (self.until.value - now) < 0:
                start.direction, start.slope = -start.direction, -start.slope
        return start

    def _close_met(self, start: State) -> None:
        """Close the targets that hold at the start already, to round-off."""
        for target, bound in list(self.open):
            if goals.is_met(target, bound, self.branch.value(bound, start.x, start.control)):
                start.met = start.met or target
                self.open = [(t, b) for t, b in self.open if t is not target]

    def _next(self, old: State) -> list[State]:
        """The next states: one at a target within reach, or one step ahead, and what lies on the way to it.

        Failures halve the step.
        """
        problem = self.path.problem
        fails = 0
        if old.kind == "limit point" and problem.memory:
            return [self.branch.jump(old, 1e-6)]
        while True:
            length = problem.reach(old.x, old.control, old.direction, old.slope, self.step.length)
            limited = length < self.step.length
            target, bound, reach = self._within_reach(old, length)
            problem.prepare(old.x, old.control, old.direction, old.slope, reach)
            try:
                if target is None:
                    new = self.branch.step(old, length)
                else:
                    new = self.branch.step_to(old, reach, bound.equation(target.value))
                    if not 0 < self.branch.progress(old, new) < 2 * length:
                        raise Failure("the target was met on a far part of the path", [])
                    new.met = target
                if problem.too_far(old.x, old.control, new.x, new.control):
                    raise Failure("too much came into contact in one step", [])
                if self._been_at(new, old):
                    raise Failure("the iteration fell back to a part of the path that was passed", [])
                states = self._sorted_into(old, new)
                if target is None and not limited:
                    self.step.accepted(len(new.history) - 1)
                return states
            except Failure as failure:
                self.path.counts.failures += 1
                self.step.length = length
                log.info("a step of length %.3g failed: %s", length, failure.reason)
                fails += 1
                if problem.memory and fails >= JUMP_AT[0] and length < JUMP_AT[1]:
                    try:
                        return [self.branch.jump(old, max(1e-6, length * old.slope))]
                    except Failure:
                        log.info("jump failed")
                if not self.step.failed():
                    self._give_up(f"the step became shorter than {self.step.smallest:g}: {failure.reason}",
                                  failure.attempt)

    def _been_at(self, new: State, old: State) -> bool:
        """True if a state found from `old` lies on an earlier piece of the path, which never comes back to itself."""
        near, passed = 0.1 * self.branch.distance(old, new), self.states[:-1]
        for a, b in zip(passed, passed[1:]):
            if (a.control - new.control) * (b.control - new.control) < 0:
                x, control = self.branch.interpolate(a, b, (new.control - a.control) / (b.control - a.control))
                if self.branch.distance(new, replace(new, x=x, control=control)) < near:
                    return True
        return False

    def _check_direction(self) -> None:
        """Stop if the path has turned back: its target further away than half of what had been gained.

        (A control may fall again after a limit point, but not below where it started.)
        """
        if not self._is_open(self.until):
            return
        gained = self._gained(self.path.last)
        self._best = max(self._best, gained)
        kept = 0.0 if isinstance(self._aim, goals.Amplitude) else 0.5
        if self._best > 0.05 and gained < kept * self._best or gained < -0.05:
            self._give_up("the path turned back, which a crease at a singular corner (a clamped rim on a fine mesh) can"
                          " cause")

    def _gained(self, state: State) -> float:
        """How far a state has come, from the first state (0) to the target (1)."""
        start = self.path.value(self._aim, self.states[0])
        return (self.path.value(self._aim, state) - start) / ((self.until.value - start) or 1.0)

    def _within_reach(self, old: State, length: float) -> tuple:
        """(target, its measure, distance) of the first open target that the tangent meets within `length`."""
        best: tuple = (None, None, length)
        for target, bound in self.open:
            now = self.branch.value(bound, old.x, old.control)
            ahead = self.branch.value(bound, old.x + length * old.direction, old.control + length * old.slope)
            if (now - target.value) * (ahead - target.value) < 0:
                reach = length * (target.value - now) / (ahead - now)
                if reach < best[2]:
                    best = (target, bound, reach)
        return best

    def _sorted_into(self, old: State, new: State) -> list[State]:
        """The states from old to new in order: a limit point and targets inside the step, then new itself.

        Raises `Failure` if one of them cannot be solved for.
        """
        found = []
        if old.slope * new.slope < 0 and old.kind != "limit point":
            try:
                found.append(self.branch.limit_point(old, new))
            except Failure as failure:
                raise Failure(f"a limit point lies ahead but could not be located: {failure.reason}", []) from None
        for target, bound in self.open:
            if target is new.met:
                continue
            a, b = (self.branch.value(bound, s.x, s.control) - target.value for s in (old, new))
            if a * b < 0:
                try:
                    state = self.branch.between(old, new, bound, target.value)
                except Failure as failure:
                    raise Failure(f"{target} was passed but could not be solved for: {failure.reason}", []) from None
                state.met = target
                found.append(state)
        found.sort(key=lambda state: self.branch.progress(old, state))
        return [*found, new]

    def _record(self, state: State) -> None:
        """Take up a state and close the target that it meets."""
        path = self.path
        path.record(state)
        if path.problem.has_kinks:
            self.branch.look_ahead(state)
        path.counts.iterations = self.branch.iterations
        self.open = [(t, b) for t, b in self.open if t is not state.met]
        log.info("state %d: %s, %d iterations", path.counts.steps, path.describe(state), len(state.history) - 1)

    def _is_open(self, target: goals.Target) -> bool:
        return any(t is target for t, _ in self.open)

    def _pace(self, max_steps: int) -> str:
        """How far a run had come when its steps ran out."""
        path, aim = self.path, self.until.value
        start, before, now = (path.value(self._aim, s) for s in (self.states[0], path.states[-2], path.last))
        part = (now - start) / ((aim - start) or 1.0)
        if not (aim - now) * (now - before) > 0:
            return f"max_steps = {max_steps} ran out, and the last step led away from the target"
        return (f"max_steps = {max_steps} ran out in good health at {100 * part:.3g} % of the target: the last step"
                f" gained {now - before:.4g} of the {aim - now:.4g} that are left, which makes about"
                f" {int(np.ceil((aim - now) / (now - before)))} steps more at that pace")

    def _give_up(self, why: str, attempt: Any = None, pace: str = "") -> None:
        found = diagnose(self.branch, self.states, why, attempt, pace,
                         self.until.value if isinstance(self._aim, goals.Amplitude) else None)
        raise self._error(f"{why}.", found)

    def _error(self, why: str, diagnosis: Any) -> ConvergenceError:
        """What happened, what was met, what to try."""
        path = self.path
        states = self.states
        values = [path.value(self._aim, s) for s in states]
        best = int(np.argmin([abs(v - self.until.value) for v in values]))
        limits = "".join(f" A limit point was passed at {path.describe(s)}." for s in states if s.kind == "limit point")
        return ConvergenceError(
            f"{f'Stage {path.stage!r}: ' * bool(path.stage)}{self.until} was not reached: {why} The nearest met was"
            f" {values[best]:.6g}, at {path.describe(states[best])}.{limits} The last good state is"
            f" {path.describe(path.last)}; it is kept in the error's `path`."
            + ("" if diagnosis.advice else _TRY), path, diagnosis)


def settle(path: Path, step: StepControl, until: goals.Target, checkpoint: Checkpoint | None) -> None:
    """Note in the last state of a path how the run goes on from it, on disk too."""
    path.last.stepping = {"step": asdict(step), "counts": asdict(path.counts), "until": [until.name, until.value]}
    if checkpoint is not None:
        checkpoint.write()


def _progress_bar(comm: Any, until: goals.Target, progress: bool) -> Any:
    from tqdm import tqdm
    return tqdm(total=1.0, desc=f"to {until}", delay=2, disable=not progress or comm.rank != 0, leave=False,
                bar_format="{desc}: {percentage:3.0f}% |{bar}| {elapsed}{postfix}")


def _show(bar: Any, states: list[State], until: goals.Target) -> None:
    now = states[-1].measures.get(until.name)
    if not bar.disable and now is not None:
        first = states[0].measures[until.name]
        bar.n = min(max((now - first) / ((until.value - first) or 1.0), 0.0), 1.0)
        bar.set_postfix_str(f"state {len(states)}", refresh=False)
        bar.update(0)
