r"""Direction of the pressure on a sheet in three dimensions that slides on a tool: the normal of the tool.

The triangles of a sheet are chords of a fillet. A pressure p normal to a chord of length l has a tangential part at the
ends of the chord, where chords of different lengths meet. On a fillet of radius R it adds p l^2/(4 R) to the tension,
an error of second order that may exceed the tension itself. The chords approximate the tool, whose normal n is known.
Of the force f of the pressure on a node in contact only

.. math:: (n \cdot f) \, n

acts. The tangential part fades as the contact pressure grows, so the force is continuous at gap closure.

Within a step the contact pressure is constant: as a function of the displacement it would keep Newton's method from
converging on coarse fillets. It is the pressure of the last accepted state, and 0 at nodes whose gap closed since then.
At a target the state is solved for again with its own contact pressure, until both agree (`LaggedCorrections.renew`).
States at targets, and states of `Path.state_at`, therefore do not depend on the steps before them without friction.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

_FULL = 1 / 3              # contact over applied pressure from which on all of this acts along the tool's normal


class PressureOnTools:
    r"""Virtual work that removes the tangential part of the pressure at the nodes that slide on tools.

    The forms contain the normal n of the tool to first order in the displacement u,

    .. math:: n(u) = n(u_0) + H (u - u_0)

    with the present displacement u_0 and the Hessian H of the distance from the tool. The tangent of the forms is
    therefore exact at u_0.

    Args:
        surface: forms of the sheet, a `Surface`.
    """

    def __init__(self, surface: Any):
        self._surface = surface
        self._sliding, self._displacement, self._normal, *self._hessian = (
            fem.Function(surface.space) for _ in range(6))

    def work(self, value: Any, area: Any) -> Any:
        """Return the virtual work (UFL) of the tangential part of a pressure, to be subtracted from the residual.

        area: deformed area vector per unit reference area (UFL, shape (3,)).
        """
        surface, v = self._surface, self._surface.test_displacement()
        sliding, displacement, normal, *hessian = (ufl.split(f)[0] for f in (
            self._sliding, self._displacement, self._normal, *self._hessian))
        n = normal + sum(h * (u - a) for h, u, a in zip(hessian, surface.u, displacement))
        full = _FULL * abs(value)
        share = sliding[0] * ufl.conditional(ufl.lt(sliding[1], full), sliding[1] / full, 1)
        tangential = ufl.inner(area, v) - ufl.inner(area, n) * ufl.inner(n, v)
        return value * share * tangential * surface.dx(
            metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})

    def refresh(self) -> None:
        """Update the coefficients of the virtual work to the present displacement of the sheet; collective.

        The coefficients are a mask of the nodes that slide on tools, the contact pressures at these nodes, the normals
        of the tools and their derivatives. The pressures belong to the last accepted state.
        """
        surface, n = self._surface, self._surface.space.dofmap.index_map.size_local
        fields, control = surface.w.x.array[:n], float(surface.control.value)
        functions = (self._sliding, self._normal, *self._hessian)
        for function in functions:
            function.x.array[:] = 0
        self._displacement.x.array[:] = surface.length * surface.w.x.array
        for face in surface.faces:
            if face.active and not face.contact.sticks and face.history is not None:
                rows, distances = face.law.contact_distances(face.positions(fields, control), face.history)
                pressure = face.law.pressure(face.history)[rows]
                sliding = np.column_stack([np.ones(len(rows)), pressure, np.zeros(len(rows))])
                columns = (sliding, distances.normal, *distances.hessian.transpose(2, 0, 1))
                for function, values in zip(functions, columns):
                    function.x.array[face.rule.dofs[rows]] = values
        for function in functions:
            function.x.scatter_forward()
