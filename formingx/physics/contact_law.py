"""Contact laws, relations of tractions to motion at points of a face and a rigid tool: interface, and penalty law.

Positions, motions and tractions of n points have c components each, 2 in the plane of a section: shape (n, c). They are
relative to the tool. A signed distance is positive inside the tool.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from .._jit import CFunctions
from ..tools.profile import Nearest, Tool
from ..tools.tool import PlaneTool
from ..values.tolerances import FAR

_C = CFunctions("physics/contact_law.c")

STICKS = 100.0
"""Coefficient of friction from which on a point counts as sticking."""

RAMP_EDGE = 1e-7
"""Negligible distance from the outer edge of the ramp, divided by theta."""


class ContactStatus(IntEnum):
    """Status of a contact point: open (FREE), sticking, or sliding.

    SLIDES is sliding along the positive tangent of the tool, SLIDES_BACK along the negative tangent.
    """

    SLIDES_BACK = -1
    STICKS = 0
    SLIDES = 1
    FREE = 2


class ContactHistory(NamedTuple):
    """History variables of n contact points with c coordinates at the last accepted state, relative to the tool.

    Attributes:
        position: positions, shape (n, c), length.
        distance: signed distances from the tool, positive inside, shape (n,), length.
        slip: elastic slips g, shape (n,), length.
        closure: predicted position of an open point when its gap closes in the next step, shape (n, c), length. NaN
            excludes the point from friction in that step.
    """

    position: np.ndarray
    distance: np.ndarray
    slip: np.ndarray
    closure: np.ndarray


class Tractions:
    """Contact tractions with c components that the body exerts on the tool at n points, per unit reference area.

    Args:
        force: traction vectors, shape (n, c), stress. They enter the residual (internal minus external forces) with
            positive sign.
        normal: normal tractions N, shape (n,), stress, positive in compression.
        tangential: tangential tractions T, shape (n,), stress.
        sense: sense of sliding, 1 or -1 along the tangent of the tool, 0 for a sticking point, shape (n,).
        stiffness: function that computes the property `stiffness` when it is first used.
        history: function that computes the property `history` when it is first used.
    """

    def __init__(self, force: np.ndarray, normal: np.ndarray, tangential: np.ndarray, sense: np.ndarray,
                 stiffness: Callable[[], np.ndarray], history: Callable[[], ContactHistory]):
        self.force, self.normal, self.tangential, self.sense = force, normal, tangential, sense
        self._stiffness, self._history = stiffness, history

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Derivative of the traction vectors by the positions of their points, shape (n, c, c), stress/length."""
        return self._stiffness()

    @cached_property
    def history(self) -> ContactHistory:
        """`ContactHistory` of the n points in the state with these tractions, valid once the state is accepted."""
        return self._history()

    @cached_property
    def status(self) -> np.ndarray:
        """`ContactStatus` of each point, shape (n,): a point without normal traction is open."""
        return np.where(self.normal != 0, self.sense, ContactStatus.FREE).astype(np.int8)


class Motion(NamedTuple):
    """Distance and elastic slip of n points with c coordinates, with their gradients, for a first-order prediction.

    Attributes:
        position: positions relative to the tool at which the other values hold, shape (n, c), length.
        distance: signed distances from the tool, positive inside, shape (n,), length.
        normal: gradients of the distance, shape (n, c).
        slip: elastic slips, shape (n,), length.
        along: gradients of the slip, shape (n, c).
    """

    position: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    slip: np.ndarray
    along: np.ndarray

    def to(self, x: np.ndarray) -> Motion:
        """Predict distances and slips to first order at positions x, shape (n, c), length; gradients stay."""
        dx = x - self.position
        return Motion(x, self.distance + np.einsum("ni,ni->n", self.normal, dx), self.normal,
                      self.slip + np.einsum("ni,ni->n", self.along, dx), self.along)


class ContactLaw:
    """Contact law at n points: tractions as a function of the positions x of the points and of their history variables.

    In each increment a contact calls these methods in this order:

    * `motion` and `touching` at its beginning, for distances, slips and points in contact.
    * `tractions` in each Newton iteration, for tractions, stiffness and new history variables. The law is linearised at
      the `Motion` that the iteration before predicts.
    * `one_sided_stiffness` at an accepted state, for the tangent towards the next step.
    * `distance`, `nearest` and `ramp` for the limits of the next step.

    A law derives from this class and defines `theta`, `start`, `touching`, `tractions`, `distance` and `part`. A law of
    a section also defines `nearest` and, for the stability of axisymmetric bodies, `hoop_stiffness`. It defines
    `without` if the solver keeps points open for a step.

    Attributes:
        theta: half-width of the contact ramp, length: contact begins at the signed distance -theta.
        elastic_slip: elastic slip at which a point begins to slide, length.
        shift: reduction of the signed distances, length, a number or shape (n,): first contact is free of stress.
        has_friction: True if tractions depend on the slip.
        has_history: True if tractions depend on the history variables (`ContactHistory`).
        adhesive: True if points in contact can carry tension; `energy` is then the energy of the bond (`Path.work`).
        predictable: True if the law has `friction` and `depth`, as `formingx.physics.contact_law.Law`; several gaps may
            then close in one step.
        sticks: True, or a mask of shape (n,), for points that never slide; used only with friction.
    """

    theta: float
    elastic_slip: float = 0.0
    shift: np.ndarray | float = 0.0
    has_friction: bool = False
    has_history: bool = False
    adhesive: bool = False
    predictable: bool = False
    sticks: np.ndarray | bool = False

    @property
    def profile(self) -> Tool | None:
        """Tool of lines and arcs, if `distance` returns its signed distance less the length `shift`; else None."""
        return None

    def start(self, x: np.ndarray) -> ContactHistory:
        """Return the history variables of points at the beginning of contact analysis, before any slip.

        Args:
            x: positions relative to the tool, shape (n, c), length.

        Returns:
            `ContactHistory` of the n points.
        """
        raise NotImplementedError

    def touching(self, x: np.ndarray, old: ContactHistory | None) -> np.ndarray:
        """Return a mask of the points that are in contact with the tool.

        Args:
            x: positions relative to the tool, shape (n, c), length.
            old: history variables of the last accepted state; None: there are none.

        Returns:
            Mask, shape (n,).
        """
        raise NotImplementedError

    def motion(self, x: np.ndarray, old: ContactHistory | None) -> Motion:
        """Return distances and elastic slips of the points with their gradients.

        The method `tractions` linearises the law at these values. By default all are 0, for a law that is linear in x.

        Args:
            x: positions relative to the tool, shape (n, c), length.
            old: history variables of the last accepted state; None: there are none.

        Returns:
            Distances, positive inside the tool, and slips, shape (n,), length; their gradients, shape (n, c).
        """
        return Motion(x, np.zeros(len(x)), np.zeros_like(x), np.zeros(len(x)), np.zeros_like(x))

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the contact tractions at the points.

        Args:
            x: positions relative to the tool, shape (n, c), length.
            old: history variables of the last accepted state; None: there are none.
            sense: sense of sliding in the last Newton iteration, 1 or -1, 0 for stick, shape (n,); None in the first.
            expected: distances and slips at which the law is linearised; None: those at x.

        Returns:
            Tractions with their stiffness and the new history variables.
        """
        raise NotImplementedError

    def one_sided_stiffness(self, x: np.ndarray, old: ContactHistory | None, newly_closed: np.ndarray) -> np.ndarray:
        """Return the stiffness of the points at an accepted state, for the tangent towards the next step.

        A point whose gap has just closed lies at the outer edge of the contact ramp, where the stiffness is 0. A law
        may return its stiffness further inside the ramp instead. The default is the stiffness of `tractions`.

        Args:
            x: positions relative to the tool, shape (n, c), length.
            old: history variables of the accepted state; None: there are none.
            newly_closed: mask of the points whose gap closed in the last step, shape (n,).

        Returns:
            Derivative of the tractions with respect to the positions, shape (n, c, c), stress/length.
        """
        return self.tractions(x, old).stiffness

    def hoop_stiffness(self, x: np.ndarray, old: ContactHistory | None, radius: np.ndarray) -> np.ndarray:
        """Return the derivative of the circumferential traction with respect to the circumferential displacement.

        The second variation of non-axisymmetric modes of an axisymmetric body uses this stiffness.

        Args:
            x: positions relative to the tool, shape (n, c), length.
            old: history variables of the last accepted state; None: there are none.
            radius: deformed radius of the points, shape (n,), length; infinite in plane strain.

        Returns:
            Stiffness, shape (n,), stress/length.
        """
        raise NotImplementedError

    def distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distances of points from the tool, positive inside, less the length `shift` of the law.

        Args:
            x: positions relative to the tool, shape (n, c), or m positions of each point, shape (m, n, c), length.

        Returns:
            Signed distances, shape (n,) or (m, n), length.
        """
        raise NotImplementedError

    def nearest(self, x: np.ndarray) -> Nearest:
        """Return the geometry of the tool at its points nearest to the contact points.

        Args:
            x: positions relative to the tool, shape (n, c), length.

        Returns:
            Signed distances less the length `shift` of the law, positive inside the tool, shape (n,), length. Unit
            normals (gradients of the distance), shape (n, c), and curvatures, shape (n,), 1/length.
        """
        raise NotImplementedError

    def ramp(self, d: np.ndarray, bonded: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return the function F(d) of the normal traction, and its derivative; by default 0.

        .. math:: N = k F(d)

        N is the normal traction and k the penalty.

        Args:
            d: signed distances from the tool, positive inside, shape (n,), length.
            bonded: mask of the points that cannot separate, shape (n,), or False.

        Returns:
            F, shape (n,), length; dF/dd, shape (n,).
        """
        return np.zeros(len(d)), np.zeros(len(d))

    def energy(self, x: np.ndarray, old: ContactHistory | None = None) -> np.ndarray:
        """Return the energy of the normal tractions per unit reference area; by default 0.

        Args:
            x: positions relative to the tool, shape (n, c), length.
            old: history variables of the last accepted state; None: there are none.

        Returns:
            Energy per area, shape (n,), stress times length.
        """
        return np.zeros(len(x))

    def gap_closures(self, start: np.ndarray, velocity: np.ndarray, free: np.ndarray, length: float) -> np.ndarray:
        """Return the arc length at which the gap of each point closes, shape (n,); `length` if it stays open.

        It is `length`, too, for points outside the mask `free`, shape (n,), which are closed. start, velocity:
        positions relative to the tool and d/ds, shape (n, c), length.
        """
        arc_lengths, profile = np.full(len(start), float(length)), self.profile
        if profile is not None:
            _C.gap_closures(len(start), start, velocity, free, 16, length / 16, self.theta, self.shift,
                            np.ndim(self.shift), len(profile.table), profile.lines, profile.table, arc_lengths)
            return arc_lengths
        at = length / 16 * np.arange(17)
        travels = 1.01 * length * np.linalg.norm(velocity, axis=1)             # bound of the approach of each point
        near = np.flatnonzero(free & (self.distance(start) + travels > -self.theta))
        if len(near):
            x = start[near] + at[:, None, None] * velocity[near]           # shape (17, m, c)
            gap = -self.theta - self.part(near).distance(x)
            hit = np.flatnonzero((gap[1:] <= 0).any(0))
            k = np.argmax(gap[1:, hit] <= 0, axis=0)
            before, now = np.maximum(gap[k, hit], 0.0), gap[k + 1, hit]
            share = np.divide(before, before - now, out=np.zeros(len(hit)), where=before > 0)
            arc_lengths[near[hit]] = at[k] + (at[k + 1] - at[k]) * share
        return arc_lengths

    def gap_closure(self, i: int, x: np.ndarray, velocity: np.ndarray, earliest: float, accuracy: float,
                 iterations: int) -> float:
        """Return the arc length at which the gap of point i closes (signed distance -theta), by Newton's method.

        x, velocity: its position relative to the tool and d/ds, shape (2,), length. accuracy: error of the distance
        over theta. The result is at least `earliest`; it is the last iterate if the point does not approach its tool.
        """
        if (profile := self.profile) is not None:
            shift = self.shift[i] if isinstance(self.shift, np.ndarray) else self.shift
            return float(_C.gap_closure(x, velocity, self.theta, shift, earliest, accuracy * self.theta, iterations,
                                     len(profile.table), profile.lines, profile.table))
        law, s = self.part(np.array([i])), 0.0
        for _ in range(iterations):
            near = law.nearest((x + s * velocity)[None])
            gap, rate = float(near.distance[0]) + law.theta, float(near.normal[0] @ velocity)
            if abs(gap) < accuracy * law.theta or not rate > 0:
                break
            s = max(s - gap / rate, earliest)
        return s

    def part(self, points: np.ndarray | slice) -> ContactLaw:
        """Return the contact law of some of the points only (indices, shape (m,), or a slice)."""
        raise NotImplementedError

    def without(self, points: np.ndarray) -> ContactLaw:
        """Return a copy of the law without traction at the points of a mask, shape (n,), wherever these points are."""
        raise NotImplementedError

    def with_friction(self, mu: np.ndarray | float) -> Self:
        """Return a copy of the law with the coefficient of friction mu, shape () or (n,); by default the law itself."""
        return self


class NormalLaw(ContactLaw):
    """Contact law without friction and history: the normal traction N follows from the signed distance d.

    .. math:: N = k F(d)

    The distance is positive inside the tool. A subclass defines `ramp`, which returns F and dF/dd, and `stored`, the
    integral of F.

    Args:
        tool: the tool, which gives the signed distance.
        k: penalty, stress/length, a number or one for each point, shape (n,).
        theta: half-width of the contact ramp, length: contact begins at the signed distance -theta.
        shift: length by which signed distances are reduced, a number or one for each point, shape (n,). A point that
            touches in the reference configuration is then at the outer edge of the ramp, free of stress.
    """

    def __init__(self, tool: PlaneTool, k: np.ndarray | float, theta: float, shift: np.ndarray | float = 0.0):
        self.tool, self.k, self.theta, self.shift = tool, k, theta, shift
        self._near: list[tuple[bytes, Nearest]] = []         # last positions and those before, and their results

    def ramp(self, d: np.ndarray, bonded: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError(f"{type(self).__name__}: ramp(d, bonded): is not defined; a contact law without"
                                  f" friction must define it")

    def stored(self, d: np.ndarray) -> np.ndarray:
        r"""Return the energy of the normal traction per reference area, divided by the penalty.

        .. math:: \int_{-\theta}^{d} F(s) \, ds

        F(d) is the result of `ramp` at the distance d. Contact begins at the distance -theta.

        Args:
            d: signed distances from the tool, positive inside, shape (n,), length.

        Returns:
            Integral, shape (n,), length^2; 0 for open points.
        """
        raise NotImplementedError

    def energy(self, x: np.ndarray, old: ContactHistory | None = None) -> np.ndarray:
        return self.k * self.stored(self.distance(x))

    def distance(self, x: np.ndarray) -> np.ndarray:
        if x.ndim == 2:
            return self.nearest(x).distance
        return self.tool.signed_distance(x).reshape(x.shape[:-1]) - self.shift

    @cached_property
    def profile(self) -> Tool | None:  # type: ignore[override]
        own = type(self).distance is NormalLaw.distance and type(self).nearest is NormalLaw.nearest
        return self.tool if own and type(self.tool) is Tool else None

    def nearest(self, x: np.ndarray) -> Nearest:
        """Return the geometry of the tool nearest to given positions.

        The last two results are stored, for repeated calls with equal x.

        Args:
            x: positions relative to the tool, shape (n, 2), length.

        Returns:
            Signed distances less the length `shift` of the law, positive inside the tool, shape (n,), length. Unit
            normals (gradients of the distance), shape (n, 2), and curvatures, shape (n,), 1/length.
        """
        positions = x.tobytes()
        for known, near in self._near:
            if known == positions:
                return near
        near = self.tool.nearest(x)
        near = near._replace(distance=near.distance - self.shift)
        self._near = [(positions, near), *self._near[:1]]
        return near

    def start(self, x: np.ndarray) -> ContactHistory:
        return ContactHistory(x.copy(), self.distance(x), np.zeros(len(x)), x.copy())

    def touching(self, x: np.ndarray, old: ContactHistory | None) -> np.ndarray:
        return self.distance(x) > -self.theta

    def motion(self, x: np.ndarray, old: ContactHistory | None) -> Motion:
        near = self.nearest(x)
        return Motion(x, near.distance, near.normal, np.zeros(len(x)), 0 * x)

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        near, zero = self.nearest(x), np.zeros(len(x))
        n, t, at = near.normal, near.tangent, near.distance if expected is None else expected.distance
        F, slope = self.ramp(at)
        N = self.k * (F + slope * (near.distance - at))
        return Tractions(N[:, None] * n, N, zero, zero, lambda: outer(n, (self.k * slope)[:, None] * n)
                         + outer(t, (self.k * F * near.curvature)[:, None] * t), lambda: self.start(x))

    def hoop_stiffness(self, x: np.ndarray, old: ContactHistory | None, radius: np.ndarray) -> np.ndarray:
        r"""Return the derivative of the circumferential traction with respect to the circumferential displacement.

        .. math:: \frac{N n_r}{r}

        N is the normal traction and n_r the radial component of the normal of the tool.

        Args:
            x: positions relative to the tool, shape (n, 2), length.
            old: not used.
            radius: deformed radius r of the points, shape (n,), length; infinite in plane strain.

        Returns:
            Stiffness, shape (n,), stress/length.
        """
        turned = self.tractions(x, old).normal * self.nearest(x).normal[:, 0]
        return np.divide(turned, radius, out=np.zeros(len(x)), where=radius > 0)

    def part(self, points: np.ndarray | slice) -> Self:
        arrays = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        return self._with(**{name: value[points] for name, value in arrays.items()})

    def without(self, points: np.ndarray) -> Self:
        return self._with(shift=self.shift + np.where(points, FAR, 0.0))

    def _with(self, **other: Any) -> Self:
        """Return a copy of the law with the attributes in `other` replaced, and without stored results."""
        law = object.__new__(type(self))
        vars(law).update(vars(self), **other, _near=[])
        return law


def outer(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the outer products a b^T of vectors, shape (n, c) each, as matrices, shape (n, c, c)."""
    return a[:, :, None] * b[:, None, :]


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

    def with_friction(self, mu: np.ndarray | float) -> Law:
        """Return a copy of the law with other coefficients of friction, shape () or (n,)."""
        law = self._with()
        law._set_friction(mu)
        return law

    def _set_friction(self, mu: np.ndarray | float) -> None:
        """Set the coefficients of friction mu, shape () or (n,), and whether the law has friction and history."""
        self.mu, self.sticks, self._slides = mu, mu >= STICKS, bool(np.all(np.isfinite(mu)))
        self.has_friction = np.ndim(mu) > 0 or bool(mu > 0)
        self.has_history = self.has_friction or self.adhesive

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
        r"""Return the signed distance of points with the normal traction N, (n,), length; N/k - theta if inseparable.

        .. math:: d = \begin{cases} N/k & N > k \theta \\ 2 \sqrt{N \theta / k} - \theta & \text{else} \end{cases}
        """
        over = pressure / (self.k * self.theta)
        return self.theta * ((np.where(over > 1, over, 2 * np.sqrt(over) - 1)) if not self.adhesive else over - 1)

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
        return ContactHistory(x.copy(), d, np.zeros(len(x)), x.copy())

    def tractions(self, x: np.ndarray, old: ContactHistory | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions at positions x, shape (n, 2), length, with their stiffness and history.

        A point whose `sense`, shape (n,), would reverse sticks for one iteration: else Newton's method would alternate.
        `expected`: distances and slips predicted to first order; those at x differ in second order on a curved tool,
        which a stiff penalty turns into large tractions.
        """
        n, out = len(x), self._evaluate(x, old, sense, expected)
        N, T, slides = out[2 * n:3 * n], out[3 * n:4 * n], out[4 * n:5 * n]
        return Tractions(out[:2 * n].reshape(n, 2), N, T, slides, lambda: out[5 * n:9 * n].reshape(n, 2, 2),
                         lambda: ContactHistory(x, out[9 * n:10 * n], out[10 * n:11 * n], x))

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
        constants = np.array([self.theta, self.elastic_slip, self.adhesive, self.has_friction, self._slides, STICKS])
        _C.tractions(len(x), constants, self.k, np.ndim(self.k), self.mu, np.ndim(self.mu), near.distance, near.normal,
                     near.curvature, None if old is None else old.distance, g, dg, *ahead, sense, limit, grows, out)
        return out

    def hoop_stiffness(self, x: np.ndarray, old: ContactHistory | None, radius: np.ndarray) -> np.ndarray:
        """Return N n_r/r, (n,), stress/length: traction, radial normal, radius r (n,), inf in plane strain.

        The stiffness of the elastic slip is added for a sticking point.
        """
        turned = super().hoop_stiffness(x, old, radius)
        if not self.has_friction:
            return turned
        n, out = len(x), self._evaluate(x, old)
        return turned + np.where(out[4 * n:5 * n] == 0, out[11 * n:], 0.0)           # where points do not slide

    def motion(self, x: np.ndarray, old: ContactHistory | None) -> Motion:
        """Return distances and slips (0 without history) at x, with gradients, shape (n, 2), length."""
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
        """Return the slip (n,) that sticking points would have at x, and its gradient (n, 2); it is stored."""
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
