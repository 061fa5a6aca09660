"""A body whose mesh is what it was deformed to: F = grad x . F_old, and how a state continues from there.

What is carried is b = F F^T/J, in which stress and energy of a neo-Hookean body are linear: in each new element the
quadratic field that is nearest to it in the mean over its volume. So the stress does the same virtual work as before in
every motion of the new elements. (The mean of F is of less stress: what F varies by about it is lost.) With that, det b
exceeds 1, and so does det F_old: the volume that is kept is det F over it. F_old turns as F did.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from ...forms.carry import in_own_cells
from .earlier_meshes import FollowedProbe, first_places, followed
from .files import save

_QUADRATIC = basix.ufl.element("Lagrange", "triangle", 2)
"""Of what is carried, by its values at the corners and at the middles of the edges opposite to them."""

_POSITIONS = basix.ufl.enriched_element([_QUADRATIC, basix.ufl.element("Bubble", "triangle", 3)])
"""Of positions, by those of the corners, the middles and the centre."""

_PLACES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0], [1 / 3, 1 / 3]])
"""Corners, middles of the edges opposite to them, centre of a cell."""

_LATTICE = np.array([(i, j) for i in range(5) for j in range(5 - i)]) / 4
"""Places all over a cell."""

_DEGREE = 12
"""Of the rule for means over new elements, in which old ones end."""

_CANDIDATES = 8
"""Old elements that a point is looked for in."""

_LEAST = 0.3
"""Of det b and of the hoop's part in it, over those of the mean: a field that is less somewhere is flattened."""


class Preformed(NamedTuple):
    """State transfer from the mesh before, of m cells; on one rank.

    Attributes:
        x, rest: where corners, middles and centres are now, and were without displacement, shape (m, 7, 2), length.
        b: what it had brought to that mesh, at corners and middles: entries rr, rz, zz, hoop of b, cos and sin of the
            rotation, shape (m, 6, 6).
        pressures: of the pressure fields at the corners, shape (m, 3, fields), dimensionless.
        held: stiffness of the volume of each point besides (`Model.volume_stiffness`), dimensionless.
        before: the problem of that mesh, and its last state.
    """

    x: np.ndarray
    rest: np.ndarray
    b: np.ndarray
    pressures: np.ndarray
    held: float = 0.0
    before: Any = None

    @classmethod
    def of(cls, problem: Any, state: Any) -> Preformed:
        """Return the transfer data of the body of a state."""
        forms = problem.forms
        with problem.state_context(state):
            both = in_own_cells(forms.domain, ufl.as_vector([*(forms.X + forms.u), *forms.X]), _PLACES)
            fields = ufl.split(forms.w)[1:]
            pressures = (in_own_cells(forms.domain, ufl.as_vector(fields), _PLACES[:3]) if fields else
                         np.zeros((len(both), 3, 0)))
        x, rest = np.split(both, 2, axis=2)
        b = np.tile([1.0, 0.0, 1.0, 1.0, 1.0, 0.0], (len(x), 6, 1))
        if forms.scene.preformed is not None:
            b = forms.scene.preformed._carried(forms)[0]
        scene = forms.scene
        held = scene.model.volume_stiffness * max(map(scene.shear_modulus, scene.mesh.layers)) / forms.stress
        return cls(x, rest, b, pressures, held, (problem, state))

    def followed(self, problem: Any, points: np.ndarray) -> np.ndarray:
        """Return the positions on the new mesh of points of the first mesh, shape (n, 2), length."""
        return followed(problem, points)

    def probe(self, problem: Any, points: np.ndarray) -> FollowedProbe:
        """Return a probe of the displacement at points of the first mesh, shape (n, 2), length."""
        return FollowedProbe(problem, points)

    def save(self, problem: Any) -> dict[str, Any]:
        """Return the data of a checkpoint from which the problem on this mesh is made again."""
        return save(problem)

    def first_places(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on the first mesh of points of the new mesh, shape (n, 2)."""
        return first_places(self, points)

    def gradient(self, forms: Any) -> tuple[Any, Any]:
        """F_old on the elements of a formulation (UFL, shape (3, 3)), and det F_old."""
        space = fem.functionspace(forms.domain, ("DG", 2, (6,)))
        field, values = fem.Function(space), self._carried(forms)[0]
        field.x.array.reshape(-1, 6)[space.dofmap.list[: len(values)]] = values
        rr, rz, zz, hoop, along, turned = ufl.split(field)
        V, c, s, area = _root(rr, rz, zz, along, turned, ufl.sqrt)
        (a, b), (_, d) = V
        F = [[a * c + b * s, b * c - a * s, 0], [b * c + d * s, d * c - b * s, 0], [0, 0, ufl.sqrt(hoop)]]
        return ufl.as_tensor(F), area * ufl.sqrt(hoop)

    def unknowns(self, problem: Any) -> np.ndarray:
        """The unknowns of the body as it stands, own part: no displacement, its pressures."""
        x, forms = np.zeros(problem.x.getLocalSize()), problem.forms
        values, fitted = np.zeros(len(forms.w.x.array)), self._carried(forms)[1]
        for k in range(fitted.shape[2]):
            values[forms.space.sub(1 + k).dofmap.list[: len(fitted)]] = fitted[..., k]
        x[: problem.n_owned] = values[: problem.n_owned]
        return x

    def _carried(self, forms: Any) -> tuple[np.ndarray, np.ndarray]:
        """`b` and `pressures` of the cells of a formulation on the body as it stands: by least squares in each."""
        rule: Any = basix.make_quadrature(basix.CellType.triangle, _DEGREE)
        at, weights = rule
        volume = forms.weight * abs(ufl.JacobianDeterminant(forms.domain))
        sampled = in_own_cells(forms.domain, ufl.as_vector([*forms.X, volume]), at)
        cells, places = self._located(np.concatenate(sampled)[:, :-1])
        b, J = self._b(cells, places, forms.scene.kinematics.axisymmetric)
        pressures = np.einsum("na,nak->nk", np.column_stack([1 - places.sum(1), places]), self.pressures[cells])
        pressures += self.held * (J - 1)[:, None]
        b, pressures = (values.reshape(len(sampled), len(at), -1) for values in (b, pressures))
        weights = sampled[..., -1] * weights

        def nearest(values: np.ndarray, shapes: np.ndarray) -> np.ndarray:
            mass = np.einsum("cq,qi,qj->cij", weights, shapes, shapes)
            return np.linalg.solve(mass, np.einsum("cq,qi,cqk->cik", weights, shapes, values))
        mean = np.einsum("cq,cqk->ck", weights, b) / weights.sum(1)[:, None]
        return (_flattened(nearest(b, _tabulated(_QUADRATIC, at)[0]), mean),
                nearest(pressures, np.column_stack([1 - at.sum(1), at])))

    def _b(self, cells: np.ndarray, places: np.ndarray, axisymmetric: bool) -> tuple[np.ndarray, np.ndarray]:
        """The entries of `b` at places of cells, shape (n, 6), and J there, shape (n,)."""
        x, rest, (shapes, *slopes) = self.x[cells], self.rest[cells], _tabulated(_POSITIONS, places, 1)
        grad = np.einsum("dna,nai->nid", slopes, x) @ np.linalg.inv(np.einsum("dna,nai->nid", slopes, rest))
        r, R = (np.einsum("na,na->n", shapes, y[..., 0]) for y in (x, rest))
        stretch = r / R if axisymmetric else np.ones(len(r))
        rr, rz, zz, hoop, along, turned = np.einsum("na,nak->kn", _tabulated(_QUADRATIC, places)[0], self.b[cells])
        V, c, s, _ = _root(rr, rz, zz, along, turned, np.sqrt)
        F = grad @ np.moveaxis(np.array(V), 2, 0) @ np.moveaxis(np.array([[c, -s], [s, c]]), 2, 0)
        in_plane = F @ F.transpose(0, 2, 1)
        turn = np.stack([F[:, 0, 0] + F[:, 1, 1], F[:, 1, 0] - F[:, 0, 1]])
        b = np.stack([in_plane[:, 0, 0], in_plane[:, 0, 1], in_plane[:, 1, 1], stretch**2 * hoop])
        J = np.linalg.det(grad) * stretch
        return np.concatenate([b / J, turn / np.linalg.norm(turn, axis=0)]).T, J

    def _located(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The cells that points, shape (n, 2), are in, shape (n,), and where in them, shape (n, 2), by Newton's method.

        New edges cut corners of old ones: points outside the body are in the element next to them, at its edge.
        """
        from scipy.spatial import cKDTree
        inside = 0.9 * _LATTICE + 0.1 / 3
        tree = cKDTree(np.concatenate(_tabulated(_POSITIONS, inside)[0] @ self.x))
        rows = tree.query(points, _CANDIDATES)[1]
        cells, found = rows[:, 0] // len(inside), inside[rows[:, 0] % len(inside)]
        least, size = np.full(len(points), -np.inf), np.ptp(points, axis=0).max()
        for column in rows.T:
            todo = np.flatnonzero(least < -1e-9)
            c, at = column[todo] // len(inside), inside[column[todo] % len(inside)]
            for _ in range(8):
                shapes, *slopes = _tabulated(_POSITIONS, at, 1)
                away = points[todo] - np.einsum("na,nai->ni", shapes, self.x[c])
                slope = np.einsum("dna,nai->nid", slopes, self.x[c])
                slope[np.abs(np.linalg.det(slope)) < 1e-14 * size**2] = size * np.eye(2)
                step = np.linalg.solve(slope, away[..., None])[..., 0]
                at = np.clip(at + step * np.minimum(1, 0.5 / np.maximum(np.abs(step).max(1), 1e-300))[:, None], -1, 2)
            within = np.where(np.linalg.norm(away, axis=1) < 1e-6 * size, np.minimum(at.min(1), 1 - at.sum(1)), -9.0)
            better = within > least[todo]
            for kept, new in ((least, within), (cells, c), (found, at)):
                kept[todo[better]] = new[better]
        by = np.maximum(np.column_stack([1 - found.sum(1), found]), 0)
        return cells, by[:, 1:] / by.sum(1, keepdims=True)


def _tabulated(element: Any, at: np.ndarray, derivatives: int = 0) -> np.ndarray:
    """Shape functions, then their derivatives, at places, shape (n, 2): shape (1 or 3, n, functions)."""
    return np.asarray(element.tabulate(derivatives, at)) if len(at) else np.zeros((1 + 2 * derivatives, 0, element.dim))


def _root(rr: Any, rz: Any, zz: Any, along: Any, turned: Any, sqrt: Any) -> tuple[list[list[Any]], Any, Any, Any]:
    """V with V^2 = b in the plane, cos and sin of a rotation, det V: of entries of `Preformed.b`."""
    area = sqrt(rr * zz - rz * rz)
    trace, length = sqrt(rr + zz + 2 * area), sqrt(along**2 + turned**2)
    off = rz / trace
    return [[(rr + area) / trace, off], [off, (zz + area) / trace]], along / length, turned / length, area


def _flattened(b: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Quadratic fields of the entries of `Preformed.b`, shape (cells, 6, 6), as near to their means, shape (cells, 6),
    as it takes to be of a body everywhere: where it turns within an element, as beside a corner, they may not be."""
    mean = mean[:, None]
    by, shapes = b - mean, _tabulated(_QUADRATIC, _LATTICE)[0]
    for k in range(12):
        rr, rz, zz, hoop, along, turned = np.moveaxis(mean + shapes @ by, -1, 0)
        bad = ((rr <= 0) | ((rr * zz - rz**2) * mean[..., 3] < _LEAST) | (hoop < _LEAST * mean[..., 3])
               | (np.hypot(along, turned) < _LEAST)).any(1)
        if not bad.any():
            break
        by[bad] *= 0.7 if k < 10 else 0.0
    return mean + by
