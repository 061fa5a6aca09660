"""Search for overlapping boxes with a tree of boxes, in O(n log n) if few overlap."""

from collections.abc import Iterator

import numpy as np

from .._jit import CFunctions
from .nodes import MAX_COMPARED

_C = CFunctions("mesh/boxes.c")
_CHUNK = 2**18      # pairs that are compared at a time


def overlapping(low: np.ndarray, high: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield i and j, (k,) each, of boxes with finite corners (n, 2) that overlap or touch, every pair once."""
    if len(low)**2 <= MAX_COMPARED:
        pairs, count = np.empty((0, 2), dtype=int), 8 * len(low)
        while len(pairs) < count:
            pairs = np.empty((count, 2), dtype=int)
            count = _C.overlaps(len(low), low, high, count, pairs)
        if len(low) > 1:
            yield pairs[:count, 0], pairs[:count, 1]
        return
    order = np.argsort(_morton_codes((low + high) / 2), kind="stable")
    depth = int(np.ceil(np.log2(len(low))))
    ends = np.full((2, 2**depth, 2), [[[np.inf]], [[-np.inf]]])             # empty boxes overlap nothing
    ends[0, :len(low)], ends[1, :len(low)] = low[order], high[order]
    tree = [ends]
    while len(tree) <= depth:
        children = tree[-1].reshape(2, -1, 2, 2)
        tree.append(np.stack([children[0].min(1), children[1].max(1)]))
    waiting = [(depth, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))]
    while waiting:
        level, a, b = waiting.pop()
        if level == 0:
            yield order[a[a < b]], order[b[a < b]]
            continue
        a, b = (2 * a[:, None] + (0, 0, 1, 1)).ravel(), (2 * b[:, None] + (0, 1, 0, 1)).ravel()
        lower, upper = tree[level - 1]
        pairs = (a <= b) & np.all((lower[a] <= upper[b]) & (lower[b] <= upper[a]), axis=1)
        a, b = a[pairs], b[pairs]
        waiting += [(level - 1, a[k:k + _CHUNK], b[k:k + _CHUNK]) for k in range(0, len(a), _CHUNK)]


def _morton_codes(points: np.ndarray) -> np.ndarray:
    """Return positions (n,) of points (n, 2) on Morton's curve, integers: neighbours are mostly close together."""
    size = np.ptp(points, axis=0).max() or 1.0
    grid = ((points - points.min(0)) / size * (2**16 - 1)).astype(np.int64)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        grid = (grid | grid << shift) & mask
    return grid[:, 0] | grid[:, 1] << 1
