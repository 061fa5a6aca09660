"""Branch points between neighbouring states of a path, and steps that end on another piece of the path."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

from .arc_length import Curve
from .equations import Equations
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
    over two limit points that are close together, which ends on a piece of path that comes back. A step half as long,
    or shorter, does not pass them. If the orientation differs at the end of each shorter step as well, another path
    branches off, and the first step is accepted.

    Args:
        problem: the equations.

    Attributes:
        max_halvings: number of halvings after which the first length of the step is restored.
    """

    max_halvings = 4

    def __init__(self, problem: Equations):
        self._problem, self._lengths = problem, list[float]()

    @property
    def halves(self) -> bool:
        """True while shorter lengths of the step are tried, since the orientation was reversed at its first end."""
        return 0 < len(self._lengths) <= self.max_halvings

    def check(self, old: State, new: State) -> None:
        """Raise `ReversedOrientation` if a step between two states should be repeated with another length.

        Args:
            old: state at the start of the step.
            new: state at its end.
        """
        smooth = old.kind in ("step", "target") or old.kind == "start" and not self._problem.singular_unloaded
        if smooth and old.orientation * new.orientation < 0 and len(self._lengths) <= self.max_halvings:
            raise ReversedOrientation("a limit point or another path may lie within the step", [])

    def next_length(self, length: float) -> float:
        """Return the length of the next attempt of the step.

        Args:
            length: arc length of the rejected attempt, dimensionless.

        Returns:
            Half the length. After `max_halvings` halvings it is the length of the first attempt.
        """
        self._lengths.append(length)
        return length / 2 if self.halves else self._lengths[0]


def branch_points(curve: Curve, states: Sequence[State]) -> list[tuple[State, State]]:
    """Return the pairs of neighbouring states between which another path branches off; collective.

    Between such states the determinant of the tangent changes its sign, and the control has no limit point. The sign at
    a state follows from `State.orientation`. States solved for at fixed control have no orientation. Then the signs at
    both ends of each piece between limit points are computed, so an even number of sign changes is missed. For a
    problem with history variables the list is empty.

    Args:
        curve: solver of the path.
        states: the states of the path, in order.

    Returns:
        Pairs (state before the branch point, state after it).
    """
    if _follow_from_states(curve, states):
        return _orientation_changes(curve, states)
    solver = DirectSolver(curve.problem.matrix, curve.problem.symmetric, determinant=True)
    found = branches(curve, states, determinant_sign(curve, solver))
    solver.destroy()
    return found


def branches(curve: Curve, states: Sequence[State], sign: Callable[[State], int]) -> list[tuple[State, State]]:
    """Return the pairs of neighbouring states between which another path branches off.

    Between them the determinant of dF/dx changes its sign, and the control has no limit point. For a problem with
    history variables the list is empty.

    Args:
        curve: solver of the path.
        states: the states of the path, in order.
        sign: function that factorises dF/dx at a state and returns the sign of its determinant. It is called only if no
            state stores this sign (`State.orientation`), at few states.

    Returns:
        Pairs (state before the branch point, state after it).
    """
    if _follow_from_states(curve, states):
        return _orientation_changes(curve, states)
    return _sign_changes(states[1 if curve.problem.singular_unloaded else 0:], sign)


def _follow_from_states(curve: Curve, states: Sequence[State]) -> bool:
    """Return True if the data of the states give the branch points, so no dF/dx has to be factorised for them.

    This is so if a state has a `State.orientation`, from which the sign of the determinant of dF/dx follows. It is also
    so for a problem with history variables, where no branch points are sought.
    """
    return curve.problem.has_history or any(state.orientation for state in states)


def warn_of_branches(record: Any, step: Sequence[State]) -> None:
    """Log a warning for each branch point within a step.

    Args:
        record: record of the run (`Record`).
        step: the state from which the step began, and the states that the step added.
    """
    for before, after in _orientation_changes(record.curve, step):
        log.warning(ANOTHER_PATH, record.describe(before), record.describe(after))


def _orientation_changes(curve: Curve, states: Sequence[State]) -> list[tuple[State, State]]:
    """Return the pairs of neighbouring states with different `State.orientation`: a branch point lies between them.

    Left out are limit points, where the sign of the determinant is round-off, and pairs across a jump or the start of a
    stage. The sign of the orientation is reversed where a run reverses its direction along the path. For a problem with
    history variables the list is empty.
    """
    found: list[tuple[State, State]] = []
    last: State | None = None
    for state in [] if curve.problem.has_history else states:
        if state.kind == "limit point":
            continue
        first = state.kind in ("start", "jump") or last is not None and last.setting != state.setting
        if last is not None and not first and last.orientation * state.orientation:
            sense = -1 if curve.progress(last, state) < 0 else 1
            if sense * last.orientation * state.orientation < 0:
                found.append((last, state))
        smooth = state.kind in ("step", "target") or state.kind == "start" and not curve.problem.singular_unloaded
        last = state if smooth else None
    return found


def determinant_sign(curve: Curve, solver: DirectSolver) -> Callable[[State], int]:
    """Return a function that gives the sign of the determinant of the tangent at a state.

    Args:
        curve: solver of the path.
        solver: solver that factorises the tangent of the problem and computes its determinant.

    Returns:
        Function of a `State` that returns 1 or -1, or 0 if the tangent could not be factorised.
    """
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
