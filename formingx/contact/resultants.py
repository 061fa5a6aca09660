"""Resultants of one contact at a state: force, energy, contact length and area, summed over all ranks.

Each function is collective. The state is given by `fields`, the locally owned unknowns, shape (n,), and by `control`,
the dimensionless control.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..ranks import combined, gathered
from .face import FaceContact
from .rule import without_area


def penetration(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Return the largest penetration depth of the contact points into the tool, length; 0 if none is inside."""
    d = face.contact.tool.signed_distance(face.positions(fields, control))
    return float(combined(face.comm, max(float(d.max(initial=0.0)), 0.0), MPI.MAX))


def length(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Return the reference length of the face in contact; in three dimensions its area, length^2.

    The node on the axis carries hardly any force and may have a small gap: it counts as in contact if the next point
    does. fields: owned unknowns, shape (n,).
    """
    rule = face.rule
    rows = gathered(face.comm, np.column_stack([rule.points, rule.lumped, rule.extent, face.touching(fields, control)]))
    points, (lumped, extent, touching) = rows[:, :-3], rows[:, -3:].T
    for i in np.flatnonzero(without_area(lumped, extent)):
        touching[i] = max(touching[i], touching[_beside(points, i)])
    return float(extent @ touching)


def area(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Return the deformed contact area of a sheet in three dimensions, length^2."""
    return _sum(face, face.rule.lumped * face.rule.area_ratio(fields) * face.touching(fields, control))


def force(face: FaceContact, fields: np.ndarray, control: float) -> np.ndarray:
    """Return the contact force of the body on the tool, shape (components,), stress length^2 (per depth stress length).

    The axisymmetric r entry is the radial traction over the circumference, no resultant.
    """
    total = face.forces(fields, control).sum(0) - face.unbalanced
    return np.asarray(combined(face.comm, total, MPI.SUM))


def normal_force(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Return the sum of the normal contact forces, stress length^2; in plane strain per depth."""
    return _sum(face, face.area * face.tractions(fields, control).normal)


def energy(face: FaceContact, fields: np.ndarray, control: float) -> float:
    """Return the energy stored by the penalty of the contact, stress length^3; in plane strain per depth."""
    return _sum(face, face.rule.area * face.law.energy(face.positions(fields, control), face.history))


def traction(face: FaceContact, fields: np.ndarray, control: float) -> tuple[np.ndarray, np.ndarray]:
    """Return reference positions, shape (m, components), and tractions, shape (m, 2), normal and tangential, stress.

    They are sorted by R, over all ranks: forces divided by tributary reference areas (`Rule.lumped`). The node on the
    axis has none. Its force is added to the middle node of its facet, whose pressure it gets: the pressure is even in
    R, the tangential traction odd.
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
    """Return the index of the point nearest to `points[i]`, among positions of shape (m, components)."""
    return int(np.argsort(np.linalg.norm(points - points[i], axis=1))[1])


def _sum(face: FaceContact, values: np.ndarray) -> float:
    """Return the sum of values at the locally owned points, shape (n,), over the points of all ranks."""
    return float(combined(face.comm, float(values.sum()), MPI.SUM))
