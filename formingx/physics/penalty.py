"""Contact law of a penalty with a regularised ramp and friction; the module `contact` states its equations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..tools.shapes import Nearest
from ..tools.tool import PlaneTool
from .contact_law import ContactHistory, Motion, NormalLaw, Tractions, outer

STICKS = 100.0
"""Coefficient of friction from which on a point counts as sticking."""

RAMP_EDGE = 1e-7
"""Distance from the outer edge of the ramp, over theta, that is negligible."""


class Law(NormalLaw):
    """Contact law with a penalty, a regularised ramp and friction, eqs. (5.7) to (5.14) of Song (1993).

    Args:
        tool: the tool, which gives the signed distance.
        mu: coefficient of friction, shape () or (n,); infinite for stick.
        k: penalty, shape () or (n,), stress/length.
        theta: half-width of the ramp, length: contact begins at the signed distance -theta.
        elastic_slip: elastic slip g_s at which a point begins to slide, length; not used by stick.
        shift: reduction of the signed distances, length, shape () or (n,).
        pulls: True if points in contact never separate.
        shear_limit: function of pressure and mu that returns the shear stress at which points slide and its derivative,
            see `Contact.shear_limit`; None for Coulomb's mu p.
    """

    predictable = True

    def __init__(self, tool: PlaneTool, mu: np.ndarray | float, k: np.ndarray | float, theta: float,
                 elastic_slip: float, shift: np.ndarray | float = 0.0, pulls: bool = False,
                 shear_limit: Callable | None = None):
        super().__init__(tool, k, theta, shift)
        self.shear_limit = shear_limit or (lambda pressure, mu: (mu * pressure, mu))
        self.elastic_slip, self.pulls = elastic_slip, pulls
        self._set_friction(mu)
        self._slid: tuple[Nearest, ContactHistory, tuple] | None = None      # last geometry and history, and their slip

    def with_friction(self, mu: np.ndarray | float) -> Law:
        """Return a copy of the law with other coefficients of friction.

        Args:
            mu: coefficient of friction, shape () or (n,).

        Returns:
            The new law.
        """
        law = self._with()
        law._set_friction(mu)
        return law

    def _set_friction(self, mu: np.ndarray | float) -> None:
        """Set the coefficients of friction and the flags that depend on them."""
        self.mu, self._slides = mu, bool(np.all(np.isfinite(mu)))
        self.has_friction = np.ndim(mu) > 0 or bool(mu > 0)
        self.has_history = self.has_friction or self.pulls

    def touching(self, x: np.ndarray, old: ContactHistory | None) -> np.ndarray:
        """Return the mask of the points in contact with the tool, including bonded points.

        Args:
            x: positions relative to the tool, shape (n, 2), length.
            old: history variables of the last accepted state, or None.

        Returns:
            Mask, shape (n,).
        """
        return (self.distance(x) > -self.theta) | self._bonded(old)

    def _bonded(self, old: ContactHistory | None) -> np.ndarray | bool:
        """Return the mask of the points that were in contact and cannot separate, shape (n,); False for no point."""
        return False if not self.pulls or old is None else old.distance > -self.theta

    def ramp(self, d: np.ndarray, bonded: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Evaluate the ramp F(d) of eq. (5.13), or max(d + theta, 0) for contact that does not separate.

        F times the penalty k is the normal traction.

        Args:
            d: signed distances from the tool, shape (n,), length.
            bonded: mask of the points that cannot separate: F = d + theta of either sign.

        Returns:
            F, shape (n,), length; dF/dd, shape (n,).
        """
        if self.pulls:
            slope = np.where(bonded | (d > -self.theta), 1.0, 0.0)
            return slope * (d + self.theta), slope
        slope = np.minimum(np.maximum((d + self.theta) / (2 * self.theta), 0.0), 1.0)      # np.clip is slow
        return np.where(d < self.theta, self.theta * slope**2, d), slope

    def depth(self, pressure: np.ndarray) -> np.ndarray:
        """Return the signed distance from the tool at which the normal traction has a given value.

        Args:
            pressure: normal traction, shape (n,), stress.

        Returns:
            Signed distance, positive inside the tool, shape (n,), length.
        """
        over = pressure / (self.k * self.theta)
        return self.theta * ((np.where(over > 1, over, 2 * np.sqrt(over) - 1)) if not self.pulls else over - 1)

    @property
    def sticks(self) -> np.ndarray | bool:
        """True, or the mask of shape (n,), for points that never slide."""
        return self.mu >= STICKS

    @property
    def friction(self) -> np.ndarray:
        """Ratio T/N at which a point slides under a vanishing pressure, shape () or (n,); infinite with stick."""
        sticks = np.asarray(self.sticks)
        grows = self.shear_limit(np.zeros(np.shape(self.mu)), np.where(sticks, 0.0, self.mu))[1]
        return np.where(sticks, np.inf, grows)

    def energy(self, x: np.ndarray, old: ContactHistory | None = None) -> np.ndarray:
        """Return the energy of the normal traction, the integral of N over the distance.

        Args:
            x: positions relative to the tool, shape (n, 2), length.
            old: history variables of the last accepted state, or None.

        Returns:
            Energy per unit reference area, shape (n,), stress times length.
        """
        d, theta = self.distance(x), self.theta
        if self.pulls:
            return self.k * np.where(self._bonded(old) | (d > -theta), (d + theta) ** 2 / 2, 0.0)
        inside = np.clip(d + theta, 0.0, 2 * theta)
        return self.k * np.where(d < theta, inside**3 / (12 * theta), d**2 / 2 + theta**2 / 6)

    def start(self, x: np.ndarray) -> ContactHistory:
        """Return the history variables of points that have not slipped.

        Args:
            x: initial positions relative to the tool, shape (n, 2), length.

        Returns:
            The history variables.
        """
        d = self.distance(x)
        if self.pulls:                                      # at the outer edge of the ramp it sticks, free of stress
            d = np.where(np.abs(d / self.theta + 1) < RAMP_EDGE, -(1 - RAMP_EDGE) * self.theta, d)
        return _history(x.copy(), d, np.zeros(len(x)))

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the contact tractions at points.

        Args:
            x: positions relative to the tool, shape (n, 2), length.
            old: history variables of the last accepted state; not used without friction.
            sense: sense of sliding in the previous Newton iteration, shape (n,). A point whose sense would reverse
                sticks for this one iteration; otherwise Newton's method would alternate across the narrow range of
                stick.
            expected: distances and slips at which the law is linearised, those predicted by the previous iteration;
                None: those at x. With values at x, the curvature of tool and motion, times a stiff penalty, would
                dominate.

        Returns:
            Tractions, with their stiffness and the new history variables.
        """
        near, k = self.nearest(x), self.k
        d, n, t, bend = near.distance, near.normal, near.tangent, near.curvature
        centre = d if expected is None else expected.distance
        bonded = self._bonded(old)
        zero: np.ndarray = np.zeros(len(x))
        if centre.max(initial=-np.inf) <= -self.theta and not np.any(bonded):         # no point touches
            return Tractions(np.zeros(x.shape), zero, zero, zero, lambda: np.zeros((*x.shape, x.shape[1])),
                             lambda: _history(x, d, zero))
        F, slope = self.ramp(centre, bonded)
        pressed, ahead = k * F, d - centre
        N = pressed + k * slope * ahead
        force = N[:, None] * n
        kept_at = np.where(bonded, np.maximum(d, 0.0), d) if self.has_history else d            # stays in contact
        if not self.has_friction:
            return Tractions(force, N, zero, zero, lambda: outer(n, (k * slope)[:, None] * n)
                             + outer(t, (pressed * bend)[:, None] * t), lambda: _history(x, kept_at, zero))
        assert old is not None
        g, dg = self._slip(x, near, t, old)
        predicted = g if expected is None else expected.slip
        s, rising = self._resistance(centre, pressed, slope)
        T, sliding = s * g + rising * ahead * predicted, np.zeros(len(x), dtype=bool)
        sense_now, bent, grows = zero, T, 0.0
        if self._slides:
            trial = s * predicted
            turned = False if sense is None else np.sign(trial) * sense < 0
            limit, grows = self.shear_limit(pressed, self.mu)
            sliding = (np.abs(trial) > limit) & ~np.asarray(turned)
            sense_now = np.where(sliding, np.sign(trial), 0.0)
            T, bent = np.where(sliding, sense_now * (limit + grows * (N - pressed)), T), np.clip(T, -limit, limit)
        force = force + T[:, None] * t

        def stiffness() -> np.ndarray:
            stuck = s[:, None] * dg + (rising * predicted)[:, None] * n
            dT = np.where(sliding[:, None], (sense_now * grows * k * slope)[:, None] * n, stuck)
            return (outer(n, (k * slope)[:, None] * n - (bent * bend)[:, None] * t)
                    + outer(t, (pressed * bend)[:, None] * t + dT))

        def history() -> ContactHistory:
            kept = np.divide(T, s, out=zero.copy(), where=s > 0)
            kept *= 1 + 1e-9 * np.abs(sense_now)             # sliding points go on sliding, in spite of round-off
            return _history(x, kept_at, kept)
        return Tractions(force, N, T, sense_now, stiffness, history)

    def _resistance(self, d: np.ndarray, pressed: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the tangential stiffness T/g of elastic slip, and its derivative by the distance, shape (n,) each.

        Args:
            d: signed distances, shape (n,), length.
            pressed: normal tractions at d, shape (n,), stress.
            slope: derivatives of the ramp at d, shape (n,).
        """
        sticks, k = self.sticks, self.k
        if np.ndim(sticks) == 0 and not sticks:
            limit, grows = self.shear_limit(pressed, self.mu)
            return limit / self.elastic_slip, grows / self.elastic_slip * k * slope
        rising = (np.abs(d) < self.theta) * (k / (2 * self.theta) * (not self.pulls))
        if np.ndim(sticks) == 0:
            return k * slope, rising
        limit, grows = self.shear_limit(pressed, np.where(sticks, 0.0, self.mu))
        return (np.where(sticks, k * slope, limit / self.elastic_slip),
                np.where(sticks, rising, grows / self.elastic_slip * k * slope))

    def stiffness_round(self, x: np.ndarray, old: ContactHistory | None, radius: np.ndarray) -> np.ndarray:
        r"""Return the derivative of the circumferential traction with respect to the circumferential motion.

        .. math:: \frac{N n_r}{r}

        For a sticking point the stiffness of the elastic slip is added.

        Args:
            x: positions relative to the tool, shape (n, 2), length.
            old: history variables of the last accepted state, or None.
            radius: radius r of the points, shape (n,), length; infinite in plane strain.

        Returns:
            Stiffness, shape (n,), stress/length.
        """
        turned, near, found = super().stiffness_round(x, old, radius), self.nearest(x), self.tractions(x, old)
        if not self.has_friction:
            return turned
        F, slope = self.ramp(near.distance, self._bonded(old))
        return turned + np.where(found.sense == 0, self._resistance(near.distance, self.k * F, slope)[0], 0.0)

    def motion(self, x: np.ndarray, old: ContactHistory | None) -> Motion:
        """Return distances and elastic slips of points, with their gradients.

        Args:
            x: positions relative to the tool, shape (n, 2), length.
            old: history variables of the last accepted state, or None: slips are 0.

        Returns:
            Distances, normals, slips and gradients of the slip at x.
        """
        near = self.nearest(x)
        g, dg = (np.zeros(len(x)), 0 * x) if old is None else self._slip(x, near, near.tangent, old)
        return Motion(x, near.distance, near.normal, g, dg)

    def stiffness_ahead(self, x: np.ndarray, old: ContactHistory | None, arrived: np.ndarray) -> np.ndarray:
        """Return the stiffness at an accepted state towards the next step, in which points that just closed are stiff.

        At the outer edge of the ramp a point has no stiffness. The tangent of the path would let such a point slip
        where it will stick. Its stiffness is therefore evaluated halfway between the outer edge and distance 0.

        Args:
            x: positions relative to the tool, shape (n, 2), length.
            old: history variables of the accepted state, or None.
            arrived: mask of the points whose gap closed in the last step, shape (n,).

        Returns:
            Stiffness, shape (n, 2, 2), stress/length.
        """
        near, now = self.nearest(x), self.tractions(x, old)
        # a body may rest at the outer edge of the ramp
        about = np.abs(near.distance / self.theta + 1.025) < 0.025 + 2 * RAMP_EDGE
        touching = (arrived | about) & (now.sense == 0)
        press = np.where(touching, np.maximum(-0.5 * self.theta - near.distance, 0.0), 0.0)
        if old is not None:
            distance = np.where(self._bonded(old), old.distance, near.distance + press)
            old = old._replace(distance=distance, position=x)
        pressed = self.tractions(x + press[:, None] * near.normal, old)
        return np.where((press > 0)[:, None, None], pressed.stiffness, now.stiffness)

    def _slip(self, x: np.ndarray, near: Nearest, tangent: np.ndarray,
              old: ContactHistory) -> tuple[np.ndarray, np.ndarray]:
        """Return the elastic slip g that sticking points would have at x, shape (n,), and its gradient, shape (n, 2).

        The result is stored for repeated calls with the same arguments.
        """
        if self._slid is not None and self._slid[0] is near and self._slid[1] is old:
            return self._slid[2]
        touched = old.distance > -self.theta
        motion = x - np.where(touched[:, None], old.position, old.arrival)
        slips = ~np.isnan(motion[:, 0])
        motion = np.where(slips[:, None], motion, 0.0)
        along = np.einsum("ni,ni->n", tangent, motion)
        across = np.einsum("ni,ni->n", near.normal, motion)
        found = old.slip + along, tangent * (slips * (1 - near.curvature * across))[:, None]
        self._slid = near, old, found
        return found


def _history(x: np.ndarray, d: np.ndarray, slip: np.ndarray) -> ContactHistory:
    """Return history variables with position x, distance d and elastic slip; a later gap closure is expected at x."""
    return ContactHistory(x, d, slip, x)
