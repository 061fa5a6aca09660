"""Closed surfaces of triangles as binary STL (3D Systems, 1988)."""

from __future__ import annotations

from typing import Any

import numpy as np

from .output import replace


def volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Return the volume sum a . (b x c)/6 in outward triangles (m, 3) of points (n, 3), length^3; inward: negative."""
    a, b, c = (points[triangles[:, k]] - points.mean(0) for k in range(3))
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6)


def write_stl(points: np.ndarray, triangles: np.ndarray, file: Any) -> None:
    """Write points (n, 3), length, and outward triangles (m, 3), as binary STL; a failed file is an OSError."""
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    rows = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    rows["normal"], rows["corners"] = normal, corners
    replace(file, lambda f: f.write(b"formingx".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes()), "wb")
