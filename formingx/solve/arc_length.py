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
        """Return dc/dx of the plane in which a step from an accepted state ends, owned entries, shape (n,)."""
        self._a.array_w[:] = state.direction
        self.problem.metric_times(self._a, self._b)
        return self._b.array_r.copy()

    def guess_from_unloaded(self, unloaded: State, control: float) -> Array:
        """Return a guess of the unknowns at a control, from the unloaded state; locally owned entries, shape (n,).

        The guess has the prescribed displacements at this control, and 0 elsewhere. If the unloaded body has no
        stiffness, such as a flat membrane, the guess is a multiple of the first tangent t instead, with F . t = 0.
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
        """Return the state at an arc length from `old` (Song 1993, eqs. 4.14 to 4.31); raise `Failure` without one.
        Newton's method corrects a guess on the tangent in the plane normal to it. `earlier` bends the guess to a
        parabola, and `bend` adds (dx, shape (n,); dcontrol)."""
        plane = self._plane(old, *self._predicted(old, length))
        return self._solve_from(*self._predicted(old, length, earlier, bend), plane, "step", old, predictor)

    def step_to(self, old: State, length: float, equation: Constraint, predictor: Predictor | None = None,
                earlier: State | None = None, bend: Bend | None = None, kind: str = "target") -> State:
        """Return the state after a step that ends where `equation` holds, such as "quantity = target", instead.
        The other arguments and errors are those of `step`."""
        return self._solve_from(*self._predicted(old, length, earlier, bend), equation, kind, old, predictor)

    def _predicted(self, old: State, length: float, earlier: State | None = None,
               bend: Bend | None = None) -> tuple[Array, float]:
        """Return the guess (x, control) of a step of arc length `length` from `old`; x: owned entries, shape (n,).

        It lies on the tangent, or on the parabola through the state `earlier`. `bend` adds (change of x, shape (n,);
        change of the control).
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
        """Return the state at which a constraint holds, solved for from the guess (x, control), x of shape (n,).

        Away from limit points the predictor replaces x, and chord iterations are allowed. Near one, dF/dx is new: it
        gives the direction of the path, from which the limit point is located.
        """
        if predictor is None or not self._is_away_from_limit_point(old.slope):
            return self.solve(x, control, constraint, kind, old)
        guess = predictor(control)
        new = self.solve(x if guess is None else guess, control, constraint, kind, old, chords=True)
        if self._is_away_from_limit_point((new.control - old.control) / self.distance(old, new)):
            return new
        return self.solve(new.x, new.control, constraint, kind, old)

    def _is_away_from_limit_point(self, slope: float) -> bool:
        """Return True if the control has more than half of the squared arc length; `slope`: dcontrol/ds."""
        return slope**2 * self.control_weight > 0.5

    def interpolate(self, a: State, b: State, fraction: float) -> tuple[Array, float]:
        """Return (x, control) on the Hermite cubic through two states, at 0 in `a` and at 1 in `b`.

        x: locally owned entries, shape (n,).
        """
        s, h = fraction, self.distance(a, b)
        weights = (1 - 3 * s**2 + 2 * s**3, 3 * s**2 - 2 * s**3, h * (s - 2 * s**2 + s**3), h * (s**3 - s**2))
        x = weights[0] * a.x + weights[1] * b.x + weights[2] * a.direction + weights[3] * b.direction
        control = weights[0] * a.control + weights[1] * b.control + weights[2] * a.slope + weights[3] * b.slope
        return x, control

    def state_at_value(self, a: State, b: State, quantity: Quantity, target: float) -> State:
        """Return the state of kind "target" between two states at which a quantity has a value in the user's units.

        The value lies between those at `a` and `b`. Raise `Failure` if no such state was found.
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
        """Return the state in the plane normal to the tangent of `a`, at a fraction (0 to 1) of the Hermite cubic.
        Raise `Failure` if Newton's method fails, or if an element is inverted."""
        x, control = self.interpolate(a, b, fraction)
        return self.solve(x, control, self._plane(a, x, control), "step", a)

    def state_at_target(self, a: State, b: State, quantity: Quantity, target: Target) -> State:
        """Return the state of kind "target" between two states that meets a target.

        Raise a `ConvergenceError` that says how to set the target before the run if no such state was found.
        """
        try:
            return self.state_at_value(a, b, quantity, target.value)
        except Failure as failure:
            raise ConvergenceError(f"the path passes {target} between two of its states, but no state was found there:"
                                   f" {failure.reason}; run with intermediate=[...] to have one") from None

    def limit_point(self, a: State, b: State) -> State:
        """Return the state of kind "limit point" between two states at which the control is stationary.

        The Hermite cubic gives the guess, and each state found replaces an end. This is repeated until the control is
        within 1e-12 of its extremum, relative, as estimated from slope and curvature.
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
