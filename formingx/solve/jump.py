"""From where a path ends, over states that are none, to the next one: a body in a viscous medium at a fixed control.

Where a process drives one way, a fold or a kink without continuation is where the body snaps. The next equilibrium is
where it comes to rest when moving costs: F(x) + eta M (x - x_k) = 0, M the mass of unit density, lumped, from one x_k to the next,
each with its own history. eta falls where the body moves smoothly and grows where it does not; what it does on the way is work lost.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .newton import UNLOADED, BorderedNewton, Failure, Tolerances

AHEAD = 1e-6
"""By how much the (dimensionless) control goes on in a jump."""

_FIRST, _FALLS, _GROWS, _LARGEST = 1e3, 0.3, 10.0, 1e10
_AT_REST = 1e-3
"""Forces (over the support forces) left over, below which the end of a jump is looked for."""


class Jump(NamedTuple):
    """What a jump did.

    dissipated: work of the viscous forces, dimensionless (times stress and volume); moved: mean distance, dimensionless;
    iterations: of Newton's method; solves: viscous steps that it took.
    """

    dissipated: float
    moved: float
    iterations: int
    solves: int


class _Damped:
    """A problem with viscous forces eta M (x - origin)."""

    def __init__(self, problem: Any):
        self._problem = problem
        self._drag, self._work = problem.x.duplicate(), problem.x.duplicate()
        self._ones = problem.x.duplicate()
        self._ones.set(1.0)
        problem.metric_times(self._ones, self._ones)
        values = self._ones.array_w
        values[problem._held] = 0
        self.eta, self.origin = 0.0, np.zeros(problem.x.getLocalSize())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._problem, name)

    def residual(self, x, control, out):
        self._problem.residual(x, control, out)
        if self.eta:
            out.array_w[:] += self.eta * self._ones.array_r * (x.array_r - self.origin)

    def tangent(self, x, control, ahead=False):
        A = self._problem.tangent(x, control, ahead)
        if self.eta:
            self._drag.array_w[:] = self.eta * self._ones.array_r
            A.setDiagonal(self._drag, addv=True)
        return A

    def destroy(self):
        for v in (self._drag, self._work, self._ones):
            v.destroy()


def jump(branch: Any, old: Any, by: float, say=lambda *a: None) -> tuple[np.ndarray, float, list, Jump]:
    problem = branch.problem
    damped = _Damped(problem)
    newton = BorderedNewton(damped, Tolerances(1e-8, 1e-6), branch.norm)
    kept = problem.memory
    target = old.control + by
    x, origin, eta = problem.x.duplicate(), old.x + (by / old.slope * old.direction if old.kind != 'limit point' else 0.0), _FIRST
    lost, iterations, solves = 0.0, 0, 0

    def fixed(x, control, gradient):
        gradient.set(0)
        return control - target, 1.0

    def attempt(eta):
        nonlocal iterations
        x.array_w[:] = origin
        damped.eta, damped.origin = eta, origin
        try:
            _, history = newton.correct(x, target, fixed)
        except Failure as failure:
            iterations += len(failure.history)
            branch.iterations += len(failure.history)
            say("eta %.1e failed %d: %s" % (eta, len(failure.history), failure.reason))
            return None
        iterations += len(history) - 1
        branch.iterations += len(history) - 1
        if problem.folded(x, target):
            say("folded")
            return None
        return history

    try:
        rest = 0.0
        while eta < _LARGEST and solves < 60:
            if rest < _AT_REST and solves:
                history = attempt(0.0)
                if history is not None:
                    say("end: its %d moved %.2e lost %.2e" % (len(history) - 1, branch.norm_of(x.array_r - old.x), lost))
                    found = Jump(lost, branch.norm_of(x.array_r - old.x), iterations, solves)
                    return x.array_r.copy(), target, history, found
                rest = np.inf if solves else 0.0
            history = attempt(eta)
            if history is None:
                eta *= _GROWS
                continue
            solves += 1
            by = x.array_r - origin
            drag = eta * damped._ones.array_r * by
            lost += float(drag @ by)
            rest = float(np.linalg.norm(drag)) / (problem.force_scale + UNLOADED)
            say("eta %.1e its %d moved %.2e rest %.2e lost %.2e" % (eta, len(history) - 1, branch.norm_of(by), rest, lost))
            origin = x.array_r.copy()
            problem.advance(origin, target)
            eta *= _FALLS
        raise Failure("no next state was found", [])
    except Failure:
        problem.advance(old.x, old.control)
        problem.memory = kept
        raise
    finally:
        newton.destroy()
        damped.destroy()
        x.destroy()
