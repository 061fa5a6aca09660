"""The next state where there is none to go on to: a body that moves against a viscous stress, at a fixed control.

Where a process drives one way, a body snaps at a fold of its path, and at a kink beyond which there is no state nearby.
It comes to rest in the next equilibrium. The way there is followed with vanishing viscosity,

    F(x) + eta V (x - x_k) = 0,   V that of a viscous stress in proportion to dF, as in a Kelvin-Voigt solid,

from one x_k to the next, the histories taken up at each. (So a wave as short as an element is held no less, and a long
one no more, than the body itself holds it; in a viscous medium, V = 1, what lets go at an edge wants 1e4 times the
viscosity that lets the body come to rest.) eta falls where the body moves smoothly and grows where it does not; where
it is 0 the body is at rest. What is out of balance on the way does work that is lost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..discrete.step_limit import Way
from .newton import UNLOADED, BorderedNewton, Failure, Iteration, Tolerances, fixed
from .state import State

AHEAD = 1e-6
"""By how much the (dimensionless) control goes on in a jump from a limit point."""

_FIRST, _LARGEST, _LEAST, _FALLS, _GROWS = 1.0, (1e5, 1e9), 1e-9, 0.3, (10.0, 3.0)
"""Of eta (over the shear modulus): at first, at most (before and after the body has begun to move), at least; factors
after a solution that took at most `_FEW` iterations, and after none was found (before and after).

It begins low and grows to the least that gives a solution: where a state follows after all, only a little viscosity
finds it; much would hold the body back while contact lets go, and what slips meanwhile changes where it ends. (At
the brink of release two states may be near, and which is found still depends on eta: tests/test_jumps.py.)"""

_LONGEST_WAIT = 8
"""Solutions at most for which eta stays after a failure: twice as many from one failure to the next, and half as many
again where eta has fallen and a solution was found."""

_FEW, _TOLERANCES = 6, Tolerances(1e-8, 1e-6, settling=8)
"""Of a viscous solution. (Where contact does not settle soon more viscosity is cheaper than more iterations.)"""

_FAR, _SHARE, _AGAIN = (3e-4, 0.1), 0.1, 3.0
"""How far (dimensionless, in the mean) the body is to move in a viscous solution: within bounds, a share of its way up
to there; how many times as far the first may move it, or it is made again with more viscosity. What is lost depends on
it and, with friction, where it ends (tests/test_jumps.py)."""

MOST, _TOO_FAR = 1000, 10.0
"""Viscous solutions, and a distance (dimensionless, in the mean), after which the body counts as never coming to rest.
(Where a sheet is drawn over an edge point by point a jump takes hundreds of short ones.)"""

_NEAR_REST = 1e-3
"""Viscous forces (over the support forces) below which the state at rest is looked for."""

_AT_REST = 1e-10
"""Viscous forces (over the support forces) below which the body rests, though where a point is at a kink of its law of
friction the iteration without them may go to and fro."""


class NoEquilibrium(Failure):
    """A body that moved on came to rest nowhere."""


class _Viscous:
    """A problem with viscosity: F + eta V (x - origin), but for unknowns that are held."""

    def __init__(self, problem: Any):
        self._problem, self._viscosity = problem, problem.viscosity()
        self.eta, self.origin = 0.0, np.zeros(0)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._problem, name)

    def residual(self, x: Any, control: float, out: Any) -> None:
        """out = F(x, control) + eta V (x - origin)."""
        self._problem.residual(x, control, out)
        out.array_w += self.drag(x.array_r)

    def tangent(self, x: Any, control: float, ahead: bool = False) -> Any:
        """Its derivative by x."""
        matrix = self._problem.tangent(x, control, ahead)
        self._viscosity.add_to(matrix, self.eta)
        return matrix

    def drag(self, x: np.ndarray) -> np.ndarray:
        """eta V (x - origin), own part."""
        return self._viscosity.forces(x - self.origin, self.eta)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._viscosity.destroy()


class _Way:
    """From a state to the next: where the body is on it, and what was lost."""

    def __init__(self, curve: Any, old: State, control: float):
        self.curve, self.problem, self._old, self.control = curve, curve.problem, old, control
        self.viscous = _Viscous(curve.problem)
        self._newton = BorderedNewton(self.viscous, _TOLERANCES, curve.norm)
        self._x, self._drag = curve.problem.x.duplicate(), np.zeros(len(old.x))
        self.at, self.lost, self.solved = old, 0.0, 0
        self.rest, self.near = np.inf, _NEAR_REST           # what is out of balance; little enough to look for rest
        self.settles = False
        self._wait, self._next_wait = 0, 1                  # solutions before eta may fall; after the next failure

    def move(self, origin: np.ndarray, eta: float) -> float:
        """One viscous solution from `origin`; the factor by which eta may change then."""
        viscous = self.viscous
        viscous.eta, viscous.origin = eta, origin
        self._x.array_w[:] = origin
        try:
            _, history = self._newton.correct(self._x, self.control, fixed(self.control), self.at)
        except Failure as failure:
            self.curve.spend(len(failure.history))
            return self._hold_back()
        self.curve.spend(len(history) - 1)
        x, limit = self._x.array_r.copy(), self.problem.limit
        last, new = self.at, replace(self.at, x=x, control=self.control)
        if self.problem.folded(self._x, self.control) or limit and limit.passes_through(last, new):
            return self._hold_back()
        drag = viscous.drag(x)
        most = np.clip(_SHARE * self.curve.moved(self._old, last), *_FAR)
        far = self.curve.moved(replace(last, x=origin), new) / most
        if not self.solved and far > _AGAIN:
            return self._hold_back(far)
        before, self.rest = self.rest, np.sqrt(self._sum(drag * drag)) / (self.problem.force_scale + UNLOADED)
        self.settles = self.rest < min(self.near, before)
        self._lose(origin, x, drag)                         # from where the body was, or was foretold to be
        self._drag, self.at, by = drag, new, x - last.x
        self.problem.advance(x, self.control)
        if limit:
            limit.prepare(Way(x, self.control, by, 0.0, 1.0))
        self.solved += 1
        if self._wait or len(history) - 1 > _FEW:
            self._wait = max(self._wait - 1, 0)
            return max(1.0, far)
        self._next_wait = max(self._next_wait // 2, 1)
        return max(_FALLS, far)

    def _hold_back(self, grows: float = 0.0) -> float:
        """No solution, or one too far off: the factor by which eta grows; it does not fall right after the next one."""
        self._wait = self._next_wait
        self._next_wait = min(2 * self._next_wait, _LONGEST_WAIT)
        return grows or _GROWS[self.solved > 0]

    def end(self) -> State | None:
        """The state at rest, if there is one near; raises `Failure` if the body, without a history, rests at none."""
        try:
            with self.curve.newton.in_a_hurry(True):        # if it fails the body moves on, with viscosity
                state = self.curve.solve(self.at.x, self.control, fixed(self.control), "jump", self.at)
        except Failure:
            if self.rest > _AT_REST:
                self.settles, self.near = False, 0.3 * self.rest
                return None
            if not self.problem.has_history:                # another branch starts here
                raise
            state = self.curve.resume(self.at.x, self.control)
            state.kind, state.history = "jump", [Iteration(self.rest, 0.0, 0.0)]
        self._lose(self.at.x, state.x, np.zeros(len(state.x)))
        energy, length = self.problem.units
        state.jump = {"dissipated": self.lost * energy, "moved": self.curve.moved(self._old, state) * length}
        return state

    def _lose(self, a: np.ndarray, x: np.ndarray, drag: np.ndarray) -> None:
        """Work of what is out of balance from a to x (trapezoidal rule: half way there the chord cuts into tools).

        A force at a that has turned before x is none that the body moved by: viscous forces do no negative work.
        """
        by = x - a
        self.lost += 0.5 * (max(self._sum(self._drag * by), 0.0) + self._sum(drag * by))

    def _sum(self, values: np.ndarray) -> float:
        return float(self.problem.comm.allreduce(values.sum()))

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._newton.destroy()
        self.viscous.destroy()
        self._x.destroy()


def jump(curve: Any, old: State, by: float, ahead: bool, solutions: int = MOST,
         told: Callable[[], None] = lambda: None) -> State:
    """The state that the body comes to from `old` when the control goes on; of kind "jump".

    Args:
        curve: the `Curve`. by: change of the control, dimensionless; its sign is the way that the process drives.
        ahead: start where the tangent leads to, not where the body is. solutions: viscous ones, at most; `told` is
            called before each.

    Raises:
        Failure: none was found, `NoEquilibrium` if the body comes to rest nowhere. The problem's histories are then
            those of `old`.
    """
    problem, kept = curve.problem, curve.problem.memory
    way = _Way(curve, old, old.control + by)
    origin = old.x + by / old.slope * old.direction if ahead else old.x
    eta = _FIRST
    try:
        while (way.solved < solutions and _LEAST < eta < _LARGEST[way.solved > 0]
               and curve.moved(old, way.at) < _TOO_FAR):
            told()
            state = way.end() if way.settles else None
            if state is not None:
                if state.slope * by < 0:
                    state.direction, state.slope = -state.direction, -state.slope
                return state
            eta *= way.move(way.at.x if way.solved else origin, eta)
        where = "it comes to rest nowhere" if way.solved else "none is found from here, however viscous the body is"
        raise (NoEquilibrium if way.solved else Failure)(f"no state follows that the body could snap to: {where}", [])
    except Failure:
        problem.memory = kept
        raise
    finally:
        way.destroy()
