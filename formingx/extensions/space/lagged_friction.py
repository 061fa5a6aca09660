"""Friction in three dimensions, and sliding without it, lagged by a step: points in contact stay on the surface of its
tool.

Which points touch is lagged as in `lagged_stick`. The traction of a point that touches, per unit reference area, is

.. math:: t = k d n + T, \\qquad T = \\frac{\\mu N_0}{g_s} g, \\quad |g| \\le g_s,

where d is its signed distance to the tool, n = grad d, and g the elastic slip (Wriggers, Computational Contact
Mechanics, 2006, chapter 5.2). The slip is its value at the last accepted state plus the motion since then in the
present tangent plane, limited to g_s (return mapping). N_0 is constant during Newton iterations, which therefore
converge. It is first the pressure at the last accepted state, extrapolated along the tangent of the path. Then it is
the pressure of the state found with it, until both agree (`StepLimits.behind`). It is 0 for a point that has touched
since the last state: steps are
short enough for the pressure to change little in each (`StepLimits.lag`).

In a step a point pulls as well as it pushes, so that Newton's method meets no kink; at its end points in tension
separate.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...physics.contact_law import ContactHistory, ContactStatus, Motion, Tractions, outer
from .lagged_stick import SMALL_GAP, LaggedStick

_LEAST = 0.1               # pressure that limits friction, over the pressure at the last state, at least
_MOST = 10.0               # and at most
_SLIDES_ON = 1 + 1e-9      # kept slip of sliding points, over g_s: it goes on sliding, in spite of round-off


class Near(NamedTuple):
    """Distances, normals and Hessians of n points relative to a tool in three dimensions.

    Attributes:
        distance: to its surface, positive inside the tool, shape (n,), length.
        normal: gradient of the distance, shape (n, 3).
        hessian: second derivatives of the distance, shape (n, 3, 3), 1/length.
    """

    distance: np.ndarray
    normal: np.ndarray
    hessian: np.ndarray


class LaggedFriction(LaggedStick):
    """The `ContactLaw` of this module.

    Its history variables (`ContactHistory`): `position` is the position at the last accepted state, and `slip` the
    elastic slip g, shape (n, 3), length. Of points in contact, `distance` is the pressure there over k, and
    the depth of `arrival` is N_0/k.

    Args:
        tool: gives its distance with first and second derivatives (`near`).
        mu: coefficient of friction, 0 for none.
        k: penalty, stress/length.
        theta: distance from which on a point counts as touching, length.
        elastic_slip: g_s, length.
    """

    tool: Any
    sticks = False

    def __init__(self, tool: Any, mu: float, k: Any, theta: float, elastic_slip: float):
        super().__init__(tool, k, theta, True)
        self.mu, self.elastic_slip = mu, elastic_slip
        self._last: tuple[np.ndarray, Near] | None = None
        self._ahead: tuple[ContactHistory, np.ndarray] | None = None

    def part(self, points: np.ndarray | slice) -> LaggedFriction:
        """Return the law of some of the points.

        Args:
            points: numbers of the points, or a slice.

        Returns:
            The law.
        """
        return LaggedFriction(self.tool, self.mu, self.k, self.theta, self.elastic_slip)

    def pulling(self, x: np.ndarray, old: ContactHistory) -> np.ndarray:
        """Return the mask of points in contact that are in tension, that is outside the tool.

        Args:
            x: positions, shape (n, 3), length.
            old: history variables.

        Returns:
            Mask, shape (n,).
        """
        return self.held(old) & (self.distance(x) < -SMALL_GAP * self.theta)

    def start(self, x: np.ndarray) -> ContactHistory:
        return super().start(x)._replace(slip=np.zeros_like(x))

    def pressure(self, history: ContactHistory) -> np.ndarray:
        """Return the contact pressure of a state.

        Args:
            history: history variables.

        Returns:
            Pressure N, shape (n,), stress.
        """
        return np.asarray(self.k * np.maximum(history.distance, 0.0))

    def pressure_ahead(self, old: ContactHistory) -> np.ndarray:
        """Return the pressure that limits friction in the next step.

        Args:
            old: history variables.

        Returns:
            Pressure N_0, shape (n,), stress.
        """
        if self._ahead is None or self._ahead[0] is not old:
            now, change = np.maximum(old.distance, 0.0), old.arrival - old.position
            depth = now + np.einsum("ni,ni->n", self.tool.near(old.position).normal, change) if change.any() else now
            self._ahead = old, self.k * np.clip(depth, _LEAST * now, _MOST * now)
        return self._ahead[1]

    def at_pressure(self, old: ContactHistory, pressure: np.ndarray) -> np.ndarray:
        """Return positions of gap closure for which `pressure_ahead` returns a given pressure.

        Args:
            old: history variables.
            pressure: the pressure, shape (n,), stress.

        Returns:
            `ContactHistory.arrival`, shape (n, 3), length.
        """
        change = pressure / self.k - np.maximum(old.distance, 0.0)
        return np.asarray(old.position + change[:, None] * self.tool.near(old.position).normal)

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions, linearised at the predicted positions; see `ContactLaw`.

        A point that reverses against the `sense` of the last iteration sticks for one iteration. Otherwise Newton's
        method would oscillate over the narrow range of elastic slip.

        Args:
            x: positions, shape (n, 3), length.
            old: history variables.
            sense: angle of sliding in the previous iteration, shape (n,), or None.
            expected: positions predicted by the previous iteration, or None.

        Returns:
            Tractions.
        """
        assert old is not None
        at, zero = x if expected is None else expected.position, np.zeros(len(x))
        rows, near = self.near(at, old)
        d, n = near.distance, near.normal
        moved = old.slip[rows] + at[rows] - old.position[rows]
        along = np.einsum("ni,ni->n", n, moved)
        g = moved - along[:, None] * n
        size, basis = np.linalg.norm(g, axis=1), _basis(n)
        slides = (size > self.elastic_slip) & (self.mu > 0)
        if sense is not None:
            before = np.cos(sense[rows, None]) * basis[0] + np.sin(sense[rows, None]) * basis[1]
            slides &= (sense[rows] == 0) | (np.einsum("ni,ni->n", before, g) > 0)
        way = np.where(slides[:, None], g, 0.0) / np.maximum(size, 1e-300)[:, None]
        stiff = self.mu * self.pressure_ahead(old)[rows] / np.where(slides, size, self.elastic_slip)

        def stiffness() -> np.ndarray:
            """Return the stiffness, shape (n, 3, 3), stress/length."""
            bends = outer(n, np.einsum("nij,nj->ni", near.hessian, moved)) + along[:, None, None] * near.hessian
            dg = np.eye(3) - outer(n, n) - bends
            dg -= outer(way, np.einsum("ni,nij->nj", way, dg))
            depth = d if expected is None else expected.distance[rows]
            found = np.zeros((*x.shape, 3))
            found[rows] = self.k * (outer(n, n) + depth[:, None, None] * near.hessian) + stiff[:, None, None] * dg
            return found

        def history() -> ContactHistory:
            """Return the new history variables."""
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
        if at is not x:
            found.force = force + np.einsum("nij,nj->ni", found.stiffness, x - at)
        return found

    def near(self, x: np.ndarray, old: ContactHistory) -> tuple[np.ndarray, Near]:
        """Return the points in contact and their geometry relative to the tool.

        Args:
            x: positions, shape (n, 3), length.
            old: history variables.

        Returns:
            Numbers of the m points in contact, shape (m,), and their geometry.
        """
        rows = np.flatnonzero(self.held(old))
        return rows, self._near(x[rows])

    def motion(self, x: np.ndarray, old: ContactHistory | None) -> Motion:
        assert old is not None
        d, n = np.zeros(len(x)), np.zeros_like(x)
        rows, near = self.near(x, old)
        d[rows], n[rows] = near.distance, near.normal
        return Motion(x, d, n, np.zeros(len(x)), np.zeros_like(x))

    def _near(self, x: np.ndarray) -> Near:
        """Return the geometry of points relative to the tool; the last result is kept."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.tool.near(x)
        return self._last[1]


class _Tractions(Tractions):
    """`Tractions` whose `sense` is the angle of sliding in the tangent plane, 0 at points that do not slide."""

    @property
    def status(self) -> np.ndarray:
        touching = np.where(self.sense != 0, ContactStatus.SLIDES, ContactStatus.STICKS)
        return np.where(self.normal != 0, touching, ContactStatus.FREE).astype(np.int8)


def _basis(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors normal to unit vectors, shape (n, 3) each: the basis of the angles of sliding."""
    axis = np.eye(3)[np.abs(normal).argmin(1)]
    first = np.cross(axis, normal)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(normal, first)
