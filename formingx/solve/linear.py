"""Direct solver for a matrix whose entries change and that is factorised many times."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from petsc4py import PETSc

from .equations import Array

_PETSC = ctypes.CDLL(PETSc.__file__)    # with the functions of PETSc that petsc4py lacks


class _Scaling(IntEnum):
    """Scaling of rows and columns, ICNTL(8) of MUMPS."""

    AUTOMATIC = 77
    KEPT = -1                           # from the factorisation before


@dataclass(frozen=True)
class Condensation:
    """Sizes of a linear system from which MUMPS is faster if it uses the zeros of sparse right-hand sides.

    Attributes:
        min_columns: number of right-hand sides from which a few entries of the inverse matrix cost less than full
            solutions (`CondensedColumns`).
        min_rows: number of unknowns from which entries of the inverse are used. Right-hand sides are given to MUMPS as
            sparse columns if their number of entries is at least this multiple of their number of nonzero entries.
    """

    min_columns: int = 12
    min_rows: int = 10_000


CONDENSATION = Condensation()


def configure(ksp: PETSc.KSP, matrix: PETSc.Mat, symmetric: bool) -> None:
    """Set a PETSc solver to one direct solution with the matrix by MUMPS: LU factors, or LDL^T if it is symmetric."""
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType("cholesky" if symmetric else "lu")
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    pc.getFactorMatrix().setMumpsIcntl(14, 100)      # workspace over MUMPS' own estimate, percent
    pc.getFactorMatrix().setMumpsIcntl(27, -64)      # right-hand sides at a time


class DirectSolver:
    """Direct solver by MUMPS: factorise a matrix once, then solve for many right-hand sides.

    symmetric: True for LDL^T factors, False for LU factors. Each factorisation computes the determinant (`sign`) and
    the number of negative pivots (`inertia`, `negative_pivots`) if wanted.

    Attributes:
        count: number of factorisations so far.
    """

    def __init__(self, matrix: PETSc.Mat, symmetric: bool, determinant: bool = False, inertia: bool = False):
        self._matrix, self._symmetric, self._determinant, self._inertia = matrix, symmetric, determinant, inertia
        self._columns: dict[int, list[PETSc.Mat]] = {}      # dense matrices for `solve_all`, by their width
        self._scaled = False                                # factors exist, with a scaling
        self.count = 0                                      # number of factorisations
        self._keeps = matrix.comm.size == 1                 # MUMPS can keep a scaling
        self._create()

    def factorise(self, rescale: bool = True) -> bool:
        """Factorise the matrix with its current entries, and return False if it is singular to working precision.

        `rescale` False keeps the last scaling, on one rank; a new one takes MUMPS a fifth of the time.
        """
        self.count += 1
        keep = self._keeps and self._scaled and not rescale
        self._ksp.getPC().getFactorMatrix().setMumpsIcntl(8, _Scaling.KEPT if keep else _Scaling.AUTOMATIC)
        self._ksp.setOperators(self._matrix)
        try:
            self._ksp.setUp()
            self._scaled = self._ksp.getPC().getFailedReason() == 0
        except PETSc.Error:
            self._scaled = False
        if self._scaled and (not keep or self.scaling == _Scaling.KEPT):
            return True
        self._keeps &= not self._scaled  # a MUMPS that cannot keep a scaling has applied none
        self.destroy()                   # PETSc refuses to factorise again with a MUMPS that has failed once
        self._create()
        self._scaled = False
        return keep and self.factorise()

    @property
    def scaling(self) -> int:
        """Parameter ICNTL(8) of MUMPS in the last factorisation, a scaling strategy; -1 if an earlier scaling was kept.
        """
        return int(self._ksp.getPC().getFactorMatrix().getMumpsInfog(33))

    def solve(self, rhs: PETSc.Vec, out: PETSc.Vec) -> None:
        """Solve K x = rhs with the last factors of the matrix K; `out` receives x."""
        self._ksp.solve(rhs, out)

    def solve_all(self, rhs: Array) -> Array:
        """Return solutions for columns of right-hand sides, owned rows (n, m), faster than one by one."""
        given, found = self._dense(*rhs.shape)
        sparse = self._sparse(rhs)
        if sparse is None:
            given.getDenseArray()[:] = rhs
        self._ksp.getPC().getFactorMatrix().matSolve(given if sparse is None else sparse, found)
        if sparse is not None:
            sparse.destroy()
        return found.getDenseArray().copy()

    def inverse(self, rows: Array) -> Array | None:
        """Return the entries of K^-1 in some rows and columns, ascending, shape (k,), as an array of shape (k, k).

        MUMPS visits only the factors between these rows and the root of its elimination tree. None on several ranks, or
        if PETSc has no such function.
        """
        get = getattr(_PETSC, "MatMumpsGetInverse", None)
        if get is None or self._matrix.comm.size > 1:
            return None
        n, k = self._matrix.size[0], len(rows)
        starts = np.zeros(n + 1, dtype=PETSc.IntType)
        starts[rows + 1] = k
        entries = PETSc.Mat().createAIJ((n, n), csr=(np.cumsum(starts, dtype=PETSc.IntType),
                                                     np.tile(rows, k).astype(PETSc.IntType), np.zeros(k * k)))
        transposed = PETSc.Mat().createTranspose(entries)
        factors = self._ksp.getPC().getFactorMatrix()
        failed = get(ctypes.c_void_p(factors.handle), ctypes.c_void_p(transposed.handle))
        factors.setMumpsIcntl(30, 0)     # PETSc leaves it at entries of the inverse
        found = entries.getValuesCSR()[2].reshape(k, k).T
        transposed.destroy()
        entries.destroy()
        return None if failed else found

    def solve_transposed(self, rhs: PETSc.Vec, out: PETSc.Vec) -> None:
        """Solve K^T x = rhs with the last factors of the matrix K; `out` receives x."""
        self._ksp.solveTranspose(rhs, out)

    def sign(self) -> int:
        """Return the sign 1 or -1 of the determinant last factorised, on all ranks; needs `determinant`."""
        return int(np.sign(self._ksp.getPC().getFactorMatrix().getMumpsRinfog(12)))

    def negative_pivots(self) -> int:
        """Return the number of negative pivots of the last L D L^T, over all ranks; needs `inertia`."""
        return int(self._ksp.getPC().getFactorMatrix().getMumpsInfog(12))

    def _create(self) -> None:
        """Create the PETSc solver, without factors."""
        self._ksp = PETSc.KSP().create(self._matrix.comm)
        configure(self._ksp, self._matrix, self._symmetric)
        if self._determinant:
            self._ksp.getPC().getFactorMatrix().setMumpsIcntl(33, 1)
        if self._inertia:                # without ScaLAPACK for the last block: it counts no pivots
            self._ksp.getPC().getFactorMatrix().setMumpsIcntl(13, 1)

    def _sparse(self, rhs: Array) -> PETSc.Mat | None:
        """Return right-hand sides, shape (n, m), as a sparse matrix; None if MUMPS gains nothing by their zeros."""
        (n, m), rows = rhs.shape, CONDENSATION.min_rows
        if rows > n * m or self._matrix.comm.size > 1 or rows * np.count_nonzero(rhs[:, 0]) > n:
            return None
        column, row = np.nonzero(rhs.T)
        if not 0 < rows * len(row) <= n * m:
            return None
        starts = np.searchsorted(column, np.arange(m + 1)).astype(PETSc.IntType)
        transposed = PETSc.Mat().createAIJ((m, n), csr=(starts, row.astype(PETSc.IntType), rhs[row, column]))
        return PETSc.Mat().createTranspose(transposed)

    def _dense(self, n: int, m: int) -> list[PETSc.Mat]:
        """Return two dense matrices, for right-hand sides and solutions, with n locally owned rows and m columns.

        Both are kept for the next call with the same m. For m > 2 they are destroyed at the first call with a new m.
        """
        if m not in self._columns:
            for other in [width for width in self._columns if width > 2]:
                self._forget(other)
            self._columns[m] = [PETSc.Mat().createDense(((n, None), (None, m)), comm=self._matrix.comm)
                                for _ in range(2)]
            for matrix in self._columns[m]:
                matrix.assemble()
        return self._columns[m]

    def _forget(self, m: int) -> None:
        """Destroy the dense matrices with m columns."""
        for matrix in self._columns.pop(m):
            matrix.destroy()

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        for m in list(self._columns):
            self._forget(m)
        self._ksp.destroy()


def condition(matrix: PETSc.Mat, solver: DirectSolver) -> float:
    """Return a lower bound of the condition number |A|_1 |A^-1|_1 of a matrix A, with `solver` holding its factors.

    The norm of the inverse is estimated (Hager 1984; Higham 1988). MUMPS' own error analysis is not available for
    matrices on several ranks.
    """
    v, y, x = (matrix.createVecRight() for _ in range(3))
    first, last = x.getOwnershipRange()
    x.set(1.0 / x.getSize())
    best, seen = 0.0, -1
    for _ in range(5):
        solver.solve(x, v)
        size = v.norm(PETSc.NormType.NORM_1)
        if not size > best:
            break
        best = size
        y.array_w[:] = np.where(v.array_r >= 0, 1.0, -1.0)
        solver.solve_transposed(y, v)
        v.abs()
        j, _ = v.max()
        if j == seen:
            break
        seen = j
        x.set(0.0)
        if first <= j < last:
            x.array_w[j - first] = 1.0
    for vector in (v, y, x):
        vector.destroy()
    return float(best * matrix.norm(PETSc.NormType.NORM_1))
