"""Positions of material points on the successive meshes of a remeshed body.

A new mesh has the deformed body as reference configuration. A point of the first mesh therefore has another position on
each later mesh.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...forms.outline import FINE_PIECES, Outline, edge_points
from ...forms.probes import Probe
from ...forms.transfer import MovingLeastSquares
from ...mesh.nodes import dof_positions, node_positions

_OUTLINE_DISTANCE = 0.02
"""Distance from the outline over the length of an edge below which a point is moved onto it: new edges differ from old.
"""

_CANDIDATES = 4
"""Points of the outline among which the edge closest to a position is searched; two of them share a corner."""


class MaterialPointProbe(Probe):
    """Probe of the displacement of material points since the start of a remeshed run.

    Attributes:
        points: positions (R, Z) of the points on the first mesh, shape (n, 2), length.
        earlier_displacement: displacement of the points from the first to the present mesh, shape (n, 2), length.
    """

    def __init__(self, problem: Any, points: Any):
        first = np.atleast_2d(np.asarray(points, dtype=float))
        super().__init__(problem, followed(problem, first))
        self.points, self.earlier_displacement = first, self.points - first

    def _read(self) -> np.ndarray:
        """Return the displacements of the n material points since the start of the run, shape (n, 2), length."""
        return super()._read() + self.earlier_displacement


def original_positions(state_transfer: Any, points: np.ndarray) -> np.ndarray:
    """Map points of a new mesh (n, 2) to the first mesh of the run, through the old one's deformed nodes; length."""
    old, state = state_transfer.before
    nodes = node_positions(old.forms.domain)
    first = nodes if old.scene.state_transfer is None else original_positions(old.scene.state_transfer, nodes)
    found = MovingLeastSquares(old.comm, nodes + Probe(old, nodes).displacement_in(state), points).fitted(first)
    return np.clip(found, first.min(0), first.max(0))


def scene_on_new_mesh(mesh: Any, state_transfer: Any) -> Any:
    """Return the scene of `StateTransfer.before` on a mesh of the deformed body, with its last temperature."""
    old, state = state_transfer.before
    if old.temperature is None:
        return old.scene.with_mesh(mesh, state_transfer)
    with old.state_context(state):
        field = old.temperature.T.copy()
    nodes, T = dof_positions(field.function_space), field.x.array
    moved = nodes + Probe(old, nodes).displacement_in(state)
    return old.scene.with_mesh(mesh, state_transfer, lambda R, Z: np.clip(
        MovingLeastSquares(old.comm, moved, np.column_stack([R, Z])).fitted(T), T.min(), T.max()))


def followed(problem: Any, points: np.ndarray) -> np.ndarray:
    """Map points of the first mesh of a run, shape (n, 2), length, to their positions on the mesh of a problem."""
    if problem.scene.state_transfer is None:
        return points
    old, state = problem.scene.state_transfer.before
    points = followed(old, points)
    return _OutlineProjection(problem)(points + Probe(old, points).displacement_in(state))


class _OutlineProjection:
    """Projection of points outside or near the outline of a mesh onto this outline."""

    def __init__(self, problem: Any):
        outline = Outline(problem.forms)
        self._edges = outline.reference_edges
        self._near = _OUTLINE_DISTANCE * np.linalg.norm(self._edges[:, 1] - self._edges[:, 0], axis=1)
        start, end = outline.ends.T
        self._previous, self._next = (np.argmax(a[:, None] == b, axis=1) for a, b in ((start, end), (end, start)))

    @cached_property
    def _tree(self) -> Any:
        """Search tree of points along the edges of the outline."""
        from scipy.spatial import cKDTree
        return cKDTree(edge_points(self._edges, FINE_PIECES).reshape(-1, self._edges.shape[-1]))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return positions x, shape (n, 2), length, with points outside or near the outline projected onto it."""
        edge, part = np.divmod(self._tree.query(x, k=_CANDIDATES)[1], FINE_PIECES + 1)
        found = [self._closest(x, edges, parts / FINE_PIECES) for edges, parts in zip(edge.T, part.T)]
        nearest = np.argmin([np.linalg.norm(offset, axis=1) for _, offset, _ in found], axis=0)
        pick = np.arange(len(x))
        edge = edge[pick, nearest]
        s, offset, normal = (np.array(values)[nearest, pick] for values in zip(*found))
        for end, neighbour in ((0.0, self._previous), (1.0, self._next)):     # at a corner both edges decide
            other = self._closest(x, neighbour[edge], np.full(len(x), 1 - end), fixed=True)[2]
            normal += np.where(s == end, other, 0.0)
        outside = (normal * offset).sum(1) < 0
        projected = outside | (np.linalg.norm(offset, axis=1) < self._near[edge])
        return x + np.where(projected[:, None], offset, 0.0)

    def _closest(self, x: np.ndarray, edge: np.ndarray, s: np.ndarray, fixed: bool = False) -> tuple[np.ndarray, ...]:
        """Return the closest points on given edges: parameter, shape (n, 1), offset and outer normal, shape (n, 2).

        x: shape (n, 2), length. The guesses s go from 0 at the start of an edge to 1; `fixed` keeps them.
        """
        a, b, middle = np.moveaxis(self._edges[edge], 1, 0)
        s, bend = s[:, None], 2 * (a + b - 2 * middle)
        for _ in range(0 if fixed else 4):                   # Newton's method for the closest point on the parabola
            slope, offset = b - a + (2 * s - 1) * bend, _points_on_edges(a, b, middle, s) - x
            rate = (slope * slope + bend * 2 * offset).sum(1, keepdims=True)
            s = np.clip(s - (slope * offset).sum(1, keepdims=True) / rate, 0.0, 1.0)
        slope, offset = b - a + (2 * s - 1) * bend, _points_on_edges(a, b, middle, s) - x
        normal = np.column_stack([slope[:, 1], -slope[:, 0]])           # the body is to the left
        return s, offset, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _points_on_edges(a: np.ndarray, b: np.ndarray, middle: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return points (n, 2) at s (n, 1), 0 at a to 1 at b, on parabolic edges with ends and midpoints (n, 2)."""
    return (1 - s) * (1 - 2 * s) * a + s * (2 * s - 1) * b + 4 * s * (1 - s) * middle
