"""Columns of elements of given lengths along a sheet."""

from typing import Any

import numpy as np

GROWTH = 0.25
"""Largest growth of the length of columns or triangles per distance from the shortest ones."""


def length_along(line: np.ndarray) -> np.ndarray:
    """Return the length along a polyline (n, 2) from its first point to each of its points, shape (n,), length."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def number_of_columns(s: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the integral of ds/h to each length s, (n,), with sizes h, (n,), of columns, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(np.diff(s) * (1 / size[1:] + 1 / size[:-1]) / 2)])


def ends_of_columns(coordinates: np.ndarray, s: np.ndarray, size: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Return the ends of columns of elements with given lengths, as coordinates along the sheet, shape (columns + 1,).

    Coordinates, lengths s and largest sizes of columns have shape (n,); `fixed` ends, first and last included, must be
    kept, (m,).
    """
    number = number_of_columns(s, size)
    marks = np.interp(fixed, coordinates, number)
    ends = [fixed[:1]]
    for a, b, last in zip(marks, marks[1:], fixed[1:]):
        n = max(int(np.ceil(b - a - 1e-6)), 1)
        ends += [np.interp(a + (b - a) * np.arange(1, n) / n, number, coordinates), np.array([last])]
    return np.concatenate(ends)


def moved_nodes(mesh: Any) -> float:
    """Return the largest displacement, by the script, of a node of the sheet's faces, over the extent of the mesh."""
    columns = mesh.columns
    nodes = np.concatenate(list(columns.place(columns.ends)[[0, -1]]))
    motions = [np.min(np.linalg.norm(nodes[:, None] - mesh.nodes_of(name), axis=2), axis=1).reshape(2, -1)[k].max()
               for k, name in enumerate(columns.faces)]
    return max(motions) / np.ptp(nodes, axis=0).max()
