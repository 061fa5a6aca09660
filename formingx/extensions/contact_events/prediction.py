"""Prediction of steps that close several gaps: step length, and positions of the points when their gaps close.

A step also ends before a gap closure that follows the separation of a point that sticks at the start of the step.
"""

from __future__ import annotations

import logging
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from ...contact.step_limit import LIMITS, Approach
from ...ranks import combined
from .event_sequence import ContactEventSequence
from .reduced_contact import BodyResponse

log = logging.getLogger("formingx")

MAX_CLOSURES = 0.05
"""Largest fraction of the points of a face whose gaps close in one step."""


class ContactEventPredictor:
    """Predictor of the contact events in a step: gap closure, sliding and opening.

    Attributes:
        allowed: number of points of each active contact, on all ranks, whose gaps may close in one step.
        active: True if contact events are predicted: a contact allows several closures, all laws are predictable.
    """

    def __init__(self) -> None:
        self._contacts, self._vectors = list[Approach](), list[Any]()
        self.allowed, self.active = list[int](), False

    def enter(self, contacts: list[Approach]) -> None:
        """Set the contacts that are active in the current stage.

        Several gaps of a face may close in one step only with stick or friction and `nodes_per_step=None`. On a moving
        tool points must stick, since long steps of a plug with Coulomb friction may pass a snap. So must Gauss points:
        the nodes cannot follow the slip of all of them.
        """
        sticks, self._contacts, self.allowed = any(c.face.contact.sticks for c in contacts), contacts, []
        for approach in contacts:
            face, most = approach.face, approach.max_closures
            one_by_one = (face.contact.nodes_per_step or face.contact.lagged or face.moves and not sticks
                          or not face.contact.sticks and face.contact.points != "nodes" or not face.law.has_friction)
            self.allowed.append(most if one_by_one else max(most, round(MAX_CLOSURES * approach.points)))
        self.active = any(allowed > c.max_closures for allowed, c in zip(self.allowed, contacts)) and all(
            c.face.law.predictable for c in contacts)

    def predict(self, curve: Any, state: Any) -> ContactEventPrediction | None:
        """Return the contact events after an accepted state.

        None if the predictor is not `active`, if the tangent is singular, or at the start of a path without a closed
        point.
        """
        n, contacts = curve.problem.n_owned, self._contacts
        if not self.active or state.kind == "start" and not any(
                [c.touches(state.x[:n], state.control) for c in contacts]) or not curve.factorise_one_sided(state):
            return None
        self._vectors = self._vectors or [curve.problem.x.duplicate(), curve.problem.x.duplicate()]
        return ContactEventPrediction(contacts, self.allowed, n, state, BodyResponse(curve, state, *self._vectors))


class ContactEventPrediction:
    """Predicted contact events after an accepted state, for steps of different lengths.

    allowed: number of points of each contact whose gaps may close in one step. n: number of locally owned unknowns of
    the fields, the first entries of x.
    """

    def __init__(self, contacts: list[Approach], allowed: list[int], n: int, state: Any, response: BodyResponse):
        self._contacts, self._allowed, self._known = contacts, allowed, True
        self._sequence = ContactEventSequence([c.face for c in contacts], n, state.x, state.control, state.direction,
                                              state.slope, response, max(allowed))

    def step_length(self, length: float) -> float | None:
        """Return the arc length, at most `length`, after which the gaps of `allowed` points of a face have closed.

        That is 1 on a face with at most one closed point. If no contact is without slip, the step ends where a point
        sticks after it has slipped, so that it sticks there. The length is halved while a point would pass through a
        tool. None if the prediction failed.
        """
        found, sequence = self._length_to_closures(length) if self._known else None, self._sequence
        slides = not any([c.face.contact.sticks for c in self._contacts])
        if found is not None and slides and LIMITS.start_fraction * length < sequence.slip_ends < found:
            found = LIMITS.overshoot * sequence.slip_ends
        while found is not None and found > LIMITS.min_length and any(
                [c.cuts_tool(a, b)
                 for c, a, b in zip(self._contacts, sequence.positions(0.0), sequence.positions(found))]):
            found /= 2
        self._known = found is not None
        return found

    def _length_to_closures(self, length: float) -> float | None:
        """Return the arc length, at most `length`, at which the gaps of `allowed` points of a face have closed.

        Sticking points are assumed to stay closed. If one is in tension at a gap closure, the step ends before this
        closure. None if the prediction fails.
        """
        sequence, before, at_start = self._sequence, 0.0, LIMITS.start_fraction * length
        allowed = [most if touching > 1 else 1 for most, touching in zip(self._allowed, sequence.touching)]
        for k in range(2 * sum(allowed)):
            closure = sequence.next(k, length)
            if closure is None:
                break
            if closure.arc_length > max(at_start, LIMITS.min_length) and self._separates(closure.arc_length):
                return closure.arc_length - LIMITS.start_fraction * (closure.arc_length - before)
            before = closure.arc_length
            allowed[closure.face] -= closure.arc_length > at_start
            if not allowed[closure.face]:
                return min(LIMITS.overshoot * closure.arc_length, length)
        else:
            return None
        if sequence.exhausted:
            log.info("the contact events of this step took too many iterations: it takes one gap closure")
            return None
        if sequence.stops or sequence.ends <= at_start:
            return None
        return min(LIMITS.overshoot * sequence.ends, length)

    @cached_property
    def _sticking(self) -> list[tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Sticking points of the accepted state that may open, m on each face, as a tuple for each face.

        The face's number; mask, shape (n,); normal tractions N, shape (m,), stress; positions x, shape (m, 2), length;
        derivatives dN/dx, shape (m, 2).
        """
        found = []
        for f, (approach, x) in enumerate(zip(self._contacts, self._sequence.positions(0.0))):
            face, contact = approach.face, approach.face.contact
            if contact.sticks and contact.separates:
                tractions = face.law.tractions(x, face.history)
                closed = (tractions.normal > 0) & (face.rule.area > 0)
                slope = np.einsum("ni,nij->nj", face.law.nearest(x).normal, tractions.stiffness)
                found.append((f, closed, tractions.normal[closed], x[closed], slope[closed]))
        return found

    def _separates(self, length: float) -> bool:
        """Return True if a sticking point of the accepted state is in tension at an arc length; collective."""
        if not self._sticking:
            return False
        x = self._sequence.positions(length)
        tension = any([np.any(N + np.einsum("ni,ni->n", slope, x[f][closed] - start) < 0)
                       for f, closed, N, start, slope in self._sticking])
        return bool(combined(self._contacts[0].face.comm, tension, MPI.LOR))

    def closures(self, length: float) -> list[tuple] | None:
        """Return `ContactEventSequence.closures` as a tuple for each active contact; None if it failed."""
        return list(zip(*self._sequence.closures(length), strict=True)) if self._known else None

    def bend(self, length: float) -> tuple[np.ndarray, float] | None:
        """Return the predicted path minus the tangent: changes of x, shape (n,), and of the control, or None."""
        return self._sequence.bend(length) if self._known else None
