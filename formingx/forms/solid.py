"""Scene as an incompressible solid of finite thickness."""

from __future__ import annotations

import itertools
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, la

from .. import _compat
from ..physics import kinematics as kin
from .formulation import Formulation
from .material_terms import MaterialTerms

_THIN_VOLUME = 5e-4  # volume over length^3 (a disc of r0/h0 = 6000) below which the bending stiffness is round-off
_FIRST_STRETCH = 1e-4      # u = _FIRST_STRETCH X, at which the first direction of a path is taken


class Solid(Formulation):
    """Forms of a scene as an incompressible solid; the fields are displacement and, in mixed models, pressures.

    Attributes:
        bodies: list of (material, its layers); layers that share one material object form one body.
        pressure_of: {layer: number of its pressure field}; empty without pressure unknowns.
    """

    def boundary(self, name: str, quadrature_degree: int) -> ufl.Measure:
        """Return the UFL measure of a boundary in the reference configuration."""
        return self.ds(self.scene.mesh.boundaries[name], metadata={"quadrature_degree": quadrature_degree})

    def face(self, name: str, quadrature_degree: int) -> tuple[Any, ufl.Measure]:
        return ufl.FacetNormal(self.domain), self.boundary(name, quadrature_degree)

    def constraints(self, support: Any) -> list[Any]:
        return support.constraints()

    def nearest(self, points: np.ndarray) -> np.ndarray:
        return points

    def mid(self, layer: str, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        return Z

    def weighted(self, density: Any, layers: list[str], metadata: dict | None = None) -> Any:
        tags = tuple(self.mesh.layers[name] for name in layers)
        dx = self.dx if len(tags) == len(self.mesh.layers) else self.dx(tags)
        return density * self.weight * (dx(metadata=metadata) if metadata else dx)

    def mean_row(self, constraint: Any) -> Any:
        ds, weight = self.boundary(constraint.on, 3), self.weight
        if constraint.by_stiffness:
            stiffness = fem.Function(fem.functionspace(self.domain, ("DG", 0)))
            for name, tag in self.scene.mesh.layers.items():
                stiffness.x.array[self.scene.mesh.cells.find(tag)] = self.scene.shear_modulus(name) / self.stress
            weight = weight * stiffness
        v = ufl.split(self.test_function())[0][constraint.component]
        return v * weight / self.constant(self.integral(weight * ds)) * ds

    def path_forms(self) -> list[Any]:
        rows = {contact.on: self.length_row(contact.on) for contact in self.scene.contacts if contact.points == "nodes"}
        return [*super().path_forms(), *rows.values()]

    def length_row(self, boundary: str) -> Any:
        """Return the linear form of the tributary lengths of boundary nodes, at their first components (UFL)."""
        metadata = {"quadrature_rule": "GLL", "quadrature_degree": 3}
        return ufl.split(self.test_function())[0][0] * self.ds(self.scene.mesh.boundaries[boundary], metadata=metadata)

    def idle_unknowns(self) -> list[tuple[Any, np.ndarray]]:
        """Return the pressures that belong to no cell of their layers, as (subspace, local numbers)."""
        found, mesh, dofmap = [], self.mesh, self.space.dofmap
        for colour in sorted(set(self.pressure_of.values())):
            sub = self.space.sub(1 + colour)
            mine = [name for name, c in self.pressure_of.items() if c == colour]
            cells = np.concatenate([mesh.cells.find(mesh.layers[name]) for name in mine])
            used = la.vector(dofmap.index_map, 1)              # the cells may all be on another rank
            used.array[sub.dofmap.list[cells].ravel()] = 1
            used.scatter_reverse(la.InsertMode.add)
            used.scatter_forward()
            dofs = np.unique(sub.dofmap.list)
            found.append((sub, dofs[used.array[dofs] == 0].astype(np.int32)))
        return found

    def set_stiff(self) -> None:
        """Set the fields `w` to 0, or in a very thin sheet to a small uniform strain, u = 1e-4 X.

        The bending stiffness of such a sheet is below round-off; the stress of the strain stiffens it.
        """
        super().set_stiff()
        if self.volume < _THIN_VOLUME * self.length**self.scene.kinematics.dimension_of_volume:
            space, dofs = self.space.sub(0).collapse()
            u = fem.Function(space)                    # interpolated, since unknowns of bubbles are no nodal values
            stretched = self.constant(_FIRST_STRETCH / self.length) * self.X
            u.interpolate(_compat.compile_expression(stretched, _compat.interpolation_points(space)))
            self.w.x.array[dofs] = u.x.array

    def _make_mesh(self) -> Any:
        scene = self.scene
        self.bodies = _bodies(scene)
        self.pressure_of = _colour(scene) if scene.model.pressure else {}
        return scene.mesh

    def mode_space(self) -> fem.FunctionSpace:
        """Return the space of instability modes: displacement amplitudes, shape (3,), and pressures."""
        return fem.functionspace(self.domain, basix.ufl.mixed_element(self._elements(self.domain.basix_cell(), 3)[1]))

    def _elements(self, cell: Any, components: int = 2) -> tuple[Any, list[Any]]:
        pressure = self.scene.model.pressure
        element = basix.ufl.element("Lagrange", cell, 2)
        if pressure and pressure.bubble:
            element = basix.ufl.enriched_element([element, basix.ufl.element("Bubble", cell, 3)])
        fields = [basix.ufl.blocked_element(element, shape=(components,))]
        if pressure:
            field = basix.ufl.element(pressure.family, cell, pressure.degree)
            fields += [field] * (max(self.pressure_of.values()) + 1)
        return element, fields

    def _weight(self) -> Any:
        return self.scene.kinematics.weight(self.X)

    def _deformation_gradient(self) -> Any:
        F = self.scene.kinematics.deformation_gradient(self.u, self.X)
        if self.scene.state_transfer is None:
            return F
        before, self.ratio_before = self.scene.state_transfer.gradient(self)
        return F * before

    def _groups(self) -> list[tuple[Any, list[str]]]:
        return self.bodies

    def _energy(self, density: Any) -> Any:
        self._eps, energy = self.constant(self.scene.model.eps), 0
        self._volume_stiffness = self.constant(self.scene.model.volume_stiffness)
        for _, names in self.bodies:
            for term, metadata in self.energy_densities(names, self.F, density):
                energy += self.weighted(self._scale * term, names, metadata)
        return energy

    def energy_densities(self, names: list[str], F: Any,
                         density: Any = MaterialTerms.step_energy) -> list[tuple[Any, dict]]:
        r"""Return [(energy per reference volume (UFL, stress), quadrature metadata)] of layers of a body.

        .. math:: W(F) - \sigma_0 \ln J + p (J - 1)

        W is the strain energy, J the volume ratio without thermal expansion, p a pressure field, and :math:`\sigma_0`
        the stress dW/dF11 at F = I. A penalty model has a penalty in place of :math:`p (J - 1)`.
        """
        return self.elastic_densities(names, self.elastic(F), ufl.split(self.w)[1:], density)

    def elastic_densities(self, names: list[str], F: Any, pressures: Any, density: Any = MaterialTerms.step_energy
                          ) -> list[tuple[Any, dict]]:
        """Return the terms of the energy density of layers of one material, for an elastic F (UFL, shape (3, 3)).

        Each is (energy per reference volume (UFL, stress), quadrature metadata): the strain energy, and the pressure
        field or penalty of incompressibility. pressures: all fields, numbered as in `pressure_of`.
        """
        model, terms, J = self.scene.model, self._terms[names[0]], kin.volume_ratio(F) / self.ratio_before
        W = density(terms, F)
        if model.stress_free:
            W -= terms.rest_stress * ufl.ln(J)
        modulus = self.constant(max(self.scene.shear_modulus(name) for name in names))
        if model.volume_stiffness:
            W += self._volume_stiffness * modulus * (J - 1) ** 2 / 2
        p = self.constant(self.stress) * pressures[self.pressure_of[names[0]]] if self.pressure_of else None
        return [(W, {}), *model.terms(J, p, modulus, self._eps)]


def _bodies(scene: Any) -> list[tuple[Any, list[str]]]:
    """Return a list of (material, its layers); layers that share one material object form one body."""
    groups: dict[int, tuple[Any, list[str]]] = {}
    for name in scene.mesh.layers:
        material = scene.materials[name]
        groups.setdefault(id(material), (material, []))[1].append(name)
    return list(groups.values())


def _colour(scene: Any) -> dict[str, int]:
    """Return {layer: number of its pressure field}; adjacent layers of different materials have different fields."""
    mesh = scene.mesh
    if not scene.model.pressure.continuous:
        return dict.fromkeys(mesh.layers, 0)
    topology = mesh.domain.topology
    topology.create_connectivity(2, 0)
    groups = [names for _, names in _bodies(scene)]
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
