"""The discrete equations of a scene: F(x, control) = 0, its tangent, and everything created once.

Unknowns are dimensionless: displacement over L (the largest extent of the mesh), pressure over mu (the largest
shear modulus), and the Lagrange multipliers of `MeanHeld` supports, kept at the end of the last rank's part. The
energy is divided by mu times the reference volume. So a run does not depend on the user's units, and what `solve`
sees are numbers of order one.
"""

from __future__ import annotations

import itertools
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from . import _compat
from .errors import InputError
from .physics import kinematics as kin
from .physics.supports import Held
from .scene import Scene

_names = itertools.count()


class Problem:
    """Residual, tangent and derivative by the control of a scene.

    Attributes:
        scene: the scene.
        length, stress: the scales L and mu, in the user's units.
        control_scale: the user's control (pressure or length) per unit of the dimensionless control.
        w: the `fem.Function` of the fields (dimensionless), the state that forms see.
        u: the displacement (UFL, the user's unit of length).
    """

    def __init__(self, scene: Scene):
        self.scene = scene
        self.domain = scene.mesh.domain
        self.comm = self.domain.comm
        moduli = {id(m): m.shear_modulus for m in scene.materials.values()}
        self.length, self.stress = float(max(scene.extent)), max(moduli.values())
        self._colours = _colour(scene) if scene.incompressibility.pressure_degree is not None else {}
        self.space = self._make_space()
        self.w = fem.Function(self.space, name="w")
        self.control = self._constant(0.0)
        self._variable = ufl.variable(self.control)
        fields = ufl.split(self.w)
        self.u = self._constant(self.length) * fields[0]
        self.X = ufl.SpatialCoordinate(self.domain)
        self.dx = ufl.Measure("dx", self.domain, subdomain_data=scene.mesh.cells,
                              metadata={"quadrature_degree": scene.quadrature_degree})
        self.ds = ufl.Measure("ds", self.domain, subdomain_data=scene.mesh.facets)
        self.weight = scene.kinematics.weight(self.X)
        self.volume = self.integral(self.weight * self.dx)
        self.control_scale = self._scale_of_control()
        self._make_forms(fields, moduli)
        self._make_supports()
        self._make_algebra()

    # --- what solve sees -------------------------------------------------------------------------------

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns: fields and multipliers, all ranks."""
        return int(self.x.getSize())

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """out = F(x, control); at a solution `force_scale` is then the norm of all support forces."""
        multipliers = self.set_state(x, control)
        values = self._assemble(self._residual_form)
        self.force_scale = np.sqrt(self._dot(values, values))
        for mu, row in zip(multipliers, self._rows):
            values += mu * row
        values[self._held] = x.array_r[: self._n][self._held] - self._motion * control
        self._fill(out, values, [self._dot(row, x.array_r[: self._n]) for row in self._rows])

    def tangent(self, x: PETSc.Vec, control: float) -> PETSc.Mat:
        """dF/dx at (x, control); the same matrix every time, refilled."""
        self.set_state(x, control)
        self._fill_matrix(self.matrix)
        return self.matrix

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """out = dF/dcontrol at (x, control)."""
        self.set_state(x, control)
        values = np.zeros(self._n)
        if self._control_form is not None:
            values += self._assemble(self._control_form)
        if self._lift_form is not None:
            values += self._assemble(self._lift_form)
        values[self._held] = -self._motion
        self._fill(out, values, [0.0] * len(self._rows))

    def inner(self, a: PETSc.Vec, b: PETSc.Vec) -> float:
        """Mean over the reference volume of the product of two displacement fields: no mesh, no unit in it."""
        n = self._n
        return self._dot(self._metric * a.array_r[:n], b.array_r[:n])

    def metric_times(self, a: PETSc.Vec, out: PETSc.Vec) -> None:
        """out with inner(a, b) = out . b."""
        self._fill(out, self._metric * a.array_r[: self._n], [0.0] * len(self._rows))

    def fill(self, out: PETSc.Vec, row: np.ndarray) -> None:
        """out = a row of weights on the owned fields, shape (n,); zero on multipliers."""
        self._fill(out, row, [0.0] * len(self._rows))

    @property
    def symmetric(self) -> bool:
        """True if the tangent is symmetric: no follower load in the scene."""
        return all(getattr(load, "symmetric", False) for load in self.scene.loads)

    # --- what results see ------------------------------------------------------------------------------

    def set_state(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Put the fields of x and the control where the forms see them; returns the multipliers, all ranks."""
        self.control.value = control
        self.w.x.array[: self._n] = x.array_r[: self._n]
        self.w.x.scatter_forward()
        if not self._rows:
            return np.zeros(0)
        tail = x.array_r[self._n:].copy() if self.comm.rank == self.comm.size - 1 else None
        return self.comm.bcast(tail, root=self.comm.size - 1)

    def integral(self, form: Any) -> float:
        """The value of a UFL integral over all ranks. Compiles on each call: for scalars needed once."""
        return self.assemble_scalar(self.compile(form))

    def compile(self, form: Any) -> Any:
        """A compiled form."""
        return fem.form(form, jit_options=_compat.JIT_OPTIONS)

    def assemble_scalar(self, form: Any) -> float:
        """The value of a compiled scalar form over all ranks, at the state last set."""
        return float(self.comm.allreduce(fem.assemble_scalar(form), MPI.SUM))

    def gradient_of(self, form: Any, out: PETSc.Vec) -> None:
        """out = a compiled linear form, assembled at the state last set."""
        self.fill(out, self._assemble(form))

    def test_function(self) -> Any:
        """The test function of all fields (dimensionless)."""
        return ufl.TestFunction(self.space)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        for thing in (self.matrix, self.x):
            thing.destroy()

    # --- how it is made --------------------------------------------------------------------------------

    def _constant(self, value: float) -> fem.Constant:
        return fem.Constant(self.domain, PETSc.ScalarType(value))

    def _make_space(self) -> Any:
        cell = self.domain.basix_cell()
        elements = [basix.ufl.element("Lagrange", cell, 2, shape=(2,))]
        if self._colours:
            degree = self.scene.incompressibility.pressure_degree
            n = max(self._colours.values()) + 1
            elements += [basix.ufl.element("Lagrange", cell, degree)] * n
        return fem.functionspace(self.domain, basix.ufl.mixed_element(elements))

    def _scale_of_control(self) -> float:
        """Pressure: mu times thickness over length, thickness being volume over loaded area. Motion: L."""
        driven = self.scene.driven
        if driven is None or not hasattr(driven, "virtual_work"):
            return self.length
        area = self.integral(self.weight * self.ds(self.scene.mesh.boundaries[driven.on],
                                                   metadata={"quadrature_degree": 2}))
        return self.stress * self.volume / (area * self.length)

    def _make_forms(self, fields: Any, moduli: dict[int, float]) -> None:
        scene, kinematics = self.scene, self.scene.kinematics
        v = ufl.TestFunction(self.space)
        scale = self._constant(1 / (self.stress * self.volume))
        eps = self._constant(scene.incompressibility.eps)
        F = kinematics.deformation_gradient(self.u, self.X)
        J = kin.volume_ratio(F)
        energy = 0
        for material, names in _by_material(scene):
            tags = tuple(scene.mesh.layers[n] for n in names)
            dx = self.dx if len(tags) == len(scene.mesh.layers) else self.dx(tags)
            constants = {k: self._constant(c) for k, c in material.parameters.items()}
            modulus = self._constant(moduli[id(material)])
            p = self._constant(self.stress) * fields[1 + self._colours[names[0]]] if self._colours else None
            strain_energy = material.strain_energy(F, **constants)
            if scene.incompressibility.stress_free:
                strain_energy -= self._constant(material.rest_stress) * ufl.ln(J)
            energy += scale * strain_energy * self.weight * dx
            for density, metadata in scene.incompressibility.terms(J, p, modulus, eps):
                energy += scale * density * self.weight * dx(metadata=metadata)
        residual = ufl.derivative(energy, self.w, v)
        du = self._constant(self.length) * ufl.split(v)[0]
        driven = None
        N = ufl.FacetNormal(self.domain)
        for load in scene.loads:
            value = self._constant(self.control_scale) * self._variable if load.driven else self._constant(load.value)
            work = load.virtual_work(kinematics, self.u, du, self.X, N, value)
            ds = self.ds(scene.mesh.boundaries[load.on], metadata={"quadrature_degree": load.quadrature_degree})
            residual -= scale * work * ds
            if load.driven:
                driven = -scale * ufl.diff(work, self._variable) * ds
        tangent = ufl.derivative(residual, self.w, ufl.TrialFunction(self.space))
        self._residual_form = self.compile(residual)
        self._tangent_form = self.compile(tangent)
        self._control_form = None if driven is None else self.compile(driven)
        self._tangent_ufl = tangent
        self.volume_form = self.compile(J * self.weight * self.dx)
        self.volume_error_form = self.compile((J - 1) ** 2 * self.weight * self.dx)
        self._weights_form = self.compile(sum(ufl.split(v)[0]) * self.weight * ufl.dx(
            self.domain, metadata={"quadrature_degree": 3}))
        self.energy_form = self.compile(energy)      # over stress * volume

    def _make_supports(self) -> None:
        scene, space = self.scene, self.space
        self._n = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
        zero = PETSc.ScalarType(0)
        self._bcs, held, motion, means = [], [], [], []
        for support in scene.supports:
            for item in support.constraints():
                sub = space.sub(0).sub(item.component)
                if not isinstance(item, Held):
                    means.append((item, sub))
                    continue
                if item.on is not None:
                    dofs = fem.locate_dofs_topological(sub, 1, scene.mesh.facets_of(item.on))
                else:
                    dofs = self._dofs_at(support, sub, item.point)
                self._bcs.append(fem.dirichletbc(zero, dofs, sub))
                held.append(dofs)
                motion.append(np.full(len(dofs), self.control_scale / self.length if item.driven else 0.0))
        for colour in sorted(set(self._colours.values())):
            sub = space.sub(1 + colour)
            tags = [scene.mesh.layers[n] for n, c in self._colours.items() if c == colour]
            cells = np.concatenate([scene.mesh.cells.find(t) for t in tags])
            dofs = sub.dofmap.list
            outside = np.setdiff1d(dofs, dofs[cells]).astype(np.int32)
            self._bcs.append(fem.dirichletbc(zero, outside, sub))
            held.append(outside)
            motion.append(np.zeros(len(outside)))
        held, motion = np.concatenate(held), np.concatenate(motion)
        order = np.argsort(-np.abs(motion), kind="stable")      # where two supports meet, the driven one counts
        held, first = np.unique(held[order], return_index=True)
        motion = motion[order][first]
        own = held < self._n
        self._held, self._motion = held[own], motion[own]
        self._rows = [self._mean_row(item) for item, _ in means]
        self._lift_form = None
        if np.any(motion != 0) or (self.scene.driven is not None and not hasattr(self.scene.driven, "virtual_work")):
            lift = fem.Function(space)
            lift.x.array[held] = motion
            self._lift_form = self.compile(ufl.action(self._tangent_ufl, lift))

    def _dofs_at(self, support: Any, sub: Any, point: tuple[float, float]) -> np.ndarray:
        collapsed, to_parent = sub.collapse()
        found = fem.locate_dofs_geometrical(
            (sub, collapsed), lambda x: np.hypot(x[0] - point[0], x[1] - point[1]) < 1e-8 * self.length)[0]
        if self.comm.allreduce(len(found), MPI.MAX) == 0:
            raise InputError(f"{support!r}: the mesh has no node at this place")
        return found

    def _mean_row(self, item: Any) -> np.ndarray:
        """c with c . w = mean of a displacement component over a boundary, shape (owned unknowns,)."""
        ds = self.ds(self.scene.mesh.boundaries[item.on], metadata={"quadrature_degree": 3})
        area = self.integral(self.weight * ds)
        v = ufl.split(self.test_function())[0][item.component]
        row = self._assemble(self.compile(v * self.weight * ds)) / area
        row[self._held] = 0
        return row

    def _make_algebra(self) -> None:
        n, m = self._n, len(self._rows)
        last = self.comm.rank == self.comm.size - 1
        index_map = self.space.dofmap.index_map
        plain = fem_petsc.create_matrix(self._tangent_form)
        self.control.value = 0.0
        fem_petsc.assemble_matrix(plain, self._tangent_form, bcs=self._bcs)
        plain.assemble()
        indptr, indices, values = plain.getValuesCSR()
        plain.destroy()
        first = index_map.size_global
        new_ptr, new_cols, new_vals = [0], [], []
        self._row_entries = []
        for i in range(n):
            cols, vals = indices[indptr[i]:indptr[i + 1]], values[indptr[i]:indptr[i + 1]]
            extra = [first + k for k, row in enumerate(self._rows) if row[i] != 0]
            new_cols += [*cols, *extra]
            new_vals += [*vals, *([0.0] * len(extra))]
            new_ptr.append(len(new_cols))
        offset = index_map.local_range[0]
        for k, row in enumerate(self._rows):
            mine = np.flatnonzero(row)
            everyone = self.comm.allgather((mine + offset, row[mine]))
            columns = np.concatenate([c for c, _ in everyone])
            weights = np.concatenate([w for _, w in everyone])
            self._row_entries.append((mine + offset, row[mine], columns, weights))
            if last:
                new_cols += [*columns, *(first + j for j in range(m))]
                new_vals += [0.0] * (len(columns) + m)
                new_ptr.append(len(new_cols))
        size = n + (m if last else 0)
        self.matrix = PETSc.Mat().createAIJ(
            ((size, None), (size, None)), csr=(np.array(new_ptr, dtype=PETSc.IntType), np.array(
                new_cols, dtype=PETSc.IntType), np.array(new_vals)), comm=self.comm)
        ghosted = index_map.local_to_global(np.arange(n + index_map.num_ghosts, dtype=np.int32))
        mapping = PETSc.LGMap().create(ghosted.astype(PETSc.IntType), comm=self.comm)
        self.matrix.setLGMap(mapping, mapping)
        mapping.destroy()
        self.matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        if self.symmetric:
            self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.x = self.matrix.createVecRight()
        self._buffer = la.vector(index_map, self.space.dofmap.index_map_bs)
        weights = self._assemble(self._weights_form) / self.volume
        self._metric = np.maximum(weights, 0)

    def _fill_matrix(self, A: PETSc.Mat) -> None:
        A.zeroEntries()
        fem_petsc.assemble_matrix(A, self._tangent_form, bcs=self._bcs)
        first = self.space.dofmap.index_map.size_global
        last = self.comm.rank == self.comm.size - 1
        A.assemble(PETSc.Mat.AssemblyType.FLUSH)
        for k, (mine, weights, columns, all_weights) in enumerate(self._row_entries):
            if len(mine):
                A.setValues(mine.astype(PETSc.IntType), [first + k], weights, addv=PETSc.InsertMode.ADD_VALUES)
            if last:
                A.setValues([first + k], columns.astype(PETSc.IntType), all_weights,
                            addv=PETSc.InsertMode.ADD_VALUES)
        A.assemble()

    def _assemble(self, form: Any) -> np.ndarray:
        """A linear form, owned part, shape (n,); the array is new."""
        self._buffer_ready()
        array = self._buffer.array
        array[:] = 0
        fem.assemble_vector(array, form)
        self._buffer.scatter_reverse(la.InsertMode.add)
        return array[: self._n].copy()

    def _buffer_ready(self) -> None:
        if not hasattr(self, "_buffer"):
            self._buffer = la.vector(self.space.dofmap.index_map, self.space.dofmap.index_map_bs)

    def _fill(self, out: PETSc.Vec, values: np.ndarray, tail: list[float]) -> None:
        array = out.array_w
        array[: self._n] = values
        if self.comm.rank == self.comm.size - 1:
            array[self._n:] = tail

    def _dot(self, a: np.ndarray, b: np.ndarray) -> float:
        return float(self.comm.allreduce(float(np.dot(a, b)), MPI.SUM))


def _by_material(scene: Scene) -> list[tuple[Any, list[str]]]:
    """[(material, its layers)]: layers of one material object are one body."""
    groups: dict[int, tuple[Any, list[str]]] = {}
    for name in scene.mesh.layers:
        material = scene.materials[name]
        groups.setdefault(id(material), (material, []))[1].append(name)
    return list(groups.values())


def _colour(scene: Scene) -> dict[str, int]:
    """{layer: number of its pressure field}: layers of different materials that touch get different fields."""
    mesh = scene.mesh
    topology = mesh.domain.topology
    topology.create_connectivity(2, 0)
    vertices = topology.index_map(0)
    comm = mesh.domain.comm
    groups = [names for _, names in _by_material(scene)]
    touches = []
    for names in groups:
        cells = np.concatenate([mesh.cells.find(mesh.layers[n]) for n in names])
        mine = {v for c in cells for v in topology.connectivity(2, 0).links(c)}
        touches.append(set(vertices.local_to_global(np.array(sorted(mine), dtype=np.int32)).tolist()))
    touches = [set().union(*parts) for parts in zip(*comm.allgather(touches))]
    colours: list[int] = []
    for i, mine in enumerate(touches):
        taken = {colours[j] for j in range(i) if touches[j] & mine}
        colours.append(next(c for c in itertools.count() if c not in taken))
    return {name: colours[i] for i, names in enumerate(groups) for name in names}
