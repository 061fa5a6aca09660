"""Transfer of contact tractions from the old to the new mesh of a remeshed body.

On one rank. Values are interpolated linearly between neighbouring points of the old face. A node on the axis has an
area that only the quadrature rule defines (`Lobatto`). It takes the pressure of its neighbour, without friction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...contact.face import FaceContact, Memory
from ...contact.rule import Lobatto
from ...physics.contact_law import ContactHistory


class ContactState(NamedTuple):
    """Contact state of a face on the old mesh, with n points in m pairs of neighbours.

    Attributes:
        position: positions in the frame of the tool, shape (n, 2), length.
        distance: distances from the tool, shape (n,), length.
        touches: mask of points in contact, shape (n,).
        traction: pressure and friction per present area, shape (n, 2), stress.
        pairs: pairs of neighbours, shape (m, 2).
        slip: largest elastic slip over the thickness.
    """

    position: np.ndarray
    distance: np.ndarray
    touches: np.ndarray
    traction: np.ndarray
    pairs: np.ndarray
    slip: float

    @classmethod
    def of(cls, face: FaceContact, fields: np.ndarray, control: float) -> ContactState:
        """Return the contact state of a face.

        Args:
            face: the face on the old mesh.
            fields: locally owned unknowns.
            control: value of the control.

        Returns:
            The contact state.
        """
        found, rule, x = face.tractions(fields, control), face.rule, face.positions(fields, control)
        assert isinstance(rule, Lobatto)
        share = np.divide(rule.area, rule.lumped, out=np.zeros_like(rule.area), where=rule.has_area)
        traction = np.column_stack([found.normal, found.tangential]) * (share / rule.area_ratio(fields))[:, None]
        pairs = np.concatenate([rule.edges[:, [0, 2]], rule.edges[:, [2, 1]]])
        touches, d = face.touching(fields, control), face.contact.tool.signed_distance(x)
        for axis in np.flatnonzero(~rule.has_area):
            ends = rule.edges[(rule.edges == axis).any(1), :2].ravel()
            beside = ends[ends != axis][0]
            traction[axis], touches[axis], d[axis] = (traction[beside, 0], 0.0), touches[beside], d[beside]
        slip = 0.0 if face.history is None else np.abs(face.history.slip).max(initial=0.0) / face.thickness
        return cls(x, d, touches, traction, pairs, slip)

    def moved_in(self, x: np.ndarray, d: np.ndarray) -> np.ndarray:
        """Return the motion out of the tool that gives points the depth of their neighbours in contact.

        A point is moved until it is as deep as its neighbours in contact.

        Args:
            x: positions in the frame of the tool, shape (n, 2), length.
            d: their distances from the tool, shape (n,), length.

        Returns:
            Motion, shape (n,), length.
        """
        pair, share = self._near(x)
        both = self.touches[pair]
        share = np.where(both.all(1), share, np.where(both[:, 0], 0.0, 1.0))
        depth = np.where(both.any(1), _between(self.distance[pair], share), 0.0)
        return np.where(both.all(1), d - depth, np.maximum(d - np.maximum(depth, 0.0), 0.0))

    def at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Interpolate pressure and friction at points.

        Args:
            x: positions in the frame of the tool, shape (n, 2), length.

        Returns:
            Pressure and friction, stress, and mask of the points between two contacts, shape (n,) each.
        """
        pair, share = self._near(x)
        found = _between(self.traction[pair], share[:, None])
        return found[:, 0], found[:, 1], self.touches[pair].all(1)

    def _near(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest pair of neighbours, shape (n, 2), and the position between its points, shape (n,)."""
        a, b = np.moveaxis(self.position[self.pairs], 1, 0)
        offset = x[:, None] - a
        share = np.clip(np.einsum("nmi,mi->nm", offset, b - a) / np.einsum("mi,mi->m", b - a, b - a), 0.0, 1.0)
        k = np.linalg.norm(offset - share[..., None] * (b - a), axis=2).argmin(1)
        return self.pairs[k], share[np.arange(len(x)), k]


def transfer_contact(face: FaceContact, old: ContactState, fields: np.ndarray, control: float) -> None:
    """Transfer the pressure and friction per present area of the old face to a new one.

    The distance of each point is offset so that the contact law gives this pressure at any depth in the tool.

    Args:
        face: the face on the new mesh.
        old: contact state on the old mesh.
        fields: locally owned unknowns.
        control: value of the control.
    """
    x, law, rule = face.positions(fields, control), face.law, face.rule
    assert isinstance(rule, Lobatto)
    theta, d = law.theta, face.contact.tool.signed_distance(x)
    pressure, friction, touches = old.at(x)
    share = np.where(rule.has_area, rule.lumped / rule.area, 0.0)
    touches &= pressure > 0
    depth = law.depth(np.where(touches, pressure * share, 0.0))
    face.shift_distances(np.where(touches, d - depth, np.maximum(d + theta, 0.0)))
    if not face.remembers:
        return
    law, zero = face.law, np.zeros(len(x))
    slip, arrived = zero, np.zeros(len(x), dtype=bool)
    if law.has_friction:
        tangential = law.tractions(x, ContactHistory(x, depth, zero + 1e-9 * theta, x)).tangential
        slip = np.divide(friction * share * 1e-9 * theta, tangential, out=zero.copy(),
                         where=touches & (tangential != 0))
        most = 2 * old.slip * face.thickness               # no friction without pressure
        slip = np.clip(slip, -most, most)
    distance = np.where(touches, depth, np.minimum(d - law.shift, -(1 + 1e-9) * theta))
    face.put(Memory(ContactHistory(x, distance, slip, x), arrived, np.ones(len(x))))


def _between(values: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the values interpolated between pairs, shape (n, 2, ...)."""
    return values[:, 0] + share * (values[:, 1] - values[:, 0])
