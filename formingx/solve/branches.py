"""Points between two states of a path at which another path branches off."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

from .arc_length import Curve
from .linear import DirectSolver
from .state import State

log = logging.getLogger("formingx")

ANOTHER_PATH = ("between %s and %s another path branches off (a bifurcation, not a limit point), and a real body may"
                " follow it: path.stability([0]) finds where, and its mode")
"""Warning, with the descriptions of two neighbouring states."""


def branch_points(curve: Curve, states: Sequence[State]) -> list[tuple[State, State]]:
    """Return the neighbours between which the determinant of the tangent changes its sign without a limit point.

    The signs are stored in the states (`State.orientation`). States at fixed control carry none: two
    factorisations for each stretch between limit points, which miss an even number of changes. With a history no other
    path begins: none. Collective.
    """
    problem = curve.problem
    solver = DirectSolver(problem.matrix, problem.symmetric, determinant=True)
    found = branches(curve, states, determinant_sign(curve, solver))
    solver.destroy()
    return found


def branches(curve: Curve, states: Sequence[State], sign: Callable[[State], int]) -> list[tuple[State, State]]:
    """Return the neighbours between which another path begins; `sign` is needed for states without orientation."""
    if any(state.orientation for state in states):
        return _turns(curve, states)
    if curve.problem.has_history:
        return []
    return _changes(states[1 if curve.problem.slack_at_rest else 0:], sign)


def warn_of_branches(record: Any, step: Sequence[State]) -> None:
    """Warn where another path branches off within a step: the state that it began with and those that it added."""
    for before, behind in _turns(record.curve, step):
        log.warning(ANOTHER_PATH, record.describe(before), record.describe(behind))


def _turns(curve: Curve, states: Sequence[State]) -> list[tuple[State, State]]:
    """Return neighbours whose orientations differ.

    Limit points are left out, since the sign there is round-off. So are pairs across a jump or the start of a stage.
    Where a run turned back at a state, the orientation turns with it.
    """
    found = []
    last: State | None = None
    for state in states:
        if state.kind == "limit point":
            continue
        first = state.kind in ("start", "jump") or last is not None and last.setting != state.setting
        if last is not None and not first and last.orientation * state.orientation:
            sense = -1 if curve.progress(last, state) < 0 else 1
            if sense * last.orientation * state.orientation < 0:
                found.append((last, state))
        smooth = state.kind in ("step", "target") or state.kind == "start" and not curve.problem.slack_at_rest
        last = state if smooth else None
    return found


def determinant_sign(curve: Curve, solver: DirectSolver) -> Callable[[State], int]:
    """Return the sign of the determinant of the tangent at a state, 0 if it has no factors."""
    problem = curve.problem

    def sign(state: State) -> int:
        with problem.state_context(state):
            problem.tangent(problem.x, state.control)
            return solver.sign() if solver.factorise() else 0
    return sign


def _changes(states: Sequence[State], sign: Callable[[State], int]) -> list[tuple[State, State]]:
    """Neighbours between which the sign of the determinant changed though the control has no limit point there."""
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
