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
        """Return the arc length of a change (dx, dcontrol) along a straight line.

        It is the root of the mean squared displacement, over the squared size of the body, plus w dcontrol^2 with the
        weight w = `control_weight`.

        Args:
            x: change dx of the unknowns.
            control: change of the load parameter (control), dimensionless.

        Returns:
            Length, dimensionless.
        """
        return float(np.sqrt(self.problem.inner(x, x) + self.control_weight * control**2))

    def distance(self, a: State, b: State) -> float:
        """Return the arc length of the straight line between two states.

        Args:
            a: first state.
            b: second state.

        Returns:
            The length, dimensionless.
        """
        return float(np.sqrt(self._inner(b.x - a.x, b.control - a.control, b.x - a.x, b.control - a.control)))

    def moved(self, a: State, b: State) -> float:
        """Return the mean displacement of the body between two states.

        Args:
            a: first state.
            b: second state.

        Returns:
            Root of the mean squared displacement, over the size of the body.
        """
        self._x.array_w[:] = b.x - a.x
        return self.norm(self._x, 0.0)

    def progress(self, old: State, new: State) -> float:
        """Return the distance between two states along the tangent of the first.

        Args:
            old: first state.
            new: second state.

        Returns:
            Arc length; negative if `new` lies behind `old`.
        """
        return self._inner(old.direction, old.slope, new.x - old.x, new.control - old.control)

    def start(self) -> State:
        """Return the state at control 0, in equilibrium with all loads besides the controlled one.

        Returns:
            The state, of kind "start", with the tangent of the path.

        Raises:
            Failure: Newton's method does not converge from the unloaded state.
            ConvergenceError: the tangent is singular near the unloaded state.
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
        """Return True if the residual F in the reference configuration, stored in the solver, exceeds round-off.

        Stresses that cancel there leave forces of round-off, eps times the shear modulus times length over thickness.
        The square root of the norm of dF/dx estimates the last two factors.
        """
        forces = self.newton.F.norm()
        if relative(self.problem, forces) <= Tolerances().residual:
            return False
        stiffness = self.problem.tangent(self._x, 0.0).norm(PETSc.NormType.NORM_INFINITY)
        return bool(forces > np.finfo(float).eps * np.sqrt(stiffness))

    def resume(self, x: Array, control: float) -> State:
        """Return a known solution as the first state of a path.

        Args:
            x: unknowns of the solution, locally owned entries, shape (n,).
            control: load parameter (control) of the state, dimensionless.

        Returns:
            The state, of kind "start", with the tangent of the path under the current step data of the problem.

        Raises:
            Failure: the tangent is singular.
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
        """Return the state that satisfies F = 0 and a constraint.

        Args:
            x: guess of the unknowns, locally owned entries, shape (n,).
            control: guess of the load parameter (control), dimensionless.
            constraint: the constraint, such as control = 0.1.
            kind: kind of the new state (`State.kind`).
            before: accepted state before the guess; the path tangent of the new state points away from it.
            chords: True to allow chord iterations, which use the factorised dF/dx of an earlier iteration. They are
                used only if F has no kinks.

        Returns:
            The state, with the tangent of the path.

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
        if self.problem.has_inverted_element(self._x, control):               # forces of 1/J do not show the sign of J
            raise Failure("an element turned inside out", history)
        self._found = self._state(control, history, kind, before)
        return self._found

    def solve_again(self, new: State, equation: Constraint, old: State) -> State:
        """Solve again for the end of a step, with another constraint or after a change of contact.

        Args:
            new: the solved end of the step, used as guess.
            equation: the constraint.
            old: accepted state at the start of the step.

        Returns:
            The state, with the kind, the target and the jump of `new`, and a tangent in the direction of `new`.

        Raises:
            Failure: Newton's method fails, or an element is inverted.
        """
        found = self.solve(new.x, new.control, equation, new.kind, old)
        sense = float(np.sign(found.slope * new.slope)) or 1.0
        return replace(found, direction=sense * found.direction, slope=sense * found.slope, target=new.target,
                       jump=new.jump)

    def update_path_tangent(self, state: State) -> None:
        """Compute the path tangent of an accepted state for the next step, with updated history variables.

        The factors of the last iteration are used again if the tangent differs at a few contact points only. There are
        two exceptions. History variables of a material change the whole tangent. Contact events are predicted with new
        factors, since a run from a checkpoint has no others, and its events must be the same.

        Args:
            state: the accepted state; its tangent is changed in place.
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
        """Factorise dF/dx for a step from an accepted state, unless this matrix was factorised last.

        At a kink of F the derivative is taken on the side of the step.

        Args:
            state: the accepted state.

        Returns:
            False if the matrix is singular.
        """
        if self._one_sided_state != (state, self.newton.solver.count):
            self._x.array_w[:] = state.x
            if not self.newton.tangent(self._x, state.control, one_sided=True):
                return False
            self._one_sided_state = state, self.newton.solver.count
        return True

    def value(self, quantity: Quantity, x: Array, control: float) -> float:
        """Return the value of an output quantity.

        Args:
            quantity: the quantity.
            x: unknowns, locally owned entries, shape (n,).
            control: load parameter (control), dimensionless.

        Returns:
            The value, in the user's units.
        """
        self._b.array_w[:] = x
        return float(quantity.value(self._b, control))

    def target_residual(self, quantity: Quantity, target: float, state: State) -> tuple[float, float]:
        """Return the residual c of the constraint "quantity = target" at a state, and dc/ds along the tangent.

        From both follows the arc length to the target, -c / (dc/ds), by linear extrapolation. Differences of the
        quantity at points on the tangent would be far from dc/ds for a contact force, which is stiff.

        Args:
            quantity: the output quantity.
            target: its target, in the user's units.
            state: the state.

        Returns:
            (c, dc/ds); s is the arc length. c is 0 at the target; only the ratio of both values has a meaning, since
            each quantity scales its constraint by a factor of its own.
        """
        self._a.array_w[:], self._b.array_w[:] = state.x, state.direction
        left, by_control = quantity.equation(target)(self._a, state.control, self.newton.gradient)
        return left, self.newton.gradient.dot(self._b) + by_control * state.slope

    def unit_slope(self, state: State) -> float:
        """Return the derivative of the control with respect to arc length.

        Args:
            state: the state at which the derivative is taken.

        Returns:
            Derivative dcontrol/ds along the tangent of the state.
        """
        return state.slope

    def work_rate(self, state: State) -> float:
        r"""Return the rate of work of the controlled load along the path, for a unit of the control.

        .. math:: -\frac{\partial F}{\partial \lambda} \cdot \frac{dx}{ds}

        F is the residual, lambda the control and s the arc length, all dimensionless.

        Args:
            state: the state, at whose tangent dx/ds the rate is taken.

        Returns:
            Rate of work, dimensionless. For a pressure it is proportional to the derivative of the enclosed volume with
            respect to arc length.
        """
        self._x.array_w[:] = state.x
        self._b.array_w[:] = state.direction
        self.problem.control_derivative(self._x, state.control, self.newton.F_control)
        return -float(self.newton.F_control.dot(self._b))

    def work(self, a: State, b: State) -> float:
        r"""Return the work of the controlled load from state a to state b, for a unit of the control.

        .. math:: -\frac{1}{2} \left(\left.\frac{\partial F}{\partial \lambda}\right|_a +
            \left.\frac{\partial F}{\partial \lambda}\right|_b\right) \cdot (x_b - x_a)

        This is the trapezoidal rule with one interval. F is the residual, lambda the control, both dimensionless.

        Args:
            a: first state.
            b: second state.

        Returns:
            Work, dimensionless.
        """
        done = 0.0
        for state in (a, b):
            self._x.array_w[:] = state.x
            self._b.array_w[:] = b.x - a.x
            self.problem.control_derivative(self._x, state.control, self.newton.F_control)
            done -= float(self.newton.F_control.dot(self._b)) / 2
        return done

    def spend(self, iterations: int) -> None:
        """Count the Newton iterations of another solver for the current step.

        Args:
            iterations: number of iterations, such as those with viscous forces.
        """
        self._iterations += iterations

    @property
    def iterations(self) -> int:
        """Number of Newton iterations since the last call of `spent`, failed attempts included."""
        return self._iterations

    def spent(self) -> int:
        """Return the number of Newton iterations since the last call, and start to count anew.

        Returns:
            Number of iterations, failed attempts included.
        """
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
