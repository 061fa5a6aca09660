r"""Stresses and stretches of a state, layer by layer: nothing is averaged over an interface.

With the energy density W per reference volume, the sum of material and volume term:

.. math::
    P = \partial W / \partial F, \qquad S = F^{-1} P, \qquad \sigma = F S F^T / J

F and S are projected (L2) on piecewise linear fields, one for each layer. All other quantities follow from them point
by point. S does not rotate with the sheet. A projection of the Cauchy stress would falsify the small stress normal to
an inflated sheet by the large stress along the sheet.

In a soft layer beside a stiff one the mean stress is much larger than the differences of the principal stresses. The
product of projected fields would falsify these. So a constant :math:`\bar p` of each layer is split off, and
:math:`S + \bar p J C^{-1}` takes the place of S. It is minus the volume mean of the principal stress of least
magnitude. It is near 0 in an inflated sheet.

The error of the stresses is estimated as by Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 24 (1987) 337
(doi:10.1002/nme.1620240206): as the difference from a smoother field. This field comes from cubics fitted to F and S
(`patches`), whose order is higher. Projected fields are no more accurate than the stresses of the elements.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cached_property
from typing import Any

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc

from ... import _compat
from ...errors import InputError, as_points, check_name, pair
from ...mesh.locate import LocatedPoints, locate
from ...mesh.nodes import COORDINATES, cell_node_positions, own_cells
from ...physics.kinematics import BLOCK
from ...ranks import gathered
from .patches import Patches
from .point_stress import Stress
from .stress_error import Fitted, StressError, StressPeak

# The entries of F and of S that are not zero, in the order (r, z, hoop; out of plane in plane strain).
_S = ((0, 0), (0, 1), (1, 1), (2, 2))
_COUNT = len(BLOCK) + len(_S)
log = logging.getLogger("formingx")


class StressField:
    """Stresses of one state: projected on continuous fields (`at_points`), or as computed (`at_quadrature_points`).

    Args:
        recovery: the `Stresses` of the problem.
        state: the state.

    >>> field = path.stress(path.state_at(fx.pole_height(6.0)))
    >>> field.at_points([(0.0, 0.0), (0.0, 0.3)]).principal_stresses[:, 0].round(2).tolist()
    [0.9, 0.99]
    """

    def __init__(self, recovery: Stresses, state: Any):
        self._recovery, self._state = recovery, state
        self._pressures = recovery.layer_pressures(state)
        self._nodes = recovery.project(state, self._pressures)

    def at_points(self, points: ArrayLike, layer: str | None = None) -> Stress:
        """Return the projected stresses at points; collective.

        Args:
            points: reference positions (R, Z), shape (n, 2), length, equal on all ranks.
            layer: name of the layer in which the points lie; optional if there is only one layer. At an interface it
                selects the side.

        Returns:
            The stresses at the n points, on all ranks.

        Raises:
            InputError: the layer is unknown, or a point lies outside it.
        """
        recovery = self._recovery
        layer = recovery.layer(layer)
        positions = as_points("Stress: points", points)
        comm, place = recovery.problem.comm, recovery.locate(positions, layer)
        values = np.zeros((len(positions), _COUNT))
        if len(place.numbers):
            shapes: Any = recovery.element.tabulate(0, place.reference)
            dofs = recovery.space.dofmap.list[place.cells]
            column = list(recovery.cells).index(layer)
            values[place.numbers] = np.einsum("nk,nkc->nc", shapes[0], self._nodes[dofs, column])
        pressure = self._pressures[list(recovery.cells).index(layer)]
        return _unpack(positions, _shifted(comm.allreduce(values, MPI.SUM), -pressure))

    def in_cells(self, reference: np.ndarray) -> Stress:
        """Return the projected stresses at k points in each of the m cells that this rank owns.

        At an interface they are the stresses of the layer to which the cell belongs.

        Args:
            reference: the points, as coordinates in the reference triangle, shape (k, 2).

        Returns:
            The stresses at the m k points, cell by cell. `Stress.points` is not computed: all its entries are 0.
        """
        recovery = self._recovery
        owned = len(own_cells(recovery.problem.forms.domain))
        column = np.zeros(owned, dtype=np.int64)
        for k, cells in enumerate(recovery.cells.values()):
            column[cells[cells < owned]] = k
        nodes = self._nodes[recovery.space.dofmap.list[:owned], column[:, None]]
        shapes: Any = recovery.element.tabulate(0, reference)
        values = np.einsum("kn,cnx->ckx", shapes[0], nodes)
        values = _shifted(values, -self._pressures[column][:, None])
        return _unpack(np.zeros((owned * len(reference), COORDINATES)), values.reshape(-1, _COUNT))

    def at_quadrature_points(self, layer: str | None = None) -> Stress:
        """Return the stresses as computed at the quadrature points of a layer, of all ranks; collective.

        Args:
            layer: name of a layer; optional if there is only one.

        Returns:
            The stresses, cell by cell, on all ranks.

        Raises:
            InputError: the layer is unknown, or there are several and `layer` is None.
        """
        return self._recovery.raw(self._state, self._recovery.layer(layer))

    def error(self, layer: str | None = None, exact: Callable | None = None) -> StressError:
        r"""Estimate the error of the stresses in each cell and in total (Zienkiewicz and Zhu 1987); collective.

        The error of a cell is the L2 norm, over its reference volume, of the difference between a smoother Cauchy
        stress and the computed one:

        .. math::
            e_K^2 = \int_K |\sigma^* - \sigma_h|^2 \, dV

        The smoother stress follows from cubics that are fitted to patches of cells. For a smooth solution the estimate
        tends to the true error on refined meshes. At a loaded sharp corner it does not decrease.

        Args:
            layer: name of a layer; default all.
            exact: function that returns the exact Cauchy stress, shape (n, 3, 3), at reference positions, shape (n, 2).
                It takes the place of the smoother stress, so the true error is returned.

        Returns:
            The errors of the cells.

        Raises:
            InputError: the layer is unknown, or `exact` is not a function or returns another shape.
        """
        selected, comm = self._recovery.of_layer(layer), self._recovery.problem.comm
        return StressError(*(gathered(comm, v[selected]) for v in self._fitted.error(exact)))

    def error_in_cells(self) -> np.ndarray:
        """Return the estimated root mean square error of the Cauchy stress in the owned cells, (m,); collective."""
        return self._fitted.error().mean

    def peak(self, layer: str | None = None, radii: tuple[float, float] | None = None) -> StressPeak:
        """Return the largest principal Cauchy stress, and whether the mesh resolves it; collective.

        A warning is logged if the mesh does not resolve it (`StressPeak.converged`).

        Args:
            layer: name of a layer; default all.
            radii: two reference radii, length. Only cells with their middle between them are examined, for example
                without a clamped rim and its stress peak.

        Returns:
            The stress peak.

        Raises:
            InputError: the layer is unknown, or no cell lies between the radii.
        """
        comm, fitted = self._recovery.problem.comm, self._fitted
        selected = self._recovery.of_layer(layer)
        if radii is not None:
            low, high = pair("stress peak: radii", radii)
            R = fitted.points[:, :, 0].mean(1)
            selected &= (low <= R) & (high >= R)
        errors = np.sqrt(((fitted.smooth - fitted.raw) ** 2).sum((2, 3))).max(1, initial=0.0)
        cells = [gathered(comm, v[selected]) for v in (*self._recovery.at_corners(fitted), errors)]
        if not len(cells[0]):
            raise InputError(f"stress peak: radii = {radii!r}: no cell has its middle between them")
        peak = StressPeak.among(*cells)
        if not peak.converged and comm.rank == 0:
            log.warning("%s", peak)
        return peak

    @cached_property
    def _fitted(self) -> Fitted:
        """Computed and fitted stress in the cells that this rank owns."""
        return self._recovery.fit(self._state)


class Stresses:
    """Computes the `StressField` of states of one problem; forms and mass matrix are created at first use."""

    def __init__(self, problem: Any):
        self.problem = problem
        self._ready = False
        self._raw: dict[int, tuple] = {}
        self._patches: Patches | None = None
        self._located: dict[str, tuple[np.ndarray, LocatedPoints]] = {}

    def evaluate(self, state: Any) -> StressField:
        """Return the stresses of a state; collective. A membrane raises an InputError."""
        if not self._ready:
            self._prepare()
            self._ready = True
        return StressField(self, state)

    def locate(self, points: np.ndarray, layer: str) -> LocatedPoints:
        """Return cells of a layer with reference points (n, 2), length, stored, else an InputError; collective."""
        before = self._located.get(layer)
        if before is None or not np.array_equal(before[0], points):
            forms, positions = self.problem.forms, self.problem.followed(points)
            before = points.copy(), locate(forms.domain, positions, forms.length, self.cells[layer], f"layer {layer!r}")
            self._located[layer] = before
        return before[1]

    def layer(self, name: str | None) -> str:
        """Return the checked name of a layer, for None that of the only layer; otherwise an InputError."""
        if name is None:
            if len(self.cells) > 1:
                raise InputError(f"stress: which layer? known: {', '.join(map(repr, self.cells))}")
            return next(iter(self.cells))
        check_name("stress: layer", name, self.cells)
        return name

    def layer_pressures(self, state: Any) -> np.ndarray:
        """Return the pressure of each layer that is split off before the projection, shape (layers,), stress.

        It is minus the volume mean of the principal Cauchy stress of least magnitude in a state. Collective.
        """
        found = np.zeros((2, len(self.cells)))
        for k, layer in enumerate(self.cells):
            _, values, volume = self._at_quadrature(state, layer)
            principal = np.linalg.eigvalsh(_cauchy(values))
            least = np.take_along_axis(principal, np.abs(principal).argmin(-1)[..., None], -1)[..., 0]
            found[:, k] = -np.sum(volume * least), volume.sum()
        total = self.problem.comm.allreduce(found, MPI.SUM)
        return total[0] / total[1]

    def project(self, state: Any, pressures: np.ndarray) -> np.ndarray:
        """Return nodal F and S of a state, 9 entries, shape (nodes, layers, 9), by linear fields; collective."""
        self._pressures.value[:] = pressures
        with self.problem.state_context(state):
            return self._projected()

    def _projected(self) -> np.ndarray:
        """Return the nodal values of F and S that `project` returns, for the present unknowns; collective."""
        n = self.space.dofmap.index_map.size_local + self.space.dofmap.index_map.num_ghosts
        nodes = np.zeros((n, len(self.cells), _COUNT))
        b, x = self._b, self._x
        for k in range(_COUNT):
            self._selector.value[:] = np.eye(_COUNT)[k]
            b.array_w[:] = owned = _compat.assemble_vector(self._vector, self._rhs)
            self._solver.solve(b, x)
            owned[:] = x.array_r
            self._vector.scatter_forward()
            nodes[:, :, k] = self._vector.array.reshape(n, -1)
        return nodes

    def raw(self, state: Any, layer: str) -> Stress:
        """Return the stresses of a state as computed at the quadrature points of a layer, of all ranks; collective."""
        points, values, _ = self._at_quadrature(state, layer)
        return _unpack(*(gathered(self.problem.comm, v).reshape(-1, v.shape[-1]) for v in (points, values)))

    def fit(self, state: Any) -> Fitted:
        """Return the stresses of a state in this rank's cells, and their fit to patches of cells; collective."""
        comm, parts = self.problem.comm, [self._at_quadrature(state, layer) for layer in self.cells]
        order = np.argsort(np.concatenate([self._owned(layer) for layer in self.cells]))
        points, values, volume = (np.concatenate([part[k] for part in parts])[order] for k in range(3))
        domain, owned = self.problem.forms.domain, order.size
        if self._patches is None:
            corners = _compat.cell_nodes(domain)[:owned, :3]
            numbers = domain.geometry.index_map().local_to_global(corners.ravel()).reshape(-1, 3)
            layer = np.concatenate([np.full(len(self._owned(name)), k) for k, name in enumerate(self.cells)])[order]
            first = comm.exscan(owned) or 0
            points_of_all, numbers, layer = (gathered(comm, v) for v in (points, numbers, layer))
            self._patches = Patches(points_of_all, numbers, layer, np.arange(first, first + owned))
        pressures = np.concatenate([np.full(len(self._owned(layer)), pressure) for layer, pressure in
                                    zip(self.cells, self.layer_pressures(state), strict=True)])[order]
        cubics = self._patches.fit(gathered(comm, _shifted(values, pressures[:, None])))
        smooth = self._fitted_cauchy(cubics, pressures, points)
        return Fitted(points, volume, _cauchy(values), smooth, cubics, pressures)

    def _fitted_cauchy(self, cubics: np.ndarray, pressures: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the Cauchy stress (m, q, 3, 3) of cubics (m, 10, 9) and pressures (m,) at points (m, q, 2)."""
        assert self._patches is not None
        return _cauchy(_shifted(self._patches.evaluate(cubics, points), -pressures[:, None]))

    def at_corners(self, fitted: Fitted) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest principal stress, of `fit`, at corners of cells of this rank, (m,), and these, (m, 2)."""
        owned = own_cells(self.problem.forms.domain)
        X = cell_node_positions(self.problem.forms.domain, owned)[:, :3]
        largest = np.linalg.eigvalsh(self._fitted_cauchy(fitted.cubics, fitted.pressures, X))[..., -1]
        top = (owned, largest.argmax(1))
        return largest[top], X[top]

    def of_layer(self, name: str | None) -> np.ndarray:
        """Return a mask of owned cells in a layer, (m,); None: all layers."""
        owned = own_cells(self.problem.forms.domain)
        return np.isin(owned, self.cells[self.layer(name)]) if name is not None else np.ones(len(owned), dtype=bool)

    def _owned(self, layer: str) -> np.ndarray:
        """Return the local numbers of the cells of a layer that this rank owns, shape (m,)."""
        return self.cells[layer][self.cells[layer] < len(own_cells(self.problem.forms.domain))]

    def _at_quadrature(self, state: Any, layer: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return F, S and volumes at the q quadrature points of each of this rank's m cells of a layer in a state.

        Positions have shape (m, q, 2), length; F_rr, F_rz, F_zr, F_zz, F_hoop, S_rr, S_rz, S_zz, S_hoop (m, q, 9);
        volumes (m, q), length^3 or, in plane strain, length^2.
        """
        forms = self.problem.forms
        number = next(i for i, (_, names) in enumerate(forms.bodies) if layer in names)
        if number not in self._raw:
            parts = self._parts(forms.bodies[number][1])
            metadata = parts[-1][1]                       # rule of the volume term
            if "quadrature_points" in metadata:
                points, weights = metadata["quadrature_points"], metadata["quadrature_weights"]
            else:
                cell = basix.CellType.triangle
                points, weights = basix.make_quadrature(cell, self.problem.scene.quadrature_degree)
            if weights.min() < 0:                         # errors must not cancel
                weights = np.full(len(points), 0.5 / len(points))
            values = ufl.as_vector([*self._F, *(sum(part[k] for part, _ in parts) for k in range(len(_S)))])
            area = abs(ufl.JacobianDeterminant(forms.domain))
            where = ufl.as_vector([*forms.X, forms.weight * area])
            self._raw[number] = *(_compat.compile_expression(e, points) for e in (values, where)), weights
        values, where, weights = self._raw[number]
        cells, q = self._owned(layer), len(weights)
        with self.problem.state_context(state):
            values, where = (e.eval(forms.domain, cells).reshape(-1, q, n) if len(cells) else np.zeros((0, q, n))
                             for e, n in ((values, _COUNT), (where, 3)))
        return where[..., :-1], values, where[..., -1] * weights

    def _parts(self, names: list[str]) -> list[tuple[Any, dict]]:
        """Return the terms of the stress S: the material's, then the volume term, for layers of one material.

        Each is (list of S_rr, S_rz, S_zz, S_hoop in UFL, quadrature metadata of its integral).
        """
        F = ufl.variable(self.problem.forms.F)
        parts = []
        for density, metadata in self.problem.forms.energy_densities(names, F):
            S = self.problem.forms.ratio_before * ufl.inv(F) * ufl.diff(density, F)
            parts.append(([S[i] for i in _S], metadata))
        return parts

    def _prepare(self) -> None:
        """Create function space, forms and mass matrix of the projection of F and S; collective."""
        problem, forms, mesh = self.problem, self.problem.forms, self.problem.scene.mesh
        bodies, domain = forms.bodies, forms.domain            # raises an error for a membrane
        self.cells = {name: mesh.cells.find(tag) for name, tag in mesh.layers.items()}
        self.element = basix.ufl.element("Lagrange", domain.basix_cell(), 1)
        self.space = fem.functionspace(domain, basix.ufl.element("Lagrange", domain.basix_cell(), 1,
                                                                 shape=(len(self.cells),)))
        self._F = [forms.F[i] for i in BLOCK]
        self._selector = fem.Constant(domain, np.zeros(_COUNT, dtype=PETSc.ScalarType))
        trial, test = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        mass: Any = 0
        rhs: Any = 0
        column = {name: k for k, name in enumerate(self.cells)}
        self._pressures = fem.Constant(domain, np.zeros(len(self.cells), dtype=PETSc.ScalarType))
        unit = ufl.det(forms.F) * ufl.inv(forms.F.T * forms.F)
        for _, names in bodies:
            parts = self._parts(names)
            for name in names:
                k, dx = column[name], forms.dx(mesh.layers[name])
                mass += trial[k] * test[k] * dx
                rhs += sum(self._selector[i] * f for i, f in enumerate(self._F)) * test[k] * dx
                for S, metadata in parts:
                    picked = sum(self._selector[len(BLOCK) + i] * s for i, s in enumerate(S))
                    rhs += picked * test[k] * (dx(metadata=metadata) if metadata else dx)
                split = self._pressures[k] * sum(self._selector[len(BLOCK) + i] * unit[s] for i, s in enumerate(_S))
                rhs += split * test[k] * (dx(metadata=metadata) if metadata else dx)     # the rule of the volume term
        forms.compile_ahead(rhs, mass)
        self._rhs = forms.compile(rhs)
        self._vector = la.vector(self.space.dofmap.index_map, len(self.cells))
        bcs = self._idle()
        mass = forms.compile(mass)
        matrix = fem_petsc.create_matrix(mass)
        _compat.assemble_matrix(matrix, mass, bcs)
        matrix.assemble()
        self._b, self._x = matrix.createVecLeft(), matrix.createVecRight()
        self._solver = PETSc.KSP().create(problem.comm)       # a mass matrix: a few dozen iterations to round-off
        self._solver.setOperators(matrix)
        self._solver.setType("cg")
        self._solver.getPC().setType("jacobi")
        self._solver.setTolerances(rtol=1e-13, atol=0.0, max_it=1000)
        self._solver.setErrorIfNotConverged(True)

    def _idle(self) -> list:
        """Return Dirichlet conditions that set the field of each layer to 0 at the nodes outside this layer."""
        n = len(self.cells)
        if n == 1:
            return []
        used = la.vector(self.space.dofmap.index_map, n)
        touched = used.array.reshape(-1, n)
        for k, cells in enumerate(self.cells.values()):
            touched[self.space.dofmap.list[cells].ravel(), k] = 1
        used.scatter_reverse(la.InsertMode.add)               # a cell of another rank may use a node of ours
        used.scatter_forward()
        return [fem.dirichletbc(PETSc.ScalarType(0), (np.flatnonzero(touched[:, k] == 0) * n + k).astype(np.int32),
                                self.space.sub(k)) for k in range(n)]


def _shifted(values: np.ndarray, pressure: Any) -> np.ndarray:
    """Return F and S, shape (..., 9), with S + p J C^-1 in place of S, for pressures p that fit (...), stress."""
    (a, b, c, d, hoop), found = np.moveaxis(values[..., :len(BLOCK)], -1, 0), values.copy()
    det = a * d - b * c
    # J C^-1 = J F^-1 F^-T, with J = det hoop
    unit = np.stack([(d * d + b * b) / det * hoop, -(c * d + a * b) / det * hoop, (a * a + c * c) / det * hoop,
                     det / hoop], axis=-1)
    found[..., len(BLOCK):] += np.asarray(pressure)[..., None] * unit
    return found


def _cauchy(values: np.ndarray) -> np.ndarray:
    """Return the Cauchy stress (m, q, 3, 3) of the nine entries of F and S, shape (m, q, 9)."""
    flat = values.reshape(-1, _COUNT)
    return _unpack(np.zeros((len(flat), COORDINATES)), flat).cauchy.reshape(*values.shape[:2], 3, 3)


def _unpack(points: np.ndarray, values: np.ndarray) -> Stress:
    """Return the `Stress` at points (n, 2) from values (n, 9): F_rr, _rz, _zr, _zz, _hoop, S_rr, _rz, _zz, _hoop."""
    F, S = np.zeros((2, len(points), 3, 3))
    for k, (i, j) in enumerate(BLOCK):
        F[:, i, j] = values[:, k]
    for k, (i, j) in enumerate(_S):
        S[:, i, j] = S[:, j, i] = values[:, len(BLOCK) + k]
    return Stress(points, F, S)
