"""Linear segment of a predicted path between two contact events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...physics.contact_law import ContactStatus


class PathSegment(NamedTuple):
    """Linear segment of the predicted path, from an arc length to the next event.

    n is the number of all contact points of this rank. m is the number of those points, of all ranks, whose compliance
    is known: the motion of the body under unit forces at the points. The contact stiffness of points that were closed
    at the accepted state is part of the factorised tangent.

    Attributes:
        begins: arc length at the start of the segment, from the accepted state.
        positions: positions of the n points of all faces relative to their tools at the start, shape (n, 2), length.
        speed: derivatives of the positions with respect to arc length, shape (n, 2), length.
        status: contact statuses, shape (m,): -1 or 1 for sliding against or along the tangent of the tool, 0 sticking,
            2 open (`ContactStatus`).
        place: positions relative to the tools at which sticking points have no tangential force, shape (m, 2), length.
        force: contact forces at the start, with the sign and scale of the residual F, shape (m, 2), dimensionless.
        rate: derivatives of `force` with respect to arc length, shape (m, 2).
        extra: change of `force` since the accepted state, minus the part due to the contact stiffness in the factorised
            tangent, shape (m, 2).
        growth: derivatives of `extra` with respect to arc length, shape (m, 2).
        correction: sums of all equilibrium corrections of x, locally owned entries, and of the control.
    """

    begins: float
    positions: np.ndarray
    speed: np.ndarray
    status: np.ndarray
    place: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    extra: np.ndarray
    growth: np.ndarray
    correction: tuple[np.ndarray, float]

    def after(self, s: float) -> PathSegment:
        """Return the rest of this segment, from an arc length on, measured from the accepted state."""
        ds = s - self.begins
        return self if ds == 0 else self._replace(begins=s, positions=self.positions + ds * self.speed,
                                                  force=self.force + ds * self.rate,
                                                  extra=self.extra + ds * self.growth)

    def extended(self, m: int) -> PathSegment:
        """Return this segment with forces and statuses for m points; points added at the end are open."""
        added = m - len(self.status)
        if not added:
            return self
        blank = np.zeros((added, self.force.shape[1]))
        grown = {name: np.concatenate([getattr(self, name), blank])
                 for name in ("place", "force", "rate", "extra", "growth")}
        return self._replace(status=np.append(self.status, np.full(added, ContactStatus.FREE)), **grown)
