"""Scene as a user declares it, checked before anything is solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError, count, known, several, together
from ..materials.constants import Sample
from ..materials.hyperelastic import Material
from ..mesh.mesh import Mesh
from ..mesh.nodes import of_mesh, span
from ..physics.contact import Contact
from ..physics.kinematics import Axisymmetric, Kinematics, ThreeD
from ..physics.loads import Load
from ..physics.models import Membrane, MixedPressure, Model
from ..physics.part import Part
from ..physics.supports import Constrained, Support
from ..ranks import gathered
from . import tool_width
from .sampling import sample
from .summary import summary
from .symmetry import NO_PLANES, MirrorPlanes, mirror_planes
from .temperature import Expansion, GivenTemperature

_HIGHEST = 30
"""Largest degree of a quadrature: a higher one is a mistake, and its points would fill the memory."""


_LARGER = 4.0
"""Ratio of sizes from which on a body that starts inside a tool is probably in another unit of length."""


class Scene:
    """A body with its materials, supports, loads and contacts.

    Args:
        mesh: from `formingx.mesh`.
        materials: {layer name: material}, or one material for all layers.
        supports: see `formingx.physics.supports`.
        loads: see `formingx.physics.loads`. A run controls one load, support or tool; a `formingx.Process` controls
            several. Contacts of one tool with several faces, of the same `direction` and name, count as one.
        contacts: contacts of faces with rigid tools, see `formingx.Contact`.
        model: `MixedPressure()` (default) or `DisplacementPenalty()`, a solid; `Membrane()`.
        kinematics: `Axisymmetric()` (default) or `PlaneStrain()`; of a sheet in three dimensions `ThreeD()`.
        quadrature_degree: of the energy, at most 30; default 5 (seven points), the thesis' rule; in three dimensions 1.
        thickness: of a sheet in three dimensions: a length, a function of arrays (x, y), or {layer: either of them}.
        temperature: of the body, which constants of materials may depend on: a number, a `table` over R, a function of
            arrays (R, Z), a CSV file with columns R, Z, T, the result of `formingx.heat`, or a DOLFINx Function.
        heat: `Cooling(...)`: the temperature changes as time goes by.
        expansion: a `ThermalExpansion` for all layers, or {layer: `ThermalExpansion`}: free strain by the temperature.
        preformed: deformation transferred from another mesh (`trace(remesh=)`).

    Raises:
        InputError: an unknown or empty tag, a layer without material, too little support, a mesh with R < 0, or whose
            elements lie over each other or are inside out, two driven objects that no name tells apart.

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
                 expansion: Any = None, thickness: Any = None, preformed: Any = None):
        if not isinstance(mesh, Mesh):
            raise InputError(f"Scene: mesh = {mesh!r}: must come from formingx.mesh (disc, read, ...)")
        if isinstance(materials, Material):
            materials = dict.fromkeys(mesh.layers, materials)
        if not isinstance(materials, Mapping):
            raise InputError(f"Scene: materials = {materials!r}: must be a formingx material, or {{layer: material}}")
        mesh.check()                                           # its nodes may have been moved
        if preformed is not None and not hasattr(preformed, "gradient"):
            raise InputError(f"Scene: preformed = {preformed!r}: must be what trace(remesh=) makes, or None")
        self.mesh, self.preformed = mesh, preformed
        self._extent = np.ptp(span(mesh.domain, mesh.comm), axis=0)
        self.materials = dict(materials)
        self.supports = _all_of(Support, "supports", supports, "supports, such as Clamped('rim')")
        self.loads = _all_of(Load, "loads", loads, "loads, such as Pressure('bottom')")
        self.contacts = _all_of(Contact, "contacts", contacts, "Contact(...)")
        in_space = mesh.domain.geometry.dim == 3
        self.model: Any = model if model is not None else Membrane() if in_space else MixedPressure()
        if not isinstance(self.model, Model):
            raise InputError(f"Scene: model = {model!r}: must be a MixedPressure, a DisplacementPenalty or a Membrane")
        self.kinematics = kinematics if kinematics is not None else ThreeD() if in_space else Axisymmetric()
        if not isinstance(self.kinematics, Kinematics) or (self.kinematics.components == 3) != in_space:
            raise InputError(f"Scene: kinematics = {kinematics!r}: must be Axisymmetric() or PlaneStrain(), of a sheet"
                             f" in space ThreeD()")
        usual = 1 if in_space else 5
        self.quadrature_degree = count("Scene: quadrature_degree",
                                       usual if quadrature_degree is None else quadrature_degree)
        if self.quadrature_degree > _HIGHEST:
            raise InputError(f"Scene: quadrature_degree = {quadrature_degree!r}: must be at most {_HIGHEST}")
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
            raise InputError(f"Scene: thickness = {thickness!r}: is for a sheet in space; a section has one already")
        self._check_names()
        self._check_materials()
        self._check_boundaries()
        if (planes := mirror_planes(self)).planes:
            self.symmetry = planes
        self.check_held(self.supports)
        self.model.check(self)
        if self.model.solid:
            self._check_hinges()
        for contact in self.contacts if preformed is None else ():      # else tools have moved already
            self._check_contact(contact)
        if heat is not None:
            if not hasattr(heat, "check") or isinstance(heat, type):
                raise InputError(f"Scene: heat = {heat!r}: must be a Cooling(...)")
            heat.check(self)
            self.heat = heat

    one_by_one = False
    """True: one node comes into contact in a step, for contacts with nodes_per_step=None."""

    temperature: GivenTemperature | None = None
    heat: Any = None
    expansion: Mapping[str, Expansion] = MappingProxyType({})
    thickness: Mapping[str, Any] = MappingProxyType({})
    symmetry: MirrorPlanes = NO_PLANES

    @property
    def symmetry_factor(self) -> int:
        """Number of images of the body that make the whole part: 4 for a quarter (`Symmetry`)."""
        return self.symmetry.factor

    @property
    def first(self) -> Scene:
        """The scene on the mesh that its run began with."""
        return self if self.preformed is None else self.preformed.before[0].scene.first

    def with_mesh(self, mesh: Mesh, preformed: Any = None, temperature: Any = None) -> Scene:
        """Return the same scene on another mesh of the body, with the same names of layers and boundaries.

        temperature: temperature on the new mesh; None: the temperature of this scene.
        """
        if temperature is None and self.temperature is not None:
            temperature = self.temperature.given
        return Scene(mesh=mesh, materials=self.materials, supports=self.supports, loads=self.loads,
                     contacts=self.contacts, model=self.model, kinematics=self.kinematics,
                     quadrature_degree=self.quadrature_degree, heat=self.heat, expansion=self.expansion or None,
                     thickness=self.thickness or None, preformed=preformed,
                     temperature=temperature)

    @property
    def items(self) -> list[Part]:
        """Loads, supports and contacts, in order."""
        return [*self.loads, *self.supports, *self.contacts]

    @property
    def drivable(self) -> list[Any]:
        """Items that can be controlled; of a tool that meets several faces its first contact."""
        return [item for i, item in enumerate(self.items)
                if item.driven and self.together(i)[0] == i]

    def together(self, number: int) -> list[int]:
        """Return the numbers of the contacts of one tool: those with the same `direction` and name."""
        item = self.items[number]
        if item.direction is None:
            return [number]
        return [i for i,
                other in enumerate(self.items) if (other.direction, other.name) == (item.direction, item.name)]

    @property
    def driven(self) -> Any:
        """Controlled item of a run with one control: the only one that can be controlled, or None."""
        drivable = self.drivable
        return drivable[0] if len(drivable) == 1 else None

    def only_driven(self, caller: str) -> Any:
        """Return `driven`; raise an InputError unless exactly one item can be driven."""
        if not self.drivable:
            raise InputError(f"{caller}: nothing is driven: give one load no value, as Pressure('bottom'), or"
                             " add a PrescribedDisplacement support")
        if len(self.drivable) > 1:
            raise InputError(f"{caller}: {', '.join(map(repr, self.drivable))} are all driven: one control drives a"
                             f" run;"
                             f" give the others a value, or drive them in stages with formingx.Process")
        self.check_driven(self.supports)
        return self.driven

    def number(self, caller: str, item: Any) -> int:
        """Return the number in `items` of an item, given itself or by name; raise an InputError if it is not there."""
        for i, own in enumerate(self.items):
            if item is own or isinstance(item, str) and item == own.name:
                return i
        names = [t.name for t in self.items if t.name]
        raise InputError(f"{caller}: {item!r} is not in the scene; it has {', '.join(map(repr, self.items))}"
                         + (f"; by name {', '.join(map(repr, names))}" if names else ""))

    def column(self, item: Any) -> str:
        """Name of the column of a controllable item: "pressure" or "travel", its name in front if there are several."""
        alone = len(self.drivable) == 1 or not item.name
        return item.quantity if alone else f"{item.name}_{item.quantity}"

    def check_held(self, supports: Sequence[Any], touched: bool = False) -> None:
        """Raise an InputError unless these supports constrain the axis and, if no tool touches, every rigid motion."""
        self._check_axis(supports)
        if not touched:
            self._check_rigid_body(supports)

    def check_driven(self, supports: Sequence[Any]) -> None:
        """Raise an InputError if one of these supports drives a component that another one constrains."""
        held = [(support, h) for support in supports for h in support.constraints()]
        for mine, driven in held:
            for other, h in held if driven.driven else ():
                if other is not mine and (h.on, h.component) == (driven.on, driven.component):
                    raise InputError(f"{mine!r}: {other!r} holds the same component of the same boundary")

    def _check_names(self) -> None:
        names = [item.name for item in self.items if item.name is not None]
        for name in names:
            if not isinstance(name, str) or not name:
                raise InputError(f"Scene: name = {name!r}: must be a word")
            called = [i for i, item in enumerate(self.items) if item.name == name]
            if called != self.together(called[0]) and len(called) > 1:
                raise InputError(f"Scene: two things are called {name!r}: names must differ")
        columns = [self.column(item) for item in self.drivable]
        for column in columns:
            if columns.count(column) > 1:
                same = [repr(t) for t in self.drivable if self.column(t) == column]
                raise InputError(f"Scene: {', '.join(same)} are all driven: one control drives a run: give the others a"
                                 f" value, or each a name=... and drive them in stages with formingx.Process")

    def _check_materials(self) -> None:
        layers = self.mesh.layers
        for name, material in self.materials.items():
            known("Scene: materials: layer", name, layers)
            if not isinstance(material, Material):
                raise InputError(f"Scene: materials[{name!r}] = {material!r}: must be a formingx material")
        missing = [name for name in layers if name not in self.materials]
        if missing:
            raise InputError(f"Scene: layer {', '.join(map(repr, missing))} has no material;"
                             f" materials are given for {', '.join(map(repr, self.materials)) or 'none'}")
        self._moduli = {name: self._checked_modulus(name, self.materials[name]) for name in layers}

    def _checked_modulus(self, layer: str, material: Material) -> float:
        """Return `shear_modulus` of a layer; check its material at every quadrature point of the energy."""
        if not material.varies:
            material.check()
            return material.shear_modulus
        looked_at = self.sample(layer)
        refused, mine = None, -np.inf
        try:
            material.check(looked_at)
            mine = float(material.shear_modulus_at(looked_at).max(initial=-np.inf))
        except InputError as error:
            refused = str(error)
        found = self.mesh.comm.allgather((refused, mine))                   # all ranks refuse, with one message
        for message in (text for text, _ in found if text is not None):
            raise InputError(f"Scene: layer {layer!r}: {message}")
        return max(modulus for _, modulus in found)

    def _checked_expansion(self, given: Any) -> dict[str, Expansion]:
        """Return {layer: its law of expansion}, checked at the temperature of every point."""
        laws = dict.fromkeys(self.mesh.layers, given) if isinstance(given, Expansion) else given
        if not isinstance(laws, Mapping) or not all(isinstance(law, Expansion) for law in laws.values()):
            raise InputError(f"Scene: expansion = {given!r}: must be ThermalExpansion(...), or {{layer: ...}}")
        if self.temperature is None:
            raise InputError("Scene: expansion: depends on the temperature: give Scene a temperature=...")
        for layer, law in laws.items():
            known("Scene: expansion: layer", layer, self.mesh.layers)
            looked_at: Any = sample(self.mesh, layer, self.quadrature_degree, self.temperature).temperature
            together(self.mesh.comm, [partial(law.stretch, looked_at)])
        return dict(laws)

    def sample(self, layer: str) -> Sample:
        """Return the quadrature points of the energy in a layer, as they are on the first mesh."""
        known("Scene.sample: layer", layer, self.mesh.layers)
        found = sample(self.mesh, layer, self.quadrature_degree, self.temperature)
        return found if self.preformed is None else found._replace(points=self.preformed.first_places(found.points))

    def shear_modulus(self, layer: str) -> float:
        """Modulus of small shear of a layer, stress; of constants that vary the largest in it, all ranks."""
        known("Scene: layer", layer, self._moduli)
        return self._moduli[layer]

    def _check_boundaries(self) -> None:
        for item in self.items:
            on = item.on
            if on is None:
                continue
            known(f"{item!r}: boundary", on, self.mesh.boundaries)
            if self.mesh.comm.allreduce(len(self.mesh.facets_of(on)), MPI.SUM) == 0:
                raise InputError(f"{item!r}: boundary {on!r} is empty: no facet of the mesh carries it")

    def _check_contact(self, contact: Contact) -> None:
        """Raise an InputError unless the body starts outside the tool and its face is the nearest one to the tool.

        Its friction must have a value at the temperatures of the face, and no driven pressure may act on the face.
        """
        contact.friction_at(None if self.temperature is None else self.temperature.on(contact.on))
        mesh, near = self.mesh, 1e-6 * max(self.extent)
        if self.kinematics.components != contact.tool.components:
            raise InputError(f"{contact!r}: a section takes tools drawn in its plane, a sheet in space those of"
                             f" fx.tools.solid, box, revolved or extruded")
        if contact.tool.components == 3:
            self.kinematics.scene_checks.check_contact(self, contact)
            return
        if self.kinematics.axisymmetric and contact.direction and contact.direction[0] \
                and contact.tool.bounds[0, 0] <= near:
            raise InputError(f"{contact!r}: it moves along R, but its tool covers the axis: no rigid tool of revolution"
                             f" does that; must be direction=(0, ...), or PlaneStrain()")
        face = mesh.nodes_of(contact.on)
        comm = mesh.comm
        points = gathered(comm, of_mesh(mesh.domain))
        depth = contact.tool.signed_distance(points)
        worst = int(np.argmax(depth))
        if depth[worst] > near:
            free = contact.tool.reversed().signed_distance(points).max() <= near
            size, length = np.ptp(contact.tool.bounds, axis=0).max(), max(self.extent)
            why = ("; the other side of its profile is free of it: use tool.reversed()" if free else "")
            if not length < _LARGER * size:
                why = (f"; the tool is {size:.4g} large, the body {length:.4g}: are the units of length the same (mm"
                       f" and cm)?")
            raise InputError(f"{contact!r}: the body starts inside the tool: {depth[worst]:.6g} deep at (R, Z) ="
                             f" ({points[worst, 0]:.6g}, {points[worst, 1]:.6g}){why}")
        if depth[worst] > contact.tool.signed_distance(face).max() + near:
            raise InputError(f"{contact!r}: the tool is behind this face of the body: another face is closer to it;"
                             f" boundaries are {list(mesh.boundaries)}")
        if any(load is self.driven and load.on == contact.on for load in self.loads):
            raise InputError(f"{contact!r}: the driven pressure acts on the same face and pushes it away from the tool:"
                             f" no tool faces the pressure")
        tool_width.check(mesh, contact, self.kinematics.axisymmetric)

    def check_travel(self, contact: Contact, travel: float) -> None:
        """Raise an InputError if a tool's travel (length) would put a held boundary as a whole inside the tool."""
        moves = contact.way
        for support in self.supports:
            for held in self.kinematics.in_axes(support, support.constraints()):
                if not isinstance(held, Constrained) or held.on is None or moves[held.component] == 0:
                    continue
                depth = contact.tool.signed_distance(self.mesh.nodes_of(held.on) - travel * moves)
                if depth.min() >= 0:
                    raise InputError(f"travel = {travel:g}: {contact!r} would go through the whole height of the"
                                     f" body to {held.on!r}, which is held: the travel must be less than"
                                     f" {travel - depth.max() / np.linalg.norm(moves):.6g}")

    def _check_axis(self, supports: Sequence[Any]) -> None:
        if not self.kinematics.axisymmetric:
            return
        geometry = self.mesh.domain.geometry
        comm = self.mesh.comm
        low = comm.allreduce(geometry.x[:, 0].min(initial=np.inf), MPI.MIN)
        size = comm.allreduce(np.abs(geometry.x).max(initial=0.0), MPI.MAX)
        if low < -1e-12 * size:
            raise InputError(f"Scene: the mesh crosses the axis: its smallest R is {low:.6g}, must be at least 0")
        if low > 1e-12 * size:
            return
        for support in supports:
            for held in support.constraints():
                if isinstance(held, Constrained) and held.component == 0 and held.on is not None \
                        and np.all(self.mesh.nodes_of(held.on)[:, 0] <= 1e-12 * size):
                    return
        raise InputError(f"Scene: the mesh touches the axis R = 0, but no support holds u_r there: add"
                         f" Symmetry of one of {list(self.mesh.boundaries)}")

    def _check_rigid_body(self, supports: Sequence[Any]) -> None:
        """Raise an InputError unless the supports prevent every rigid motion of the kinematics."""
        names, modes = zip(*self.kinematics.rigid_motions().items())
        gram = np.zeros((len(modes), len(modes)))
        size = max(self.extent)
        for support in supports:
            for held in self.kinematics.in_axes(support, support.held()):
                X = (np.array([held.point]) if held.point is not None else self.mesh.nodes_of(held.on)) / size
                rows = np.stack([mode(X)[:, held.component] for mode in modes], 1)
                if not isinstance(held, Constrained):
                    rows = rows.mean(0, keepdims=True)
                gram += rows.T @ rows / len(rows)
        values, vectors = np.linalg.eigh(gram)
        if values[0] < 1e-12:
            free = names[int(np.argmax(np.abs(vectors[:, 0])))]
            raise InputError(f"Scene: too little support: the body is free to move as a rigid body ({free});"
                             f" supports are {supports!r}; hold that motion, with Clamped or SimplySupported"
                             f" for one")

    def _check_hinges(self) -> None:
        """Raise an InputError if a hinge or a pressure would overload a layer much softer than another at the same rim.

        With weight="area" a hinge pulls all layers with one traction: refused if they differ by more than 100 times in
        stiffness. A hinged rim face is free, so a pressure on a layer 50 times softer would squeeze it out there.
        """
        moduli = {name: self.shear_modulus(name) for name in self.materials}
        for held in (held for support in self.supports for held in support.constraints()):
            if isinstance(held, Constrained):
                continue
            at_rim = self._layers_at(held.on)
            hard = max(at_rim, key=moduli.__getitem__)
            soft = min(at_rim, key=moduli.__getitem__)
            if not held.by_stiffness and moduli[hard] > 100 * moduli[soft]:
                raise InputError(f"Scene: SimplySupported({held.on!r}) pulls all layers with the same traction, but"
                                 f" layer {soft!r} is {moduli[hard] / moduli[soft]:.3g} times softer than {hard!r}: use"
                                 f" SimplySupported({held.on!r}, weight='stiffness')")
            pressed = {name for load in self.loads if load.on is not None
                       for name in self._layers_at(load.on)} & at_rim
            for name in pressed:
                if moduli[hard] > 50 * moduli[name]:
                    raise InputError(f"Scene: the pressure that bends layer {hard!r} would squeeze layer {name!r},"
                                     f" {moduli[hard] / moduli[name]:.3g} times softer, out of the free face of the"
                                     f" hinge SimplySupported({held.on!r}): use Clamped({held.on!r})")

    def _layers_at(self, boundary: str) -> set[str]:
        """Names of the layers whose cells have a facet on a boundary, all ranks."""
        topology, cells = self.mesh.domain.topology, self.mesh.cells
        topology.create_connectivity(1, 2)
        touching = {topology.connectivity(1, 2).links(f)[0] for f in self.mesh.facets_of(boundary)}
        mine = set(cells.values[np.isin(cells.indices, sorted(touching))].tolist())
        tags = set().union(*self.mesh.comm.allgather(mine))
        return {name for name, tag in self.mesh.layers.items() if tag in tags}

    @property
    def extent(self) -> np.ndarray:
        """Size of the mesh along R and Z, shape (2,), all ranks."""
        return self._extent

    def __str__(self) -> str:
        lines = summary(self)
        width = max(map(len, lines))
        return "\n".join(f"{part:{width}}  {line}" for part, line in lines.items())


def _all_of(kind: type, name: str, scene_items: Any, what: str) -> list[Any]:
    """Return a list of items of one kind; raise an InputError for others."""
    scene_items = several(f"Scene: {name}", scene_items, what)
    for item in scene_items:
        if not isinstance(item, kind):
            raise InputError(f"Scene: {name}: {item!r} is not allowed here: must be a list of {what}")
    return scene_items
