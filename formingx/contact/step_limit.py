"""How much contact one step may bring: a step that brings a whole region into contact decides by its length where it
sticks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..extensions.contact_events.event_sequence import Foretold
from ..extensions.contact_events.reduced_contact import Response
from .approach import LIMITS, Approach


class Way(NamedTuple):
    """A straight piece of a path: from (x, control) along (direction, slope), so long. Arrays: own part, shape (n,).

    response: how the body gives way there, or None: then arrivals do not turn the path.
    """

    x: np.ndarray
    control: float
    direction: np.ndarray
    slope: float
    length: float
    response: Response | None = None


class Cut(NamedTuple):
    """Why a step is too long, and the part of it that will do; 0: not known."""

    why: str
    part: float = 0.0


class StepLimit:
    """What the contacts of a problem allow. For each step, in this order: `length`, `prepare`, `check`.

    Args:
        problem: the `Problem`.
    """

    def __init__(self, problem: Any):
        self._n, heat = problem.n_owned, problem.scene.heat
        self._all = [Approach(face, heat is not None and heat.conducts(face.contact)) for face in problem.contacts]
        self._foretold: tuple[Any, Foretold | None] = (None, None)      # ahead of a state, by its x
        if problem.scene.one_by_one:
            self.one_by_one()

    @property
    def _present(self) -> list[Approach]:
        return [approach for approach in self._all if approach.face.present]

    @property
    def foretells(self) -> bool:
        """True if a step may bring more points where it is told how the body gives way."""
        return any(c.foretells for c in self._present) and all(
            hasattr(c.face.law, "friction") and hasattr(c.face.law, "without") for c in self._present)

    def foretells_from(self, state: Any) -> bool:
        """True if arrivals ahead of a state are to be foretold: at rest, where nothing touches yet, not."""
        n = self._n
        return self.foretells and (state.kind != "start" or any(
            [c.touches(state.x[:n], state.control) for c in self._present]))

    def one_by_one(self) -> None:
        """Points are not foretold one after the other."""
        for approach in self._all:
            approach.foretold = approach.at_once

    def length(self, way: Way) -> float:
        """How long a step may be: up to where contact begins, or enough new nodes touch."""
        found = self._length_foretold(way) if way.response else None
        if found is not None:
            return found
        n, self._foretold = self._n, (way.x, None)
        return min([c.reach(way.x[:n], way.control, way.direction[:n], way.slope, way.length)
                    for c in self._present], default=way.length)

    def _length_foretold(self, way: Way) -> float | None:
        """Up to where enough nodes have touched one after the other, none through a tool; None: that cannot be told."""
        found, ahead = self._enough_foretold(way), self._foretold[1]
        while found is not None and ahead is not None and found > LIMITS.shortest and any(
                [c.cuts(a, b) for c, a, b in zip(self._present, ahead.at(0.0), ahead.at(found))]):
            found /= 2
        return found

    def _enough_foretold(self, way: Way) -> float | None:
        """Up to where enough nodes have touched one after the other; None: that cannot be told."""
        n, present = self._n, self._present
        if self._foretold[0] is not way.x:
            assert way.response is not None
            self._foretold = way.x, Foretold([c.face for c in present], n, way.x, way.control, way.direction,
                                             way.slope, way.response, max(c.foretold for c in present))
        ahead = self._foretold[1]
        if ahead is None:
            return None
        allowed = [c.foretold if touching > 1 else 1 for c, touching in zip(present, ahead.touching)]
        for k in range(2 * sum(allowed)):
            arrival = ahead.next(k, way.length)
            if arrival is None:
                break
            allowed[arrival.face] -= arrival.time > LIMITS.as_good * way.length
            if not allowed[arrival.face]:
                return min(LIMITS.beyond * arrival.time, way.length)
        else:
            return None
        if ahead.stops or ahead.ends <= LIMITS.as_good * way.length:
            return None
        return min(LIMITS.beyond * ahead.ends, way.length)

    def prepare(self, way: Way, ends: bool = False) -> tuple[np.ndarray, float] | None:
        """A step is about to be taken; `ends`: it is to end where something comes into contact, see `check`.

        What arrivals that are foretold add to (x, control) at its end, own part; None: nothing.
        """
        n, ahead = self._n, self._ahead(way)
        if ahead is not None:
            found: list[tuple] = list(zip(*ahead.places(way.length), strict=True))
        else:
            found = [(*c.along(way.x[:n], way.control, way.direction[:n], way.slope, way.length), None)
                     for c in self._present]
        for approach, (times, places, guessed) in zip(self._present, found):
            approach.prepare(times, places, guessed, way.length, ends)
        return None if ahead is None else ahead.bend(way.length)

    def _ahead(self, way: Way) -> Foretold | None:
        """What was foretold of this way by `length`."""
        return self._foretold[1] if self._foretold[0] is way.x else None

    def check(self, old: Any, new: Any, length: float, ends: bool = False) -> Cut | None:
        """Why the step between two states is too long, or None.

        `ends`: what comes into contact in it sticks or slides from where it touches, which a long step gets wrong.
        """
        n, contacts = self._n, self._present
        if any([c.grew_too_much(old.x[:n], old.control, new.x[:n], new.control) for c in contacts]):
            return Cut("too many points came into contact in one step")
        if self.passes_through(old, new):
            return Cut("a tool would pass through the face that it touches")
        if ends and length > LIMITS.shortest:
            part = min([c.touches_by(new.x[:n], new.control, new.direction[:n], new.slope, length) for c in contacts],
                       default=1.0)
            if part < 1:
                return Cut("contact arriving", part)
        return None

    def let_go(self, new: Any) -> bool:
        """Let go of what pulls at a tool in space at a state that was found; False if nothing does."""
        return any([c.face.let_go(new.x[: self._n], new.control) for c in self._present])

    def hold_late(self, new: Any) -> bool:
        """Hold what came into a tool in space in the step to a state that was found; False if nothing did."""
        return any([c.face.hold_late(new.x[: self._n], new.control, LIMITS.near * c.face.thickness)
                    for c in self._present])

    def passes_through(self, old: Any, new: Any) -> bool:
        """True if a contact point goes through its tool on the straight way from one state to another."""
        n = self._n
        return any([c.passes_through(old.x[:n], old.control, new.x[:n], new.control) for c in self._present])
