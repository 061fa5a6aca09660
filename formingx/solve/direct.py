"""A direct solver for a matrix that is refilled and factorised many times."""

from __future__ import annotations

from petsc4py import PETSc


def configure(ksp: PETSc.KSP, matrix: PETSc.Mat, symmetric: bool) -> None:
    """Make `ksp` a single LU (LDL^T if symmetric) of the matrix by MUMPS."""
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType("cholesky" if symmetric else "lu")
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    pc.getFactorMatrix().setMumpsIcntl(14, 100)      # workspace over MUMPS' own estimate, percent


class DirectSolver:
    """Factorise, then solve as often as needed."""

    def __init__(self, matrix: PETSc.Mat, symmetric: bool):
        self._matrix, self._symmetric = matrix, symmetric
        self._create()

    def factorise(self) -> bool:
        """Factorise the matrix as it is now; False if it is singular to working precision."""
        self._ksp.setOperators(self._matrix)
        try:
            self._ksp.setUp()
            good = self._ksp.getPC().getFailedReason() == 0
        except PETSc.Error:
            good = False
        if not good:                     # PETSc refuses to factorise again with a MUMPS that has failed once
            self.destroy()
            self._create()
        return good

    def solve(self, rhs: PETSc.Vec, out: PETSc.Vec) -> None:
        """out = matrix^-1 rhs."""
        self._ksp.solve(rhs, out)

    def _create(self) -> None:
        self._ksp = PETSc.KSP().create(self._matrix.comm)
        configure(self._ksp, self._matrix, self._symmetric)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._ksp.destroy()
