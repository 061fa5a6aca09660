"""Check of stages in which air is let to a sheet that sticks to a mould and relaxes."""

from __future__ import annotations

from collections.abc import Iterator

from ..findings import Finding, register
from ..physics.contact import Contact
from ..solve.stage import Plan
from .sizes import SizedBody


@register("start")
def peeling(body: SizedBody) -> Iterator[Finding]:
    """Report stages that remove the pressure from a relaxing sheet that sticks to a mould and may separate from it.

    The points of the relaxed sheet separate one by one, stick again beside their first places, and separate again. At
    the end the part is as without the mould, after many times as many states (tests/test_vents.py).
    """
    scene = body.scene
    if not any(material.internal or material.integral for material in scene.materials.values()):
        return
    pressed: set[int] = set()                                # numbers of the loads with a pressure at the time
    for step in body.plans:
        before, pressed = pressed, pressed | set(_pressures(step, body))
        pressed -= {i for i, value in _pressures(step, body).items() if value == 0} | set(step.inactive)
        moulds = [item for i, item in enumerate(scene.items) if isinstance(item, Contact) and item.direction is None
                  and item.sticks and item.separates and not item.lagged and i not in step.inactive]
        if before and not pressed and moulds:
            mould = moulds[0].label
            yield Finding("warning", step.stage.label, f"it takes the pressure away from a sheet that relaxes and"
                          f" sticks to {mould!r}: its points separate one by one and stick again, in many states. For a"
                          f" part that is released leave the tool out, inactive=[{mould!r}]; for a part that stays in"
                          f" the mould use Contact(..., separates=False)")


def _pressures(step: Plan, body: SizedBody) -> dict[int, float]:
    """Return the pressures that a stage controls, at its end, {number of the load in `Scene.items`: stress}."""
    ends = {i: float(table[-1, 1]) for i, table in step.tables}
    until = step.stage.until
    if step.numbers and until is not None and until.name.endswith("pressure"):
        ends[step.numbers[0]] = float(until.value)
    elif step.numbers:
        ends[step.numbers[0]] = 1.0                          # of unknown size
    return {i: value for i, value in ends.items() if body.scene.items[i].quantity == "pressure"}
