"""Expected stretches of a flat sheet, estimated before its run."""

from collections.abc import Iterator
from typing import Any

import numpy as np


def expected_stretches(body: Any) -> Iterator[tuple[str, float]]:
    """Yield the stretches that a flat axisymmetric sheet is expected to reach, as (cause, stretch).

    The cause is a target of the run or a mould, as text. A free dome has its largest stretch at the pole. In a mould,
    the stretch is estimated as the root of the areal draw ratio.

    Args:
        body: the `Body` to be checked.
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
    """Return the pole stretch of a disc inflated to a spherical cap that meets a target, 1 + (height / radius)^2.

    This holds for a thin disc whose points move at right angles to the successive caps.

    Args:
        target: a `Target` that is a pole stretch, a pole height or an enclosed volume.
        radius: radius of the disc, length.

    Returns:
        The stretch, or None for another target.
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
    """Return 1/pi times the area that a polyline of points (r, z), shape (n, 2), sweeps about the axis, length^2."""
    return float(np.sum((line[1:, 0] + line[:-1, 0]) * np.hypot(*np.diff(line, axis=0).T)))
