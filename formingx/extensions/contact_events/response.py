"""First-order response of the body to contact forces at an accepted state, from the LU factors of its tangent."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from ...ranks import combined
from ...solve.arc_length import Curve
from ...solve.equations import Array, Equations
from ...solve.local_contact import unit_forces
from ...solve.state import State


class BodyResponse:
    r"""Response of the unknowns x and the control to contact forces, linearised at an accepted state.

    The linearised equations are K dx = E, with right-hand sides E such as unit forces. The response to E is

    .. math:: \Delta x = V - \dot x \, (n \cdot V), \qquad \Delta\lambda = - \dot\lambda \, (n \cdot V), \qquad
              V = K^{-1} E

    K is the tangent dF/dx, :math:`\lambda` the control, and a dot the derivative along the path by arc length. n is the
    normal of the plane in which an arc-length step ends (`Curve.plane_normal`). The methods return None once the stored
    LU factors belong to another tangent.

    Args:
        curve: path solver (`formingx.solve.arc_length.Curve`) that has just factorised the tangent at the state.
        state: the accepted state.
        x: work vector for the unknowns.
        F: work vector for the residual.
    """

    def __init__(self, curve: Curve, state: State, x: PETSc.Vec, F: PETSc.Vec):
        self._newton, self._state, self._made = curve.newton, state, curve.newton.solver.count
        self._problem: Equations = curve.problem
        self._normal = curve.plane_normal(state)
        self._x, self._F = x, F

    @property
    def is_valid(self) -> bool:
        """True if the stored LU factors still belong to the tangent at the state."""
        return self._made == self._newton.solver.count

    def to_points(self, chosen: list[Array]) -> tuple[Array, Array] | None:
        """Return dx, shape (n, m), dcontrol, (m,), by forces -1 at chosen owned points; None if K changed."""
        return self._solve(unit_forces(self._problem, self._problem.active_contacts, chosen)) if self.is_valid else None

    def to_equilibrium(self, x: Array, control: float, forces: list[Array]) -> tuple[Array, float] | None:
        """Return one modified Newton correction of (x, control), x of shape (n,), with given contact forces.

        forces: for each face, dimensionless, added to the residual F, shape (n, 2); at NaN the law gives the force.
        None if the result is not finite, or if the stored LU factors belong to another tangent.
        """
        if not self.is_valid:
            return None
        self._x.array_w[:] = x
        try:
            for face, given in zip(self._problem.active_contacts, forces, strict=True):
                face.apply(given)
            self._problem.residual(self._x, control, self._F)
        finally:
            for face in self._problem.active_contacts:
                face.apply(None)
        left = self._F.array_r.copy()
        left[self._problem.constrained] = 0.0
        found = self._solve(left[:, None])
        return None if found is None or not np.isfinite(found[0]).all() else (found[0][:, 0] * -1, -float(found[1][0]))

    def _solve(self, E: Array) -> tuple[Array, Array] | None:
        """Return dx, shape (n, m), and dcontrol, shape (m,), by changes E of the residual, owned rows, shape (n, m).

        None if K with the changed stiffness of a few contact points is singular.
        """
        V = self._newton.solve_one_sided(E)
        if V is None:
            return None
        along = combined(self._problem.comm, self._normal @ V)
        return V - np.outer(self._state.direction, along), -self._state.slope * along
