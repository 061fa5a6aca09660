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
        self._matrix = matrix
        self._ksp = PETSc.KSP().create(matrix.comm)
        configure(self._ksp, matrix, symmetric)

    def factorise(self) -> bool:
        """Factorise the matrix as it is now; False if it is singular to working precision."""
        self._ksp.setOperators(self._matrix)
        try:
            self._ksp.setUp()
        except PETSc.Error:
            return False
        return self._ksp.getPC().getFailedReason() == 0

    def solve(self, rhs: PETSc.Vec, out: PETSc.Vec) -> None:
        """out = matrix^-1 rhs."""
        self._ksp.solve(rhs, out)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._ksp.destroy()
