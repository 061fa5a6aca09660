r"""Snap-through: when a body snaps, and the equilibrium state that it reaches.

If a process drives in one direction, a body snaps at a limit point of its path. It also snaps at a kink beyond which no
equilibrium is near. The motion to the next equilibrium is computed with vanishing viscosity, at a fixed control,

.. math:: F(x) + \eta \, V (x - x_k) = 0,

from one x_k to the next, with the history variables updated at each. V is the matrix of a viscous stress in proportion
to dF, as in a Kelvin-Voigt solid. Such damping resists waves of all lengths in proportion to their stiffness. Damping
in proportion to the mass resists short waves least. Points that separate at an edge then need 1e4 times the viscosity
with which the body reaches equilibrium. eta falls while the body moves smoothly and grows otherwise. With eta = 0 the
body is in equilibrium. The unbalanced force dissipates work during the motion.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from ..contact.step_limit import StepLimit, TrialStep
from ..ranks import combined
from .arc_length import Curve
from .equations import Array, Equations, Viscosity
from .newton import BorderedNewton, Failure, Iteration, Tolerances, fixed, relative
from .progress import RunTargets
from .state import State

log = logging.getLogger("formingx")


@dataclass(frozen=True)
class SnapThrough:
    """Criteria for snap-through, and settings of the viscous motion to the next equilibrium state.

    The viscosity eta, over the shear modulus, begins low and grows to the smallest value that gives a solution. With
    low viscosity the motion ends at a near equilibrium. High viscosity slows the body: it slips along its tools for
    longer before contact opens, and slip changes the final state. Where contact is about to open, two equilibria may be
    near, and the result depends on eta. The dissipated energy depends on the distance moved in a viscous solution. With
    friction, so does the final state. Both effects are measured in tests/test_jumps.py. Distances are root mean squares
    of the displacement over the size of the body. Forces are relative to the support forces.

    Attributes:
        lengths: arc lengths, decreasing. A step that fails twice below one of them is replaced by a snap-through, once
            for each length. A snap-through starts at the last length along the tangent if a kink of F reverses the
            path, or if no shorter step is left.
        control_change: change of the control in a snap-through, at first.
        max_control_change: largest change of the control in a snap-through.
        first_viscosity: first value of eta.
        max_viscosity: value of eta above which the snap-through has failed.
        max_easy_iterations: largest number of Newton iterations of a viscous solution after which eta decreases, at
            most by the inverse of `viscosity_growth`.
        viscosity_growth: factor of eta after a failed viscous solution, before the body has begun to move.
        viscosity_growth_in_motion: factor of eta after a failed viscous solution, after the body has begun to move.
        tolerances: tolerances of a viscous solution. If contact does not settle soon, more viscosity is cheaper than
            more iterations. With looser tolerances a nearly singular tangent looks like equilibrium too early.
        min_distance: smallest distance that the body should move in a viscous solution.
        max_distance: largest distance that the body should move in a viscous solution.
        distance_ratio: distance that the body should move in a viscous solution, over the distance moved so far.
        repetition_ratio: distance moved in the first viscous solution, over the distance that the body should move,
            above which the solution is repeated with more viscosity.
        max_solutions: number of viscous solutions after which the snap-through has failed. Where a sheet is drawn over
            an edge point by point, hundreds of solutions are needed.
        max_total_distance: distance moved after which the snap-through has failed.
        max_iterations: Newton iterations of one step, failed attempts and snap-throughs included, after which the step
            tries no further snap-through and halves its length.
        trial_force: viscous forces below which a solution without viscosity is tried.
        equilibrium_force: viscous forces below which the body is in equilibrium, even if the iteration without
            viscosity fails. This iteration may oscillate where a point is at a kink of its friction law.
    """

    lengths: tuple[float, ...] = (1e-2, 1e-3)
    control_change: float = 1e-6
    max_control_change: float = 1e-3
    first_viscosity: float = 1.0
    max_viscosity: float = 1e9
    max_easy_iterations: int = 6
    viscosity_growth: float = 10.0
    viscosity_growth_in_motion: float = 3.0
    tolerances: Tolerances = Tolerances(1e-8, 1e-6, settling=8)
    min_distance: float = 3e-4
    max_distance: float = 0.1
    distance_ratio: float = 0.1
    repetition_ratio: float = 3.0
    max_solutions: int = 1000
    max_iterations: int = 5000
    max_total_distance: float = 10.0
    trial_force: float = 1e-3
    equilibrium_force: float = 1e-10

    def lengths_for(self, limit: StepLimit | None) -> tuple[float, ...]:
        """Return arc lengths for a snap-through after two failures, the smallest alone if all friction sticks."""
        return self.lengths[-1:] if limit and limit.only_sticks else self.lengths

    def retry_fraction(self, iterations: int) -> float:
        """Return the largest fraction of a failed step to try again: 0.5 after too many iterations, else 1."""
        return 0.5 if iterations > self.max_iterations else 1.0


class NoEquilibrium(Failure):
    """Failure of a snap-through: the body moved, but reached no equilibrium."""


class ViscousDrag:
    """Viscous forces eta V (x - origin) on the body, 0 at constrained unknowns, with the matrix V of a viscous stress.

    Attributes:
        eta: viscosity over the shear modulus, dimensionless.
        origin: unknowns at the position from which the body moves, locally owned entries, shape (n,).
    """

    def __init__(self, viscosity: Viscosity):
        self._viscosity = viscosity
        self.eta = 0.0
        self.origin: Array = np.zeros(0)

    def forces(self, x: Array) -> Array:
        """Return the viscous forces at the unknowns x, locally owned entries, shape (n,)."""
        return self._viscosity.forces(x - self.origin, self.eta)

    def add_to(self, tangent: PETSc.Mat) -> None:
        """Add eta V, the derivative of the viscous forces, to a tangent matrix in place."""
        self._viscosity.add_to(tangent, self.eta)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._viscosity.destroy()


class _Motion:
    """Viscous motion, at a constant control, from the unstable state `old` to the next equilibrium.

    work_sign: 1 or -1, the sign that the work of the controlled load must have; 0: either. passed: earlier states of
    the path, to which the body must not return.

    Attributes:
        state: current position of the body, as a state.
        dissipated: energy dissipated so far, dimensionless.
        solved: number of viscous solutions so far.
        unbalanced: norm of the viscous forces in the last solution, relative to the support forces.
        trial_force: value of `unbalanced` below which a solution without viscosity is tried.
        settles: True if a solution without viscosity should be tried next.
    """

    def __init__(self, curve: Curve, old: State, control: float, settings: SnapThrough, work_sign: float = 0.0,
                 passed: Sequence[State] = ()):
        self.curve, self.problem, self._old, self.control = curve, curve.problem, old, control
        self._work_sign, self._passed = work_sign, passed
        self._settings, self._drag = settings, ViscousDrag(curve.problem.viscosity())
        self._newton = BorderedNewton(curve.problem, settings.tolerances, curve.norm, drag=self._drag)
        self._x = curve.problem.x.duplicate()
        self._pull: Array = np.zeros(len(old.x))
        self.state, self.dissipated, self.solved = old, 0.0, 0
        self.unbalanced, self.trial_force = np.inf, settings.trial_force
        self.settles = False
        self._wait = False                                  # eta may not fall after the next solution

    def continues(self, eta: float) -> bool:
        """Return True if the viscosity eta, over the shear modulus, and the distance moved so far are within bounds."""
        moved = self.curve.moved(self._old, self.state)
        return eta < self._settings.max_viscosity and moved < self._settings.max_total_distance

    def move(self, origin: Array, eta: float) -> float:
        """Solve F(x) + eta V (x - origin) = 0, and take the solution, shape (n,), as the new position unless rejected.

        A failure, an inverted element, a point through a tool or work of the wrong sign reject it, and so does a too
        large first motion. eta: viscosity over shear modulus. Return the factor of eta for the next solution: above 1
        after a rejected solution.
        """
        settings, self._drag.eta, self._drag.origin = self._settings, eta, origin
        self._x.array_w[:] = origin
        try:
            _, history = self._newton.correct(self._x, self.control, fixed(self.control), self.state)
        except Failure as failure:
            self.curve.iterations += len(failure.history)
            return self._reject()
        self.curve.iterations += len(history) - 1
        x, limit = self._x.array_r.copy(), self.problem.contact.limit
        last, new = self.state, replace(self.state, x=x, control=self.control)
        if self.problem.has_inverted_element(self._x, self.control) or limit and limit.passes_through(last, new):
            return self._reject()
        if self._moves_back(last, new):                      # to the unstable state where the motion began
            return self._reject()
        pull = self._drag.forces(x)
        most = np.clip(settings.distance_ratio * self.curve.moved(self._old, last), settings.min_distance,
                       settings.max_distance)
        far = self.curve.moved(replace(last, x=origin), new) / most
        if not self.solved and far > settings.repetition_ratio:
            self._wait = True
            return far
        before, self.unbalanced = self.unbalanced, relative(self.problem, np.sqrt(self._sum(pull * pull)))
        self.settles = self.unbalanced < min(self.trial_force, before)
        self._add_dissipation(origin, x, pull)                         # from the last or the predicted position
        self._pull, self.state = pull, new
        self.problem.history.advance(x, self.control)
        if limit:
            limit.prepare(TrialStep(x, self.control, x - last.x, 0.0, 1.0))
        self.solved += 1
        stays, self._wait = self._wait or len(history) - 1 > settings.max_easy_iterations, False
        return max(1.0 if stays else 1 / settings.viscosity_growth, far)

    def _reject(self) -> float:
        """Reject a solution, and return the factor by which eta grows."""
        self._wait = True
        return self._settings.viscosity_growth_in_motion if self.solved else self._settings.viscosity_growth

    def equilibrium(self) -> State | None:
        """Return the state of kind "jump" near the current position, without viscous forces; None if none is near.

        None, too, if the body moved back to it. Raise `Failure` if the iteration fails although the viscous forces have
        vanished; with history variables the position then counts as the state.
        """
        try:
            state = self.curve.solve(self.state.x, self.control, fixed(self.control), "jump", self.state)
        except Failure:
            if self.unbalanced > self._settings.equilibrium_force:
                self.settles, self.trial_force = False, 0.3 * self.unbalanced
                return None
            if not self.problem.history.path_dependent:                # another branch starts here
                raise
            state = self.curve.resume(self.state.x, self.control)
            state.kind, state.history = "jump", [Iteration(self.unbalanced, 0.0, 0.0)]
        if self._moves_back(self._old, state) or was_passed(self.curve, self._passed, self._old, state):
            self.settles, self.trial_force = False, 0.3 * self.unbalanced
            return None
        self._add_dissipation(self.state.x, state.x, np.zeros(len(state.x)))
        energy, length = self.problem.description.units
        state.jump = {"dissipated": self.dissipated * energy, "moved": self.curve.moved(self._old, state) * length}
        return state

    def _moves_back(self, a: State, b: State) -> bool:
        """Return True if the work of the controlled load from state a to state b has the sign opposite to `work_sign`.
        """
        return bool(self._work_sign) and self.curve.work(a, b) * self._work_sign < 0

    def _add_dissipation(self, a: Array, x: Array, pull: Array) -> None:
        """Add the work of viscous forces from a to x, shape (n,), to `dissipated`, by the trapezoidal rule.

        Negative work of the force at the start is left out; `pull`: forces at the end, shape (n,).
        """
        dx = x - a
        self.dissipated += 0.5 * (max(self._sum(self._pull * dx), 0.0) + self._sum(pull * dx))

    def _sum(self, values: Array) -> float:
        """Return the sum of locally owned values over all ranks."""
        return float(combined(self.problem.comm, values.sum()))

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._newton.destroy()
        self._drag.destroy()
        self._x.destroy()


def snap_through(curve: Curve, old: State, change: float, from_tangent: bool, settings: SnapThrough,
                 solutions: int | None = None, listener: Callable[[], None] = lambda: None, work_sign: float = 0.0,
                 passed: Sequence[State] = ()) -> State:
    """Return the state of kind "jump" to which the body snaps from `old` when the control changes by `change`.

    from_tangent: True to start on the tangent of `old`. The work of the controlled load must have the sign `work_sign`
    (0: either), and the body must not return to the states `passed`. Raise `Failure` if no state was found,
    `NoEquilibrium` if the body moved without one. The history variables are then those of `old`.
    """
    problem, kept = curve.problem, curve.problem.history.variables
    motion = _Motion(curve, old, old.control + change, settings, work_sign, passed)
    origin = old.x + change / old.slope * old.direction if from_tangent else old.x
    eta, solutions = settings.first_viscosity, solutions or settings.max_solutions
    try:
        while motion.solved < solutions and motion.continues(eta):
            if curve.iterations > settings.max_iterations:
                log.info("no jump within %d Newton iterations of this step: shorter steps are tried", curve.iterations)
                raise Failure(f"a jump took more than {settings.max_iterations} Newton iterations", [])
            listener()
            state = motion.equilibrium() if motion.settles else None
            if state is not None:
                if state.slope * change < 0:
                    state.direction, state.slope = -state.direction, -state.slope
                return state
            eta *= motion.move(motion.state.x if motion.solved else origin, eta)
        kind, where = (NoEquilibrium, "it comes to rest nowhere") if motion.solved else (
            Failure, "even the largest artificial viscosity finds no next state")
        raise kind(f"no equilibrium is found that the body could snap to: {where}", [])
    except Failure:
        problem.history.variables = kept
        raise
    finally:
        motion.destroy()


def was_passed(curve: Curve, passed: Sequence[State], old: State, new: State) -> bool:
    """Return True if a new state lies on an earlier piece of the path, within a tenth of the step from `old`.

    Pieces before a snap-through do not count, since the history variables differ.
    """
    near = 0.1 * curve.distance(old, new)
    states = [] if old.kind == "jump" else passed[::-1]
    for b, a in zip(states, states[1:]):
        if b.kind == "jump":
            break
        if (a.control - new.control) * (b.control - new.control) < 0:
            x, control = curve.interpolate(a, b, (new.control - a.control) / (b.control - a.control))
            if curve.distance(new, replace(new, x=x, control=control)) < near:
                return True
    return False


class JumpRules:
    """Snap-throughs of a run: where they are tried, and with which change of the control.

    Attributes:
        rule: rule at limit points: "continue", "continue_volume" (snap where the enclosed volume has a maximum),
            "snap_through" or "stop"; "" until a run sets it at its start.
        change: change of the control in the next snap-through, dimensionless. It is 10 times larger after each
            snap-through, and returns to its first value after a step along the path.
        no_equilibrium_at: control at which a snap-through reached no equilibrium, dimensionless; NaN without one.
    """

    def __init__(self, curve: Curve, targets: RunTargets, settings: SnapThrough, rule: str = ""):
        self._curve, self._problem, self._targets, self._settings = curve, curve.problem, targets, settings
        self.rule, self.change, self.no_equilibrium_at = rule, settings.control_change, np.nan

    @property
    def allowed(self) -> bool:
        """True if `rule` snaps, or is "continue" and the path may end at a kink of F (contact, history variables)."""
        may_end = self._problem.history.path_dependent or bool(self._problem.contact.faces)
        return self.rule in ("snap_through", "continue_volume") or self.rule == "continue" and may_end

    @property
    def tried_early(self) -> bool:
        """True if a snap-through is tried after two failed steps, False if only after the smallest step has failed.

        False for a pressure with history variables, since slip in the viscous motion changes the final state.
        """
        return self.rule in ("snap_through", *["continue_volume"] * (not self._problem.history.path_dependent))

    def found_no_equilibrium_near(self, old: State) -> bool:
        """Return True if an earlier snap-through, at nearly the control of `old`, reached no equilibrium."""
        return abs(old.control - self.no_equilibrium_at) < self._settings.max_control_change

    def jump(self, old: State, length: float, sense: float, passed: Sequence[State], listener: Callable[[], None],
             work_sign: float = 0.0) -> State:
        """Return the state of kind "jump" after a snap-through from `old`; raise `Failure` if none was found.

        The motion starts at arc length `length` along the tangent. With length 0 and history variables several changes
        of the control are tried, since contact may converge at one of them only. While unbalanced forces fade, the
        control goes to 1 at once. The work of the controlled load has the sign `work_sign`; 0: either.
        """
        fading, settings = self._problem.setting.fading, self._settings
        others = (settings.control_change, settings.max_control_change) if (
            length == 0 and self._problem.history.path_dependent and not fading) else ()
        failure: Failure | None = None
        for next_change in dict.fromkeys((self.change, *others)):
            self.change = next_change
            solutions = settings.max_solutions // 5 if self.found_no_equilibrium_near(old) else settings.max_solutions
            change = sense * max(self.change, length * abs(old.slope))
            change = 1 - old.control if fading else self._targets.short_of_targets(old, change)
            try:
                new = snap_through(self._curve, old, change, length > 0 and not fading, settings, solutions, listener,
                                   work_sign, passed)
            except Failure as last:
                failure = last
                if isinstance(last, NoEquilibrium):
                    self.no_equilibrium_at = old.control
            else:
                self.change = min(10 * self.change, settings.max_control_change)
                return new
        assert failure is not None
        raise failure


def at_limit_points(problem: Equations, decreases: bool) -> str:
    """Return the default rule at limit points of the control.

    "continue" follows the path: without history variables, except for a pressure in contact. "continue_volume" snaps at
    a maximum of the volume: for an increasing pressure with history variables or contact. Else "snap_through".
    """
    if problem.description.control_kind == "time":
        return "snap_through"
    by_pressure = problem.description.control_kind == "pressure"
    if not (problem.history.path_dependent or problem.contact.faces and by_pressure):
        return "continue"
    return "continue_volume" if by_pressure and not decreases else "snap_through"


def snaps(curve: Curve, old: State, at_limit_point: str, sense: float) -> bool:
    """Return True if the body snaps at a state: its control reverses or, with "continue_volume", its enclosed volume.

    `sense`: direction 1 or -1 of the control at the start of the run.
    """
    if at_limit_point not in ("snap_through",
                              "continue_volume") or old.kind != "limit point" and old.slope * sense >= 0:
        return False
    return at_limit_point == "snap_through" or curve.work_rate(old) * sense < 0
