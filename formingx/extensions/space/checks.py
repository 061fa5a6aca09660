"""Checks of membranes in space."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...findings import Finding, register

_SHARE = 1e-3              # of the sheet's area in compression


@register("end")
def compressed(path: Any) -> Iterator[Finding]:
    """A membrane in compression whose energy is not relaxed there; collective."""
    scene = path.problem.scene
    if scene.kinematics.components != 3 or scene.model.wrinkles is not None:
        return
    wall = path.wall()
    share = float(wall.area_at_rest[wall.wrinkled].sum() / wall.area_at_rest.sum())
    if share >= _SHARE:
        at = ", ".join(f"{v:.4g}" for v in wall.middle[int(np.argmax(wall.wrinkled))])
        yield Finding("serious", "membrane", f"{100 * share:.3g} % of the sheet is in compression in the last state,"
                      f" one place at (x, y, z) = ({at}): it wrinkles there, and its wall depends on the mesh: use"
                      f" Membrane(wrinkles=0.01), and look at path.wall().wrinkled.")
