"""Viscous stress that damps a jump to another equilibrium: P = eta dF, with one eta for the whole body."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from .. import _compat


class Viscosity:
    r"""Nodal forces of a viscous stress on the whole body, eta V dx for a change dx of the unknowns.

    The matrix V belongs to a viscosity of 1, and the methods receive the viscosity eta (dimensionless):

    .. math:: w^T V \, dx = \frac{1}{V_0} \int dF : \delta F \, dV_0

    dF and :math:`\delta F` are the deformation gradients of dx and of virtual unknowns w, V_0 is the reference volume.
    Constrained unknowns neither cause nor receive forces.
    """

    def __init__(self, form: Any, bcs: list):
        self._matrix = fem_petsc.create_matrix(form)
        _compat.assemble_matrix(self._matrix, form, bcs, diagonal=0.0)
        self._matrix.assemble()
        self._change, self._forces = self._matrix.createVecs()
        self._rows = np.arange(*self._matrix.getOwnershipRange(), dtype=PETSc.IntType)
        self._entries = self._matrix.getValuesCSR()

    def forces(self, change: np.ndarray, eta: float) -> np.ndarray:
        found, n = np.zeros_like(change), len(self._rows)
        self._change.array_w[:] = change[:n]
        self._matrix.mult(self._change, self._forces)
        found[:n] = eta * self._forces.array_r
        return found

    def add_to(self, tangent: PETSc.Mat, eta: float) -> None:
        pointers, columns, values = self._entries
        tangent.setValuesIJV(pointers, columns, eta * values, PETSc.InsertMode.ADD_VALUES, self._rows)
        tangent.assemble()

    def destroy(self) -> None:
        for item in (self._matrix, self._change, self._forces):
            item.destroy()
