"""Triangle sizes of a sheet in three dimensions, from the states of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mesh.edges import edges_of
from ...mesh.nodes import COORDINATES
from ...mesh.sizes import GROWTH

_MIN_SIZE_RATIO = 0.25
"""Smallest required over present size: a coarse mesh shows that it is too coarse, not by how much."""


def required_sizes(path: Any, max_rotation: float | None, error: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Return positions of the nodes of the flat sheet, shape (n, 2), and the required sizes, shape (n,), length.

    Each limit that is not None reduces them in each state: rotation (radians), relative wall change over an edge.
    """
    factor: np.ndarray = np.ones(0)
    for state in path.states:
        wall = path.wall(state)
        if not len(factor):
            pairs, factor = _neighbours(wall.triangles), np.ones(len(wall.triangles))
        a, b, c = (wall.deformed_points[wall.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        turn = np.arccos(np.clip(np.einsum("ij,ij->i", *normal[pairs.T]), -1, 1))
        change = np.abs(np.diff(np.log(wall.ratio[pairs]), axis=1)[:, 0])
        for allowed, found in ((max_rotation, turn), (error, change)):
            if allowed is not None:
                reduction = np.maximum(allowed / np.maximum(found, allowed), _MIN_SIZE_RATIO)
                for triangle in pairs.T:
                    np.minimum.at(factor, triangle, reduction)
    smallest_factor = np.ones(len(wall.reference_points))
    np.minimum.at(smallest_factor, wall.triangles.ravel(), np.repeat(factor, 3))
    size = wall.to_nodes(np.sqrt(wall.reference_area / (np.sqrt(3) / 4)))         # of equilateral triangles
    points = wall.reference_points
    return points[:, :COORDINATES], rounded(_graded(points, wall.triangles, size * smallest_factor))


def rounded(sizes: np.ndarray) -> np.ndarray:
    """Return sizes, shape (n,), to three digits: gmsh makes other triangles even where round-off changes a size."""
    last = 10.0 ** (np.floor(np.log10(sizes)) - 2)
    return np.round(sizes / last) * last


def _neighbours(triangles: np.ndarray) -> np.ndarray:
    """Return the numbers of triangles, shape (m, 3), with a common edge in pairs, shape (k, 2)."""
    numbers = edges_of(triangles)[2]
    triangle = np.tile(np.arange(len(triangles)), 3)
    order = np.argsort(numbers, kind="stable")
    same = numbers[order[1:]] == numbers[order[:-1]]
    return np.column_stack([triangle[order[:-1]][same], triangle[order[1:]][same]])


def _graded(points: np.ndarray, triangles: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return sizes (n,) of nodes (n, 3) reduced in place to differ by at most 0.25 of an edge of triangles (m, 3)."""
    a, b = edges_of(triangles)[1].T
    growth = GROWTH * np.linalg.norm(points[a] - points[b], axis=1)
    while True:
        before = size.copy()
        np.minimum.at(size, a, before[b] + growth)
        np.minimum.at(size, b, before[a] + growth)
        if np.array_equal(size, before):
            return size
