"""Displacements at reference points, evaluated from the fields of a problem."""

from __future__ import annotations

from typing import Any

import basix.ufl
import numpy as np
from mpi4py import MPI

from .. import _compat
from ..errors import InputError
from ..findings import coordinates
from ..mesh.locate import locate
from ..mesh.nodes import cell_node_positions, own_cells
from ..ranks import gathered


class Probe:
    """Evaluation of the displacement at fixed reference points, as weighted sums of the unknowns of a problem.

    Attributes:
        points: reference positions (R, Z), in three dimensions (x, y), shape (n, 2), length, the same on all ranks. A
            point outside the mesh is an InputError.
        earlier_displacement: displacement of the points from the first mesh of a run to this one, 0 without remeshing,
            shape (n, components), length.
    """

    def __init__(self, problem: Any, points: Any):
        points = np.atleast_2d(np.asarray(points, dtype=float))
        forms = problem.forms
        place = locate(forms.domain, forms.nearest(points), forms.length)
        self._components = forms.scene.kinematics.components
        self._subs = forms.displacement_dofmaps
        self._problem, self.points = problem, points
        self.earlier_displacement = np.zeros((len(points), self._components))
        self._mine, self._cells, self._reference = place
        self._dofs = self._dofs_of(place.cells)
        self._weights = _basis(forms.displacement_element, 0, self._reference)

    def _dofs_of(self, cells: np.ndarray) -> np.ndarray:
        """Return the displacement unknowns of m cells, with dim for each component, shape (m, components, dim)."""
        return np.array([[sub.cell_dofs(c) for sub in self._subs] for c in cells], dtype=np.int64).reshape(
            len(cells), self._components, self._problem.forms.displacement_element.dim)

    def displacement(self, x: Any) -> np.ndarray:
        """Set the fields of the forms to x, and return the displacement, shape (n, components), length; collective."""
        self._problem.set_fields(x.array_r)
        return self._read()

    def displacement_in(self, state: Any) -> np.ndarray:
        """Return the displacement in a state, shape (n, components), length, and restore the fields; collective."""
        w = self._problem.forms.w.x.array
        before = w.copy()
        try:
            self._problem.set_fields(state.x)
            return self._read()
        finally:
            w[:] = before

    def _read(self) -> np.ndarray:
        """Return the displacement at the points for the current fields, shape (n, components), length."""
        w = self._problem.forms.w.x.array
        values = np.zeros((len(self.points), self._components))
        values[self._mine] = self._problem.forms.length * self._local(w[self._dofs])
        return self._problem.comm.allreduce(values, MPI.SUM)

    def stretch_row(self) -> tuple[np.ndarray, float]:
        r"""Return a row, owned entries, shape (n,), and a power for the in-plane stretch at the pole.

        .. math:: \lambda = (1 + \text{row} \cdot x)^{\text{power}}

        The two points lie on the axis, the lower one first. Incompressibility gives the in-plane stretch from that of
        the thickness: the power is -1/2 if axisymmetric, -1 in plane strain.
        """
        (_, low), (_, high) = self.points
        row = self.row(np.array([[0.0, -1.0], [0.0, 1.0]])) * self._problem.forms.length / (high - low)
        return row, -0.5 if self._problem.scene.kinematics.axisymmetric else -1.0

    def row(self, factors: np.ndarray) -> np.ndarray:
        """Return the vector, owned entries, with row . x = (1/L) sum_ic w_ic u_ic for factors w, (n, components)."""
        return self._row(factors, self._weights)

    def _local(self, values: np.ndarray) -> np.ndarray:
        """Return the dimensionless displacement of m points, shape (m, 2), from those of cells, shape (m, 2, dim)."""
        return np.einsum("kj,kij->ki", self._weights, values)

    def _row(self, factors: np.ndarray, point_weights: np.ndarray) -> np.ndarray:
        """Return the row of a weighted sum of displacements of points, locally owned entries.

        factors: of all n points, (n, components). point_weights: shape functions at the m points here, (m, dim).
        """
        problem = self._problem
        index_map = problem.forms.space.dofmap.index_map
        triples: list[list] = [[], []]
        for k, i in enumerate(self._mine):
            for component in range(self._components):
                triples[0].append(index_map.local_to_global(self._dofs[k, component].astype(np.int32)))
                triples[1].append(factors[i, component] * point_weights[k])
        dofs = np.concatenate(triples[0]) if triples[0] else np.zeros(0, dtype=np.int64)
        weights = np.concatenate(triples[1]) if triples[1] else np.zeros(0)
        dofs = gathered(problem.comm, dofs)
        weights = gathered(problem.comm, weights)
        first, last = index_map.local_range
        own = (dofs >= first) & (dofs < last)
        row = np.zeros(last - first)
        np.add.at(row, dofs[own] - first, weights[own])
        return row


class MidSurfaceProbe(Probe):
    """Displacement of a membrane at points on normals of its mid-surface, whose distances scale with the thickness."""

    def __init__(self, problem: Any, points: np.ndarray):
        super().__init__(problem, points)
        element, domain = problem.forms.displacement_element, problem.forms.domain
        nodes = cell_node_positions(domain, self._cells)
        geometry = basix.ufl.element("Lagrange", "interval", _compat.coordinate_map(domain).degree, shape=())
        self._middle = np.einsum("kj,kji->ki", _basis(geometry, 0, self._reference), nodes)
        tangent = np.einsum("kj,kji->ki", _basis(geometry, 1, self._reference), nodes)       # dX/dxi
        speed = np.hypot(*tangent.T)[:, None] * np.where(tangent[:, :1] > 0, 1.0, -1.0)
        self._tangent = tangent / speed                                                     # towards growing R
        slopes = (_basis(element, 1, self._reference) / speed)[:, None]                     # d/dS of the basis
        self._slopes = np.repeat(slopes, 2, axis=1)
        self._on_axis = (self._middle[:, 0] < 1e-12 * problem.forms.length) & ("axis" in problem.forms.mesh.boundaries)
        for k in np.flatnonzero(self._on_axis):
            self._slopes[k] = 0.0                      # u_z is even in R; u_r is odd: R and R^3 through the two nodes
            far = int(np.argmax(nodes[k, :2, 0]))      # leave an error of the fourth order
            h = nodes[k, far, 0]
            self._slopes[k, 0, [far, 2]] = -1 / (3 * h), 8 / (3 * h)
        self._average_slopes(element, geometry)

    def _average_slopes(self, element: Any, geometry: Any) -> None:
        """Replace `_tangent` by its mean over both elements at points where two elements meet; collective.

        `_ends` has data for the mean of du/dS there, by the reference arc length S. element, geometry: scalar elements
        of a displacement component and of the mid-surface.
        """
        forms, domain = self._problem.forms, self._problem.forms.domain
        nodes = cell_node_positions(domain, own_cells(domain))
        R = forms.nearest(self.points)[:, 0]
        at, cells, end = np.nonzero(np.abs(R[:, None, None] - nodes[None, :, :2, 0]) < 1e-9 * forms.length)
        meet = self._problem.comm.allreduce(np.bincount(at, minlength=len(R))) == 2
        at, cells, end = (part[meet[at]] for part in (at, cells, end))
        tangent = np.einsum("kj,kji->ki", _basis(geometry, 1, end[:, None].astype(float)), nodes[cells])
        speed = np.hypot(*tangent.T)[:, None] * np.where(tangent[:, :1] > 0, 1.0, -1.0)
        self._ends = at, self._dofs_of(cells), _basis(element, 1, end[:, None].astype(float)) / speed
        self._meet = meet[self._mine]
        both = self._mean_over_elements(tangent / speed)[self._mine]
        self._mean_length = np.where(self._meet, np.hypot(*both.T), 1.0)[:, None]     # of the mean of unit vectors
        self._tangent = np.where(self._meet[:, None], both / self._mean_length, self._tangent)

    def _mean_over_elements(self, values: np.ndarray) -> np.ndarray:
        """Return means (n, 2) over both elements that meet of values (ends, 2), in the order of `_ends`; collective."""
        total = np.zeros((len(self.points), self._components))
        np.add.at(total, self._ends[0], values / 2)
        return self._problem.comm.allreduce(total, MPI.SUM)

    def stretch_row(self) -> tuple[np.ndarray, float]:
        """Return the row (n,) of 1 + du_r/dR = 1 + row . x at the pole of a membrane, and the power 1."""
        row = self._row(np.array([[1.0, 0.0], [0.0, 0.0]]), self._slopes[:, 0] * self._problem.forms.length)
        return row, 1.0

    def row(self, factors: np.ndarray) -> np.ndarray:
        """Return the row of `Probe.row` for factors (n, components) on the mid-surface; elsewhere: InputError."""
        middle = self._problem.forms.nearest(self.points)
        outside = np.abs(self.points - middle).max(axis=1) > 1e-8 * self._problem.forms.length
        if np.any(outside):
            point, nearest = (coordinates(x[np.argmax(outside)], 6) for x in (self.points, middle))
            raise InputError(f"point (R, Z) = {point} is not on the mid-surface, and a membrane knows no other: there"
                             f" it is {nearest}")
        return super().row(factors)

    def _local(self, values: np.ndarray) -> np.ndarray:
        u, du = super()._local(values), np.einsum("kij,kij->ki", self._slopes, values)
        forms = self._problem.forms
        _, dofs, slopes = self._ends
        means = self._mean_over_elements(np.einsum("kj,kij->ki", slopes, forms.w.x.array[dofs]))
        both = means[self._mine] / self._mean_length
        du = np.where(self._meet[:, None], both, du)
        t = self._tangent + forms.length * du
        l1 = np.hypot(*t.T)
        l2 = np.ones_like(l1)
        if self._problem.scene.kinematics.axisymmetric:
            R, u_r = self._middle[:, 0], forms.length * u[:, 0]
            l2 = np.where(self._on_axis, 1 + forms.length * du[:, 0], 1 + u_r / np.where(self._on_axis, 1.0, R))
        offset = self.points[self._mine] - self._middle
        along = np.sum(offset * self._tangent, axis=1)
        above = np.sum(offset * _normal(self._tangent), axis=1)
        carried = along[:, None] * t + (above / (l1**2 * l2))[:, None] * _normal(t)
        return u + (carried - offset) / forms.length


def _normal(tangents: np.ndarray) -> np.ndarray:
    """Return vectors rotated counterclockwise by 90 degrees, shape (m, 2)."""
    return np.column_stack([-tangents[:, 1], tangents[:, 0]])


def _basis(element: Any, derivative: int, reference: np.ndarray) -> np.ndarray:
    """Return shape functions, or first derivatives on an interval, at reference points (m, dimension), (m, dim)."""
    if not len(reference):                             # basix does not take an empty set
        return np.zeros((0, element.dim))
    return element.tabulate(derivative, reference)[derivative].reshape(len(reference), element.dim)


def probe(problem: Any, points: Any) -> Probe:
    """Return the `Probe` of the displacement at reference points (R, Z), shape (n, 2), length, for every model."""
    return problem.forms.probe(problem, points)
