"""A scene as an incompressible solid of finite thickness: its fields and its forms.

Unknowns are dimensionless: displacement over `length` (the largest extent of the mesh) and pressure over `stress` (the
largest shear modulus). The energy is divided by stress times reference volume. So a run does not depend on the
user's units, and what `solve` sees are numbers of order one.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from .. import _compat
from ..physics import kinematics as kin


class Formulation(ABC):
    """The forms of a scene: what a solid and a membrane have in common.

    Attributes:
        scene: the scene.
        mesh: the `Mesh` that the fields live on; domain, comm: its `dolfinx.mesh.Mesh` and communicator.
        length, stress, volume: scales L and mu, and the reference volume, in the user's units.
        space, w: the mixed `FunctionSpace` and the `Function` of all fields (dimensionless), displacement first.
        displacement_element: the scalar element of a displacement component.
        u, X: displacement and reference position (UFL, user's unit of length, shape (2,)).
        F, J: deformation gradient (UFL, shape (3, 3)) and its determinant.
        dx, weight: weight * dx is the element of reference volume.
        control: the `Constant` of the dimensionless control.
        scales: the user's pressure or travel over the amplitude (`Setting`), for every thing of the scene; last, 1
            for the time. control_scale: that of the only driven thing, or L.
        residual: dPi/dw - external virtual work (UFL, rank 1); control_derivative: its derivative by the control,
            or None.
        energy: strain energy over stress times volume (UFL, rank 0).
        slack_at_rest: True if the body at rest has no stiffness in some direction.
    """

    slack_at_rest = False

    def __init__(self, scene: Any):
        self.scene = scene
        self._moduli = {id(m): m.shear_modulus for m in scene.materials.values()}
        self.length, self.stress = float(max(scene.extent)), max(self._moduli.values())
        self.mesh = self._make_mesh()
        self.domain = self.mesh.domain
        self.comm = scene.mesh.comm
        self.displacement_element, elements = self._elements(self.domain.basix_cell())
        self.space = fem.functionspace(self.domain, basix.ufl.mixed_element(elements))
        self.w = fem.Function(self.space, name="w")
        self.control = self.constant(0.0)
        self.u = self.constant(self.length) * ufl.split(self.w)[0]
        self.X = ufl.SpatialCoordinate(self.domain)
        self.dx = ufl.Measure("dx", self.domain, subdomain_data=self.mesh.cells,
                              metadata={"quadrature_degree": scene.quadrature_degree})
        self.ds = ufl.Measure("ds", self.domain, subdomain_data=self.mesh.facets)
        self.weight = self._weight()
        self.volume = self.integral(self.weight * self.dx)
        self._scale = self.constant(1 / (self.stress * self.volume))
        self.scales = [self._scale_of(thing) for thing in scene.things] + [1.0]
        self.control_scale = next((s for s, t in zip(self.scales, scene.things) if t is scene.driven), self.length)
        self.F = self._deformation_gradient()
        self.J = kin.volume_ratio(self.F)
        self.energy = self._energy()
        self.residual, self.control_derivative = self._residual()

    @abstractmethod
    def face(self, name: str, quadrature_degree: int) -> tuple[Any, ufl.Measure]:
        """(outward normal, measure) of a boundary that a load acts on."""

    @abstractmethod
    def constraints(self, support: Any) -> list[Any]:
        """What a support holds: a list of Held or MeanHeld."""

    @abstractmethod
    def nearest(self, points: np.ndarray) -> np.ndarray:
        """The points of `mesh` that stand for points of the body, shape (n, 2)."""

    @abstractmethod
    def _make_mesh(self) -> Any:
        """The `Mesh` of the fields."""

    @abstractmethod
    def _elements(self, cell: Any) -> tuple[Any, list[Any]]:
        """The scalar element of the displacement, and those of all fields."""

    @abstractmethod
    def _weight(self) -> Any:
        """See `weight`."""

    @abstractmethod
    def _deformation_gradient(self) -> Any:
        """See `F`."""

    @abstractmethod
    def _energy(self) -> Any:
        """See `energy`."""

    def mean_row(self, held: Any) -> Any:
        """Linear form: mean of a displacement component (dimensionless) over a boundary, as a `MeanHeld` asks."""
        raise NotImplementedError

    def idle_unknowns(self) -> list[tuple[Any, np.ndarray]]:
        """[(sub space, local dofs)] of unknowns that no equation holds: they stay 0."""
        return []

    def set_stiff(self) -> None:
        """Put `w` to a state near rest whose tangent is regular: its tangent gives a path its first direction."""
        self.w.x.array[:] = 0

    def constant(self, value: float) -> fem.Constant:
        """A number in a form that can be changed without compiling it again."""
        return fem.Constant(self.domain, PETSc.ScalarType(value))

    def compile(self, form: Any) -> Any:
        """A compiled form."""
        try:
            return fem.form(form, jit_options=_compat.JIT_OPTIONS)
        except TimeoutError as error:
            raise TimeoutError(
                f"a form is being compiled by another process for more than {_compat.JIT_OPTIONS['timeout']} s, or a"
                f" compilation was killed: if no other run is going on, remove the folder .cache/fenics") from error

    def integral(self, form: Any) -> float:
        """The value of a UFL integral over all ranks, compiled for this one use."""
        return float(self.comm.allreduce(fem.assemble_scalar(self.compile(form)), MPI.SUM))

    def test_function(self) -> Any:
        """The test function of all fields (dimensionless)."""
        return ufl.TestFunction(self.space)

    def metric_row(self) -> Any:
        """Linear form whose vector is the lumped mass of the displacement, over the volume."""
        v = ufl.split(self.test_function())[0]
        dx = ufl.dx(self.domain, metadata={"quadrature_degree": 4})
        return (v[0] + v[1]) * self.weight / self.constant(self.volume) * dx

    def _scale_of(self, thing: Any) -> float:
        """Pressure: stress times thickness over length, thickness being volume over loaded area. Motion: length."""
        if not getattr(thing, "driven", False) or not hasattr(thing, "virtual_work"):
            return self.length
        return self.stress * self.thickness(thing.on) / self.length

    def thickness(self, boundary: str) -> float:
        """Volume of the body over the area of a boundary, length."""
        return self.volume / self.integral(self.scene.kinematics.weight(self.X) * self.face(boundary, 2)[1])

    def _residual(self) -> tuple[Any, Any]:
        v = self.test_function()
        residual = ufl.derivative(self.energy, self.w, v)
        du = self.constant(self.length) * ufl.split(v)[0]
        control, driven = ufl.variable(self.control), None
        self._loads = []
        for load, scale in zip(self.scene.loads, self.scales):
            base, rate = self.constant(0.0 if load.driven else load.value), self.constant(0.0)
            self._loads.append((load, base, rate))
            value = self.constant(scale) * (base + rate * control) if load.driven else base
            N, ds = self.face(load.on, load.quadrature_degree)
            work = load.virtual_work(self.scene.kinematics, self.u, du, self.X, N, value)
            residual -= self._scale * work * ds
            if load.driven:
                by_control = -self._scale * ufl.diff(work, control) * ds
                driven = by_control if driven is None else driven + by_control
        return residual, driven

    def set_loads(self, setting: Any) -> None:
        """Loads as a `Setting` wants them."""
        for i, (load, base, rate) in enumerate(self._loads):
            there = i not in setting.off
            base.value = there * (setting.base[i] if load.driven else load.value)
            rate.value = there * setting.rate[i]


class Solid(Formulation):
    """A scene as an incompressible solid; the fields are displacement and, if the model has them, pressures.

    Attributes:
        bodies: [(material, its layers)]: layers of one material object are one body.
    """

    def boundary(self, name: str, quadrature_degree: int) -> ufl.Measure:
        """The measure of a named boundary."""
        return self.ds(self.scene.mesh.boundaries[name], metadata={"quadrature_degree": quadrature_degree})

    def face(self, name, quadrature_degree):
        return ufl.FacetNormal(self.domain), self.boundary(name, quadrature_degree)

    def constraints(self, support):
        return support.constraints()

    def nearest(self, points):
        return points

    def mean_row(self, held):
        ds, weight = self.boundary(held.on, 3), self.weight
        if held.by_stiffness:
            stiffness = fem.Function(fem.functionspace(self.domain, ("DG", 0)))
            for name, tag in self.scene.mesh.layers.items():
                modulus = self._moduli[id(self.scene.materials[name])]
                stiffness.x.array[self.scene.mesh.cells.find(tag)] = modulus / self.stress
            weight = weight * stiffness
        v = ufl.split(self.test_function())[0][held.component]
        return v * weight / self.constant(self.integral(weight * ds)) * ds

    def length_row(self, boundary: str) -> Any:
        """Linear form whose vector is, at the first component of a node, the length of boundary that belongs to it."""
        metadata = {"quadrature_rule": "GLL", "quadrature_degree": 3}
        return ufl.split(self.test_function())[0][0] * self.ds(self.scene.mesh.boundaries[boundary], metadata=metadata)

    def idle_unknowns(self) -> list[tuple[Any, np.ndarray]]:
        """[(sub space, local dofs)] of pressures that belong to no cell of their layers."""
        found, mesh, dofmap = [], self.mesh, self.space.dofmap
        for colour in sorted(set(self._colours.values())):
            sub = self.space.sub(1 + colour)
            cells = np.concatenate([mesh.cells.find(mesh.layers[n]) for n, c in self._colours.items() if c == colour])
            used = la.vector(dofmap.index_map, 1)              # the cells may all be on another rank
            used.array[sub.dofmap.list[cells].ravel()] = 1
            used.scatter_reverse(la.InsertMode.add)
            used.scatter_forward()
            dofs = np.unique(sub.dofmap.list)
            found.append((sub, dofs[used.array[dofs] == 0].astype(np.int32)))
        return found

    def _make_mesh(self) -> Any:
        scene = self.scene
        self.bodies = _by_material(scene)
        self._colours = _colour(scene) if scene.model.pressure else {}
        return scene.mesh

    def _elements(self, cell: Any) -> tuple[Any, list[Any]]:
        pressure = self.scene.model.pressure
        element = basix.ufl.element("Lagrange", cell, 2)
        if pressure and pressure.bubble:
            element = basix.ufl.enriched_element([element, basix.ufl.element("Bubble", cell, 3)])
        fields = [basix.ufl.blocked_element(element, shape=(2,))]
        if pressure:
            field = basix.ufl.element(pressure.family, cell, pressure.degree)
            fields += [field] * (max(self._colours.values()) + 1)
        return element, fields

    def _weight(self) -> Any:
        return self.scene.kinematics.weight(self.X)

    def _deformation_gradient(self) -> Any:
        return self.scene.kinematics.deformation_gradient(self.u, self.X)

    def _energy(self) -> Any:
        scene = self.scene
        self._eps = self.constant(scene.model.eps)
        energy = 0
        for material, names in self.bodies:
            tags = tuple(scene.mesh.layers[n] for n in names)
            dx = self.dx if len(tags) == len(scene.mesh.layers) else self.dx(tags)
            for density, metadata in self.energy_densities(material, names, self.F):
                energy += self._scale * density * self.weight * (dx(metadata=metadata) if metadata else dx)
        return energy

    def energy_densities(self, material: Any, names: list[str], F: Any) -> list[tuple[Any, dict]]:
        """[(energy per reference volume (UFL, stress), quadrature metadata)] of a body for F, shape (3, 3).

        The energy of the material, then what keeps the volume: W(F) - rest_stress ln J, and p (J - 1) or a penalty.
        """
        model, J = self.scene.model, kin.volume_ratio(F)
        W = material.strain_energy(F, **{k: self.constant(c) for k, c in material.parameters.items()})
        if model.stress_free:
            W -= self.constant(material.rest_stress) * ufl.ln(J)
        modulus = self.constant(self._moduli[id(material)])
        p = self.constant(self.stress) * ufl.split(self.w)[1 + self._colours[names[0]]] if self._colours else None
        return [(W, {}), *model.terms(J, p, modulus, self._eps)]


def _by_material(scene: Any) -> list[tuple[Any, list[str]]]:
    """[(material, its layers)]: layers of one material object are one body."""
    groups: dict[int, tuple[Any, list[str]]] = {}
    for name in scene.mesh.layers:
        material = scene.materials[name]
        groups.setdefault(id(material), (material, []))[1].append(name)
    return list(groups.values())


def _colour(scene: Any) -> dict[str, int]:
    """{layer: number of its pressure field}: bodies of different materials that touch get different fields."""
    mesh = scene.mesh
    if not scene.model.pressure.continuous:
        return dict.fromkeys(mesh.layers, 0)
    topology = mesh.domain.topology
    topology.create_connectivity(2, 0)
    groups = [names for _, names in _by_material(scene)]
    touches = []
    for names in groups:
        cells = np.concatenate([mesh.cells.find(mesh.layers[n]) for n in names])
        mine = {v for c in cells for v in topology.connectivity(2, 0).links(c)}
        local = np.array(sorted(mine), dtype=np.int32)
        touches.append(set(topology.index_map(0).local_to_global(local).tolist()))
    touches = [set().union(*parts) for parts in zip(*mesh.comm.allgather(touches), strict=True)]
    colours: list[int] = []
    for i, mine in enumerate(touches):
        taken = {colours[j] for j in range(i) if touches[j] & mine}
        colours.append(next(c for c in itertools.count() if c not in taken))
    return {name: colours[i] for i, names in enumerate(groups) for name in names}
