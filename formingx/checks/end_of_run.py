"""Checks at the end of a run: its last state, its jumps, the contact with its tools."""

from collections.abc import Iterator
from typing import Any

from ..findings import Finding, register
from ..results.evaluate import creases, edges, peeling, resticking, snaps, tension, volume
from ..values.tolerances import NOTICEABLE


@register("end")
def inadmissible(path: Any) -> Iterator[Finding]:
    """Report the first inadmissible state of a `Path`: no real body can have it (`State.inadmissible_reason`)."""
    bad = next((state for state in path.states if state.inadmissible_reason), None)
    if bad is not None:
        yield Finding("serious", "state", f"from {path.record.describe(bad)} on the results must not be used:"
                                          f" {bad.inadmissible_reason}")


@register("end")
def volumes(path: Any) -> Iterator[Finding]:
    """Yield findings on volume ratios J with RMS above 0.005 or outside 1/2 to 2 in the last state; collective."""
    error = path.last.measures["volume_error"]
    yield from volume.findings(error, "the last state", volume.away_from_clamps(path) if error > NOTICEABLE else None)
    yield from volume.extreme_ratio(path)


@register("end")
def contact(path: Any) -> Iterator[Finding]:
    """Report inaccurate contact in a `Path`; collective.

    The causes are penetration that changes tool forces, coarse elements at edges of tools, sticking points that
    separate and stick again elsewhere, tools off which the sheet is peeled, and faces that crease between sticking
    points.
    """
    moved = resticking.furthest(path)
    yield from path._view(path.record.segments[-1]).admissibility.findings(path.last)
    yield from edges.findings(edges.coarsest(path, path.last))
    yield from resticking.findings(moved)
    if moved and moved.shift > resticking.LARGE_SHIFT:
        yield from peeling.findings(peeling.strongest(path.problem, path.record.segments[-1].states))
    yield from creases.findings(creases.deepest(path))


@register("end")
def equilibrium(path: Any) -> Iterator[Finding]:
    """Report compression of a membrane, and a snap-through that changes the wall, in a `Path`; collective."""
    yield from tension.findings(tension.first_compression(path))
    yield from snaps.findings(snaps.largest(path))


@register("end")
def force_signs(path: Any) -> Iterator[Finding]:
    """Note a support that moved to negative values to reach a positive force: the force of the body on it."""
    scene = path.scene
    for state in path.states:
        if state.target is None or not state.target.name.endswith("force") or not state.target.value > 0:
            continue
        of = state.target.name.removesuffix("_force")
        for number, item in enumerate(scene.items):
            if item in scene.contacts or item not in scene.drivable or item.quantity != "travel":
                continue
            setting = state.setting
            travel = setting["base"][number] + setting["rate"][number] * state.control
            if travel < 0 and setting["rate"][number] and of in ("force", item.name):
                yield Finding("note", item.name or "support", f"{state.target} is the force of the body on the support"
                              f" {item.name or item.on!r}, which moved in the negative direction to reach it and"
                              f" presses the body", f"To move it the other way, give force({-state.target.value:g}).")
