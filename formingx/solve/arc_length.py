"""Curve of solutions (x, control): steps along it, and states between two of its states."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from petsc4py import PETSc

from ..errors import ConvergenceError
from .equations import Array, Attempt, Constraint, Equations, Quantity
from .newton import BorderedNewton, Failure, Iteration, Tolerances, fixed, relative
from .state import State

log = logging.getLogger("formingx")

Predictor: TypeAlias = Callable[[float], Array | None]
"""Function that returns a guess of x, locally owned entries, at a control; None where the tangent is the better guess.
"""

Bend: TypeAlias = tuple[Array, float]
"""Correction of a guess on the tangent: (change of x, locally owned entries; change of the control)."""

_BY_CUBIC = 8
"""Largest number of states that are solved for to find a limit point by a cubic; twice as many follow, every second at
half of the interval."""

_FLAT = 1e-8
"""Mean displacement over the size of the body below which a body without stiffness is in the reference configuration.
"""


class Curve:
    r"""Solver for steps along the curve of solutions (x, control), and for states between two of its states.

    The arc length of a small change (dx, dlambda) of the unknowns and of the control is

    .. math:: \Delta s^2 = \overline{|\Delta x|^2} + w \, \Delta\lambda^2,

    with the weight w of the control. The first term is the mean over the body of the squared displacement, made
    dimensionless by the size of the body (`Equations.inner`).

    Attributes:
        problem: the equations.
        newton: solver of F = 0 with a constraint (`BorderedNewton`).
        fixed_control: True if the solver cannot pass a limit point.
        control_weight: weight w of the squared control in arc length (dimensionless).
        iterations: number of Newton iterations since the last call of `spent`, failed attempts included.
    """

    fixed_control = False
    control_weight = 0.1

    def __init__(self, problem: Equations, tolerances: Tolerances):
        self.problem = problem
        self.newton = BorderedNewton(problem, tolerances, self.norm)
        self.iterations = 0
        self._found: State | None = None                    # state whose tangent was factorised last
        self._one_sided_state: tuple[State | None, int] = None, 0   # state of one-sided factors; number of factors then
        self._x, self._a, self._b = (problem.x.duplicate() for _ in range(3))

    def norm(self, x: PETSc.Vec, control: float) -> float:
        """Return the arc length of a change (dx, dcontrol): the root of the mean (u/size)^2 plus w dcontrol^2."""
        return float(np.sqrt(self.problem.inner(x, x) + self.control_weight * control**2))

    def distance(self, a: State, b: State) -> float:
        """Return the arc length of the straight line between two states, dimensionless."""
        return float(np.sqrt(self._inner(b.x - a.x, b.control - a.control, b.x - a.x, b.control - a.control)))

    def moved(self, a: State, b: State) -> float:
        """Return the root of the mean squared displacement between two states, over the size of the body."""
        self._x.array_w[:] = b.x - a.x
        return self.norm(self._x, 0.0)

    def progress(self, old: State, new: State) -> float:
        """Return the arc length from `old` to `new` along the tangent of `old`; negative if `new` lies behind."""
        return self._inner(old.direction, old.slope, new.x - old.x, new.control - old.control)

    def start(self) -> State:
        """Return the state of kind "start" at control 0, with the tangent of the path.

        Raise `Failure` without convergence from the unloaded state, `ConvergenceError` if the tangent is singular near
        it.
        """
        history: list[Iteration] = []
        self._x.set(0)
        self.problem.residual(self._x, 0.0, self.newton.F)
        if self._is_loaded():
            try:
                _, history = self.newton.correct(self._x, 0.0, fixed(0.0))
            except Failure as failure:
                self.iterations += len(failure.history)
                failure.attempt = self._attempt()
                raise
            self.iterations += len(history) - 1
        else:
            self.problem.reference.stiff_state(self._x)
            if not self.newton.tangent(self._x, 0.0):
                raise ConvergenceError("the unloaded body has a singular tangent: something in it is not held, or has"
                                       " no stiffness")
            self._x.set(0)
        return self._state(0.0, history, "start", None)

    def _is_loaded(self) -> bool:
        """Return True if F in the reference configuration, stored in the solver, exceeds the round-off of stresses.

        It is eps times shear modulus times length over thickness, from the root of |dF/dx|.
        """
        forces = self.newton.F.norm()
        if relative(self.problem, forces) <= Tolerances().residual:
            return False
        stiffness = self.problem.tangent(self._x, 0.0).norm(PETSc.NormType.NORM_INFINITY)
        return bool(forces > np.finfo(float).eps * np.sqrt(stiffness))

    def resume(self, x: Array, control: float) -> State:
        """Return a solution x (n,) as first state under the step data; a singular tangent is a `Failure`."""
        self._x.array_w[:] = x
        self.problem.residual(self._x, control, self.newton.F)
        flat = self._has_no_stiffness()
        if flat:                                            # such as a flat membrane between equal pressures
            self.problem.reference.stiff_state(self._x)
        if not self.newton.tangent(self._x, control):
            raise Failure("the tangent is singular: something in the body is held no more, or has no stiffness", [])
        if flat:
            self._x.set(0)
        return self._state(control, [], "start", None)

    def solve(self, x: Array, control: float, constraint: Constraint, kind: str, before: State,
              chords: bool = False) -> State:
        """Return the state that satisfies F = 0 and a constraint, from a guess (x, control), x of shape (n,).

        Its path tangent points away from `before`. chords: True to use earlier factors of dF/dx if F has no kinks.
        Raise `Failure` if Newton's method fails, or if an element is inverted.
        """
        self._x.array_w[:] = x
        self._found = None
        try:
            control, history = self.newton.correct(self._x, control, constraint, before, chords)
        except Failure as failure:
            self.iterations += len(failure.history)
            failure.attempt = self._attempt()
            raise
        self.iterations += len(history) - 1
        if self.problem.has_inverted_element(self._x, control):               # forces of 1/J do not show the sign of J
            raise Failure("an element turned inside out", history)
        self._found = self._state(control, history, kind, before)
        return self._found

    def solve_again(self, new: State, equation: Constraint, old: State) -> State:
        """Solve for the end of a step again from `new`, whose kind, target, jump and direction it keeps."""
        found = self.solve(new.x, new.control, equation, new.kind, old)
        sense = float(np.sign(found.slope * new.slope)) or 1.0
        return replace(found, direction=sense * found.direction, slope=sense * found.slope, target=new.target,
                       jump=new.jump)

    def update_path_tangent(self, state: State) -> None:
        """Compute the path tangent of an accepted state for the next step, in place, with updated history variables.

        The last factors are used again if the tangent differs at a few contact points only. Material history needs new
        ones, and so do contact events, for the same events after a checkpoint.
        """
        self._x.array_w[:] = state.x
        limit = self.problem.contact.limit
        at_hand = state is self._found and not (self.problem.history.body_path_dependent
                                                or limit and limit.predicts_events)
        self._found = None
        count = self.newton.solver.count
        if at_hand and self.newton.update_one_sided(self._x, state.control) or self.newton.tangent(
                self._x, state.control, one_sided=True):
            size = self._length_of(self.newton.b)
            direction, slope = self.newton.b.array_r / size, 1 / size
            sense = np.sign(state.slope if state.kind == "start" else        # round-off may turn a film's displacements
                            self._inner(direction, slope, state.direction, state.slope)) or 1.0
            state.direction, state.slope = sense * direction, sense * slope
            if self.newton.solver.count > count and not self.fixed_control:
                state.orientation = self.newton.solver.sign() * int(sense)
            self._one_sided_state = state, self.newton.solver.count

    def factorise_one_sided(self, state: State) -> bool:
        """Factorise dF/dx on the side of the step, unless it was so last; return False if it is singular."""
        if self._one_sided_state != (state, self.newton.solver.count):
            self._x.array_w[:] = state.x
            if not self.newton.tangent(self._x, state.control, one_sided=True):
                return False
            self._one_sided_state = state, self.newton.solver.count
        return True

    def value(self, quantity: Quantity, x: Array, control: float) -> float:
        """Return the value of a quantity in the user's units; x: locally owned entries, shape (n,)."""
        self._b.array_w[:] = x
        return float(quantity.value(self._b, control))

    def target_residual(self, quantity: Quantity, target: float, state: State) -> tuple[float, float]:
        """Return (c, dc/ds) of "quantity = target" along the tangent of a state; -c/(dc/ds) is the length to it.

        Only their ratio has a meaning. A difference quotient would be far from dc/ds for a stiff contact force.
        """
        self._a.array_w[:], self._b.array_w[:] = state.x, state.direction
        left, by_control = quantity.equation(target)(self._a, state.control, self.newton.gradient)
        return left, self.newton.gradient.dot(self._b) + by_control * state.slope

    def unit_slope(self, state: State) -> float:
        """Return dcontrol/ds along the tangent of a state."""
        return state.slope

    def work_rate(self, state: State) -> float:
        r"""Return the rate of work of the controlled load along the path, for a unit of the control; dimensionless.

        .. math:: -\frac{\partial F}{\partial \lambda} \cdot \frac{dx}{ds}

        For a pressure it is proportional to the derivative of the enclosed volume with respect to arc length.
        """
        self._x.array_w[:] = state.x
        self._b.array_w[:] = state.direction
        self.problem.control_derivative(self._x, state.control, self.newton.F_control)
        return -float(self.newton.F_control.dot(self._b))

    def work(self, a: State, b: State) -> float:
        r"""Return the work of the controlled load from state a to state b, for a unit of the control; dimensionless.

        .. math:: -\frac{1}{2} \left(\left.\frac{\partial F}{\partial \lambda}\right|_a +
            \left.\frac{\partial F}{\partial \lambda}\right|_b\right) \cdot (x_b - x_a)
        """
        done = 0.0
        for state in (a, b):
            self._x.array_w[:] = state.x
            self._b.array_w[:] = b.x - a.x
            self.problem.control_derivative(self._x, state.control, self.newton.F_control)
            done -= float(self.newton.F_control.dot(self._b)) / 2
        return done

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
        if not self.problem.reference.singular or control == 0:
            return self.problem.reference.motion(control)
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
             bend: Bend | None = None, equation: Constraint | None = None) -> State:
        """Return the state at an arc length from `old` (Song 1993, eqs. 4.14 to 4.31); raise `Failure` without one.

        It lies in the plane normal to the tangent, or where `equation` holds, such as "quantity = target". `earlier`
        bends the guess to a parabola, and `bend` adds (dx, shape (n,); dcontrol). Away from limit points the predictor
        replaces the guess of x.
        """
        x, control = old.x + length * old.direction, old.control + length * old.slope
        end = equation or self._plane(old, x, control)
        if earlier is not None:
            h = self.distance(earlier, old)
            share = (length / h) ** 2
            x = x + share * (earlier.x - old.x + h * old.direction)
            control += share * (earlier.control - old.control + h * old.slope)
        if bend is not None:
            x, control = x + bend[0], control + bend[1]
        if predictor is None or not self._is_away_from_limit_point(old.slope):
            return self.solve(x, control, end, "step", old)
        guess = predictor(control)                          # with chord iterations
        new = self.solve(x if guess is None else guess, control, end, "step", old, chords=True)
        if self._is_away_from_limit_point((new.control - old.control) / self.distance(old, new)):
            return new
        return self.solve(new.x, new.control, end, "step", old)        # a new dF/dx gives the direction of the path

    def _is_away_from_limit_point(self, slope: float) -> bool:
        """Return True if the control has more than half of the squared arc length; `slope`: dcontrol/ds."""
        return slope**2 * self.control_weight > 0.5

    def interpolate(self, a: State, b: State, fraction: float) -> tuple[Array, float]:
        """Return (x (n,), control) on the Hermite cubic through two states, at 0 in `a` and at 1 in `b`."""
        s, h = fraction, self.distance(a, b)
        weights = (1 - 3 * s**2 + 2 * s**3, 3 * s**2 - 2 * s**3, h * (s - 2 * s**2 + s**3), h * (s**3 - s**2))
        x = weights[0] * a.x + weights[1] * b.x + weights[2] * a.direction + weights[3] * b.direction
        control = weights[0] * a.control + weights[1] * b.control + weights[2] * a.slope + weights[3] * b.slope
        return x, control

    def state_at_value(self, a: State, b: State, quantity: Quantity, target: float) -> State:
        """Return the "target" state from `a` to `b` where a quantity has a value in the user's units, or `Failure`."""
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
        """Return the state at a fraction of the Hermite cubic in the plane normal to `a`'s tangent, else `Failure`."""
        x, control = self.interpolate(a, b, fraction)
        return self.solve(x, control, self._plane(a, x, control), "step", a)

    def limit_point(self, a: State, b: State) -> State:
        """Return the state of kind "limit point" between two states at which the control is stationary.

        The Hermite cubic gives the guess, and each state found replaces an end, until the control is within 1e-12 of
        its extremum, as estimated from slope and curvature. Where the cubic does not come within 1e-6, the ends are
        halved in every second step.
        """
        for k in range(3 * _BY_CUBIC):
            chord = self.distance(a, b)
            fraction = _stationary(a, b, chord) if k < _BY_CUBIC or k % 2 else 0.5
            x, control = self.interpolate(a, b, fraction)
            found = self.solve(x, control, self._plane(a, x, control), "limit point", a)
            curvature = abs(a.slope - b.slope) / chord
            if found.slope**2 < (2e-6 if k == _BY_CUBIC - 1 else 2e-12) * curvature * abs(found.control):
                break
            a, b = (found, b) if found.slope * a.slope > 0 else (a, found)
        return found

    def _plane(self, old: State, x0: Array, control0: float) -> Constraint:
        """Return the constraint of the plane through x0, owned (n,), control0, normal to the tangent of `old`."""
        normal, weight = self.plane_normal(old), self.control_weight * old.slope

        def c(x: PETSc.Vec, control: float, gradient: PETSc.Vec) -> tuple[float, float]:
            gradient.array_w[:] = normal
            self._b.array_w[:] = x.array_r - x0
            return gradient.dot(self._b) + weight * (control - control0), weight
        return c

    def spent(self) -> int:
        """Return the number of iterations since the last call, failed attempts included, and count anew."""
        spent, self.iterations = self.iterations, 0
        return spent

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.newton.destroy()
        for vector in (self._x, self._a, self._b):
            vector.destroy()

    def _attempt(self) -> Attempt:
        """Return the unknowns and the last corrections of the run of Newton's method that just failed."""
        control, step = self.newton.reached
        return Attempt(self._x.array_r.copy(), control, self.newton.a.array_r.copy(), step)

    def _state(self, control: float, history: list[Iteration], kind: str, before: State | None) -> State:
        """Return the state with the unknowns `_x` and a control, with the tangent that `newton` computed last.

        The tangent is directed away from the state `before`; None: the control increases along it. history: Newton
        iterations of the state. kind: `State.kind`.
        """
        b = self.newton.b
        size = self._length_of(b)
        state = State(self._x.array_r.copy(), control, b.array_r / size, 1 / size, history=history, kind=kind,
                      time=self.problem.history.time_at(control))
        if before is not None and self._inner(state.direction, state.slope, state.x - before.x,
                                              control - before.control) < 0:
            state.direction, state.slope = -state.direction, -state.slope
        if not self.fixed_control:
            sign = 0 if self._has_no_stiffness() else self.newton.solver.sign()     # it would be that of round-off
            state.orientation = sign * int(np.sign(state.slope))
        return state

    def _has_no_stiffness(self) -> bool:
        """Return True if the unknowns `_x` are those of a flat membrane, which has no stiffness normal to itself."""
        return self.problem.reference.singular and self.norm(self._x, 0.0) < _FLAT

    def _length_of(self, b: PETSc.Vec) -> float:
        """Return the arc length per unit of the control along a tangent b = dx/dcontrol."""
        return self.norm(b, 1.0)

    def _inner(self, x: Array, control: float, y: Array, other: float) -> float:
        """Return the inner product of two changes (x, control) and (y, other), whose norm is the arc length."""
        self._a.array_w[:] = x
        self._b.array_w[:] = y
        return self.problem.inner(self._a, self._b) + self.control_weight * control * other


def _stationary(a: State, b: State, chord: float) -> float:
    """Return where the cubic of the control is stationary between states (0 to 1) of arc distance `chord`."""
    jump = (b.control - a.control) / chord
    c2, c1, c0 = 3 * (a.slope + b.slope - 2 * jump), 6 * jump - 4 * a.slope - 2 * b.slope, a.slope
    roots = np.roots([c2, c1, c0])
    inside = [r.real for r in roots if abs(r.imag) < 1e-12 and 0 <= r.real <= 1]
    return inside[0] if inside else a.slope / (a.slope - b.slope)
