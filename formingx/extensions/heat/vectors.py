"""Vectors of the heat equation: assembly of forms, heat capacity, sums over ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from ... import _compat
from ...mesh.mesh import Mesh
from ...ranks import combined


class HeatVectors:
    """Assembly of vectors of the heat equation M dT/dt = R(T); the subclass `Conduction` sets the attributes.

    Entries of M and R are divided by `capacity`, so that M sums to 1 and R is in degrees per time.

    Attributes:
        mesh: the `Mesh`.
        comm: MPI communicator.
        T: temperature `Function` at which the forms are assembled.
        capacity: heat capacity of the whole body, heat per degree.
        power: heat source, heat per time at the nodes over `capacity`, locally owned entries, shape (n,), or 0.
    """

    mesh: Mesh
    comm: Any
    T: fem.Function
    capacity: float
    power: Any
    _n: int
    _buffer: la.Vector
    _change: fem.Function
    _scale: fem.Constant
    _v: Any
    _rate_form: Any
    _mass_form: Any

    def constant(self, value: float) -> fem.Constant:
        """Return a UFL constant, whose value can change without a new compilation of the forms."""
        return fem.Constant(self.mesh.domain, PETSc.ScalarType(value))

    def stored(self, change: np.ndarray) -> float:
        """Return the heat stored by a change of nodal temperatures, shape (n,), degrees, summed over ranks."""
        return self.capacity * self._sum(self._mass(change))

    def mass(self, change: np.ndarray) -> np.ndarray:
        """Return M, over `capacity`, times a change of nodal temperatures; both shape (n,), degrees."""
        return self._mass(change)

    def source(self, make: Any) -> Any:
        """Compile a heat source: `make` maps a test function v to the integral of v times heat per time and volume."""
        return self._form(make(self._scale * self._v))

    def assembled(self, form: Any) -> np.ndarray:
        """Return the nodal heat per time of a compiled source over `capacity`, shape (n,), degrees per time."""
        return self._assemble(form)

    def _form(self, form: Any) -> Any:
        """Return the compiled form of a UFL form."""
        return _compat.compile_form(form)

    def _integral(self, form: Any) -> float:
        """Return the value of an integral (UFL) over all ranks."""
        return float(combined(self.comm, fem.assemble_scalar(self._form(form)), MPI.SUM))

    def _assemble(self, form: Any) -> np.ndarray:
        """Return the locally owned entries of an assembled linear form, shape (n,)."""
        return _compat.assemble_vector(self._buffer, form).copy()

    def _body_rate(self, T: np.ndarray) -> np.ndarray:
        """Set the nodal temperature T (n,); return the heat per time without tools over `capacity`, degrees per time.
        """
        self.T.x.array[: self._n] = T
        self.T.x.scatter_forward()
        return self._assemble(self._rate_form) + self.power

    def _mass(self, change: np.ndarray) -> np.ndarray:
        """Return M dT/c, shape (n,), degrees, with the capacity matrix M and c = `capacity`, from dT, shape (n,)."""
        self._change.x.array[: self._n] = change
        self._change.x.scatter_forward()
        return self._assemble(self._mass_form)

    def _largest(self, values: np.ndarray) -> float:
        """Return the largest absolute value of the locally owned entries `values`, shape (n,), over all ranks."""
        return float(combined(self.comm, np.abs(values).max(initial=0.0), MPI.MAX))

    def _sum(self, values: np.ndarray) -> float:
        """Return the sum of the locally owned entries `values`, shape (n,), over all ranks."""
        return float(combined(self.comm, values.sum(), MPI.SUM))
