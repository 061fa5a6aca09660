"""Vectors of a problem: assembly of forms, fields of the forms, inner product."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from .. import _compat
from ..forms.histories import Histories
from ..ranks import combined


class Vectors(Histories):
    """Part of `Problem` that assembles forms and holds the fields; see `formingx.solve.equations`.

    Attributes:
        comm: MPI communicator.
    """

    comm: Any
    _n: int
    _buffer: la.Vector

    @property
    def n_owned(self) -> int:
        """Number of field unknowns that this rank owns."""
        return int(self._n)

    @cached_property
    def _fields(self) -> np.ndarray:
        """Fields of the forms on this rank, with ghosts: writable view of the unknowns of `forms.w`."""
        return np.asarray(self.forms.w.x.array)

    @cached_property
    def _control(self) -> np.ndarray:
        """Control of the forms, shape (): writable view of the value of `forms.control`."""
        return np.asarray(self.forms.control.value)

    @cached_property
    def _metric(self) -> np.ndarray:
        """Lumped mass matrix of the displacement for density 1/volume, locally owned diagonal entries, shape (n,)."""
        return np.asarray(np.maximum(self.assemble(self.forms.compile(self.forms.metric_row())), 0))

    def set_fields_and_control(self, x: np.ndarray, control: float) -> None:
        """Set the fields and the control of the forms.

        Args:
            x: unknowns, locally owned entries, shape (n,).
            control: load parameter (control), dimensionless.
        """
        self._control[()] = control
        self.set_fields(x)

    def inner(self, a: PETSc.Vec, b: PETSc.Vec) -> float:
        r"""Return the inner product of two dimensionless displacement fields, by a lumped mass matrix.

        .. math:: \frac{1}{V} \int_V a \cdot b \, dV

        V is the reference volume. Pressures and multipliers do not count.

        Args:
            a: first vector of unknowns, whose displacements are divided by the length scale L.
            b: second vector of unknowns.

        Returns:
            Inner product (dimensionless).
        """
        return self._dot(self._metric * a.array_r[: self._n], b.array_r[: self._n])

    def metric_times(self, a: PETSc.Vec, out: PETSc.Vec) -> None:
        self.fill(out, self._metric * a.array_r[: self._n])

    def set_fields(self, x: np.ndarray) -> None:
        """Set the fields of the forms, and update the coefficients that depend on them.

        Args:
            x: unknowns, locally owned entries, shape (n,).
        """
        self._fields[: self._n] = x[: self._n]
        if self.comm.size > 1:
            self.forms.w.x.scatter_forward()
        self.forms.refresh()

    def stiff_state(self, out: PETSc.Vec) -> None:
        self.forms.set_stiff()
        self.fill(out, self.forms.w.x.array[: self._n])

    def assemble(self, form: Any) -> np.ndarray:
        """Assemble a compiled linear form at the current fields and control of the forms.

        Args:
            form: compiled linear form.

        Returns:
            Locally owned entries, shape (n,).
        """
        return _compat.assemble_vector(self._buffer, form).copy()

    def assemble_scalar(self, form: Any) -> float:
        """Assemble a compiled scalar form at the current fields and control of the forms, over all ranks.

        Args:
            form: compiled form without arguments.

        Returns:
            Value of the form.
        """
        return float(combined(self.comm, fem.assemble_scalar(form), MPI.SUM))

    def fill(self, out: PETSc.Vec, values: np.ndarray, tail: list[float] | None = None) -> None:
        """Set a vector from locally owned field values and multipliers.

        Args:
            out: vector that receives the values.
            values: values of the fields, shape (n,).
            tail: values of the multipliers, used on the last rank; None: 0.
        """
        array = out.array_w
        array[: self._n] = values
        array[self._n:] = 0.0 if tail is None or self.comm.rank < self.comm.size - 1 else tail

    def _dot(self, a: np.ndarray, b: np.ndarray) -> float:
        """Return the dot product of two vectors of locally owned entries over all ranks."""
        return float(combined(self.comm, float(np.dot(a, b)), MPI.SUM))
