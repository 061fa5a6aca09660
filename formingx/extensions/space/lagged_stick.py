"""Sticking contact in three dimensions, in which points stick or separate only between steps.

A point whose straight path between two accepted states leads into the tool sticks in the following steps. An isotropic
penalty constrains it to the position where the path crossed the surface (compare the user's guide of Polyflow). Within
a step the set of sticking points is constant, so the law is linear: Newton's method meets no kink, and evaluates no
distance, normal or curvature of the tool. The error is of first order in the motion of a point in the step of its gap
closure. With 1 % of the points per step, walls are within 0.1 % of the walls of exact stick. The tool only has to give
its signed distance.

Points stick until a stage makes the tool inactive. With `separates=True`, points in tension separate at the end of each
step, at constant control, until no point is in tension. A body that snaps off reaches equilibrium by a jump. Tests
prove this for elastic sheets. Relaxing sheets are refused: under a plug they become slack, their points separate and
touch again in each step, and the run makes no progress.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...physics.contact_law import ContactHistory, ContactLaw, Motion, Tractions
from ...tools.tool import RigidTool
from ...values.tolerances import NEGLIGIBLE, ROUND_OFF

_TENSILE_DISTANCE = 0.01
"""Distance outside the tool, over the distance from the sticking position, above which a point is in tension.

A point that is sheared along a facet leaves the tool at the edges of the facet, without tension.
"""

_ADVANCES = 200            # steps along a path up to the tool, each as long as the distance from it

_BISECTIONS = math.ceil(-math.log2(ROUND_OFF))
"""Bisections of a chord down to the point where it crosses a tool."""


class LaggedStick(ContactLaw):
    """Contact law, with penalty k, stress/length, of points that stick where they crossed a tool in three dimensions.

    The points in contact are lagged: those of the last accepted state during a whole step. A point sticks where its
    signed distance, positive inside, exceeds -theta, length. `ContactHistory` has the sticking position and the
    distance 0 of a sticking point, of an open one its position and signed distance at the last accepted state.
    separates: True if points in tension separate at the end of a step.
    """

    has_history = adhesive = sticks = True
    mu = np.inf

    def __init__(self, tool: RigidTool, k: Any, theta: float, separates: bool = False):
        self.tool, self.k, self.theta, self.separates = tool, k, theta, separates
        self._found: list[tuple[np.ndarray, np.ndarray]] = []           # distances asked for last, and where

    def part(self, points: np.ndarray | slice) -> LaggedStick:
        """Return the contact law of some of the points, numbers of shape (m,) or a slice."""
        return LaggedStick(self.tool, self.k, self.theta, self.separates)

    def in_contact(self, old: ContactHistory) -> np.ndarray:
        """Return the mask of the points that are in contact during the next step, shape (n,)."""
        return old.distance > -self.theta

    def in_tension(self, x: np.ndarray, old: ContactHistory) -> np.ndarray:
        """Return the mask of sticking points in tension, shape (n,), which separate at the end of a step.

        They lie outside by over 0.01 times the way from their sticking position and 0.001 theta. None if `separates` is
        False.
        """
        travel = np.linalg.norm(x - old.position, axis=1)
        limit = np.maximum(_TENSILE_DISTANCE * travel, NEGLIGIBLE * self.theta)
        return self.separates & self.in_contact(old) & (-self.distance(x) > limit)

    def touching(self, x: np.ndarray, old: ContactHistory | None) -> np.ndarray:
        return np.zeros(len(x), dtype=bool) if old is None else self.in_contact(old)

    def distance(self, x: np.ndarray) -> np.ndarray:
        """Return signed distances at x, (n, 3) or (m, n, 3), length, positive inside; the last three are stored."""
        for positions, found in self._found:
            if np.array_equal(positions, x):
                return found
        found = self.tool.signed_distance(x.reshape(-1, x.shape[-1])).reshape(x.shape[:-1])
        if x.ndim == 2:
            self._found = [(x.copy(), found), *self._found[:2]]
        return found

    def entries(self, a: np.ndarray, b: np.ndarray, free: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return where straight paths enter the tool, as shares of the paths, shape (n,); inf for paths outside it.

        a, b: start (outside the tool) and end, shape (n, 3), length. free: mask of the paths that are examined, the
        others have inf. ends: mask of paths that end in the tool or on it, shape (n,).
        """
        hit, low, high = self._bracketed_entries(a, b, free, ends)
        found: np.ndarray = np.where(free & ends, 1.0, np.inf)
        way = (b - a)[hit]
        for _ in range(_BISECTIONS):
            if not np.any(high - low > ROUND_OFF):
                break
            middle = (low + high) / 2
            inside = self.tool.signed_distance(a[hit] + middle[:, None] * way) > 0
            low, high = np.where(inside, low, middle), np.where(inside, middle, high)
        found[hit] = high
        return found

    def enter(self, a: np.ndarray, b: np.ndarray, free: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return the mask of the straight paths that enter the tool, shape (n,); the arguments are those of `entries`.
        """
        found: np.ndarray = free & ends
        found[self._bracketed_entries(a, b, free, ends)[0]] = True
        return found

    def _bracketed_entries(self, a: np.ndarray, b: np.ndarray, free: np.ndarray,
                           ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the numbers of paths that enter the tool, and shares of them before and after, shape (m,) each.

        The distance from the tool is a safe advance along a path, so no thin part is passed over.
        """
        length = np.linalg.norm(b - a, axis=1)
        rows = np.flatnonzero(free & (ends | (length > -self.distance(a) - self.distance(b))) & (length > 0))
        start, way, length = a[rows], (b - a)[rows], length[rows]
        low: np.ndarray = np.zeros(len(rows))
        high: np.ndarray = np.full(len(rows), np.inf)
        active: np.ndarray = np.arange(len(rows))
        for _ in range(_ADVANCES):
            if not len(active):
                break
            d = self.tool.signed_distance(start[active] + low[active, None] * way[active])
            inside = d > 0
            high[active[inside]] = low[active[inside]]
            active, d = active[~inside], d[~inside]
            d, active = d[low[active] < 1], active[low[active] < 1]
            low[active] = np.minimum(low[active] + np.maximum(-d, self.theta) / length[active], 1.0)
        low = np.where(np.isfinite(high), np.maximum(high - self.theta / length, 0.0), 0.0)
        high = np.where(np.isfinite(high), high, np.where(ends[rows], 1.0, np.inf))
        hit = np.isfinite(high)
        return rows[hit], low[hit], high[hit]

    def start(self, x: np.ndarray) -> ContactHistory:
        """Return the history variables at x, shape (n, 3), length; points inside the tool stick there."""
        d = self.distance(x)
        sticking = d > -self.theta
        return ContactHistory(x.copy(), np.where(sticking, 0.0, d), np.zeros(len(x)), x.copy())

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions k (x - x_0) of sticking points with the penalty k; 0 for open points.

        x: shape (n, 3), length. x_0 is where the point crossed the tool. The law computes no normals:
        `Tractions.normal` is 1 for a sticking point and 0 for an open one, not a stress.
        """
        assert old is not None
        sticking, zero, force = self.in_contact(old), np.zeros(len(x)), np.zeros_like(x)
        force[sticking] = self.k * (x[sticking] - old.position[sticking])

        def stiffness() -> np.ndarray:
            """Return the derivative of the tractions with respect to the positions, shape (n, 3, 3), stress/length."""
            found = np.zeros((*x.shape, x.shape[1]))
            found[sticking] = self.k * np.eye(x.shape[1])
            return found
        return Tractions(force, sticking.astype(float), zero, zero, stiffness, lambda: self._history(x, old, sticking))

    def _history(self, x: np.ndarray, old: ContactHistory, sticking: np.ndarray) -> ContactHistory:
        """Return the history variables after the state at x, shape (n, 3), length, is accepted.

        A point whose gap closed in the step sticks where its straight path enters the tool. sticking: mask of the
        points that stick already, shape (n,).
        """
        d = self.distance(x)
        share = self.entries(old.position, x, ~sticking, d > -self.theta)
        new = np.isfinite(share)
        position = np.where(sticking[:, None], old.position, x)
        position[new] = old.position[new] + share[new, None] * (x - old.position)[new]
        free = np.minimum(d, -2 * self.theta)
        return ContactHistory(position, np.where(sticking | new, 0.0, free), np.zeros(len(x)), x.copy())
