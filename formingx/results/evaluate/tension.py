"""Check of a membrane for compression, under which it wrinkles, because it has no bending stiffness.

Tension field theory describes the wrinkled state (Steigmann, Proc. R. Soc. London A 429 (1990) 141). It is not
implemented here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import ufl

from ... import _compat
from ...findings import Finding
from ...mesh.nodes import own_cells
from ...physics.models import Membrane
from ...ranks import gathered
from ...values.tolerances import NEGLIGIBLE


class Resultant(NamedTuple):
    """Smallest principal stress resultant (force per deformed length) of a membrane in a state.

    Attributes:
        direction: direction of the force, "meridional" or "hoop".
        value: the resultant over shear modulus times reference thickness, negative in compression.
        point: reference position (R, Z) of its place on the mid-surface, length.
    """

    direction: str
    value: float
    point: tuple[float, float]

    @property
    def compressed(self) -> bool:
        """True if the smallest resultant is below -0.001 times shear modulus times reference thickness."""
        return self.value < -NEGLIGIBLE


class Tension:
    r"""Computes the principal stress resultants of an incompressible membrane, forces per deformed length.

    A layer has the reference thickness h, the meridional stretch l1, the hoop stretch l2, the stretch l3 of its
    thickness, and the energy density W per reference volume. Its resultants N1 and N2 are

    .. math:: N_i = h \, l_3 (l_i P_{ii} - l_3 P_{33}), \qquad P = \partial W / \partial F

    The resultants of all layers are added. The problem has a scene whose model is a `Membrane`.
    """

    def __init__(self, problem: Any):
        forms, self._problem = problem.forms, problem
        resultants: Any = [0, 0]
        for terms in forms.terms:
            F = ufl.variable(forms.F)
            P = ufl.diff(terms.stored_energy(F), F)
            h = F[1, 1] * forms.thicknesses[terms.names[0]]
            resultants = [N + h * (F[i, i] * P[i, i] - F[1, 1] * P[1, 1]) for N, i in zip(resultants, (0, 2))]
        unit = forms.constant(forms.stress) * sum(forms.thicknesses.values())
        reference_hoop = resultants[1] * forms.F[0, 0]      # per reference length
        values = ufl.as_vector([*(N / unit for N in resultants), forms.X[0], forms.X[1], reference_hoop])
        self._found = _compat.compile_expression(values, forms.terms[0].places)

    def smallest(self, state: Any) -> Resultant:
        """Return the smallest meridional or hoop resultant at the quadrature points in a state; collective.

        Compression is negative. In plane strain the resultants out of plane are not examined.
        """
        values = self._values(state)
        n = 2 if self._problem.scene.kinematics.axisymmetric else 1
        k, i = np.unravel_index(np.argmin(values[:, :n]), (len(values), n))
        return Resultant(("meridional", "hoop")[i], float(values[k, i]), (float(values[k, 2]), float(values[k, 3])))

    def hoop(self, state: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (n, 2) and hoop forces per reference length (n,) from axis to rim; collective."""
        values = self._values(state)
        values = values[np.argsort(values[:, 2])]
        return values[:, 2:4], values[:, 4]

    def _values(self, state: Any) -> np.ndarray:
        """Return data at the n quadrature points of all ranks in a state, shape (n, 5); collective.

        The columns are the meridional and the hoop resultant over shear modulus times thickness, R and Z (length), and
        the hoop force per reference length of the meridian (stress * length).
        """
        problem, domain = self._problem, self._problem.forms.domain
        with problem.state_context(state):
            cells = own_cells(domain)
            values = self._found.eval(domain, cells).reshape(-1, 5) if len(cells) else np.zeros((0, 5))
        return gathered(problem.comm, values)


def first_compression(path: Any) -> tuple[int, Resultant] | None:
    """Return number and resultant of the first compressed state of a membrane in a section, or None; collective."""
    k = 0
    for segment in path.record.segments:
        scene = segment.problem.scene
        line = isinstance(scene.model, Membrane) and scene.kinematics.components == 2
        tension = Tension(segment.problem) if line else None
        for state in segment.states:
            if tension is not None and (smallest := tension.smallest(state)).compressed:
                return k, smallest
            k += 1
    return None


def findings(first: tuple[int, Resultant] | None) -> list[Finding]:
    """Return a finding on the first compression of a membrane in a list; empty without compression."""
    if first is None:
        return []
    k, (direction, value, point) = first
    return [Finding("serious", "membrane", f"The membrane is in compression, first in state {k}: its {direction}"
                    f" resultant is {value:.2g} of shear modulus times thickness at (R, Z) = ({point[0]:.5g},"
                    f" {point[1]:.5g}): it would wrinkle there, as it has no bending stiffness: use a solid model,"
                    f" MixedPressure().")]
