"""Newton's method at a fixed control, by PETSc SNES, in increments of the control (Song 1993, section 3.2)."""

from __future__ import annotations

import itertools

import numpy as np
from petsc4py import PETSc

from .arc_length import Bend, Curve, Predictor
from .equations import Array, Attempt, Constraint, Equations
from .linear import configure
from .newton import Failure, Iteration, Tolerances, fixed, relative
from .state import State

_prefixes = itertools.count()


class FixedControl:
    """Solver of F(x, control) = 0 at a given control, by Newton's method without a line search.

    A backtracking line search would stall for thin sheets.

    Attributes:
        history: the iterations of the last solution.
    """

    def __init__(self, problem: Equations, tolerances: Tolerances):
        self._problem, self._tolerances = problem, tolerances
        self._control, self._work = 0.0, 0.0
        self.history: list[Iteration] = []
        self._snes = PETSc.SNES().create(problem.comm)
        self._snes.setType("newtonls")
        self._snes.setFunction(self._function, problem.x.duplicate())
        self._snes.setJacobian(self._jacobian, problem.matrix)
        self._snes.setConvergenceTest(self._test)
        self._snes.setTolerances(max_it=tolerances.iterations)
        configure(self._snes.getKSP(), problem.matrix, problem.symmetric)
        prefix, options = f"formingx_{next(_prefixes)}_", PETSc.Options()
        self._snes.setOptionsPrefix(prefix)
        options[prefix + "snes_linesearch_type"] = "basic"
        self._snes.setFromOptions()
        del options[prefix + "snes_linesearch_type"]

    def solve(self, x: PETSc.Vec, control: float) -> bool:
        """Iterate x in place to a solution of F(x, control) = 0; return False without convergence."""
        self._control, self._work, self.history = control, 0.0, []
        self._snes.solve(None, x)
        return bool(self._snes.getConvergedReason() > 0)

    def correction(self) -> Array:
        """Return the last Newton correction of x, locally owned entries, shape (n,)."""
        return np.negative(self._snes.getSolutionUpdate().array_r)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._snes.destroy()

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Compute the residual F at x and the current control in `out`, as SNES calls it."""
        self._problem.residual(x, self._control, out)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        """Compute the tangent dF/dx at x in the matrix of the problem, as SNES calls it; A and P are this matrix."""
        self._problem.tangent(x, self._control)

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        """Append the iteration, with norms of x, its correction and F, to `history`; return PETSc's reason."""
        size, step, residual = norms
        left = relative(self._problem, residual)
        correction = step / (size + 1e-8) if iteration else 1.0
        work = abs(snes.getFunction()[0].dot(snes.getSolutionUpdate())) if iteration else 0.0
        self._work = self._work or work
        self.history.append(Iteration(left, correction, work / self._work if self._work else 1.0))
        if not np.isfinite(left):
            return int(PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN)
        if self._tolerances.converged([i.correction for i in self.history[1:]], [i.residual for i in self.history]):
            return int(PETSc.SNES.ConvergedReason.CONVERGED_SNORM_RELATIVE)
        return int(PETSc.SNES.ConvergedReason.ITERATING)


class FixedControlCurve(Curve):
    """Solver for states at given values of the control, by PETSc SNES, for paths without limit points.

    Arc length is replaced by the change of the control. The length of a step is the change of the control in it, and
    the path tangent (dx, dcontrol) of a state has dcontrol = 1 or -1.
    """

    fixed_control = True

    def __init__(self, problem: Equations, tolerances: Tolerances):
        super().__init__(problem, tolerances)
        self._fixed = FixedControl(problem, tolerances)

    def step(self, old: State, length: float, predictor: Predictor | None = None, earlier: State | None = None,
             bend: Bend | None = None, equation: Constraint | None = None) -> State:
        """Return the state at the control old.control + length old.slope; raise `Failure` if the iteration fails."""
        return self._correct(old, length)

    def state_at_fraction(self, a: State, b: State, fraction: float) -> State:
        """Return the state at the control a.control + fraction (b.control - a.control), with a fraction from 0 to 1."""
        control = a.control + fraction * (b.control - a.control)
        if self._is_unloaded(a):                                 # a slack body has no tangent in its first state
            return self._correct(a, (control - a.control) / a.slope)
        return self.solve(self.interpolate(a, b, fraction)[0], control, fixed(control), "step", a)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        super().destroy()
        self._fixed.destroy()

    def unit_slope(self, state: State) -> float:
        """Return the derivative of the control at a state with respect to true arc length, which includes changes of x.
        """
        self._a.array_w[:] = state.direction
        return state.slope / self.norm(self._a, state.slope)

    def plane_normal(self, state: State) -> Array:
        """Return zeros, shape (n,): dc/dx of the constraint control = target, at which a step ends."""
        return np.zeros(len(state.x))

    def _length_of(self, b: PETSc.Vec) -> float:
        """Return 1, the length along a tangent per unit of the control, since length is the change of the control."""
        return 1.0

    def _inner(self, x: Array, control: float, y: Array, other: float) -> float:
        """Return control * other, the inner product of two changes (x, control) and (y, other); x and y do not count.
        """
        return control * other

    def _correct(self, old: State, length: float) -> State:
        """Return the state at old.control + length old.slope, else raise `Failure`."""
        control = old.control + length * old.slope
        self._x.array_w[:] = self.guess_from_unloaded(old, control) if self._is_unloaded(old) else (
            old.x + length * old.direction)
        good = self._fixed.solve(self._x, control)
        history = self._fixed.history
        self.iterations += len(history) - 1
        if not good or self.problem.has_inverted_element(self._x, control):
            failure = Failure("Newton's method at fixed control did not converge", history)
            failure.attempt = Attempt(self._x.array_r.copy(), control, self._fixed.correction(), 0.0)
            raise failure
        self.newton.tangent(self._x, control)
        return self._state(control, history, "step", old)

    @staticmethod
    def _is_unloaded(state: State) -> bool:
        """Return True if a state is the first one of a path and the body is in the reference configuration, x = 0."""
        return state.kind == "start" and not np.any(state.x)
