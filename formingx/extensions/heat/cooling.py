"""Heat while a body is formed: once per accepted step, in the body as it is deformed half-way through the step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...errors import ConvergenceError, InputError, instance, known, positive, several
from ...findings import Finding
from ...forms.carry import Carrier
from ...forms.history import Start
from ...ranks import gathered
from ...values.table import Table
from ...values.temperature import ABSOLUTE_ZERO
from . import stepping
from .boundaries import Convection, FixedTemperature, ThermalProperties
from .conduction import Conduction
from .contact import ConductingTool, ContactWithTool
from .layers import graded
from .run import checked_boundaries, checked_materials
from .space_error import SpaceError

_MOST_STEPS = 10_000       # of the heat equation in one of the run's
_WARNS = 2e-3
"""Discretisation error over the span of temperatures above which a run warns: the promised accuracy of stresses."""
_LOOKS = 8
"""Number of states in which the discretisation error is estimated, beside the ends of stages."""
_NEAR = 1e-2
"""Distance to a tool over the thickness of the body within which a node touches it, for heat: so thin a layer of air
conducts as well as a contact does. (A sheet that is drawn over a flat face lifts off its middle by less.)"""

_CONTINUOUS = 1e4
"""Conductance of a suddenly chilled face, over conductivity/thickness. The shrinkage of a part is 0.1 % from its limit
(with 1e3: 0.6 %, with 1e2: 2.5 %; tests/test_released.py)."""

_TOOLS = "a dict of (conductance, tool) by the names of contacts"


class ToolHeat(NamedTuple):
    """Heat exchange of a tool of the scene with the body while, and where, it touches it.

    conductance: of the contact, heat per time, area and degree; tool: a temperature, or a `ConductingTool`.
    """

    conductance: float
    tool: float | ConductingTool

    @classmethod
    def of(cls, name: str, given: Any) -> ToolHeat:
        """Return a pair that a user gave for a contact; raises `InputError` if it is none."""
        try:
            return cls(*given)
        except TypeError:
            raise InputError(f"Cooling: tools: {name} = {given!r}: must be (conductance, tool)") from None


class Cooling:
    """The temperature of a scene's body changes while it is formed, as time goes by.

    In each accepted step the heat equation is solved in the body as it is deformed half-way through the step (a
    staggered scheme, of second order in the step). Temperature-dependent constants have their new values in the next
    step. Steps are shortened so that the temperature, too, is accurate in time (`accuracy` of `Process.run`).

    Args:
        materials: {layer: `ThermalProperties`}, or one for all layers.
        boundaries: laws of faces, as of `formingx.heat`.
        tools: {name of a contact of the scene: (conductance, tool)}, see `ToolHeat`.
        unit: of all temperatures, "C" or "K".
        tolerance: the largest estimated error of one step in time of the heat equation, degrees.
        work_to_heat: heat that comes of a unit of the work that materials dissipate, in the units of the two: 1 in
            SI, 1e-3 for MPa, mm and W, less where a part of it is stored. None: work does not heat. (The work of
            friction on tools never does.)

    >>> air = fx.Convection("top", h=2e-5, air=20.0)
    >>> polymer = fx.ThermalProperties(conductivity=0.2e-3, density=1e-3, heat_capacity=2.0)
    >>> hot = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=fx.entropic(0.4, 150.0, unit="C")), loads=scene.loads,
    ...                supports=scene.supports, temperature=150.0, heat=fx.Cooling(polymer, [air], unit="C"))
    """

    def __init__(self, materials: ThermalProperties | Mapping[str, ThermalProperties], boundaries: Sequence[Any] = (),
                 *, unit: str, tools: Mapping[str, Any] | None = None, tolerance: float = 0.05,
                 work_to_heat: float | None = None):
        known("Cooling: unit", unit, ABSOLUTE_ZERO)
        self.materials, self.unit, self.tolerance = materials, unit, positive("Cooling: tolerance", tolerance)
        self.work_to_heat = None if work_to_heat is None else positive("Cooling: work_to_heat", work_to_heat)
        self.boundaries = several("Cooling: boundaries", boundaries, "boundaries, such as Convection(...)")
        tools = {} if tools is None else instance("Cooling: tools", tools, Mapping, _TOOLS)
        self.tools = {name: ToolHeat.of(name, given) for name, given in tools.items()}

    def __repr__(self) -> str:
        tools = {name: (tool.conductance, tool.tool) for name, tool in self.tools.items()}
        more = f", work_to_heat={self.work_to_heat!r}" * (self.work_to_heat is not None)
        return f"Cooling({self.materials!r}, {self.boundaries!r}, unit={self.unit!r}, tools={tools!r}{more})"

    def check(self, scene: Any) -> None:
        """Raise an InputError unless it fits a scene."""
        if scene.temperature is None:
            raise InputError("Scene: heat: the body needs a temperature to begin with: temperature=...")
        if not scene.model.solid:
            raise InputError("Scene: heat: a membrane has no thickness to conduct through: use a solid model")
        if self.work_to_heat and not any(material.internal for material in scene.materials.values()):
            raise InputError(f"Scene: heat: work_to_heat = {self.work_to_heat:g}: no material of the scene dissipates"
                             f" work: give one that relaxes, or leave it out")
        zero = ABSOLUTE_ZERO[self.unit]
        checked_materials(scene.mesh, self.materials)
        checked_boundaries(scene.mesh, [*self.boundaries, *self._touches(scene)], zero)

    def without_tools(self, mesh: Any, thickness: float, boundaries: Any) -> Cooling:
        """Return the same cooling without tools, with other laws at the faces of a body.

        A face that takes on another temperature at once changes the stress by a finite amount in any step, however
        short. So a fixed temperature acts through a large conductance (`_CONTINUOUS`).

        Args:
            mesh: mesh of the body.
            thickness: its largest wall, length.
            boundaries: laws, or {boundary: prescribed temperature}.
        """
        laws = [FixedTemperature(name, temperature=T) for name, T in boundaries.items()] if isinstance(
            boundaries, Mapping) else several("Path.springback: boundaries", boundaries,
                                              "boundaries, such as Convection(...)")
        h = _CONTINUOUS * max(m.conductivity for m in checked_materials(mesh, self.materials).values()) / thickness
        laws = [Convection(law.on, h=h, air=law.parameters["temperature"]) if isinstance(law, FixedTemperature) else law
                for law in laws]
        return Cooling(self.materials, laws, unit=self.unit, tolerance=self.tolerance, work_to_heat=self.work_to_heat)

    def time_through(self, mesh: Any, thickness: float) -> float:
        """Return the diffusion time thickness^2/diffusivity of the slowest layer of a mesh, time."""
        return thickness**2 / min(m.diffusivity for m in checked_materials(mesh, self.materials).values())

    def history(self, problem: Any) -> CoolingHistory:
        """Return the history variables of the temperature (`formingx.forms.history.History`)."""
        return CoolingHistory(self, problem)

    def extremes(self, scene: Any) -> tuple[float, float]:
        """Return the bounds of the temperature of the body if work does not heat it; collective."""
        first = scene.temperature.T.x.array
        ends = scene.mesh.comm.allgather((first.min(initial=np.inf), first.max(initial=-np.inf)))
        return _extremes([*np.ravel(ends)], [*self.boundaries, *self._touches(scene)])

    def conductances(self, scene: Any) -> dict[str, float]:
        """Return {boundary: the largest conductance of its laws}, heat per time, area and degree; inf: a fixed one."""
        found: dict[str, float] = {}
        for law in [*self.boundaries, *self._touches(scene)]:
            given = np.inf if isinstance(law, FixedTemperature) else getattr(law, "conductance", None) or getattr(
                law, "parameters", {}).get("h", 0.0)
            value = float(np.max(given.y)) if isinstance(given, Table) else float(given)
            found[law.on] = max(value, found.get(law.on, 0.0))
        return {on: value for on, value in found.items() if value}

    def conducts(self, contact: Any) -> bool:
        """Return True if heat flows through a contact of the scene."""
        return contact.name in self.tools

    def _touches(self, scene: Any) -> list[ContactWithTool]:
        names = [contact.name for contact in scene.contacts]
        for name in self.tools:
            known("Cooling: tools: contact", name, names)
        touching = [(contact, self.tools[contact.name]) for contact in scene.contacts if self.conducts(contact)]
        return [ContactWithTool(contact.on, conductance=given.conductance, tool=given.tool)
                for contact, given in touching]


class Memory(NamedTuple):
    """State of the heat equation.

    Attributes:
        time: process time.
        temperature: locally owned entries, shape (n,).
        lines: temperatures of the lines of each tool, see `Touch`.
        step: time step to continue with, or None.
        power: heat of dissipated work (`Conduction.power`), locally owned entries, or None.
        before: an earlier time and the temperature then, or None.
    """

    time: float
    temperature: np.ndarray
    lines: list[np.ndarray]
    step: float | None
    power: np.ndarray | None
    before: tuple[float, np.ndarray] | None


class CoolingHistory:
    """The temperature as a history."""

    def __init__(self, cooling: Cooling, problem: Any):
        forms, scene = problem.forms, problem.scene
        self._cooling, self._problem, self._forms = cooling, problem, forms
        self._field = problem.temperature
        self._body = self._conduction()
        self._touches = self._touching(self._body)
        self._n = len(self._body.points)
        self._first = scene.temperature.T.x.array[: self._n]
        self._seen: Any = None                              # by the field, and by what depends on it
        low, high = cooling.extremes(scene)
        self._field.limits = low, np.inf if cooling.work_to_heat else high
        self._dissipated = self._body.source(forms.dissipated) if cooling.work_to_heat else None
        self.start()

    def _conduction(self, degree: int = 2) -> Conduction:
        scene, zero = self._problem.scene, ABSOLUTE_ZERO[self._cooling.unit]
        laws = [*self._cooling.boundaries, *self._cooling._touches(scene)]
        return Conduction(scene.mesh, checked_materials(scene.mesh, self._cooling.materials),
                          checked_boundaries(scene.mesh, laws, zero), scene.kinematics, zero, self._forms.u, degree)

    def _touching(self, body: Conduction) -> list[tuple[Any, Any, np.ndarray]]:
        """Return (touch, contact, conductance in contact) of each tool that exchanges heat."""
        contacts = [c for c in self._problem.contacts if self._cooling.conducts(c.contact)]
        return [(touch, contact, touch.conductance.copy())
                for touch, contact in zip(body.touches, contacts, strict=True)]

    def errors_in_space(self, states: Sequence[Any]) -> np.ndarray:
        """Return the largest errors of temperatures in states that are due to the mesh, estimated, degrees;
        collective."""
        finer, power, found = self._conduction(degree=3), self._body.power, []
        estimate, touches = SpaceError(self._body, finer), self._touching(finer)
        try:
            for state in states:
                with self._problem.state_context(state):
                    self._body.power = 0.0                  # of both, or of none
                    for body, touching in ((self._body, self._touches), (finer, touches)):
                        _look_where_it_touches(body, touching, state.control)
                        body.update()
                    found.append(estimate.of(self._state, self._time))
        finally:
            self._body.power = power
            estimate.destroy()
        return np.array(found)

    def findings(self, states: Sequence[Any]) -> list[Finding]:
        """Return the finding on the temperatures in states, where the mesh is too coarse for them; collective."""
        states = [state for state in states if state.time > 0]
        if not states:
            return []
        begun = [k + 1 for k, (a, b) in enumerate(zip(states, states[1:])) if a.stage != b.stage]
        looked = sorted({*np.linspace(0, len(states) - 1, _LOOKS).astype(int).tolist(), *(k - 1 for k in begun)})
        looked = [k for j, k in enumerate(looked) if not j or states[k].time > states[looked[j - 1]].time]
        errors = self.errors_in_space([states[k] for k in looked])
        temperatures = [states[k].memory[-1].temperature for k in looked]          # the memory of heat is the last one
        scene, comm = self._problem.scene, self._problem.comm
        ends = comm.allgather([float(f(T)) for T in temperatures for f in (np.min, np.max) if len(T)])
        worst, span = int(np.argmax(errors)), np.ptp(np.concatenate(ends))
        duration = float(np.diff([0.0, *(states[k].time for k in looked)])[worst])    # since it was looked at last
        allowed = max(self._cooling.tolerance, _WARNS * span)
        if errors[worst] <= allowed:
            return []
        low, high = self._cooling.extremes(scene)
        most = max(span, high - low) if np.isfinite(high - low) else span          # no error is larger
        error = f"is about {errors[worst]:.2g}" if errors[worst] < most else f"may be their whole span, {most:.3g}"
        return [Finding("warning", "temperature", f"The error of the temperature in space {error} degrees at time"
                        f" {states[looked[worst]].time:.4g}: use thinner elements at faces that touch a tool or"
                        f" lose heat{_such_as(scene, min(errors[worst], most) / allowed, duration)}.")]

    def start(self) -> None:
        """See `History`."""
        self._time = 0.0
        self._dt: float | None = None
        self._power: Any = None if self._dissipated is None else np.zeros(self._n)
        self._before: Any = None
        self._state = [self._first.copy(), *(touch.start() for touch in self._body.touches)]
        self._take()

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """See `History`.

        The heat equation is solved in the body half-way through the step. A point that touches or separates in the
        step has half its conductance. So the step is of second order.
        """
        until = self._forms.time_at(control)
        if self._power is not None:                         # the materials have advanced
            power = self._cooling.work_to_heat * self._body.assembled(self._dissipated)
            self._body.power, self._power = (self._power + power) / 2, power
        if until <= self._time:
            return
        _look_where_it_touches(self._body, self._touches, control)
        self._before = self._time, self._state[0]
        if start is not None:
            after = [touch.conductance.copy() for touch, *_ in self._touches]
            self._problem.place(start.x)
            _look_where_it_touches(self._body, self._touches, start.control)
            for (touch, *_), conductance in zip(self._touches, after):
                touch.conductance[:] = (touch.conductance + conductance) / 2
            self._problem.place((start.x[: len(x)] + x) / 2)
        self._body.update()
        self._state[0] = self._body.held(self._state[0])
        self._go(until)
        self._problem.place(x)
        self._take()

    def _go(self, until: float) -> None:
        """Take steps of the heat equation with the body at a fixed position."""
        dt, tolerance = self._dt or 1e-3 * (until - self._time), self._cooling.tolerance
        for _ in range(_MOST_STEPS):
            trial = stepping.fitted(dt, until - self._time)
            found = stepping.step(self._body, self._state, trial)
            dt = stepping.next_length(trial, found.error, tolerance)
            if found.error <= tolerance:
                self._state = found.state
                self._time = until if trial == until - self._time else self._time + trial
            if self._time == until:
                self._dt = max(dt, trial)
                return
        raise ConvergenceError(f"heat: time {until:.6g} was not reached in {_MOST_STEPS} steps")

    def get(self) -> Memory:
        """See `History`."""
        return Memory(self._time, self._state[0].copy(), [lines.copy() for lines in self._state[1:]], self._dt,
                      self._power, self._before)

    def put(self, memory: Memory) -> None:
        """See `History`."""
        self._time, self._dt, self._power, self._before = memory.time, memory.step, memory.power, memory.before
        self._state = [memory.temperature.copy(), *(lines.copy() for lines in memory.lines)]
        self._take()

    def save(self, memory: Memory) -> dict[str, Any]:
        """See `History`."""
        plain = partial(gathered, self._problem.comm)
        return {"time": memory.time, "step": memory.step, "points": plain(self._body.points),
                "temperature": plain(memory.temperature),
                **({} if memory.before is None else {"before": [memory.before[0], plain(memory.before[1])]}),
                **({} if memory.power is None else {"power": plain(memory.power)}),
                "lines": [{"points": plain(touch.points), "above_back": plain(lines)}
                          for touch, lines in zip(self._body.touches, memory.lines, strict=True)]}

    def load(self, data: dict[str, Any]) -> Memory:
        """See `History`."""
        rows = _rows(self._body.points, data["points"])
        if ("power" in data) != (self._dissipated is not None):
            raise InputError("the temperature history belongs to a scene with another work_to_heat")
        power = np.array(data["power"])[rows] if "power" in data else None
        lines = [np.array(d["above_back"])[_rows(touch.points, d["points"])].reshape(len(touch.points), -1)
                 for touch, d in zip(self._body.touches, data["lines"], strict=True)]
        before = (float(data["before"][0]), np.array(data["before"][1])[rows]) if "before" in data else None
        return Memory(float(data["time"]), np.array(data["temperature"])[rows], lines, data["step"], power, before)

    def carry(self, source: CoolingHistory, memory: Memory, x: np.ndarray, control: float,
              mapping: Callable[[np.ndarray], np.ndarray]) -> Memory:
        """See `History`; the materials have been carried."""
        comm, before = self._problem.comm, memory.before
        to_body = Carrier(comm, mapping(source._body.points), self._body.points).fitted
        touched = zip(source._body.touches, memory.lines, strict=True) if self._body.touches else ()
        lines = [Carrier(comm, mapping(other.points), touch.points).fitted(kept)  # what is released touches nothing
                 for touch, (other, kept) in zip(self._body.touches, touched, strict=True)]
        power = None if memory.power is None else self._cooling.work_to_heat * self._body.assembled(self._dissipated)
        return Memory(memory.time, to_body(memory.temperature), lines, memory.step, power,
                      before and (before[0], to_body(before[1])))

    def _take(self) -> None:
        """Set the temperature of the problem and its dependent coefficients."""
        field, T, before = self._field, self._state[0], self._before
        seen = self._time, T, before
        if self._problem.comm.allreduce(int(self._seen is None or not _equal(seen, self._seen))):
            self._seen = seen
            field.T.x.array[: self._n] = T
            field.T.x.scatter_forward()
            field.time, field.before = self._time, None
            if before is not None:
                earlier = field.T.copy()
                earlier.x.array[: self._n] = before[1]
                earlier.x.scatter_forward()
                field.time_before, field.before = before[0], earlier.x.array
            self._problem.take_temperature()


def _look_where_it_touches(body: Conduction, touches: Sequence[tuple[Any, Any, np.ndarray]], control: float) -> None:
    """Set the conductance of the nodes in contact: zero where no tool touches the deformed body."""
    u = body.displacements()
    for touch, contact, conductance in touches:
        depth = contact.contact.tool.signed_distance(touch.points + u[touch.dofs] - contact.travelled(control))
        touch.conductance[:] = conductance * (contact.present & (depth > -_NEAR * contact.thickness))


def _such_as(scene: Any, times: float, duration: float) -> str:
    """Return the advice on elements that reduce an error by a factor (of third order)."""
    laws = {law.on for law in [*scene.heat.boundaries, *scene.heat._touches(scene)]}
    faces = [face for face in ("bottom", "top") if face in laws]
    if not faces or len(scene.mesh.layers) > 1:
        return ""
    material, = checked_materials(scene.mesh, scene.heat.materials).values()
    sizes = graded(scene.mesh, faces, 0.8 * times ** (-1 / 3), float(np.sqrt(material.diffusivity * duration)))
    return f", such as elements=(n, {[float(f'{size:.2g}') for size in sizes]}), from the bottom up"


def _equal(a: Any, b: Any) -> bool:
    """Return True if two (time, temperature, before) are the same."""
    same = a[0] == b[0] and np.array_equal(a[1], b[1]) and (a[2] is None) == (b[2] is None)
    return same and (a[2] is None or a[2][0] == b[2][0] and np.array_equal(a[2][1], b[2][1]))


def _extremes(temperatures: list[float], laws: Sequence[Any]) -> tuple[float, float]:
    """Return the bounds of the temperature of a body under these laws, by the maximum principle."""
    for law in laws:
        if not getattr(law, "temperatures", ()):            # heat from elsewhere
            return -np.inf, np.inf
        touches = isinstance(law, ContactWithTool)
        for value in [law.tool] if touches else [law.parameters[name] for name in law.temperatures]:
            found: Any = (value.y.tolist() if isinstance(value, Table) else
                          [value.back, value.start] if isinstance(value, ConductingTool) else [value])
            temperatures += found
    return min(temperatures), max(temperatures)


def _rows(points: np.ndarray, others: Any) -> np.ndarray:
    """Return the row of `others` at the position of each point, shape (n,).

    Raises:
        InputError: a point is not among the others.
    """
    from scipy.spatial import cKDTree
    others = np.reshape(others, (-1, points.shape[-1]))
    if not len(points):
        return np.zeros(0, dtype=int)
    away, rows = cKDTree(others).query(points)
    if np.any(away > 1e-9 * np.abs(others).max()):
        raise InputError("the temperature history belongs to another mesh")
    return rows
