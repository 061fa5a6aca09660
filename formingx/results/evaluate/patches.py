"""Recovery of smooth fields from values at quadrature points: a cubic for each cell, fitted to its patch.

The patch of a cell consists of the cells of the same layer that share a corner with it. So nothing is averaged over an
interface. A cubic in (R, Z) is fitted to the values on the patch by least squares. This is similar to the patches
around nodes of Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331 (doi:10.1002/nme.1620330702). A patch per
cell needs no special rule at boundaries.
"""

from __future__ import annotations

import numpy as np

_POWERS = np.array([(i, n - i) for n in range(4) for i in range(n, -1, -1)])
"""Exponents of (R, Z) in a cubic, shape (10, 2)."""
_CHUNK = 2048  # number of cells that are fitted at a time, in about 30 MB
_KEPT = 2**25  # matrices of the fits are stored for the next state if they have fewer entries than this (256 MB)


class Patches:
    """Least-squares fits of cubics to values at quadrature points, for m of the n cells of a mesh.

    The cubic of a cell is fitted to the values in its patch: the cells of the same layer that share a corner with it.
    Points (R, Z) have shape (n, q, 2), length, corners of cells (n, 3), their layers (n,), and the cells to be fitted
    (m,).
    """

    def __init__(self, points: np.ndarray, corners: np.ndarray, layer: np.ndarray, fitted: np.ndarray):
        self._points = points
        neighbours: dict[tuple[int, int], list[int]] = {}
        for cell, (three, where) in enumerate(zip(corners, layer, strict=True)):
            for corner in three:
                neighbours.setdefault((int(where), int(corner)), []).append(cell)
        patches = [sorted({c for corner in corners[cell].tolist() for c in neighbours[int(layer[cell]), corner]})
                   for cell in fitted]
        self._patch = np.full((len(fitted), max(map(len, patches), default=0)), -1)
        for row, patch in zip(self._patch, patches, strict=True):
            row[: len(patch)] = patch
        self._origin = points[fitted].mean(1)
        self._size = np.ones_like(self._origin)
        for chunk in self._chunks():
            distance = np.abs(points[self._patch[chunk]] - self._origin[chunk, None, None])
            self._size[chunk] = np.where(self._patch[chunk, :, None, None] < 0, 0.0, distance).max((1, 2))
        self._keeps = self._patch.size * points.shape[1] * len(_POWERS) < _KEPT
        self._operators: dict[int, np.ndarray] = {}

    def fit(self, values: np.ndarray) -> np.ndarray:
        """Fit cubics in (R, Z) to values (n, q, k) on the patch of each cell; coefficients (m, 10, k)."""
        found = np.zeros((len(self._patch), len(_POWERS), values.shape[-1]))
        for chunk in self._chunks():
            patch = self._patch[chunk]
            found[chunk] = self._operator(chunk) @ values[patch].reshape(len(patch), -1, values.shape[-1])
        return found

    def _operator(self, chunk: slice) -> np.ndarray:
        """Return matrices (cells of the slice, 10, points) from values in a patch to its cubic, 0 beyond its points."""
        if chunk.start in self._operators:
            return self._operators[chunk.start]
        patch = self._patch[chunk]
        basis = self._basis(chunk, self._points[patch]) * (patch >= 0)[..., None, None]
        basis = basis.reshape(len(patch), -1, len(_POWERS)).transpose(0, 2, 1)
        # too few cells for a cubic: the smallest coefficients that fit
        operator = np.linalg.pinv(basis @ basis.transpose(0, 2, 1), rcond=1e-12, hermitian=True) @ basis
        if self._keeps:
            self._operators[chunk.start] = operator
        return operator

    def evaluate(self, coefficients: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the values of cubics (m, 10, k) at p points (m, p, 2) of each of the m cells, shape (m, p, k)."""
        return self._basis(slice(None), points) @ coefficients

    def _basis(self, chunk: slice, points: np.ndarray) -> np.ndarray:
        """Return the ten monomials of a cubic at points (cells, ..., 2), shape (cells, ..., 10)."""
        between = (slice(None), *[None] * (points.ndim - 2))
        x = (points - self._origin[chunk][between]) / self._size[chunk][between]
        powers = np.stack([np.ones_like(x), x, x * x, x * x * x], axis=-1)        # (..., coordinate, power)
        return powers[..., 0, _POWERS[:, 0]] * powers[..., 1, _POWERS[:, 1]]

    def _chunks(self) -> list[slice]:
        """Return slices that divide the m cells into groups of at most 2048 (`_CHUNK`), to limit the memory."""
        return [slice(k, k + _CHUNK) for k in range(0, len(self._patch), _CHUNK)]
