"""How a body without stress is stretched by its temperature."""

from __future__ import annotations

from functools import partial
from typing import Any

import basix
import basix.ufl
from dolfinx import fem

from .followed import Followed


class FreeStretch:
    """J_T^(1/3) at the quadrature points of the energy; 1 in layers that do not expand.

    Args:
        forms: the `Formulation`; expansion: {layer: `ThermalExpansion`}.

    Attributes:
        stretch: UFL. take_temperature(): see `Followed`.
    """

    def __init__(self, forms: Any, expansion: dict[str, Any]):
        cell, degree = forms.domain.basix_cell(), forms.scene.quadrature_degree
        places, temperature = basix.make_quadrature(cell, degree)[0], forms.temperature
        element = basix.ufl.quadrature_element(cell, scheme="default", degree=degree)
        stretch = fem.Function(fem.functionspace(forms.domain, element), name="free stretch")
        stretch.x.array[:] = 1.0
        parts = [(cells, law.stretch, partial(temperature.in_cells, cells, places))
                 for name, law in expansion.items() for cells in [forms.cells_of([name])]]
        self._followed = Followed(forms, stretch, parts)
        self.stretch, self.take_temperature = self._followed.at(forms.time), self._followed.take_temperature

    def elastic(self, F: Any) -> Any:
        """The elastic part of a deformation gradient F, shape (3, 3)."""
        return F / self.stretch
