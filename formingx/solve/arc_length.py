"""The curve of solutions (x, control): its metric, its tangents, and the solver for single states on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from petsc4py import PETSc

from ..errors import ConvergenceError
from ..measures.targets import Target
from .equations import Array, Attempt, Constraint, Equations, Measure
from .newton import BorderedNewton, Failure, Iteration, Tolerances, fixed, relative
from .state import State

Predictor: TypeAlias = Callable[[float], Array | None]
"""Function from a control to a guess of x, locally owned entries, or to None where the tangent gives the better
guess."""

Bend: TypeAlias = tuple[Array, float]
"""Correction of a guess on the tangent: (change of x, locally owned entries; change of the control)."""


class Curve:
    r"""Solver for single states of a problem, with a metric of their distance (arc length).

    .. math:: \Delta s^2 = \overline{|\Delta x|^2} + w \, \Delta\lambda^2,

    with the mean squared displacement over the size of the body and the weight w of the control.

    Args:
        problem: the equations.
        tolerances: convergence criteria of a state.

    Attributes:
        fixed_control: True if the solver cannot pass a limit point.
        sweeps: largest number of solutions of one step in three dimensions, each with more points put into contact.
        control_weight: weight w of the squared control in arc length (dimensionless).
    """

    fixed_control = False
    control_weight = 0.1
    sweeps = 30

    def __init__(self, problem: Equations, tolerances: Tolerances):
        self.problem = problem
        self.newton = BorderedNewton(problem, tolerances, self.norm)
        self._iterations = 0
        self._found: State | None = None                    # state whose tangent was factorised last
        self._ahead_of: tuple[State | None, int] = None, 0  # state of the factors ahead; factorisations until then
        self._x, self._a, self._b = (problem.x.duplicate() for _ in range(3))

    def norm(self, x: PETSc.Vec, control: float) -> float:
        """Return the arc length of a change (x, control) along a straight line."""
        return float(np.sqrt(self.problem.inner(x, x) + self.control_weight * control**2))

    def start(self) -> State:
        """Return the state at control 0, in equilibrium with all other loads on the body, with its tangent.

        Raises:
            Failure: Newton's method does not converge from the unloaded state.
            ConvergenceError: the body has no stiffness.
        """
        history: list[Iteration] = []
        self._x.set(0)
        self.problem.residual(self._x, 0.0, self.newton.F)
        if relative(self.problem, self.newton.F.norm()) > Tolerances().residual:
            try:
                _, history = self.newton.correct(self._x, 0.0, fixed(0.0))
            except Failure as failure:
                self._iterations += len(failure.history)
                failure.attempt = self._attempt()
                raise
            self._iterations += len(history) - 1
        else:
            self.problem.stiff_state(self._x)
            if not self.newton.tangent(self._x, 0.0):
                raise ConvergenceError("the unloaded body has a singular tangent: something in it is not held, or has"
                                       " no stiffness")
            self._x.set(0)
        return self._state(0.0, history, "start", None)

    def spend(self, iterations: int) -> None:
        """Count the Newton iterations of another solver, such as a viscous one, for the present step."""
        self._iterations += iterations

    @property
    def iterations(self) -> int:
        """Number of Newton iterations of the present step (since the last call of `spent`)."""
        return self._iterations

    def moved(self, a: State, b: State) -> float:
        """Return the mean displacement of the body from state a to state b, over the size of the body."""
        self._x.array_w[:] = b.x - a.x
        return self.norm(self._x, 0.0)

    def spent(self) -> int:
        """Return the number of Newton iterations since the last call, failed attempts included, and reset it."""
        spent, self._iterations = self._iterations, 0
        return spent

    def resume(self, x: Array, control: float) -> State:
        """Return a known solution (x, control) as a first state, with its tangent under the present step data of the
        problem.

        Raises:
            Failure: the tangent is singular.
        """
        self._x.array_w[:] = x
        self.problem.residual(self._x, control, self.newton.F)
        if not self.newton.tangent(self._x, control):
            raise Failure("the tangent is singular: something in the body is held no more, or has no stiffness", [])
        return self._state(control, [], "start", None)

    def solve(self, x: Array, control: float, constraint: Constraint, kind: str, before: State,
              chords: bool = False) -> State:
        """Return the state that satisfies F = 0 and a constraint; (x, control) is the guess, x locally owned, shape
        (n,).

        Args:
            kind: kind of the new state.
            before: accepted state before the guess; the tangent of the new state points away from it.
            chords: allow tangents of earlier iterations, see `BorderedNewton.correct`.

        Raises:
            Failure: Newton's method fails, or an element is inverted.
        """
        self._x.array_w[:] = x
        self._found = None
        try:
            control, history = self.newton.correct(self._x, control, constraint, before, chords)
        except Failure as failure:
            self._iterations += len(failure.history)
            failure.attempt = self._attempt()
            raise
        self._iterations += len(history) - 1
        if self.problem.folded(self._x, control):               # forces of 1/J do not show the sign of J
            raise Failure("an element turned inside out", history)
        self._found = self._state(control, history, kind, before)
        return self._found

    def look_ahead(self, state: State) -> None:
        """Compute the path tangent of an accepted state again, with the history variables updated, for the next step.

        The factors of its last iteration are used, unless many contact points differ or materials have advanced.
        Predicted contact events need new factors, so that a run from a checkpoint finds the same ones.
        """
        self._x.array_w[:] = state.x
        limit, at_hand = self.problem.limit, state is self._found and not self.problem.body_has_history
        at_hand, self._found = at_hand and not (limit and limit.predicts_events), None
        if at_hand and self.newton.update_ahead(self._x, state.control) or self.newton.tangent(
                self._x, state.control, ahead=True):
            size = self._length_of(self.newton.b)
            direction, slope = self.newton.b.array_r / size, 1 / size
            sense = np.sign(self._inner(direction, slope, state.direction, state.slope)) or 1.0
            state.direction, state.slope = sense * direction, sense * slope
            self._ahead_of = state, self.newton.solver.count

    def factorise_ahead(self, state: State) -> bool:
        """Factorise dF/dx ahead of an accepted state, unless this was done last; return False if it is singular."""
        if self._ahead_of != (state, self.newton.solver.count):
            self._x.array_w[:] = state.x
            if not self.newton.tangent(self._x, state.control, ahead=True):
                return False
            self._ahead_of = state, self.newton.solver.count
        return True

    def plane_normal(self, state: State) -> Array:
        """Return the derivative with respect to x of the constraint plane in which a step from a state ends, locally
        owned."""
        self._a.array_w[:] = state.direction
        self.problem.metric_times(self._a, self._b)
        return self._b.array_r.copy()

    def guess_from_rest(self, rest: State, control: float) -> Array:
        """Return a guess of x at a control: the unloaded state with the prescribed displacements of this control.

        If the unloaded body has no stiffness (a flat membrane), the guess is the point along the first tangent at which
        F does no work. `rest`: the unloaded state, with this tangent.
        """
        if not self.problem.slack_at_rest or control == 0:
            return self.problem.motion(control)
        sign, low, high = np.sign(control), 0.0, 1e-6

        def work(length: float) -> float:
            self._x.array_w[:] = sign * length * rest.direction
            self.problem.residual(self._x, control, self.newton.F)
            self._b.array_w[:] = rest.direction
            return float(sign * self.newton.F.dot(self._b))

        while work(high) < 0 and high < 1:
            low, high = high, 2 * high
        for _ in range(10):
            middle = (low + high) / 2
            low, high = (middle, high) if work(middle) < 0 else (low, middle)
        return sign * high * rest.direction

    def step(self, old: State, length: float, predictor: Predictor | None = None, behind: State | None = None,
             bend: Bend | None = None) -> State:
        """Return the state after a step of arc length `length` from the state `old` (Song 1993, eqs. 4.14 to 4.31).

        The guess lies on the tangent; Newton's method corrects in the plane normal to it at this length.

        Args:
            predictor: function from the control to a guess of x, in a step in time, or None.
            behind: earlier state on the same smooth path, or None. The guess lies on the parabola through it and `old`.
            bend: correction of the guess in this plane, or None.
        """
        plane = self._plane(old, *self._ahead(old, length))
        return self._solve_from(*self._ahead(old, length, behind, bend), plane, "step", old, predictor)

    def step_to(self, old: State, length: float, equation: Constraint, predictor: Predictor | None = None,
                behind: State | None = None, bend: Bend | None = None, kind: str = "target") -> State:
        """Return the state near the end of such a step at which the constraint `equation` holds, such as "quantity =
        target".

        The other arguments are the same as in `step`. `kind`: kind of the new state.
        """
        return self._solve_from(*self._ahead(old, length, behind, bend), equation, kind, old, predictor)

    def _ahead(self, old: State, length: float, behind: State | None = None,
               bend: Bend | None = None) -> tuple[Array, float]:
        """Return a guess (x, control) on the tangent of `old`, or on the parabola through `behind`, plus the
        correction `bend`."""
        x, control = old.x + length * old.direction, old.control + length * old.slope
        if behind is not None:
            h = self.distance(behind, old)
            share = (length / h) ** 2
            x += share * (behind.x - old.x + h * old.direction)
            control += share * (behind.control - old.control + h * old.slope)
        if bend is not None:
            x += bend[0]
            control += bend[1]
        return x, control

    def _solve_from(self, x: Array, control: float, constraint: Constraint, kind: str, old: State,
                    predictor: Predictor | None) -> State:
        """Solve from a guess (x, control). A predictor replaces x, with kept tangents, unless a limit point is near.

        Limit points are located by the tangents of their neighbours, which must be new.
        """
        if predictor is None or not self._runs_along_control(old.slope):
            return self.solve(x, control, constraint, kind, old)
        guess = predictor(control)
        new = self.solve(x if guess is None else guess, control, constraint, kind, old, chords=True)
        if self._runs_along_control((new.control - old.control) / self.distance(old, new)):
            return new
        return self.solve(new.x, new.control, constraint, kind, old)

    def _runs_along_control(self, slope: float) -> bool:
        """Return True if the control contributes more than half of the squared arc length: no limit point is near."""
        return slope**2 * self.control_weight > 0.5

    def unit_slope(self, state: State) -> float:
        """Return the derivative of the control with respect to arc length at a state."""
        return state.slope

    def progress(self, old: State, new: State) -> float:
        """Return the distance from `old` to `new`, projected on the tangent of `old`, arc length."""
        return self._inner(old.direction, old.slope, new.x - old.x, new.control - old.control)

    def work_ahead(self, state: State) -> float:
        """Return the work of the controlled load along the tangent of a state, per unit of control and of arc length.

        For a pressure it is the growth of the enclosed volume over arc length (dimensionless).
        """
        self._x.array_w[:] = state.x
        self._b.array_w[:] = state.direction
        self.problem.control_derivative(self._x, state.control, self.newton.F_control)
        return -float(self.newton.F_control.dot(self._b))

    def work(self, a: State, b: State) -> float:
        """Return the work of the controlled load from state a to b, per unit of control, as in `work_ahead`
        (trapezoidal rule)."""
        done = 0.0
        for state in (a, b):
            self._x.array_w[:] = state.x
            self._b.array_w[:] = b.x - a.x
            self.problem.control_derivative(self._x, state.control, self.newton.F_control)
            done -= float(self.newton.F_control.dot(self._b)) / 2
        return done

    def value(self, bound: Measure, x: Array, control: float) -> float:
        """Return the value of the output quantity `bound` at (x, control), in the user's units; x: locally owned
        entries."""
        self._b.array_w[:] = x
        return float(bound.value(self._b, control))

    def aim(self, bound: Measure, target: float, state: State) -> tuple[float, float]:
        """Return (c, dc/ds): the residual of "quantity = target" at a state, and its derivative along the tangent.

        The values of a stiff quantity, such as a contact force, a step ahead along the tangent are meaningless.
        """
        self._a.array_w[:], self._b.array_w[:] = state.x, state.direction
        left, by_control = bound.equation(target)(self._a, state.control, self.newton.gradient)
        return left, self.newton.gradient.dot(self._b) + by_control * state.slope

    def interpolate(self, a: State, b: State, fraction: float) -> tuple[Array, float]:
        """Return (x, control) on the cubic through two states and their tangents, at a fraction of the distance from
        a to b."""
        s, h = fraction, self.distance(a, b)
        weights = (1 - 3 * s**2 + 2 * s**3, 3 * s**2 - 2 * s**3, h * (s - 2 * s**2 + s**3), h * (s**3 - s**2))
        x = weights[0] * a.x + weights[1] * b.x + weights[2] * a.direction + weights[3] * b.direction
        control = weights[0] * a.control + weights[1] * b.control + weights[2] * a.slope + weights[3] * b.slope
        return x, control

    def between(self, a: State, b: State, bound: Measure, target: float) -> State:
        """Return the state between a and b at which the output quantity `bound` has the value `target`; raise
        `Failure`."""
        low, high = 0.0, 1.0
        sign = self.value(bound, a.x, a.control) - target
        for _ in range(40):
            middle = (low + high) / 2
            if (self.value(bound, *self.interpolate(a, b, middle)) - target) * sign > 0:
                low = middle
            else:
                high = middle
        return self.solve(*self.interpolate(a, b, low), bound.equation(target), "target", a)

    def inside(self, a: State, b: State, fraction: float) -> State:
        """Return the state at a fraction of the distance from a to b, in the plane normal to the tangent of a."""
        x, control = self.interpolate(a, b, fraction)
        return self.solve(x, control, self._plane(a, x, control), "step", a)

    def find(self, a: State, b: State, bound: Measure, target: Target) -> State:
        """Return the state between a and b that meets a target, whose output quantity is `bound`.

        Raises:
            ConvergenceError: no such state was found.
        """
        try:
            return self.between(a, b, bound, target.value)
        except Failure as failure:
            raise ConvergenceError(f"the path passes {target} between two of its states, but no state was found there:"
                                   f" {failure.reason}; run with intermediate=[...] to have one") from None

    def limit_point(self, a: State, b: State) -> State:
        """Return the state between two states at which the control is stationary.

        The cubic through both ends gives the guess, and each state found replaces an end. This is repeated until the
        control is within 1e-12 of its extremum, relative, as estimated from slope and curvature.

        Raises:
            Failure: no such state was found.
        """
        for _ in range(8):
            chord = self.distance(a, b)
            x, control = self.interpolate(a, b, _stationary(a, b, chord))
            found = self.solve(x, control, self._plane(a, x, control), "limit point", a)
            curvature = abs(a.slope - b.slope) / chord
            if found.slope**2 < 2e-12 * curvature * abs(found.control):
                break
            a, b = (found, b) if found.slope * a.slope > 0 else (a, found)
        return found

    def solve_again(self, new: State, equation: Constraint, old: State) -> State:
        """Return the solution of another constraint, with the state `new` as guess, for a step from `old`.

        The tangent keeps the direction along the path; target and jump are copied. Raises `Failure`.
        """
        found = self.solve(new.x, new.control, equation, new.kind, old)
        sense = float(np.sign(found.slope * new.slope)) or 1.0
        return replace(found, direction=sense * found.direction, slope=sense * found.slope, met=new.met, jump=new.jump)

    def close_penetrated(self, old: State, states: list[State],
                         targets: Sequence[tuple[Target, Measure]]) -> list[State]:
        """Solve again for the first of `states`, found by a step from `old`, with penetrating points in contact.

        For tools in three dimensions. A point stays in contact where it met the tool. If the state meets one of
        `targets`, pairs (target, output quantity), the points of all tools count, and the target is met again. Else the
        control stays constant, and only points on tools with friction count. Returns all states of the step.

        Raises:
            Failure: no such state was found.
        """
        limit, (new, *rest) = self.problem.limit, states
        bound = next((bound for target, bound in targets if target is new.met), None)
        if limit is None or new.kind == "limit point":
            return states
        equation = fixed(new.control) if bound is None or new.met is None else bound.equation(new.met.value)
        for sweep in range(self.sweeps):
            if not limit.close_penetrated(new, bound is not None, sweep):
                return [new, *rest]
            new = self.solve_again(new, equation, old)
        raise Failure("points that come into contact late bring others into their tool again and again", [])

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.newton.destroy()
        for vector in (self._x, self._a, self._b):
            vector.destroy()

    def _attempt(self) -> Attempt:
        """Return the end of the failed run of Newton's method."""
        control, step = self.newton.reached
        return Attempt(self._x.array_r.copy(), control, self.newton.a.array_r.copy(), step)

    def _state(self, control: float, history: list[Iteration], kind: str, before: State | None) -> State:
        """Return the state at (self._x, control), with the tangent of the last factorisation, directed away from
        `before`."""
        b = self.newton.b
        size = self._length_of(b)
        state = State(self._x.array_r.copy(), control, b.array_r / size, 1 / size, history=history, kind=kind,
                      time=self.problem.time_at(control))
        if before is not None and self._inner(state.direction, state.slope, state.x - before.x,
                                              control - before.control) < 0:
            state.direction, state.slope = -state.direction, -state.slope
        if not (self.fixed_control or self.problem.has_history):
            state.orientation = self.newton.solver.sign() * int(np.sign(state.slope))
        return state

    def _length_of(self, b: PETSc.Vec) -> float:
        """Return the arc length per unit of the control along a tangent b = dx/dcontrol."""
        return self.norm(b, 1.0)

    def _inner(self, x: Array, control: float, y: Array, other: float) -> float:
        """Return the inner product of two changes (x, control) and (y, other), by which arc length is measured."""
        self._a.array_w[:] = x
        self._b.array_w[:] = y
        return self.problem.inner(self._a, self._b) + self.control_weight * control * other

    def distance(self, a: State, b: State) -> float:
        """Return the arc length of the straight line between two states."""
        return float(np.sqrt(self._inner(b.x - a.x, b.control - a.control, b.x - a.x, b.control - a.control)))

    def _plane(self, old: State, x0: Array, control0: float) -> Constraint:
        """Return the constraint of the plane through (x0, control0) normal to the tangent of `old`."""
        def c(x: PETSc.Vec, control: float, gradient: PETSc.Vec) -> tuple[float, float]:
            self._a.array_w[:] = old.direction
            self.problem.metric_times(self._a, gradient)
            self._b.array_w[:] = x.array_r - x0
            weight = self.control_weight * old.slope
            return gradient.dot(self._b) + weight * (control - control0), weight
        return c


def _stationary(a: State, b: State, chord: float) -> float:
    """Return the fraction of the distance `chord` from a to b at which the cubic of the control is stationary."""
    jump = (b.control - a.control) / chord
    c2, c1, c0 = 3 * (a.slope + b.slope - 2 * jump), 6 * jump - 4 * a.slope - 2 * b.slope, a.slope
    roots = np.roots([c2, c1, c0])
    inside = [r.real for r in roots if abs(r.imag) < 1e-12 and 0 <= r.real <= 1]
    return inside[0] if inside else a.slope / (a.slope - b.slope)
