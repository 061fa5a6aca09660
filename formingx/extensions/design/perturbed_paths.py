"""Transfer of perturbed runs along the base run to its last state, for derivatives by design parameters.

The base run is the run whose derivatives are computed. A perturbed run is the same run with one parameter slightly
changed. Without history variables only the ends of the stages are solved for. With history variables a perturbed run is
solved at every state of the base run, and has its own history variables.

The sticking position of a node depends on the time of its gap closure, which changes with the parameter. So the node of
the perturbed run is moved along the velocity of the base run onto the tool of the perturbed run. The length of the step
then has no effect. With the steps of the base run instead, derivatives were wrong by up to a factor of three.

A perturbed state is compared with the state of the base run at the same event. If a gap closure ends the step and turns
the path, the gap of the perturbed run is closed too. At a target the perturbed run meets its own target. Elsewhere the
perturbed state lies in the plane normal to the path of the base run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...forms.schedule import StepData
from ...measures.targets import Target
from ...ranks import combined
from ...results.path import Path
from ...solve.newton import Failure, fixed
from ...solve.pieces import control_step_data, end_time, next_knot, table_step_data
from ...solve.stage import Plan, plan
from ...solve.state import State
from .perturbed_runs import PerturbedRun, solve_perturbed


def trace_perturbed(path: Path, end: Any, perturbed: Sequence[PerturbedRun]) -> None:
    """Solve for perturbed runs at the last state of the base run, in place; collective. Raises `Failure`."""
    _PerturbedPaths(path, end, perturbed).run()


class _PerturbedPaths:
    """Perturbed runs that follow the path of the base run, state by state.

    A remeshed body, contact in space and a parameter that changes the control of a stage raise `Failure`.
    """

    def __init__(self, path: Path, end: Any, perturbed: Sequence[PerturbedRun]):
        if len(path.record.segments) > 1:
            raise Failure("the body was remeshed", [])
        if path.ended:
            raise Failure(path.ended, [])
        if any(face.contact.lagged for face in path.problem.contacts):
            raise Failure("contact in three dimensions has no exact derivatives; Design(derivatives='runs') takes"
                          " differences", [])
        self.path, self.runs = path, perturbed
        self.problem, self.curve = path.problem, path.record.curve
        self._single = isinstance(end, Target)
        self._plans = [] if self._single else [plan(self.problem.scene, stage) for stage in end]
        self._end = end
        self._targets: dict[tuple[int, int], tuple[Any, list[Any]]] = {}
        for run in perturbed:
            run.plans = [] if self._single else [plan(run.problem.scene, stage) for stage in run.end]
            if [_fixed_properties(p) for p in run.plans] != [_fixed_properties(p) for p in self._plans]:
                raise Failure(f"parameter {run.name} changes what the stages drive or how they end", [])

    def run(self) -> None:
        """Solve for the perturbed runs at all states of the base run; a `Failure` says why derivatives are missing."""
        states = self.path.states
        history = self.problem.history.path_dependent
        if history and any(state.kind == "jump" for state in states):
            jump = next(state for state in states if state.kind == "jump")
            raise Failure(f"the body snaps at {self.path.record.describe(jump)}, where the result does not depend"
                          " smoothly on parameters", [])
        if history and any(p.prescribes_quantity for p in self._plans):
            raise Failure("there is none yet for a stage that follows or holds a measure (amplitudes={measure: ...},"
                          " constant=...) in a scene with friction, relaxation or heat", [])
        before: State | None = None
        for k, state in enumerate(states):
            last = k == len(states) - 1 or states[k + 1].setting != state.setting
            begins = before is None or state.setting != before.setting
            if begins and not self._single:
                self._begin_stage(StepData(**state.setting))
            if before is None:
                self._start(state)
            elif state.kind == "start":
                self._solved = state
            elif last or history:
                self._solve_at(state, before, last)
            if history:
                for run in self.runs:
                    run.advance()
                self._copy_contact_status(state)
            before = state
        if states[-1].target is None:
            raise Failure("it did not reach its target", [])

    def _start(self, state: State) -> None:
        """Set the perturbed runs to their first state: undeformed, or in equilibrium with initial loads, as `state`."""
        for run in self.runs:
            run.x, run.control = state.x.copy(), state.control
        self._closing: list[np.ndarray] = []
        self._solved = state
        if np.any(state.x):
            with self.problem.state_context(replace(state, history_variables=state.history_variables_before)):
                constraint = fixed(state.control)
                solve_perturbed(self.curve, state, self.runs, constraint, [constraint] * len(self.runs))

    def _begin_stage(self, setting: StepData) -> None:
        """Begin a stage, or a piece of a stage, in each perturbed run.

        Piece 0 is the change from the stage before; then one follows between successive knots of its amplitudes.
        """
        for run in self.runs:
            problem, p = run.problem, run.plans[setting.stage]
            current = problem.setting
            started = run.x is not None
            amplitudes = [0.0] * len(current.base) if not started else [
                *current.amplitudes(run.control)[:-1], problem.history.time_at(run.control)]
            x = run.x if started else np.zeros(problem.x.getLocalSize())
            if started:
                for number in set(current.inactive) - set(setting.inactive):
                    problem.contact.activate(number, x, run.control)
            if setting.piece == 0:
                base, rate, control = amplitudes, [0.0] * len(amplitudes), 0.0
            elif p.by_time:
                time = current.base[-1] + current.rate[-1] * run.control if started else 0.0
                piece_end = next_knot(p.tables, time, end_time(p.stage, p.tables, time))
                base, rate = table_step_data(amplitudes, problem.description.scales, p.tables, time, piece_end)
                run.piece_end, control = piece_end, 0.0
            else:
                base, rate, control = control_step_data(amplitudes, problem.description.scales, p.numbers, p.stage,
                                                        clocked=not p.prescribes_quantity)
            problem.enter(replace(setting, base=base, rate=rate), x, control)
            run.control = control
            if started:
                run.begin_step()

    def _solve_at(self, state: State, before: State, last: bool) -> None:
        """Solve for the perturbed runs at a state of the base run; `last` if a stage or piece ends there."""
        with self.problem.state_context(replace(state, history_variables=state.history_variables_before)):
            self._closing = []
            for number, face in enumerate(self.problem.contacts):
                self._closing.append(self._close_gaps(number, face, state, before))
            self._keep_open(state)
            for run in self.runs:                              # the perturbed runs keep the events of the base run
                run.x = state.x + (run.x - self._solved.x)
                run.control = state.control + (run.control - self._solved.control)
            equation, equations = self._equations(state, last)
            residual = solve_perturbed(self.curve, state, self.runs, equation, equations)
            for run in self.runs if state is self.path.last else []:
                run.balance(residual)
            self._solved = state
            b = self.curve.newton.b.array_r
            self._velocity = [face.relative_motion(b, 1.0) for face in self.problem.contacts]

    def _keep_open(self, state: State) -> None:
        """Keep contact points open in all perturbed runs that are open in the base run, or close as the step ends."""
        n = self.problem.n_owned
        for face, closing, *others in zip(self.problem.contacts, self._closing,
                                          *(run.problem.contacts for run in self.runs)):
            if face.active:
                face.keep_open(closing)
                free = ~face.law.touching(face.positions(state.x[:n], state.control), face.history)
                for perturbed in others:
                    perturbed.keep_open(free | closing)

    def _close_gaps(self, number: int, face: Any, state: State, before: State) -> np.ndarray:
        """Move perturbed points of face `number` to where gaps close; return the mask (n,) of those at the end."""
        history, law, n = face.history, face.law, self.problem.n_owned
        no_points = np.zeros(len(face.points), dtype=bool)
        if history is None or not law.has_friction or not face.active:
            return no_points
        distance = law.distance(face.positions(state.x[:n], state.control))
        newly_closed = (history.distance <= -law.theta) & (distance > -law.theta)
        closing = newly_closed & (np.isnan(history.closure[:, 0]) | (not face.contact.sticks) & (distance < law.theta))
        velocity = face.relative_motion(before.direction, before.slope)
        start = face.positions(before.x[:n], before.control)
        inside = np.flatnonzero(newly_closed & ~closing)
        if len(inside):
            gap = law.part(inside).distance(history.closure[inside])
        for run in self.runs:
            perturbed, closure = run.problem.contacts[number], history.closure.copy()
            if len(inside):
                position = perturbed.positions(run.x[:n], run.control)[inside] + history.closure[inside] - start[inside]
                closure[inside] = _projected(perturbed.law.part(inside), position, velocity[inside], gap)
            perturbed.set_closures(closure)
        return closing

    def _copy_contact_status(self, state: State) -> None:
        """Copy the contact status of the base run at a state to the perturbed runs.

        Points that closed at the end of the step move along the base run's velocity onto the perturbed run's tool.
        """
        n = self.problem.n_owned
        for number, face in enumerate(self.problem.contacts):
            if not face.law.has_history or not face.active:
                continue
            base = state.history_variables[self.problem.history.parts.index(face)]
            free = base.history.distance <= -face.law.theta
            closing = np.flatnonzero(self._closing[number] if self._closing else 0 * free)
            free[closing] = True
            for run in self.runs:
                perturbed = run.problem.contacts[number]
                variables = perturbed.get()
                assert variables is not None
                history = variables.history._replace(distance=base.history.distance,
                                              slip=np.where(free, base.history.slip, variables.history.slip))
                if len(closing):
                    history = history._replace(position=history.position.copy())
                    history.position[closing] = _projected(
                        perturbed.law.part(closing), perturbed.positions(run.x[:n], run.control)[closing],
                        self._velocity[number][closing], base.history.distance[closing])
                perturbed.put(variables._replace(history=history, newly_closed=base.newly_closed))
        for run in self.runs:
            run.history_variables = run.problem.history.variables
        self._closing = []

    def _equations(self, state: State, last: bool) -> tuple[Any, list[Any]]:
        """Return the constraints that determine at which point of its path each run is compared.

        The first is None for the plane normal to the path; `last`: a stage or a piece of it ends at the state.
        """
        setting = self.problem.setting
        if not last:
            timed = setting.rate[-1] and self.problem.history.rate_dependent
            constraint = fixed(state.control)
            return (constraint, [constraint] * len(self.runs)) if timed else self._gap_constraints()
        if setting.piece == 0 and not self._single:          # the stage change ends at control 1
            return fixed(1.0), [fixed(1.0)] * len(self.runs)
        key = (setting.stage, setting.piece)
        p = None if self._single else self._plans[setting.stage]
        if p is not None and p.by_time and not p.stage.waits:
            return fixed(state.control), [fixed((run.piece_end - run.problem.setting.base[-1])
                                                / run.problem.setting.rate[-1]) for run in self.runs]
        if p is not None and p.prescribes_quantity:
            raise Failure("there is none yet for a stage that follows or holds a measure", [])
        if key not in self._targets:
            targets = [(self.problem, self._end if p is None else p.stage.until),
                       *((run.problem, run.end if p is None else run.plans[setting.stage].stage.until)
                         for run in self.runs)]
            base, *others = (target.bind(problem).equation(target.value) for problem, target in targets)
            self._targets[key] = base, others
        target = self._end if p is None else p.stage.until
        if state.target is None or state.target[:2] != target[:2]:
            raise Failure(f"it did not reach its target {target}", [])
        return self._targets[key]

    def _gap_constraints(self) -> tuple[Any, list[Any]]:
        """Return constraints that close, in every run, the gap that closes at the end of the base run's step.

        The first, of the base run, is None without such a gap.
        """
        for number, closing in enumerate(self._closing):
            face = self.problem.contacts[number]
            size = np.where(closing, abs(face.rule.area), 0.0)
            most = self.problem.comm.allgather(float(size.max(initial=0.0)))
            if max(most) > 0:
                point = int(np.argmax(size)) if int(np.argmax(most)) == self.problem.comm.rank else None
                return _gap_constraint(self.problem, face, point, True), [
                    _gap_constraint(run.problem, run.problem.contacts[number], point, False) for run in self.runs]
        return None, []


def _gap_constraint(problem: Any, face: Any, point: int | None, with_gradient: bool) -> Any:
    """Return a constraint of (x, control, gradient) that closes the gap of a point (None on other ranks).

    It returns the signed distance, length, its derivative by the control, and fills the gradient by x if requested.
    """
    local = np.array([] if point is None else [point], dtype=int)
    law = face.law.part(local)

    def gap(x: Any, control: float, gradient: Any) -> tuple[float, float]:
        """Return the distance and its derivative by the control; set the vector `gradient` to its derivative by x."""
        near = law.nearest(face.positions(x.array_r[: problem.n_owned], control)[local])
        distance, rate = float(near.distance.sum()), 0.0
        if with_gradient:
            forces, values = np.zeros_like(face.points), np.zeros(problem.n_owned)
            forces[local] = near.normal
            rate = float((near.normal * face.relative_motion(np.zeros(len(x.array_r)), 1.0)[local]).sum())
            face.add(values, problem.forms.length * forces)
            problem.fill(gradient, values)
        return tuple(combined(problem.comm, np.array([distance, rate])))
    return gap


def _fixed_properties(p: Plan) -> tuple[list[int], list[tuple[int, int]], list[int]]:
    """Return indices of controlled items, (item, knots) of amplitudes in time, and indices of inactive items."""
    return p.numbers, [(i, len(table)) for i, table in p.tables], p.inactive


def _projected(law: Any, x: np.ndarray, velocity: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Move points (n, 2) along velocities to signed gaps (n,), length, to first order; along the tool they stay."""
    near = law.nearest(x)
    rate = np.einsum("ni,ni->n", near.normal, velocity)
    towards = abs(rate) > 1e-3 * np.linalg.norm(velocity, axis=1)
    time = np.divide(gap - near.distance, rate, out=np.zeros(len(x)), where=towards)
    return x + time[:, None] * velocity
