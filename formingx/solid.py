"""A scene as an incompressible solid of finite thickness: its fields and its forms.

Unknowns are dimensionless: displacement over `length` (the largest extent of the mesh) and pressure over `stress` (the
largest shear modulus). The energy is divided by stress times reference volume. So a run does not depend on the
user's units, and what `solve` sees are numbers of order one.
"""

from __future__ import annotations

import itertools
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from . import _compat
from .physics import kinematics as kin


class Solid:
    """The forms of a scene.

    Attributes:
        scene: the scene.
        domain, comm: its `dolfinx.mesh.Mesh` and communicator.
        length, stress, volume: scales L and mu, and the reference volume, in the user's units.
        space, w: the mixed `FunctionSpace` and the `Function` of all fields (dimensionless), displacement first.
        u, X: displacement and reference position (UFL, user's unit of length, shape (2,)).
        control: the `Constant` of the dimensionless control; control_scale times it is the user's.
        residual: dPi/dw - external virtual work (UFL, rank 1); control_derivative: its derivative by the control,
            or None.
        energy: strain energy over stress times volume (UFL, rank 0).
    """

    def __init__(self, scene: Any):
        self.scene = scene
        self.domain = scene.mesh.domain
        self.comm = self.domain.comm
        self._moduli = {id(m): m.shear_modulus for m in scene.materials.values()}
        self.length, self.stress = float(max(scene.extent)), max(self._moduli.values())
        self._colours = _colour(scene) if scene.incompressibility.pressure_degree is not None else {}
        self.space = self._make_space()
        self.w = fem.Function(self.space, name="w")
        self.control = self.constant(0.0)
        self.u = self.constant(self.length) * ufl.split(self.w)[0]
        self.X = ufl.SpatialCoordinate(self.domain)
        self.dx = ufl.Measure("dx", self.domain, subdomain_data=scene.mesh.cells,
                              metadata={"quadrature_degree": scene.quadrature_degree})
        self.ds = ufl.Measure("ds", self.domain, subdomain_data=scene.mesh.facets)
        self.weight = scene.kinematics.weight(self.X)
        self.volume = self.integral(self.weight * self.dx)
        self.control_scale = self._scale_of_control()
        self.J = kin.volume_ratio(scene.kinematics.deformation_gradient(self.u, self.X))
        self.energy = self._energy()
        self.residual, self.control_derivative = self._residual()

    def constant(self, value: float) -> fem.Constant:
        """A number in a form that can be changed without compiling it again."""
        return fem.Constant(self.domain, PETSc.ScalarType(value))

    def boundary(self, name: str, quadrature_degree: int) -> ufl.Measure:
        """The measure of a named boundary."""
        return self.ds(self.scene.mesh.boundaries[name], metadata={"quadrature_degree": quadrature_degree})

    def compile(self, form: Any) -> Any:
        """A compiled form."""
        return fem.form(form, jit_options=_compat.JIT_OPTIONS)

    def integral(self, form: Any) -> float:
        """The value of a UFL integral over all ranks, compiled for this one use."""
        return float(self.comm.allreduce(fem.assemble_scalar(self.compile(form)), MPI.SUM))

    def test_function(self) -> Any:
        """The test function of all fields (dimensionless)."""
        return ufl.TestFunction(self.space)

    def mean_row(self, held: Any) -> Any:
        """Linear form: mean of a displacement component (dimensionless) over a boundary, as a `MeanHeld` asks."""
        ds, weight = self.boundary(held.on, 3), self.weight
        if held.by_stiffness:
            stiffness = fem.Function(fem.functionspace(self.domain, ("DG", 0)))
            for name, tag in self.scene.mesh.layers.items():
                modulus = self._moduli[id(self.scene.materials[name])]
                stiffness.x.array[self.scene.mesh.cells.find(tag)] = modulus / self.stress
            weight = weight * stiffness
        v = ufl.split(self.test_function())[0][held.component]
        return v * weight / self.constant(self.integral(weight * ds)) * ds

    def metric_row(self) -> Any:
        """Linear form whose vector is the lumped mass of the displacement, over the volume."""
        v = ufl.split(self.test_function())[0]
        dx = ufl.dx(self.domain, metadata={"quadrature_degree": 3})
        return (v[0] + v[1]) * self.weight / self.constant(self.volume) * dx

    def idle_unknowns(self) -> list[tuple[Any, np.ndarray]]:
        """[(sub space, local dofs)] of pressures that belong to no cell of their layers."""
        found = []
        for colour in sorted(set(self._colours.values())):
            sub = self.space.sub(1 + colour)
            mesh = self.scene.mesh
            cells = np.concatenate([mesh.cells.find(mesh.layers[n]) for n, c in self._colours.items() if c == colour])
            dofs = sub.dofmap.list
            found.append((sub, np.setdiff1d(dofs, dofs[cells]).astype(np.int32)))
        return found

    def _make_space(self) -> Any:
        cell = self.domain.basix_cell()
        elements = [basix.ufl.element("Lagrange", cell, 2, shape=(2,))]
        if self._colours:
            degree = self.scene.incompressibility.pressure_degree
            elements += [basix.ufl.element("Lagrange", cell, degree)] * (max(self._colours.values()) + 1)
        return fem.functionspace(self.domain, basix.ufl.mixed_element(elements))

    def _scale_of_control(self) -> float:
        """Pressure: stress times thickness over length, thickness being volume over loaded area. Motion: length."""
        driven = self.scene.driven
        if driven is None or not hasattr(driven, "virtual_work"):
            return self.length
        area = self.integral(self.weight * self.boundary(driven.on, 2))
        return self.stress * self.volume / (area * self.length)

    def _energy(self) -> Any:
        scene = self.scene
        fields = ufl.split(self.w)
        self._scale = self.constant(1 / (self.stress * self.volume))
        eps = self.constant(scene.incompressibility.eps)
        F = scene.kinematics.deformation_gradient(self.u, self.X)
        energy = 0
        for material, names in _by_material(scene):
            tags = tuple(scene.mesh.layers[n] for n in names)
            dx = self.dx if len(tags) == len(scene.mesh.layers) else self.dx(tags)
            W = material.strain_energy(F, **{k: self.constant(c) for k, c in material.parameters.items()})
            if scene.incompressibility.stress_free:
                W -= self.constant(material.rest_stress) * ufl.ln(self.J)
            energy += self._scale * W * self.weight * dx
            modulus = self.constant(self._moduli[id(material)])
            p = self.constant(self.stress) * fields[1 + self._colours[names[0]]] if self._colours else None
            for density, metadata in scene.incompressibility.terms(self.J, p, modulus, eps):
                energy += self._scale * density * self.weight * dx(metadata={**dx.metadata(), **metadata})
        return energy

    def _residual(self) -> tuple[Any, Any]:
        v = self.test_function()
        residual = ufl.derivative(self.energy, self.w, v)
        du = self.constant(self.length) * ufl.split(v)[0]
        control, driven = ufl.variable(self.control), None
        for load in self.scene.loads:
            value = self.constant(self.control_scale) * control if load.driven else self.constant(load.value)
            work = load.virtual_work(self.scene.kinematics, self.u, du, self.X, ufl.FacetNormal(self.domain), value)
            ds = self.boundary(load.on, load.quadrature_degree)
            residual -= self._scale * work * ds
            if load.driven:
                driven = -self._scale * ufl.diff(work, control) * ds
        return residual, driven


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
    topology = mesh.domain.topology
    topology.create_connectivity(2, 0)
    groups = [names for _, names in _by_material(scene)]
    touches = []
    for names in groups:
        cells = np.concatenate([mesh.cells.find(mesh.layers[n]) for n in names])
        mine = {v for c in cells for v in topology.connectivity(2, 0).links(c)}
        local = np.array(sorted(mine), dtype=np.int32)
        touches.append(set(topology.index_map(0).local_to_global(local).tolist()))
    touches = [set().union(*parts) for parts in zip(*mesh.domain.comm.allgather(touches), strict=True)]
    colours: list[int] = []
    for i, mine in enumerate(touches):
        taken = {colours[j] for j in range(i) if touches[j] & mine}
        colours.append(next(c for c in itertools.count() if c not in taken))
    return {name: colours[i] for i, names in enumerate(groups) for name in names}
