"""First-order response of the body ahead of an accepted state, with the LU factors of its tangent."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from ...solve.arc_length import Curve
from ...solve.equations import Array, ContactFace, Equations
from ...solve.local_contact import unit_forces
from ...solve.state import State


class Response:
    """Changes (x, control) by forces, in the plane in which a step from a state ends; None once its factors are gone.

    Args:
        curve: it has just made the tangent ahead of the state.
        x, F: vectors to work with.
    """

    def __init__(self, curve: Curve, state: State, x: PETSc.Vec, F: PETSc.Vec):
        self._newton, self._state, self._made = curve.newton, state, curve.newton.solver.count
        self._problem: Equations = curve.problem
        self._normal = curve.plane_normal(state)
        self._x, self._F = x, F

    @property
    def at_hand(self) -> bool:
        """The factors are those of the state."""
        return self._made == self._newton.solver.count

    def to_points(self, chosen: list[Array]) -> tuple[Array, Array] | None:
        """Return the response to -1 at locally owned points (numbers) of each face.

        It consists of the changes of x, locally owned rows, (n, m), and of the control, (m,).

        m: point by point, way by way, of all ranks.
        """
        return self._by(unit_forces(self._problem, self._problem.present, chosen)) if self.at_hand else None

    def to_equilibrium(self, x: Array, control: float, forces: list[Array]) -> tuple[Array, float] | None:
        """Return the correction from (x, control) to equilibrium by the residual there.

        It consists of the changes of x, locally owned entries, and of the control.

        forces: at the points of each face, NaN where the law of contact says it, shape (n, 2).
        """
        if not self.at_hand:
            return None
        self._x.array_w[:] = x
        faces: list[ContactFace] = list(self._problem.present)
        for face, given in zip(faces, forces, strict=True):
            face.leave_out(~np.isnan(given[:, 0]))
        self._problem.residual(self._x, control, self._F)
        for face, given in zip(faces, forces, strict=True):
            values = self._F.array_r.copy()
            face.add(values, np.nan_to_num(given))
            self._F.array_w[:] = values
        self._problem.begin()
        left = self._F.array_r.copy()
        left[self._problem.held] = 0.0
        found = self._by(left[:, None])
        return None if found is None or not np.isfinite(found[0]).all() else (found[0][:, 0] * -1, -float(found[1][0]))

    def _by(self, E: Array) -> tuple[Array, Array] | None:
        V = self._newton.solve_ahead(E)
        if V is None:
            return None
        along = self._problem.comm.allreduce(self._normal @ V)
        return V - np.outer(self._state.direction, along), -self._state.slope * along
