"""How much contact one step may bring: a step that brings a whole region into contact decides by its length where it
sticks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .contact.approach import Approach

_SHORTEST = 1e-4
"""Lengths of steps (dimensionless) that are never too long for what comes into contact."""


class Way(NamedTuple):
    """A straight piece of a path: from (x, control) along (direction, slope), so long. Arrays: own part, shape (n,)."""

    x: np.ndarray
    control: float
    direction: np.ndarray
    slope: float
    length: float


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
        self._n, heat, self._all = problem.n_owned, problem.scene.heat, []
        for face in problem.contacts:
            timed = face.law.remembers or heat is not None and heat.conducts(face.contact)
            # where it does not matter when they come, the convergence of the contact limits them
            self._all.append(Approach(face, face.points_per_step * (1 if timed else 10)))

    @property
    def _present(self) -> list[Approach]:
        return [approach for approach in self._all if approach.face.present]

    def length(self, way: Way) -> float:
        """How long a step may be: up to where contact begins, or enough new nodes touch."""
        n = self._n
        return min([c.reach(way.x[:n], way.control, way.direction[:n], way.slope, way.length)
                    for c in self._present], default=way.length)

    def prepare(self, way: Way, ends: bool = False) -> None:
        """A step is about to be taken; `ends`: it is to end where something comes into contact, see `check`."""
        n = self._n
        for approach in self._present:
            approach.prepare(way.x[:n], way.control, way.direction[:n], way.slope, way.length, ends)

    def check(self, old: Any, new: Any, length: float, ends: bool = False) -> Cut | None:
        """Why the step between two states is too long, or None.

        `ends`: what comes into contact in it sticks or slides from where it touches, which a long step gets wrong.
        """
        n, contacts = self._n, self._present
        if any([c.grew_too_much(old.x[:n], old.control, new.x[:n], new.control) for c in contacts]):
            return Cut("too much came into contact in one step")
        if self.passes_through(old, new):
            return Cut("a tool would pass through the face that it touches")
        if ends and length > _SHORTEST:
            part = min([c.touches_by(new.x[:n], new.control, new.direction[:n], new.slope, length) for c in contacts],
                       default=1.0)
            if part < 1:
                return Cut("contact arriving", part)
        return None

    def let_go(self, new: Any) -> bool:
        """Let go of what pulls at a tool in space at a state that was found; False if nothing does."""
        return any([c.face.let_go(new.x[: self._n], new.control) for c in self._present])

    def passes_through(self, old: Any, new: Any) -> bool:
        """True if a contact point goes through its tool on the straight way from one state to another."""
        n = self._n
        return any([c.passes_through(old.x[:n], old.control, new.x[:n], new.control) for c in self._present])
