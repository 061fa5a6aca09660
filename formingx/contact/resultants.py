"""Resultants of a contact in a state (fields: locally owned unknowns; control), of all ranks; collective."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..ranks import gathered
from .face import FaceContact
from .rule import without_area


def penetration(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Depth of the deepest point inside the tool, 0 if none is, length."""
    d = face.contact.tool.signed_distance(face.positions(fields, control))
    return float(face.comm.allreduce(max(float(d.max(initial=0.0)), 0.0), MPI.MAX))


def length(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Return the reference length of the face that is in touch; in three dimensions its area.

    The node on the axis carries hardly any force and may have a small gap where its neighbours stick. It is in touch if
    the point next to it is.
    """
    rule = face.rule
    rows = gathered(face.comm, np.column_stack([rule.points, rule.lumped, rule.extent, face.touching(fields, control)]))
    points, (lumped, extent, touching) = rows[:, :-3], rows[:, -3:].T
    for i in np.flatnonzero(without_area(lumped, extent)):
        touching[i] = max(touching[i], touching[_beside(points, i)])
    return float(extent @ touching)


def area(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Deformed area of the face of a sheet in three dimensions that is in touch, length^2."""
    return _sum(face, face.rule.lumped * face.rule.area_ratio(fields) * face.touching(fields, control))


def force(face: FaceContact, fields: np.ndarray, control: float) -> np.ndarray:
    """Total force of the body on the tool, shape (components,), stress length^2 (per depth: length).

    Axisymmetric: the r entry is the radial traction summed around, not a resultant (which is 0).
    """
    total = (face.area[:, None] * face.tractions(fields, control).force).sum(0) - face.unbalanced
    return np.asarray(face.comm.allreduce(total, MPI.SUM))


def pressing(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Sum of the normal forces at the points, in the units of `force`."""
    return _sum(face, face.area * face.tractions(fields, control).normal)


def energy(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Return the energy of the normal tractions, stress length^3 (per depth: length^2)."""
    return _sum(face, face.rule.area * face.law.energy(face.positions(fields, control), face.touch))


def traction(face: FaceContact, fields: np.ndarray, control: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (reference points, shape (m, components), normal and tangential traction per reference area (m, 2)), by R.

    That is force over `lumped` area: their sum is the force. The node on the axis has none: its force counts to the
    middle of its facet, whose pressure it shows (pressure is even in R, tangential traction odd).
    """
    found, rule, c = face.tractions(fields, control), face.rule, face.points.shape[1]
    rows = np.column_stack([rule.points, rule.area, rule.lumped, rule.lengths, found.normal, found.tangential])
    rows = gathered(face.comm, rows)
    rows = rows[np.lexsort(rows[:, c - 1::-1].T)]
    points, (area, lumped, lengths), values = rows[:, :c], rows[:, c:c + 3].T, rows[:, c + 3:]
    axis = without_area(lumped, lengths)
    values = values * np.divide(area, lumped, out=area.copy(), where=~axis)[:, None]
    for i in np.flatnonzero(axis):
        middle = _beside(points, i)
        values[middle] += values[i] / lumped[middle]
        values[i] = values[middle, 0], 0.0
    return points, values


def _beside(points: np.ndarray, i: int) -> int:
    """Return the point next to points[i]."""
    return int(np.argsort(np.linalg.norm(points - points[i], axis=1))[1])


def _sum(face: FaceContact, values: np.ndarray) -> float:
    return float(face.comm.allreduce(float(values.sum()), MPI.SUM))
