"""Fillets of edges where the surfaces of two rigid solids meet.

The common part of two solids has the smaller of both signed distances, and a convex edge. The union has the larger one,
and a concave edge. A fillet is exact where the surfaces meet at right angles.
"""

from __future__ import annotations

import numpy as np

from .lagged_friction import Distances


def rounded_minimum(a: np.ndarray, b: np.ndarray, fillet: float) -> np.ndarray:
    """Return the signed distances (n,) of the common part of two solids with a fillet, from theirs (n,); length."""
    R = fillet
    return np.maximum(R, np.minimum(a, b)) - np.hypot(np.maximum(R - a, 0.0), np.maximum(R - b, 0.0)) if R else (
        np.minimum(a, b))


def rounded_distances(a: Distances, b: Distances, fillet: float) -> Distances:
    """Return distances, with first and second derivatives, of the common part of solids a and b with a fillet."""
    u, v = (np.maximum(fillet - part.distance, 0.0) for part in (a, b))
    nearer = (a.distance <= b.distance)[:, None]
    s = np.hypot(u, v)
    normal = np.where(nearer, a.normal, b.normal)
    hessian = np.where(nearer[..., None], a.hessian, b.hessian)
    k = (u > 0) & (v > 0)
    if k.any():
        p, q = (u / np.maximum(s, 1e-300))[k, None], (v / np.maximum(s, 1e-300))[k, None]
        n = p * a.normal[k] + q * b.normal[k]
        outer = [w[:, :, None] * w[:, None] for w in (a.normal[k], b.normal[k], n)]
        normal[k] = n
        hessian[k] = (p[..., None] * a.hessian[k] + q[..., None] * b.hessian[k]
                      - (outer[0] + outer[1] - outer[2]) / s[k, None, None])
    return Distances(rounded_minimum(a.distance, b.distance, fillet), normal, hessian)


def complement(part: Distances) -> Distances:
    """Return the distances from the complement of a solid."""
    return Distances(-part.distance, -part.normal, -part.hessian)
