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
        """Return the history of past states, a `formingx.forms.history.ConstitutiveHistory`, for a body and a material.

        forms, terms: its `Formulation` and `MaterialTerms`. `refresh()` updates the fields `coefficients` to them.
        """

    def unsymmetric_work(self, C: Sequence[object], dC: Sequence[object], coefficients: Mapping[str, object]) -> object:
        """Return the virtual work (UFL, stress) per reference volume that derives from no potential, or None.

        C, dC: entries 11, 22, 12, 33 of the isochoric right Cauchy-Green tensor and its virtual change (UFL).
        coefficients: {name: function (UFL)}.
        """
