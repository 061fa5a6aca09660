r"""Frictional contact of a few points, condensed onto their contact forces.

Coulomb's law is solved for m points alone; the body enters by its compliance C at them. The factorised tangent of a
state contains a contact stiffness S at points that were closed. For contact forces F instead, the condensed equations
of motion per arc length are

.. math:: dx = u - C (dF - S \, dx)

where u is the motion along the tangent, and C is taken in the plane normal to the path. A sticking point has dx = 0. A
sliding point stays on its tool with T = mu N. On a tool of curvature c its force rotates with the motion:

.. math:: dF = c \, (t \cdot dx) (N t - T n)

with the normal n into the tool and its tangent t: the geometric stiffness of contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from petsc4py import PETSc

from ..._jit import CFunctions
from ...contact.step_limit import LIMITS
from ...physics.contact_law import ContactStatus
from ...ranks import combined
from ...solve.arc_length import Curve
from ...solve.equations import Array
from ...solve.local_contact import FacePoints
from ...solve.state import State
from ...values.tolerances import FAR


class BodyResponse:
    r"""Response of the unknowns x and the control to contact forces, linearised at an accepted state.

    The linearised equations are K dx = E, with right-hand sides E such as unit forces. The response to E is

    .. math:: \Delta x = V - \dot x \, (n \cdot V), \qquad \Delta\lambda = - \dot\lambda \, (n \cdot V), \qquad
              V = K^{-1} E

    K is the tangent dF/dx, :math:`\lambda` the control, and a dot the derivative along the path by arc length. n is the
    normal of the plane in which an arc-length step ends (`Curve.plane_normal`). The curve has just factorised K at the
    state; the methods return None once its LU factors belong to another tangent. x and F are work vectors.

    Attributes:
        problem: the problem, with all members of its class.
    """

    def __init__(self, curve: Curve, state: State, x: PETSc.Vec, F: PETSc.Vec):
        self._newton, self._state, self._made = curve.newton, state, curve.newton.solver.count
        self.problem: Any = curve.problem                   # it knows its constrained unknowns, too
        self._normal = curve.plane_normal(state)
        self._x, self._F = x, F

    def to_equilibrium(self, x: Array, control: float, forces: list[Array]) -> tuple[Array, float] | None:
        """Return one modified Newton correction of (x, control), x of shape (n,), with given contact forces.

        forces: for each face, dimensionless, added to the residual F, shape (n, 2); at NaN the law gives the force.
        None if the result is not finite, or if the stored LU factors belong to another tangent.
        """
        self._x.array_w[:] = x
        try:
            for face, given in zip(self.problem.contact.faces, forces, strict=True):
                face.applied = given
            self.problem.residual(self._x, control, self._F)
        finally:
            for face in self.problem.contact.faces:
                face.applied = None
        left = self._F.array_r.copy()
        left[self.problem.constrained] = 0.0
        found = self.solve(left[:, None])
        return None if found is None or not np.isfinite(found[0]).all() else (found[0][:, 0] * -1, -float(found[1][0]))

    def solve(self, E: Array) -> tuple[Array, Array] | None:
        """Return dx, shape (n, m), and dcontrol, shape (m,), by changes E of the residual, owned rows, shape (n, m).

        None if K with the changed stiffness of a few points is singular, or if the factors belong to another tangent.
        """
        V = self._newton.solve_one_sided(E) if self._made == self._newton.solver.count else None
        if V is None:
            return None
        along = combined(self.problem.comm, self._normal @ V)
        return V - np.outer(self._state.direction, along), -self._state.slope * along


@dataclass(frozen=True)
class StatusSearch:
    """Limits and tolerances of the active-set search for contact statuses that satisfy Coulomb's law.

    Attributes:
        simultaneous_trials: number of trials in which all statuses that violate the law change; later one changes at a
            time.
        max_trials: maximum number of status sets that are tried.
        negligible_rate: fraction of the largest rate of force or motion below which a rate is negligible.
        limit_tolerance: relative distance from the Coulomb limit mu N, or from N = 0, below which a force counts as on
            it.
    """

    simultaneous_trials: int = 6
    max_trials: int = 60
    negligible_rate: float = 1e-9
    limit_tolerance: float = 1e-6


_SEARCH = StatusSearch()
_VALUES = np.array([*astuple(_SEARCH), LIMITS.min_length])      # rates of forces times this length are forces
_C = CFunctions("extensions/contact_events/reduced_contact.c")


class ToolFrame(NamedTuple):
    """Geometry of the tools at m contact points.

    Attributes:
        normal: unit normals, pointing into the tool, shape (m, 2).
        tangent: unit tangents of the tool, shape (m, 2).
        curvature: curvatures of the tool, shape (m,), 1/length.
        beyond: depth in the tool at which the contact law gives the current force, minus the depth of the point, shape
            (m,), length.
    """

    normal: np.ndarray
    tangent: np.ndarray
    curvature: np.ndarray
    beyond: np.ndarray


class CondensedPoints(FacePoints):
    """Contact points of all ranks whose compliance is known: the motion of the body under unit forces at these points.

    Each unit force contributes -1 to one component (r or z) of the residual F at one point. m is the number of these
    points, n the number of all contact points that this rank owns. x has `size` owned entries, its first ones are
    fields.

    Attributes:
        columns: changes of x under these unit forces, locally owned rows, shape (size, 2 m).
        steps: changes of the control under these forces, shape (2 m,).
        motions: motions of the n owned points of all faces under these forces, shape (n, 2, 2 m), length.
        friction: coefficient of friction, infinite for stick, shape (m,).
        elastic_slip: elastic slip at which a point begins to slide, shape (m,), length.
    """

    def __init__(self, faces: Sequence[Any], n: int, size: int, response: BodyResponse):
        super().__init__(faces)
        self._n, self._response = n, response
        empty: Any = np.zeros(0)
        self.columns, self.steps = np.zeros((size, 0)), empty
        c = faces[0].points.shape[1]
        self.motions = np.zeros((self.starts[-1], c, 0))
        self.friction, self.elastic_slip, self._pulls = empty, empty, empty.astype(bool)
        self._S, self._C = np.zeros((0, c, c)), np.zeros((0, 0))

    def learn(self, chosen: list[np.ndarray], touched: bool = False) -> bool:
        """Add chosen owned points of each face, and solve for their compliance with the stored LU factors.

        touched: True if the factorised tangent contains their stiffness. Return False if the factors no longer belong
        to the state; no point is then added.
        """
        found = self._response.solve(self._response.problem.contact.unit_forces(chosen))
        if found is None:
            return False
        old = len(self.ids)
        self.choose(chosen)
        self.columns, self.steps = np.column_stack([self.columns, found[0]]), np.append(self.steps, found[1])
        motions = [face.relative_motion(found[0][: self._n], found[1]) for face in self._faces]
        self.motions = np.concatenate([self.motions, np.concatenate(motions)], axis=-1)
        self._C = self.values_at(self.motions).reshape(len(self.steps), -1)
        friction, self.elastic_slip, pulls = self.values_at(self._properties)[:, :3].T
        self.friction, self._pulls = np.where(friction < FAR, friction, np.inf), pulls > 0
        S = np.zeros((len(self.ids), *self._S.shape[1:]))
        S[:old] = self._S
        if touched:
            S[old:] = self.values_at(np.concatenate([face.stiffness_in_tangent for face in self._faces]))[old:]
        self._S = S
        return True

    @cached_property
    def _properties(self) -> np.ndarray:
        """Properties of the n owned points of all faces that the C function `frame` reads, shape (n, 7).

        They are friction, elastic slip, adhesion, force over traction, theta of the ramp, shift of the distance and
        penalty.
        """
        found = np.empty((self.starts[-1], 7))
        for face, rows in zip(self._faces, self.of_faces(found)):
            law = face.law
            for k, values in enumerate((np.minimum(law.friction, FAR), law.elastic_slip, law.adhesive, face.scale,
                                        law.theta, law.shift, law.k)):
                rows[:, k] = values
        return found

    @cached_property
    def sticks(self) -> np.ndarray:
        """Mask of the points that never slide, shape (n,) for the n owned points of all faces."""
        return self._properties[:, 0] >= FAR

    def tool_frame(self, positions: np.ndarray, force: np.ndarray) -> ToolFrame:
        """Return normals, tangents, curvatures and `beyond` of the tools at the m points (`ids`).

        positions: of the n owned points relative to their tools, shape (n, 2), length. force: contact forces, shape (m,
        2). `beyond` is the depth that gives the force of a point, minus its depth.
        """
        own = force[self._mine]
        if self._profiles is None:
            found = self._frame_by_arrays(positions, own)
        else:
            found, (table, ranges) = np.empty((len(self._rows), 6)), self._profiles
            _C.frame(len(self._rows), positions, self._rows, own, self._properties, ranges, table, found)
        found = self.of_all_ranks(found)
        return ToolFrame(found[:, :2], found[:, 2:4], found[:, 4], found[:, 5])

    @cached_property
    def _profiles(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Profiles of all tools, shape (pieces, 9), as `Tool.table` has them; None if not used.

        The second array, shape (n, 3), has the first piece of each point's tool and its numbers of pieces and of lines.
        """
        tools = [face.law.profile for face in self._faces]
        if None in tools:
            return None
        tables = [tool.table for tool in tools]
        firsts = [0, *np.cumsum([len(table) for table in tables[:-1]])]
        ranges = [(first, len(table), tool.lines) for first, table, tool in zip(firsts, tables, tools)]
        return np.concatenate(tables), np.repeat(np.array(ranges), np.diff(self.starts), axis=0)

    def _frame_by_arrays(self, positions: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the tool geometry at the k owned ones of the m points as the C function `frame` does, for any tools.

        positions: shape (n, 2), length. force: shape (k, 2). The columns of the result, shape (k, 6), are those of
        `ToolFrame`.
        """
        found = np.zeros((len(self._rows), 6))
        for face, first, end in zip(self._faces, self.starts, self.starts[1:]):
            k = np.flatnonzero((first <= self._rows) & (self._rows < end))
            i = self._rows[k]
            law, x = face.law.part(i - first), positions[i]
            near = law.nearest(x)
            N = np.einsum("ni,ni->n", force[k], near.normal) / face.scale[i - first]
            beyond = law.depth(N if law.adhesive else np.maximum(N, 0.0)) - near.distance
            found[k] = np.column_stack([near.normal, near.tangent, near.curvature, beyond])
        return found

    def forces_at_end(self, u: np.ndarray, status: np.ndarray, near: ToolFrame, force: np.ndarray,
                      to: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute the contact forces F after a motion u of the m points at constant forces, and F - `force` - S dx.

        S: stiffness in the factorised tangent; `to`: motion to zero tangential force (sticking) or onto the tool
        (sliding). All shapes (m, 2), length for motions; status (`ContactStatus`): (m,). Without F: `force` and NaN.
        """
        F, outside = np.empty(force.shape), np.empty(force.shape)
        good = _C.forces_at_end(*self._arguments(near), self.elastic_slip, near.beyond, u, status, force, to, _VALUES,
                                F, outside)
        return (F, outside) if good else (force, np.full(force.shape, np.nan))

    def rates(self, u: np.ndarray, status: np.ndarray, near: ToolFrame,
              force: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Compute the rates F of the contact forces along the path, with statuses that satisfy Coulomb's law.

        Return F, F - S v, shape (m, 2) each, and statuses, shape (m,), found by an active-set search from `status`;
        else None. u: velocities by arc length at constant forces, shape (m, 2). S: stiffness in the factorised tangent;
        v: velocities. force: shape (m, 2).
        """
        slack = (status != ContactStatus.FREE) & ~self._pulls
        F, outside, N = np.empty(force.shape), np.empty(force.shape), np.einsum("ni,ni->n", force, near.normal)
        slack &= np.abs(N).max(initial=0.0) * _SEARCH.limit_tolerance >= N
        given = *self._arguments(near), u, force, status, _VALUES
        for found in (np.array(status, dtype=int), np.where(slack, ContactStatus.FREE, status).astype(int)):
            if _C.rates(*given, found, F, outside):
                return F, outside, found
        return None

    def change(self, status: np.ndarray, near: ToolFrame, force: np.ndarray, rate: np.ndarray) -> tuple[float,
                                                                                                        np.ndarray]:
        """Return the arc length at which a point first opens or begins to slide, and the statuses, shape (m,), then.

        Forces, shape (m, 2), change linearly by `rate`; infinite without a change. status: `ContactStatus`, shape (m,).
        """
        changed, after = np.zeros(2, dtype=int), np.array(status, dtype=int)
        s = _C.change(*self._arguments(near), status, force, rate, _VALUES, changed)
        if s < np.inf:
            after[changed[0]] = changed[1]
        return s, after

    def _arguments(self, near: ToolFrame) -> tuple:
        """Return m, friction, adhesion, S, C, normals and curvatures, the first arguments of the C functions."""
        return len(self.friction), self.friction, self._pulls, self._S, self._C, near.normal, near.curvature
