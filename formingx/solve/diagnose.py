"""Diagnosis of a failed run: numbers, probable causes, advice, and a picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import ConvergenceError, InputError
from ..findings import Finding, coordinates, findings_at, register
from ..mesh.triangles import Place
from .arc_length import Curve
from .branches import branches, determinant_sign
from .equations import Attempt, Equations, Examined
from .linear import DirectSolver, condition
from .state import State


@dataclass(frozen=True)
class Limits:
    """Limits that separate causes of a failure from harmless values, for numbers of the last good state.

    Attributes:
        states_before: number of states between the last good state and the earlier state with which its condition
            number is compared.
        singular_ratio: ratio of both condition numbers above which the tangent counts as singular.
        round_off_condition: condition number above which hardly any of 16 digits is correct.
        slope_ratio: derivative of the control with respect to arc length, over the largest such derivative on the path,
            below which a limit point ahead is extrapolated.
        material_ratio: ratio of I1 - 3 to its limit in the material, above which the material counts as a cause.
        min_volume_ratio: volume ratio J below which an element is about to turn inside out.
        min_quality_ratio: shape quality of a deformed element, over its value in the reference configuration, below
            which the element is about to turn inside out.
    """

    states_before: int = 10
    singular_ratio: float = 100.0
    round_off_condition: float = 1e14
    slope_ratio: float = 0.3
    material_ratio: float = 0.8
    min_volume_ratio: float = 0.3
    min_quality_ratio: float = 0.1


_LIMITS = Limits()


@dataclass(frozen=True)
class FailedRun:
    """Failed run, as the checks registered by `formingx.findings.register("failure")` examine it.

    Attributes:
        facts: {field of `Diagnosis`: value}, without `findings`.
        problem: the equations.
        last: the last good state, or None.
        fixed_control: True if the solver of the run cannot pass a limit point.
        target: target of the controlled quantity, in the user's units, or None.
    """

    facts: dict[str, Any]
    problem: Equations
    last: State | None
    fixed_control: bool = False
    target: float | None = None


@dataclass(frozen=True)
class Diagnosis:
    """Diagnosis of a failed run. Numbers are None where they could not be computed; a membrane has no J.

    Attributes:
        reason: how the last attempt ended, as text.
        step: number of the state that was not reached; the start is 0.
        control: value of the controlled quantity in the last good state: pressure (stress), travel (length) or time.
        aimed: value of the controlled quantity, in the user's units, at the end of the failed attempt.
        residual: {"displacement", "pressure", "multipliers": norm of this part of the residual over the norm of the
            support forces} in the failed attempt; inf where it was not finite.
        worst: `Place` (R and Z in the reference configuration, layer, nearest boundary and its distance) of the largest
            out-of-balance force in the failed attempt.
        smallest_J: smallest det F at the quadrature points of the last good state.
        at_J: place of `smallest_J`, a `Place`.
        failed_J: smallest det F at the quadrature points in the failed attempt.
        at_failed_J: place of `failed_J`, a `Place`.
        shape: smallest shape quality of a deformed element of the last good state, over its value in the reference
            configuration.
        shortened: (mean stretch, (R, Z) of one end, (R, Z) of the other) of the longest piece of a sheet compressed
            along its section.
        I1: largest (I1 - 3) / (limit - 3) in the last good state, with the limit of the material at each point; None
            without a limit.
        limit: place of `I1`, a `Place`.
        turned: pairs of values of the controlled quantity, in the user's units, between which the determinant of the
            tangent changed its sign without a limit point.
        limit_points: values of the controlled quantity at the limit points of the path, in the user's units.
        next_limit_point: value of the controlled quantity at a limit point ahead, extrapolated from the slopes of the
            last states; None without one.
        flipped: number of nodes whose contact status (open, sticking, sliding) changed in the last iteration of the
            failed attempt.
        touching: number of nodes in contact in the last good state.
        condition: estimate of the 1-norm condition number of the tangent of the last good state.
        condition_before: the same estimate for the state 10 states earlier.
        findings: causes that the numbers prove ("serious") or make likely ("warning"), with advice.
        what: name of the controlled quantity.
        examined: examination of the body, which `picture` draws; None without a body.
    """

    reason: str
    step: int
    control: float
    aimed: float | None = None
    residual: dict[str, float] = field(default_factory=dict)
    worst: Place | None = None
    smallest_J: float | None = None
    at_J: Place | None = None
    failed_J: float | None = None
    at_failed_J: Place | None = None
    shape: float | None = None
    shortened: tuple[float, tuple[float, float], tuple[float, float]] | None = None
    I1: float | None = None
    limit: Place | None = None
    turned: tuple[tuple[float, float], ...] = ()
    limit_points: tuple[float, ...] = ()
    next_limit_point: float | None = None
    flipped: int | None = None
    touching: int = 0
    condition: float | None = None
    condition_before: float | None = None
    findings: tuple[Finding, ...] = ()
    what: str = "control"
    examined: Examined | None = field(default=None, repr=False)

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes of the failure as text, the strongest first."""
        return tuple(finding.text for finding in self.findings)

    @property
    def advice(self) -> tuple[str, ...]:
        """Advice on further attempts, as text."""
        return tuple(dict.fromkeys(finding.advice for finding in self.findings))

    def __str__(self) -> str:
        at = f", at {self.what} {self.aimed:.8g}" if self.aimed is not None else ""
        lines = [f"Step {self.step} failed after {self.what} {self.control:.8g}{at}: {self.reason}." if self.step else
                 f"No equilibrium was found at the start: {self.reason}."]
        lines += [f"Cause: {cause}." for cause in self.causes]
        if self.residual:
            lines += [] if self.causes else ["Cause: not clear from the numbers below."]
            parts = ", ".join(f"{k} {v:.3g}" if np.isfinite(v) else f"{k} not finite" for k, v in self.residual.items())
            at = f"; the largest force at {self.worst}" if self.worst else ""
            lines.append(f"Out-of-balance forces, relative to the support forces: {parts}{at}.")
        if self.smallest_J is not None:
            new = self.failed_J is not None and abs(self.failed_J - self.smallest_J) > 0.01 * abs(self.smallest_J)
            failed = f"; in the failed attempt {self.failed_J:.4g} at {self.at_failed_J}" if new else ""
            lines.append(f"Smallest J (deformed over original volume): {self.smallest_J:.4g} at {self.at_J}{failed}.")
        if self.condition is not None:
            lines.append(f"Condition number of the tangent: {self.condition:.2g}.")
        if self.touching or self.flipped:
            flips = (f"; {self.flipped} changed between open, sticking and sliding in the last iteration"
                     if self.flipped is not None else "")
            lines.append(f"Nodes in contact: {self.touching}{flips}.")
        lines += [f"Try {'; '.join(self.advice)}."] if self.advice else []
        return "\n".join(lines)

    def picture(self, file: Any) -> None:
        """Draw the last good state: the deformed elements coloured by J, and the tools.

        Marks show the points of smallest J, of the largest out-of-balance force, and nearest to a material's limit.

        Args:
            file: name of the image file; rank 0 writes it.

        Raises:
            InputError: the body is a membrane, or the run has no good state.
        """
        if self.examined is None:
            raise InputError("Diagnosis.picture: there is no body to draw")
        self.examined.draw(file, f"last good state: {self.what} {self.control:.5g}")


def diagnose(curve: Curve, states: Sequence[State], reason: str, attempt: Attempt | None = None, pace: str = "",
             target: float | None = None) -> Diagnosis:
    """Return the diagnosis of a failed run, from its last good state and its failed attempt; collective.

    reason: how the last attempt ended, as text. pace: progress of a run that used up its steps, as text. target: that
    of the controlled quantity, in the user's units.
    """
    equations, last = curve.problem, states[-1] if states else None
    facts: dict[str, Any] = {"reason": reason, "step": len(states),
                             "control": equations.description.shown(last.control)[1] if last else 0.0,
                             "what": equations.description.shown(0.0)[0]}
    examined = equations.description.examine(last, attempt)
    if examined is not None:
        facts |= examined.facts
    if attempt is not None:
        facts["aimed"] = equations.description.shown(attempt.control)[1]
    if last:
        facts |= _tangent_facts(curve, states)
    found = findings_at("failure", FailedRun(facts, equations, last, curve.fixed_control, target))
    if pace and not found:
        found.append(Finding("note", "steps", pace, "more max_steps"))
    return Diagnosis(**facts, findings=tuple(found), examined=examined)


def limits_passed(problem: Equations, states: Sequence[State]) -> str:
    """Return a sentence with the values at the limit points of a path, after a space; "" without limit points."""
    shown = [problem.description.shown(state.control) for state in states if state.kind == "limit point"]
    if not shown:
        return ""
    many = f"{len(shown)} limit points were" if shown[1:] else "A limit point was"
    return f" {many} passed, at {shown[0][0]} {', '.join(f'{value:.6g}' for _, value in shown)}."


def not_reached(record: Any, states: Sequence[State], targets: Any, why: str, diagnosis: Diagnosis,
                hint: str) -> ConvergenceError:
    """Return the error of a run that ends before its target, with its diagnosis.

    `states` are those since the stage began, and `hint` is used if the diagnosis has no advice.
    """
    best = int(np.argmin([abs(value - targets.until.value) for value in targets.values]))
    at = f", at {record.describe(states[best])}" * (states[best] is not record.last)
    return ConvergenceError(
        f"{f'Stage {record.stage!r}: ' * bool(record.stage)}{targets.until} was not reached: {why} The nearest"
        f" value was {targets.values[best]:.6g}{at}.{limits_passed(record.curve.problem, states)} The last good state"
        f" is {record.describe(record.last)}; it is kept in the error's `path`.{hint * (not diagnosis.advice)}",
        diagnosis=diagnosis)


def _tangent_facts(curve: Curve, states: Sequence[State]) -> dict[str, Any]:
    """Return {field of `Diagnosis`: value} for the fields that follow from the tangents of the states.

    These are condition numbers, sign changes of det dF/dx, and limit points. One ahead is extrapolated from the last
    two states, since (dcontrol/ds)^2 is linear in the control near it.
    """
    problem = curve.problem
    solver = DirectSolver(problem.matrix, problem.symmetric, determinant=True)

    def value(control: float) -> float:
        return problem.description.shown(control)[1]
    sign = determinant_sign(curve, solver)
    limits = tuple(value(s.control) for s in states if s.kind == "limit point")
    facts: dict[str, Any] = {"limit_points": limits}
    usable = [s for s in states[1 if problem.reference.singular else 0:] if s.kind != "limit point"]
    if sign(states[-1]):
        facts["condition"] = condition(problem.matrix, solver)
    if len(usable) > _LIMITS.states_before and sign(usable[-1 - _LIMITS.states_before]):
        facts["condition_before"] = condition(problem.matrix, solver)
    turned = branches(curve, states, sign)
    facts["turned"] = tuple((value(a.control), value(b.control)) for a, b in turned)
    solver.destroy()
    if len(states) > 2:
        a, b = states[-2:]
        slopes = [curve.unit_slope(s) for s in states]
        drop = slopes[-2]**2 - slopes[-1]**2              # slope^2 is proportional to the distance to the limit
        if drop > 0 and slopes[-2] * slopes[-1] > 0 and abs(slopes[-1]) < _LIMITS.slope_ratio * max(map(abs, slopes)):
            ahead = b.control + (b.control - a.control) * slopes[-1]**2 / drop
            facts["next_limit_point"] = value(ahead)
    return facts


@register("failure")
def _material_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield a finding if I1 at a point of the body is near the limit of its material (Gent, Arruda-Boyce)."""
    facts = run.facts
    if (facts.get("I1") or 0) > _LIMITS.material_ratio:
        yield Finding("serious", "material",
                      f"a material is stretched nearly to its limit: I1 - 3 is {100 * facts['I1']:.3g} % of the largest"
                      f" that it allows, at {facts['limit']}",
                      "a target that needs less stretch there, a material with a higher limit, or shorter steps"
                      " (StepControl(largest=...))")


@register("failure")
def _element_findings(run: FailedRun) -> Iterator[Finding]:
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
def _buckling_findings(run: FailedRun) -> Iterator[Finding]:
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
def _limit_point_findings(run: FailedRun) -> Iterator[Finding]:
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
def _branch_findings(run: FailedRun) -> Iterator[Finding]:
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
                      f" {_LIMITS.states_before}"
                      f" states; the body buckles here, or a contact point is about to slip off its tool",
                      "smaller elements; Contact(..., points=4), where there is contact")
    if facts.get("flipped"):
        yield Finding("warning", "contact",
                      f"contact does not settle: {facts['flipped']} nodes changed between open, sticking and sliding in"
                      f" the last iteration",
                      "smaller elements along the face in contact, or Contact with points=4, a wider ramp or a lower"
                      " penalty")


def _singular(facts: dict[str, Any]) -> bool:
    """Return True if the condition number grew by `Limits.singular_ratio` over `Limits.states_before` states."""
    before = facts.get("condition_before")
    return bool(before and (facts.get("condition") or 0) > _LIMITS.singular_ratio * before)


@register("failure")
def _round_off_findings(run: FailedRun) -> Iterator[Finding]:
    """Yield a finding if the condition number of the tangent leaves hardly any correct digits."""
    facts = run.facts
    if (facts.get("condition") or 0) > _LIMITS.round_off_condition and not _singular(facts):
        yield Finding("warning", "round-off",
                      f"round-off: the condition number of the tangent stiffness is {facts['condition']:.1g}, and"
                      f" hardly any of 16 digits are left",
                      "more elements along a film, or Membrane(); a larger eps, a lower contact penalty, or layers that"
                      " differ less in stiffness")
