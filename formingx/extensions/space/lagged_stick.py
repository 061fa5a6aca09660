"""Contact in three dimensions, lagged by a step: a point that crossed a tool sticks there from the next step on.

A point whose straight path between two accepted states leads into the tool sticks in the following steps. An isotropic
penalty constrains it to the position where the path crossed the surface (compare the user's guide of Polyflow).
Within a step nothing changes: the law is linear, and Newton's method meets no kink, no normal and no curvature, nor
asks the tool. The error is of first order in the motion of points in the step of their gap closure. With 1 % of the
points per step, walls are within 0.1 % of the walls of exact stick. The tool must give its signed distance alone.

Points in contact stick until a stage leaves the tool out. With `separates=True`, points in tension separate at the end
of each step, at constant control, until none is left. A body that snaps off reaches equilibrium by a jump. Tests prove
this for elastic sheets. Relaxing sheets are refused: slack under the plug, their points separate and touch again in
each step, and the run makes no progress.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...physics.contact_law import ContactHistory, ContactLaw, Motion, Tractions
from ...tools.tool import RigidTool

_BISECTIONS = 30           # of a chord, to where it crosses a tool: 1e-9 of it

_PULLS = 0.01
"""Distance outside the tool, over the distance from the sticking position, above which a point is in tension.
(A point that is sheared along a facet leaves the tool at its edges.)"""

SMALL_GAP = 1e-3
"""Distance outside the tool, over theta, that is negligible."""


class LaggedStick(ContactLaw):
    """Contact law of this module.

    For a sticking point, `ContactHistory.position` is the sticking position, and `distance` is 0. For a free point they
    are its position at the last accepted state and its distance, below -theta.

    Args:
        tool: tool with a signed distance.
        k: penalty, stress/length.
        theta: distance above which a point counts as closed, length.
        separates: True if points in tension separate, see `pulling`.
    """

    remembers = pulls = sticks = True
    mu = np.inf

    def __init__(self, tool: RigidTool, k: Any, theta: float, separates: bool = False):
        self.tool, self.k, self.theta, self.separates = tool, k, theta, separates
        self._found: list[tuple[np.ndarray, np.ndarray]] = []           # distances asked for last, and where

    def part(self, points: np.ndarray | slice) -> LaggedStick:
        """Return the law of some of the points.

        Args:
            points: numbers of the points, or a slice.

        Returns:
            The law.
        """
        return LaggedStick(self.tool, self.k, self.theta, self.separates)

    def held(self, old: ContactHistory) -> np.ndarray:
        """Return the mask of the sticking points.

        Args:
            old: history variables.

        Returns:
            Mask, shape (n,).
        """
        return old.distance > -self.theta

    def pulling(self, x: np.ndarray, old: ContactHistory) -> np.ndarray:
        """Return the mask of sticking points that are in tension, that is outside the tool, and may separate.

        Args:
            x: positions, shape (n, 3), length.
            old: history variables.

        Returns:
            Mask, shape (n,).
        """
        away = np.linalg.norm(x - old.position, axis=1)
        most = np.maximum(_PULLS * away, SMALL_GAP * self.theta)
        return self.separates & self.held(old) & (-self.distance(x) > most)

    def touching(self, x: np.ndarray, old: ContactHistory | None) -> np.ndarray:
        return np.zeros(len(x), dtype=bool) if old is None else self.held(old)

    def distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distances; results of the last few states are kept.

        Args:
            x: positions, shape (n, 3), length.

        Returns:
            Distances, positive inside the tool, shape (n,), length.
        """
        for at, found in self._found:
            if np.array_equal(at, x):
                return found
        found = self.tool.signed_distance(x.reshape(-1, x.shape[-1])).reshape(x.shape[:-1])
        if x.ndim == 2:
            self._found = [(x.copy(), found), *self._found[:2]]
        return found

    def start(self, x: np.ndarray) -> ContactHistory:
        """Return the initial history variables; points inside the tool at the start stick there.

        Args:
            x: positions, shape (n, 3), length.

        Returns:
            The history variables.
        """
        d = self.distance(x)
        held = d > -self.theta
        return ContactHistory(x.copy(), np.where(held, 0.0, d), np.zeros(len(x)), x.copy())

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions of the sticking points; their `normal` is 1, as no normals are computed.

        Args:
            x: positions, shape (n, 3), length.
            old: history variables.
            sense: not used.
            expected: not used.

        Returns:
            Tractions.
        """
        assert old is not None
        held, zero, force = self.held(old), np.zeros(len(x)), np.zeros_like(x)
        force[held] = self.k * (x[held] - old.position[held])

        def stiffness() -> np.ndarray:
            found = np.zeros((*x.shape, x.shape[1]))
            found[held] = self.k * np.eye(x.shape[1])
            return found
        return Tractions(force, held.astype(float), zero, zero, stiffness, lambda: self._history(x, old, held))

    def _history(self, x: np.ndarray, old: ContactHistory, held: np.ndarray) -> ContactHistory:
        """Return the history variables of an accepted state."""
        d = self.distance(x)
        new = ~held & (d > -self.theta)
        position = np.where(held[:, None], old.position, x)
        rows = np.flatnonzero(new)
        if len(rows):
            a, b = old.position[rows], x[rows]
            low: np.ndarray = np.zeros(len(rows))
            high: np.ndarray = np.ones(len(rows))
            for _ in range(_BISECTIONS):
                middle = (low + high) / 2
                inside = self.tool.signed_distance(a + middle[:, None] * (b - a)) > 0
                low, high = np.where(inside, low, middle), np.where(inside, middle, high)
            position[rows] = a + high[:, None] * (b - a)
        free = np.minimum(d, -2 * self.theta)
        return ContactHistory(position, np.where(held | new, 0.0, free), np.zeros(len(x)), x.copy())
