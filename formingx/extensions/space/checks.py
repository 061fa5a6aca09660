"""Checks of membranes in three dimensions."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...findings import Finding, register
from ...physics.supports import NAMES, Symmetry
from ...scene.contact_checks import OTHER_UNIT
from .solid_tool import Triangulated

_SHARE = 1e-3              # of the sheet's area in compression


@register("end")
def compressed(path: Any) -> Iterator[Finding]:
    """Warn of a membrane in compression whose material has no relaxed energy (tension field); collective.

    Args:
        path: the computed `Path`.

    Yields:
        A finding if there is compression.
    """
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


@register("start")
def too_large(body: Any) -> Iterator[Finding]:
    """Find tools from files that are many times as wide as the sheet: a file has no unit of length.

    Args:
        body: the examined body.

    Yields:
        A finding for each such tool.
    """
    scene = body.scene
    for contact in scene.contacts:
        if scene.kinematics.components == 3 and isinstance(contact.tool, Triangulated) and contact.direction is None:
            cut = [any(isinstance(s, Symmetry) and NAMES[s.component] == axis for s in scene.supports) for axis in "xy"]
            sheet = max((1 + half) * float(length) for half, length in zip(cut, scene.extent))
            ratio = float(np.ptp(contact.tool.bounds, axis=0)[:2].max() / sheet)
            if ratio > OTHER_UNIT:
                yield Finding("warning", repr(contact), f"the tool is {ratio:.3g} times as wide as the sheet: is its"
                              f" file in another unit of length? Give solid a scale=...")
