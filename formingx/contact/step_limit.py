"""Limits to the number of points that come into contact in one step.

If a whole region comes into contact in one step, its sticking positions depend on the length of that step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from ..forms.history import Start
from .approach import LIMITS, Approach


class EventPrediction(Protocol):
    """The contact events ahead of a state and the path that they bend (`formingx.extensions.contact_events`)."""

    def step_length(self, length: float) -> float | None:
        """Return the length of a step, at most `length`; None: the events are unknown, from now on."""

    def closures(self, length: float) -> list[tuple] | None:
        """Return for each contact the first three arguments of `Approach.prepare`; None: the events are unknown."""

    def bend(self, length: float) -> tuple[np.ndarray, float] | None:
        """Return the change of (x, control) at a length along the tangent by the events, locally owned entries;
        None: zero."""


class State(Start, Protocol):
    """An accepted state: the unit tangent (direction, slope) of its path; kind: "start" of a path, or another."""

    direction: np.ndarray
    slope: float
    kind: str


class Curve(Protocol):
    """A path with the LU factors of its tangents."""

    def factorise_ahead(self, state: State) -> bool:
        """Factorise the tangent ahead of an accepted state, unless it is at hand; False: it is singular."""


class EventPredictor(Protocol):
    """Predicts the contact events of the contacts of a `StepLimit`."""

    @property
    def active(self) -> bool:
        """True if events are predicted for this body."""

    def predict(self, curve: Curve, state: State) -> EventPrediction | None:
        """Return the events ahead of an accepted state, or None."""


class Way(NamedTuple):
    """A straight piece of a path: from (x, control) along (direction, slope), with an arc length.

    Arrays are locally owned entries, shape (n,). events: predicted contact events ahead of (x, control), or None.
    """

    x: np.ndarray
    control: float
    direction: np.ndarray
    slope: float
    length: float
    events: EventPrediction | None = None


class Cut(NamedTuple):
    """Reason for which a step is too long, and the admissible part of it; 0: not known."""

    why: str
    part: float = 0.0


class StepLimit:
    """Limits that the contacts of a problem set to each step, in this order: `length`, `prepare`, `check`.

    Args:
        problem: the `Problem`.
    """

    def __init__(self, problem: Any):
        self._n, heat = problem.n_owned, problem.scene.heat
        self._all = [Approach(face, heat is not None and heat.conducts(face.contact)) for face in problem.contacts]
        self.several = not problem.scene.one_by_one
        make = type(self).make_predictor
        self._predictor = make(self) if make else None

    make_predictor: ClassVar[Callable[[StepLimit], EventPredictor] | None] = None
    """Function that makes the predictor of a limit, set by an extension. Without it, steps end where sticking points
    touch."""

    @property
    def present(self) -> list[Approach]:
        """Return the contacts that take part now."""
        return [approach for approach in self._all if approach.face.present]

    @property
    def only_sticks(self) -> bool:
        """True if all contacts with friction stick: then sliding never ends a path, and short steps go on."""
        coarse = [approach.face for approach in self.present if approach.face.law.has_friction]
        return bool(coarse) and all(face.contact.sticks and not face.contact.lagged for face in coarse)

    @property
    def predicts_events(self) -> bool:
        """True if contact events ahead of a state are predicted."""
        return self._predictor is not None and self._predictor.active

    def one_by_one(self) -> None:
        """End steps where each point touches: predict no contact events."""
        self.several = False

    def predict(self, curve: Curve, state: State) -> EventPrediction | None:
        """Return the contact events ahead of an accepted state, or None."""
        return self._predictor.predict(curve, state) if self._predictor else None

    def length(self, way: Way) -> float:
        """Return the admissible length of a step: up to where contact begins, or enough new nodes touch."""
        found = way.events.step_length(way.length) if way.events else None
        if found is not None:
            return found
        n = self._n
        return min([c.reach(way.x[:n], way.control, way.direction[:n], way.slope, way.length)
                    for c in self.present], default=way.length)

    def prepare(self, way: Way, ends: bool = False) -> tuple[np.ndarray, float] | None:
        """Prepare all contacts for the next step; return the deviation from the tangent due to predicted events.

        Args:
            way: the step.
            ends: True if the step ends at the first gap closure, see `check`.

        Returns:
            Change of (x, control) at the end of the step, locally owned entries; None: zero.
        """
        n, found = self._n, way.events.closures(way.length) if way.events else None
        for k, approach in enumerate(self.present):
            if approach.face.contact.lagged and not (ends and approach.lags):
                continue                                    # such a contact uses no predicted gap closures
            times, places, guessed = found[k] if found else (*approach.along(
                way.x[:n], way.control, way.direction[:n], way.slope, way.length), None)
            approach.prepare(times, places, guessed, way.length, ends)
        return way.events.bend(way.length) if way.events and found else None

    def check(self, old: Any, new: Any, length: float, ends: bool = False) -> Cut | None:
        """Return the reason for which the step between two states is too long, or None.

        `ends`: points that come into contact in it stick or slide from where they touch, which a long step gets wrong.
        """
        n, contacts = self._n, self.present
        if any([c.grew_too_much(old.x[:n], old.control, new.x[:n], new.control) for c in contacts]):
            return Cut("too many points came into contact in one step")
        if self.passes_through(old, new):
            return Cut("a tool would pass through the face that it touches")
        change = max([c.change_of_pressure(new.x[:n], new.control) for c in contacts], default=0.0)
        if change > LIMITS.inaccurate * LIMITS.lag and length > LIMITS.shortest:
            return Cut("the pressure that limits friction changes", LIMITS.lag / change)
        if length > LIMITS.mixed and any([c.opens_and_closes(new.x[:n], new.control) for c in contacts]):
            return Cut("points lift off while others come into contact", 0.5)
        if ends and length > LIMITS.shortest:
            part = min([c.touches_by(new.x[:n], new.control, new.direction[:n], new.slope, length) for c in contacts],
                       default=1.0)
            if part < 1:
                return Cut("contact arriving", part)
        return None

    @property
    def settling(self) -> int:
        """Iterations in which friction in three dimensions settles, however short the step."""
        return LIMITS.settling if any(c.lags for c in self.present) else 0

    def let_go(self, new: Any) -> bool:
        """Open the contact of points in tension at tools in three dimensions, at a converged state.

        Returns:
            True if any point opened.
        """
        return any([c.face.let_go(new.x[: self._n], new.control) for c in self.present])

    def hold_late(self, new: Any, at_target: bool, sweep: int) -> bool:
        """Put the points that penetrated tools in three dimensions during a step into contact, at its converged state.

        At a target these are the points of all tools, else only the points on tools with friction. Friction begins
        then, limited by the pressure of the state.

        Args:
            new: the converged state.
            at_target: True if the state meets a target.
            sweep: number of earlier calls for this step.

        Returns:
            True if anything changed, so that the state must be solved for again.
        """
        n, again = self._n, sweep < LIMITS.corrections
        late = [c.face.hold_late(new.x[:n], new.control, LIMITS.near * c.face.thickness)
                for c in self.present if at_target or c.lags]
        return any([*late, *(c.update_pressure(new.x[:n], new.control) for c in self.present if again)])

    def passes_through(self, old: Any, new: Any) -> bool:
        """Return True if a contact point goes through its tool on the straight way from one state to another."""
        n = self._n
        return any([c.passes_through(old.x[:n], old.control, new.x[:n], new.control) for c in self.present])
