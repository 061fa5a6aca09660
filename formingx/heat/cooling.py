"""Heat while a body is formed: once per accepted step, in the body as it is deformed then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import ConvergenceError, InputError, instance, known, positive, several
from ..tables import Table
from ..time_temperature import ABSOLUTE_ZERO
from . import stepping
from .boundaries import ThermalProperties
from .conduction import Conduction
from .contact import ConductingTool, ContactWithTool
from .run import checked_boundaries, checked_materials

_MOST_STEPS = 10_000
_NEAR = 1e-2
"""Distance to a tool over the thickness of the body within which a node touches it, for heat: so thin a layer of air
conducts as well as a contact does. (A sheet that is drawn over a flat face lifts off its middle by less.)"""

_TOOLS = "a dict of (conductance, tool) by the names of contacts"


class ToolHeat(NamedTuple):
    """How a tool of the scene takes heat from the body where, and while, it touches it.

    conductance: of the contact, heat per time, area and degree; tool: a temperature, or a `ConductingTool`.
    """

    conductance: float
    tool: float | ConductingTool

    @classmethod
    def of(cls, name: str, given: Any) -> ToolHeat:
        """A pair that a user gave for a contact; raises `InputError` if it is none."""
        try:
            return cls(*given)
        except TypeError:
            raise InputError(f"Cooling: tools: {name} = {given!r}: must be (conductance, tool)") from None


class Cooling:
    """The temperature of a scene's body changes while it is formed, as time goes by.

    In each accepted step the heat equation is solved in the body as it is deformed at the end of the step (a staggered
    scheme, of first order in the step); constants that depend on the temperature have their new values from then on.
    Steps are shortened so that the temperature, too, is exact in time (`accuracy` of `Process.run`).

    Args:
        materials: {layer: `ThermalProperties`}, or one for all layers.
        boundaries: laws of faces, as of `formingx.heat`.
        tools: {name of a contact of the scene: (conductance, tool)}, see `ToolHeat`.
        unit: of all temperatures, "C" or "K".
        tolerance: the largest estimated error of one step in time of the heat equation, degrees.
        work_to_heat: heat that comes of a unit of the work that materials dissipate, in the units of the two: 1 in
            SI, 1e-3 for MPa, mm and W, less where a part of it is stored. None: work does not heat. (That of friction
            on tools never does.)
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

    def check(self, scene: Any) -> None:
        """An InputError unless it fits a scene."""
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

    def history(self, problem: Any) -> CoolingHistory:
        """What a problem remembers of the temperature (`formingx.discrete.history.History`)."""
        return CoolingHistory(self, problem)

    def conducts(self, contact: Any) -> bool:
        """True if heat flows through a contact of the scene."""
        return contact.name in self.tools

    def _touches(self, scene: Any) -> list[ContactWithTool]:
        names = [contact.name for contact in scene.contacts]
        for name in self.tools:
            known("Cooling: tools: contact", name, names)
        touching = [(contact, self.tools[contact.name]) for contact in scene.contacts if self.conducts(contact)]
        return [ContactWithTool(contact.on, conductance=given.conductance, tool=given.tool)
                for contact, given in touching]


class Memory(NamedTuple):
    """Process time, and the state of the heat equation: {"temperature": T from absolute zero, own part, shape (n, 1)},
    and the lines of each tool; the step in time to go on with, if there is one; heat of dissipated work
    (`Conduction.power`), own part, or None."""

    time: float
    values: dict[str, np.ndarray]
    lines: list[np.ndarray]
    step: float | None
    power: np.ndarray | None


class CoolingHistory:
    """The temperature as a history: it advances in accepted steps only."""

    weights = {"temperature": 0.1}
    """Of errors in time: relative ones of the absolute temperature."""

    def __init__(self, cooling: Cooling, problem: Any):
        forms, scene = problem.forms, problem.scene
        self._cooling, self._problem, self._forms = cooling, problem, forms
        self._zero = ABSOLUTE_ZERO[cooling.unit]
        self._T = scene.temperature.T
        touches = cooling._touches(scene)
        self._body = Conduction(scene.mesh, checked_materials(scene.mesh, cooling.materials),
                                checked_boundaries(scene.mesh, [*cooling.boundaries, *touches], self._zero),
                                scene.kinematics, self._zero, forms.u)
        touching = [c for c in problem.contacts if cooling.conducts(c.contact)]
        self._touches = [(touch, contact, touch.conductance.copy())
                         for touch, contact in zip(self._body.touches, touching, strict=True)]
        self._n = len(self._body.points)
        self._first = scene.temperature.first[: self._n].copy()
        self._seen: Any = None                              # by the constants of this problem
        ends = problem.comm.allgather((self._first.min(initial=np.inf), self._first.max(initial=-np.inf)))
        low, high = _extremes([*np.ravel(ends)], [*cooling.boundaries, *touches])
        scene.temperature.limits = low, np.inf if cooling.work_to_heat else high
        self._dissipated = self._body.source(forms.dissipated) if cooling.work_to_heat else None
        self.start()

    def start(self) -> None:
        """See `History`."""
        self._time = 0.0
        self._dt: float | None = None
        self._power: Any = None if self._dissipated is None else np.zeros(self._n)
        self._take(self._first)
        self._state = [self._first.copy(), *(touch.start() for touch in self._body.touches)]

    def advance(self, x: np.ndarray, control: float) -> None:
        """See `History`."""
        until = self._forms.time_at(control)
        if self._power is not None:                         # the materials have advanced
            power = self._cooling.work_to_heat * self._body.assembled(self._dissipated)
            self._body.power, self._power = (self._power + power) / 2, power
        if until <= self._time:
            return
        u = self._body.displacements()
        for touch, contact, conductance in self._touches:
            depth = contact.contact.tool.signed_distance(touch.points + u[touch.dofs] - contact.travelled(control))
            touch.conductance[:] = conductance * (contact.present & (depth > -_NEAR * contact.thickness))
        self._body.update()
        self._state[0] = self._body.held(self._state[0])
        self._go(until)
        self._take(self._state[0])

    def _go(self, until: float) -> None:
        """Steps of the heat equation, the body standing still."""
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
        raise ConvergenceError(f"heat: {_MOST_STEPS} steps did not lead to time {until:.6g}")

    def get(self) -> Memory:
        """See `History`."""
        return Memory(self._time, {"temperature": (self._state[0] - self._zero)[:, None]},
                      [lines.copy() for lines in self._state[1:]], self._dt, self._power)

    def put(self, memory: Memory) -> None:
        """See `History`."""
        self._time, self._dt, self._power = memory.time, memory.step, memory.power
        T = memory.values["temperature"][:, 0] + self._zero
        self._state = [T, *(lines.copy() for lines in memory.lines)]
        self._take(T)

    def save(self, memory: Memory) -> dict[str, Any]:
        """See `History`."""
        def plain(own):
            return self._gathered(own).tolist()
        return {"time": memory.time, "step": memory.step, "points": plain(self._body.points),
                "temperature": plain(memory.values["temperature"][:, 0]),
                **({} if memory.power is None else {"power": plain(memory.power)}),
                "lines": [{"points": plain(touch.points), "above_back": plain(lines)}
                          for touch, lines in zip(self._body.touches, memory.lines, strict=True)]}

    def load(self, data: dict[str, Any]) -> Memory:
        """See `History`."""
        rows = _rows(self._body.points, data["points"])
        if ("power" in data) != (self._dissipated is not None):
            raise InputError("what is remembered of the temperature is of another work_to_heat")
        power = np.array(data["power"])[rows] if "power" in data else None
        lines = [np.array(d["above_back"])[_rows(touch.points, d["points"])].reshape(len(touch.points), -1)
                 for touch, d in zip(self._body.touches, data["lines"], strict=True)]
        return Memory(float(data["time"]), {"temperature": np.array(data["temperature"])[rows, None]}, lines,
                      data["step"], power)

    def _gathered(self, own: np.ndarray) -> np.ndarray:
        """Of all ranks, one after the other."""
        return np.concatenate(self._problem.comm.allgather(own))

    def _take(self, T: np.ndarray) -> None:
        """The temperature of the scene, which other problems may have changed, and the constants of this one."""
        here = self._T.x.array[: self._n]
        same = self._seen is not None and np.array_equal(T, self._seen) and np.array_equal(T, here)
        if self._problem.comm.allreduce(int(not same)):
            self._seen = here[:] = T
            self._T.x.scatter_forward()
            self._problem.take_temperature()


def _extremes(temperatures: list[float], laws: Sequence[Any]) -> tuple[float, float]:
    """Between which a body of these temperatures stays under these laws, by the maximum principle."""
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
    """For each point, shape (n, 2), the row of others in which it is; an InputError if it is not there."""
    from scipy.spatial import cKDTree
    others = np.array(others).reshape(-1, 2)
    if not len(points):
        return np.zeros(0, dtype=int)
    away, rows = cKDTree(others).query(points)
    if np.any(away > 1e-9 * np.abs(others).max()):
        raise InputError("what is remembered of the temperature is of another mesh")
    return rows
