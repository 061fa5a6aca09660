"""Heat conduction of a body during forming: the declaration `Cooling` of a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, as_list, check_name, check_type, positive
from ...values.temperature import ABSOLUTE_ZERO
from .boundaries import Convection, FixedTemperature, ThermalProperties, numbers_of
from .contact import ConductingTool, ContactWithTool
from .cooling_history import CoolingHistory
from .run import checked_boundaries, checked_materials

_SUDDEN_CONDUCTANCE = 1e4
"""Conductance that replaces a suddenly prescribed temperature, over conductivity/thickness.

The shrinkage of a part differs by 0.1 % from the limit of an infinite conductance (with 1e3: 0.6 %, with 1e2: 2.5 %;
tests/test_springback.py).
"""

_TOOLS = "a dict of (conductance, tool) by the names of contacts"


class ToolHeat(NamedTuple):
    """Heat exchange of a tool of the scene with the body where they are in contact.

    Attributes:
        conductance: contact conductance, heat per time, area and degree.
        tool: a prescribed temperature, or a `ConductingTool`.
    """

    conductance: float
    tool: float | ConductingTool

    @classmethod
    def of(cls, name: str, given: Any) -> ToolHeat:
        """Return the heat exchange of a contact from the pair (conductance, tool); otherwise an InputError names it."""
        try:
            return cls(*given)
        except TypeError:
            raise InputError(f"Cooling: tools: {name} = {given!r}: must be (conductance, tool)") from None


class Cooling:
    """Heat conduction during forming, which changes the temperature of a scene's body with time.

    In each accepted step the heat equation is solved in the deformed body halfway through the step. This staggered
    scheme is of second order in the step. Temperature-dependent constants have their new values in the next step. Steps
    are shortened so that the temperature, too, is accurate in time (`accuracy` of `Process.run`).

    In a section heat flows in both directions, in a sheet in three dimensions through its thickness only
    (docs/how/warm_tray.md). A law with a name acts in the stages that do not leave it out (`Stage.inactive`).

    Args:
        materials: {layer: `ThermalProperties`}, or one for all layers.
        boundaries: list of `Convection`, `Radiation`, `HeatFlux`, `FixedTemperature`, `ContactWithTool` and
            `Absorption`; several on one boundary add up.
        unit: unit of all temperatures, "C" or "K".
        tools: {name of a contact of the scene: (conductance, tool)}. The conductance is heat per time, area and degree;
            the tool is a prescribed temperature or a `ConductingTool`.
        tolerance: largest estimated error of one time step of the heat equation, degrees.
        work_to_heat: heat per dissipated work of the materials, in the units of both: 1 in SI, 1e-3 for MPa, mm and W.
            It is less if part of the work is stored. None: no heating by work. The work of friction on tools is never
            included.

    Raises:
        InputError: an argument that is not allowed.

    >>> air = fx.Convection("top", h=2e-5, air=20.0)
    >>> polymer = fx.ThermalProperties(conductivity=0.2e-3, density=1e-3, heat_capacity=2.0)
    >>> hot = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=fx.entropic(0.4, 150.0, unit="C")), loads=scene.loads,
    ...                supports=scene.supports, temperature=150.0, heat=fx.Cooling(polymer, [air], unit="C"))
    """

    def __init__(self, materials: ThermalProperties | Mapping[str, ThermalProperties], boundaries: Sequence[Any] = (),
                 *, unit: str, tools: Mapping[str, Any] | None = None, tolerance: float = 0.05,
                 work_to_heat: float | None = None):
        check_name("Cooling: unit", unit, ABSOLUTE_ZERO)
        self.materials, self.unit, self.tolerance = materials, unit, positive("Cooling: tolerance", tolerance)
        self.work_to_heat = None if work_to_heat is None else positive("Cooling: work_to_heat", work_to_heat)
        self.boundaries = as_list("Cooling: boundaries", boundaries, "boundaries, such as Convection(...)")
        tools = {} if tools is None else check_type("Cooling: tools", tools, Mapping, _TOOLS)
        self.tools = {name: ToolHeat.of(name, given) for name, given in tools.items()}

    def __repr__(self) -> str:
        tools = {name: (tool.conductance, tool.tool) for name, tool in self.tools.items()}
        work = f", work_to_heat={self.work_to_heat!r}" * (self.work_to_heat is not None)
        return (f"Cooling({self.materials!r}, {self.boundaries!r}, unit={self.unit!r}, tools={tools!r},"
                f" tolerance={self.tolerance!r}{work})")

    def check(self, scene: Any) -> None:
        """Raise an InputError unless this heat conduction fits a scene.

        Args:
            scene: the `Scene`.

        Raises:
            InputError: the scene has no temperature, or is a membrane in a section; or a law, tool, material or
                `work_to_heat` does not fit.
        """
        if scene.temperature is None:
            raise InputError("Scene: heat: the body needs a temperature to begin with: temperature=...")
        if scene.kinematics.components == 3:
            scene.kinematics.scene_checks.check_heat(scene, self)
        elif not scene.model.solid:
            raise InputError("Scene: heat: a membrane has no thickness to conduct through: use a solid model")
        if self.work_to_heat and not any(material.internal for material in scene.materials.values()):
            raise InputError(f"Scene: heat: work_to_heat = {self.work_to_heat:g}: no material of the scene dissipates"
                             f" work: give one that relaxes, or leave it out")
        items = [item.name for item in scene.items if item.name]
        for law in self.boundaries:
            if getattr(law, "name", None) in items:
                raise InputError(f"Cooling: {law!r}: name: an item of the scene is called {law.name!r}: must be another"
                                 f" name")
        zero = ABSOLUTE_ZERO[self.unit]
        checked_materials(scene.mesh, self.materials)
        checked_boundaries(scene.mesh, [*self.boundaries, *self.contacts_with_tools(scene)], zero)

    def without_tools(self, mesh: Any, thickness: float, boundaries: Any) -> Cooling:
        """Return the heat conduction of a part after demoulding: without tools, with other laws at the faces.

        A prescribed temperature of a face would change the stress at once by a finite amount. It is replaced by
        convection with a large conductance: `_SUDDEN_CONDUCTANCE` times the conductivity over the thickness.

        Args:
            mesh: `Mesh` of the body.
            thickness: largest wall of the body, length.
            boundaries: list of laws of heat, or {boundary: prescribed temperature}.

        Returns:
            A new `Cooling`.

        Raises:
            InputError: `boundaries` is neither a list of laws nor a dict.
        """
        laws = [FixedTemperature(name, temperature=T) for name, T in boundaries.items()] if isinstance(
            boundaries, Mapping) else as_list("Path.springback: boundaries", boundaries,
                                              "boundaries, such as Convection(...)")
        conductivity = max(m.conductivity for m in checked_materials(mesh, self.materials).values())
        h = _SUDDEN_CONDUCTANCE * conductivity / thickness
        laws = [Convection(law.on, h=h, air=law.parameters["temperature"]) if isinstance(law, FixedTemperature) else law
                for law in laws]
        return Cooling(self.materials, laws, unit=self.unit, tolerance=self.tolerance, work_to_heat=self.work_to_heat)

    def time_through(self, mesh: Any, thickness: float) -> float:
        r"""Return the time in which heat diffuses through a wall, in the layer of smallest diffusivity.

        .. math:: t = \frac{h^2}{a}

        Args:
            mesh: the `Mesh`, for its layers.
            thickness: thickness h of the wall, length.

        Returns:
            Time t, with the smallest diffusivity a of the layers.
        """
        return thickness**2 / min(m.diffusivity for m in checked_materials(mesh, self.materials).values())

    def history(self, problem: Any) -> Any:
        """Return the history variables of the temperature for a run.

        Args:
            problem: the `Problem` of the run.

        Returns:
            A `CoolingHistory`, or the history that the formulation of the body makes (`heat_history`).
        """
        make = getattr(problem.forms, "heat_history", CoolingHistory)
        return make(self, problem)

    def extremes(self, scene: Any) -> tuple[float, float]:
        """Return bounds of the temperature of the body by the maximum principle, without heating by work; collective.

        The bounds are the extremes of the initial temperature and of the temperatures of air, heaters, tools and faces.

        Args:
            scene: the `Scene`, with the initial temperature.

        Returns:
            Lowest and highest temperature; -inf and inf if there is a `HeatFlux` or an `Absorption`.
        """
        first = scene.temperature.T.x.array
        ends = scene.mesh.comm.allgather((first.min(initial=np.inf), first.max(initial=-np.inf)))
        return _extremes([*np.ravel(ends)], [*self.boundaries, *self.contacts_with_tools(scene)])

    def conductances(self, scene: Any) -> dict[str, float]:
        """Return the largest heat transfer coefficient or contact conductance at each boundary.

        Args:
            scene: the `Scene`.

        Returns:
            {boundary: conductance, heat per time, area and degree}; inf for a prescribed temperature. Boundaries
            without convection, tool or prescribed temperature are left out.
        """
        found: dict[str, float] = {}
        for law in [*self.boundaries, *self.contacts_with_tools(scene)]:
            given = np.inf if isinstance(law, FixedTemperature) else getattr(law, "conductance", None) or getattr(
                law, "parameters", {}).get("h", 0.0)
            found[law.on] = max(*numbers_of(given), found.get(law.on, 0.0))
        return {on: value for on, value in found.items() if value}

    def conducts(self, contact: Any) -> bool:
        """Check whether the tool of a contact exchanges heat with the body.

        Args:
            contact: the `Contact`.

        Returns:
            True if `tools` has its name.
        """
        return contact.name in self.tools

    def contacts_with_tools(self, scene: Any) -> list[ContactWithTool]:
        """Return a law of heat for each contact of a scene whose tool exchanges heat.

        The laws hold for contact at all nodes. A run sets the conductance to 0 at nodes away from the tool.

        Args:
            scene: the `Scene`.

        Returns:
            A `ContactWithTool` for each contact named in `tools`, in the order of the scene.

        Raises:
            InputError: `tools` names a contact that the scene does not have.
        """
        names = [contact.name for contact in scene.contacts]
        for name in self.tools:
            check_name("Cooling: tools: contact", name, names)
        touching = [(contact, self.tools[contact.name]) for contact in scene.contacts if self.conducts(contact)]
        return [ContactWithTool(contact.on, conductance=given.conductance, tool=given.tool)
                for contact, given in touching]


def _extremes(temperatures: list[float], laws: Sequence[Any]) -> tuple[float, float]:
    """Return bounds of the temperature by the maximum principle; -inf and inf if a law prescribes a bare flux."""
    for law in laws:
        if not getattr(law, "temperatures", ()):            # a flux without a temperature has no bound
            return -np.inf, np.inf
        touches = isinstance(law, ContactWithTool)
        for value in [law.tool] if touches else [law.parameters[name] for name in law.temperatures]:
            temperatures += [value.back, value.start] if isinstance(value, ConductingTool) else numbers_of(value)
    return min(temperatures), max(temperatures)
