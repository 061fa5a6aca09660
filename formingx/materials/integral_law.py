"""Interface of a stress that depends on all past states of a material."""

from collections.abc import Mapping, Sequence
from typing import Protocol


class IntegralLaw(Protocol):
    """Law of a stress that depends on all past states (`Material.integral`).

    Attributes:
        coefficients: fields at quadrature points from which the stress follows, {name: value in the reference
            configuration}. A value is a number, or a tuple of the entries of a tensor.
    """

    coefficients: Mapping[str, object]

    def history(self, forms: object, terms: object) -> object:
        """Return the history of the material: its past states, from which the fields `coefficients` are computed.

        Args:
            forms: the `Formulation` of the body.
            terms: the `MaterialTerms` of the material.

        Returns:
            A `formingx.forms.history.ConstitutiveHistory`. Its method `refresh()` updates the fields
            `coefficients` to the current displacements and time of the forms.
        """

    def unsymmetric_work(self, C: Sequence[object], dC: Sequence[object], coefficients: Mapping[str, object]) -> object:
        """Return the part of the virtual work per reference volume that does not derive from a potential.

        Args:
            C: entries 11, 22, 12, 33 of the isochoric right Cauchy-Green tensor (UFL).
            dC: virtual changes of these entries (UFL).
            coefficients: {name of a coefficient: its function (UFL)}.

        Returns:
            Virtual work (UFL, stress); None if the stress derives from a potential.
        """
