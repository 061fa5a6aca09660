"""Factors by which the columns of a mesh must become shorter or longer, from the states of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, positive
from ...forms.outline import FINE_PIECES, Outline, edge_points
from ...results.reader import section_only
from ...values.tolerances import EXAMINED_STATES

_FILLET_GAP = 0.25
"""Gap over the fillet radius up to which a face lies on the fillet: the gap of a chord of 80 degrees."""

_MAX_ROTATION = 1.0
"""Upper bound of the rotation of a column, radians: a larger one belongs to a coarse or a crushed element."""

_STRESS_ORDER = 2
"""Order of the stress error."""


def column_factors(path: Any, max_rotation: float | None, error: float | None) -> np.ndarray:
    """Return the factors by which n columns of a mesh should become longer, shape (n,); inf where no state demands one.

    A column has the elements between two cross-sections; its factor is the smallest over the states of the run. The
    sheet turns along it by at most `max_rotation`, radians, with at most this times a fillet radius as length. `error`:
    allowed relative error of the stress, as norms over the body. None: ignored.
    """
    section_only(path.scene, "column_factors", "use fx.mesh.adapted")
    max_rotation, error = (value if value is None else positive(f"column_factors: {name}", value)
                    for name, value in (("max_rotation", max_rotation), ("error", error)))
    columns = path.problem.scene.mesh.columns
    if columns is None:
        raise InputError("column_factors: the mesh has no columns: must be made by disc, sphere, parison or from_lines")
    middles = columns.place((columns.ends[1:] + columns.ends[:-1]) / 2)
    factors = np.full(len(columns.ends) - 1, np.inf)
    if max_rotation is not None and path.problem.scene.model.solid:
        factors = np.minimum(factors, _factors_by_rotation(path, max_rotation, middles))
    if error is not None:
        factors = np.minimum(factors, _factors_by_stress_error(path, error, middles))
    return factors


def _nearest_column(points: np.ndarray, middles: np.ndarray) -> np.ndarray:
    """Return the nearest of n columns with middles (rows, n, 2) to each point (m, 2), shape (m,)."""
    n = middles.shape[1]
    from scipy.spatial import cKDTree
    return cKDTree(middles.reshape(-1, middles.shape[-1])).query(points)[1] % n


def _factors_by_rotation(path: Any, max_rotation: float, middles: np.ndarray) -> np.ndarray:
    """Return the required over the present length of the n columns of elements for a limit of rotation, shape (n,).

    The limit, in radians, holds for the angle along a column, and on a fillet also for its length over the radius.
    Middles of the columns have shape (rows of nodes, n, 2), length.
    """
    found = np.full(middles.shape[1], np.inf)
    problem = path.problem
    columns, outline = problem.scene.mesh.columns, Outline(problem.forms)
    faces = [outline.mask(contact.contact.on) for contact in problem.contacts]
    column = _nearest_column(outline.reference_edges[:, 2], middles[[0, -1]])
    begin = columns.place(columns.ends[:-1])[[0, -1]]
    sides = []                                               # edges column by column, mask of reversed ones
    for name, first in zip(columns.faces, begin):
        edges = np.flatnonzero(outline.mask(name))
        edges = edges[np.unique(column[edges], return_index=True)[1]]               # ghosts appear twice
        a, b = (np.linalg.norm(outline.reference_edges[edges, k] - first, axis=1) for k in (0, 1))
        sides.append((edges, a > b))
    for state in path.states:
        with problem.state_context(state):
            edges = outline.edges()
        found = np.minimum(found, max_rotation / np.maximum(_rotations(edges, sides), 1e-300))
        points = edge_points(edges, FINE_PIECES)
        length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(1)
        with problem.state_context(state):
            for contact, face in zip(problem.contacts, faces):
                if not contact.active:
                    continue
                positions = points[face] - contact.tool_displacement(state.control)
                nearest = contact.contact.tool.nearest(positions.reshape(-1, positions.shape[-1]))
                bend = np.abs(nearest.curvature)
                radius = np.divide(1, bend, out=np.zeros(len(bend)), where=bend > 0) + np.sign(
                    nearest.curvature) * nearest.distance
                on_fillet = (radius > 0) & (-nearest.distance < _FILLET_GAP * radius)
                smallest = np.where(on_fillet, radius, np.inf).reshape(-1, FINE_PIECES + 1).min(1)
                np.minimum.at(found, column[face], max_rotation * smallest / length[face])
    return found


def _rotations(edges: np.ndarray, sides: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return the angle by which the sheet turns along each of n columns, radians, at most 1, shape (n,).

    Edges have shape (m, 3, 2). A jump between two columns counts half in each. Each of the two `sides` has rows of
    edges and masks of those that end at the column's end, (n,).
    """
    tangent = np.zeros(edges.shape[-1])                      # at both ends of each column, averaged over both faces
    for numbers, reversed_edges in sides:
        a, b, m = edges[numbers].transpose(1, 0, 2)
        first, last = 4 * m - 3 * a - b, 3 * b - 4 * m + a
        tangents = np.where(reversed_edges[:, None, None], -np.stack([last, first], 1), np.stack([first, last], 1))
        tangent = tangent + tangents / np.linalg.norm(b - a, axis=1)[:, None, None]
    angle = np.unwrap(np.arctan2(tangent[..., 1], tangent[..., 0]).ravel())
    turn = np.abs(np.diff(angle))
    inside, kinks = turn[::2], np.concatenate([[0.0], turn[1::2], [0.0]])
    return np.minimum(inside + (kinks[1:] + kinks[:-1]) / 2, _MAX_ROTATION)


def _factors_by_stress_error(path: Any, error: float, middles: np.ndarray) -> np.ndarray:
    r"""Return the required over the present length of the n columns of elements for a given stress error, shape (n,).

    .. math:: h \propto C^{-2/(2p + 1)}, \qquad \int (C h^p)^2 \, ds = \varepsilon^2 \|\sigma\|^2

    C h^p is the error of the stress sigma in a column of elements of length h. The order is p = 2, and the run gives
    the constant C of each column. s is the length along the sheet. The smallest ratio of h to the present length over
    the examined states is returned. `error` is epsilon; middles of the columns have shape (rows of nodes, n, 2),
    length.
    """
    n = middles.shape[1]
    length = np.linalg.norm(np.diff(path.problem.scene.mesh.columns.place(
        path.problem.scene.mesh.columns.ends)[[0, -1]], axis=1), axis=2).mean(0)
    found = np.full(n, np.inf)
    states = [state for state in path.states if state.kind != "start"]
    examined = np.unique(np.linspace(0, len(states) - 1, EXAMINED_STATES).astype(int))
    for state in (states[k] for k in examined):
        estimate = path.stress(state).error()
        squares = np.bincount(_nearest_column(estimate.points, middles), estimate.cells**2, n)
        allowed = (error * np.linalg.norm(estimate.stress)) ** 2
        q = 2 * _STRESS_ORDER + 1
        density = (squares / length**q) ** (1 / q)           # C^(2/q)
        with np.errstate(divide="ignore"):
            h = (allowed / max((density * length).sum(), 1e-300)) ** (1 / (q - 1)) / density
        found = np.minimum(found, h / length)
    return found
