"""Transfer of a state to a new mesh whose reference configuration is the deformed body, F = grad x . F_old.

The transferred quantity is b = F F^T/J: stress and energy of a neo-Hookean body are linear in it. In each new element
it is the quadratic field nearest to b in the mean over the volume. So the stress does the same virtual work as before
in every motion of the new elements. The mean of F itself would lose the stress of its variation.

The projection raises det b, and det F_old, above 1. The conserved volume is det F divided by det F_old. F_old has the
rotation of F.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from ...forms.transfer import in_own_cells
from .earlier_meshes import MaterialPointProbe, followed, original_positions
from .files import save

_QUADRATIC = basix.ufl.element("Lagrange", "triangle", 2)
"""Element of the transferred quantities: values at the corners and at the midpoints of the opposite edges."""

_POSITIONS = basix.ufl.enriched_element([_QUADRATIC, basix.ufl.element("Bubble", "triangle", 3)])
"""Element of positions: values at the corners, the midpoints and the centre."""

_LOCAL_NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0], [1 / 3, 1 / 3]])
"""Local coordinates of the corners of a triangle, the midpoints of the edges opposite to them, and its centre."""

_LATTICE = np.array([(i, j) for i in range(5) for j in range(5 - i)]) / 4
"""Local coordinates of the points of a triangle at which `_positive_definite` and the search of cells sample it."""

_QUADRATURE_DEGREE = 12
"""Quadrature degree of means over new elements, which old edges cross."""

_CANDIDATE_ELEMENTS = 8
"""Number of old elements in which a point is searched."""

_MIN_DETERMINANT_RATIO = 0.3
"""Smallest det b and hoop entry of b in an element, over those of the mean; a field below is moved towards the mean."""


class StateTransfer(NamedTuple):
    """Deformed state of a body on its old mesh with m cells, to be transferred to a new mesh; on one rank.

    Attributes:
        x: present positions of corners, midpoints and centres of the cells, shape (m, 7, 2), length.
        reference: positions of these points in the reference configuration of the old mesh, shape (m, 7, 2), length.
        b: deformation from the start of the run to the time when the old mesh was made, as b = F F^T/J with J = det F.
            Shape (m, 6, 6): six entries at the corners and midpoints of each cell. The entries are rr, rz, zz and hoop
            entry of b, then cosine and sine of the rotation of F in the section.
        pressures: pressure unknowns of the model at the corners, shape (m, 3, p), dimensionless; p is their number.
        volume_stiffness: additional volume stiffness (`Model.volume_stiffness` times shear modulus) over the unit of
            stress of the problem.
        before: the problem on the old mesh and its last state.
    """

    x: np.ndarray
    reference: np.ndarray
    b: np.ndarray
    pressures: np.ndarray
    volume_stiffness: float = 0.0
    before: Any = None

    @classmethod
    def of(cls, problem: Any, state: Any) -> StateTransfer:
        """Return the positions, deformations and pressures of the body in a state, for a new mesh of it."""
        forms = problem.forms
        with problem.state_context(state):
            both = in_own_cells(forms.domain, ufl.as_vector([*(forms.X + forms.u), *forms.X]), _LOCAL_NODES)
            fields = ufl.split(forms.w)[1:]
            pressures = (in_own_cells(forms.domain, ufl.as_vector(fields), _LOCAL_NODES[:3]) if fields else
                         np.zeros((len(both), 3, 0)))
        x, reference = np.split(both, 2, axis=2)
        b = np.tile([1.0, 0.0, 1.0, 1.0, 1.0, 0.0], (len(x), 6, 1))
        if forms.scene.state_transfer is not None:
            b = forms.scene.state_transfer._projected_fields(forms)[0]
        scene = forms.scene
        stiffness = scene.model.volume_stiffness * max(map(scene.shear_modulus, scene.mesh.layers)) / forms.stress
        return cls(x, reference, b, pressures, stiffness, (problem, state))

    def followed(self, problem: Any, points: np.ndarray) -> np.ndarray:
        """Map points of the first mesh of the run, shape (n, 2), length, to their positions on the new mesh."""
        return followed(problem, points)

    def probe(self, problem: Any, points: np.ndarray) -> MaterialPointProbe:
        """Return a probe of the displacement since the start of the run at points of the first mesh, shape (n, 2)."""
        return MaterialPointProbe(problem, points)

    def save(self, problem: Any) -> dict[str, Any]:
        """Return the data of a checkpoint from which the problem on the new mesh can be made again."""
        return save(problem)

    def original_positions(self, points: np.ndarray) -> np.ndarray:
        """Map points of the new mesh, shape (n, 2), length, to their positions on the first mesh of the run."""
        return original_positions(self, points)

    def gradient(self, forms: Any) -> tuple[Any, Any]:
        """Return F_old (UFL, (3, 3)) from the start of the run to the new mesh, on its elements, and det F_old."""
        space = fem.functionspace(forms.domain, ("DG", 2, (6,)))
        field, values = fem.Function(space), self._projected_fields(forms)[0]
        field.x.array.reshape(-1, 6)[space.dofmap.list[: len(values)]] = values
        rr, rz, zz, hoop, along, turned = ufl.split(field)
        V, c, s, area = _left_stretch(rr, rz, zz, along, turned, ufl.sqrt)
        (a, b), (_, d) = V
        F = [[a * c + b * s, b * c - a * s, 0], [b * c + d * s, d * c - b * s, 0], [0, 0, ufl.sqrt(hoop)]]
        return ufl.as_tensor(F), area * ufl.sqrt(hoop)

    def unknowns(self, problem: Any) -> np.ndarray:
        """Return the initial unknowns, shape (n,): zero displacements and transferred pressure fields."""
        x, forms = np.zeros(problem.x.getLocalSize()), problem.forms
        values, fitted = np.zeros(len(forms.w.x.array)), self._projected_fields(forms)[1]
        for k in range(fitted.shape[2]):
            values[forms.space.sub(1 + k).dofmap.list[: len(fitted)]] = fitted[..., k]
        x[: problem.n_owned] = values[: problem.n_owned]
        return x

    def _projected_fields(self, forms: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return deformation (cells, 6, 6) and pressures (cells, 3, p) in new cells, by least squares in each.

        The deformation, at corners and midpoints, has rr, rz, zz and hoop entry of b = F F^T/J, then cosine and sine of
        the rotation of F. Pressures, at corners, are dimensionless.
        """
        rule: Any = basix.make_quadrature(basix.CellType.triangle, _QUADRATURE_DEGREE)
        xi, weights = rule
        volume = forms.weight * abs(ufl.JacobianDeterminant(forms.domain))
        sampled = in_own_cells(forms.domain, ufl.as_vector([*forms.X, volume]), xi)
        cells, coordinates = self._find_cells(np.concatenate(sampled)[:, :-1])
        b, J = self._deformation_at(cells, coordinates, forms.scene.kinematics.axisymmetric)
        linear = np.column_stack([1 - coordinates.sum(1), coordinates])
        pressures = np.einsum("na,nak->nk", linear, self.pressures[cells])
        pressures += self.volume_stiffness * (J - 1)[:, None]
        b, pressures = (values.reshape(len(sampled), len(xi), -1) for values in (b, pressures))
        weights = sampled[..., -1] * weights

        def nearest(values: np.ndarray, shapes: np.ndarray) -> np.ndarray:
            """Return nodal values (cells, nodes, k) that fit values (cells, points, k) best by shape functions."""
            mass = np.einsum("cq,qi,qj->cij", weights, shapes, shapes)
            return np.linalg.solve(mass, np.einsum("cq,qi,cqk->cik", weights, shapes, values))
        mean = np.einsum("cq,cqk->ck", weights, b) / weights.sum(1)[:, None]
        return (_positive_definite(nearest(b, _tabulated(_QUADRATIC, xi)[0]), mean),
                nearest(pressures, np.column_stack([1 - xi.sum(1), xi])))

    def _deformation_at(self, cells: np.ndarray, coordinates: np.ndarray,
                        axisymmetric: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return b = F F^T/J with cosine and sine of the rotation of F, shape (n, 6), and J of old cells, shape (n,).

        The four entries rr, rz, zz and hoop of b come first. Points have local coordinates, shape (n, 2).
        """
        x, reference, (shapes, *slopes) = self.x[cells], self.reference[cells], _tabulated(_POSITIONS, coordinates, 1)
        grad = np.einsum("dna,nai->nid", slopes, x) @ np.linalg.inv(np.einsum("dna,nai->nid", slopes, reference))
        r, R = (np.einsum("na,na->n", shapes, y[..., 0]) for y in (x, reference))
        stretch = r / R if axisymmetric else np.ones(len(r))
        rr, rz, zz, hoop, along, turned = np.einsum("na,nak->kn", _tabulated(_QUADRATIC, coordinates)[0], self.b[cells])
        V, c, s, _ = _left_stretch(rr, rz, zz, along, turned, np.sqrt)
        F = grad @ np.moveaxis(np.array(V), 2, 0) @ np.moveaxis(np.array([[c, -s], [s, c]]), 2, 0)
        in_plane = F @ F.transpose(0, 2, 1)
        turn = np.stack([F[:, 0, 0] + F[:, 1, 1], F[:, 1, 0] - F[:, 0, 1]])
        b = np.stack([in_plane[:, 0, 0], in_plane[:, 0, 1], in_plane[:, 1, 1], stretch**2 * hoop])
        J = np.linalg.det(grad) * stretch
        return np.concatenate([b / J, turn / np.linalg.norm(turn, axis=0)]).T, J

    def _find_cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the old cells, shape (n,), in which points (n, 2) of the deformed body lie, and local coordinates.

        Newton's method is used in the nearest cells. A point outside is placed on the edge of the nearest one.
        """
        from scipy.spatial import cKDTree
        inside = 0.9 * _LATTICE + 0.1 / 3
        tree = cKDTree(np.concatenate(_tabulated(_POSITIONS, inside)[0] @ self.x))
        rows = tree.query(points, _CANDIDATE_ELEMENTS)[1]
        cells, found = rows[:, 0] // len(inside), inside[rows[:, 0] % len(inside)]
        depth, size = np.full(len(points), -np.inf), np.ptp(points, axis=0).max()
        for column in rows.T:
            open_points = np.flatnonzero(depth < -1e-9)
            c, xi = column[open_points] // len(inside), inside[column[open_points] % len(inside)]
            for _ in range(8):
                shapes, *slopes = _tabulated(_POSITIONS, xi, 1)
                offset = points[open_points] - np.einsum("na,nai->ni", shapes, self.x[c])
                slope = np.einsum("dna,nai->nid", slopes, self.x[c])
                slope[np.abs(np.linalg.det(slope)) < 1e-14 * size**2] = size * np.eye(2)
                step = np.linalg.solve(slope, offset[..., None])[..., 0]
                xi = np.clip(xi + step * np.minimum(1, 0.5 / np.maximum(np.abs(step).max(1), 1e-300))[:, None], -1, 2)
            within = np.where(np.linalg.norm(offset, axis=1) < 1e-6 * size, np.minimum(xi.min(1), 1 - xi.sum(1)), -9.0)
            improved = within > depth[open_points]
            for stored, new in ((depth, within), (cells, c), (found, xi)):
                stored[open_points[improved]] = new[improved]
        area = np.maximum(np.column_stack([1 - found.sum(1), found]), 0)              # area coordinates
        return cells, area[:, 1:] / area.sum(1, keepdims=True)


def _tabulated(element: Any, xi: np.ndarray, derivatives: int = 0) -> np.ndarray:
    """Return shape functions at local points xi, (n, 2): shape (1 or 3, n, functions) with `derivatives` 0 or 1."""
    return np.asarray(element.tabulate(derivatives, xi)) if len(xi) else np.zeros((1 + 2 * derivatives, 0, element.dim))


def _left_stretch(rr: Any, rz: Any, zz: Any, along: Any, turned: Any,
                  sqrt: Any) -> tuple[list[list[Any]], Any, Any, Any]:
    """Return the left stretch V in the section (V^2 = b), cosine and sine of the rotation of F, and det V.

    The interpolated cosine (`along`) and sine (`turned`) are divided by their length; `sqrt` is that of numbers or UFL.
    """
    area = sqrt(rr * zz - rz * rz)
    trace, length = sqrt(rr + zz + 2 * area), sqrt(along**2 + turned**2)
    shear = rz / trace
    return [[(rr + area) / trace, shear], [shear, (zz + area) / trace]], along / length, turned / length, area


def _positive_definite(b: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Return fields b, shape (cells, 6, 6), that are positive definite everywhere in their cells.

    Where a rapid rotation makes them indefinite, they move towards their means, shape (cells, 6), as far as needed.
    Entries: rr, rz, zz, hoop, cosine, sine.
    """
    mean = mean[:, None]
    deviation, shapes = b - mean, _tabulated(_QUADRATIC, _LATTICE)[0]
    for k in range(12):
        rr, rz, zz, hoop, along, turned = np.moveaxis(mean + shapes @ deviation, -1, 0)
        bad = ((rr <= 0) | ((rr * zz - rz**2) * mean[..., 3] < _MIN_DETERMINANT_RATIO)
               | (hoop < _MIN_DETERMINANT_RATIO * mean[..., 3])
               | (np.hypot(along, turned) < _MIN_DETERMINANT_RATIO)).any(1)
        if not bad.any():
            break
        deviation[bad] *= 0.7 if k < 10 else 0.0
    return mean + deviation
