"""Scene: a body with materials, supports, loads and contacts as a user declares it, checked before anything is solved.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from ..errors import InputError, as_list, call_on_all_ranks, check_name, count
from ..materials.constants import OfMesh, Sample
from ..materials.hyperelastic import Material
from ..mesh.contact_columns import for_contacts
from ..mesh.mesh import Mesh
from ..mesh.nodes import span
from ..physics.contact import Contact
from ..physics.contact_arguments import MAX_DEGREE
from ..physics.kinematics import Axisymmetric, Kinematics, ThreeD
from ..physics.loads import Load
from ..physics.models import Membrane, MixedPressure, Model
from ..physics.part import ScenePart
from ..physics.supports import Support
from . import boundary_checks, contact_checks, support_checks
from .sampling import sample
from .summary import summary
from .symmetry import NO_PLANES, MirrorPlanes, mirror_planes
from .temperature import Expansion, GivenTemperature

log = logging.getLogger("formingx")



class Scene:
    """Body with its materials, supports, loads and contacts.

    Args:
        mesh: mesh of the body, from `formingx.mesh`.
        materials: {layer name: material}, or one material for all layers.
        supports: list of supports, see `formingx.physics.supports`.
        loads: list of loads, see `formingx.physics.loads`. A run controls one load, support or tool; a
            `formingx.Process` controls several.
        contacts: list of contacts of faces with rigid tools, see `formingx.Contact`. Contacts with the same `direction`
            and name are contacts of one tool with several faces.
        model: `MixedPressure()` or `DisplacementPenalty()` for a solid, or `Membrane()`. The default is
            `MixedPressure()`, in three dimensions `Membrane()`.
        kinematics: `Axisymmetric()` (default) or `PlaneStrain()`; for a sheet in three dimensions `ThreeD()`.
        quadrature_degree: degree of the quadrature rule of the energy, at most 30. The default is 5 (seven points), the
            rule of Song (1993); in three dimensions 1.
        temperature: temperature of the body, on which material constants may depend. It is a number, a `table` over R,
            a function of arrays (R, Z), or a CSV file with columns R, Z, T. It may also be the result of
            `formingx.heat`, or a DOLFINx Function.
        heat: `Cooling(...)` for a temperature that changes with time.
        expansion: thermal expansion, a `ThermalExpansion` for all layers, or {layer: `ThermalExpansion`}.
        thickness: thickness of a sheet in three dimensions: a length, a function of arrays (x, y), or {layer: either}.
        state_transfer: deformation transferred from another mesh; only remeshing (`trace(remesh=)`) sets it.

    Attributes:
        mesh: mesh of the body. For a scene with tools its elements may differ from the given mesh: they are chosen for
            the tools, unless `elements` was given to `formingx.mesh.disc`.
        materials: {layer name: material}.
        supports: list of supports.
        loads: list of loads.
        contacts: list of contacts.
        model: the model of the body.
        kinematics: the kinematics.
        quadrature_degree: degree of the quadrature of the energy.
        temperature: initial temperature (`GivenTemperature`), or None.
        heat: the `Cooling`, or None.
        expansion: {layer: law of thermal expansion}.
        thickness: {layer: thickness} of a sheet in three dimensions, else empty.
        symmetry: mirror planes of the body (`MirrorPlanes`).
        state_transfer: deformation transferred from another mesh, or None.

    Raises:
        InputError: a boundary or a layer is unknown or empty, a layer has no material, or the supports are too few.
            Elements overlap or are inverted, or the mesh reaches R < 0. Two controlled items have the same name or no
            names. An argument is not allowed.

    >>> print(scene)
    mesh               16 six-node triangles, 10 by 0.3 (R, Z); layers: sheet; boundaries: axis, rim, bottom, top
    material of sheet  NeoHookean(c10=0.4)
    support 1          Symmetry('axis', 'r')
    support 2          SimplySupported('rim')
    load 1             Pressure('bottom') (driven)
    model              MixedPressure()
    kinematics         Axisymmetric()
    quadrature degree  5
    """

    def __init__(self, *, mesh: Mesh, materials: Material | Mapping[str, Material], supports: Sequence[Any],
                 loads: Sequence[Any] = (), contacts: Sequence[Contact] = (), model: Any = None, kinematics: Any = None,
                 quadrature_degree: int | None = None, temperature: Any = None, heat: Any = None,
                 expansion: Any = None, thickness: Any = None, state_transfer: Any = None):
        if not isinstance(mesh, Mesh):
            raise InputError(f"Scene: mesh = {mesh!r}: must come from formingx.mesh (disc, read, ...)")
        if isinstance(materials, Material):
            materials = dict.fromkeys(mesh.layers, materials)
        if not isinstance(materials, Mapping):
            raise InputError(f"Scene: materials = {materials!r}: must be a formingx material, or {{layer: material}}")
        mesh.check()                                           # a script may have moved its nodes
        if state_transfer is not None and not hasattr(state_transfer, "gradient"):
            raise InputError(f"Scene: state_transfer = {state_transfer!r}: must be what trace(remesh=) makes, or None")
        self.mesh, self.state_transfer = mesh, state_transfer
        self._extent = np.ptp(span(mesh.domain, mesh.comm), axis=0)
        self.materials = dict(materials)
        self.supports = _checked_items(Support, "supports", supports, "supports, such as Clamped('rim')")
        self.loads = _checked_items(Load, "loads", loads, "loads, such as Pressure('bottom')")
        self.contacts = _checked_items(Contact, "contacts", contacts, "Contact(...)")
        in_space = mesh.domain.geometry.dim == 3
        self.model: Any = model if model is not None else Membrane() if in_space else MixedPressure()
        if not isinstance(self.model, Model):
            raise InputError(f"Scene: model = {model!r}: must be a MixedPressure, a DisplacementPenalty or a Membrane")
        self.kinematics = kinematics if kinematics is not None else ThreeD() if in_space else Axisymmetric()
        if not isinstance(self.kinematics, Kinematics) or (self.kinematics.components == 3) != in_space:
            raise InputError(f"Scene: kinematics = {kinematics!r}: must be Axisymmetric() or PlaneStrain(), of a sheet"
                             f" in three dimensions ThreeD()")
        if state_transfer is None and not self._has_constants_of_mesh():
            self.mesh = for_contacts(mesh, self.contacts, self.kinematics.axisymmetric, heat is not None)
            if self.mesh is not mesh:
                log.info("elements chosen for the tools: %d columns instead of %d",
                         *(len(found.columns.ends) - 1 for found in (self.mesh, mesh) if found.columns is not None))
            mesh = self.mesh
        usual = 1 if in_space else 5
        self.quadrature_degree = count("Scene: quadrature_degree",
                                       usual if quadrature_degree is None else quadrature_degree)
        if self.quadrature_degree > MAX_DEGREE:
            raise InputError(f"Scene: quadrature_degree = {quadrature_degree!r}: must be at most {MAX_DEGREE}")
        if temperature is not None:
            self.temperature = GivenTemperature(temperature, mesh)
        if expansion is not None:
            self.expansion = self._checked_expansion(expansion)
        if in_space:
            if self.kinematics.scene_checks is None:
                raise InputError("Scene: mesh: is three-dimensional: the extension 'space' of formingx is not"
                                 " installed")
            self.thickness = self.kinematics.scene_checks.thicknesses(self, thickness)
            self.kinematics.scene_checks.refuse(self, heat)
        elif thickness is not None:
            raise InputError(f"Scene: thickness = {thickness!r}: is for a sheet in three dimensions; a section has one"
                             f" already")
        self._check_names()
        self._check_materials()
        if self.kinematics.components == 3:
            self.kinematics.scene_checks.check_laws(self)
        boundary_checks.check(self)
        if (planes := mirror_planes(self)).planes:
            self.symmetry = planes
        support_checks.check_held(self, self.supports)
        self.model.check(self)
        if self.model.solid:
            support_checks.check_hinges(self)
        for contact in self.contacts if state_transfer is None else ():      # after remeshing they have moved
            contact_checks.check_start(self, contact)
        if heat is not None:
            if not hasattr(heat, "check") or isinstance(heat, type):
                raise InputError(f"Scene: heat = {heat!r}: must be a Cooling(...)")
            heat.check(self)
            self.heat = heat

    one_node_per_step = False
    """True if at most one node comes into contact in a step, for contacts with nodes_per_step=None."""

    temperature: GivenTemperature | None = None
    heat: Any = None
    expansion: Mapping[str, Expansion] = MappingProxyType({})
    thickness: Mapping[str, Any] = MappingProxyType({})
    symmetry: MirrorPlanes = NO_PLANES

    @property
    def symmetry_factor(self) -> int:
        """Number of images of the modelled body in the whole part, such as 4 for a quarter (`Symmetry`)."""
        return self.symmetry.factor

    @property
    def first(self) -> Scene:
        """Scene on the first mesh of a run with remeshing; this scene itself unless remeshing made it."""
        return self if self.state_transfer is None else self.state_transfer.before[0].scene.first

    def with_mesh(self, mesh: Mesh, state_transfer: Any = None, temperature: Any = None) -> Scene:
        """Return this scene with another mesh of the body.

        Args:
            mesh: the new mesh, with the same names of layers and boundaries.
            state_transfer: deformation transferred from the present mesh, or None.
            temperature: temperature on the new mesh; None for the temperature given to this scene.

        Returns:
            The new scene.
        """
        if temperature is None and self.temperature is not None:
            temperature = self.temperature.given
        return Scene(mesh=mesh, materials=self.materials, supports=self.supports, loads=self.loads,
                     contacts=self.contacts, model=self.model, kinematics=self.kinematics,
                     quadrature_degree=self.quadrature_degree, heat=self.heat, expansion=self.expansion or None,
                     thickness=self.thickness or None, state_transfer=state_transfer,
                     temperature=temperature)

    @property
    def items(self) -> list[ScenePart]:
        """Loads, then supports, then contacts of the scene. The number of an item is its index in this list, from 0."""
        return [*self.loads, *self.supports, *self.contacts]

    @property
    def heat_laws(self) -> dict[str, list[int]]:
        """Named laws of heat of the scene, {name: numbers of the laws with this name}, for `Stage.inactive`.

        The numbers follow those of `items` and of the process time, in the order of `Cooling.boundaries`.
        """
        found: dict[str, list[int]] = {}
        for k, law in enumerate([] if self.heat is None else self.heat.boundaries, len(self.items) + 1):
            if getattr(law, "name", None):
                found.setdefault(law.name, []).append(k)
        return found

    @property
    def drivable(self) -> list[Any]:
        """Items whose pressure, displacement or travel a run can control; of a moving tool only the first contact."""
        return [item for i, item in enumerate(self.items)
                if item.driven and self.same_tool(i)[0] == i]

    def same_tool(self, number: int) -> list[int]:
        """Return the numbers in `items` of all contacts of the same moving tool, with the same `direction` and name.

        They are ascending; for an item without `direction` it is its own number.
        """
        item = self.items[number]
        if item.direction is None:
            return [number]
        return [i for i, other in enumerate(self.items)
                if (other.direction, other.name) == (item.direction, item.name)]

    @property
    def driven(self) -> Any:
        """Load, support or contact that a run controls, if exactly one can be controlled; else None."""
        drivable = self.drivable
        return drivable[0] if len(drivable) == 1 else None

    def only_driven(self, caller: str) -> Any:
        """Return the item that a run with one control controls; raise `InputError` for none or several.

        Another support must not constrain the component of a controlled support. caller: name for messages.
        """
        if not self.drivable:
            raise InputError(f"{caller}: nothing is driven: give one load no value, as Pressure('bottom'), or"
                             " add a PrescribedDisplacement support")
        if len(self.drivable) > 1:
            raise InputError(f"{caller}: {', '.join(map(repr, self.drivable))} are all driven: one control drives a"
                             f" run; give the others a value, or drive them in stages with formingx.Process")
        support_checks.check_driven(self.supports)
        return self.driven

    def number(self, caller: str, item: Any) -> int:
        """Return the number in `items` of a load, support or contact, or of its name; raise `InputError` without it.

        caller: name of the calling function, for the message.
        """
        for i, own in enumerate(self.items):
            if item is own or isinstance(item, str) and item == own.name:
                return i
        names = [t.name for t in self.items if t.name]
        raise InputError(f"{caller}: {item!r} is not in the scene; it has {', '.join(map(repr, self.items))}"
                         + (f"; by name {', '.join(map(repr, names))}" if names else ""))

    def column(self, item: Any) -> str:
        """Return the name of the column of a `Path` with the pressure or the travel of an item that can be controlled.

        It is preceded by the name of the item if several items can be controlled.
        """
        alone = len(self.drivable) == 1 or not item.name
        return item.quantity if alone else f"{item.name}_{item.quantity}"

    def _has_constants_of_mesh(self) -> bool:
        """Return True if a material constant is a UFL expression of the given mesh, so that the mesh must be kept."""
        return any(isinstance(constant, OfMesh) for material in self.materials.values()
                   if isinstance(material, Material) for constant in material.constants().values())

    def _check_names(self) -> None:
        """Raise an InputError unless the names of items and of columns of controlled items are unique."""
        names = [item.name for item in self.items if item.name is not None]
        for name in names:
            if not isinstance(name, str) or not name:
                raise InputError(f"Scene: name = {name!r}: must be a word")
            called = [i for i, item in enumerate(self.items) if item.name == name]
            if called != self.same_tool(called[0]) and len(called) > 1:
                raise InputError(f"Scene: two items are called {name!r}: names must differ")
        columns = [self.column(item) for item in self.drivable]
        for column in columns:
            if columns.count(column) > 1:
                same = [repr(t) for t in self.drivable if self.column(t) == column]
                raise InputError(f"Scene: {', '.join(same)} are all driven: one control drives a run: give the others a"
                                 f" value, or each a name=... and drive them in stages with formingx.Process")

    def _check_materials(self) -> None:
        """Raise an InputError unless each layer has a valid material; store the shear moduli of the layers."""
        layers = self.mesh.layers
        for name, material in self.materials.items():
            check_name("Scene: materials: layer", name, layers)
            if not isinstance(material, Material):
                raise InputError(f"Scene: materials[{name!r}] = {material!r}: must be a formingx material")
        missing = [name for name in layers if name not in self.materials]
        if missing:
            raise InputError(f"Scene: layer {', '.join(map(repr, missing))} has no material;"
                             f" materials are given for {', '.join(map(repr, self.materials)) or 'none'}")
        self._moduli = {name: self._checked_modulus(name, self.materials[name]) for name in layers}

    def _checked_modulus(self, layer: str, material: Material) -> float:
        """Return the largest shear modulus of a layer, stress; check its material at every quadrature point."""
        if not material.varies:
            material.check()
            return material.shear_modulus
        points = self.sample(layer)
        refused, mine = None, -np.inf
        try:
            material.check(points)
            mine = float(material.shear_modulus_at(points).max(initial=-np.inf))
        except InputError as error:
            refused = str(error)
        found = self.mesh.comm.allgather((refused, mine))                   # all ranks refuse, with one message
        for message in (text for text, _ in found if text is not None):
            raise InputError(f"Scene: layer {layer!r}: {message}")
        return max(modulus for _, modulus in found)

    def _checked_expansion(self, given: Any) -> dict[str, Expansion]:
        """Return {layer: law of thermal expansion} from the argument `expansion`, checked at all quadrature points."""
        laws = dict.fromkeys(self.mesh.layers, given) if isinstance(given, Expansion) else given
        if not isinstance(laws, Mapping) or not all(isinstance(law, Expansion) for law in laws.values()):
            raise InputError(f"Scene: expansion = {given!r}: must be ThermalExpansion(...), or {{layer: ...}}")
        if self.temperature is None:
            raise InputError("Scene: expansion: depends on the temperature: give Scene a temperature=...")
        for layer, law in laws.items():
            check_name("Scene: expansion: layer", layer, self.mesh.layers)
            T: Any = sample(self.mesh, layer, self.quadrature_degree, self.temperature).temperature
            call_on_all_ranks(self.mesh.comm, [partial(law.stretch, T)])
        return dict(laws)

    def sample(self, layer: str) -> Sample:
        """Return the quadrature points of the energy in a layer, with their positions on the first mesh of the run."""
        check_name("Scene.sample: layer", layer, self.mesh.layers)
        found = sample(self.mesh, layer, self.quadrature_degree, self.temperature)
        if self.state_transfer is None:
            return found
        return found._replace(points=self.state_transfer.original_positions(found.points))

    def shear_modulus(self, layer: str) -> float:
        """Return the small-strain shear modulus of a layer, stress; the largest one if constants vary over the body."""
        check_name("Scene: layer", layer, self._moduli)
        return self._moduli[layer]

    @property
    def extent(self) -> np.ndarray:
        """Extent of the body along R and Z, in three dimensions x, y and z, shape (2 or 3,), length."""
        return self._extent

    def __str__(self) -> str:
        lines = summary(self)
        width = max(map(len, lines))
        return "\n".join(f"{part:{width}}  {line}" for part, line in lines.items())


def _checked_items(kind: type, name: str, scene_items: Any, what: str) -> list[Any]:
    """Return an argument, named `name`, as a list of objects of `kind`, described by `what`, else an InputError."""
    scene_items = as_list(f"Scene: {name}", scene_items, what)
    for item in scene_items:
        if not isinstance(item, kind):
            raise InputError(f"Scene: {name}: {item!r} is not allowed here: must be a list of {what}")
    return scene_items
