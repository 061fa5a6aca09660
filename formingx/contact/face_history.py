"""History variables of the points of a contact face, and their arrays in a file."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..mesh.nodes import matching_rows
from ..physics.contact_law import ContactHistory


class FaceHistory(NamedTuple):
    """History variables of the points of a face at the last accepted state.

    Attributes:
        history: history variables of the contact law.
        newly_closed: mask of the points that came into contact in the step to this state, shape (n,).
        penalty: penalty with which the state was solved for, over the reference penalty, shape (n,)
            (`Contact.present_area`).
    """

    history: ContactHistory
    newly_closed: np.ndarray
    penalty: np.ndarray

    def saved(self, points: np.ndarray, comm: Any) -> dict[str, np.ndarray]:
        """Return {name: array} of the history variables and points of all ranks; collective.

        points: reference positions of the n owned points, shape (n, components), length.
        """
        parts = comm.allgather((points, *self.history, self.newly_closed, self.penalty))
        names = ("points", *self.history._fields, "newly_closed", "penalty")
        return {name: np.concatenate(column) for name, column in zip(names, zip(*parts, strict=True))}

    @classmethod
    def loaded(cls, data: dict[str, Any], points: np.ndarray, start: ContactHistory, tolerance: float) -> FaceHistory:
        """Return the history variables of owned points, shape (n, components), length, from the arrays of `saved`.

        Raise `InputError` if a point has no stored one within `tolerance`, length. `start` gives the shapes of arrays.
        """
        rows = matching_rows(points, data["points"], tolerance,
                             "checkpoint: a contact point of the scene is not in it: it belongs to another mesh")
        history = ContactHistory(*(np.array(data[name], dtype=float)[rows].reshape(getattr(start, name).shape)
                                   for name in ContactHistory._fields))
        return cls(history, np.array(data["newly_closed"], dtype=bool)[rows], np.array(data["penalty"])[rows])
