r"""Sliding contact in three dimensions, with or without friction, in which points open and close only between steps.

Contact is lagged: a point whose gap closed in a step is in contact from the next step on. It then stays on the surface
of the tool. Its traction per unit reference area is

.. math:: t = k d n + T, \qquad T = \frac{\mu N_0}{g_s} g, \quad |g| \le g_s,

with the penalty k, the coefficient of friction mu and the elastic slip g (Wriggers, Computational Contact Mechanics,
2006, chapter 5.2). The signed distance d of the point from the tool is positive inside, and n = grad d. The slip is the
slip of the last accepted state plus the motion since then in the present tangent plane. Return mapping limits it to
g_s.

The pressure N_0 is constant during the Newton iterations of a step, which therefore converge. At first it belongs to
the last accepted state, extrapolated along the path. Then the step is solved again with the pressure that was found,
until both agree (`LaggedLimits.max_pressure_difference`). N_0 is 0 for a point whose gap has closed since the last
accepted state. Steps are short, so that the pressure changes little in each of them
(`LaggedLimits.max_pressure_change`).

Within a step a point in contact carries tension as well as pressure, so that Newton's method meets no kink. Points in
tension separate at the end of the step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...physics.contact_law import ContactHistory, ContactStatus, Motion, Tractions, outer
from .lagged_stick import LaggedStick

_MAX_PRESSURE_RATIO = 10.0  # factor, up or down, from the last pressure to the pressure that limits friction
_TENSION = 1e-5            # distance outside the tool over theta, from which on a point in contact is in tension
_SLIDES_ON = 1 + 1e-9      # stored slip of sliding points, over g_s: they continue to slide in spite of round-off


class Distances(NamedTuple):
    """Signed distances of n points from a tool in three dimensions, with their first and second derivatives.

    Attributes:
        distance: signed distances from the surface of the tool, positive inside, shape (n,), length.
        normal: gradients of the distance with respect to the position, unit vectors into the tool, shape (n, 3).
        hessian: second derivatives of the distance with respect to the position, shape (n, 3, 3), 1/length.
    """

    distance: np.ndarray
    normal: np.ndarray
    hessian: np.ndarray


class LaggedFriction(LaggedStick):
    """Contact law of points that slide on a tool in three dimensions, with lagged friction or without friction.

    The history variables (`ContactHistory`) of the n points at the last accepted state are:

    * `position`: positions, shape (n, 3), length.
    * `slip`: elastic slips as vectors, shape (n, 3), length.
    * `distance`: of a point in contact its pressure over the penalty k, 0 or more; of an open point its signed
      distance, below -theta; shape (n,), length.
    * `closure`: positions that store N_0: their depth in the tool is N_0/k, shape (n, 3), length.

    The tool has a method `distances`. mu has shape () or (n,), 0 without friction; k is in stress/length. A point is in
    contact where its signed distance exceeds -theta, and begins to slide at `elastic_slip`, length.
    """

    tool: Any
    mu: Any
    sticks = False

    def __init__(self, tool: Any, mu: np.ndarray | float, k: Any, theta: float, elastic_slip: float):
        super().__init__(tool, k, theta, True)
        self.mu, self.elastic_slip = mu, elastic_slip
        self._last: list[tuple[np.ndarray, Distances]] = []         # distances asked for last, and where
        self._pressure_ahead: tuple[ContactHistory, np.ndarray] | None = None

    def part(self, points: np.ndarray | slice) -> LaggedFriction:
        """Return the contact law of some of the points, numbers of shape (m,) or a slice."""
        return LaggedFriction(self.tool, self._mu_at(points), self.k, self.theta, self.elastic_slip)

    def with_friction(self, mu: np.ndarray | float) -> LaggedFriction:
        """Return a copy of the law with the coefficient of friction mu, shape () or (n,)."""
        return LaggedFriction(self.tool, mu, self.k, self.theta, self.elastic_slip)

    def _mu_at(self, points: np.ndarray | slice) -> np.ndarray | float:
        """Return the coefficient of friction of some of the points, numbers of shape (m,) or a slice."""
        return self.mu[points] if isinstance(self.mu, np.ndarray) and self.mu.ndim else self.mu

    def in_tension(self, x: np.ndarray, old: ContactHistory) -> np.ndarray:
        """Return the mask of the points in contact that lie outside the tool, shape (n,); x: shape (n, 3), length."""
        return self.in_contact(old) & (self.distance(x) < -_TENSION * self.theta)

    def start(self, x: np.ndarray) -> ContactHistory:
        """Return the history variables of points at x, shape (n, 3), length, without slip."""
        return super().start(x)._replace(slip=np.zeros_like(x))

    def pressure(self, history: ContactHistory) -> np.ndarray:
        """Return the contact pressure of an accepted state, shape (n,), stress; 0 if open or in tension."""
        return np.asarray(self.k * np.maximum(history.distance, 0.0))

    def friction_pressure(self, old: ContactHistory) -> np.ndarray:
        """Return the contact pressure N_0 that limits friction during the next step, shape (n,), stress.

        It is k times the depth of `ContactHistory.closure`, within a factor of 10 of the last accepted pressure.
        """
        if self._pressure_ahead is None or self._pressure_ahead[0] is not old:
            now, change = np.maximum(old.distance, 0.0), old.closure - old.position
            depth = now
            if change.any():
                depth = now + np.einsum("ni,ni->n", self.tool.distances(old.position).normal, change)
            self._pressure_ahead = old, self.k * np.clip(depth, now / _MAX_PRESSURE_RATIO, _MAX_PRESSURE_RATIO * now)
        return self._pressure_ahead[1]

    def closure_at_pressure(self, old: ContactHistory, pressure: np.ndarray) -> np.ndarray:
        """Return the positions, shape (n, 3), length, whose depth in the tool is a pressure over the penalty.

        `friction_pressure` then limits friction by it; pressure: shape (n,), stress.
        """
        change = pressure / self.k - np.maximum(old.distance, 0.0)
        return np.asarray(old.position + change[:, None] * self.tool.distances(old.position).normal)

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions at positions x, shape (n, 3), length, linearised at `expected` positions and distances.

        sense: direction of sliding in the previous iteration, shape (n,), radians from the first to the second vector
        of `_basis`; 0: none. A point whose slip reverses sticks for one iteration: Newton's method would oscillate over
        the narrow range of elastic slip.
        """
        assert old is not None
        positions, zero = x if expected is None else expected.position, np.zeros(len(x))
        rows, distances = self.contact_distances(positions, old)
        d, n = distances.distance, distances.normal
        moved = old.slip[rows] + positions[rows] - old.position[rows]
        along = np.einsum("ni,ni->n", n, moved)
        g = moved - along[:, None] * n
        size, basis = np.sqrt(np.einsum("ni,ni->n", g, g)), _basis(n)
        mu = self._mu_at(rows)
        slides = (size > self.elastic_slip) & (mu > 0)
        if sense is not None:
            before = np.cos(sense[rows, None]) * basis[0] + np.sin(sense[rows, None]) * basis[1]
            slides &= (sense[rows] == 0) | (np.einsum("ni,ni->n", before, g) > 0)
        way = np.where(slides[:, None], g, 0.0) / np.maximum(size, 1e-300)[:, None]
        stiff = mu * self.friction_pressure(old)[rows] / np.where(slides, size, self.elastic_slip)

        def stiffness() -> np.ndarray:
            """Return the derivative of the tractions with respect to the positions, shape (n, 3, 3), stress/length."""
            hessian = distances.hessian
            bends = outer(n, np.einsum("nij,nj->ni", hessian, moved)) + along[:, None, None] * hessian
            dg = np.eye(3) - outer(n, n) - bends
            dg -= outer(way, np.einsum("ni,nij->nj", way, dg))
            depth = d if expected is None else expected.distance[rows]
            found = np.zeros((*x.shape, 3))
            found[rows] = self.k * (outer(n, n) + depth[:, None, None] * hessian) + stiff[:, None, None] * dg
            return found

        def history() -> ContactHistory:
            """Return the history variables that the n points have once the state at x is accepted."""
            slip = np.zeros_like(x)
            slip[rows] = np.where(slides[:, None], self.elastic_slip * _SLIDES_ON * way, g)
            depth = self.distance(x)
            depth = np.where(depth > -self.theta, 0.0, np.minimum(depth, -2 * self.theta))
            depth[rows] = np.maximum(self.distance(x)[rows], 0.0)
            return ContactHistory(x.copy(), depth, slip, x.copy())
        force, normal, tangential, sliding = np.zeros_like(x), zero.copy(), zero.copy(), zero.copy()
        force[rows] = self.k * d[:, None] * n + stiff[:, None] * g
        normal[rows], tangential[rows] = self.k * d, stiff * size
        angle = np.arctan2(*(np.einsum("ni,ni->n", way, e) for e in basis[::-1]))
        sliding[rows] = np.where(slides, np.where(angle == 0, 2 * np.pi, angle), 0.0)
        found = _Tractions(force, normal, tangential, sliding, stiffness, history)
        if positions is not x:
            found.force = force + np.einsum("nij,nj->ni", found.stiffness, x - positions)
        return found

    def contact_distances(self, x: np.ndarray, old: ContactHistory) -> tuple[np.ndarray, Distances]:
        """Return the numbers of points in contact, shape (m,), and their `Distances`; x: shape (n, 3), length."""
        rows = np.flatnonzero(self.in_contact(old))
        return rows, self._distances(x[rows])

    def motion(self, x: np.ndarray, old: ContactHistory | None) -> Motion:
        """Return distances (0 for open points) and normals at x, (n, 3), length, to predict distances; slips are 0."""
        assert old is not None
        d, n = np.zeros(len(x)), np.zeros_like(x)
        rows, distances = self.contact_distances(x, old)
        d[rows], n[rows] = distances.distance, distances.normal
        return Motion(x, d, n, np.zeros(len(x)), np.zeros_like(x))

    def _distances(self, x: np.ndarray) -> Distances:
        """Return distances, normals and Hessians at x, shape (n, 3), length; the last four results are stored."""
        for positions, found in self._last:
            if np.array_equal(positions, x):
                return found
        found = self.tool.distances(x)
        self._last = [(x.copy(), found), *self._last[:3]]
        return found


class _Tractions(Tractions):
    """Tractions whose `sense` is the angle of sliding from the first vector of `_basis`, radians; 0: no sliding."""

    @property
    def status(self) -> np.ndarray:
        touching = np.where(self.sense != 0, ContactStatus.SLIDES, ContactStatus.STICKS)
        return np.where(self.normal != 0, touching, ContactStatus.FREE).astype(np.int8)


def _basis(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two orthogonal unit vectors in each tangent plane, shape (n, 3) each; normal: unit normals, shape (n, 3).

    Source: Duff et al., Journal of Computer Graphics Techniques 6 (2017) 1.
    """
    x, y, z = normal.T
    side = np.where(z < 0, -1.0, 1.0)
    a = -1 / (side + z)
    b = x * y * a
    return (np.column_stack([1 + side * x * x * a, side * b, -side * x]), np.column_stack([b, side + y * y * a, -y]))
