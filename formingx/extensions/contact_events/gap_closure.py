"""Gap closure of a contact point, as the prediction of events stores it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class GapClosure(NamedTuple):
    """Contact event: the gap of an open point closes, at the signed distance -theta from its tool.

    The half-width theta of the contact ramp belongs to the contact law. All ranks store the same value.

    Attributes:
        arc_length: arc length of the event from the accepted state.
        rank: rank that owns the point.
        face: number of the contact face.
        point: local number of the point.
        place: position of the point relative to the tool at the event, shape (2,), length.
        tolerance: convergence tolerance of `place`, length.
    """

    arc_length: float
    rank: int
    face: int
    point: int
    place: np.ndarray
    tolerance: float

    @property
    def point_id(self) -> tuple[int, int, int]:
        """Identifier of the point, (rank, face, point)."""
        return self.rank, self.face, self.point
