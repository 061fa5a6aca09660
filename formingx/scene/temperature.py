"""The temperature of a scene's body: a field on its mesh that constants may depend on."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem

from ..mesh import Mesh
from . import fields


class BodyTemperature:
    """A temperature on the scene's own mesh, quadratic in each element.

    Args:
        given: what `fields.values_at` takes.
        mesh: of the scene.

    Attributes:
        T: the DOLFINx `Function` (P2). Who changes it calls `take_temperature` of the problem's `forms`.
        first: its values as given, ghosts included.
        before: values at an earlier time, or None; time, time_before: of the values and of those.
        limits: lowest and highest temperature that there can be. Next to a face that is chilled at once quadratic
            elements overshoot: what lies beyond is cut off where temperatures are read.

    Raises:
        InputError: it is not given all over the body.
    """

    def __init__(self, given: Any, mesh: Mesh):
        self._text = "a function" if callable(given) and not hasattr(given, "check") else repr(given)
        self._mesh = mesh
        self.T = fem.Function(fem.functionspace(mesh.domain, ("Lagrange", 2)), name="temperature")
        points = self.T.function_space.tabulate_dof_coordinates()[:, :2]
        self.T.x.array[:] = fields.values_at(given, points, mesh, "Scene: temperature")
        self.first = self.T.x.array.copy()
        self.before: Any = None
        self.time = self.time_before = 0.0
        self.limits = (-np.inf, np.inf)

    def in_cells(self, cells: np.ndarray, places: np.ndarray, values: Any = None) -> np.ndarray:
        """Temperatures in some cells (local numbers) at places in the reference cell, shape (q, 2): (cells, q).

        values: in place of those now, such as `first` or `before`.
        """
        space = self.T.function_space
        basis = space.element.basix_element.tabulate(0, places)[0, :, :, 0]
        found = (self.T.x.array if values is None else values)[space.dofmap.list[cells]] @ basis.T
        return np.clip(found, *self.limits)

    def at(self, points: np.ndarray) -> np.ndarray:
        """Temperatures at points, shape (n, 2), of this rank's own choice, shape (n,); collective."""
        return np.clip(fields.values_at(self.T, np.asarray(points, dtype=float), self._mesh), *self.limits)

    def nodes(self, points: np.ndarray) -> np.ndarray:
        """Local numbers of the nodes of T that lie at points of this rank's cells, shape (..., 2), shape (...)."""
        from scipy.spatial import cKDTree
        return cKDTree(self.T.function_space.tabulate_dof_coordinates()[:, :2]).query(points)[1]

    def at_nodes(self, nodes: np.ndarray) -> np.ndarray:
        """Temperatures at nodes of T, local numbers of any shape, without error."""
        return np.clip(self.T.x.array[nodes], *self.limits)

    def on(self, boundary: str) -> np.ndarray:
        """Temperatures as given at the nodes of T on a boundary, shape (n,), all ranks; collective."""
        nodes = fem.locate_dofs_topological(self.T.function_space, 1, self._mesh.facets_of(boundary))
        return np.concatenate(self._mesh.comm.allgather(self.first[nodes]))

    def __repr__(self) -> str:
        return self._text
