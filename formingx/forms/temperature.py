"""Temperature of a body during forming: initially given by the scene, and changed by a heat history."""

from __future__ import annotations

import numpy as np

from ..scene import fields
from ..scene.temperature import GivenTemperature


class Temperature:
    """Temperature of a problem's body at the last accepted state.

    Attributes:
        given: temperature of the scene.
        T: DOLFINx `Function` (P2) of the temperature. After a change call `update_temperature` of the `Problem`.
        before: nodal values of T at an earlier time, with ghosts, shape (n,), or None.
        time: process time of `T`.
        time_before: process time of `before`.
        limits: lowest and highest possible temperature. Quadratic elements overshoot next to a suddenly chilled face;
            values beyond the limits are cut off where temperatures are read.
    """

    def __init__(self, given: GivenTemperature):
        self._given = given
        self.T = given.T.copy()
        self.before: np.ndarray | None = None
        self.time = self.time_before = 0.0
        self.limits = (-np.inf, np.inf)

    def last_two_states(self, cells: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the temperatures in cells at q places, now and before, shape (1 or 2, cells, q), within `limits`."""
        values = [self.T.x.array] if self.before is None else [self.T.x.array, self.before]
        return np.clip(self._given.in_cells(cells, places, np.array(values)), *self.limits)

    def at_points(self, points: np.ndarray, depth: np.ndarray | None = None) -> np.ndarray:
        """Return the temperatures at points, shape (n, 2), length, within `limits`; collective. `depth` is not used."""
        return np.clip(fields.values_at(self.T, np.asarray(points, dtype=float), self._given.mesh), *self.limits)

    def nodes(self, points: np.ndarray, boundary: str) -> np.ndarray:
        """Return the local numbers of nodes at positions in this rank's cells, shape (..., 2), on a boundary."""
        from scipy.spatial import cKDTree
        nodes = self.T.function_space.tabulate_dof_coordinates()[:, :points.shape[-1]]
        return np.asarray(cKDTree(nodes).query(points)[1])

    def at_nodes(self, nodes: np.ndarray) -> np.ndarray:
        """Return the temperatures at local node numbers of any shape, within `limits`."""
        return np.clip(self.T.x.array[nodes], *self.limits)
