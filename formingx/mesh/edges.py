"""Edges of triangles."""

import numpy as np


def edges_of(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the edges of triangles, and the number of triangles at each edge.

    Args:
        triangles: vertex numbers of m triangles, shape (m, 3).

    Returns:
        Edges of all triangles in the order of their vertices, the first of each triangle first, shape (3 m, 2). Then
        the k distinct edges with ascending vertex numbers, shape (k, 2). Then the number of the distinct edge for each
        of the 3 m edges, shape (3 m,). Last the number of triangles at each distinct edge, shape (k,).
    """
    directed = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    low, high = np.sort(directed, axis=1).T.astype(np.int64)
    base = int(directed.max(initial=0)) + 1
    keys, numbers, times = np.unique(low * base + high, return_inverse=True, return_counts=True)
    return directed, np.column_stack(np.divmod(keys, base)), numbers.ravel(), times
