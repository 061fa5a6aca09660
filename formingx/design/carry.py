"""Neighbours carried along a run, from its first state to its last.

Without a history the last state depends on its own equations alone, so they are solved for there and nowhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..measures.targets import Target
from ..results.path import Path
from ..solve.newton import Failure
from .neighbours import Neighbour, settle


def carry(path: Path, end: Any, neighbours: Sequence[Neighbour]) -> None:
    """Solve for all neighbours beside the last state of a run.

    end: the `Target` of a run with one control, or the stages of a process.

    Raises:
        Failure: the run has no derivative, in words.
    """
    if path.problem.has_history or not isinstance(end, Target):
        raise Failure("histories are not carried yet", [])
    last, problem = path.last, path.problem
    if last.met is None or last.met[:2] != end[:2]:
        raise Failure(f"it did not end at its target, {end}", [])
    for one in neighbours:
        one.x, one.control = last.x.copy(), last.control
    with problem.at(last):
        settle(path.record.curve, last, neighbours, end.bind(problem).equation(end.value),
               [one.end.bind(one.problem).equation(one.end.value) for one in neighbours])
