r"""Heat conduction in the deformed body, M dT/dt = R(T), on quadratic triangles.

Per reference volume, with F and J of a displacement and the heat flux q into the deformed face (Nanson's formula):

.. math::
    \rho c \frac{dT}{dt} = \mathrm{Div}(k J F^{-1} F^{-T} \mathrm{Grad}\, T) + J s, \qquad
    k J F^{-1} F^{-T} \mathrm{Grad}\, T \cdot N = q |J F^{-T} N|

The forms of a body without displacement do not contain F. All forms are divided by the heat capacity of the whole body.
The entries of M therefore add up to 1, and R is in degrees per time.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from ... import _compat
from ...errors import ConvergenceError
from ...mesh import Mesh
from ...mesh.nodes import dof_positions
from ...physics import kinematics as kin
from ...ranks import gathered
from ...results.evaluate.profile import distance_to_line
from ...solve.linear import DirectSolver
from ...values.table import Table
from .boundaries import Absorption, FixedTemperature, ThermalProperties
from .contact import ContactWithTool, HeatContact
from .implicit_stage import ImplicitStage
from .vectors import HeatVectors

_MAX_ITERATIONS = 20
"""Largest number of Newton iterations in an implicit stage."""


class Conduction(HeatVectors):
    """Finite element equations M dT/dt = R(T) of heat conduction in a body and in the tools that touch it.

    A temperature state is a list. Its first array has the temperatures of the body at the n locally owned nodes. One
    array follows per tool contact, shape (contact nodes, m). It has the excess temperatures of the tool over its back,
    at m nodes along the depth below each contact node, the face first. Entries of M and R of the body are divided by
    `capacity`: M sums to 1, and R is in degrees per time.

    Attributes:
        mesh: the `Mesh`.
        comm: MPI communicator.
        space: function space of the temperature.
        T: temperature `Function` at which the forms are assembled.
        points: reference positions of the locally owned nodes, shape (n, 2), length.
        capacity: heat capacity of the whole body, heat per degree.
        volume: reference volume of the body.
        tool_contacts: a `HeatContact` for each `ContactWithTool`; call `update` after a change of its conductance.
        power: heat source, heat per time at the nodes over `capacity`, locally owned entries, shape (n,), or 0.
        names: names of the boundaries and sources of heat.
    """

    def __init__(self, mesh: Mesh, materials: Mapping[str, ThermalProperties], boundaries: Sequence[Any],
                 kinematics: Any, absolute_zero: float, displacement: Any = None, degree: int = 2):
        self.mesh, self.comm, self._degree = mesh, mesh.comm, degree
        self._kinematics, self._u, self._zero = kinematics, displacement, absolute_zero
        domain = mesh.domain
        self.space = fem.functionspace(domain, ("Lagrange", degree))
        self.T, self._change, self._fixed_values = (fem.Function(self.space) for _ in range(3))
        self._n = self.space.dofmap.index_map.size_local
        self.points = dof_positions(self.space)[: self._n]
        self._X, self._v = ufl.SpatialCoordinate(domain), ufl.TestFunction(self.space)
        self._dx = ufl.Measure("dx", domain, subdomain_data=mesh.cells,
                               metadata={"quadrature_degree": 2 * degree + 2})
        self._scale, self._c = self.constant(1.0), self.constant(1.0)
        self.power: Any = 0.0
        self._shares: dict[int, fem.Constant] = {}
        self._buffer = la.vector(self.space.dofmap.index_map, 1)
        self._factored_for: float | None = None
        self._displaced: Any = None
        self._set_deformation()
        unity = self.constant(1.0)
        self.volume = self._integral(unity * self._weight * self._dx)
        self.capacity = self._integral(self._stored(materials, unity, unity))
        self._scale.value = 1 / self.capacity
        self.tool_contacts = [self._tool_contact(b) for b in boundaries if isinstance(b, ContactWithTool)]
        self._set_fixed_values([b for b in boundaries if isinstance(b, FixedTemperature)])
        self._laws = [b for b in boundaries if hasattr(b, "flux") and not isinstance(b, Absorption)]
        self._sources = [(b, fem.Function(self.space)) for b in boundaries if isinstance(b, Absorption)]
        given = [*self._laws, *(source for source, _ in self._sources),
                 *(b for b in boundaries if isinstance(b, ContactWithTool)), *(b for b, _ in self._fixed)]
        self.names = [f"{type(b).__name__}({b.on!r})" for b in given]
        self._compile(materials)
        self.update()

    def start(self) -> list[np.ndarray]:
        """Return the initial temperatures of body and tools; `FixedTemperature` faces have theirs."""
        return [self.with_fixed_values(self.T.x.array[: self._n]), *(touch.start() for touch in self.tool_contacts)]

    def with_fixed_values(self, T: np.ndarray) -> np.ndarray:
        """Return temperatures, shape (n,), with the prescribed values at nodes of `FixedTemperature` faces."""
        return np.where(self._fixed_mask, self._fixed_values.x.array[: self._n], T)

    def set_inactive(self, laws: Sequence[Any]) -> None:
        """Leave out some laws of heat, which must have names; `update` must follow."""
        for law, share in self._shares.items():
            share.value = float(not any(law == id(item) for item in laws))

    def update(self) -> None:
        """Update areas of tool contacts and depths of absorption after a change of displacement or contact."""
        self._factored_for = None
        for touch, area in zip(self.tool_contacts, self._areas):
            touch.area = self._assemble(area)[touch.dofs]
        for source, depth in self._sources:
            depth.x.array[: self._n] = distance_to_line(self._deformed(self.points, self.displacements()),
                                                        self._face_line(source.on))
            depth.x.scatter_forward()

    def rates(self, state: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        """Return the rates of heat M dT/dt, with the shapes of `state`, and the heat per time of faces and sources.

        Rates of the body are over its heat capacity, degrees per time; those of tools per contact area.
        """
        R = self._body_rate(state[0])
        found, through = [R], []
        for touch, excess in zip(self.tool_contacts, state[1:], strict=True):
            q, rate = touch.rates(excess, state[0][touch.dofs])
            R[touch.dofs] += touch.area * q
            through.append(touch.area @ q)
            found.append(rate)
        return found, self._heats(through)

    def stage(self, state: list[np.ndarray], known: list[np.ndarray], c: float, guess: np.ndarray) -> ImplicitStage:
        r"""Solve an implicit stage of a time step for body and tools with Newton's method.

        .. math:: M \Delta = k + c R(y + \Delta)

        M is the capacity matrix, R the rate of heat, Delta the change of the temperatures y. `state` and `known` (k)
        are temperature states, see the class. The guess of the change of the body has shape (n,), degrees. Without a
        solution, ConvergenceError is raised.
        """
        T = state[0]
        responses = [touch.response(excess, k, c) for touch, excess, k in zip(self.tool_contacts, state[1:], known[1:])]
        change = np.where(self._fixed_mask, 0.0, guess)
        for iteration in range(_MAX_ITERATIONS):
            R = self._body_rate(T + change)
            for touch, response in zip(self.tool_contacts, responses):
                T_face = (T + change)[touch.dofs]
                R[touch.dofs] += touch.area * response.conductance * (response.face_temperature - T_face)
            residual = known[0] + c * R - self._mass(change)
            self._factorise(c, responses, afresh=iteration % 4 == 3)        # modified Newton: a tangent serves 4 times
            correction = self._solve(residual)
            change += correction
            size, last = self._largest(change), self._largest(correction)
            if last <= max(1e-11 * size, 1e-15 * self._largest(T + change)):
                return self._end_of_stage(T, change, known, c, responses)
            if not np.isfinite(last):
                break
        raise ConvergenceError("heat: Newton's method did not converge in a step")

    def difference(self, known: list[np.ndarray], c: float) -> tuple[float, np.ndarray]:
        r"""Return the temperature changes that given heats cause in a linearised implicit step.

        .. math:: (M - c R') \Delta = k

        M is the capacity matrix, R' the derivative of the rate of heat, Delta the change of temperature. The factorised
        matrix of the last `stage` is reused if it had the same c; otherwise it is assembled at the last temperature. k
        is a temperature state of heats. The results are the largest absolute change on all ranks and the change of the
        body, shape (n,), degrees.
        """
        responses = [touch.response(0 * k, k, c, absolute=False) for touch, k in zip(self.tool_contacts, known[1:])]
        self._factorise(c, responses, afresh=False)
        rhs = known[0].copy()
        for touch, response in zip(self.tool_contacts, responses):
            rhs[touch.dofs] += c * touch.area * response.conductance * response.face_temperature
        change = self._solve(rhs)
        sizes = [self._largest(change)]
        for touch, response, k in zip(self.tool_contacts, responses, known[1:]):
            sizes.append(self._largest(touch.flux_and_change(response, k, change[touch.dofs], c)[1]))
        return max(sizes), change

    def slope(self, rate: np.ndarray) -> np.ndarray:
        """Return dT/dt, shape (n,), from rates M dT/dt over `capacity`, degrees per time; 0 at prescribed nodes."""
        self._factorise(0.0, [], afresh=True)
        return self._solve(rate)

    def heat_through_fixed_faces(self, missing: np.ndarray) -> np.ndarray:
        """Return the heat through each prescribed face, shape (faces,), from the missing heat of nodes, shape (n,)."""
        return self.capacity * np.array([self._sum(missing[dofs]) for _, dofs in self._fixed])

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        for item in (self._solver, self._matrix, self._rhs, self._out):
            item.destroy()

    def _end_of_stage(self, T: np.ndarray, change: np.ndarray, known: list[np.ndarray], c: float,
                responses: list[Any]) -> ImplicitStage:
        """Return changes, rates and heats of a converged implicit stage.

        T and its change have shape (n,), degrees; `known` is a temperature state of heats; c is in units of time.
        """
        R = self._body_rate(T + change)
        changes, rates, through = [change], [R], []
        for touch, response, k in zip(self.tool_contacts, responses, known[1:]):
            q, moved, rate = touch.flux_and_change(response, k, (T + change)[touch.dofs], c)
            R[touch.dofs] += touch.area * q
            through.append(touch.area @ q)
            changes.append(moved)
            rates.append(rate)
        return ImplicitStage(changes, rates, self._heats(through))

    def _heats(self, tool_heats: list[float]) -> np.ndarray:
        """Return the heat per time into the body from faces, sources and tools at `T`, summed over ranks, shape (k,).
        """
        local = [fem.assemble_scalar(form) for form in self._scalars] + tool_heats
        return self.capacity * self.comm.allreduce(np.array(local, dtype=float), MPI.SUM)

    def _set_deformation(self) -> None:
        """Set the UFL factors by which the deformation enters the forms.

        `_weight` is the reference volume per area of the section. `_area` is the deformed area of a face per reference
        length of its line. `_J` is det F. `_gradient_map` is F^-T, which maps Grad T to grad T; None without
        displacement.
        """
        kinematics, u, X = self._kinematics, self._u, self._X
        self._weight, self._J, self._gradient_map = kinematics.weight(X), self.constant(1.0), None
        self._area = self._weight
        if u is not None:
            F = kinematics.deformation_gradient(u, X)
            self._J = kin.volume_ratio(F)
            self._gradient_map = ufl.inv(ufl.as_matrix([[F[0, 0], F[0, 1]], [F[1, 0], F[1, 1]]])).T
            area = kinematics.area_vector(u, X, ufl.FacetNormal(self.mesh.domain))
            self._area = ufl.sqrt(ufl.inner(area, area))

    def _gradient(self, f: Any) -> Any:
        """Return the spatial gradient grad f of a scalar (UFL vector)."""
        return ufl.grad(f) if self._gradient_map is None else self._gradient_map * ufl.grad(f)

    def _layer_measures(self, materials: Mapping[str, ThermalProperties]) -> list[tuple[Any, Any]]:
        """Return pairs (material, UFL measure over all layers of this material); `materials`: {layer: material}."""
        groups: dict[int, tuple[Any, list[int]]] = {}
        for name, tag in self.mesh.layers.items():
            groups.setdefault(id(materials[name]), (materials[name], []))[1].append(tag)
        everywhere = len(groups) == 1
        return [(m, self._dx if everywhere else self._dx(tuple(tags))) for m, tags in groups.values()]

    def _stored(self, materials: Mapping[str, ThermalProperties], T: Any, v: Any) -> Any:
        """Return the form of the heat density at T times the test function v, times `_scale` (1 or 1 / `capacity`)."""
        return sum(self._scale * self.constant(m.density * m.heat_capacity) * T * v * self._weight * dx
                   for m, dx in self._layer_measures(materials))

    def _compile(self, materials: Mapping[str, ThermalProperties]) -> None:
        """Compile the forms of mass, rate and tangent, and create the matrix and its solver; `materials`: by layer."""
        T, v, J = self.T, self._v, self._J
        R = -sum(self._scale * self.constant(m.conductivity) * J * self._weight
                 * ufl.inner(self._gradient(T), self._gradient(v)) * dx for m, dx in self._layer_measures(materials))
        scalars = []
        for law in self._laws:
            ds = self._ds(law.on, {"quadrature_degree": law.quadrature_degree})
            parameters = {name: self._coefficient(value) for name, value in law.parameters.items()}
            flux = self._share_of(law) * law.flux(T, self.constant(self._zero), **parameters)
            R += self._scale * flux * self._area * v * ds
            scalars.append(self._scale * flux * self._area * ds)
        for source, depth in self._sources:
            kappa = self.constant(source.coefficient)
            flux = self._share_of(source) * self.constant(source.flux)
            heat = flux * kappa * ufl.exp(-kappa * depth) * J * self._weight * self._scale
            R += heat * v * self._dx
            scalars.append(heat * self._dx)
        tangent = self._stored(materials, ufl.TrialFunction(self.space), v) - self._c * ufl.derivative(R, T)
        self._rate_form, self._mass_form = self._form(R), self._form(self._stored(materials, self._change, v))
        self._scalars = [self._form(s) for s in scalars]
        gll = {"quadrature_rule": "GLL", "quadrature_degree": 2 * self._degree - 1}    # points at the nodes
        self._areas = [self._form(self._scale * self._area * v * self._ds(touch.on, gll))
                       for touch in self.tool_contacts]
        self._tangent = self._form(tangent)
        self._matrix = fem_petsc.create_matrix(self._tangent)
        self._rhs, self._out = self._matrix.createVecRight(), self._matrix.createVecRight()
        self._solver = DirectSolver(self._matrix, symmetric=False)

    def _share_of(self, law: Any) -> Any:
        """Return the factor of a law of heat: a `Constant` that is 0 while the law is inactive; 1 without a name."""
        if law.name is None:
            return 1
        return self._shares.setdefault(id(law), self.constant(1.0))

    def _coefficient(self, value: float | Table) -> Any:
        """Return a parameter of a law, a number or a table over R, as a UFL scalar: the table is evaluated at R."""
        return value(self._X[0]) if isinstance(value, Table) else self.constant(value)

    def _ds(self, boundary: str, metadata: dict) -> ufl.Measure:
        """Return the UFL measure of a boundary with quadrature metadata."""
        ds = ufl.Measure("ds", self.mesh.domain, subdomain_data=self.mesh.facets)
        return ds(self.mesh.boundaries[boundary], metadata=metadata)

    def _dofs(self, boundary: str) -> np.ndarray:
        """Return the local numbers of the temperature unknowns on a boundary, with ghosts."""
        return fem.locate_dofs_topological(self.space, 1, self.mesh.facets_of(boundary))

    def _set_fixed_values(self, fixed: list[FixedTemperature]) -> None:
        """Set `_fixed_values`, prescribed temperatures, `_fixed_mask`, the mask of their nodes, `_bcs` and `_fixed`."""
        self._fixed_mask = np.zeros(self._n, dtype=bool)
        self._fixed, self._bcs, taken = [], [], self._fixed_mask.copy()
        for boundary in fixed:
            dofs = self._dofs(boundary.on)
            R = self.space.tabulate_dof_coordinates()[dofs, 0]
            value = boundary.parameters["temperature"]
            self._fixed_values.x.array[dofs] = value(R) if isinstance(value, Table) else value
            self._bcs.append(fem.dirichletbc(self._fixed_values, dofs))
            own = dofs[dofs < self._n]
            self._fixed.append((boundary, own[~taken[own]]))
            taken[own] = self._fixed_mask[own] = True

    def _tool_contact(self, contact: ContactWithTool) -> HeatContact:
        """Return the `HeatContact` of the locally owned nodes on the face of a `ContactWithTool`."""
        dofs = self._dofs(contact.on)
        own = dofs[dofs < self._n]
        return HeatContact(contact, own, self.points[own])

    def displacements(self) -> Any:
        """Return the displacements of the locally owned nodes, shape (n, 2), length; None without displacement."""
        if self._u is None:
            return None
        if self._displaced is None:
            space = fem.functionspace(self.mesh.domain, ("Lagrange", self._degree, (2,)))
            self._displaced = fem.Function(space), _compat.compile_expression(
                self._u, _compat.interpolation_points(space))
        u, expression = self._displaced
        u.interpolate(expression)
        return u.x.array.reshape(-1, self.points.shape[1])[: self._n]

    @staticmethod
    def _deformed(points: np.ndarray, u: Any) -> np.ndarray:
        """Return deformed positions points + u, shape (n, 2), length; the points themselves if u is None."""
        return points if u is None else points + u

    def _face_line(self, boundary: str) -> np.ndarray:
        """Return the deformed positions of the k nodes of a boundary of all ranks, in order, shape (k, 2), length."""
        line = self.mesh.line_of(boundary)
        u = self.displacements()
        if u is None:
            return line
        from scipy.spatial import cKDTree
        dofs = self._dofs(boundary)
        own = dofs[dofs < self._n]
        X, u = (gathered(self.comm, a) for a in (self.points[own], u[own]))
        return line + u[cKDTree(X).query(line)[1]]

    def _factorise(self, c: float, responses: list[Any], afresh: bool) -> None:
        """Factorise M - c R' of an implicit stage: capacity matrix M, derivative R' of rates of heat at the last `T`.

        Tools add their conductance to the diagonal. Factors of the same c are reused unless `afresh`.
        """
        if self._factored_for == c and not afresh:
            return
        self._factored_for = c
        self._c.value = c
        self._matrix.zeroEntries()
        _compat.assemble_matrix(self._matrix, self._tangent, self._bcs)
        self._matrix.assemble()
        if self.tool_contacts:
            extra = np.zeros(self._n)
            for touch, response in zip(self.tool_contacts, responses):
                extra[touch.dofs] += c * touch.area * response.conductance
            self._rhs.array_w[:] = np.where(self._fixed_mask, 0.0, extra)
            self._matrix.setDiagonal(self._rhs, PETSc.InsertMode.ADD_VALUES)
        if not self._solver.factorise():
            raise ConvergenceError("heat: the matrix of a step is singular")

    def _solve(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution for the right-hand side `rhs`, both locally owned entries, with the factorised matrix."""
        self._rhs.array_w[:] = np.where(self._fixed_mask, 0.0, rhs)
        self._solver.solve(self._rhs, self._out)
        return self._out.array_r.copy()
