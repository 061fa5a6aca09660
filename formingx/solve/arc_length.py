"""Curve of solutions (x, control): steps along it, and states between two of its states."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from petsc4py import PETSc

from ..errors import ConvergenceError
from ..measures.targets import Target
from .equations import Array, Constraint, Quantity
from .newton import Failure
from .state import State
from .state_solver import StateSolver

log = logging.getLogger("formingx")

Predictor: TypeAlias = Callable[[float], Array | None]
"""Function that returns a guess of x, locally owned entries, at a control; None where the tangent is the better guess.
"""

Bend: TypeAlias = tuple[Array, float]
"""Correction of a guess on the tangent: (change of x, locally owned entries; change of the control)."""


class Curve(StateSolver):
    """Solver for steps along the curve of solutions (x, control), and for states between two of its states.

    Args:
        problem: the equations.
        tolerances: convergence criteria of a state.
    """

    def plane_normal(self, state: State) -> Array:
        """Return the normal of the plane in which a step from a state ends, as the gradient of its constraint.

        Args:
            state: accepted state at the start of the step.

        Returns:
            Derivative of the constraint with respect to x, locally owned entries, shape (n,).
        """
        self._a.array_w[:] = state.direction
        self.problem.metric_times(self._a, self._b)
        return self._b.array_r.copy()

    def guess_from_unloaded(self, unloaded: State, control: float) -> Array:
        """Return a guess of the unknowns at a control, from the unloaded state.

        The guess has the prescribed displacements at this control, and 0 elsewhere. If the unloaded body has no
        stiffness, such as a flat membrane, the guess is a multiple of the first tangent t instead, with F . t = 0.

        Args:
            unloaded: the unloaded state, with the first tangent of the path.
            control: load parameter (control), dimensionless.

        Returns:
            The guess, locally owned entries, shape (n,).
        """
        if not self.problem.singular_unloaded or control == 0:
            return self.problem.motion(control)
        sign, low, high = np.sign(control), 0.0, 1e-6

        def work(length: float) -> float:
            self._x.array_w[:] = sign * length * unloaded.direction
            self.problem.residual(self._x, control, self.newton.F)
            self._b.array_w[:] = unloaded.direction
            return float(sign * self.newton.F.dot(self._b))

        while work(high) < 0 and high < 1:
            low, high = high, 2 * high
        for _ in range(10):
            middle = (low + high) / 2
            low, high = (middle, high) if work(middle) < 0 else (low, middle)
        return sign * high * unloaded.direction

    def step(self, old: State, length: float, predictor: Predictor | None = None, earlier: State | None = None,
             bend: Bend | None = None) -> State:
        """Return the state after a step of a given arc length (Song 1993, eqs. 4.14 to 4.31).

        The guess lies on the tangent of `old`, at the given length. Newton's method corrects the guess in the plane
        through it that is normal to the tangent.

        Args:
            old: accepted state at the start of the step.
            length: arc length of the step, dimensionless.
            predictor: function that returns a guess of x at a control, shape (n,), for a step in time. The guess on the
                tangent is used if `predictor` is None or returns None, and near limit points.
            earlier: a state before `old` on the same smooth path. The guess then lies on the parabola through both that
                touches the tangent of `old`. None: the guess lies on the tangent.
            bend: correction that is added to the guess: (change of x, shape (n,); change of the control); or None.

        Returns:
            The state, of kind "step".

        Raises:
            Failure: Newton's method fails, or an element is inverted.
        """
        plane = self._plane(old, *self._predicted(old, length))
        return self._solve_from(*self._predicted(old, length, earlier, bend), plane, "step", old, predictor)

    def step_to(self, old: State, length: float, equation: Constraint, predictor: Predictor | None = None,
                earlier: State | None = None, bend: Bend | None = None, kind: str = "target") -> State:
        """Return the state after a step that ends where a constraint holds, in place of the plane of `step`.

        Args:
            old: accepted state at the start of the step.
            length: arc length at which the guess lies, dimensionless.
            equation: the constraint, such as "quantity = target".
            predictor: function that returns a guess of x at a control, shape (n,), for a step in time. The guess on the
                tangent is used if `predictor` is None or returns None, and near limit points.
            earlier: a state before `old` on the same smooth path. The guess then lies on the parabola through both that
                touches the tangent of `old`. None: the guess lies on the tangent.
            bend: correction that is added to the guess: (change of x, shape (n,); change of the control); or None.
            kind: kind of the new state (`State.kind`).

        Returns:
            The state.

        Raises:
            Failure: Newton's method fails, or an element is inverted.
        """
        return self._solve_from(*self._predicted(old, length, earlier, bend), equation, kind, old, predictor)

    def _predicted(self, old: State, length: float, earlier: State | None = None,
               bend: Bend | None = None) -> tuple[Array, float]:
        """Return the guess (x, control) of a step from `old`; x: locally owned entries, shape (n,).

        length: arc length of the step. earlier: state before `old`; the guess lies on the parabola through both that
        touches the tangent of `old`. None: the guess lies on the tangent. bend: correction that is added to the guess:
        (change of x, shape (n,); change of the control); or None.
        """
        x, control = old.x + length * old.direction, old.control + length * old.slope
        if earlier is not None:
            h = self.distance(earlier, old)
            share = (length / h) ** 2
            x += share * (earlier.x - old.x + h * old.direction)
            control += share * (earlier.control - old.control + h * old.slope)
        if bend is not None:
            x += bend[0]
            control += bend[1]
        return x, control

    def _solve_from(self, x: Array, control: float, constraint: Constraint, kind: str, old: State,
                    predictor: Predictor | None) -> State:
        """Return the state at which a constraint holds, solved for from the guess (x, control).

        Away from limit points the predictor replaces the guess of x, and chord iterations are allowed. Near a limit
        point dF/dx must be new. It gives the direction of the path at each state, from which the limit point is
        located. kind: `State.kind` of the new state. old: accepted state at the start of the step.
        """
        if predictor is None or not self._is_away_from_limit_point(old.slope):
            return self.solve(x, control, constraint, kind, old)
        guess = predictor(control)
        new = self.solve(x if guess is None else guess, control, constraint, kind, old, chords=True)
        if self._is_away_from_limit_point((new.control - old.control) / self.distance(old, new)):
            return new
        return self.solve(new.x, new.control, constraint, kind, old)

    def _is_away_from_limit_point(self, slope: float) -> bool:
        """Return True if the control contributes more than half of the squared arc length, so no limit point is near.

        slope: derivative of the control with respect to arc length.
        """
        return slope**2 * self.control_weight > 0.5

    def interpolate(self, a: State, b: State, fraction: float) -> tuple[Array, float]:
        """Return a point on the cubic (Hermite) through two states with their tangents.

        Args:
            a: first state.
            b: second state.
            fraction: position between them, 0 at a, 1 at b.

        Returns:
            Unknowns x, locally owned entries, shape (n,); control.
        """
        s, h = fraction, self.distance(a, b)
        weights = (1 - 3 * s**2 + 2 * s**3, 3 * s**2 - 2 * s**3, h * (s - 2 * s**2 + s**3), h * (s**3 - s**2))
        x = weights[0] * a.x + weights[1] * b.x + weights[2] * a.direction + weights[3] * b.direction
        control = weights[0] * a.control + weights[1] * b.control + weights[2] * a.slope + weights[3] * b.slope
        return x, control

    def state_at_value(self, a: State, b: State, quantity: Quantity, target: float) -> State:
        """Return the state between two states at which an output quantity has a given value.

        Args:
            a: first state.
            b: second state.
            quantity: the output quantity.
            target: the value, in the user's units, between the values of the quantity at a and b.

        Returns:
            The state, of kind "target".

        Raises:
            Failure: no such state was found.
        """
        low, high = 0.0, 1.0
        sign = self.value(quantity, a.x, a.control) - target
        for _ in range(40):
            middle = (low + high) / 2
            if (self.value(quantity, *self.interpolate(a, b, middle)) - target) * sign > 0:
                low = middle
            else:
                high = middle
        return self.solve(*self.interpolate(a, b, low), quantity.equation(target), "target", a)

    def state_at_fraction(self, a: State, b: State, fraction: float) -> State:
        """Return the state between two states in a plane that is normal to the tangent of the first.

        Args:
            a: first state.
            b: second state.
            fraction: parameter of the Hermite cubic through (x, control) of both states with their tangents, 0 at a, 1
                at b. The plane goes through the point of the cubic with this parameter.

        Returns:
            The state, of kind "step".

        Raises:
            Failure: Newton's method fails, or an element is inverted.
        """
        x, control = self.interpolate(a, b, fraction)
        return self.solve(x, control, self._plane(a, x, control), "step", a)

    def state_at_target(self, a: State, b: State, quantity: Quantity, target: Target) -> State:
        """Return the state between two states that meets a target.

        Args:
            a: first state.
            b: second state.
            quantity: output quantity of the target.
            target: the target.

        Returns:
            The state, of kind "target".

        Raises:
            ConvergenceError: no such state was found. Its message tells the user how to set the target before the run.
        """
        try:
            return self.state_at_value(a, b, quantity, target.value)
        except Failure as failure:
            raise ConvergenceError(f"the path passes {target} between two of its states, but no state was found there:"
                                   f" {failure.reason}; run with intermediate=[...] to have one") from None

    def limit_point(self, a: State, b: State) -> State:
        """Return the state between two states at which the control is stationary.

        The cubic through both ends gives the guess, and each state found replaces an end. This is repeated until the
        control is within 1e-12 of its extremum, relative, as estimated from slope and curvature.

        Args:
            a: state before the limit point.
            b: state after the limit point.

        Returns:
            The state, of kind "limit point".

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

    def _plane(self, old: State, x0: Array, control0: float) -> Constraint:
        """Return the constraint of the plane through (x0, control0) that is normal to the tangent of the state `old`.

        Normality refers to the inner product of arc length. x0: locally owned entries, shape (n,).
        """
        def c(x: PETSc.Vec, control: float, gradient: PETSc.Vec) -> tuple[float, float]:
            self._a.array_w[:] = old.direction
            self.problem.metric_times(self._a, gradient)
            self._b.array_w[:] = x.array_r - x0
            weight = self.control_weight * old.slope
            return gradient.dot(self._b) + weight * (control - control0), weight
        return c


def _stationary(a: State, b: State, chord: float) -> float:
    """Return the position between two states, 0 at a, 1 at b, at which the cubic of the control is stationary.

    The cubic has the controls and slopes of both states. chord: arc length of the straight line between the states.
    """
    jump = (b.control - a.control) / chord
    c2, c1, c0 = 3 * (a.slope + b.slope - 2 * jump), 6 * jump - 4 * a.slope - 2 * b.slope, a.slope
    roots = np.roots([c2, c1, c0])
    inside = [r.real for r in roots if abs(r.imag) < 1e-12 and 0 <= r.real <= 1]
    return inside[0] if inside else a.slope / (a.slope - b.slope)
