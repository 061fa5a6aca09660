"""Path following of a scene through limit points to a target (Riks 1979; Song 1993, eqs. 4.8 to 4.31).

A step predicts along the tangent and corrects in the plane normal to it (Keller), in a norm that is independent of mesh
and units. Targets are met exactly: within reach, the equation "quantity = target" replaces the plane.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..contact.step_limit import TrialStep
from ..measures.targets import Amplitude, Target
from . import predictor
from .arc_length import Predictor
from .branches import OrientationCheck, ReversedOrientation, warn_of_branches
from .diagnose import diagnose, not_reached
from .equations import Array, Attempt, Quantity
from .newton import Failure, fixed, tangents
from .progress import Progress, RunTargets
from .record import InadmissibleState, Record
from .snap_through import JumpRules, SnapThrough, at_limit_points, snaps
from .state import State
from .stepping import Cutback, StepControl, TimeError

log = logging.getLogger("formingx")

_TRY = (" Try a target within the range that was reached, a smaller first step (step=StepControl(length=...)), more"
        " elements where the body deforms most, or more max_steps.")


@dataclass(frozen=True)
class PathFollowing:
    """Settings for cutbacks and for giving up. The length of steps is set by `StepControl`.

    Attributes:
        max_time_error: time integration error over its tolerance above which a step is repeated.
        snap_through: settings of snap-through (`SnapThrough`).
    """

    max_time_error: float = 1.4
    snap_through: SnapThrough = SnapThrough()


class Run:
    """Run along a path with one control, from state to state, until its last target is met.

    targets: pairs (target, output quantity); the last ends the run, the others are met on the way; `requested` may end
    it, too. step: None for that of the last state, or the default. at_limit_point: "continue", "snap_through", "stop",
    or None for the default (`at_limit_points`). accuracy: tolerance of the relative time integration error.
    """

    settings = PathFollowing()

    def __init__(self, record: Record, targets: Sequence[tuple[Target, Quantity]], step: StepControl | None = None,
                 at_limit_point: str | None = None, accuracy: float = 2e-3, label: str = "",
                 requested: Target | None = None):
        self.record, self._label, self.curve, self.problem = record, label, record.curve, record.curve.problem
        self._accuracy = accuracy
        self._time_error = TimeError(self.problem, accuracy) if self.problem.history.rate_dependent else None
        self.targets = RunTargets(self.curve, targets, requested)
        self._step, self._began = step, time.perf_counter()
        self._jumps = JumpRules(self.curve, self.targets, self.settings.snap_through, at_limit_point or "")
        self._turned: list[State] = []                      # first state of a run that goes back along the path

    def follow(self, max_steps: int | None, progress: bool, start: State | None, may_turn: bool = False) -> None:
        """Follow the path from `start`, or from the last recorded state, until the last target is met.

        Raise a `ConvergenceError` without `path` if it cannot be reached; the record holds the states. The run gives up
        if many states came no nearer to the target. may_turn: True to let a continued run go back along the path.
        """
        record, before = self.record, self.record.counts.steps
        kept: dict[str, Any] = {}
        self._first = len(record.states)
        self._progress = Progress(self.problem.comm, f"{self._label}to {self.targets.until}", progress)
        try:
            if start is None:
                kept = self._continue(may_turn)
            else:
                self._accept(self.targets.directed_to_target(start, first=not record.states))
            self._sense = float(np.sign(self.states[0].slope)) or 1.0       # of the change of the control at the start
            self._jumps.rule = self._jumps.rule or at_limit_points(self.problem, self._is_released)
            if self._step is None or asdict(self._step) == kept.get("given"):
                self.step = StepControl(**kept.get("step", {}))
            else:
                self.step = replace(self._step)
            self.targets.close_reached(record.last)
            self._complete_step()
            while self.targets.is_open():
                self._check_progress()
                if max_steps is not None and record.counts.steps - before >= max_steps:
                    self._give_up(f"max_steps = {max_steps} were used up before it", pace=self.targets.pace(max_steps))
                states = self.states
                for state in self._next_states(states[-1]):
                    self._accept(state)
                    if state.kind == "jump" and (why := self.targets.jumped_past()):
                        self._give_up(why)
                    if state.kind == "limit point" and self._jumps.rule == "stop":
                        record.ended = f"the {self._control_name} has a limit point at {record.describe(state)}"
                    if record.ended or self.problem.history.path_dependent or self._jumps.rule == "snap_through":
                        break                           # the next step starts from this state
                    if not self.targets.is_open() and state.target is self.targets.until:
                        break
                self._complete_step()
                if not self.problem.history.path_dependent:
                    warn_of_branches(record, self.states[len(states) - 1:])
                if record.ended:
                    break
                self._progress.show(self.targets.gained(), len(self.states), self.step.length)
        except BaseException:
            record.counts.seconds += self._elapsed()
            raise
        finally:
            self._progress.close()

    @property
    def _control_name(self) -> str:
        """Name of the controlled quantity."""
        return self.problem.description.shown(0.0)[0]

    @property
    def _target_is_control(self) -> bool:
        """True unless the last target is a process time and no time passes as the control of the run changes."""
        return self.targets.until.name != "process_time" or bool(self.problem.setting.rate[-1])

    @property
    def _is_released(self) -> bool:
        """True if the controlled quantity decreases towards 0, as a pressure that is released."""
        return self.targets.is_control and abs(self.targets.until.value) < abs(self.targets.values[0])

    @property
    def states(self) -> list[State]:
        """States of this run, in order."""
        return [*self._turned, *self.record.states[self._first + len(self._turned):]]

    def _continue(self, may_turn: bool) -> dict[str, Any]:
        """Continue the run that added the last states to the record; return the data stored with its last step.

        These data (`State.stepping`) are the step control, the counts and the target of the run, {} without them.
        may_turn: True if the run may go back along the path to a new target. The target must not be a pressure, which
        may be reached further along the path, too.
        """
        record, last = self.record, self.record.last
        number = record.restore()                           # of states with the current step data
        targets, quantity = self.targets, self.targets.quantity
        pressure = isinstance(quantity, Amplitude) and quantity.is_load
        if may_turn and last.stepping.get("until") != [*targets.until[:2]] and not pressure:
            with self.problem.state_context(last):
                turned = targets.directed_to_target(replace(last))
            self._turned = [turned] if turned.slope != last.slope else []
        self._first -= 1 if self._turned else number
        for state in self.states:
            with self.problem.state_context(state):
                targets.add_known(state)
        met = [s.target[:2] for s in self.states if s.target]
        targets.open = [(target, quantity) for target, quantity in targets.open if target[:2] not in met]
        kept = next((s.stepping for s in reversed(self.states) if s.stepping), {})
        self._jumps.change, no_equilibrium_at = kept.get("jumps", (self.settings.snap_through.control_change, None))
        self._jumps.no_equilibrium_at = np.nan if no_equilibrium_at is None else no_equilibrium_at
        return kept

    def _elapsed(self) -> float:
        """Return the wall time since the last call, or since the start of the run, s."""
        before, self._began = self._began, time.perf_counter()
        return self._began - before

    def _complete_step(self) -> None:
        """Complete a step in the record, with the data with which the run continues."""
        self.record.counts.seconds += self._elapsed()
        failed_at = float(self._jumps.no_equilibrium_at)
        jumps = self._jumps.change, None if np.isnan(failed_at) else failed_at
        self.record.complete_step(self.step, self.targets.until, given=self._step and asdict(self._step),
                                  accuracy=self._accuracy, jumps=jumps)

    def _next_states(self, old: State) -> list[State]:
        """Return the states of the next step from `old`, in order; the last one is its end, or a target within reach.

        A failure halves the step. A snap-through is tried where the rule at limit points demands it at `old`, or if the
        smallest step has failed. It may also be tried after two failures, if the step is short. This is not done at a
        first state with history variables, nor near the control of an earlier snap-through without equilibrium.
        """
        first, failed, most, limit, end = self.step.length, 0, np.inf, self.problem.contact.limit, None
        lengths, last = list[float](), self.settings.snap_through.lengths[-1]
        self._orientation = OrientationCheck(self.curve, self.settings.snap_through.lengths[0])
        if snaps(self.curve, old, self._jumps.rule, self._sense):
            return self._snap(old)
        events = limit.predictor.predict(self.curve, old) if limit and limit.predictor else None
        self._trial = TrialStep(old.x, old.control, old.direction, old.slope, 0.0, events)
        while True:
            length = min(self.step.length, most)
            length = limit.length(self._trial._replace(length=length)) if limit else length
            target, quantity, reach = self.targets.within_reach(old, length)
            if length < self.step.length:
                self._limited("gap closure", length)
            try:
                return self._try_step(old, length, target, quantity, reach, end)
            except Cutback as cut:
                most, end = cut.part * reach, cut.control if cut.lasts and most < np.inf else None
                self.step.length = most if cut.lasts else self.step.length
                self._failed(str(cut), most)
                if most < self.step.smallest:
                    self._give_up(f"the step became shorter than {self.step.smallest:g}: {cut}")
            except Failure as failure:
                if isinstance(failure, ReversedOrientation) or self._orientation.halves:
                    self.step.length = self._orientation.next_length(length)
                    self._failed(failure.reason, self.step.length)
                    continue
                self.step.length, end = length, None
                log.info("a step of length %.3g failed: %s", length, failure.reason)
                lengths = lengths or [*self.settings.snap_through.lengths_for(limit), 0.0]
                good, failed = self.step.failed(), failed + (not isinstance(failure, _PassedState))
                self._failed(failure.reason, self.step.length)
                self._trial = self._trial._replace(events=None if failed > 1 else self._trial.events)
                begins = old.kind == "start" and self.problem.history.path_dependent
                early = self._jumps.tried_early and failed > 1 and length < lengths[0] and not (
                    begins or self._jumps.found_no_equilibrium_near(old))
                if self._jumps.allowed and (not good or early):
                    lengths.pop(0)
                    for start_length in (reach,) if good else (last, 0.0):
                        with contextlib.suppress(Failure):
                            return [self._jump(old, start_length, first)]
                if not good:
                    self._give_up(f"the step became shorter than {self.step.smallest:g}: {failure.reason}",
                                  failure.attempt)

    def _failed(self, why: str, length: float) -> None:
        """Count a rejected step and its reason `why`; `length`: length of the next attempt."""
        self.record.counts.failures += 1
        self._limited(why, length)

    def _limited(self, why: str, length: float) -> None:
        """Count the reason `why` for a shortened or rejected step; `length`: length of the next attempt."""
        self.record.counts.limits[why] = self.record.counts.limits.get(why, 0) + 1
        self._progress.limited(why, length)

    def _try_step(self, old: State, length: float, target: Target | None, quantity: Quantity | None,
              reach: float, end: float | None = None) -> list[State]:
        """Return the states of one step from `old`, of a given arc length, or to a target at the arc length `reach`.

        target: target within the step, or None. quantity: its output quantity. end: control at the end of the step, in
        place of its length, or None. A failed step raises `Failure`, and a step that is too long raises `Cutback`.
        """
        limit = self.problem.contact.limit
        bend = limit.prepare(self._trial._replace(length=reach), ends=True) if limit else None
        smooth = not self.problem.contact.faces
        earlier = predictor.parabola_state(self.states, reach, self.curve.distance) if smooth else None
        equation = None if end is None else fixed(end)
        if target is not None and quantity is not None:
            equation = quantity.equation(target.value)
        in_time = self._predictor if smooth and self._time_error else None
        new = self.curve.step(old, reach, in_time, earlier, bend, equation)
        if target is not None:
            new.kind = "target"
            if not 0 < self.curve.progress(old, new) < 2 * length:
                raise _PassedState("the target was met on a distant part of the path", [])
            new.target = target
        rejection = limit and limit.check(old, new, reach, ends=True)
        if rejection:
            part = min(max(rejection.fraction, 0.1), self.settings.snap_through.retry_fraction(self.curve.iterations))
            raise Cutback(rejection.reason, part) if rejection.fraction else _PassedState(rejection.reason, [])
        if self._jumps.rule == "snap_through" and (new.control - old.control) * self._sense < 0 < old.slope * new.slope:
            raise Failure("the path turns back here", [])
        if smooth and (new.control - old.control) * old.slope < 0 < old.slope * new.slope:
            raise Failure("two limit points lie within the step", [])
        self._orientation.check(old, new)
        error = self._error_in_time(new, self._time_error) if self._time_error else 0.0
        variables = self.problem.history.variables
        try:
            if limit and limit.corrections:
                new = limit.corrections.separate(self.curve, old, new, lambda state: self._jump(state, 0.0))
            states, self._jumps.change = self._states_within(old, new), self.settings.snap_through.control_change
        except Failure:
            self.problem.history.variables = variables
            raise
        if target is None and length == self.step.length:   # not a step that contact has shortened
            self.step.accepted(tangents(new.history) - (limit.settling if limit else 0), error)
        return states

    @property
    def _predictor(self) -> Predictor | None:
        """Function from a control to a guess of x, a polynomial through the last states; None if no time passes."""
        if not self.problem.setting.rate[-1]:
            return None

        def x(control: float) -> Array | None:
            time = self.problem.history.time_at(control)
            past = predictor.recent_states(self.states, time, degree=3)
            return predictor.weights(past, time) @ [s.x for s in past] if len(past) > 2 else None
        return x

    def _error_in_time(self, new: State, time_error: TimeError) -> float:
        """Return the time integration error of a step to `new` over its tolerance; raise `Cutback` if it is too large.
        """
        error = time_error.ratio(self.states, new.x, new.control)
        if error > self.settings.max_time_error:
            part = max(0.8 * error ** (-1 / 3), 0.1)
            past = self.states[-1].control
            raise Cutback("the error in time", part, lasts=True, control=past + part * (new.control - past))
        return error

    def _snap(self, old: State) -> list[State]:
        """Snap through from a state at which the control (or the enclosed volume) reverses along the path.

        Return a list with the new state. If a body with constant loads reaches no equilibrium, the list is empty and
        the run ends.
        """
        work_sign = self._sense * (self._jumps.rule == "continue_volume")
        if old.kind != "limit point":
            with contextlib.suppress(Failure):
                return [self._jump(old, self.settings.snap_through.lengths[-1], work_sign=work_sign)]
        try:
            return [self._jump(old, 0.0, work_sign=work_sign)]
        except Failure as failure:
            if not self.problem.setting.is_constant:        # the controlled quantity should have changed further
                controlled = "enclosed volume" if work_sign else self._control_name
                self._give_up(f"the {controlled} has a limit point here, and {failure.reason}", failure.attempt)
            self.record.ended = f"the body snaps at {self.record.describe(old)}, and no equilibrium follows"
            return []

    def _jump(self, old: State, length: float, step: float = 0.0, work_sign: float = 0.0) -> State:
        """Return the state after a snap-through from `old`; raise `Failure` if there is none.

        length: arc length along the tangent of `old` at which the motion starts. step: length of the first attempt of
        the step. work_sign: 1 or -1, the sign that the work of the controlled load must have; 0: either.
        """
        new = self._jumps.jump(old, length, self._sense, self.states,
                               lambda: self._progress.limited("a jump", self.step.length), work_sign)
        new = replace(new, target=self.targets.reached_target(new))
        new = self._corrected(old, new)
        self.step.length = max(self.step.length, step / 2)
        log.info("a jump: %s", new.jump)
        return new

    def _check_progress(self) -> None:
        """Raise a `ConvergenceError` if states lead away from the target or stall, or the control is implausible."""
        control = self.record.last.control
        reason = self.problem.description.implausible(control)
        if reason is not None:
            value = self.problem.description.shown(control)[1]
            self._give_up(f"the {self._control_name} has come to {value:.4g}, beyond any process: {reason}")
        if why := self.targets.no_progress():
            self._give_up(why)

    def _states_within(self, old: State, new: State) -> list[State]:
        """Return the states at limit point and targets between `old` and `new`, then `new`; may raise `Failure`."""
        found = []
        if old.slope * new.slope < 0 and old.kind != "limit point":
            try:
                limit = self.curve.limit_point(old, new)
            except Failure as failure:
                raise Failure(f"a limit point lies ahead but could not be located: {failure.reason}", []) from None
            if (limit.control - old.control) * old.slope < 0:   # on the piece of path that a jump has skipped
                raise Failure("a limit point lies ahead, but it was located behind the last state", [])
            found.append(limit)
        for target, quantity in self.targets.open:
            if target is new.target:
                continue
            a, b = [self.curve.value(quantity, s.x, s.control) - target.value for s in (old, new)]
            if a * b < 0:
                try:
                    state = self.curve.state_at_value(old, new, quantity, target.value)
                except Failure as failure:
                    raise Failure(f"{target} was passed but could not be solved for: {failure.reason}", []) from None
                state.target = target
                found.append(state)
        found.sort(key=lambda state: self.curve.progress(old, state))
        first, *rest = [*found, new]
        return [self._corrected(old, first), *rest]

    def _corrected(self, old: State, new: State) -> State:
        """Return `new`, a step from `old`, after contacts open and close points in three dimensions, or `Failure`."""
        limit = self.problem.contact.limit
        corrections = limit.corrections if limit else None
        if not corrections or new.kind == "limit point":
            return new
        equation = next((quantity.equation(target.value) for target, quantity in self.targets.open
                         if target is new.target), None)
        return corrections.close_penetrated(self.curve, old, new, equation)

    def _accept(self, state: State) -> None:
        """Accept a state and close the targets that it meets."""
        record = self.record
        try:
            record.accept(state)
        except InadmissibleState as inadmissible:
            if not self.states:
                raise
            self._give_up("at {} {:.6g}: {}; allow_inadmissible=True goes on".format(
                *self.problem.description.shown(state.control), inadmissible), hint="")
        if self.problem.contact.faces:
            self.curve.update_path_tangent(state)
        self.targets.accept(state)
        record.counts.iterations += self.curve.spent()
        if log.isEnabledFor(logging.INFO):
            log.info("state %d: %s, %d iterations", record.counts.steps, record.describe(state), len(state.history) - 1)

    def _give_up(self, why: str, attempt: Attempt | None = None, pace: str = "", hint: str = _TRY) -> None:
        """Raise the `ConvergenceError` of a run that ends before its target, for the reason `why`, with a diagnosis.

        attempt: end of the failed Newton iteration, or None. pace: progress of a run that used up its steps, as text.
        hint: advice as text, used if the diagnosis has none.
        """
        self.record.counts.iterations += self.curve.spent()
        found = diagnose(self.curve, self.states, why, attempt, pace,
                         self.targets.until.value if self.targets.is_control and self._target_is_control else None)
        self.curve.spent()                                  # the diagnosis is not part of the run
        raise not_reached(self.record, self.states, self.targets, f"{why}.", found, hint)


class _PassedState(Failure):
    """Failure of a step that found a state on another part of the path; a shorter step can succeed."""
