"""The temperature of a body while it is formed: it begins as the scene gives it, and a history may change it."""

from __future__ import annotations

import numpy as np

from ..scene import fields
from ..scene.temperature import GivenTemperature


class Temperature:
    """The temperature of a problem's body at the last accepted state.

    Args:
        given: temperature of the scene.

    Attributes:
        T: the DOLFINx `Function` (P2) of its values. After a change call `take_temperature` of the `Problem`.
        before: values at an earlier time, ghosts included, or None.
        time, time_before: process times of `T` and of `before`.
        limits: lowest and highest temperature that there can be. Next to a face that is chilled at once quadratic
            elements overshoot: the part beyond is cut off where temperatures are read.
    """

    def __init__(self, given: GivenTemperature):
        self._given = given
        self.T = given.T.copy()
        self.before: np.ndarray | None = None
        self.time = self.time_before = 0.0
        self.limits = (-np.inf, np.inf)

    def now_and_before(self, cells: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the temperatures of `GivenTemperature.in_cells`, and of the step before if there is one: (1
        or 2, cells, q)."""
        values = [self.T.x.array] if self.before is None else [self.T.x.array, self.before]
        return np.clip(self._given.in_cells(cells, places, np.array(values)), *self.limits)

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return the temperatures, shape (n,), at reference points that each rank chooses, shape (n, 2); collective."""
        return np.clip(fields.values_at(self.T, np.asarray(points, dtype=float), self._given.mesh), *self.limits)

    def nodes(self, points: np.ndarray) -> np.ndarray:
        """Return the local numbers, shape (...), of the nodes of T at points of this rank's cells, shape (..., 2)."""
        from scipy.spatial import cKDTree
        return cKDTree(self.T.function_space.tabulate_dof_coordinates()[:, :points.shape[-1]]).query(points)[1]

    def at_nodes(self, nodes: np.ndarray) -> np.ndarray:
        """Return the temperatures at nodes of T, by their local numbers, of any shape; cut off at `limits`."""
        return np.clip(self.T.x.array[nodes], *self.limits)
