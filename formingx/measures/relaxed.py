"""Relaxation of a body: stress at the pole over its equilibrium value, elastic stretches of relaxing branches."""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from .. import _compat
from ..mesh.nodes import own_cells
from ..values.tolerances import ROUND_OFF

_ADDED_STRAIN = 1e-6
"""Equibiaxial strain that is added if the stresses are zero: the ratio of stresses is then the ratio of the moduli."""


class PoleStressRatio:
    r"""Ratio of the Mises stress at the pole to its value after complete relaxation at the same deformation.

    Both stresses are means over the reference volume of the elements at the axis:

    .. math:: \sigma = \sqrt{\tfrac{3}{2}} \, |\mathrm{dev}(P F^T)|, \qquad P = \frac{\partial W}{\partial F}

    W is `Material.stored_energy` for the present stress, `Material.equilibrium_energy` for the relaxed stress. In the
    equibiaxial state of a pole, sigma is the stress along the sheet minus the stress through its thickness.
    """

    def __init__(self, problem: Any):
        forms = problem.forms
        domain, mesh = forms.domain, forms.mesh
        dim = domain.topology.dim
        domain.topology.create_connectivity(dim - 1, dim)
        facets = np.concatenate([mesh.facets.find(tag) for tag in np.atleast_1d(mesh.boundaries["axis"])])
        cells = [domain.topology.connectivity(dim - 1, dim).links(f) for f in facets]
        near = np.unique(np.concatenate([np.zeros(0, np.int32), *cells]))
        near = near[near < len(own_cells(domain))]
        self._problem, self._strain = problem, forms.constant(0.0)
        self._weights = forms.rule.weights
        self._parts = [(self._expression(terms), np.intersect1d(near, terms.cells).astype(np.int32))
                       for terms in forms.terms]

    @staticmethod
    def known(problem: Any) -> bool:
        """Return True with a boundary "axis" and an equilibrium energy of every material."""
        forms = problem.forms
        return "axis" in forms.mesh.boundaries and all(t.equilibrium_energy(forms.elastic_F) is not None
                                                       for t in forms.terms)

    def evaluate(self) -> float:
        """Return present over relaxed Mises stress at the pole, the ratio of moduli if undeformed; collective."""
        stored, relaxed, modulus = self._integrals()
        if relaxed < ROUND_OFF * modulus:
            self._strain.value = _ADDED_STRAIN
            stored, relaxed, _ = self._integrals()
            self._strain.value = 0.0
        return float(stored / relaxed)

    def _integrals(self) -> np.ndarray:
        """Return the integrals of three stresses over the elements at the pole.

        They are the present and the relaxed Mises stress, and the largest shear modulus, on all ranks; collective.
        """
        totals = np.zeros(3)
        for expression, cells in self._parts:
            if len(cells):
                values = expression.eval(self._problem.forms.domain, cells).reshape(len(cells), -1, 3)
                totals += np.einsum("q,cqk->k", self._weights, values)
        return self._problem.comm.allreduce(totals, MPI.SUM)

    def _expression(self, terms: Any) -> fem.Expression:
        """Return the integrands of `_integrals` at quadrature points, as a compiled expression of shape (3,).

        They are the present Mises stress, the relaxed Mises stress and the largest shear modulus. Each is multiplied by
        the reference volume of the body per volume of the reference cell. `terms` are the `MaterialTerms` of a
        material.
        """
        forms, e = self._problem.forms, self._strain
        F = ufl.variable(forms.elastic_F * ufl.diag(ufl.as_vector([1 + e, 1 - 2 * e, 1 + e])))
        deviators = [ufl.dev(ufl.diff(energy, F) * F.T) for energy in (terms.stored_energy(F),
                                                                      terms.equilibrium_energy(F))]
        stresses = [ufl.sqrt(1.5 * ufl.inner(d, d)) for d in deviators] + [forms.constant(forms.stress)]
        volume = sum(part.integrand() for part in forms.weighted(forms.constant(1.0), terms.names).integrals())
        volume *= abs(ufl.JacobianDeterminant(forms.domain))
        return _compat.compile_expression(ufl.as_vector([s * volume for s in stresses]), terms.places)


class ElasticStretches:
    """Largest principal elastic stretch of each relaxing branch, at n points of every cell.

    It is 1 for a relaxed branch. The values at quadrature points are projected to a linear function in each cell, by
    least squares. The points have positions in the reference cell, shape (n, 2).

    Attributes:
        count: largest number of branches of a material; 0 if no material relaxes.
    """

    def __init__(self, problem: Any, places: np.ndarray):
        forms = problem.forms
        self._problem, self._n = problem, len(places)
        self._parts = []
        for terms in forms.terms:
            if stretches := terms.elastic_stretches(forms.elastic_F):
                own = terms.cells[terms.cells < len(own_cells(forms.domain))]
                compiled = _compat.compile_expression(ufl.as_vector(stretches), terms.places)
                self._parts.append((compiled, own, len(stretches)))
        self.count = max((count for *_, count in self._parts), default=0)
        if self._parts:
            points, weights = forms.rule.places, forms.rule.weights
            root = np.sqrt(np.abs(weights))[:, None]
            basis, at_places = (np.column_stack([np.ones(len(x)), x]) for x in (points, places))
            self._to_places = at_places @ np.linalg.pinv(root * basis) * root.T      # least squares: an L2 projection

    def evaluate(self, cells: int) -> np.ndarray:
        """Return present stretches in owned cells, (cells, n, `count`); nan for a missing branch."""
        found = np.full((cells, self._n, self.count), np.nan)
        for expression, own, count in self._parts:
            if len(own):
                values = expression.eval(self._problem.forms.domain, own).reshape(len(own), -1, count)
                found[own, :, :count] = np.einsum("nq,cqk->cnk", self._to_places, values)
        return found
