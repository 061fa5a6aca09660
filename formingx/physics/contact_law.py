"""What a law of contact between points of a face and a rigid tool gives, and what the points remember.

Positions, motions and tractions of n points have c components each, 2 in the plane of a section: shape (n, c).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from ..tools.shapes import Nearest


class Touch(NamedTuple):
    """What n points remember of the last accepted state, seen from the tool.

    position: shape (n, c), length; distance: signed, shape (n,), length; slip: elastic slip g, shape (n,), length;
    arrival: where the point will be when it touches, if it does in the step ahead, shape (n, c), length; NaN if it has
    no friction before the end of that step.
    """

    position: np.ndarray
    distance: np.ndarray
    slip: np.ndarray
    arrival: np.ndarray


class Tractions:
    """Tractions at n points per unit reference area, as the residual wants them (what the body does to the tool).

    force: shape (n, c), stress; normal, tangential: N and T, shape (n,), stress; sense: of sliding, 1 or -1 along the
    tangent, 0 if stuck, shape (n,). stiffness, touch: what gives those properties when they are first asked for, which
    most tractions never are.
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
        """What to remember."""
        return self._touch()

    @property
    def active(self) -> np.ndarray:
        """What each point does: 0 is free, 4 sticks, 3 and 5 slide either way, shape (n,)."""
        return (self.sense + 4 * (self.normal != 0)).astype(np.int8)


class Motion(NamedTuple):
    """Where n points are with respect to a tool, to first order.

    position: shape (n, c), length; distance, slip: shape (n,), length; normal, along: their gradients, shape (n, c).
    """

    position: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    slip: np.ndarray
    along: np.ndarray

    def to(self, x: np.ndarray) -> Motion:
        """What it foretells for the points moved to x, shape (n, c)."""
        by = x - self.position
        distance = self.distance + np.einsum("ni,ni->n", self.normal, by)
        return self._replace(position=x, distance=distance, slip=self.slip + np.einsum("ni,ni->n", self.along, by))


class ContactLaw(Protocol):
    """Tractions at n points, a function of their positions x and of what they remember. (`None`: nothing.)

    For each increment, in this order:

        motion, touching    where it begins: each point's distance and slip to first order; which points touch;
        tractions           each iteration, linearised where the `Motion` of the iteration before foretells: forces,
                            their derivative (the tangent) and, of a state that is accepted, what to remember;
        stiffness_ahead     there: the tangent of the path, with the points that have just touched;
        distance, nearest, ramp     limits of the next step: when points arrive, and whether that was foreseen.

    What only `formingx.physics.contact.Law` has, and others may: `without`, for derivatives of runs with contact
    (`formingx.Design`); `shift`, for a mesh that is made again on the way (`trace(remesh=)`).

    Attributes:
        theta: half-width of the ramp: at -theta contact begins, length; elastic_slip: before a point slides, length.
        has_friction: tractions depend on slip; remembers: on `Touch`.
    """

    theta: float
    elastic_slip: float
    has_friction: bool

    @property
    def remembers(self) -> bool: ...

    def start(self, x: np.ndarray) -> Touch:
        """What points at x remember before anything has happened."""

    def touching(self, x: np.ndarray, old: Touch | None) -> np.ndarray:
        """Which points at x touch, or are held, shape (n,)."""

    def motion(self, x: np.ndarray, old: Touch | None) -> Motion:
        """Distance and slip of points at x, and their gradients."""

    def tractions(self, x: np.ndarray, old: Touch | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """At points x; `expected`: where to linearise the law (at x if None); `sense`: of the iteration before."""

    def stiffness_ahead(self, x: np.ndarray, old: Touch | None, arrived: np.ndarray) -> np.ndarray:
        """Derivative of the tractions beyond a state, shape (n, c, c), stress/length; `arrived`: just now."""

    def stiffness_round(self, x: np.ndarray, old: Touch | None, radius: np.ndarray) -> np.ndarray:
        """That of the traction round the axis by the motion there, shape (n,), stress/length."""

    def distance(self, x: np.ndarray) -> np.ndarray:
        """Signed, of points x, shape (n, c), or several places of each, (m, n, c), length; contact begins at -theta."""

    def nearest(self, x: np.ndarray) -> Nearest:
        """`RigidTool.nearest`, with these distances."""

    def ramp(self, d: np.ndarray, held: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Normal traction over the penalty at distances d, and its derivative."""

    def energy(self, x: np.ndarray) -> np.ndarray:
        """What penetration holds per unit reference area, shape (n,), stress length."""

    def part(self, points: np.ndarray | slice) -> ContactLaw:
        """The law of some of the points."""

    def with_friction(self, mu: np.ndarray | float) -> ContactLaw:
        """The same law with other coefficients of friction."""
