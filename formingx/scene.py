"""What the user declares, checked before anything is solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from .errors import InputError, count, known, several
from .mesh import Mesh
from .physics.contact import Contact
from .physics.incompressibility import DisplacementPenalty, Membrane, MixedPressure
from .physics.kinematics import Axisymmetric
from .physics.materials import Material
from .physics.supports import Held


class Scene:
    """A body, what it is made of, how it is held and what loads it.

    Args:
        mesh: from `formingx.mesh`.
        materials: {layer name: material}, or one material for all layers.
        supports: see `formingx.physics.supports`.
        loads: see `formingx.physics.loads`. At most one load, support or tool is driven (controlled by the run).
            (Contacts of one tool with several faces, of the same `moves`, count as one.)
        contacts: faces of the body that rigid tools stop, see `formingx.Contact`.
        model: how the scene is modelled: `MixedPressure()` (default) or `DisplacementPenalty()`, a solid; `Membrane()`.
        kinematics: `Axisymmetric()` (default) or `PlaneStrain()`.
        quadrature_degree: of the energy; 5 (seven points) is the thesis' rule.

    Raises:
        InputError: an unknown or empty tag, a layer without material, too little support, a mesh with R < 0, more
            than one driven object.
    """

    def __init__(self, *, mesh: Mesh, materials: Material | Mapping[str, Material], supports: Sequence[Any],
                 loads: Sequence[Any] = (), contacts: Sequence[Contact] = (), model: Any = None, kinematics: Any = None,
                 quadrature_degree: int = 5):
        if not isinstance(mesh, Mesh):
            raise InputError(f"Scene: mesh = {mesh!r}: must come from formingx.mesh (disc, read, ...)")
        if isinstance(materials, Material):
            materials = dict.fromkeys(mesh.layers, materials)
        if not isinstance(materials, Mapping):
            raise InputError(f"Scene: materials = {materials!r}: must be a formingx material, or {{layer: material}}")
        self.mesh = mesh
        self.materials = dict(materials)
        self.supports = _all_with("constraints", "supports", supports, "supports, such as Clamped('rim')")
        self.loads = _all_with("virtual_work", "loads", loads, "loads, such as Pressure('bottom')")
        self.contacts = _all_with("law", "contacts", contacts, "Contact(...)")
        self.model = model if model is not None else MixedPressure()
        if not isinstance(self.model, MixedPressure | DisplacementPenalty | Membrane):
            raise InputError(f"Scene: model = {model!r}: must be a MixedPressure, a DisplacementPenalty or a Membrane")
        self.kinematics = kinematics if kinematics is not None else Axisymmetric()
        if not hasattr(self.kinematics, "dimension_of_volume") or isinstance(self.kinematics, type):
            raise InputError(f"Scene: kinematics = {kinematics!r}: must be Axisymmetric() or PlaneStrain()")
        self.quadrature_degree = count("Scene: quadrature_degree", quadrature_degree)
        self._check_materials()
        self._check_boundaries()
        self._check_axis()
        self._check_rigid_body()
        if isinstance(self.model, Membrane):
            self.model.check(self)
        else:
            self._check_hinges()
        if self.contacts and isinstance(self.model, Membrane):
            raise InputError(f"Scene: {self.contacts[0]!r}: a membrane has no contact yet: use a solid model,"
                             f" MixedPressure() for one")
        for contact in self.contacts:
            self._check_contact(contact)
        driven = [x for x in (*self.loads, *self.supports, *self.contacts) if getattr(x, "driven", False)]
        together = len({getattr(x, "moves", None) for x in driven}) == 1 and getattr(driven[0], "moves", None)
        if len(driven) > 1 and not together:                     # one tool that meets several faces moves as one
            raise InputError(f"Scene: {', '.join(map(repr, driven))} are all driven: one control drives a run;"
                             f" give the others a value")
        self.driven = driven[0] if driven else None

    def _check_materials(self) -> None:
        layers = self.mesh.layers
        for name, material in self.materials.items():
            known("Scene: materials: layer", name, layers)
            if not isinstance(material, Material):
                raise InputError(f"Scene: materials[{name!r}] = {material!r}: must be a formingx material")
            material.check()
        missing = [name for name in layers if name not in self.materials]
        if missing:
            raise InputError(f"Scene: layer {', '.join(map(repr, missing))} has no material;"
                             f" materials are given for {', '.join(map(repr, self.materials)) or 'none'}")

    def _check_boundaries(self) -> None:
        for thing in (*self.loads, *self.supports, *self.contacts):
            if not hasattr(thing, "on"):
                continue
            on = thing.on
            known(f"{thing!r}: boundary", on, self.mesh.boundaries)
            if self.mesh.domain.comm.allreduce(len(self.mesh.facets_of(on)), MPI.SUM) == 0:
                raise InputError(f"{thing!r}: boundary {on!r} is empty: no facet of the mesh carries it")

    def _check_contact(self, contact: Contact) -> None:
        """The body starts outside the tool, the face looks at it, and the pressure does not push away from it."""
        mesh, near = self.mesh, 1e-6 * max(self.extent)
        face = mesh.nodes_of(contact.on)
        comm = mesh.domain.comm
        points = np.concatenate(comm.allgather(mesh.domain.geometry.x[:, :2]))
        depth = contact.tool.signed_distance(points)
        worst = int(np.argmax(depth))
        if depth[worst] > near:
            raise InputError(f"{contact!r}: the body starts inside the tool: {depth[worst]:.6g} deep at (R, Z) ="
                             f" ({points[worst, 0]:.6g}, {points[worst, 1]:.6g})")
        if depth[worst] > contact.tool.signed_distance(face).max() + near:
            raise InputError(f"{contact!r}: the tool is behind this face of the body: another face is closer to it;"
                             f" boundaries are {list(mesh.boundaries)}")
        if any(load.driven and load.on == contact.on for load in self.loads):
            raise InputError(f"{contact!r}: the driven pressure acts on the same face and pushes it away from the tool:"
                             f" no tool faces the pressure")

    def check_travel(self, travel: float) -> None:
        """An InputError if the driven tool's travel (length) would put a held boundary as a whole inside the tool."""
        if not isinstance(self.driven, Contact) or self.driven.moves is None:
            return
        moves = np.array(self.driven.moves)
        for support in self.supports:
            for held in support.constraints():
                if not isinstance(held, Held) or held.on is None or moves[held.component] == 0:
                    continue
                depth = self.driven.tool.signed_distance(self.mesh.nodes_of(held.on) - travel * moves)
                if depth.min() >= 0:
                    raise InputError(f"travel = {travel:g}: {self.driven!r} would go through the whole height of the"
                                     f" body to {held.on!r}, which is held: the travel must be less than"
                                     f" {travel - depth.max() / np.hypot(*moves):.6g}")

    def _check_axis(self) -> None:
        if not isinstance(self.kinematics, Axisymmetric):
            return
        geometry = self.mesh.domain.geometry
        comm = self.mesh.domain.comm
        low = comm.allreduce(geometry.x[:, 0].min(initial=np.inf), MPI.MIN)
        size = comm.allreduce(np.abs(geometry.x).max(initial=0.0), MPI.MAX)
        if low < -1e-12 * size:
            raise InputError(f"Scene: the mesh crosses the axis: its smallest R is {low:.6g}, must be at least 0")
        if low > 1e-12 * size:
            return
        for support in self.supports:
            for held in support.constraints():
                if isinstance(held, Held) and held.component == 0 and held.on is not None \
                        and np.all(self.mesh.nodes_of(held.on)[:, 0] <= 1e-12 * size):
                    return
        raise InputError(f"Scene: the mesh touches the axis R = 0, but no support holds u_r there: add"
                         f" Symmetry of one of {list(self.mesh.boundaries)}")

    def _check_rigid_body(self) -> None:
        """The supports must hold every rigid motion that the kinematics allows."""
        if isinstance(self.kinematics, Axisymmetric):
            names, modes = ["translation along Z"], [lambda X: np.stack([0 * X[:, 0], 1 + 0 * X[:, 0]], 1)]
        else:
            names = ["translation along R", "translation along Z", "rotation"]
            modes = [lambda X: np.stack([1 + 0 * X[:, 0], 0 * X[:, 0]], 1),
                     lambda X: np.stack([0 * X[:, 0], 1 + 0 * X[:, 0]], 1),
                     lambda X: np.stack([-X[:, 1], X[:, 0]], 1)]
        gram = np.zeros((len(modes), len(modes)))
        size = max(self.extent)
        for support in self.supports:
            for held in support.constraints():
                point = getattr(held, "point", None)
                X = (np.array([point]) if point is not None else self.mesh.nodes_of(held.on)) / size
                rows = np.stack([mode(X)[:, held.component] for mode in modes], 1)
                if not isinstance(held, Held):
                    rows = rows.mean(0, keepdims=True)
                gram += rows.T @ rows / len(rows)
        values, vectors = np.linalg.eigh(gram)
        if values[0] < 1e-12:
            free = names[int(np.argmax(np.abs(vectors[:, 0])))]
            raise InputError(f"Scene: too little support: the body is free to move as a rigid body ({free});"
                             f" supports are {self.supports!r}; hold that motion, with Clamped or SimplySupported"
                             f" for one")

    def _check_hinges(self) -> None:
        """What a hinge asks of the soft one of two layers must not be a hundred times too much for it.

        A plain mean pulls all layers with one traction; and a hinged rim face is free, so a pressure on a soft layer
        squeezes it out there.
        """
        moduli = {name: material.shear_modulus for name, material in self.materials.items()}
        for held in (held for support in self.supports for held in support.constraints()):
            if isinstance(held, Held):
                continue
            at_rim = self._layers_at(held.on)
            hard = max(at_rim, key=moduli.__getitem__)
            soft = min(at_rim, key=moduli.__getitem__)
            if not held.by_stiffness and moduli[hard] > 100 * moduli[soft]:
                raise InputError(f"Scene: SimplySupported({held.on!r}) pulls all layers with the same traction, but"
                                 f" layer {soft!r} is {moduli[hard] / moduli[soft]:.3g} times softer than {hard!r}: use"
                                 f" SimplySupported({held.on!r}, weight='stiffness')")
            pressed = {name for load in self.loads for name in self._layers_at(load.on)} & at_rim
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
        tags = set().union(*self.mesh.domain.comm.allgather(mine))
        return {name for name, tag in self.mesh.layers.items() if tag in tags}

    @property
    def extent(self) -> np.ndarray:
        """Size of the mesh along R and Z, shape (2,), all ranks."""
        X, comm = self.mesh.domain.geometry.x[:, :2], self.mesh.domain.comm
        high = np.array([comm.allreduce(X[:, i].max(initial=-np.inf), MPI.MAX) for i in (0, 1)])
        low = np.array([comm.allreduce(X[:, i].min(initial=np.inf), MPI.MIN) for i in (0, 1)])
        return high - low


def _all_with(method: str, name: str, things: Any, what: str) -> list[Any]:
    """A list of things that all have a method, or an InputError."""
    things = several(f"Scene: {name}", things, what)
    for thing in things:
        if not hasattr(thing, method) or isinstance(thing, type):
            raise InputError(f"Scene: {name}: {thing!r} is not allowed here: must be a list of {what}")
    return things
