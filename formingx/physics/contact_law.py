"""Interface of a contact law, the relation of tractions to motion at points of a face and a rigid tool.

Positions, motions and tractions of n points have c components each, 2 in the plane of a section: shape (n, c). They are
relative to the tool. A signed distance is positive inside the tool.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from ..tools.profile import Nearest, Tool
from ..tools.tool import PlaneTool
from ..values.tolerances import FAR


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
        slip = self.slip + np.einsum("ni,ni->n", self.along, x - self.position)
        return Motion(x, self.distance_at(x), self.normal, slip, self.along)

    def distance_at(self, x: np.ndarray) -> np.ndarray:
        """Predict the signed distances, shape (n,), to first order at positions x, shape (n, c), length."""
        return self.distance + np.einsum("ni,ni->n", self.normal, x - self.position)


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
        predictable: True if the law has `friction` and `depth`, as `formingx.physics.penalty.Law`; several gaps may
            then close in one step.
    """

    theta: float
    elastic_slip: float = 0.0
    shift: np.ndarray | float = 0.0
    has_friction: bool = False
    has_history: bool = False
    adhesive: bool = False
    predictable: bool = False

    @property
    def profile(self) -> Tool | None:
        """Tool of lines and arcs, if `distance` returns its signed distance less the length `shift`; else None."""
        return None

    @property
    def sticks(self) -> np.ndarray | bool:
        """True, or a mask of shape (n,), for points that never slide; used only with friction."""
        return False

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
        r"""Return the function F(d) of the normal traction, and its derivative; by default 0.

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
    r"""Contact law without friction and history: the normal traction N follows from the signed distance d.

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

    @property
    def profile(self) -> Tool | None:
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
