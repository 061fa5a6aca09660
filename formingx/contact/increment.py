"""One increment of a contact: its tractions, as Newton's method linearises them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..physics.contact_law import ContactLaw, Motion, Touch, Tractions


class Increment:
    """Tractions at n points from their history variables of the last accepted state, until the next one is accepted.

    Each run of Newton's method begins one, and so does the evaluation of a state. In each iteration

        tractions(x)     gives the residual, at the positions x of the points seen from the tool, shape (n, c);
        linearise(x)     is called at the same positions: `tractions(x)` then contains the tangent of the iteration;

    and then `status`, `arrivals`, `taken` and `foretold` may be read. `expect` sets the sense of sliding for the next
    iteration. A new increment begins when the state is accepted.

    Args:
        law: contact law.
        touch: history variables of the points; None without friction.
        start: positions of the points at the last accepted state, shape (n, c), length; None without such a state.
        guessed: mask of the points whose first guess is predicted from their forces, shape (n,). The law of these
            points is first linearised at the guess.
    """

    def __init__(self, law: ContactLaw, touch: Touch | None, start: np.ndarray | None = None,
                 guessed: np.ndarray | None = None):
        self._law, self._touch = law, touch
        self._touched = None if start is None else law.touching(start, touch)
        self._before: Motion | None = None if start is None else law.motion(start, touch)   # at the last iteration
        self._guessed = guessed
        self._sense: np.ndarray | None = None                                               # of sliding there
        self._last: tuple[np.ndarray, Tractions] | None = None

    def tractions(self, x: np.ndarray) -> Tractions:
        """Compute the tractions of the law at positions x, once; after `linearise` at them, linearised."""
        if self._last is None or not np.array_equal(x, self._last[0]):
            self._last = x, self._law.tractions(x, self._touch)
        return self._last[1]

    def linearise(self, x: np.ndarray) -> np.ndarray:
        """Linearise the law at the motion predicted by the last iteration; return the change of the tractions at x.

        Args:
            x: positions of the points, seen from the tool, shape (n, c), length.

        Returns:
            Tractions of the linearised law less the tractions of the law itself, shape (n, c), stress.
        """
        plain = found = self.tractions(x)
        now = self._law.motion(x, self._touch)
        if self._before is not None:
            expected = self._before.to(x)
            if self._guessed is not None:
                expected = Motion(*(np.where(self._guessed if a.ndim == 1 else self._guessed[:, None], b, a)
                                    for a, b in zip(expected, now)))
            found = self._law.tractions(x, self._touch, self._sense, expected)
            self._last = x, found
        self._sense, self._before, self._guessed = found.sense, now, None
        return found.force - plain.force

    @property
    def status(self) -> np.ndarray:
        """`Tractions.status` of those last computed, shape (n,)."""
        return self._now[1].status

    @property
    def arrivals(self) -> np.ndarray:
        if self._touched is None:
            return np.zeros(len(self._now[0]), dtype=bool)
        return self._law.touching(self._now[0], self._touch) & ~self._touched

    @property
    def ramp(self) -> float:
        """Half-width of the ramp in which contact begins, length."""
        return self._law.theta

    def taken(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._now[1].force[points], self._now[1].stiffness[points]

    def foretold(self, by: np.ndarray) -> Tractions:
        """Return the law linearised at the positions after a motion, shape (n, c), length."""
        return self.ahead(slice(None))(by)

    def ahead(self, points: np.ndarray | slice) -> Callable[[np.ndarray], Tractions]:
        touch = self._touch and Touch(*(part[points] for part in self._touch))
        law, x, there = self._law.part(points), self._now[0][points], self._foreseen(points)
        return lambda by: law.tractions(x, touch, None, there(by))

    def in_ramp(self, points: np.ndarray) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        assert self._before is not None
        width, x = 2 * self._law.theta, self._now[0][points]
        before = Motion(*(part[points] for part in self._before))
        grows = np.reshape(self._law.has_friction and not self._law.pulls and self._law.part(points).sticks, (-1, 1))

        def found(by: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return before.distance_at(x + by) / width + 0.5, width * grows * before.normal
        return found

    def _foreseen(self, points: np.ndarray | slice) -> Callable[[np.ndarray], Motion]:
        """Return a function that maps a displacement of points to their `Motion` at the tool, to first order."""
        assert self._before is not None
        before, x = Motion(*(part[points] for part in self._before)), self._now[0][points]
        return lambda by: before.to(x + by)

    def expect(self, points: np.ndarray, sense: np.ndarray) -> None:
        self._sense = np.where(points, sense, 0.0 if self._sense is None else self._sense)

    @property
    def _now(self) -> tuple[np.ndarray, Tractions]:
        assert self._last is not None, "call `tractions` first"
        return self._last
