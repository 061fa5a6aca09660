"""One increment of a contact: tractions at its points, with the linearisation that Newton's method uses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..physics.contact_law import ContactHistory, ContactLaw, Motion, Tractions


class Increment:
    """Tractions at n contact points during one increment, starting from the last accepted state.

    An increment begins with each run of Newton's method, and with each evaluation of a state. It ends when the state is
    accepted. x are the positions of the points relative to the tool, with c components. In each iteration these methods
    are called:

    * `tractions(x)`, for the residual.
    * `linearise(x)` at the same positions. After it, `tractions(x)` returns the linearised law with its stiffness.
    * If statuses change, the local contact problem (`LocalSolve`) reads `status`, `newly_closed` and `last_tractions`,
      predicts tractions by `law_at` and `predicted`, and sets the sense of sliding of the next iteration by `expect`.

    Args:
        law: contact law.
        history: history variables of the points; None without friction.
        start: positions of the points relative to the tool at the last accepted state, shape (n, c), length; None
            without such a state.
        guessed: mask of the points whose predicted contact forces belong to the guess of the step, shape (n,). The
            first iteration linearises the law at the guess for these points. For the others it extrapolates distances
            and slips from `start`.
    """

    def __init__(self, law: ContactLaw, history: ContactHistory | None, start: np.ndarray | None = None,
                 guessed: np.ndarray | None = None):
        self._law, self._history = law, history
        self._touched = None if start is None else law.touching(start, history)
        self._before: Motion | None = None if start is None else law.motion(start, history)   # in the last iteration
        self._guessed = guessed
        self._sense: np.ndarray | None = None               # of sliding in the last iteration
        self._last: tuple[np.ndarray, Tractions] | None = None
        self._last_positions = b""                          # those of `_last`

    def tractions(self, x: np.ndarray) -> Tractions:
        """Return the tractions at positions x, shape (n, c), length: of the law or, after `linearise(x)`, linearised.

        They are stored for repeated calls with the same positions.
        """
        positions = x.tobytes()
        if self._last is None or positions != self._last_positions:
            self._last, self._last_positions = (x, self._law.tractions(x, self._history)), positions
        return self._last[1]

    def linearise(self, x: np.ndarray) -> np.ndarray:
        """Linearise the law at distances and slips extrapolated from the last iteration to x, shape (n, c), length.

        Return the tractions of the linearised law minus those of the law itself, both at x, shape (n, c), stress.
        """
        plain = found = self.tractions(x)
        now = self._law.motion(x, self._history)
        if self._before is not None:
            expected = self._before.to(x)
            if self._guessed is not None:
                expected = Motion(*(np.where(self._guessed if a.ndim == 1 else self._guessed[:, None], b, a)
                                    for a, b in zip(expected, now)))
            found = self._law.tractions(x, self._history, self._sense, expected)
            self._last = x, found
        self._sense, self._before, self._guessed = found.sense, now, None
        return found.force - plain.force

    @property
    def status(self) -> np.ndarray:
        """`ContactStatus` of each point (open, sticking, sliding) in the last computed tractions, shape (n,)."""
        return self._last_result[1].status

    @property
    def newly_closed(self) -> np.ndarray:
        """Mask of the points that are in contact now and were open at the start of the increment, shape (n,)."""
        if self._touched is None:
            return np.zeros(len(self._last_result[0]), dtype=bool)
        return self._law.touching(self._last_result[0], self._history) & ~self._touched

    @property
    def ramp(self) -> float:
        """Half-width theta of the ramp, the range of distances over which the contact pressure sets in, length."""
        return self._law.theta

    def last_tractions(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the tractions, (m, c), stress, and stiffnesses, (m, c, c), that the last `linearise` used."""
        return self._last_result[1].force[points], self._last_result[1].stiffness[points]

    def predicted(self, motion: np.ndarray) -> Tractions:
        """Return the law linearised after a further motion y of all points, shape (n, c), length.
        Traction f and stiffness S are those before the motion: after it the traction is f + S y."""
        x, predicted = self._last_result[0], self._predicted_motion(slice(None))
        return self._law.tractions(x, self._history, None, predicted(motion))

    def law_at(self, points: np.ndarray) -> Callable[[np.ndarray], Tractions]:
        """Return `predicted` for m points: a function of their motion y, shape (m, c), length.

        Its `Tractions` have the traction f and stiffness S before the motion; after it the traction is f + S y.
        """
        history = self._history and ContactHistory(*(part[points] for part in self._history))
        law, x, predicted = self._law.part(points), self._last_result[0][points], self._predicted_motion(points)
        return lambda motion: law.tractions(x, history, None, predicted(motion))

    def in_ramp(self, points: np.ndarray) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Return a function that predicts how deep m points are in the ramp after a motion, shape (m, c), length.

        It returns the depth over the width 2 theta, shape (m,), from 0 to 1, and the normal times 2 theta, shape (m,
        c), length; 0 for points that slide, adhere or have no friction. Sticking points stop at the edge with it.
        """
        assert self._before is not None
        width, x = 2 * self._law.theta, self._last_result[0][points]
        before = Motion(*(part[points] for part in self._before))
        law = self._law.part(points)
        sticks = np.reshape(law.has_friction and not law.adhesive and law.sticks, (-1, 1))

        def depth_and_path(motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return before.distance_at(x + motion) / width + 0.5, width * sticks * before.normal
        return depth_and_path

    def _predicted_motion(self, points: np.ndarray | slice) -> Callable[[np.ndarray], Motion]:
        """Return a function from the motion of m points, shape (m, c), length, to their predicted `Motion`."""
        assert self._before is not None
        before, x = Motion(*(part[points] for part in self._before)), self._last_result[0][points]
        return lambda motion: before.to(x + motion)

    def expect(self, points: np.ndarray, sense: np.ndarray) -> None:
        """Set the sense of sliding, 1, -1 or 0 (sticking), at masked points, shape (n,) both, for `linearise`."""
        self._sense = np.where(points, sense, 0.0 if self._sense is None else self._sense)

    @property
    def _last_result(self) -> tuple[np.ndarray, Tractions]:
        """Positions and tractions of the last call of `tractions` or `linearise`."""
        assert self._last is not None, "call `tractions` first"
        return self._last
