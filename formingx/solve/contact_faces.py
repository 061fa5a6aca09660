"""Interfaces of faces in contact for the solver: contact points, their law in an iteration, their tractions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

import numpy.typing as npt

from ..contact.rule import Rule

Array: TypeAlias = npt.NDArray[Any]


class Tractions(Protocol):
    """Tractions of the contact law at n points with c components.

    Attributes:
        force: tractions, shape (n, c), stress.
        sense: direction of sliding along the tangent of the tool, 1 or -1; 0 for points that do not slide; shape (n,).
        stiffness: derivative of `force` with respect to the position of its point, shape (n, c, c), stress/length.
        status: `ContactStatus` of each point, shape (n,).
    """

    force: Array
    sense: Array

    @property
    def stiffness(self) -> Array: ...

    @property
    def status(self) -> Array: ...


class Increment(Protocol):
    """Contact law at n locally owned points of a face with c components, linearised in each Newton iteration."""

    @property
    def ramp(self) -> float:
        """Half-width theta of the contact ramp, length.

        The contact stiffness grows from zero as the distance, positive inside the tool, goes from -theta to theta.
        """

    @property
    def status(self) -> Array:
        """`ContactStatus` of each point in the last linearisation, shape (n,)."""

    @property
    def newly_closed(self) -> Array:
        """Mask of points that are closed now but were open at the start of Newton's method, shape (n,)."""

    def last_tractions(self, points: Array) -> tuple[Array, Array]:
        """Return (tractions, stiffnesses) of m points in the last linearisation, shapes (m, c) and (m, c, c).

        points: numbers of the points. Tractions are stresses, stiffnesses stress/length.
        """

    def predicted(self, motion: Array) -> Tractions:
        """Return the tractions at all points after a further motion, to first order in distances and slips.

        motion: motion relative to the tool since the last linearisation, shape (n, c), length.
        """

    def law_at(self, points: Array) -> Callable[[Array], Tractions]:
        """Return a function that maps further motions of m points, shape (m, c), length, to their tractions.

        A motion is relative to the tool, since the last linearisation. points: numbers of the points, shape (m,).
        """

    def in_ramp(self, points: Array) -> Callable[[Array], tuple[Array, Array]]:
        """Return a function that predicts the depth of m points in the contact ramp after a motion.

        Its argument is the motion of the points relative to the tool since the last linearisation, shape (m, c),
        length. It returns two arrays. The first is the depth, shape (m,): 0 at the signed distance -theta from the
        tool, where contact begins, and 1 at theta. The second is the normal of the tool times the width 2 theta of the
        ramp, shape (m, c), length. The second is 0 for sliding points, and without friction or with adhesion.

        points: numbers of the points, shape (m,).
        """

    def expect(self, points: Array, sense: Array) -> None:
        """Set the direction of sliding that the next linearisation assumes at some points.

        points: mask of these points among the n points, shape (n,). sense: direction of sliding along the tangent of
        the tool, 1 or -1, or 0 for sticking; shape (n,). Entries outside the mask are not used.
        """


class ContactFace(Protocol):
    """Face of the body in contact, with n locally owned points.

    Attributes:
        points: reference positions of the contact points, shape (n, c), length.
        rule: quadrature rule of the face. It interpolates displacements at the contact points, and adds their forces to
            the residual.
    """

    points: Array
    rule: Rule

    @property
    def increment(self) -> Increment:
        """Contact law at the points during one run of Newton's method, which begins with `ActiveSet.begin`."""

    @property
    def scale(self) -> Array:
        """Factor from the traction of each point to its force in the dimensionless residual F, shape (n,), 1/stress."""

    def apply(self, forces: Array | None) -> None:
        """Set contact forces that act in F in place of the contact law, shape (n, c), dimensionless.

        The law acts at points with NaN, and at all points after None.
        """

    def relative_motion(self, dx: Array, step: Array | float) -> Array:
        """Return the motion of the n points relative to their tool due to an update, shape (n, c), length.

        dx: update of the unknowns, locally owned entries, shape (m,). step: update of the control. For k updates dx has
        the shape (m, k), step the shape (k,) and the result the shape (n, c, k).
        """
