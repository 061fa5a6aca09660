"""Control by an output quantity: the controlled load is an unknown, and the quantity follows an amplitude in time.

Examples: a prescribed volume of air, a constant force. At each given time the state solves F(x, control) = 0 with the
quantity at its prescribed value. A pressure then passes its maximum as it does in practice.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..contact.step_limit import TrialStep
from ..measures.targets import Target, is_met, process_time
from . import predictor
from .equations import Array, Quantity
from .newton import Failure, tangents
from .path_following import Run
from .record import Record
from .state import State
from .stepping import SAME_TIME, Cutback, StepControl


@dataclass(frozen=True)
class QuantitySteps:
    """Settings of steps in time along a prescribed amplitude of an output quantity.

    Attributes:
        max_step_ratio: multiple of the step length. A step ends at the next time to be met exactly if this time lies
            within this multiple, so that no short step is left over.
        max_cutback: largest ratio of the lengths of a repeated step and of the rejected step before it.
        min_control_change: relative change of the control in a step, below which the control counts as constant. No
            limit point is sought in a step whose arc length is below the same number.
        time_tolerance: tolerance of the time of a limit point, over the duration of its step.
        target_tolerance: relative tolerance of a target that is met inside a step.
        min_contact_fraction: a step fails if too many gaps would close before this fraction of its length. The number
            of gaps that may close in one step is set by the contacts (`StepLimit.length`).
    """

    max_step_ratio: float = 1.5
    max_cutback: float = 0.6
    min_control_change: float = 1e-7
    time_tolerance: float = 1e-4
    target_tolerance: float = 1e-8
    min_contact_fraction: float = 0.5


_STEPS = QuantitySteps()


class QuantityRun(Run):
    """Run in which an output quantity follows an `amplitude` in time, in the user's units; the control is an unknown.

    times: met exactly, the start, the corners and the end of the amplitude. targets: pairs (target, output quantity) to
    meet on the way. step: its lengths are fractions of the duration. accuracy: tolerance of the relative time
    integration error.
    """

    def __init__(self, record: Record, quantity: Quantity, amplitude: Callable[[float], float], times: Sequence[float],
                 targets: Sequence[tuple[Target, Quantity]], step: StepControl | None, accuracy: float,
                 label: str = ""):
        end = process_time(times[-1])
        super().__init__(record, [*targets, (end, end.bind(record.curve.problem))], step, "continue", accuracy, label)
        self._quantity, self._amplitude, self._times, self._duration = quantity, amplitude, times, times[-1] - times[0]

    def _accept(self, state: State) -> None:
        """Accept a state, and set the process time of the problem to the time of the state."""
        self.problem.history.clock = state.time
        super()._accept(state)

    def _next_states(self, old: State) -> list[State]:
        """Return a list with one state, the next in time: the first target or limit point in the step, else its end."""
        event = self._next_event(old.time)
        while True:
            left = event - old.time
            dt = min(self.step.length * self._duration, left)
            dt = left if left < _STEPS.max_step_ratio * dt else dt
            try:
                new = self._solve_at(old, event if dt == left else old.time + dt)
                error = self._error_in_time(new, self._time_error) if self._time_error else 0.0
                self.step.accepted(tangents(new.history), error)
                return [self._met_before(old, self._limit_before(old, new))]
            except (Cutback, Failure) as failed:
                part = min(failed.part, _STEPS.max_cutback) if isinstance(failed, Cutback) else 0.5
                self.step.length = part * dt / self._duration
                self._failed(str(failed), self.step.length)
                if self.step.length < self.step.smallest:
                    self._give_up(f"the step in time became shorter than {self.step.smallest * self._duration:.3g}:"
                                  f" {failed}", getattr(failed, "attempt", None))

    def _next_event(self, time: float) -> float:
        """Return the first time after `time` to be met exactly: a corner or the end of the amplitude, or a target."""
        times = [*self._times, *(t.value for t, _ in self.targets.open if t.name == "process_time")]
        return min(t for t in times if t > time + SAME_TIME * max(abs(time), self._duration))

    def _solve_at(self, old: State, time: float) -> State:
        """Return the state at a process time, one step after the accepted state `old`, or raise `Failure`."""
        problem, problem.history.clock = self.problem, time
        value = float(self._amplitude(time))
        x, control = self._predicted(old, time, value)
        trial, limit = TrialStep(old.x, old.control, x - old.x, control - old.control, 1.0), problem.contact.limit
        if limit and limit.length(trial) < _STEPS.min_contact_fraction:
            raise Failure("too many points would come into contact in one step", [])
        if limit:
            limit.prepare(trial)
        new = self.curve.solve(x, control, self._quantity.equation(value), "step", old, chords=True)
        rejection = limit and limit.check(old, new, 1.0)
        if rejection:
            raise Failure(rejection.reason, [])
        return new

    def _limit_before(self, old: State, new: State) -> State:
        """Return the state of a control extremum between two states, solved for in one step from `old`; else `new`.

        Corners of the amplitude, and round-off of a constant control, do not count as extrema.
        """
        if len(self.states) < 2 or old.time in self._times or old.kind == "limit point":
            return new
        length = self.curve.distance(old, new)
        if length < _STEPS.min_control_change:
            return new
        if self.problem.history.rate_dependent:
            before = _rate([*predictor.recent_states(self.states[:-1], old.time, degree=1), old])
            after, step = _rate([*predictor.recent_states(self.states, new.time, degree=1), new]), new.time - old.time
        else:                                                # the tangents of the path show an extremum
            before, after, step = old.slope, new.slope, length
        still = _STEPS.min_control_change * max(abs(old.control), abs(new.control)) / step
        if before * after >= 0 or min(abs(before), abs(after)) < still:
            return new
        tried: list[State] = []

        def below(time: float) -> float:
            tried.append(self._solve_at(old, time))
            return -float(np.sign(before)) * tried[-1].control
        from scipy.optimize import minimize_scalar
        with contextlib.suppress(Failure):                   # then the extremum gets no state
            error = _STEPS.time_tolerance * (new.time - old.time)
            minimize_scalar(below, bounds=(old.time, new.time), options={"xatol": error})
            new = max(tried, key=lambda state: np.sign(before) * state.control)
            new.kind = "limit point"
        return new

    def _predicted(self, old: State, time: float, value: float) -> tuple[Array, float]:
        """Return a guess (x, control) of the state at a time, by a polynomial in time through the last states.

        With a single state it is the point on its tangent at which the quantity has the prescribed `value` (user's
        units).
        """
        past = predictor.recent_states(self.states, time, degree=2 if self.problem.contact.faces else 3)
        if len(past) == 1:
            return self._on_tangent(old, value)
        w = predictor.weights(past, time)
        return w @ [s.x for s in past], float(w @ [s.control for s in past])

    def _on_tangent(self, old: State, value: float) -> tuple[Array, float]:
        """Return the point (x, control) on the tangent of `old` at which the quantity has a value in the user's units.

        It is sought within an arc length of about 1, in both directions; without one, `old` is returned.
        """
        def deviation(s: float) -> float:
            return self.curve.value(self._quantity, old.x + s * old.direction, old.control + s * old.slope) - value
        now = deviation(0.0)
        for sense in (1.0, -1.0):
            high = 1e-9 * sense
            while now * deviation(high) > 0 and abs(high) < 1.0:
                high *= 4
            if now * deviation(high) <= 0:
                s = _root(deviation, 0.0, high)
                return old.x + s * old.direction, old.control + s * old.slope
        return old.x, old.control

    def _met_before(self, old: State, new: State) -> State:
        """Return the earliest state after `old` and up to `new` that meets an open target; `new` if none does."""
        problem, best = self.problem, new
        for target, quantity in self.targets.open:
            if target.name == "process_time":
                if abs(target.value - new.time) <= SAME_TIME * max(abs(new.time), 1e-300):
                    new.target = target
                continue
            values = []
            for state in (old, new):
                problem.history.clock = state.time
                values.append(self.curve.value(quantity, state.x, state.control) - target.value)
            if values[0] * values[1] < 0:
                found = self._state_at_target(old, target, quantity, old.time, new.time)
                best = found if found.time < best.time else best
        if best.target is not None:
            best.kind = "target"
        return best

    def _state_at_target(self, old: State, target: Target, quantity: Quantity, low: float, high: float) -> State:
        """Return the state, one step after `old`, that meets a target at a time from `low` to `high`, or `Failure`."""
        found: dict[float, State] = {}

        def deviation(time: float) -> float:
            found[time] = self._solve_at(old, time) if time > low else old
            return self.curve.value(quantity, found[time].x, found[time].control) - target.value
        time = _root(deviation, low, high)
        miss, most = deviation(time), _STEPS.target_tolerance * max(abs(target.value), _STEPS.target_tolerance)
        state = found[time]
        if not is_met(target, quantity.size, miss + target.value) and abs(miss) > most:
            raise Failure(f"{target} was passed but could not be solved for", [])
        state.target = target
        return state


def _rate(states: Sequence[State]) -> float:
    """Return the time derivative of the control at the last of two or three states, by a polynomial through them."""
    t = np.array([state.time - states[-1].time for state in states])
    return float(np.polynomial.Polynomial(np.polynomial.polynomial.polyfit(
        t, [state.control for state in states], len(t) - 1)).deriv()(0.0))


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return a root of a function between `low` and `high`, at which its signs differ."""
    from scipy.optimize import brentq
    return float(brentq(function, low, high, xtol=1e-14 * abs(high - low), rtol=1e-14, maxiter=100))
