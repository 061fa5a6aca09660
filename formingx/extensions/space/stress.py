r"""Stresses of a sheet in three dimensions: membrane resultants, principal stresses, and stresses at a depth.

In the axes along the deformed first edge, across it in the surface and along the normal, the Cauchy stress of an
incompressible membrane without normal stress is (Holzapfel, Nonlinear Solid Mechanics, 2000, section 6.3)

.. math:: \sigma_{\alpha\beta} = \tau_{\alpha\beta} - \tau_{33} \delta_{\alpha\beta}, \qquad
          \tau = \frac{\partial W}{\partial F} F^T
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ufl

from ... import _compat
from ...errors import InputError
from ...materials.constants import OfTemperature
from ...mesh.nodes import own_cells
from ...ranks import gathered
from ...results.files.column_table import ColumnTable
from . import show
from .heat.basis import lagrange, layer_shares
from .scene_checks import depends_on_direction
from .wall import SheetWall, wall_of


@dataclass(frozen=True, repr=False)
class SheetStress(ColumnTable):
    """Principal stresses of the m triangles of a sheet in one state, in the order of `Path.wall`.

    Attributes:
        principal: principal Cauchy stresses in the surface, the larger first, shape (m, 2), stress; means over the
            thickness, or those at a depth.
        directions: unit vectors along them in the deformed body, shape (m, 2, 3).
        wall: wall of the sheet in this state (`SheetWall`).
        depth: depth of the stresses, from 0 at the bottom (inner) face to 1 at the top (outer) face; None: means.
        comm: MPI communicator.
        draw: function of a file and of values of the triangles, shape (m,), that draws the part coloured by them.
    """

    principal: np.ndarray
    directions: np.ndarray
    wall: SheetWall
    depth: float | None = None
    comm: Any = field(default=None, repr=False)
    draw: Any = field(default=None, repr=False)

    @property
    def resultants(self) -> np.ndarray:
        """Principal membrane resultants, force per deformed length, shape (m, 2), stress length.

        They are the mean stresses times the wall.
        """
        if self.depth is not None:
            raise InputError(f"resultants: these are the stresses at the depth {self.depth:g}: use path.stress() for"
                             f" the means over the thickness")
        return self.principal * self.wall.wall[:, None]

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the table, with a row for each triangle: {name: values, shape (m,)}.

        They are the deformed centroid (x, y, z), the principal stresses "stress_1" and "stress_2" and the direction of
        the first, "direction_x", "direction_y" and "direction_z"; the resultants "force_1" and "force_2" of means.
        """
        found = dict(zip(("x", "y", "z"), self.wall.middle.T))
        found |= {f"stress_{k + 1}": self.principal[:, k] for k in range(2)}
        found |= {f"direction_{axis}": self.directions[:, 0, i] for i, axis in enumerate("xyz")}
        if self.depth is None:
            found |= {f"force_{k + 1}": self.resultants[:, k] for k in range(2)}
        return found

    def view(self, file: Any) -> None:
        """Draw the whole part as PNG, coloured by its larger principal stress (rank 0 draws).

        Args:
            file: its name ends in .png.

        Raises:
            InputError: the name has another ending, or there is no screen and no Xvfb.
        """
        self.draw(file, self.principal[:, 0])


def stress_of(path: Any, state: Any, depth: float | None) -> SheetStress:
    """Return the stresses of a sheet in a state, means over the thickness or those at a depth; collective.

    Raise `InputError` for a stress without potential (K-BKZ), and for a depth that is not from 0 to 1.
    """
    if depth is not None and not 0 <= depth <= 1:
        raise InputError(f"Path.stress: depth = {depth!r}: must be from 0, the bottom face, to 1, the top face")
    problem, forms, comm = path.problem, path.problem.forms, path.problem.comm
    for terms in forms.terms:
        if terms.unsymmetric_work(forms.elastic_F, lambda c: c) is not None:
            raise InputError("Path.stress: is not available with K-BKZ for a sheet in three dimensions")
    cells, wall = own_cells(forms.domain), wall_of(path, state)
    parts = _parts(path.scene, depth)
    with problem.state_context(state):
        frame = _evaluated(forms, ufl.as_vector([v[i] for v in forms.frame for i in range(3)]), cells, None)
        found = {terms.names[0]: _Layer(forms, terms, cells).stress(parts[terms.names[0]])
                 for terms in forms.terms if terms.names[0] in parts}
    order = np.argsort(gathered(comm, forms.domain.topology.original_cell_index[cells]))
    frame = gathered(comm, frame[:, 0])[order].reshape(-1, 3, 3)
    sigma: Any = sum((wall.layers[name] if depth is None else 1.0) * gathered(comm, values)[order].T
                for name, values in found.items())
    if depth is None:
        sigma = sigma / wall.reference_thickness
    values, vectors = np.linalg.eigh(np.array([[sigma[0], sigma[2]], [sigma[2], sigma[1]]]).transpose(2, 0, 1))
    directions = np.einsum("mak,mai->mki", vectors[:, :, ::-1], frame[:, :2])

    def draw(file: Any, values: np.ndarray) -> None:
        """Draw the part, coloured by values of the triangles, shape (m,)."""
        show.view(path, state, file, values=values, name="larger stress")
    return SheetStress(values[:, ::-1], directions, wall, depth, comm, draw)


def _parts(scene: Any, depth: float | None) -> dict[str, float | None]:
    """Return {layer: depth within it, 0 to 1, or None for its mean} for the layers that have a part in the stresses."""
    if depth is None:
        return dict.fromkeys(scene.mesh.layers)
    shares = layer_shares(scene)
    ends = np.concatenate([[0.0], np.cumsum([*shares.values()])])
    k = int(np.clip(np.searchsorted(ends, depth, side="right") - 1, 0, len(shares) - 1))
    return {[*shares][k]: float((depth - ends[k]) / (ends[k + 1] - ends[k]))}


def _evaluated(forms: Any, expression: Any, cells: np.ndarray, places: Any) -> np.ndarray:
    """Return the values of a vector expression at places of cells (None: the centroid), shape (cells, places, n)."""
    at = np.array([[1 / 3, 1 / 3]]) if places is None else places
    if not len(cells):
        return np.zeros((0, len(at), expression.ufl_shape[0]))
    return np.asarray(_compat.compile_expression(expression, at).eval(forms.domain, cells)).reshape(
        len(cells), len(at), -1)


class _Layer:
    """Stresses of one layer in the present fields, entries 11, 22 and 12 in the axes of the deformed triangle.

    cells: local numbers of the owned cells, shape (m,).
    """

    def __init__(self, forms: Any, terms: Any, cells: np.ndarray):
        self._forms, self._terms, self._cells = forms, terms, cells
        self._basis: Any = getattr(forms.temperature, "basis", None)

    def stress(self, depth: float | None) -> np.ndarray:
        """Return the mean stresses of the layer, or those at a depth in it, shape (m, 3), stress."""
        forms, terms, rule = self._forms, self._terms, self._forms.rule
        if depth is not None and self._basis is not None and not terms.has_history:
            if depends_on_direction(forms.scene, terms.names[0]):
                raise InputError(f"Path.stress: depth = {depth!r}: with heat=... and the energy of {terms.material},"
                                 f" which depends on the direction, only means are available: leave depth out")
            return self._elastic(depth)
        F = ufl.variable(forms.elastic_F)
        tau = ufl.diff(forms.layer_energy(terms.step_energy, F), F) * F.T
        entries = ufl.as_vector([tau[0, 0] - tau[2, 2], tau[1, 1] - tau[2, 2], (tau[0, 1] + tau[1, 0]) / 2])
        found = _evaluated(forms, entries, self._cells, rule.places)
        if depth is None or self._basis is None:
            return np.einsum("q,cqk->ck", rule.weights / rule.weights.sum(), found)
        n = forms.energy_depths
        plane, across = rule.weights.reshape(-1, n).sum(1), found.reshape(len(found), -1, n, 3)
        at = self._basis.layers[terms.names[0]].gauss(n)[0]
        return np.einsum("p,m,cpmk->ck", plane / plane.sum(), lagrange(at, np.array([depth]))[0], across)

    def _elastic(self, depth: float) -> np.ndarray:
        """Return the stresses of an elastic layer at a depth, whose constants are those of the temperature there."""
        forms, terms, material = self._forms, self._terms, self._terms.material
        layer = self._basis.layers[terms.names[0]]
        points = self._basis.depths[layer.points]
        at = points[0] + depth * (points[-1] - points[0])
        T = forms.temperature.last_two_states(self._cells, np.array([[1 / 3, 1 / 3]]), terms.names[0])[0, :, 0]
        T = np.clip(T @ lagrange(points, np.array([at]))[0], *forms.temperature.limits)
        constants = []
        for name, value in material.constants().items():
            coefficient = terms.constants[name]
            if isinstance(value, OfTemperature):
                constants.append(value.clamped(T))
            else:
                constants.append(_evaluated(forms, ufl.as_vector([coefficient]), self._cells, forms.rule.places)
                                 .mean(1)[:, 0])
        F = _evaluated(forms, ufl.as_vector([forms.F[0, 0], forms.F[0, 1], forms.F[1, 1]]), self._cells, None)[:, 0]
        plane = np.zeros((len(F), 2, 2))
        plane[:, 0, 0], plane[:, 0, 1], plane[:, 1, 1] = F.T
        squared, axes = np.linalg.eigh(np.einsum("cik,cjk->cij", plane, plane))       # of F F^T, in deformed axes
        l1, l2 = np.sqrt(squared[:, 1]), np.sqrt(squared[:, 0])
        left = forms.scene.model.wrinkles
        principal = _cauchy(material, l1, l2, constants)
        if left is not None:                                 # in compression, the stress of tension-field theory
            slack = np.maximum(l1, 1.0)
            principal = left * principal + (1 - left) * _cauchy(material, slack, np.maximum(
                np.where(l1 > 1, l2, 1.0), slack**-0.5), constants)
        entries = np.einsum("kc,cik,cjk->cij", principal[::-1], axes, axes)
        return np.column_stack([entries[:, 0, 0], entries[:, 1, 1], entries[:, 0, 1]])


def _cauchy(material: Any, l1: np.ndarray, l2: np.ndarray, constants: list[np.ndarray]) -> np.ndarray:
    """Return the principal Cauchy stresses of an elastic material at stretches of shape (m,), shape (2, m), stress."""
    l = np.array([l1, l2, 1 / (l1 * l2)])
    slopes = material.response.derivatives(l, constants)[0]
    return np.asarray(l[:2] * slopes[:2] - l[2] * slopes[2])
