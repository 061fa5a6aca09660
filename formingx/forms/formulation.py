"""Forms of a scene: common base class of solids, membranes and sheets in three dimensions.

Unknowns are dimensionless: displacements are divided by `length` (the largest extent of the mesh), pressures by
`stress` (the largest shear modulus), the energy by stress times reference volume. A run therefore does not depend on
the user's units, and the solver works with numbers of order one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from ufl.algorithms.analysis import extract_constants

from .. import _compat
from ..errors import call_on_all_ranks
from ..physics import kinematics as kin
from ..ranks import combined
from .admissible import Admissible
from .energy_rule import EnergyRule
from .free_stretch import FreeStretch
from .history import History
from .loaded_body import LoadedBody
from .material_history import MaterialHistory
from .material_terms import MaterialTerms
from .probes import Probe
from .temperature import Temperature


class Formulation(ABC):
    """Fields and variational forms (UFL) of a model declaration (`Scene`), without contact.

    Displacements are divided by `length`, pressures by `stress`, and the residual by stress times volume.

    Attributes:
        scene: the model declaration (`Scene`).
        mesh: `Mesh` of the fields.
        domain: `dolfinx.mesh.Mesh` of the fields.
        comm: MPI communicator.
        length: scale L of lengths, the largest extent of the mesh, length.
        stress: scale of stresses, the largest shear modulus, stress.
        volume: reference volume, length^3; in plane strain per depth, length^2.
        space: mixed `FunctionSpace` of all fields, displacement first.
        w: `Function` of all fields (dimensionless).
        displacement_element: scalar element of a displacement component.
        u: displacement (UFL, length, shape (2,)).
        X: reference position (UFL, length, shape (2,)).
        F: deformation gradient (UFL, shape (3, 3)).
        elastic_F: F without thermal expansion (UFL, shape (3, 3)).
        J: det `elastic_F` divided by `ratio_before` (UFL scalar).
        ratio_before: det F of the deformation transferred from another mesh (`StateTransfer`), else 1.
        rule: quadrature rule of the energy (`EnergyRule`).
        dx: measure of the domain, with this rule.
        weight: reference volume per measure `dx` (UFL scalar).
        control: `Constant` of the dimensionless load parameter (control).
        time: process time, a function of the control (UFL scalar, time).
        scales: unit of each load, support and contact: its value (pressure, travel, ...) in the user's units divided by
            its amplitude (`StepData`). The last entry, 1, belongs to the time.
        control_scale: entry of `scales` for the only load, support or contact with a control; else L.
        terms: the `MaterialTerms` of each material of the scene.
        refreshed: coefficients that depend on fields and time, with a method `refresh`: integrals over past states.
        histories: history variables of materials and temperature (`History`), on which the forms depend.
        potential: incremental potential of a step, divided by stress times volume (UFL, rank 0).
        energy: stored energy divided by stress times volume (UFL, rank 0), or None; without histories the potential.
        dissipation: dissipated power divided by stress times volume (UFL, rank 0), or None.
        damage_energy: energy dissipated by damage, divided by stress times volume (UFL, rank 0), or None.
        load_values: list of (load, its value at the current stage and control (UFL, the user's units)).
        residual: dpotential/dw minus the external virtual work (UFL, rank 1).
        control_derivative: derivative of `residual` with respect to the control, through the loads, or None.
        time_derivative: derivative of `residual` with respect to the control, through the time in materials, or None.
        elastic_supports: list of (support with an energy, `Constant` that is 1 while the support is active, else 0).
        load_works: virtual work of each load of the scene at its current value (UFL, rank 1, user's units).
        temperature: `Temperature` of the body, or None.
        faces: contact faces of the problem (`FaceContact`); the problem sets them.
        singular_unloaded: True if the body in the reference configuration has no stiffness in some direction.
    """

    singular_unloaded, ratio_before = False, 1.0

    def __init__(self, scene: Any):
        self.scene = scene
        self.faces: list[Any] = []
        self.length = float(max(scene.extent))
        self.stress = max(scene.shear_modulus(name) for name in scene.mesh.layers)
        self.mesh = self._make_mesh()
        self.domain = self.mesh.domain
        self.comm = scene.mesh.comm
        self.displacement_element, elements = self._elements(self.domain.basix_cell())
        self.space = fem.functionspace(self.domain, basix.ufl.mixed_element(elements))
        self.w = fem.Function(self.space, name="w")
        self.temperature: Any = None if scene.temperature is None else self._make_temperature()
        self.control = self.constant(0.0)
        self._control = ufl.variable(self.control)
        self._time = self.constant(0.0), self.constant(0.0)                    # base, and rate by the control
        self.time = self._time[0] + self._time[1] * self._control
        self.u = self.constant(self.length) * ufl.split(self.w)[0]
        self.X = ufl.SpatialCoordinate(self.domain)
        self.rule = self._energy_rule()
        self.dx = ufl.Measure("dx", self.domain, subdomain_data=self.mesh.cells, metadata=self.rule.metadata)
        self.ds = ufl.Measure("ds", self.domain, subdomain_data=self.mesh.facets)
        self.weight = self._weight()
        self.volume = self.integral(self.weight * self.dx)
        self._scale = self.constant(1 / (self.stress * self.volume))
        self.F = self._deformation_gradient()
        self._free = FreeStretch(self, scene.expansion) if scene.expansion else None
        self.elastic_F = self.elastic(self.F)
        self.J = kin.volume_ratio(self.elastic_F) / self.ratio_before
        body = LoadedBody(self)
        self.scales = [load.unit(body) if load.driven else self.length for load in scene.loads]
        self.scales += [self.length] * (len(scene.items) - len(self.scales)) + [1.0]
        self.control_scale = next((s for s, t in zip(self.scales, scene.items) if t is scene.driven), self.length)
        self._add_materials()
        self._add_supports(body)
        self.residual, self.control_derivative, self.time_derivative = self._residual(body)

    def _make_temperature(self) -> Any:
        """Return the temperature of the body at the last accepted state."""
        return Temperature(self.scene.temperature)

    def _energy_rule(self) -> EnergyRule:
        """Return the quadrature rule of the energy."""
        return EnergyRule.of_degree(self.domain.basix_cell(), self.scene.quadrature_degree)

    def law_axes(self, material: Any, names: list[str]) -> Callable:
        """Return the function that refers F to the directions that a material in some layers takes; here those of F."""
        return lambda F: F

    def mean_over_depths(self, law: Callable, terms: MaterialTerms) -> Callable:
        """Return the law f(T) of a coefficient at a point; for temperatures at several depths the mean of f."""
        return law

    def _add_materials(self) -> None:
        """Set the coefficients, histories and energies of the materials."""
        self._terms = {name: terms for material, names in self._groups()
                       for terms in [MaterialTerms(self, material, names)] for name in names}
        self.terms = list(dict.fromkeys(self._terms.values()))
        pasts = [terms.material.integral.history(self, terms) for terms in self.terms if terms.past_integrals]
        self.refreshed: list[Any] = list(pasts)
        changing = [terms for terms in self.terms if terms.internal]
        self.histories: list[History] = [*pasts, *(MaterialHistory(self, terms) for terms in changing)]
        self.potential = self._energy(MaterialTerms.step_energy)
        self.energy = self.dissipation = None
        timed = [terms for terms in changing if terms.material.rate_dependent]
        if all(terms.material.stores_energy for terms in self.terms):
            self.energy = self._energy(MaterialTerms.stored_energy) if changing else self.potential
            self.dissipation = self.dissipated(self._scale) if timed else None
        damaged = [self.weighted(self._scale * terms.damage_energy(), terms.names)
                   for terms in changing if terms not in timed]
        self.damage_energy = sum(damaged[1:], damaged[0]) if damaged else None

    def _add_supports(self, body: LoadedBody) -> None:
        """Add the energies of elastic supports."""
        self.elastic_supports = []
        for support in self.scene.supports:
            energy = body.stored(support)
            if energy is not None:
                active = self.constant(1.0)
                self.elastic_supports.append((support, active))
                self.potential, self.energy = (None if e is None else e + self._scale * active * energy
                                               for e in (self.potential, self.energy))

    def _residual(self, body: LoadedBody) -> tuple[Any, Any, Any]:
        """Return the residual and its derivatives by the control, through loads and through time (UFL, rank 1).

        body: fields and integrals for the virtual works. A derivative that the scene does not have is None.
        """
        v, control = self.test_function(), self._control
        residual = ufl.derivative(self.potential, self.w, v)
        for entry in self.terms:
            if work := entry.unsymmetric_work(self.elastic_F, lambda f: ufl.derivative(f, self.w, v)):
                residual += self.weighted(self._scale * work, entry.names)
        timed = ufl.Form([i for i in self.potential.integrals() if self.control in extract_constants(i.integrand())])
        by_time = ufl.derivative(ufl.diff(timed, control), self.w, v) if timed.integrals() else None
        terms = []
        self._loads, self.load_works, self.load_values = [], [], []
        for load, scale in zip(self.scene.loads, self.scales):
            base, rate = self.constant(0.0 if load.driven else load.value), self.constant(0.0)
            self._loads.append((load, base, rate))
            value = self.constant(scale) * (base + rate * control) if load.driven else base
            self.load_values.append((load, value))
            work = body.work(load, value)
            self.load_works.append(work)
            residual -= self._scale * work
            if load.driven:
                terms.append(-self._scale * ufl.diff(work, control))
        return residual, sum(terms[1:], terms[0]) if terms else None, by_time

    def constant(self, value: float) -> fem.Constant:
        """Return a UFL constant; a new value needs no new compilation of the forms that contain it."""
        return fem.Constant(self.domain, PETSc.ScalarType(value))

    @property
    def clock(self) -> float:
        """Process time at control 0; a run that chooses its own time steps sets it before each step."""
        return float(self._time[0].value)

    @clock.setter
    def clock(self, time: float) -> None:
        self._time[0].value = time

    def time_at(self, control: float) -> float:
        """Return the process time at a control, for the current step data (`StepData`)."""
        base, rate = self._time
        return float(base.value + rate.value * control)

    @property
    def time_now(self) -> float:
        """Process time at the current control of the forms."""
        return self.time_at(float(self.control.value))

    def set_loads(self, setting: Any) -> None:
        """Set loads, elastic supports and process time as functions of the control, from step data (`StepData`)."""
        for support, factor in self.elastic_supports:
            factor.value = float(self.scene.items.index(support) not in setting.inactive)
        for i, (load, base, rate) in enumerate(self._loads):
            active = i not in setting.inactive
            base.value = active * (setting.base[i] if load.driven else load.value)
            rate.value = active * setting.rate[i]
        for constant, value in zip(self._time, (setting.base[-1], setting.rate[-1])):
            constant.value = value

    def carried_forces(self, face: Any, fields: np.ndarray, control: float) -> np.ndarray | float:
        """Return the forces of pressures that act on a tool between the points of a contact face; 0."""
        return 0.0

    def dissipated(self, factor: Any) -> Any:
        """Return the integral of `factor` times the dissipated power per volume (UFL, rank 0)."""
        return sum(self.weighted(factor * terms.dissipation(self.elastic_F), terms.names)
                   for terms in self.terms if terms.internal)

    def elastic(self, F: Any) -> Any:
        """Return the elastic part of a deformation gradient, without thermal expansion (UFL, shape (3, 3))."""
        return F if self._free is None else self._free.elastic(F)

    def temperatures(self, terms: MaterialTerms) -> np.ndarray:
        """Return the temperatures at q points of the cells of `terms`, now and before, shape (1 or 2, cells, q)."""
        return np.asarray(self.temperature.last_two_states(terms.cells, terms.places))

    def update_temperature(self) -> None:
        """Update material constants to a changed temperature, else raise `InputError`; scales stay; collective."""
        following: list[Any] = [*self.terms, *([self._free] if self._free else [])]
        call_on_all_ranks(self.comm, [entry.update_temperature for entry in following])

    def cells_of(self, layers: list[str]) -> np.ndarray:
        """Return the local numbers of the cells of some layers, with ghosts, ascending, shape (n,)."""
        return np.sort(np.concatenate([self.mesh.cells.find(self.mesh.layers[name]) for name in layers]))

    def admissible(self) -> Any:
        """Return a new check of the fields `w` for inverted elements and points beyond the axis."""
        return Admissible(self)

    def probe(self, problem: Any, points: Any) -> Probe:
        """Return the `Probe` of the displacement at reference points (R, Z), shape (n, 2), length."""
        return Probe(problem, points) if (old := self.scene.state_transfer) is None else old.probe(problem, points)

    def mean_row(self, constraint: Any) -> Any:
        """Return the linear form of the mean of a dimensionless displacement component over a boundary (UFL)."""
        raise NotImplementedError

    def idle_unknowns(self) -> list[tuple[Any, np.ndarray]]:
        """Return the unknowns that appear in no equation and stay 0, as (subspace, local numbers)."""
        return []

    def set_stiff(self) -> None:
        """Set `w` to fields with a regular tangent, for the first direction of a path if it is singular at 0."""
        self.w.x.array[:] = 0

    def compile(self, form: Any) -> Any:
        """Return the compiled UFL form; raise `TimeoutError` if another process does not finish compiling it."""
        try:
            return _compat.compile_form(form)
        except TimeoutError as error:
            raise TimeoutError(
                f"waited {_compat.JIT_OPTIONS['timeout']} s for another process to compile a form; a compilation that"
                " was killed leaves such a wait behind: if no other run is going on, remove the folder"
                " .cache/fenics") from error

    def compile_ahead(self, *forms: Any) -> None:
        """Compile forms by one call of the C compiler, for `compile`; None is skipped; collective."""
        _compat.compile_ahead(self.comm, [form for form in forms if form is not None])

    @cached_property
    def displacement_dofmaps(self) -> list[Any]:
        """Degrees of freedom of the cells, for each displacement component (DOLFINx `DofMap`)."""
        return [self.space.sub(0).sub(i).dofmap for i in range(self.scene.kinematics.components)]

    @cached_property
    def tangent(self) -> Any:
        """Derivative of the residual with respect to the unknowns, a bilinear form."""
        return ufl.derivative(self.residual, self.w, ufl.TrialFunction(self.space))

    def path_forms(self) -> list[Any]:
        """Return the UFL forms that every run compiles, to compile them together; None for a missing derivative."""
        areas = {contact.on: self.area(contact.on) for contact in self.scene.contacts}
        return [self.residual, self.tangent, self.control_derivative, self.time_derivative, self.metric_row(),
                *areas.values()]

    def integral(self, form: Any) -> float:
        """Return the value of a UFL form of rank 0 over all ranks, in its own unit."""
        return float(combined(self.comm, fem.assemble_scalar(self.compile(form)), MPI.SUM))

    def test_function(self) -> Any:
        """Return the test function of all fields (UFL, dimensionless)."""
        return ufl.TestFunction(self.space)

    def test_displacement(self) -> Any:
        """Return the virtual displacement (UFL, length, shape (2,))."""
        return self.constant(self.length) * ufl.split(self.test_function())[0]

    def metric_row(self) -> Any:
        r"""Return the linear form :math:`\frac{1}{V} \int \sum_i v_i \, dV`, a lumped mass matrix of the displacement.
        """
        v = ufl.split(self.test_function())[0]
        dx = ufl.dx(self.domain, metadata={"quadrature_degree": 4})
        return sum(v[i] for i in range(self.domain.geometry.dim)) * self.weight / self.constant(self.volume) * dx

    def viscosity(self) -> Any:
        """Return (1/V) int dF/dt : delta F dV, the bilinear form of a viscous stress (UFL, dimensionless)."""
        F = self.scene.kinematics.deformation_gradient(self.u, self.X)
        potential = ufl.inner(F, F) / 2 * self.weight / self.constant(self.volume)
        dx = ufl.dx(self.domain, metadata={"quadrature_degree": 4})
        return ufl.derivative(ufl.derivative(potential * dx, self.w, self.test_function()), self.w)

    def thickness(self, boundary: str) -> float:
        """Return the mean thickness behind a boundary, reference volume over its reference area, length."""
        return self.volume / self.integral(self.area(boundary))

    def area(self, boundary: str) -> Any:
        """Return the scalar form of the reference area of a boundary (UFL, rank 0)."""
        return self.scene.kinematics.weight(self.X) * self.face(boundary, 2)[1]

    @abstractmethod
    def face(self, name: str, quadrature_degree: int) -> tuple[Any, ufl.Measure]:
        """Return the outward reference normal (UFL, shape (2,)) and the measure of a boundary on which a load acts."""

    @abstractmethod
    def constraints(self, support: Any) -> list[Any]:
        """Return the `Constrained` and `ConstrainedMean` that a support imposes on the displacement field."""

    @abstractmethod
    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Return points (n, 2), length, on the fields' mesh: the same, or of the mid-surface at the same R."""

    @abstractmethod
    def weighted(self, density: Any, layers: list[str], metadata: dict | None = None) -> Any:
        """Return the integral of a density (UFL scalar) over the reference volume of layers; per depth in plane strain.

        metadata: of the UFL measure; None: the scene's quadrature.
        """

    @abstractmethod
    def mid(self, layer: str, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        """Return heights (n,), length, at which functions are evaluated: Z, in membranes halfway through the layer."""

    @abstractmethod
    def _make_mesh(self) -> Any:
        """Return the `Mesh` of the fields."""

    @abstractmethod
    def _elements(self, cell: Any) -> tuple[Any, list[Any]]:
        """Return the scalar element of a displacement component, and the elements of all fields."""

    @abstractmethod
    def _groups(self) -> list[tuple[Any, list[str]]]:
        """Return a list of (material, names of its layers), one for each term of the energy."""

    @abstractmethod
    def _weight(self) -> Any:
        """Return the reference volume per measure `dx` of the mesh (UFL scalar), such as 2 pi R."""

    @abstractmethod
    def _deformation_gradient(self) -> Any:
        """Return the deformation gradient (UFL, shape (3, 3))."""

    @abstractmethod
    def _energy(self, density: Any) -> Any:
        """Return the integral over the body of density(`MaterialTerms`, F) (stress), over stress times volume (UFL)."""
