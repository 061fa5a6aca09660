"""Transfer of contact tractions from the old to the new mesh of a remeshed body; on one rank.

Values are interpolated linearly between neighbouring points of the old face. A node on the axis has no area of its own
(`Lobatto` defines one). It takes the pressure of its neighbour, without friction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...contact.face import FaceContact, FaceHistory
from ...contact.rule import Lobatto
from ...physics.contact_law import ContactHistory


class ContactState(NamedTuple):
    """Contact state of a face on the old mesh, at n contact points; m pairs of these are neighbours.

    Attributes:
        position: positions of the points in the frame of the tool, shape (n, 2), length.
        distance: signed distances from the surface of the tool, positive inside the tool, shape (n,), length.
        touches: mask of the points in contact, shape (n,).
        traction: pressure and friction per present area at the points, shape (n, 2), stress.
        pairs: numbers of neighbouring points, shape (m, 2).
        slip: largest elastic slip of the points over the thickness of the body.
    """

    position: np.ndarray
    distance: np.ndarray
    touches: np.ndarray
    traction: np.ndarray
    pairs: np.ndarray
    slip: float

    @classmethod
    def of(cls, face: FaceContact, fields: np.ndarray, control: float) -> ContactState:
        """Return the contact state of a face at a control, for the unknowns of the old mesh, shape (n,)."""
        found, rule, x = face.tractions(fields, control), face.rule, face.positions(fields, control)
        assert isinstance(rule, Lobatto)
        share = np.divide(rule.area, rule.lumped, out=np.zeros_like(rule.area), where=rule.has_area)
        traction = np.column_stack([found.normal, found.tangential]) * (share / rule.area_ratio(fields))[:, None]
        pairs = np.concatenate([rule.edges[:, [0, 2]], rule.edges[:, [2, 1]]])
        touches, d = face.touching(fields, control), face.contact.tool.signed_distance(x)
        for axis in np.flatnonzero(~rule.has_area):
            ends = rule.edges[(rule.edges == axis).any(1), :2].ravel()
            neighbour = ends[ends != axis][0]
            traction[axis], touches[axis], d[axis] = (traction[neighbour, 0], 0.0), touches[neighbour], d[neighbour]
        slip = 0.0 if face.history is None else np.abs(face.history.slip).max(initial=0.0) / face.thickness
        return cls(x, d, touches, traction, pairs, slip)

    def outward_motion(self, x: np.ndarray, d: np.ndarray) -> np.ndarray:
        """Return the outward motions of new points from signed gaps d, shape (n,), to the depth of the old face.

        Between old contact points the depth is interpolated; elsewhere points move to the surface or an old neighbour's
        depth. Negative is into the tool, length.
        """
        pair, share = self._nearest_pairs(x)
        both = self.touches[pair]
        share = np.where(both.all(1), share, np.where(both[:, 0], 0.0, 1.0))
        depth = np.where(both.any(1), _interpolated(self.distance[pair], share), 0.0)
        return np.where(both.all(1), d - depth, np.maximum(d - np.maximum(depth, 0.0), 0.0))

    def tractions_at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return pressure, friction and mask of points between old contact points, shape (n,) each, at x, (n, 2)."""
        pair, share = self._nearest_pairs(x)
        found = _interpolated(self.traction[pair], share[:, None])
        return found[:, 0], found[:, 1], self.touches[pair].all(1)

    def _nearest_pairs(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs of old points, shape (n, 2), between which x lies, and positions from 0 to 1, (n,)."""
        a, b = np.moveaxis(self.position[self.pairs], 1, 0)
        offset = x[:, None] - a
        share = np.clip(np.einsum("nmi,mi->nm", offset, b - a) / np.einsum("mi,mi->m", b - a, b - a), 0.0, 1.0)
        k = np.linalg.norm(offset - share[..., None] * (b - a), axis=2).argmin(1)
        return self.pairs[k], share[np.arange(len(x)), k]


def transfer_contact(face: FaceContact, old: ContactState, fields: np.ndarray, control: float) -> None:
    """Transfer the pressure and friction per present area of a face to the same face on the new mesh, in place.

    The distance of each contact point is offset, so that the law gives this pressure at any depth in the tool.
    """
    x, law, rule = face.positions(fields, control), face.law, face.rule
    assert isinstance(rule, Lobatto)
    theta, d = law.theta, face.contact.tool.signed_distance(x)
    pressure, friction, touches = old.tractions_at(x)
    share = np.where(rule.has_area, rule.lumped / rule.area, 0.0)
    touches &= pressure > 0
    depth = law.depth(np.where(touches, pressure * share, 0.0))
    face.shift_distances(np.where(touches, d - depth, np.maximum(d + theta, 0.0)))
    if not face.has_history:
        return
    law, zero = face.law, np.zeros(len(x))
    slip, newly_closed = zero, np.zeros(len(x), dtype=bool)
    if law.has_friction:
        tangential = law.tractions(x, ContactHistory(x, depth, zero + 1e-9 * theta, x)).tangential
        slip = np.divide(friction * share * 1e-9 * theta, tangential, out=zero.copy(),
                         where=touches & (tangential != 0))
        bound = 2 * old.slip * face.thickness               # under a small pressure the slip would be unbounded
        slip = np.clip(slip, -bound, bound)
    distance = np.where(touches, depth, np.minimum(d - law.shift, -(1 + 1e-9) * theta))
    face.put(FaceHistory(ContactHistory(x, distance, slip, x), newly_closed, np.ones(len(x))))


def _interpolated(values: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Interpolate pairs of values, shape (n, 2) or (n, 2, k), linearly at `share` from 0 to 1, shape (n,) or (n, 1)."""
    return values[:, 0] + share * (values[:, 1] - values[:, 0])
