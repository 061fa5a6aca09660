"""Stretches to be expected of a flat sheet before it is run."""

from collections.abc import Iterator
from typing import Any

import numpy as np


def draws(body: Any) -> Iterator[tuple[str, float]]:
    """Yield (what, stretch) of a flat sheet: at the pole of a free dome, in a mould the root of the draw ratio."""
    for pushed in body.pushed:
        if not pushed.flat or not pushed.round:
            continue
        for target in (*body.targets, *body.highest):
            if (stretch := _of_cap(target, pushed.radius)) is not None:
                yield str(target), stretch
        if pushed.tools:
            points, ends = pushed.ways
            if np.all(np.isfinite(ends)) and len(ends) > 1:
                yield repr(pushed.tools[0]), float(np.sqrt(_area(ends) / _area(points)))


def _of_cap(target: Any, radius: float) -> float | None:
    """Return the stretch at the pole of a flat disc that is blown to a cap of height h radii, about 1 + h^2, or None.

    A thin disc has it if its points move at right angles to the caps that they pass through.
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
    """Return 1/pi times the area that a line, shape (n, 2), sweeps about the axis, length^2."""
    return float(np.sum((line[1:, 0] + line[:-1, 0]) * np.hypot(*np.diff(line, axis=0).T)))
