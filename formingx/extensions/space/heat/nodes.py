"""Nodes of a sheet in three dimensions: their areas, thicknesses and displacements, for columns through the sheet."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import la

from .... import _compat


class SheetNodes:
    """The n locally owned nodes of a sheet, with N nodes including ghosts.

    Attributes:
        comm: MPI communicator.
        points: reference positions of the owned nodes, shape (n, 3), length.
        faces: {name of a face: sign of its normal}.
    """

    def __init__(self, surface: Any):
        self._surface, self.comm = surface, surface.comm
        self._vectors, numbers = surface.space.sub(0).collapse()
        self._dofs = np.asarray(numbers, dtype=np.int64).reshape(-1, 3)
        self._n = self._vectors.dofmap.index_map.size_local
        self.all_points = self._vectors.tabulate_dof_coordinates()
        self.points, self.faces = self.all_points[: self._n].copy(), surface.mesh.faces

    def cells(self, cells: np.ndarray) -> np.ndarray:
        """Return the numbers of the nodes of m cells, ghosts included, shape (m, 3)."""
        return np.asarray(self._vectors.dofmap.list[cells])

    def with_ghosts(self, values: np.ndarray) -> np.ndarray:
        """Return values at all N nodes, shape (N, m), from those at the owned nodes, shape (n, m); collective."""
        if self.comm.size == 1:
            return values
        vector = la.vector(self._vectors.dofmap.index_map, values.shape[1])
        vector.array[: values.size] = values.ravel()
        vector.scatter_forward()
        return np.asarray(vector.array).reshape(-1, values.shape[1]).copy()

    def displacements(self) -> np.ndarray:
        """Return the displacements of the owned nodes, shape (n, 3), length."""
        return np.asarray(self._surface.length * self._surface.w.x.array[self._dofs[: self._n]])

    @cached_property
    def area(self) -> np.ndarray:
        """Reference area of each owned node, a third of the area of the adjacent triangles, shape (n,), length^2."""
        return self._areas(self._surface.area_row())

    def area_ratio(self) -> np.ndarray:
        """Return the deformed over the reference area of the owned nodes, shape (n,), for the present fields."""
        return self._assembled(self._surface.deformed_area) / self.area

    @cached_property
    def thickness(self) -> np.ndarray:
        """Reference thickness at the owned nodes, shape (n,), length."""
        return np.asarray(sum(given(*self.points.T) for given in self._surface.scene.thickness.values()))

    def _areas(self, form: Any) -> np.ndarray:
        """Return the entries of a linear form (UFL) at the first component of the owned nodes, shape (n,)."""
        return self._assembled(self._surface.compile(form))

    def _assembled(self, form: Any) -> np.ndarray:
        """Return the entries of a compiled linear form at the first component of the owned nodes, shape (n,)."""
        buffer = la.vector(self._surface.space.dofmap.index_map, self._surface.space.dofmap.index_map_bs)
        return np.asarray(_compat.assemble_vector(buffer, form))[self._dofs[: self._n, 0]]
