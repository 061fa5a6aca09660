"""Diagnosis of a failed run: numbers, probable causes, advice, and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import ConvergenceError, InputError
from ..findings import Finding, findings_at
from ..mesh.triangles import Place
from .arc_length import Curve
from .branches import branches, determinant_sign
from .equations import Attempt, Equations, Examined
from .linear import DirectSolver, condition
from .state import State

STATES_BEFORE = 10
"""Number of states between the last good state and the earlier state with which its condition number is compared."""

_SLOPE_RATIO = 0.3
"""Derivative of the control by arc length, over the largest one on the path, below which a limit point is ahead."""


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
    if len(usable) > STATES_BEFORE and sign(usable[-1 - STATES_BEFORE]):
        facts["condition_before"] = condition(problem.matrix, solver)
    turned = branches(curve, states, sign)
    facts["turned"] = tuple((value(a.control), value(b.control)) for a, b in turned)
    solver.destroy()
    if len(states) > 2:
        a, b = states[-2:]
        slopes = [curve.unit_slope(s) for s in states]
        drop = slopes[-2]**2 - slopes[-1]**2              # slope^2 is proportional to the distance to the limit
        if drop > 0 and slopes[-2] * slopes[-1] > 0 and abs(slopes[-1]) < _SLOPE_RATIO * max(map(abs, slopes)):
            ahead = b.control + (b.control - a.control) * slopes[-1]**2 / drop
            facts["next_limit_point"] = value(ahead)
    return facts
