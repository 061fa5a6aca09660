"""Temperatures of a sheet in three dimensions during a run: columns through the thickness at its nodes."""

from __future__ import annotations

from typing import Any

import basix.ufl
import numpy as np
from mpi4py import MPI

from ....mesh.locate import locate
from ....scene import fields
from ....scene.temperature import GivenTemperature
from .basis import ColumnBasis
from .nodes import SheetNodes


class ColumnTemperature:
    """Temperature of a sheet at the last accepted state; it replaces `formingx.forms.temperature.Temperature`.

    given: temperature of the scene, uniform through the thickness.

    Attributes:
        basis: basis of the columns, with m points.
        sheet: the `SheetNodes`, n of them locally owned, N with ghosts.
        first: temperature of the scene at the nodes, shape (N,).
        now: temperatures of the columns, shape (N, m).
        before: temperatures at an earlier time, shape (N, m), or None.
        time: process time of `now`.
        time_before: process time of `before`.
        limits: lowest and highest possible temperature; values beyond them are cut off where temperatures are read.
    """

    def __init__(self, given: GivenTemperature, surface: Any, basis: ColumnBasis):
        self.basis, self.sheet = basis, SheetNodes(surface)
        self.first = fields.values_at(given.given, self.sheet.all_points, given.mesh, "Scene: temperature")
        self.now = np.repeat(self.first[:, None], len(basis.depths), axis=1)
        self.before: np.ndarray | None = None
        self.time = self.time_before = 0.0
        self.limits = (-np.inf, np.inf)
        self._domain, self._size = surface.domain, surface.length
        self._element: Any = basix.ufl.element("Lagrange", surface.domain.basix_cell().name, 1)

    def last_two_states(self, cells: np.ndarray, places: np.ndarray, layer: str) -> np.ndarray:
        """Return temperatures now and before, within `limits`, at places and layer, (1 or 2, cells, q, points)."""
        points, nodes = self.basis.layers[layer].points, self.sheet.cells(cells)
        shapes = np.asarray(self._element.tabulate(0, places)[0])
        states = [self.now] if self.before is None else [self.now, self.before]
        found = np.array([np.einsum("qa,cam->cqm", shapes, T[nodes][..., points]) for T in states])
        return np.clip(found, *self.limits)

    def through(self, cells: np.ndarray, places: np.ndarray, depths: np.ndarray) -> np.ndarray:
        """Return temperatures at q places of cells and n depths from 0 to 1, shape (cells, q, n), within `limits`."""
        shapes = np.asarray(self._element.tabulate(0, places)[0])
        corners = self.now[self.sheet.cells(cells)] @ self.basis.shapes(depths).T
        return np.clip(np.einsum("qa,can->cqn", shapes, corners), *self.limits)

    def at_points(self, points: np.ndarray, depth: np.ndarray | None = None) -> np.ndarray:
        """Return temperatures at reference points (n, 2 or 3), depths 0 to 1, () or (n,), None: 0.5; collective."""
        points = np.asarray(points, dtype=float)
        at = np.broadcast_to(0.5 if depth is None else depth, len(points))
        if self.sheet.comm.size == 1:                        # all nodes need no search in the triangles
            from scipy.spatial import cKDTree
            distance, nodes = cKDTree(self.sheet.all_points[:, : points.shape[1]]).query(points)
            if len(points) and distance.max() < 1e-9 * self._size:
                found = np.einsum("nm,nm->n", self.now[nodes], self.basis.shapes(at))
                return np.clip(found, *self.limits)
        place = locate(self._domain, points, self._size)
        shapes = np.asarray(self._element.tabulate(0, place.reference)[0]) if len(place.numbers) else np.zeros((0, 3))
        through = self.basis.shapes(at)[place.numbers]
        found = np.zeros(len(points))
        found[place.numbers] = np.einsum("na,nam,nm->n", shapes, self.now[self.sheet.cells(place.cells)], through)
        return np.clip(self.sheet.comm.allreduce(found, MPI.SUM), *self.limits)

    def nodes(self, points: np.ndarray, boundary: str) -> tuple[np.ndarray, int]:
        """Return the local numbers of nodes at positions, shape (n, 3), and the point of a column at their face."""
        from scipy.spatial import cKDTree
        nodes = cKDTree(self.sheet.all_points).query(points)[1]
        return nodes, 0 if self.sheet.faces[boundary] < 0 else len(self.basis.depths) - 1

    def at_nodes(self, nodes: tuple[np.ndarray, int]) -> np.ndarray:
        """Return the temperatures at nodes of one face, the result of the method `nodes`, within `limits`."""
        return np.clip(self.now[nodes], *self.limits)
