"""The interface of a stress that depends on all past states of a material."""

from collections.abc import Mapping, Sequence
from typing import Protocol


class IntegralLaw(Protocol):
    """The law of a stress that depends on all past states (`Material.integral`).

    Attributes:
        coefficients: {name: value in the reference configuration}, tuples for tensors: the functions that the forms
            hold at quadrature points.
    """

    coefficients: Mapping[str, object]

    def history(self, forms: object, terms: object) -> object:
        """Return the `formingx.forms.history.ConstitutiveHistory` that keeps the past states and the coefficients.

        It has a method `refresh()`, which makes the coefficients exact at the fields and the time of the forms.

        Args:
            forms: the `Formulation`. terms: the `MaterialTerms` of the material.
        """

    def unsymmetric_work(self, C: Sequence[object], dC: Sequence[object], coefficients: Mapping[str, object]) -> object:
        """Return the virtual work in addition to the potential, per reference volume (UFL, stress), or None.

        Args:
            C: entries 11, 22, 12, 33 of the isochoric right Cauchy-Green tensor (UFL). dC: their virtual changes.
            coefficients: {name: function}.
        """
