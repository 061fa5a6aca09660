r"""Pressure on a sheet in three dimensions that slides on a tool, along the normal of the tool.

The triangles of a sheet are chords of a fillet. Pressure normal to a chord of length l has a tangential part at its
ends where chords of different lengths meet. On a fillet of radius R it adds p l^2/(4 R) to the tension, an error of
second order that may exceed the tension itself. The chords approximate the tool, whose normal n is known. Of the force
f of the pressure on a node in contact only

.. math:: (n \cdot f) \, n

acts. The tangential part fades as the contact pressure grows, so the force is continuous at gap closure.

The contact pressure is taken from the last accepted state, and is 0 at nodes whose gap closed since then. A state in
which nodes have just closed therefore depends on the step that led to it (`Path.at`, `intermediate`): in a trough,
walls change by up to 3 %. Once the contact pressure is a third of the pressure, the state does not depend on the steps.
The contact pressure of the state itself would make states unique, but Newton's method would not converge on coarse
fillets.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

_FULL = 1 / 3              # contact over applied pressure from which on all of this acts along the tool's normal


class PressureOnTools:
    """Virtual work that removes the tangential part of the pressure at the nodes that slide on tools.

    The normal in the forms, n + H (u - u_0), has its exact derivative with respect to the displacement u at the present
    displacement u_0.

    Args:
        surface: the `Surface`.
    """

    def __init__(self, surface: Any):
        self._surface = surface
        self._touches, self._at, self._normal, *self._hessian = (fem.Function(surface.space) for _ in range(6))

    def work(self, value: Any, area: Any) -> Any:
        """Return the virtual work of the removed part of a pressure.

        Args:
            value: the pressure (UFL scalar, stress).
            area: deformed area vector per reference area (UFL, shape (3,)).

        Returns:
            Virtual work (UFL, rank 1).
        """
        surface, v = self._surface, self._surface.test_displacement()
        touches, at, normal, *hessian = (ufl.split(f)[0] for f in (
            self._touches, self._at, self._normal, *self._hessian))
        n = normal + sum(h * (u - a) for h, u, a in zip(hessian, surface.u, at))
        most = _FULL * abs(value)
        share = touches[0] * ufl.conditional(ufl.lt(touches[1], most), touches[1] / most, 1)
        tangential = ufl.inner(area, v) - ufl.inner(area, n) * ufl.inner(n, v)
        return value * share * tangential * surface.dx(
            metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})

    def refresh(self) -> None:
        """Update the points in contact and the normals of the tools to the present displacement; collective."""
        surface, n = self._surface, self._surface.space.dofmap.index_map.size_local
        fields, control = surface.w.x.array[:n], float(surface.control.value)
        functions = (self._touches, self._normal, *self._hessian)
        for function in functions:
            function.x.array[:] = 0
        self._at.x.array[:] = surface.length * surface.w.x.array
        for face in surface.faces:
            if face.present and not face.contact.sticks and face.history is not None:
                held, near = face.law.near(face.positions(fields, control), face.history)
                pressed = face.law.pressure(face.history)[held]
                touches = np.column_stack([np.ones(len(held)), pressed, np.zeros(len(held))])
                for function, values in zip(functions, (touches, near.normal, *near.hessian.transpose(2, 0, 1))):
                    function.x.array[face.rule.dofs[held]] = values
        for function in functions:
            function.x.scatter_forward()
