"""Checks of membranes in three dimensions."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...findings import Finding, register
from ...physics.supports import NAMES, Symmetry
from ...scene.contact_checks import OTHER_UNIT
from .triangulated import Triangulated

_SHARE = 1e-3              # share of the sheet's area in compression from which on a finding is made


@register("end")
def compressed(path: Any) -> Iterator[Finding]:
    """Find a membrane with compression in the last state that has no relaxed energy (tension field); collective.

    Args:
        path: the computed `Path`.

    Yields:
        A finding if 0.1 % of the reference area or more is in compression.
    """
    scene = path.problem.scene
    if scene.kinematics.components != 3 or scene.model.wrinkles is not None:
        return
    wall = path.wall()
    share = float(wall.area_at_rest[wall.wrinkled].sum() / wall.area_at_rest.sum())
    if share >= _SHARE:
        place = ", ".join(f"{v:.4g}" for v in wall.middle[int(np.argmax(wall.wrinkled))])
        yield Finding("serious", "membrane", f"{100 * share:.3g} % of the sheet is in compression in the last state,"
                      f" one place at (x, y, z) = ({place}): it wrinkles there, and its wall depends on the mesh: use"
                      f" Membrane(wrinkles=0.01), and look at path.wall().wrinkled.")


@register("start")
def too_large(body: Any) -> Iterator[Finding]:
    """Find tools from STL files that are more than 4 times as wide as the sheet: a file states no unit of length.

    Args:
        body: the examined body, whose `scene` has the contacts.

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
