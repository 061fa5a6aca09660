"""Thermal stretch of a body without stress."""

from __future__ import annotations

from functools import partial
from typing import Any

import basix
import basix.ufl
from dolfinx import fem

from .temperature_coefficient import TemperatureCoefficient


class FreeStretch:
    """Stretch of the stress-free thermal expansion at the quadrature points of the energy.

    The deformation gradient is split into an elastic and an isotropic thermal part:

    .. math:: F = J_T^{1/3} F_e

    J_T is the volume ratio of free thermal expansion, by {layer: its `Expansion`}. The stretch is 1 in other layers.

    Attributes:
        stretch: :math:`J_T^{1/3}` at the current time (UFL scalar).
    """

    def __init__(self, forms: Any, expansion: dict[str, Any]):
        cell, degree = forms.domain.basix_cell(), forms.scene.quadrature_degree
        element = basix.ufl.quadrature_element(cell, scheme="default", degree=degree)
        stretch = fem.Function(fem.functionspace(forms.domain, element), name="free stretch")
        stretch.x.array[:] = 1.0
        self._cells = [forms.cells_of([name]) for name in expansion]
        self._temperatures = partial(forms.temperature.last_two_states, places=basix.make_quadrature(cell, degree)[0])
        laws = [(cells, partial(law.stretch, clamped=True)) for cells, law in zip(self._cells, expansion.values())]
        self._coefficient = TemperatureCoefficient(forms, stretch, laws, map(self._temperatures, self._cells))
        self.stretch = self._coefficient.at_time(forms.time)

    def update_temperature(self) -> None:
        """Update the thermal stretch to a changed temperature of the body."""
        self._coefficient.update(map(self._temperatures, self._cells))

    def elastic(self, F: Any) -> Any:
        """Return F / J_T^(1/3) with the volume ratio J_T of free thermal expansion (UFL, shape (3, 3))."""
        return F / self.stretch
