"""Loads: each gives its virtual work."""

from __future__ import annotations

import ufl

from ..errors import finite


class Pressure:
    """Follower pressure on a tagged boundary: it stays normal to the deformed face (Song 1993, section 3.3).

    dW = -p integral over the deformed face of n . du, pulled back by Nanson's formula and integrated exactly; its
    (unsymmetric) load stiffness is part of the tangent.

    Args:
        on: name of the boundary. A positive pressure pushes into the body.
        value: a fixed pressure (stress); None: the pressure is what the run controls.
        name: what it is called in a process and in its columns.
    """

    quadrature_degree = 5
    quantity = "pressure"

    def __init__(self, on: str, value: float | None = None, name: str | None = None):
        self.on, self.name = on, name
        self.value = None if value is None else finite(f"Pressure({on!r}): value", value)

    @property
    def driven(self) -> bool:
        """True if the run controls this load."""
        return self.value is None

    def virtual_work(self, kinematics, u, du, X, N, pressure):
        """Integrand on the reference boundary: u, du displacement and test function, N the outward normal."""
        return -pressure * ufl.inner(kinematics.area_vector(u, X, N), du)

    def __repr__(self) -> str:
        return f"Pressure({self.on!r}{'' if self.driven else f', {self.value!r}'})"
