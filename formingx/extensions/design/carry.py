"""Transfer of perturbed runs from state to state along the base run, to its last state.

Without history variables the last state depends on its own equations alone, and on the end of earlier stages. With
history variables a perturbed run stores its own states.

The sticking position of a node depends on the time of its gap closure, which changes with the parameter. So the
perturbed node is moved along the velocity of the base run onto its own tool, independently of the step. With the steps
of the base run instead, derivatives were wrong by up to a factor of three.

A perturbed state is compared at the same event as the state of the base run. If a gap closure ends the step and turns
the path, the perturbed gap is closed too. At a target the perturbed run meets its own target. Elsewhere the perturbed
state lies in the plane normal to the path of the base run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...forms.schedule import StepData
from ...measures.targets import Target
from ...results.path import Path
from ...solve.newton import Failure, fixed
from ...solve.process import driving, end_of, next_knot, straight
from ...solve.stage import Plan, plan
from ...solve.state import State
from .neighbours import PerturbedRun, settle


def carry(path: Path, end: Any, neighbours: Sequence[PerturbedRun]) -> None:
    """Solve for all perturbed runs at the last state of the base run.

    Args:
        path: the base run.
        end: the `Target` of a run with one control, or the stages of a process.
        neighbours: the perturbed runs; their states are updated in place.

    Raises:
        Failure: the run has no derivative; its text is the reason.
    """
    _StateTransfer(path, end, neighbours).run()


class _StateTransfer:
    """Transfer of the perturbed runs along the base run."""
    def __init__(self, path: Path, end: Any, neighbours: Sequence[PerturbedRun]):
        if len(path.segments) > 1:
            raise Failure("the body was remeshed", [])
        if path.ended:
            raise Failure(path.ended, [])
        if any(face.contact.lagged for face in path.problem.contacts):
            raise Failure("there is no derivative of contact in space yet", [])
        self.path, self.neighbours = path, neighbours
        self.problem, self.curve = path.problem, path.record.curve
        self._single = isinstance(end, Target)
        self._plans = [] if self._single else [plan(self.problem.scene, stage) for stage in end]
        self._end = end
        self._until: dict[tuple[int, int], tuple[Any, list[Any]]] = {}
        for entry in neighbours:
            entry.plans = [] if self._single else [plan(entry.problem.scene, stage) for stage in entry.end]
            if [_kind(p) for p in entry.plans] != [_kind(p) for p in self._plans]:
                raise Failure(f"parameter {entry.name} changes what the stages drive or how they end", [])

    def run(self) -> None:
        """Repeat the steps of the base run with each parameter slightly changed, from its first state to its last."""
        states = self.path.states
        history = self.problem.has_history
        if history and any(state.kind == "jump" for state in states):
            jump = next(state for state in states if state.kind == "jump")
            raise Failure(f"the body snaps at {self.path.describe(jump)}, where the result does not depend smoothly on"
                          " parameters", [])
        if history and any(p.in_flow for p in self._plans):
            raise Failure("there is none yet for a stage that follows or holds a measure (amplitudes={measure: ...},"
                          " constant=...) in a scene with friction, relaxation or heat", [])
        before: State | None = None
        for k, state in enumerate(states):
            last = k == len(states) - 1 or states[k + 1].setting != state.setting
            begins = before is None or state.setting != before.setting
            if begins and not self._single:
                self._enter(StepData(**state.setting))
            if before is None:
                self._begin(state)
            elif state.kind == "start":
                self._beside = state
            elif last or history:
                self._settle(state, before, last)
            if history:
                for entry in self.neighbours:
                    entry.problem.advance(entry.x, entry.control)
                self._put_on_tools(state)
            before = state
        if states[-1].met is None:
            raise Failure("it did not reach its target", [])

    def _begin(self, state: State) -> None:
        """Set up the first state: the undeformed body, or the body in equilibrium with its loads."""
        for entry in self.neighbours:
            entry.x, entry.control = state.x.copy(), state.control
        self._late: list[np.ndarray] = []
        self._beside = state
        if np.any(state.x):
            with self.problem.state_context(replace(state, memory=state.before)):
                constraint = fixed(state.control)
                settle(self.curve, state, self.neighbours, constraint, [constraint] * len(self.neighbours))

    def _enter(self, setting: StepData) -> None:
        """Begin a stage in each perturbed run from its current state."""
        for entry in self.neighbours:
            problem, p = entry.problem, entry.plans[setting.stage]
            now = problem.setting
            started = entry.x is not None
            amplitudes = [0.0] * len(now.base) if not started else [
                *now.amplitudes(entry.control)[:-1], problem.time_at(entry.control)]
            x = entry.x if started else np.zeros(problem.x.getLocalSize())
            if started:
                for number in set(now.inactive) - set(setting.inactive):
                    problem.bring_in(number, x, entry.control)
            if setting.piece == 0:
                base, rate, control = amplitudes, [0.0] * len(amplitudes), 0.0
            elif p.by_time:
                time = now.base[-1] + now.rate[-1] * entry.control if started else 0.0
                then = next_knot(p.tables, time, end_of(p.stage, p.tables, time))
                base, rate = straight(amplitudes, problem.scales, p.tables, time, then)
                entry.then, control = then, 0.0
            else:
                base, rate, control = driving(amplitudes, problem.scales, p.numbers, p.stage, clocked=not p.in_flow)
            problem.enter(replace(setting, base=base, rate=rate), x, control)
            entry.control = control

    def _settle(self, state: State, before: State, last: bool) -> None:
        """Solve for the perturbed runs at a converged state of the base run."""
        with self.problem.state_context(replace(state, memory=state.before)):
            self._late = []
            for number, face in enumerate(self.problem.contacts):
                self._late.append(self._arrivals(number, face, state, before))
            self._leave_out(state)
            for entry in self.neighbours:                      # the perturbed runs keep the events of the base run
                entry.x = state.x + (entry.x - self._beside.x)
                entry.control = state.control + (entry.control - self._beside.control)
            equation, equations = self._equations(state, last)
            left_over = settle(self.curve, state, self.neighbours, equation, equations)
            for entry in self.neighbours if state is self.path.last else []:
                entry.balance(left_over)
            self._beside = state
            b = self.curve.newton.b.array_r
            self._velocity = [face.moved(b, 1.0) for face in self.problem.contacts]

    def _leave_out(self, state: State) -> None:
        """Keep points open in the perturbed runs that are open in the base run at the end of the step."""
        n = self.problem.n_owned
        for face, late, *others in zip(self.problem.contacts, self._late,
                                       *(entry.problem.contacts for entry in self.neighbours)):
            if face.present:
                face.leave_out(late)
                free = ~face.law.touching(face.positions(state.x[:n], state.control), face.history)
                for mine in others:
                    mine.leave_out(free | late)

    def _arrivals(self, number: int, face: Any, state: State, before: State) -> np.ndarray:
        """Place the perturbed points whose gap closes in a step; return the mask of closures at its end, shape (n,)."""
        history, law, n = face.history, face.law, self.problem.n_owned
        zero = np.zeros(len(face.points), dtype=bool)
        if history is None or not law.has_friction or not face.present:
            return zero
        distance = law.distance(face.positions(state.x[:n], state.control))
        arrived = (history.distance <= -law.theta) & (distance > -law.theta)
        late = arrived & (np.isnan(history.arrival[:, 0]) | (not face.contact.sticks) & (distance < law.theta))
        velocity = face.moved(before.direction, before.slope)
        start = face.positions(before.x[:n], before.control)
        early = np.flatnonzero(arrived & ~late)
        if len(early):
            gap = law.part(early).distance(history.arrival[early])
        for entry in self.neighbours:
            mine, arrival = entry.problem.contacts[number], history.arrival.copy()
            if len(early):
                guess = mine.positions(entry.x[:n], entry.control)[early] + history.arrival[early] - start[early]
                arrival[early] = _onto(mine.law.part(early), guess, velocity[early], gap)
            mine.expect_arrivals(arrival)
        return late

    def _put_on_tools(self, state: State) -> None:
        """Copy the contact status of the base run to the perturbed runs.

        Points whose gap closed at the end of the step are projected onto the tool along the velocity of the base run.
        """
        n = self.problem.n_owned
        for number, face in enumerate(self.problem.contacts):
            if not face.law.remembers or not face.present:
                continue
            run = state.memory[self.problem.histories.index(face)]
            free = run.history.distance <= -face.law.theta
            late = np.flatnonzero(self._late[number] if self._late else 0 * free)
            free[late] = True
            for entry in self.neighbours:
                mine = entry.problem.contacts[number]
                memory = mine.get()
                assert memory is not None
                history = memory.history._replace(distance=run.history.distance,
                                              slip=np.where(free, run.history.slip, memory.history.slip))
                if len(late):
                    history = history._replace(position=history.position.copy())
                    history.position[late] = _onto(
                        mine.law.part(late), mine.positions(entry.x[:n], entry.control)[late],
                        self._velocity[number][late],
                        run.history.distance[late])
                mine.put(memory._replace(history=history, arrived=run.arrived))
        for entry in self.neighbours:
            entry.memory = entry.problem.memory
        self._late = []

    def _equations(self, state: State, last: bool) -> tuple[Any, list[Any]]:
        """Return the constraints of the base run and of the perturbed runs; None for the plane normal to the path."""
        setting = self.problem.setting
        if not last:
            timed = setting.rate[-1] and self.problem.relaxes
            hold = fixed(state.control)
            return (hold, [hold] * len(self.neighbours)) if timed else self._gaps()
        if setting.piece == 0 and not self._single:          # the stage change ends at control 1
            return fixed(1.0), [fixed(1.0)] * len(self.neighbours)
        key = (setting.stage, setting.piece)
        p = None if self._single else self._plans[setting.stage]
        if p is not None and p.by_time and not p.stage.waits:
            return fixed(state.control), [fixed((entry.then - entry.problem.setting.base[-1])
                                                / entry.problem.setting.rate[-1]) for entry in self.neighbours]
        if p is not None and p.in_flow:
            raise Failure("there is none yet for a stage that follows or holds a measure", [])
        if key not in self._until:
            targets = [(self.problem, self._end if p is None else p.stage.until),
                       *((entry.problem, entry.end if p is None else entry.plans[setting.stage].stage.until)
                         for entry in self.neighbours)]
            mine, *others = (target.bind(problem).equation(target.value) for problem, target in targets)
            self._until[key] = mine, others
        target = self._end if p is None else p.stage.until
        if state.met is None or state.met[:2] != target[:2]:
            raise Failure(f"it did not reach its target {target}", [])
        return self._until[key]

    def _gaps(self) -> tuple[Any, list[Any]]:
        """Return the gap of a point that closes at the end of the step and turns the path, or None."""
        for number, late in enumerate(self._late):
            face = self.problem.contacts[number]
            size = np.where(late, abs(face.rule.area), 0.0)
            most = self.problem.comm.allgather(float(size.max(initial=0.0)))
            if max(most) > 0:
                mine = int(np.argmax(size)) if int(np.argmax(most)) == self.problem.comm.rank else None
                return _gap(self.problem, face, mine, True), [
                    _gap(entry.problem, entry.problem.contacts[number], mine, False) for entry in self.neighbours]
        return None, []


def _gap(problem: Any, face: Any, point: int | None, sloped: bool) -> Any:
    """Return a constraint: the gap of a point of a face, with its gradient if `sloped`.

    `point` is the local number of the point on its owner rank, and None on other ranks.
    """
    mine = np.array([] if point is None else [point], dtype=int)
    law = face.law.part(mine)

    def c(x: Any, control: float, gradient: Any) -> tuple[float, float]:
        """Return the gap and its derivative by the control; set its gradient."""
        near = law.nearest(face.positions(x.array_r[: problem.n_owned], control)[mine])
        found, rate = float(near.distance.sum()), 0.0
        if sloped:
            forces, values = np.zeros_like(face.points), np.zeros(problem.n_owned)
            forces[mine] = near.normal
            rate = float((near.normal * face.moved(np.zeros(len(x.array_r)), 1.0)[mine]).sum())
            face.add(values, problem.forms.length * forces)
            problem.fill(gradient, values)
        return (found, rate) if problem.comm.size == 1 else tuple(problem.comm.allreduce(np.array([found, rate])))
    return c


def _kind(p: Plan) -> tuple[list[int], list[tuple[int, int]], list[int]]:
    """Return the controls of a stage, its tables and their lengths, and its inactive items."""
    return p.numbers, [(i, len(table)) for i, table in p.tables], p.inactive


def _onto(law: Any, x: np.ndarray, velocity: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Return points x moved along a velocity until their distance from a tool is `gap`, shape (n, 2)."""
    near = law.nearest(x)
    rate = np.einsum("ni,ni->n", near.normal, velocity)
    sure = abs(rate) > 1e-3 * np.linalg.norm(velocity, axis=1)
    time = np.divide(gap - near.distance, rate, out=np.zeros(len(x)), where=sure)
    return x + time[:, None] * velocity
