"""History of the temperature during forming: the heat equation is solved once per accepted step of the run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...errors import ConvergenceError, InputError
from ...findings import Finding, coordinates
from ...forms.history import Start
from ...forms.transfer import MovingLeastSquares
from ...mesh.nodes import matching_rows, without_round_off
from ...ranks import combined, gathered, listed
from ...values.temperature import ABSOLUTE_ZERO
from ...values.tolerances import EXAMINED_STATES, WARNED_ERROR
from . import stepping
from .conduction import Conduction
from .layers import graded
from .run import checked_boundaries, checked_materials
from .space_error import SpaceError

_MAX_STEPS = 10_000
"""Largest number of steps of the heat equation in one step of the run."""


_CONTACT_DISTANCE = 1e-2
"""Distance to a tool over the thickness of the body within which a node exchanges heat with it.

A layer of air of this thickness conducts as well as a contact. A sheet that is drawn over a flat face lifts off its
middle by less.
"""


class HeatState(NamedTuple):
    """State of the heat equation at the end of a step of the run.

    Attributes:
        time: process time at the end of the step.
        temperature: temperatures of the body, locally owned entries, shape (n,).
        tool_excess: for each tool contact, excess temperatures of the tool over its back, shape (contact nodes, m). The
            m nodes lie along the depth below each contact node, the face first.
        step: length of the next time step of the heat equation, time; None before the first step.
        power: heat per time of the dissipated work at the nodes, over the heat capacity of the body, degrees per time,
            locally owned entries, shape (n,); None without heating by work.
        before: (time, temperatures) at the start of the step; None before the first step.
    """

    time: float
    temperature: np.ndarray
    tool_excess: list[np.ndarray]
    step: float | None
    power: np.ndarray | None
    before: tuple[float, np.ndarray] | None


class CoolingHistory:
    """History variables of the temperature: body and conducting tools, as a `formingx.forms.history.History`."""

    def __init__(self, cooling: Any, problem: Any):
        forms, scene = problem.forms, problem.scene
        self._cooling, self._problem, self._forms = cooling, problem, forms
        self._field = problem.temperature
        self._body = self._conduction()
        self._contacts = self._tool_contacts(self._body)
        self._n = len(self._body.points)
        self._first = self._initial_temperatures()
        self._seen: Any = None                              # temperature seen by the field and its coefficients
        low, high = cooling.extremes(scene)
        self._field.limits = low, np.inf if cooling.work_to_heat else high
        self._dissipated = self._body.source(forms.dissipated) if cooling.work_to_heat else None
        self.start()

    def _initial_temperatures(self) -> np.ndarray:
        """Return the initial temperatures of the body, locally owned entries, shape (n,)."""
        return np.asarray(self._problem.scene.temperature.T.x.array[: self._n])

    def _conduction(self, degree: int = 2) -> Any:
        """Return the heat equation of the deformed body; `degree`: polynomial degree of the temperature in an element.
        """
        scene, zero = self._problem.scene, ABSOLUTE_ZERO[self._cooling.unit]
        laws = [*self._cooling.boundaries, *self._cooling.contacts_with_tools(scene)]
        return Conduction(scene.mesh, checked_materials(scene.mesh, self._cooling.materials),
                          checked_boundaries(scene.mesh, laws, zero), scene.kinematics, zero, self._forms.u, degree)

    def _tool_contacts(self, body: Any) -> list[tuple[Any, Any, np.ndarray]]:
        """Return (`HeatContact`, contact of the problem, nodal conductances in contact (n,)) for each tool with heat.
        """
        contacts = [c for c in self._problem.contacts if self._cooling.conducts(c.contact)]
        touching = body.tool_contacts[len(body.tool_contacts) - len(contacts):]      # after each `ContactWithTool`
        return [(touch, contact, touch.conductance.copy()) for touch, contact in zip(touching, contacts, strict=True)]

    def errors_in_space(self, states: Sequence[Any]) -> np.ndarray:
        """Estimate the largest error of temperature in space in each state, degrees, shape (states,); collective."""
        return np.array([error for error, _ in self._space_errors(states)])

    def _space_errors(self, states: Sequence[Any]) -> list[tuple[float, str]]:
        """Return the errors of `errors_in_space`, each with the end of a contact at its place as text, or ""."""
        finer, power, found = self._conduction(degree=3), self._body.power, []
        estimator, tool_contacts = SpaceError(self._body, finer), self._tool_contacts(finer)
        try:
            for state in states:
                with self._problem.state_context(state):
                    self._body.power = 0.0                  # as in `finer`, which has none
                    for body, touching in ((self._body, self._contacts), (finer, tool_contacts)):
                        _set_conductances(body, touching, state.control)
                    for (touch, *_), (cubic, _, conductance) in zip(self._contacts, tool_contacts, strict=True):
                        fraction = estimator.contact_fraction(touch, cubic)
                        cubic.conductance[np.isclose(fraction, 0)] = 0.0
                        inside = np.isclose(fraction, 1)
                        cubic.conductance[inside] = conductance[inside]
                    self._body.update()
                    finer.update()
                    error, place = estimator.largest(self._state, self._time)
                    found.append((error, self._contact_end(place)))
        finally:
            self._body.power = power
            estimator.destroy()
        return found

    def _contact_end(self, place: np.ndarray) -> str:
        """Return the end of a contact at a reference position, shape (2,), length, as text; "" if there is none.

        A contact ends there if only some of the three nearest nodes of its face touch the tool.
        """
        for touch, contact, _ in self._contacts:
            nodes = gathered(self._problem.comm, np.column_stack([touch.points, touch.conductance > 0]))
            nearest = np.argsort(np.linalg.norm(nodes[:, :2] - place, axis=1))[:3]
            if 0 < nodes[nearest, 2].sum() < len(nearest):
                R, Z = without_round_off(place, nodes[:, :2])
                return f" at (R, Z) = {coordinates((R, Z))}, where contact with {contact.contact.label!r} ends"
        return ""

    def findings(self, states: Sequence[Any]) -> list[Finding]:
        """Return a warning in a list if the mesh is too coarse for the temperatures of a run; collective.

        The error is estimated in at most eight states and at the ends of stages. At the end of a contact that moves on
        it decays, so there it counts at the ends of stages only.
        """
        states = [state for state in states if state.time > 0]
        if not states:
            return []
        last = [k for k, (a, b) in enumerate(zip(states, states[1:])) if a.stage != b.stage] + [len(states) - 1]
        looked = sorted({*np.linspace(0, len(states) - 1, EXAMINED_STATES).astype(int).tolist(), *last})
        looked = [k for j, k in enumerate(looked) if not j or states[k].time > states[looked[j - 1]].time]
        found = self._space_errors([states[k] for k in looked])
        errors = [error if k in last or not end else 0.0 for k, (error, end) in zip(looked, found)]
        temperatures = [states[k].history_variables[-1].temperature for k in looked]      # the temperature is last
        scene, comm = self._problem.scene, self._problem.comm
        ends = listed(comm, [float(f(T)) for T in temperatures for f in (np.min, np.max) if len(T)])
        worst, span = int(np.argmax(errors)), np.ptp(np.concatenate(ends))
        duration = float(np.diff([0.0, *(states[k].time for k in looked)])[worst])    # since it was looked at last
        allowed = max(self._cooling.tolerance, WARNED_ERROR * span)
        if errors[worst] <= allowed:
            return []
        low, high = self._cooling.extremes(scene)
        most = max(span, high - low) if np.isfinite(high - low) else span          # no error is larger
        about, end = float(f"{errors[worst]:.2g}"), found[worst][1]
        error = f"is about {about:g}" if errors[worst] < most else f"may be the whole span, {most:.3g}"
        advice = ("use shorter elements along the face there; thinner ones do not reduce this error" if end else
                  f"use thinner elements at faces that touch a tool or lose heat"
                  f"{_finer_elements(scene, min(errors[worst], most) / allowed, duration)}")
        return [Finding("warning", "temperature", f"The error of the temperature in space {error} degrees at time"
                        f" {states[looked[worst]].time:.4g}{end}: {advice}.")]

    def start(self) -> None:
        """Set the initial temperatures of body and tools, at time 0."""
        self._time = 0.0
        self._dt: float | None = None
        self._power: Any = None if self._dissipated is None else np.zeros(self._n)
        self._before: Any = None
        self._state = [self._first.copy(), *(touch.start() for touch in self._body.tool_contacts)]
        self._update_problem()

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Solve the heat equation over a step to x, owned entries, with the body where it is halfway through the step.

        A contact node that closes or opens has half its conductance: the step is of second order. start: state at the
        start; None: the body is at x all the time. ConvergenceError: the end was not reached.
        """
        until = self._forms.time_at(control)
        if self._power is not None:                         # the materials have advanced
            power = self._cooling.work_to_heat * self._body.assembled(self._dissipated)
            self._body.power, self._power = (self._power + power) / 2, power
        if until <= self._time:
            return
        self._body.set_inactive(self._inactive_laws())
        _set_conductances(self._body, self._contacts, control)
        self._before = self._time, self._state[0]
        if start is not None:
            after = [touch.conductance.copy() for touch, *_ in self._contacts]
            self._problem.set_fields(start.x)
            _set_conductances(self._body, self._contacts, start.control)
            for (touch, *_), conductance in zip(self._contacts, after):
                touch.conductance[:] = (touch.conductance + conductance) / 2
            self._problem.set_fields((start.x[: len(x)] + x) / 2)
        self._body.update()
        self._state[0] = self._body.with_fixed_values(self._state[0])
        self._integrate(until)
        self._problem.set_fields(x)
        self._update_problem()

    @property
    def time(self) -> float:
        """Process time of the present temperatures."""
        return self._time

    def ahead(self, time: float, control: float, read: Callable[[], float]) -> float:
        """Return `read()` with the temperatures that the body has at a later time if it stays where the forms are.

        control: load parameter (control) of the state to which the forms are set, dimensionless. The present
        temperatures are restored. At an earlier time the present temperatures are read.
        """
        if time <= self._time:
            return read()
        present = self._time, self._dt, self._state
        try:
            self._body.set_inactive(self._inactive_laws())
            _set_conductances(self._body, self._contacts, control)
            self._body.update()
            self._state = [self._body.with_fixed_values(self._state[0]), *self._state[1:]]
            self._integrate(time)
            self._set_field(self._state[0], None)
            return read()
        finally:
            self._time, self._dt, self._state = present
            self._set_field(self._state[0], None if self._before is None else self._before[1])

    def _inactive_laws(self) -> list[Any]:
        """Return the laws of heat that are inactive in the current stage."""
        first = len(self._problem.scene.items) + 1
        return [self._cooling.boundaries[number - first] for number in self._problem.setting.inactive
                if number >= first]

    def _integrate(self, until: float) -> None:
        """Solve the heat equation up to the time `until`, with the body at a fixed position."""
        dt, tolerance = self._dt or 1e-3 * (until - self._time), self._cooling.tolerance
        for _ in range(_MAX_STEPS):
            trial = stepping.fitted(dt, until - self._time)
            found = stepping.step(self._body, self._state, trial)
            dt = stepping.next_length(trial, found.error, tolerance)
            if found.error <= tolerance:
                self._state = found.state
                self._time = until if trial == until - self._time else self._time + trial
            if self._time == until:
                self._dt = max(dt, trial)
                return
        raise ConvergenceError(f"heat: time {until:.6g} was not reached in {_MAX_STEPS} steps")

    def get(self) -> HeatState:
        """Return the present state of the heat equation."""
        return HeatState(self._time, self._state[0].copy(), [excess.copy() for excess in self._state[1:]], self._dt,
                         self._power, self._before)

    def put(self, variables: HeatState) -> None:
        """Set the present state of the heat equation, a result of `get`."""
        self._time, self._dt = variables.time, variables.step
        self._power, self._before = variables.power, variables.before
        self._state = [variables.temperature.copy(), *(excess.copy() for excess in variables.tool_excess)]
        self._update_problem()

    def save(self, variables: HeatState) -> dict[str, Any]:
        """Return a state of the heat equation as plain data for `load`, the same on all ranks; collective."""
        plain = partial(gathered, self._problem.comm)
        return {"time": variables.time, "step": variables.step, "points": plain(self._body.points),
                "temperature": plain(variables.temperature),
                **({} if variables.before is None else {"before": [variables.before[0], plain(variables.before[1])]}),
                **({} if variables.power is None else {"power": plain(variables.power)}),
                "tools": [{"points": plain(touch.points), "excess": plain(excess)}
                          for touch, excess in zip(self._body.tool_contacts, variables.tool_excess, strict=True)]}

    def load(self, data: dict[str, Any]) -> HeatState:
        """Return this rank's state from data of `save`; InputError: another mesh, or `work_to_heat` in one run only."""
        matching = partial(matching_rows, tolerance=1e-9 * np.abs(data["points"]).max(),
                           message="the temperature history belongs to another mesh")
        rows = matching(self._body.points, data["points"])
        if ("power" in data) != (self._dissipated is not None):
            raise InputError("the temperature history belongs to a scene with another work_to_heat")
        power = np.array(data["power"])[rows] if "power" in data else None
        tool_excess = [np.array(d["excess"])[matching(touch.points, d["points"])].reshape(len(touch.points), -1)
                       for touch, d in zip(self._body.tool_contacts, data["tools"], strict=True)]
        before = (float(data["before"][0]), np.array(data["before"][1])[rows]) if "before" in data else None
        return HeatState(float(data["time"]), np.array(data["temperature"])[rows], tool_excess, data["step"], power,
                         before)

    def transfer(self, source: CoolingHistory, variables: HeatState, x: np.ndarray, control: float,
                 mapping: Callable[[np.ndarray], np.ndarray]) -> HeatState:
        """Interpolate a state of the heat equation from the history `source` on another mesh to this one.

        The material histories must have been transferred before: they give the heat of dissipated work. mapping: from
        reference points there, shape (n, 2), to points here.
        """
        comm, before = self._problem.comm, variables.before
        to_body = MovingLeastSquares(comm, mapping(source._body.points), self._body.points).fitted
        touched = (zip(source._body.tool_contacts, variables.tool_excess, strict=True)
                   if self._body.tool_contacts else ())     # a released body has no tools
        tool_excess = [MovingLeastSquares(comm, mapping(other.points), touch.points).fitted(excess)
                       for touch, (other, excess) in zip(self._body.tool_contacts, touched, strict=True)]
        power = None if variables.power is None else self._cooling.work_to_heat * self._body.assembled(self._dissipated)
        return HeatState(variables.time, to_body(variables.temperature), tool_excess, variables.step, power,
                         before and (before[0], to_body(before[1])))

    def _update_problem(self) -> None:
        """Pass the temperatures at start and end of the step to the problem, for its temperature-dependent constants.
        """
        field, T, before = self._field, self._state[0], self._before
        seen = self._time, T, before
        if combined(self._problem.comm, int(self._seen is None or not _equal(seen, self._seen))):
            self._seen = seen
            self._set_field(T, None if before is None else before[1])
            field.time = self._time
            if before is not None:
                field.time_before = before[0]
            self._problem.update_temperature()

    def _set_field(self, T: np.ndarray, before: np.ndarray | None) -> None:
        """Set the temperature of the problem, now and before, from locally owned entries, shape (n,); None: unknown."""
        field = self._field
        field.T.x.array[: self._n] = T
        field.T.x.scatter_forward()
        field.before = None
        if before is not None:
            earlier = field.T.copy()
            earlier.x.array[: self._n] = before
            earlier.x.scatter_forward()
            field.before = earlier.x.array


def _set_conductances(body: Any, tool_contacts: Sequence[tuple[Any, Any, np.ndarray]], control: float) -> None:
    """Set the conductance of each contact node; 0 if the tool is absent or away from the node in the state."""
    u = body.displacements()
    for touch, contact, conductance in tool_contacts:
        depth = contact.contact.tool.signed_distance(touch.points + u[touch.dofs] - contact.tool_displacement(control))
        touch.conductance[:] = conductance * (contact.active & (depth > -_CONTACT_DISTANCE * contact.thickness))


def _finer_elements(scene: Any, times: float, duration: float) -> str:
    """Return advice on element sizes that reduce the error `times` (of third order in the size), or "" if unknown.

    `duration` is the time during which heat has penetrated; it gives the depth of the thin elements.
    """
    laws = {law.on for law in [*scene.heat.boundaries, *scene.heat.contacts_with_tools(scene)]}
    faces = [face for face in ("bottom", "top") if face in laws]
    if not faces or len(scene.mesh.layers) > 1:
        return ""
    material, = checked_materials(scene.mesh, scene.heat.materials).values()
    sizes = graded(scene.mesh, faces, 0.8 * times ** (-1 / 3), float(np.sqrt(material.diffusivity * duration)))
    return f", such as elements=(n, {[float(f'{size:.2g}') for size in sizes]}), from the bottom up"


def _equal(a: Any, b: Any) -> bool:
    """Return True if two steps, each (time, temperatures, start or None), have equal temperatures."""
    same = a[0] == b[0] and np.array_equal(a[1], b[1]) and (a[2] is None) == (b[2] is None)
    return same and (a[2] is None or a[2][0] == b[2][0] and np.array_equal(a[2][1], b[2][1]))
