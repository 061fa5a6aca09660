"""Length of a step that closes several gaps, and the positions of the closures."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from ...contact.approach import LIMITS, Approach
from ...contact.step_limit import StepLimit
from .event_sequence import ContactEventSequence
from .response import Response

log = logging.getLogger("formingx")

SHARE = 0.05
"""Largest part of the points of a face that close their gaps in one step."""


class ContactEventPredictor:
    """Predictor of the contact events of a `StepLimit`, see `step_limit.EventPredictor`."""

    def __init__(self, limit: StepLimit):
        self._limit, self._vectors = limit, list[Any]()

    def allowed(self, approach: Approach) -> int:
        """Return the number of points of a face that may close their gaps in one step.

        It exceeds `Approach.at_once` where points stick or slide and their contact leaves `nodes_per_step` open.
        """
        face, most = approach.face, approach.at_once
        if not self._limit.several or not face.law.has_friction or face.contact.nodes_per_step or face.contact.lagged:
            return most
        return max(most, round(SHARE * approach.points))

    @property
    def active(self) -> bool:
        """True if a face sticks, so that its result depends on the order of the events."""
        present = self._limit.present
        return any(c.face.contact.sticks and self.allowed(c) > c.at_once for c in present) and all(
            c.face.law.predictable for c in present)

    def predict(self, curve: Any, state: Any) -> ContactEventPrediction | None:
        """Return the events ahead of an accepted state; None at the start of a path where no point touches yet."""
        n, present = curve.problem.n_owned, self._limit.present
        if not self.active or state.kind == "start" and not any(
                [c.touches(state.x[:n], state.control) for c in present]) or not curve.factorise_ahead(state):
            return None
        self._vectors = self._vectors or [curve.problem.x.duplicate(), curve.problem.x.duplicate()]
        return ContactEventPrediction(present, [self.allowed(c) for c in present], n, state,
                                      Response(curve, state, *self._vectors))


class ContactEventPrediction:
    """Events ahead of one state, see `step_limit.EventPrediction`.

    Args:
        present: active contacts.
        allowed: number of points of each contact that may close their gaps in one step.
        n: number of locally owned unknowns.
        state: the accepted state.
        response: linearised response of the body there.
    """

    def __init__(self, present: list[Approach], allowed: list[int], n: int, state: Any, response: Response):
        self._present, self._allowed, self._known = present, allowed, True
        self._sequence = ContactEventSequence([c.face for c in present], n, state.x, state.control, state.direction,
                                              state.slope, response, max(allowed))

    def step_length(self, length: float) -> float | None:
        """Return the length to where enough gaps have closed, and no point passes through a tool."""
        found, sequence = self._to_enough_closures(length) if self._known else None, self._sequence
        while found is not None and found > LIMITS.shortest and any(
                [c.cuts(a, b) for c, a, b in zip(self._present, sequence.positions(0.0), sequence.positions(found))]):
            found /= 2
        self._known = found is not None
        return found

    def _to_enough_closures(self, length: float) -> float | None:
        sequence = self._sequence
        allowed = [most if touching > 1 else 1 for most, touching in zip(self._allowed, sequence.touching)]
        for k in range(2 * sum(allowed)):
            closure = sequence.next(k, length)
            if closure is None:
                break
            allowed[closure.face] -= closure.time > LIMITS.as_good * length
            if not allowed[closure.face]:
                return min(LIMITS.beyond * closure.time, length)
        else:
            return None
        if sequence.exhausted:
            log.info("the contact events of this step took too many iterations: it takes one gap closure")
            return None
        if sequence.stops or sequence.ends <= LIMITS.as_good * length:
            return None
        return min(LIMITS.beyond * sequence.ends, length)

    def closures(self, length: float) -> list[tuple] | None:
        """See `step_limit.EventPrediction`."""
        return list(zip(*self._sequence.closures(length), strict=True)) if self._known else None

    def bend(self, length: float) -> tuple[np.ndarray, float] | None:
        """See `step_limit.EventPrediction`."""
        return self._sequence.bend(length) if self._known else None
