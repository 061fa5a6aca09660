"""Expected stretches of a flat sheet, estimated before its run."""

from collections.abc import Iterator
from typing import Any

import numpy as np


def expected_stretches(body: Any) -> Iterator[tuple[str, float]]:
    """Yield (target or mould as text, stretch) that a flat axisymmetric sheet is expected to reach.

    A target gives the pole stretch of a free spherical cap, a closed mould the square root of the areal draw ratio.
    """
    for face in body.pressurised_faces:
        if not face.flat or not face.axisymmetric:
            continue
        for target in (*body.targets, *body.table_maxima):
            if (stretch := _cap_stretch(target, face.radius)) is not None:
                yield str(target), stretch
        if face.tools:
            points, ends = face.mould_points
            if np.all(np.isfinite(ends)) and len(ends) > 1:
                yield repr(face.tools[0]), float(np.sqrt(_area(ends) / _area(points)))


def _cap_stretch(target: Any, radius: float) -> float | None:
    """Return 1 + (H/a)^2 at the pole of a disc of radius a blown to a cap of height H that meets a target, or None.

    The points of the thin disc move at right angles to the successive caps. A target is a pole stretch or height, or a
    volume.
    """
    if target.name == "pole_stretch":
        return float(target.value)
    height = abs(target.value) / radius
    if target.name == "enclosed_volume":                     # pi h (3 + h^2)/6 for a unit radius
        volume = height / radius**2
        root = np.roots([1.0, 0.0, 3.0, -6 * volume / np.pi])
        height = float(root[np.abs(root.imag) < 1e-9].real.max())
    elif target.name != "pole_height":
        return None
    return 1 + height**2


def _area(line: np.ndarray) -> float:
    """Return the area of the surface of revolution of a polyline, shape (n, 2), over pi, length^2."""
    return float(np.sum((line[1:, 0] + line[:-1, 0]) * np.hypot(*np.diff(line, axis=0).T)))
