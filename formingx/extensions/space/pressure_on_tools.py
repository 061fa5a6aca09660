r"""Pressure on a sheet in three dimensions that slides on a tool: it acts along the normals of the tool.

The triangles of a sheet are chords of a fillet. A pressure p normal to a chord of length l has a tangential part at the
ends of the chord, where chords of different lengths meet. On a fillet of radius R it adds p l^2/(4 R) to the tension,
an error of second order that may exceed the tension itself. The sheet lies on the tool between the nodes, too: if it
slides, the volume below it is constant, and the pressure does no work. So the force of the pressure at each node of a
triangle whose three nodes touch one tool is

.. math:: \frac{p \, a}{3} \, n

with the area a of the triangle and the unit normal n of the tool at the node. The share of this force increases from 0
to 1 with the least contact pressure of the three nodes, so the force is continuous at gap closure. On all other
triangles the pressure acts normal to the triangle.

Along an arc of a tool the forces p a n/3 differ from the resultant of the pressure on the chords. The difference is
the pressure on the arc between the nodes. The sheet passes it on to the tool, so it is part of the force on the tool
(`carried_forces`). Supports and tools thus balance the pressure.

Within a step the contact pressure is constant: as a function of the displacement it would keep Newton's method from
converging on coarse fillets. It is the pressure of the last accepted state, and 0 at nodes whose gap closed since then.
At a target the state is solved for again with its own contact pressure, until both agree (`LaggedCorrections.renew`).
States at targets, and states of `Path.state_at`, therefore do not depend on the steps before them without friction.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI

from ... import _compat
from ...ranks import combined

_FULL = 1 / 3              # contact over applied pressure from which on all of this acts along the normals of the tool
_BRIDGED = 0.25            # cosine of the angle between triangle and tool, below which the triangle bridges an edge


class PressureOnTools:
    r"""Virtual work that turns the pressure on triangles that slide on tools into the normals of the tools.

    The forms contain the normal n of the tool to first order in the displacement u,

    .. math:: n(u, c) = n(u_0, c_0) + H (u - u_0 - (c - c_0) \, w)

    with the present displacement u_0 and control c_0, the Hessian H of the distance from the tool, and the motion w of
    the tool by the control. The derivatives of the forms are therefore exact at (u_0, c_0).
    """

    def __init__(self, surface: Any):
        self._surface = surface
        self._works: list[Any] = []
        self._state: tuple[np.ndarray, list[Any]] | None = None         # to which the coefficients belong
        self._displacement, self._normal, self._motion, *self._hessian = (
            fem.Function(surface.space) for _ in range(6))
        self._at = surface.constant(0.0)                     # control to which the coefficients belong
        self._pressed = fem.Function(surface.space)          # contact pressure of one tool at each node
        self._least = fem.Function(fem.functionspace(surface.domain, ("Discontinuous Lagrange", 0)))
        self._holder: np.ndarray = np.zeros(0, dtype=int)    # number of the face that touches each owned unknown, or -1

    def work(self, value: Any, area: Any, control: Any) -> Any:
        """Return the virtual work (UFL) that a pressure does in excess of p a n/3, to subtract from the residual.

        value: pressure (UFL). area: deformed area vector per unit reference area (UFL, shape (3,)). control: UFL.
        """
        surface, v = self._surface, self._surface.test_displacement()
        displacement, normal, motion, *hessian = (ufl.split(f)[0] for f in (
            self._displacement, self._normal, self._motion, *self._hessian))
        further = surface.u - displacement - (control - self._at) * motion
        n = normal + sum(h * further[i] for i, h in enumerate(hessian))
        full = _FULL * abs(value)
        share = ufl.conditional(ufl.lt(self._least, full), self._least / full, ufl.conditional(
            ufl.gt(self._least, 0), 1, 0))
        size = ufl.sqrt(ufl.inner(area, area))
        cosine = ufl.inner(area, n) / size
        side = ufl.conditional(ufl.lt(abs(cosine), _BRIDGED), cosine / _BRIDGED, cosine / abs(cosine))
        found = value * share * ufl.inner(area - side * size * n, v) * surface.dx(
            metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
        self._works.append(found)
        return found

    def refresh(self) -> None:
        """Update the coefficients of the virtual work to the present displacement of the sheet; collective.

        They are the normals of the tools at the nodes in contact, their derivatives, the motions of the tools by the
        control, and the smallest contact pressure of each triangle's nodes, of the last accepted state.
        """
        surface, n = self._surface, self._surface.space.dofmap.index_map.size_local
        fields, control = surface.w.x.array[:n], float(surface.control.value)
        state = [part for face in surface.faces for part in (
            face.history, face.law, face.active, control, *face.tool_displacement(control))]
        same = self._state is not None and np.array_equal(self._state[0], fields) and all(
            a is b or isinstance(a, float) and a == b for a, b in zip(self._state[1], state))
        if combined(surface.comm, same, MPI.LAND):
            return
        self._state = fields.copy(), state
        functions = (self._motion, self._normal, *self._hessian)
        self._at.value = control
        for function in (*functions, self._least):
            function.x.array[:] = 0
        largest, self._holder = np.zeros(len(surface.w.x.array)), np.full(len(surface.w.x.array), -1)
        self._displacement.x.array[:] = surface.length * surface.w.x.array
        nodes = surface.displacement_dofmaps[0].list
        for k, face in enumerate(surface.faces):
            if face.active and not face.contact.sticks and face.history is not None:
                rows, distances = face.law.contact_distances(face.positions(fields, control), face.history)
                pressure, dofs = face.law.pressure(face.history)[rows], face.rule.dofs[rows]
                self._pressed.x.array[:] = 0
                self._pressed.x.array[dofs[:, 0]] = pressure
                self._pressed.x.scatter_forward()
                self._least.x.array[:] = np.maximum(self._least.x.array, self._pressed.x.array[nodes].min(1))
                first = pressure >= largest[dofs[:, 0]]      # of several tools, the one that presses most
                largest[dofs[first, 0]] = pressure[first]
                self._holder[dofs[first]] = k
                motion = np.broadcast_to(face.tool_displacement(1.0) - face.tool_displacement(0.0), dofs.shape)
                for function, values in zip(functions, (motion, distances.normal,
                                                        *distances.hessian.transpose(2, 0, 1))):
                    function.x.array[dofs[first]] = values[first]
        for function in functions:
            function.x.scatter_forward()

    def carried_forces(self, face: Any, fields: np.ndarray, control: float) -> np.ndarray:
        """Return the forces of the pressure on the tool of one face near its m points, shape (m, 3), stress length^2.

        fields: owned unknowns, shape (n,). Collective.
        """
        surface = self._surface
        w, before, earlier = surface.w.x, surface.w.x.array.copy(), float(surface.control.value)
        w.array[:len(fields)], surface.control.value = fields, control
        w.scatter_forward()
        self.refresh()
        forces = _compat.assemble_vector(self._buffer, self._excess)
        held = self._holder[face.rule.dofs] == surface.faces.index(face)
        found = np.where(held, -forces[face.rule.dofs] / surface.length, 0.0)
        w.array[:], surface.control.value = before, earlier
        self.refresh()
        return np.asarray(found)

    @cached_property
    def _excess(self) -> Any:
        """Compiled linear form of the work of all pressures in excess of p a n/3."""
        return self._surface.compile(sum(self._works[1:], self._works[0]))

    @cached_property
    def _buffer(self) -> Any:
        """Vector for the entries of the linear form."""
        dofmap = self._surface.space.dofmap
        return la.vector(dofmap.index_map, dofmap.index_map_bs)
