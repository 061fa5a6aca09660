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
        """Return the tractions at given positions: of the law, or after `linearise(x)` of the linearised law.

        They are stored for repeated calls with the same positions.

        Args:
            x: positions of the points relative to the tool, shape (n, c), length.

        Returns:
            Tractions at the points, with their stiffness.
        """
        positions = x.tobytes()
        if self._last is None or positions != self._last_positions:
            self._last, self._last_positions = (x, self._law.tractions(x, self._history)), positions
        return self._last[1]

    def linearise(self, x: np.ndarray) -> np.ndarray:
        """Linearise the contact law for this iteration.

        The law is linearised at predicted distances and slips. They are extrapolated from the last iteration to x by
        their first derivatives with respect to the position.

        Args:
            x: positions of the points relative to the tool in this iteration, shape (n, c), length.

        Returns:
            Tractions of the linearised law minus tractions of the law itself, both at x, with c components, shape (n,
            c), stress.
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
        """Return the tractions and stiffnesses that the last `linearise` used at some points.

        Args:
            points: indices of the points, shape (m,).

        Returns:
            Tractions, shape (m, c), stress; their derivatives by the position, shape (m, c, c), stress/length.
        """
        return self._last_result[1].force[points], self._last_result[1].stiffness[points]

    def predicted(self, motion: np.ndarray) -> Tractions:
        """Return the linearised law of all points after a further motion.

        The law is linearised at the distances and slips after the motion, as their gradients predict them.

        Args:
            motion: motion y of the points relative to the tool since the last computed tractions, shape (n, c), length.

        Returns:
            Traction f and stiffness S of this linearisation at the position before the motion. The traction after it is
            f + S y.
        """
        x, predicted = self._last_result[0], self._predicted_motion(slice(None))
        return self._law.tractions(x, self._history, None, predicted(motion))

    def law_at(self, points: np.ndarray) -> Callable[[np.ndarray], Tractions]:
        """Return a function that gives the linearised law of some points after a further motion.

        The law is linearised at the distances and slips after the motion, as their gradients predict them.

        Args:
            points: indices of the points, shape (m,).

        Returns:
            Function of the motion y of these points since the last computed tractions, shape (m, c), length. It returns
            `Tractions` with the traction f at the position before the motion and the stiffness S. The traction after
            the motion is f + S y.
        """
        history = self._history and ContactHistory(*(part[points] for part in self._history))
        law, x, predicted = self._law.part(points), self._last_result[0][points], self._predicted_motion(points)
        return lambda motion: law.tractions(x, history, None, predicted(motion))

    def in_ramp(self, points: np.ndarray) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Return a function that predicts how deep some points are in the ramp after a further motion.

        The local solve of contact uses this function to stop sticking points near the outer edge of the ramp.

        Args:
            points: indices of the points, shape (m,).

        Returns:
            Function of the motion of these points since the last computed tractions, shape (m, c), length. It returns
            two arrays. The first is the depth over the width 2 theta of the ramp, shape (m,): 0 at the signed distance
            -theta, where contact begins, and 1 at the distance theta. The second is the normal times 2 theta, shape (m,
            c), length; 0 for points that slide, adhere or have no friction.
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
        """Return a function that predicts the distances and slips of m points after a motion by their gradients.

        points: indices of the points, shape (m,), or a slice. The function takes the motion of the points since the
        last computed tractions, shape (m, c), length. It returns a `Motion` with distances, slips and their gradients.
        """
        assert self._before is not None
        before, x = Motion(*(part[points] for part in self._before)), self._last_result[0][points]
        return lambda motion: before.to(x + motion)

    def expect(self, points: np.ndarray, sense: np.ndarray) -> None:
        """Set the sense of sliding at some points, from which the next `linearise` starts.

        Args:
            points: mask of these points, shape (n,).
            sense: sense of sliding along the tangent of the tool, 1 or -1; 0 for sticking points, shape (n,).
        """
        self._sense = np.where(points, sense, 0.0 if self._sense is None else self._sense)

    @property
    def _last_result(self) -> tuple[np.ndarray, Tractions]:
        """Positions and tractions of the last call of `tractions` or `linearise`."""
        assert self._last is not None, "call `tractions` first"
        return self._last
