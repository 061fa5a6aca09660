"""Edges of triangles."""

import numpy as np


def edges_of(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return all edges (3 m, 2) of triangles (m, 3), distinct ones (k, 2), their numbers (3 m,), and counts (k,).

    Edges of a triangle follow its vertices; distinct ones ascend, and have the number of triangles.
    """
    directed = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    low, high = np.sort(directed, axis=1).T.astype(np.int64)
    base = int(directed.max(initial=0)) + 1
    keys, numbers, times = np.unique(low * base + high, return_inverse=True, return_counts=True)
    return directed, np.column_stack(np.divmod(keys, base)), numbers.ravel(), times
