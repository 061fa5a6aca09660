"""A process: stages in order, each with its own control. A stage starts from the last state of the stage before.

Meshes, forms and solver are created once. The step data of a stage (`StepData`) state how the amplitudes of all items
depend on the control. The controlled item has the control as its amplitude; other items keep their current values. With
tables against time, the time is the control in each piece between two knots. An item that becomes inactive (an open
grip, a plug that is not there yet) leaves unbalanced forces. They fade to zero along a path of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from ..errors import ConvergenceError, InputError
from ..forms.schedule import StepData
from ..measures.targets import Amplitude, Target, change_completed, process_time
from .arc_length import Curve
from .diagnose import diagnose
from .equations import Array, Quantity
from .measure_control import QuantityRun
from .newton import Failure, relative
from .path_following import Run
from .pieces import control_step_data, end_time, next_knot, table_step_data
from .record import Record
from .stage import Plan
from .state import State
from .stepping import SAME_TIME, StepControl

_IN_TIME = StepControl(length=1e-3, smallest=1e-13)
"""Step control for a material that relaxes: after the first steps the time integration error sets the step length."""

_CONTACT_IN_TIME = replace(_IN_TIME, target=8)
"""Step control for a body in contact while only time passes: its contact points hardly move, so more Newton
iterations per step are allowed. The time integration error sets the step length."""

_Targets: TypeAlias = list[tuple[Target, Quantity]]


class Execution:
    """One run of a process, stage by stage, from its last state to the end of the last stage.

    A stage consists of pieces, each a run with its own `StepData`. Piece 0 changes the active loads, supports and
    contacts. Piece 1 varies the control of the stage. With tables, each of pieces 1, 2, ... ends at the next knot.

    Args:
        record: record of the states.
        plans: plans of the stages.
        unchecked: plans for `check` to check again at the start of their stage, since travels are unknown before.
        check: function of such a plan, and of a function from the number of an item to its value in the user's units.
        step: step control of stages without their own; None: the default.
        balanced: norm of negligible unbalanced forces, relative to the support forces.
        accuracy: tolerance of the relative time integration error.
    """

    def __init__(self, record: Record, plans: list[Plan], unchecked: list[Plan],
                 check: Callable[[Plan, Callable[[int], float]], None], step: StepControl | None, balanced: float,
                 accuracy: float = 2e-3):
        problem = record.curve.problem
        self.record, self.curve, self.problem = record, record.curve, problem
        self.plans, self._unchecked, self._check, self._step, self._balanced = plans, unchecked, check, step, balanced
        self._accuracy = accuracy
        self._unloaded, nothing = np.zeros(problem.x.getLocalSize()), [0.0] * len(problem.description.scales)
        self._constant = StepData(nothing, nothing, [])
        self._targets = [self._bind(plan) for plan in plans]    # compile before the first stage
        problem.enter(self._constant, self._unloaded, 0.0)

    def run(self, max_steps: int | None, progress: bool) -> None:
        """Run the remaining stages of the process, with at most `max_steps` steps for a piece of a stage.

        Raise `ConvergenceError` if a stage does not reach its target, `InputError` if it contradicts the state of the
        process.
        """
        self._max_steps, self._progress = max_steps, progress
        last = self.record.last.setting if self.record.states else {"stage": 0, "piece": -1}
        if self.record.states:
            self.record.restore()
        for k, plan in enumerate(self.plans[last["stage"]:], last["stage"]):
            self.record.stage, self._stage, self._inactive, self._k = plan.stage.name, plan.stage, plan.inactive, k
            piece = last["piece"] if k == last["stage"] else -1     # last piece of this stage that has begun
            if piece < 1:
                self._change_items(piece == 0)
                if self.record.ended:
                    break
                if any(plan is p for p in self._unchecked):     # the travels of its tools are known now
                    self._check(plan, self._present_value)
            if plan.prescribes_quantity:
                self._prescribe(plan.numbers, piece > 0)
            elif plan.by_time:
                self._run_tables(plan.tables, max(piece, 0))
            elif plan.numbers:
                self._run_control(plan.numbers, piece > 0)
            elif not self.record.states or self.record.last.setting["stage"] < k:
                self._accept_known(self._resumed(self._present()[2]))
            if self.record.ended:
                break

    def _bind(self, plan: Plan) -> list[tuple[Target, Quantity]]:
        """Return pairs (target, output quantity) of a stage: the intermediate targets, then the target `until`.

        The target `until` is left out if process time is the control and does not end early.
        """
        stage, moving = plan.stage, {*plan.numbers, *(i for i, _ in plan.tables)}
        rate = [float(i in moving) for i in range(len(self._constant.rate) - 1)] + [float(stage.timed)]
        self.problem.enter(replace(self._constant, rate=rate, inactive=plan.inactive), self._unloaded, 0.0)
        found = []
        for target in (*stage.intermediate, *([stage.until] if stage.until and (plan.numbers or stage.waits) else [])):
            try:
                quantity = target.bind(self.problem)
            except InputError as error:
                raise InputError(f"{stage.label}: {error}") from None
            if isinstance(quantity, Amplitude) and not quantity.is_controlled:
                raise InputError(f"{stage.label}: target {target}: this stage does not drive that")
            found.append((target, quantity))
        return found

    def _open_targets(self) -> _Targets:
        """Return the open pairs (target, output quantity) of the stage, not those met before a remeshing."""
        met = [s.target[:2] for segment in self.record.segments[:-1] for s in segment.states
               if s.target and s.setting["stage"] == self._k]
        return [(target, quantity) for target, quantity in self._targets[self._k]
                if target[:2] not in met or target not in self._stage.intermediate]

    def _present(self) -> tuple[StepData, Array, float]:
        """Return (step data, unknowns, shape (n,), control) of the last accepted state, or of the unloaded body."""
        last = self.record.last if self.record.states else None
        return self.problem.setting, last.x if last else self._unloaded, last.control if last else 0.0

    def _present_value(self, number: int) -> float:
        """Return the current value of an item, in the user's units; number: index of the item in `Scene.items`."""
        setting, _, control = self._present()
        return setting.amplitude(number, control) * self.problem.description.scales[number]

    def _enter(self, base: list[float], rate: list[float], piece: int, control: float, fading: bool = False) -> None:
        """Set step data, base + rate control, of a piece; fading: forces of changed items fade as control goes to 1."""
        changed = sorted(set(self.problem.setting.inactive) ^ set(self._inactive)) if fading else []
        setting = StepData(base, rate, self._inactive, fading, self._k, piece, changed, self.problem.setting.mesh)
        self.problem.enter(setting, self._present()[1], control)

    def _resumed(self, control: float) -> State:
        """Return the current state under new step data, with its control and tangent, else a ConvergenceError."""
        if not self.record.states:
            return begin(self.curve)
        try:
            return self.curve.resume(self.record.last.x, control)
        except Failure as failure:
            raise ConvergenceError(f"{self._stage.label} cannot begin: {failure.reason}") from None

    def _accept_known(self, state: State) -> None:
        """Accept a state without an iteration, since nothing changes, and complete its step in the record."""
        self.record.accept(state)
        self.record.complete_step(StepControl(), change_completed())

    def _trace(self, targets: _Targets, control: float | None, requested: Target | None = None) -> _Targets:
        """Follow the path until the last target is met; return the pairs (target, output quantity) that are still open.

        control: its value where the run starts; None: continue an interrupted run. requested: another target that may
        end it first.
        """
        step = self._stage.step or self._step
        if control is not None and self.problem.setting.rate[-1] and self.problem.history.rate_dependent:
            only_time = self.problem.contact.faces and not any(self.problem.setting.rate[:-1])
            step = step or (_CONTACT_IN_TIME if only_time else _IN_TIME)    # a continued piece has its own steps
        run = Run(self.record, targets, step, self._stage.at_limit_point, self._accuracy, self._label, requested)
        start = None if control is None else self._resumed(control)
        run.follow(self._max_steps, self._progress, start)
        return run.targets.open

    def _change_items(self, begun: bool) -> None:
        """Change the active loads, supports and contacts of the current stage, and let unbalanced forces fade to 0.

        This is piece 0 of the stage. begun: True to continue it. Raise `InputError` if an item cannot become active.
        """
        before, x, control = self._present()
        start: float | None = None
        if not begun:
            for i in set(before.inactive) - set(self._inactive):
                try:
                    self.problem.contact.activate(i, x, control)
                except InputError as error:
                    raise InputError(f"{self._stage.label}: {error}") from None
            still, fading = [0.0] * len(before.base), bool(self.record.states) and before.inactive != self._inactive
            start = 0.0 if fading else control
            self._enter(self._amplitudes(), still, 0, start, fading)
        if not self.problem.setting.fading:
            return
        if begun or self._out_of_balance(x):
            target = change_completed()
            self._trace([(target, target.bind(self.problem))], start)
        else:                                               # such as a tool that is free already: nothing fades
            self._enter(self._amplitudes(), still, 0, control)

    def _out_of_balance(self, x: Array) -> bool:
        """Return True if unbalanced forces at x, owned (n,), are not negligible against the support forces."""
        self.problem.x.array_w[:] = x
        self.problem.residual(self.problem.x, 1.0, self.curve.newton.F)
        return relative(self.problem, self.curve.newton.F.norm()) > self._balanced

    def _run_control(self, numbers: list[int], begun: bool) -> None:
        """Run, or continue if `begun`, a stage whose control is the amplitude of the items `numbers` (of one tool)."""
        control = None if begun else self._enter_control(numbers)
        self._trace(self._open_targets(), control)

    def _enter_control(self, numbers: list[int], clocked: bool = True) -> float:
        """Set data with items `numbers` as the control; return its value; clocked: time may pass meanwhile."""
        base, rate, control = control_step_data(self._amplitudes(), self.problem.description.scales, numbers,
                                                self._stage, clocked)
        self._enter(base, rate, 1, control)
        return control

    @property
    def _label(self) -> str:
        """Text before the target beside a progress bar: the stage and its number."""
        return f"stage {self._stage.name!r} ({self._k + 1} of {len(self.plans)}), "

    def _amplitudes(self) -> list[float]:
        """Return the current dimensionless amplitudes of all items, then the process time."""
        setting, _, control = self._present()
        return [*setting.amplitudes(control)[:-1], self.problem.history.time_at(control)]

    def _prescribe(self, numbers: list[int], begun: bool) -> None:
        """Run, or continue if `begun`, a stage in which an output quantity follows an amplitude in time.

        The control is the amplitude of the items `numbers`: a load, or all contacts of a tool.
        """
        control = None if begun else self._enter_control(numbers, clocked=False)
        target, amplitude, times = self._prescribed_amplitude(self.problem.setting.base[-1])
        run = QuantityRun(self.record, target.bind(self.problem), amplitude, times, self._open_targets(),
                   self._stage.step or self._step or (None if begun else _IN_TIME), self._accuracy, self._label)
        run.follow(self._max_steps, self._progress, None if control is None else self._resumed(control))

    def _prescribed_amplitude(self, now: float) -> tuple[Target, Callable[[float], float], list[float]]:
        """Return (target of the quantity, its value by time in the user's units, times to be met) of the current stage.

        The times are the start of the stage, the corners and the end of the amplitude. Raise `InputError` if the
        amplitude begins later than the stage, or ends before it.
        """
        stage, end = self._stage, self._stage.until
        if stage.constant and stage.duration:
            value = stage.constant.value
            return stage.constant, lambda time: value, [now, now + stage.duration]
        assert stage.prescribed is not None
        make_target, amplitude = stage.prescribed
        corners = [] if callable(amplitude) else amplitude[:, 0].tolist()
        if corners and corners[0] > now:
            raise InputError(f"{stage.label}: the table begins at time {corners[0]:g}, but the process time is"
                             f" {now:g}: nothing is given for the time between")
        last = corners[-1] if end is None else end.value
        if last <= now:
            raise InputError(f"{stage.label}: ends at time {last:g}, but the process time is {now:g} already: time"
                             f" cannot go back")
        at = amplitude if callable(amplitude) else lambda time: np.interp(time, *amplitude.T)
        return make_target(float(at(now))), at, [now, *(t for t in corners if now < t < last), last]

    def _run_tables(self, tables: list[tuple[int, Array]], piece: int) -> None:
        """Run a stage with tables in time, piece by piece from knot to knot; `piece`: number to continue, 0 to begin.

        tables: [(index in `Scene.items`, knots (time, value), shape (n, 2))].
        """
        before, _, control = self._present()
        stage, through = self._stage, self._open_targets()
        now = before.base[-1] if piece else self.problem.history.time_at(control)
        end = end_time(stage, tables, now)
        if not piece:
            self._check_beginning(tables, now, end)
        begun = piece > 0
        while not self.record.ended and (begun or now < end - SAME_TIME * abs(end)):
            then = next_knot(tables, now, end)
            if not begun:
                piece += 1
                self._enter_line(tables, now, then, piece)
            through = self._run_piece(then, through, begun)
            now, begun = then, False

    def _enter_line(self, tables: list[tuple[int, Array]], now: float, then: float, piece: int) -> None:
        """Set the step data of a piece between two process times, between which all tables, shape (n, 2), are linear.
        """
        base, rate = table_step_data(self._amplitudes(), self.problem.description.scales, tables, now, then)
        self._enter(base, rate, piece, 0.0)

    def _run_piece(self, then: float, through: _Targets, begun: bool) -> _Targets:
        """Run, or continue if `begun`, a piece of a stage to time `then`, and return the targets that are still open.

        Raise `ConvergenceError` if a target that ends the stage was not met within its duration.
        """
        if self.problem.setting.is_constant and not self.problem.history.rate_dependent:   # time has no effect
            if not begun:
                self._accept_known(self._resumed(0.0))
            if self.record.last.control < 1.0:
                self._accept_known(replace(self.record.last, control=1.0, kind="target", measures={}, history=[]))
            return through
        target, requested = process_time(then), self._stage.until if self._stage.waits else None
        left = self._trace([*through, (target, target.bind(self.problem))], None if begun else 0.0, requested)
        for waited, quantity in left:
            if waited is requested and not self.record.ended:
                last = self.record.last
                raise ConvergenceError(f"{self._stage.label}: {waited} was not reached within its duration of"
                                       f" {self._stage.duration:g}: it is"
                                       f" {self.curve.value(quantity, last.x, last.control):.6g} then: give it longer")
        return left

    def _check_beginning(self, tables: list[tuple[int, Array]], now: float, end: float) -> None:
        """Raise `InputError` if a table begins in the past or with another value, or if the stage ends in the past.

        tables: [(index in `Scene.items`, knots (time, value), shape (n, 2))].
        """
        caller = self._stage.label
        if end <= now:
            raise InputError(f"{caller}: ends at time {end:g}, but the process time is {now:g} already: time cannot go"
                             f" back")
        for i, table in tables:
            name, first = self.plans[self._k].names[i], table[0]
            if first[0] < now - SAME_TIME * abs(now):
                raise InputError(f"{caller}: the table of {name} begins at time {first[0]:g}, but the process time is"
                                 f" {now:g} already: it goes back in time")
            stands = self._present_value(i)
            size = max(np.abs(table[:, 1]).max(), self.problem.description.scales[i])
            if first[0] <= now + SAME_TIME * abs(now) and abs(stands - first[1]) > 1e-9 * size:
                raise InputError(f"{caller}: the table of {name} begins with {first[1]:g} at time {first[0]:g}, but it"
                                 f" stands at {stands:g} then")


def is_done(record: Record, plans: list[Plan]) -> bool:
    """Return True if the last state of a run is the end of the last stage."""
    last, plan = record.last, plans[-1]
    if last.setting["stage"] < len(plans) - 1:
        return False
    if plan.stage.until is not None:
        return last.target is not None and last.target[:2] == plan.stage.until[:2]
    if not (plan.by_time or plan.prescribes_quantity):
        return not last.setting["fading"] or last.control == 1.0
    first = next(s for s in record.states if s.setting["stage"] == last.setting["stage"])
    tables = [plan.stage.prescribed[1]] if plan.stage.prescribed else [table for _, table in plan.tables]
    end = first.time + plan.stage.duration if plan.stage.duration else max(table[-1, 0] for table in tables)
    return bool(last.time >= end - SAME_TIME * abs(end))


def begin(curve: Curve) -> State:
    """Return the first state of a path, of kind "start": equilibrium with all other loads at the control 0.

    Newton's method starts from the unloaded state. If it fails, the constant loads are increased in steps. Raise
    `ConvergenceError` if no equilibrium was found.
    """
    problem = curve.problem
    try:
        return curve.start()
    except Failure as failure:
        first, rest = problem.setting, np.zeros(problem.x.getLocalSize())
        if not problem.description.fixed_loads:
            raise _no_start(curve, failure) from None
        record = Record(problem, curve)
        target = change_completed()
        try:
            problem.enter(replace(first, rate=[0.0] * len(first.rate), fading=True), rest, 0.0)
            run = Run(record, [(target, target.bind(problem))])
            # the unbalanced loads have faded: a flat membrane leaves the reference configuration as under a driven load
            run.follow(1000, False, curve.start() if problem.reference.singular else curve.resume(rest, 0.0))
        except (ConvergenceError, Failure):
            raise _no_start(curve, failure) from None
        problem.enter(first, record.last.x, 0.0)
        return curve.resume(record.last.x, 0.0)


def _no_start(curve: Curve, failure: Failure) -> ConvergenceError:
    """Return the error of a run without a first state; `failure`: the failure of Newton's method."""
    loads = curve.problem.description.fixed_loads
    words = f", under {', '.join(loads)}" if loads else ""
    touches = "; a tool touches the body at rest: give its Contact a smaller ramp" * bool(curve.problem.contact.faces)
    advice = "; drive the largest of them instead" if loads else touches
    problem: Any = curve.problem                            # the cause lies in its scene
    scene = getattr(problem, "scene", None)
    pressures = [load for load in scene.loads if load.quantity == "pressure"] if scene is not None else []
    if {load.value is None for load in pressures} == {True, False}:
        advice = ("; a pressure on one face has no equilibrium before that on the other face: only their difference"
                  " deforms the body. Give the difference alone, or let both grow together in a first Stage,"
                  " amplitudes={above: [(0, 0), (1, p)], below: [(0, 0), (1, p)]}, and then drive one of them")
    return ConvergenceError(f"no equilibrium was found before anything is driven{words}: {failure.reason}{advice}",
                            diagnosis=diagnose(curve, [], failure.reason, failure.attempt))
