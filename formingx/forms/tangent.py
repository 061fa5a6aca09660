"""Derivatives of a scene's residual without contact: tangent matrix, and derivative with respect to the control."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from .. import _compat
from .constraints import Constraints


class ExtendedMatrix:
    """Sparse matrix `mat` of a tangent K and m constraint rows C, allocated once and refilled for every tangent.

    form, index_map: compiled bilinear form of K, and that of its space. rows: C, locally owned entries, shape (n,)
    each; later rows must be 0 where these are 0. bcs: later calls of `constrain` may constrain a subset of them.
    """

    def __init__(self, form: Any, index_map: Any, bcs: list, rows: list[np.ndarray], comm: Any, symmetric: bool):
        self._form, self._index_map, self._comm = form, index_map, comm
        self._first = index_map.size_global
        self._last_rank = comm.rank == comm.size - 1
        self.constrain(bcs, rows)
        n, m = index_map.size_local, len(rows)
        size = n + (m if self._last_rank else 0)
        indptr, columns = self._pattern(rows, m)
        self.mat = PETSc.Mat().createAIJ(((size, None), (size, None)), csr=(indptr, columns, np.zeros(len(columns))),
                                         comm=comm)
        ghosted = index_map.local_to_global(np.arange(n + index_map.num_ghosts, dtype=np.int32))
        mapping = PETSc.LGMap().create(ghosted.astype(PETSc.IntType), comm=comm)
        self.mat.setLGMap(mapping, mapping)
        mapping.destroy()
        if symmetric:
            self.mat.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def constrain(self, bcs: list, rows: list[np.ndarray]) -> None:
        """Set DirichletBCs and rows of the constraint matrix C, owned entries, shape (n,) each, of later tangents.

        Constrained unknowns, and the multipliers of rows that are 0 on all ranks, get unit vectors.
        """
        self._bcs, size, offset = bcs, self._index_map.size_local, self._index_map.local_range[0]
        self._constrained = np.zeros(size + self._index_map.num_ghosts, dtype=bool)
        for bc in bcs:
            self._constrained[bc.dof_indices()[0]] = True
        self._entries = []              # (own numbers, own weights, all numbers, all weights) of each row of C
        for row in rows:
            mine = np.flatnonzero(row)
            parts = self._comm.allgather((mine + offset, row[mine]))
            self._entries.append((mine + offset, row[mine], np.concatenate([n for n, _ in parts]),
                                  np.concatenate([w for _, w in parts])))

    def fill(self, blocks: Sequence[tuple[np.ndarray, np.ndarray]] = ()) -> PETSc.Mat:
        """Assemble and return the matrix, with blocks (dofs, shape (n, m), with ghosts; values, shape (n, m, m)) added.

        The m unknowns of a block must share a cell. Entries of constrained unknowns are skipped.
        """
        A, add = self.mat, PETSc.InsertMode.ADD_VALUES
        A.zeroEntries()
        _compat.assemble_matrix(A, self._form, self._bcs)
        A.assemble(PETSc.Mat.AssemblyType.FLUSH)
        for dofs, values in blocks:
            free = ~self._constrained[dofs]
            values = values * free[:, :, None] * free[:, None, :]
            A.setValuesLocalRCV(dofs, dofs, values.reshape(len(dofs), dofs.shape[1] ** 2), addv=add)
        for k, (mine, weights, everyone, all_weights) in enumerate(self._entries):
            if len(mine):
                A.setValues(mine.astype(PETSc.IntType), [self._first + k], weights, addv=add)
            if self._last_rank:
                A.setValues([self._first + k], everyone.astype(PETSc.IntType), all_weights, addv=add)
                A.setValue(self._first + k, self._first + k, float(len(everyone) == 0), addv=add)
        A.assemble()
        return A

    def _pattern(self, rows: list[np.ndarray], m: int) -> tuple[np.ndarray, np.ndarray]:
        """Return row pointers and global columns of owned rows, with m rows (n,) each of the constraint matrix C."""
        plain = fem_petsc.create_matrix(self._form)
        _compat.assemble_matrix(plain, self._form, self._bcs)
        plain.assemble()
        indptr, indices, _ = plain.getValuesCSR()
        plain.destroy()
        entries = [np.flatnonzero(row) for row in rows]      # the multipliers' columns come after all others
        added = np.concatenate([np.full(len(i), self._first + k) for k, i in enumerate(entries)]) if rows else []
        places = np.concatenate(entries) if rows else np.zeros(0, dtype=int)
        order = np.lexsort((added, places)) if rows else places
        columns = np.insert(indices, indptr[1:][places[order]], np.asarray(added, dtype=indices.dtype)[order])
        lengths = np.diff(indptr) + np.bincount(places, minlength=len(indptr) - 1)
        if self._last_rank:
            tail = self._first + np.arange(m)
            parts = [np.concatenate([np.sort(everyone), tail]) for _, _, everyone, _ in self._entries]
            columns, lengths = np.concatenate([columns, *parts]), np.append(lengths, [len(part) for part in parts])
        pointers = np.concatenate([[0], np.cumsum(lengths)])
        return pointers.astype(PETSc.IntType), columns.astype(PETSc.IntType)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self.mat.destroy()


class Tangent:
    """Derivatives of the residual F by the unknowns and the control, with the constraints of supports.

    `matrix`, an `ExtendedMatrix`, holds dF/dx, which may be `symmetric`; `by_control` returns dF/dcontrol.
    """

    def __init__(self, forms: Any, constraints: Constraints, symmetric: bool):
        scene = forms.scene
        self.matrix = ExtendedMatrix(forms.compile(forms.tangent), forms.space.dofmap.index_map,
                                     [e.bc for e in constraints.entries], [row for _, row in constraints.means],
                                     forms.comm, symmetric)
        self._by_load, self._by_time = (form and forms.compile(form)
                                        for form in (forms.control_derivative, forms.time_derivative))
        self._movable = [k for k, item in enumerate(scene.items) if item in scene.supports and item.driven]
        self._by_motion = self._lift = None
        if constraints.can_move:
            self._lift = fem.Function(forms.space)              # driven unknowns load the others through the tangent
            self._by_motion = forms.compile(ufl.action(forms.tangent, self._lift))

    def enter(self, active: Any, rate: list[float], changed: bool) -> None:
        """Set active constraints and support motions, `StepData.rate`, of step data; changed: constraints differ."""
        if changed:
            self.matrix.constrain(active.bcs, active.rows)
        if self._lift is not None:
            self._lift.x.array[:] = 0
            self._lift.x.array[active.dofs] = np.append(rate, 0.0)[active.driver]

    def by_control(self, rate: list[float], assemble: Callable[[Any], np.ndarray], n: int) -> np.ndarray:
        """Return dF/dcontrol (n,) through loads, time and supports; `assemble`: from forms to owned entries."""
        values = assemble(self._by_load) if self._by_load else np.zeros(n)
        if self._by_time and rate[-1]:
            values += assemble(self._by_time)
        if self._by_motion and any(rate[k] for k in self._movable):             # the same on all ranks
            values += assemble(self._by_motion)
        return values
