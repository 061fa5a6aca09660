"""Interface of a stress that depends on all past states of a material."""

from collections.abc import Mapping, Sequence
from typing import Protocol


class IntegralLaw(Protocol):
    """Law of a stress that depends on all past states (`Material.integral`).

    Attributes:
        coefficients: {name: value in the reference configuration}, tuples for tensors; functions of the forms at
            quadrature points.
    """

    coefficients: Mapping[str, object]

    def history(self, forms: object, terms: object) -> object:
        """Return the history of past states and coefficients, a `formingx.forms.history.ConstitutiveHistory`.

        Its method `refresh()` makes the coefficients exact for the fields and the time of the forms.

        Args:
            forms: the `Formulation`.
            terms: the `MaterialTerms` of the material.

        Returns:
            The history.
        """

    def unsymmetric_work(self, C: Sequence[object], dC: Sequence[object], coefficients: Mapping[str, object]) -> object:
        """Return the virtual work that no potential has, per reference volume.

        Args:
            C: entries 11, 22, 12, 33 of the isochoric right Cauchy-Green tensor (UFL).
            dC: their virtual changes (UFL).
            coefficients: {name: function}.

        Returns:
            Virtual work (UFL, stress), or None.
        """
