"""Contact law of a penalty with a regularised ramp and friction; the module `contact` states its equations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np

from .._jit import CFunctions
from ..tools.shapes import Nearest
from ..tools.tool import PlaneTool
from .contact_law import ContactHistory, ContactLaw, Motion, NormalLaw, Tractions, outer

_C = CFunctions("physics/penalty.c")

STICKS = 100.0
"""Coefficient of friction from which on a point counts as sticking."""

RAMP_EDGE = 1e-7
"""Negligible distance from the outer edge of the ramp, divided by theta."""


class Law(NormalLaw):
    r"""Contact law with a penalty k, a regularised ramp F and friction with an elastic slip.

    .. math:: N = k F(d), \qquad T_{stick} = k F'(d)\, g, \qquad
              T_{Coulomb} = \mu N \min(|g| / g_s, 1)\, \operatorname{sign} g

    N and T are the normal and tangential traction, d is the signed distance (positive inside the tool), and g the
    elastic slip. The ramp F is (d + theta)^2/(4 theta) if abs(d) < theta, else max(d, 0). N is given by Song (1993),
    eqs. (5.7) and (5.13); T tends to mu N, eq. (5.9), for a small g_s.

    Args:
        tool: the tool, which gives the signed distance.
        mu: coefficient of friction, shape () or (n,); infinite for stick.
        k: penalty, shape () or (n,), stress/length.
        theta: half-width of the ramp, length: contact begins at the signed distance -theta.
        elastic_slip: elastic slip g_s at which a point begins to slide, length; not used by stick.
        shift: length by which the signed distances are reduced, shape () or (n,).
        adhesive: True if points in contact never separate and can carry tension.
        shear_limit: function of the pressure p, shape (n,), and mu, shape () or (n,). It returns the shear stress at
            which points slide, and its derivative by p. None for Coulomb's mu p.
    """

    predictable = True

    def __init__(self, tool: PlaneTool, mu: np.ndarray | float, k: np.ndarray | float, theta: float,
                 elastic_slip: float, shift: np.ndarray | float = 0.0, adhesive: bool = False,
                 shear_limit: Callable | None = None):
        super().__init__(tool, k, theta, shift)
        self.shear_limit = shear_limit
        self.elastic_slip, self.adhesive = elastic_slip, adhesive
        self._set_friction(mu)
        self._slid: tuple[Nearest, ContactHistory, tuple] | None = None      # last geometry and history, and their slip
        self._constants: tuple | None = None

    def with_friction(self, mu: np.ndarray | float) -> Law:
        """Return a copy of the law with other coefficients of friction, shape () or (n,)."""
        law = self._with()
        law._set_friction(mu)
        return law

    def _set_friction(self, mu: np.ndarray | float) -> None:
        """Set the coefficients of friction mu, shape () or (n,), and whether the law has friction and history."""
        self.mu, self._slides = mu, bool(np.all(np.isfinite(mu)))
        self.has_friction = np.ndim(mu) > 0 or bool(mu > 0)
        self.has_history = self.has_friction or self.adhesive

    def _with(self, **other: Any) -> Self:
        return super()._with(_constants=None, **other)

    def _given(self) -> tuple:
        """Return the constants of the law as arguments of the C function `tractions`, stored for repeated calls."""
        if self._constants is None:
            flags = (self.adhesive, self.has_friction, self._slides)
            self._constants = (np.array([self.theta, self.elastic_slip, *flags, STICKS]),
                               self.k, np.ndim(self.k), self.mu, np.ndim(self.mu))
        return self._constants

    def touching(self, x: np.ndarray, old: ContactHistory | None) -> np.ndarray:
        """Return the mask of the points in contact, shape (n,), bonded ones included; x: shape (n, 2), length."""
        return (self.distance(x) > -self.theta) | self._bonded(old)

    def _bonded(self, old: ContactHistory | None) -> np.ndarray | bool:
        """Return the mask of the points that were in contact and cannot separate, shape (n,); False for no point."""
        return False if not self.adhesive or old is None else old.distance > -self.theta

    def ramp(self, d: np.ndarray, bonded: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        r"""Return the contact ramp F(d), eq. (5.13) of Song (1993), shape (n,), length, and its derivative, shape (n,).

        .. math:: F(d) = \begin{cases} 0 & d \le -\theta \\ (d + \theta)^2 / (4\theta) & |d| < \theta \\
                  d & d \ge \theta \end{cases}

        d: signed distances, positive inside, shape (n,), length. F times the penalty k is the normal traction. Without
        separation F is max(d + theta, 0), and d + theta at `bonded` points, which may be negative (tension).
        """
        F, slope = np.empty(len(d)), np.empty(len(d))
        _C.ramp(len(d), self.theta, self.adhesive, d, None if bonded is False else bonded, F, slope)
        return F, slope

    def depth(self, pressure: np.ndarray) -> np.ndarray:
        r"""Return the signed distance, shape (n,), length, at which the normal traction is N, shape (n,), stress.

        .. math:: d = \begin{cases} N/k & N > k \theta \\ 2 \sqrt{N \theta / k} - \theta & \text{else} \end{cases}

        For a contact that does not separate, d is N/k - theta.
        """
        over = pressure / (self.k * self.theta)
        return self.theta * ((np.where(over > 1, over, 2 * np.sqrt(over) - 1)) if not self.adhesive else over - 1)

    @property
    def sticks(self) -> np.ndarray | bool:
        """True, or the mask of shape (n,), for points that never slide."""
        return self.mu >= STICKS

    @property
    def friction(self) -> np.ndarray:
        """Ratio of tangential to normal traction at which a point slides, shape () or (n,); infinite for stick.

        With a shear limit that is no constant ratio, it is that of a pressure that tends to 0.
        """
        sticks, mu = np.asarray(self.sticks), np.asarray(self.mu)
        if self.shear_limit is not None:
            mu = self.shear_limit(np.zeros(mu.shape), np.where(sticks, 0.0, mu))[1]
        return np.where(sticks, np.inf, mu)

    def energy(self, x: np.ndarray, old: ContactHistory | None = None) -> np.ndarray:
        r"""Return the energy of the normal traction N per reference area, shape (n,), stress times length.

        .. math:: \int_{-\theta}^{d} N \, ds = \begin{cases} k (d + \theta)^3 / (12 \theta) & |d| < \theta \\
                  k (d^2/2 + \theta^2/6) & d \ge \theta \end{cases}

        x: shape (n, 2), length. It is 0 for open points, and k (d + theta)^2/2 for a contact that does not separate.
        """
        d, theta = self.distance(x), self.theta
        if self.adhesive:
            return self.k * np.where(self._bonded(old) | (d > -theta), (d + theta) ** 2 / 2, 0.0)
        inside = np.clip(d + theta, 0.0, 2 * theta)
        return self.k * np.where(d < theta, inside**3 / (12 * theta), d**2 / 2 + theta**2 / 6)

    def start(self, x: np.ndarray) -> ContactHistory:
        """Return the history variables of points at x, shape (n, 2), length, that have not slipped."""
        d = self.distance(x)
        if self.adhesive:                                   # at the outer edge of the ramp it sticks, free of stress
            d = np.where(np.abs(d / self.theta + 1) < RAMP_EDGE, -(1 - RAMP_EDGE) * self.theta, d)
        return _history(x.copy(), d, np.zeros(len(x)))

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions at positions x, shape (n, 2), length, with their stiffness and history.

        A point whose `sense`, shape (n,), would reverse sticks for one iteration: else Newton's method would alternate.
        `expected`: distances and slips predicted to first order. On a curved tool those at x differ in second order,
        which a stiff penalty turns into large tractions.
        """
        n, out = len(x), self._evaluate(x, old, sense, expected)
        N, T, slides = out[2 * n:3 * n], out[3 * n:4 * n], out[4 * n:5 * n]
        return Tractions(out[:2 * n].reshape(n, 2), N, T, slides, lambda: out[5 * n:9 * n].reshape(n, 2, 2),
                         lambda: _history(x, out[9 * n:10 * n], out[10 * n:11 * n]))

    def _evaluate(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> np.ndarray:
        """Return the output of the C function `tractions` at n positions x, one array of shape (12 n,).

        In this order it has the traction vectors (2 n), normal tractions, tangential tractions and senses of sliding (n
        each), stiffness (4 n), signed distances, elastic slips and tangential stiffness (n each).
        """
        near, out = self.nearest(x), np.empty(12 * len(x))
        g = dg = limit = grows = None
        if self.has_friction:
            assert old is not None
            g, dg = self._slip(x, near, old)
            if self.shear_limit is not None:
                centre = near.distance if expected is None else expected.distance
                mu = self.mu if self._slides else np.where(self.sticks, 0.0, self.mu)
                found = self.shear_limit(self.k * self.ramp(centre, self._bonded(old))[0], mu)
                limit, grows = (np.broadcast_to(a, len(x)) for a in found)
        ahead = (None, None) if expected is None else (expected.distance, expected.slip)
        _C.tractions(len(x), *self._given(), near.distance, near.normal, near.curvature,
                     None if old is None else old.distance, g, dg, *ahead, sense, limit, grows, out)
        return out

    def hoop_stiffness(self, x: np.ndarray, old: ContactHistory | None, radius: np.ndarray) -> np.ndarray:
        r"""Return the derivative of the hoop traction by the hoop displacement, shape (n,), stress/length.

        .. math:: \frac{N n_r}{r}

        N is the normal traction, n_r the radial component of the normal of the tool. The stiffness of the elastic slip
        is added for a sticking point. radius: deformed, shape (n,), length; infinite in plane strain.
        """
        turned = super().hoop_stiffness(x, old, radius)
        if not self.has_friction:
            return turned
        n, out = len(x), self._evaluate(x, old)
        return turned + np.where(out[4 * n:5 * n] == 0, out[11 * n:], 0.0)           # where points do not slide

    def motion(self, x: np.ndarray, old: ContactHistory | None) -> Motion:
        """Return distances and elastic slips at x, shape (n, 2), length, with their gradients, shape (n, 2).

        Slips are 0 without history.
        """
        near = self.nearest(x)
        g, dg = (np.zeros(len(x)), 0 * x) if old is None else self._slip(x, near, old)
        return Motion(x, near.distance, near.normal, g, dg)

    def one_sided_stiffness(self, x: np.ndarray, old: ContactHistory | None, newly_closed: np.ndarray) -> np.ndarray:
        """Return the stiffness at an accepted state for the next step, shape (n, 2, 2), stress/length.

        A point whose gap just closed (mask `newly_closed`, shape (n,)) has the distance -theta, where the stiffness is
        0. On the tangent it would slip, so it gets the stiffness at -theta/2.
        """
        near, now = self.nearest(x), self.tractions(x, old)
        # a body may rest at the outer edge of the ramp
        about = np.abs(near.distance / self.theta + 1.025) < 0.025 + 2 * RAMP_EDGE
        touching = (newly_closed | about) & (now.sense == 0)
        press = np.where(touching, np.maximum(-0.5 * self.theta - near.distance, 0.0), 0.0)
        if old is not None:
            distance = np.where(self._bonded(old), old.distance, near.distance + press)
            old = old._replace(distance=distance, position=x)
        pressed = self.tractions(x + press[:, None] * near.normal, old)
        return np.where((press > 0)[:, None, None], pressed.stiffness, now.stiffness)

    def _slip(self, x: np.ndarray, near: Nearest, old: ContactHistory) -> tuple[np.ndarray, np.ndarray]:
        """Return the elastic slip that sticking points would have at x, shape (n,), and its gradient, shape (n, 2).

        The result is stored for repeated calls. near: result of `nearest` at x.
        """
        if self._slid is None or self._slid[0] is not near or self._slid[1] is not old:
            g, dg = np.empty(len(x)), np.empty((len(x), 2))
            _C.elastic_slips(len(x), self.theta, x, near.normal, near.curvature, *old, g, dg)
            self._slid = near, old, (g, dg)
        return self._slid[2]


def symmetric_stiffness(law: ContactLaw, x: np.ndarray, old: ContactHistory | None) -> np.ndarray:
    """Return a symmetric stiffness of points in a section, shape (n, 2, 2), stress/length, for second variations.

    It leaves out the coupling of sliding friction to the normal displacement. That has no energy, and its symmetric
    part would count every such point as an unstable mode.
    """
    if not law.has_friction:
        return law.tractions(x, old).stiffness
    tangent = law.nearest(x).tangent
    sticking = law.hoop_stiffness(x, old, np.full(len(x), np.inf))
    return law.with_friction(0.0).tractions(x, old).stiffness + outer(tangent, sticking[:, None] * tangent)


def _history(x: np.ndarray, d: np.ndarray, slip: np.ndarray) -> ContactHistory:
    """Return a `ContactHistory` with closures at the present positions, shape (n, 2); d, slip: (n,), length."""
    return ContactHistory(x, d, slip, x)
