"""Interface of a law of contact between points of a face and a rigid tool, and its history variables.

Positions, motions and tractions of n points have c components each, 2 in the plane of a section: shape (n, c).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from ..tools.shapes import Nearest
from ..tools.tool import PlaneTool

FAR = 1e30
"""A number larger than all others, but finite: its product with 0 is 0."""


class ContactStatus(IntEnum):
    """Status of a contact point; of a sliding one also the sense, along the tangent of the tool."""

    SLIDES_BACK = -1
    STICKS = 0
    SLIDES = 1
    FREE = 2


class Touch(NamedTuple):
    """History variables of n points at the last accepted state, relative to the tool.

    Attributes:
        position: shape (n, c), length.
        distance: signed distance, shape (n,), length.
        slip: elastic slip g, shape (n,), length.
        arrival: predicted position of an open point when its gap closes in the next step, shape (n, c), length; NaN if
            the point has no friction before the end of that step.
    """

    position: np.ndarray
    distance: np.ndarray
    slip: np.ndarray
    arrival: np.ndarray


class Tractions:
    """Tractions at n points per unit reference area, with the sign of the residual (of the body on the tool).

    Args:
        force: shape (n, c), stress.
        normal, tangential: N and T, shape (n,), stress.
        sense: sense of sliding, 1 or -1 along the tangent, 0 for a sticking point, shape (n,).
        stiffness, touch: functions that compute these properties when they are first used.
    """

    def __init__(self, force: np.ndarray, normal: np.ndarray, tangential: np.ndarray, sense: np.ndarray,
                 stiffness: Callable[[], np.ndarray], touch: Callable[[], Touch]):
        self.force, self.normal, self.tangential, self.sense = force, normal, tangential, sense
        self._stiffness, self._touch = stiffness, touch

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Derivative of the force, shape (n, c, c), stress/length."""
        return self._stiffness()

    @cached_property
    def touch(self) -> Touch:
        """History variables after the state."""
        return self._touch()

    @property
    def status(self) -> np.ndarray:
        """The `ContactStatus` of each point, shape (n,)."""
        return np.where(self.normal != 0, self.sense, ContactStatus.FREE).astype(np.int8)


class Motion(NamedTuple):
    """Position of n points relative to a tool, to first order.

    position: shape (n, c), length; distance, slip: shape (n,), length; normal, along: their gradients, shape (n, c).
    """

    position: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    slip: np.ndarray
    along: np.ndarray

    def to(self, x: np.ndarray) -> Motion:
        """Return the predicted values for the points moved to x, shape (n, c)."""
        slip = self.slip + np.einsum("ni,ni->n", self.along, x - self.position)
        return Motion(x, self.distance_at(x), self.normal, slip, self.along)

    def distance_at(self, x: np.ndarray) -> np.ndarray:
        """Return the predicted distances of the points moved to x, shape (n, c), shape (n,), length."""
        return self.distance + np.einsum("ni,ni->n", self.normal, x - self.position)


class ContactLaw:
    """Tractions at n points, a function of their positions x and of their history variables (`None`: there are none).

    For each increment, in this order:

    * `motion`, `touching`, at its beginning: distance and slip of each point to first order; the points that touch;
    * `tractions`, in each iteration, linearised at the `Motion` that the iteration before predicts: forces, their
      derivative (the tangent) and, for an accepted state, the new history variables;
    * `stiffness_ahead`, at an accepted state: the tangent of the path, with the points that have just touched;
    * `distance`, `nearest`, `ramp`, for limits of the next step: when gaps close, and whether that was predicted.

    A law derives from it and gives `theta`, `start`, `touching`, `tractions`, `distance` and `part`. The other members
    have defaults, or are needed for friction, in a section or where a contact is left out.

    Attributes:
        theta: half-width of the ramp, length: contact begins at the distance -theta.
        elastic_slip: slip of a point before it slides, length.
        shift: reduction of the distances, length, a number or one for each point, shape (n,).
        has_friction: True if tractions depend on the slip.
        remembers: True if tractions depend on the history variables (`Touch`).
        pulls: True if the body may pull at the tool; `energy` is then the energy of the bond (`Path.work`).
        predictable: True if the law has `friction` and `depth`, as `formingx.physics.penalty.Law`; several gaps may
            then close in one step.
    """

    theta: float
    elastic_slip: float = 0.0
    shift: np.ndarray | float = 0.0
    has_friction: bool = False
    remembers: bool = False
    pulls: bool = False
    predictable: bool = False

    @property
    def sticks(self) -> np.ndarray | bool:
        """True, or a mask of shape (n,), for points that never slide; used only with friction."""
        return False

    def start(self, x: np.ndarray) -> Touch:
        """Return the initial history variables of points at x."""
        raise NotImplementedError

    def touching(self, x: np.ndarray, old: Touch | None) -> np.ndarray:
        """Return a mask of the points at x that touch or stick, shape (n,)."""
        raise NotImplementedError

    def motion(self, x: np.ndarray, old: Touch | None) -> Motion:
        """Return the distance and the slip of points at x, and their gradients; default: zero, for a linear law."""
        return Motion(x, np.zeros(len(x)), np.zeros_like(x), np.zeros(len(x)), np.zeros_like(x))

    def tractions(self, x: np.ndarray, old: Touch | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions at points x; `expected`: where to linearise (at x if None); `sense`: of the
        iteration before."""
        raise NotImplementedError

    def stiffness_ahead(self, x: np.ndarray, old: Touch | None, arrived: np.ndarray) -> np.ndarray:
        """Return the derivative of the tractions beyond a state, shape (n, c, c), stress/length; `arrived`: just
        now."""
        return self.tractions(x, old).stiffness

    def stiffness_round(self, x: np.ndarray, old: Touch | None, radius: np.ndarray) -> np.ndarray:
        """Return the derivative of the circumferential traction by the circumferential motion, shape (n,),
        stress/length."""
        raise NotImplementedError

    def distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distance, length, of points x, shape (n, c), or of m positions of each point, (m, n, c)."""
        raise NotImplementedError

    def nearest(self, x: np.ndarray) -> Nearest:
        """`PlaneTool.nearest`, with these distances."""
        raise NotImplementedError

    def ramp(self, d: np.ndarray, held: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal traction over the penalty at distances d, and its derivative; default: no ramp."""
        return np.zeros(len(d)), np.zeros(len(d))

    def energy(self, x: np.ndarray, old: Touch | None = None) -> np.ndarray:
        """Return the energy of the normal tractions per unit reference area, shape (n,), stress length; default: 0."""
        return np.zeros(len(x))

    def part(self, points: np.ndarray | slice) -> ContactLaw:
        """Return the law of some of the points."""
        raise NotImplementedError

    def without(self, points: np.ndarray) -> ContactLaw:
        """Return the same law, of which some points (a mask, shape (n,)) touch nothing."""
        raise NotImplementedError

    def with_friction(self, mu: np.ndarray | float) -> Self:
        """Return the same law with other coefficients of friction; default: it has none."""
        return self


class NormalLaw(ContactLaw):
    """A law without friction or memory: subclasses give `ramp` and `stored`.

    Args:
        tool: the tool, which gives the signed distance.
        k: the penalty, stress/length, a number or one for each point, shape (n,).
        theta, shift: see `ContactLaw`. With a shift a point that touches from the start begins at the outer edge of
            the ramp, free of stress.
    """

    def __init__(self, tool: PlaneTool, k: np.ndarray | float, theta: float, shift: np.ndarray | float = 0.0):
        self.tool, self.k, self.theta, self.shift = tool, k, theta, shift
        self._near: tuple[bytes, Nearest] | None = None     # positions last asked for, and the result

    def stored(self, d: np.ndarray) -> np.ndarray:
        """Return the integral of the ramp over the distance, 0 where there is no contact, shape (n,), length^2."""
        raise NotImplementedError

    def energy(self, x: np.ndarray, old: Touch | None = None) -> np.ndarray:
        return self.k * self.stored(self.distance(x))

    def distance(self, x: np.ndarray) -> np.ndarray:
        if x.ndim == 2:
            return self.nearest(x).distance
        return self.tool.signed_distance(x).reshape(x.shape[:-1]) - self.shift

    def nearest(self, x: np.ndarray) -> Nearest:
        """See `ContactLaw`; found once for the same points."""
        positions = x.tobytes()
        if self._near is None or positions != self._near[0]:
            near = self.tool.nearest(x)
            self._near = positions, Nearest(near.distance - self.shift, near.normal, near.curvature)
        return self._near[1]

    def start(self, x: np.ndarray) -> Touch:
        return Touch(x.copy(), self.distance(x), np.zeros(len(x)), x.copy())

    def touching(self, x: np.ndarray, old: Touch | None) -> np.ndarray:
        return self.distance(x) > -self.theta

    def motion(self, x: np.ndarray, old: Touch | None) -> Motion:
        near = self.nearest(x)
        return Motion(x, near.distance, near.normal, np.zeros(len(x)), 0 * x)

    def tractions(self, x: np.ndarray, old: Touch | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        near, zero = self.nearest(x), np.zeros(len(x))
        n, t, at = near.normal, near.tangent, near.distance if expected is None else expected.distance
        F, slope = self.ramp(at)
        N = self.k * (F + slope * (near.distance - at))
        return Tractions(N[:, None] * n, N, zero, zero, lambda: outer(n, (self.k * slope)[:, None] * n)
                         + outer(t, (self.k * F * near.curvature)[:, None] * t), lambda: self.start(x))

    def stiffness_round(self, x: np.ndarray, old: Touch | None, radius: np.ndarray) -> np.ndarray:
        """See `ContactLaw`: N n_r/r, r being `radius`, infinite in plane strain."""
        turned = self.tractions(x, old).normal * self.nearest(x).normal[:, 0]
        return np.divide(turned, radius, out=np.zeros(len(x)), where=radius > 0)

    def part(self, points: np.ndarray | slice) -> Self:
        arrays = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        return self._with(**{name: value[points] for name, value in arrays.items()})

    def without(self, points: np.ndarray) -> Self:
        return self._with(shift=self.shift + np.where(points, FAR, 0.0))

    def _with(self, **other: Any) -> Self:
        """Return the same law with other attributes."""
        law = object.__new__(type(self))
        vars(law).update(vars(self), **other, _near=None)
        return law


def outer(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a b^T of n vectors, shape (n, c, c)."""
    return a[:, :, None] * b[:, None, :]
