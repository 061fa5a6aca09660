"""How a body without stress is stretched by its temperature."""

from __future__ import annotations

from typing import Any

import basix
import basix.ufl
from dolfinx import fem


class FreeStretch:
    """J_T^(1/3) at the quadrature points of the energy; 1 in layers that do not expand.

    Args:
        forms: the `Formulation`; expansion: {layer: `ThermalExpansion`}.

    Attributes:
        stretch: a `Function` of a quadrature element.
    """

    def __init__(self, forms: Any, expansion: dict[str, Any]):
        cell, degree = forms.domain.basix_cell(), forms.scene.quadrature_degree
        self._places = basix.make_quadrature(cell, degree)[0]
        self._layers = [(forms.cells_of([name]), law) for name, law in expansion.items()]
        self._temperature = forms.scene.temperature
        element = basix.ufl.quadrature_element(cell, scheme="default", degree=degree)
        self.stretch = fem.Function(fem.functionspace(forms.domain, element), name="free stretch")
        self.stretch.x.array[:] = 1.0
        self.take_temperature()

    def elastic(self, F: Any) -> Any:
        """The elastic part of a deformation gradient F, shape (3, 3)."""
        return F / self.stretch

    def take_temperature(self) -> None:
        """The temperature has changed.

        Raises:
            InputError: there is no volume at a temperature.
        """
        for cells, law in self._layers:
            rows = self.stretch.function_space.dofmap.list[cells]
            self.stretch.x.array[rows] = law.stretch(self._temperature.in_cells(cells, self._places))
