"""Solver for single states of a problem, with the metric of the path through them and its tangents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from ..errors import ConvergenceError
from .equations import Array, Attempt, Constraint, Equations, Quantity
from .newton import BorderedNewton, Failure, Iteration, Tolerances, fixed, relative
from .state import State

_FLAT = 1e-8
"""Mean displacement over the size of the body below which a body without stiffness is in the reference configuration.
"""


class StateSolver:
    r"""Solver for single states of a problem, with the arc length between states.

    The arc length of a small change (dx, dlambda) of the unknowns and of the control is

    .. math:: \Delta s^2 = \overline{|\Delta x|^2} + w \, \Delta\lambda^2,

    with the weight w of the control. The first term is the mean over the body of the squared displacement, made
    dimensionless by the size of the body (`Residual.inner`).

    Args:
        problem: the equations.
        tolerances: convergence criteria of a state.

    Attributes:
        problem: the equations.
        newton: solver of F = 0 with a constraint (`BorderedNewton`).
        fixed_control: True if the solver cannot pass a limit point.
        control_weight: weight w of the squared control in arc length (dimensionless).
    """

    fixed_control = False
    control_weight = 0.1

    def __init__(self, problem: Equations, tolerances: Tolerances):
        self.problem = problem
        self.newton = BorderedNewton(problem, tolerances, self.norm)
        self._iterations = 0
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
        """Return a known solution, x of shape (n,), as the first state of a path under the current step data.

        Raise `Failure` if its tangent is singular.
        """
        self._x.array_w[:] = x
        self.problem.residual(self._x, control, self.newton.F)
        flat = self._has_no_stiffness()
        if flat:                                            # such as a flat membrane between equal pressures
            self.problem.stiff_state(self._x)
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
            self._iterations += len(failure.history)
            failure.attempt = self._attempt()
            raise
        self._iterations += len(history) - 1
        if self.problem.has_inverted_element(self._x, control):               # forces of 1/J do not show the sign of J
            raise Failure("an element turned inside out", history)
        self._found = self._state(control, history, kind, before)
        return self._found

    def solve_again(self, new: State, equation: Constraint, old: State) -> State:
        """Return the end of a step, solved for again from `new`, with another constraint or after a change of contact.

        It keeps the kind, target and jump of `new`, and its direction.
        """
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
        limit, at_hand = self.problem.limit, state is self._found and not self.problem.body_has_history
        at_hand, self._found = at_hand and not (limit and limit.predicts_events), None
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
        """Factorise dF/dx for a step from an accepted state, on the side of the step, unless it was factorised last.

        Return False if the matrix is singular.
        """
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

    def spend(self, iterations: int) -> None:
        """Count iterations of another solver, such as those with viscous forces, for the current step."""
        self._iterations += iterations

    @property
    def iterations(self) -> int:
        """Number of Newton iterations since the last call of `spent`, failed attempts included."""
        return self._iterations

    def spent(self) -> int:
        """Return the number of iterations since the last call, failed attempts included, and count anew."""
        spent, self._iterations = self._iterations, 0
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
                      time=self.problem.time_at(control))
        if before is not None and self._inner(state.direction, state.slope, state.x - before.x,
                                              control - before.control) < 0:
            state.direction, state.slope = -state.direction, -state.slope
        if not self.fixed_control:
            sign = 0 if self._has_no_stiffness() else self.newton.solver.sign()     # it would be that of round-off
            state.orientation = sign * int(np.sign(state.slope))
        return state

    def _has_no_stiffness(self) -> bool:
        """Return True if the unknowns `_x` are those of a flat membrane, which has no stiffness normal to itself."""
        return self.problem.singular_unloaded and self.norm(self._x, 0.0) < _FLAT

    def _length_of(self, b: PETSc.Vec) -> float:
        """Return the arc length per unit of the control along a tangent b = dx/dcontrol."""
        return self.norm(b, 1.0)

    def _inner(self, x: Array, control: float, y: Array, other: float) -> float:
        """Return the inner product of two changes (x, control) and (y, other), whose norm is the arc length."""
        self._a.array_w[:] = x
        self._b.array_w[:] = y
        return self.problem.inner(self._a, self._b) + self.control_weight * control * other
