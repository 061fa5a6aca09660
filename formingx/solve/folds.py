"""What is done where what is driven has a limit point: follow the path back, or let the body snap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .arc_length import Curve
from .equations import Equations
from .state import State


def usual(problem: Equations, falls: bool) -> str:
    """What is done at folds: "follow", "jump", or "blow", which is to follow while the volume of the air grows.

    Time goes one way. With a history so does whatever is driven, for to follow a fold would be to let it go back; but
    where a pressure that is put on has its maximum it is the volume of the air that goes on growing, unless it has its
    maximum there, too. The same holds for a pressure on a body in contact, with a history or without: where contact
    changes a path may end. `falls`: what is driven is let off.
    """
    if problem.drives == "time":
        return "jump"
    by_pressure = problem.drives == "pressure"
    if not (problem.has_history or problem.has_kinks and by_pressure):
        return "follow"
    return "blow" if by_pressure and not falls else "jump"


def snaps(curve: Curve, old: State, at_fold: str, sense: float) -> bool:
    """True if the body snaps from a state: its path leads back. sense: 1 or -1, which way the control goes at first.

    (Right behind the maximum of a pressure that of the volume may follow.)
    """
    if at_fold not in ("jump", "blow") or old.kind != "limit point" and old.slope * sense >= 0:
        return False
    return at_fold == "jump" or curve.work_ahead(old) * sense < 0


def was_passed(curve: Curve, passed: Sequence[State], old: State, new: State) -> bool:
    """True if a state found from `old` lies on a piece of the path passed earlier, to which it never comes back.

    (After a jump it may: then the body is another.)
    """
    near = 0.1 * curve.distance(old, new)
    states = [] if old.kind == "jump" else passed[::-1]
    for b, a in zip(states, states[1:]):
        if b.kind == "jump":
            break
        if (a.control - new.control) * (b.control - new.control) < 0:
            x, control = curve.interpolate(a, b, (new.control - a.control) / (b.control - a.control))
            if curve.distance(new, replace(new, x=x, control=control)) < near:
                return True
    return False
