"""Branch points between neighbouring states of a path, and steps that end on another piece of the path."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from .arc_length import Curve
from .linear import DirectSolver
from .newton import Failure
from .state import State

log = logging.getLogger("formingx")

ANOTHER_PATH = ("between %s and %s another path branches off (a bifurcation, not a limit point), and a real body may"
                " follow it: path.stability([0]) finds where, and its mode")
"""Format of a warning; its arguments are the descriptions of two neighbouring states."""


class ReversedOrientation(Failure):
    """Failure of a step between whose ends the orientation changes its sign; shorter steps show the reason."""


class OrientationCheck:
    """Check of one step that its end lies on the piece of path on which it began (Allgower and Georg 1990).

    `State.orientation` is constant along a smooth path, through limit points, too. It differs at both ends of a step
    over two limit points that are close together, which ends on a piece of path that comes back, and of a step over a
    branch point. So a step with different orientations is halved, down to the arc length `shortest`. If the shorter
    step ends on the cubic through both ends of the longer one with their tangents, the path is smooth between them:
    another path branches off, and the longer step is accepted.

    Attributes:
        max_distance: distance of a state from the cubic, over the distance of its ends, up to which the path is smooth.
            On smooth paths it was at most 0.009, with contact mostly 0.025, beside two limit points 0.041.
    """

    max_distance = 0.03

    def __init__(self, curve: Curve, shortest: float):
        self._curve, self._shortest, self._accepts = curve, shortest, False
        self._lengths: list[float] = []
        self._end: State | None = None                      # end of the last attempt with another orientation

    @property
    def halves(self) -> bool:
        """True while shorter lengths of the step are tried, since the orientation differed at its first end."""
        return bool(self._lengths) and not self._accepts

    def check(self, old: State, new: State) -> None:
        """Raise `ReversedOrientation` if the step from `old` to `new` should be repeated with another length."""
        smooth = old.kind in ("step", "target") or old.kind == "start" and not self._curve.problem.reference.singular
        if self._accepts or not smooth or not self._lengths and self._curve.distance(old, new) < 2 * self._shortest:
            return
        self._accepts = self._end is not None and self._distance(old, new, self._end) < self.max_distance
        if self._accepts or old.orientation * new.orientation < 0:
            self._end = new
            raise ReversedOrientation("a limit point or another path may lie within the step", [])

    def next_length(self, length: float) -> float:
        """Return the arc length of the next attempt: half the rejected one, or the first one if it is to be accepted.
        """
        self._lengths.append(length)
        self._accepts |= length < 2 * self._shortest
        return self._lengths[0] if self._accepts else length / 2

    def _distance(self, old: State, new: State, end: State) -> float:
        """Return the distance of a state from the cubic between the states `old` and `end`, over their distance."""
        low, high, position = 0.0, 1.0, self._curve.progress(old, new)
        for _ in range(40):                                 # bisection: the cubic in the plane of the step to `new`
            middle = (low + high) / 2
            x, control = self._curve.interpolate(old, end, middle)
            point = replace(new, x=x, control=control)
            low, high = (middle, high) if self._curve.progress(old, point) < position else (low, middle)
        return self._curve.distance(new, point) / self._curve.distance(old, end)


def branch_points(curve: Curve, states: Sequence[State]) -> list[tuple[State, State]]:
    """Return the pairs of neighbouring states (before, after) between which another path branches off; collective.

    The sign of the determinant follows from `State.orientation`. Without it, signs are computed at both ends of each
    piece between limit points, so an even number of sign changes is missed.
    """
    if _follow_from_states(curve, states):
        return _orientation_changes(curve, states)
    solver = DirectSolver(curve.problem.matrix, curve.problem.symmetric, determinant=True)
    found = branches(curve, states, determinant_sign(curve, solver))
    solver.destroy()
    return found


def branches(curve: Curve, states: Sequence[State], sign: Callable[[State], int]) -> list[tuple[State, State]]:
    """Return the pairs of neighbouring states with a branch point between them; none with history variables.

    `sign` factorises dF/dx at a state, and is called only if no state has an orientation.
    """
    if _follow_from_states(curve, states):
        return _orientation_changes(curve, states)
    return _sign_changes(states[1 if curve.problem.reference.singular else 0:], sign)


def _follow_from_states(curve: Curve, states: Sequence[State]) -> bool:
    """Return True if branch points need no dF/dx, by orientations or since history variables exclude them."""
    return curve.problem.history.path_dependent or any(state.orientation for state in states)


def warn_of_branches(record: Any, step: Sequence[State]) -> None:
    """Log a warning for each branch point between the neighbouring states of a step."""
    for before, after in _orientation_changes(record.curve, step):
        log.warning(ANOTHER_PATH, record.describe(before), record.describe(after))


def _orientation_changes(curve: Curve, states: Sequence[State]) -> list[tuple[State, State]]:
    """Return the pairs of neighbouring states with different `State.orientation`: a branch point lies between them.

    Left out are limit points, where the sign of the determinant is round-off, and pairs across a jump or the start of a
    stage. Where a run reverses its direction along the path, the sign is reversed. None with history variables.
    """
    found: list[tuple[State, State]] = []
    last: State | None = None
    for state in [] if curve.problem.history.path_dependent else states:
        if state.kind == "limit point":
            continue
        first = state.kind in ("start", "jump") or last is not None and last.setting != state.setting
        if last is not None and not first and last.orientation * state.orientation:
            sense = -1 if curve.progress(last, state) < 0 else 1
            if sense * last.orientation * state.orientation < 0:
                found.append((last, state))
        smooth = state.kind in ("step", "target") or state.kind == "start" and not curve.problem.reference.singular
        last = state if smooth else None
    return found


def determinant_sign(curve: Curve, solver: DirectSolver) -> Callable[[State], int]:
    """Return a function that gives the sign of det dF/dx at a state: 1, -1, or 0 if the factorisation fails."""
    problem = curve.problem

    def sign(state: State) -> int:
        with problem.state_context(state):
            problem.tangent(problem.x, state.control)
            return solver.sign() if solver.factorise() else 0
    return sign


def _sign_changes(states: Sequence[State], sign: Callable[[State], int]) -> list[tuple[State, State]]:
    """Return pairs of neighbouring states between which the determinant changes its sign without a limit point.

    Bisection finds at most one pair in each piece between limit points. sign: function that returns the sign of the
    determinant of the tangent at a state.
    """
    pieces: list[list[State]] = [[]]
    for state in states:
        if state.kind == "limit point":
            pieces.append([])
        else:
            pieces[-1].append(state)
    found = []
    for piece in pieces:
        low, high = 0, len(piece) - 1
        if high < 1:
            continue
        first, last = sign(piece[low]), sign(piece[high])
        if first * last >= 0:
            continue
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if sign(piece[middle]) * first > 0 else (low, middle)
        if piece[low].slope * piece[high].slope > 0:
            found.append((piece[low], piece[high]))
    return found
