"""Values at points of a body, carried to points of another mesh of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..ranks import gathered

_NEIGHBOURS = 12
"""Points of a fit: twice the six coefficients of a quadratic polynomial in the plane."""


class Carrier:
    """Local fits of quadratic polynomials to values at scattered points: exact for those, of third order else.

    Weights are the inverse fourth power of the distance, so values at a point that both meshes have stay as they are
    (interpolating moving least squares: Lancaster and Salkauskas, Mathematics of Computation 37, 1981). At a jump fits
    go beyond it by less than a tenth.

    Args:
        comm: communicator; source, target: own points, shapes (m, components), (n, components), length; collective.
    """

    def __init__(self, comm: Any, source: np.ndarray, target: np.ndarray):
        from scipy.spatial import cKDTree
        self._comm = comm
        points = gathered(comm, source)
        k = min(_NEIGHBOURS, len(points))
        away, self._rows = (found.reshape(len(target), k) for found in cKDTree(points).query(target, k))
        self.nearest = self._rows[:, 0]
        scale = np.maximum(away[:, -1:], 1e-300)
        by = (points[self._rows] - target[:, None]) / scale[..., None]
        i, j = np.triu_indices(points.shape[1])
        basis = np.concatenate([np.ones_like(by[..., :1]), by, by[..., i] * by[..., j]], axis=-1)
        weight = 1 / np.maximum(away / scale, 1e-7) ** 2                # root of the weights
        self._share = np.linalg.pinv(weight[..., None] * basis, rcond=1e-9)[:, 0] * weight

    def fitted(self, values: np.ndarray) -> np.ndarray:
        """Own values at `source`, shape (m, ...), at `target`, shape (n, ...); collective."""
        return np.einsum("nk,nk...->n...", self._share, self.all(values)[self._rows])

    def all(self, values: np.ndarray) -> np.ndarray:
        """Own values at `source` of all ranks, in the order of `nearest`; collective."""
        return gathered(self._comm, values)


def carry(source: Any, memory: list[Any], problem: Any, x: np.ndarray, control: float) -> None:
    """Let a problem remember what one of the same body on another mesh does (`State.memory`); collective.

    x, control: the state of it that this belongs to, own part.
    """
    problem.look_at(x, control)
    for mine, other, kept in zip(problem.histories, source.histories, memory, strict=True):
        mine.put(mine.carry(other, kept, x[: problem.n_owned], control))
