"""Triangles of a surface in three dimensions on all ranks, and their deformed positions."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mesh.nodes import own_cells
from ...ranks import gathered


class WholeSurface:
    """The n nodes and m triangles of a surface, the same on all ranks.

    Attributes:
        triangles: numbers of the nodes of each triangle, shape (m, 3), counter-clockwise seen from "top" or "outer".
        reference: reference positions of the nodes, shape (n, 3), length.
    """

    def __init__(self, surface: Any):
        self._surface = surface
        vectors, numbers = surface.space.sub(0).collapse()
        index = vectors.dofmap.index_map
        self._dofs = np.asarray(numbers, dtype=np.int64).reshape(-1, 3)[:index.size_local]
        self._order = gathered(surface.comm, index.local_to_global(np.arange(index.size_local, dtype=np.int32)))
        self.reference = self._ordered(vectors.tabulate_dof_coordinates()[:index.size_local])
        cells = vectors.dofmap.list[own_cells(surface.domain)]
        cells = index.local_to_global(np.ascontiguousarray(cells.ravel(), dtype=np.int32)).reshape(-1, 3)
        self.triangles = gathered(surface.comm, cells).astype(np.int64)
        if surface.mesh.flat:
            corners = self.reference[self.triangles]
            turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] < 0
            self.triangles[turned] = self.triangles[turned][:, ::-1]

    def positions(self, fields: np.ndarray) -> np.ndarray:
        """Return the deformed positions of all nodes, shape (n, 3), length; fields: owned unknowns; collective."""
        return self.reference + self._ordered(self._surface.length * fields[self._dofs])

    def _ordered(self, own: np.ndarray) -> np.ndarray:
        """Return the rows of all nodes, shape (n, 3), from those of the owned nodes; collective."""
        found = np.empty((len(self._order), 3))
        found[self._order] = gathered(self._surface.comm, own)
        return found
