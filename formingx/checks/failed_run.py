"""Checks of a failed run: probable causes of its failure, and advice."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..findings import Finding, coordinates, register
from ..solve.diagnose import STATES_BEFORE, FailedRun


@dataclass(frozen=True)
class FailureLimits:
    """Limits that separate causes of a failure from harmless values, for numbers of the last good state.

    Attributes:
        singular_ratio: condition number of the tangent over that of an earlier state, above which the tangent counts as
            singular.
        round_off_condition: condition number above which hardly any of 16 digits is correct.
        material_ratio: ratio of I1 - 3 to its limit in the material, above which the material counts as a cause.
        min_volume_ratio: volume ratio J below which an element is about to turn inside out.
        min_quality_ratio: shape quality of a deformed element, over its value in the reference configuration, below
            which the element is about to turn inside out.
    """

    singular_ratio: float = 100.0
    round_off_condition: float = 1e14
    material_ratio: float = 0.8
    min_volume_ratio: float = 0.3
    min_quality_ratio: float = 0.1


_LIMITS = FailureLimits()


@register("failure")
def material_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield a finding if I1 at a point of the body is near the limit of its material (Gent, Arruda-Boyce)."""
    facts = run.facts
    if (facts.get("I1") or 0) > _LIMITS.material_ratio:
        yield Finding("serious", "material",
                      f"a material is stretched nearly to its limit: I1 - 3 is {100 * facts['I1']:.3g} % of the largest"
                      f" that it allows, at {facts['limit']}",
                      "a target that needs less stretch there, a material with a higher limit, or shorter steps"
                      " (StepControl(largest=...))")


@register("failure")
def element_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield a finding if an element of the last good state is about to turn inside out."""
    facts = run.facts
    J, failed_J = facts.get("smallest_J"), facts.get("failed_J")
    infinite = any(np.isinf(v) for v in facts.get("residual", {}).values())
    inverted = failed_J is not None and failed_J <= 0
    small = J is not None and _LIMITS.min_volume_ratio > J
    if J is not None and (small or facts["shape"] < _LIMITS.min_quality_ratio and (inverted or infinite)):
        now = f"J = {J:.3g}" if small else f"its shape quality is {facts['shape']:.2g} times that at rest"
        R, Z = facts["at_J"].position
        yield Finding("serious", "element",
                      f"an element is about to turn inside out: {now} in the last good state, at {facts['at_J']}"
                      + (f" (in the failed attempt J = {failed_J:.3g})" if inverted else ""),
                      f"smaller elements around (R, Z) = {coordinates((R, Z))}, in a disc with"
                      f" concentrate={{{R:.4g}: 0.2}}, or elements that are long at the start in the direction in which"
                      f" they are compressed there")


@register("failure")
def buckling_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield a finding if a sheet in contact is compressed along its section, which makes it buckle."""
    if _buckles(run.facts):
        stretch, first, last = run.facts["shortened"]
        yield Finding("serious", "wall",
                      f"the wall buckles: between (R, Z) = {coordinates(first)} and {coordinates(last)} it is"
                      f" compressed along its section, to {stretch:.3g} of its length, as supports and tools hold both"
                      f" its ends",
                      "more room for the free end of the body: where it comes to stand on its tool early, as a"
                      " parison's bottom on the base of its mould, the blown part presses on the wall above; or a"
                      " support that lets the other end move")


def _buckles(facts: dict[str, Any]) -> bool:
    """Return True if, by the `facts` of a failed run, a sheet in contact is compressed along its section."""
    return bool(facts.get("shortened") and facts["touching"])


@register("failure")
def limit_point_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield findings if the control passed a limit point before its target, or is about to reach one."""
    facts, target = run.facts, run.target
    if _buckles(facts):                                      # the limit point is only an effect of buckling
        return
    what, limits = facts["what"], facts.get("limit_points", ())
    if what == "process time" and facts["control"] in limits:
        yield Finding("serious", "limit point",
                      f"the control reaches a maximum, a limit point, at process time {facts['control']:.6g}",
                      "a stage in which something goes on growing, such as"
                      " amplitudes={enclosed_volume: [(time, value), ...]}")
    elif target is not None and limits and abs(facts["control"]) <= max(map(abs, limits)) < abs(target):
        extremum, side = ("maximum", "above") if target > 0 else ("minimum", "below")
        yield Finding("serious", "limit point",
                      f"the {what} has its {extremum}, {max(limits, key=abs):.6g}, at a limit point that was passed,"
                      f" and the target {target:.6g} lies {side} it",
                      "a target that goes on growing past a limit point, such as enclosed_volume")
    ahead, aimed = facts.get("next_limit_point"), facts.get("aimed")
    if ahead is not None and run.fixed_control:
        yield Finding("warning", "limit point",
                      f"a limit point lies ahead: extrapolated from the last states, the {what} rises to about"
                      f" {ahead:.6g} and no further" + (f"; {aimed:.6g} was asked for" if aimed is not None else ""),
                      "`trace`, which passes limit points, or a lower target")


@register("failure")
def branch_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield findings if another path branches off, the tangent is singular, or the active set does not converge."""
    facts = run.facts
    what = facts["what"]
    for a, b in facts.get("turned", ()):
        yield Finding("serious", "branch point",
                      f"the tangent stiffness became indefinite between {what} {a:.6g} and {b:.6g} without a limit"
                      f" point: another path branches off there (a bifurcation, such as buckling)",
                      f"a small imperfection in the load or the mesh, or a target before {what} {b:.6g}")
    at_limit_point = facts.get("next_limit_point") is not None or facts.get("control") in facts.get("limit_points", ())
    if _singular(facts) and not facts.get("turned") and not at_limit_point:
        yield Finding("warning", "tangent",
                      "the tangent stiffness becomes singular, and there is no limit point: its condition number has"
                      f" grown from {facts['condition_before']:.1g} to {facts['condition']:.1g} in"
                      f" {STATES_BEFORE}"
                      f" states; the body buckles here, or a contact point is about to slip off its tool",
                      "smaller elements; Contact(..., points=4), where there is contact")
    if facts.get("flipped"):
        yield Finding("warning", "contact",
                      f"contact does not settle: {facts['flipped']} nodes changed between open, sticking and sliding in"
                      f" the last iteration",
                      "smaller elements along the face in contact, or Contact with points=4, a wider ramp or a lower"
                      " penalty")


def _singular(facts: dict[str, Any]) -> bool:
    """Return True if the condition number grew by `FailureLimits.singular_ratio` over `STATES_BEFORE` states."""
    before = facts.get("condition_before")
    return bool(before and (facts.get("condition") or 0) > _LIMITS.singular_ratio * before)


@register("failure")
def round_off_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield a finding if the condition number of the tangent leaves hardly any correct digits."""
    facts = run.facts
    if (facts.get("condition") or 0) > _LIMITS.round_off_condition and not _singular(facts):
        yield Finding("warning", "round-off",
                      f"round-off: the condition number of the tangent stiffness is {facts['condition']:.1g}, and"
                      f" hardly any of 16 digits are left",
                      "more elements along a film, or Membrane(); a larger eps, a lower contact penalty, or layers that"
                      " differ less in stiffness")
