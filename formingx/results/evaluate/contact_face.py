"""Contact of a tool with a face of the body, point by point: pressure, friction and gap; forces on the tools."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...contact import resultants
from ...contact.tooling import Tooling
from ...errors import InputError
from ...mesh.nodes import facet_node_positions, nearest
from ...ranks import gathered
from ..files.column_table import ColumnTable


@dataclass(frozen=True, repr=False)
class ContactTable(ColumnTable):
    """Contact quantities at the n contact points (nodes or Gauss points) of a face, ordered by reference radius.

    Attributes:
        reference_points: reference positions (R, Z) of the points, shape (n, 2), length.
        points: deformed positions (r, z) of the points, shape (n, 2), length.
        gap: distance of each point from the tool, negative inside it, shape (n,), length.
        pressure: contact pressure per deformed area, positive in compression, shape (n,), stress.
        friction: tangential traction of the body on the tool per deformed area, shape (n,), stress. Its positive
            direction is the normal that points into the tool, rotated left by 90 degrees.
        comm: MPI communicator of the run.
    """

    reference_points: np.ndarray
    points: np.ndarray
    gap: np.ndarray
    pressure: np.ndarray
    friction: np.ndarray
    comm: Any

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the table, {name: values, shape (n,)}.

        Their names are reference_radius, reference_height, r, z, gap, contact_pressure and friction_stress.
        """
        R, Z = self.reference_points.T
        return {"reference_radius": R, "reference_height": Z, "r": self.points[:, 0],
                "z": self.points[:, 1], "gap": self.gap, "contact_pressure": self.pressure,
                "friction_stress": self.friction}


class ContactFace:
    """Contact pressure, friction and gap of one `FaceContact`, at the contact points of all ranks.

    Creating it and all of its methods are collective.

    Attributes:
        reference_points: reference positions of the n contact points, ordered by R, then Z, shape (n, 2), length.
        nodes: reference positions of the nodes of the face, edge by edge, shape (m, 2), length.
        nearest: number of the contact point nearest to each node, shape (m,).
    """

    def __init__(self, path: Any, contact: Any):
        self._path, self._contact = path, contact
        self._at_nodes = contact.contact.points == "nodes"
        self.reference_points, _ = self._gathered(contact.points)
        self.nodes = self._edge_points().reshape(-1, self.reference_points.shape[1])
        self.nearest = nearest(self.reference_points, self.nodes)[1]
        if self._at_nodes:
            self._edges = np.unique(self.nearest.reshape(-1, 3), axis=0)             # ghost edges occur twice
            self._reference_tangents = _tangents(self.reference_points[self._edges])

    def evaluate(self, state: Any) -> ContactTable:
        """Return the contact quantities in a state of a section; 0 if the tool is inactive."""
        path, contact = self._path, self._contact
        with path.problem.state_context(state) as problem:
            fields = problem.x.array_r.copy()
            moved = contact.points + path.problem.forms.length * contact.displacement(fields)
            gap = -contact.contact.tool.signed_distance(contact.positions(fields, state.control))
            traction = np.zeros_like(self.reference_points)
            if contact in path.problem.contact.faces:
                _, traction = resultants.traction(contact, fields, state.control)
        _, values = self._gathered(moved, gap)
        points, gap = values[:, :-1], values[:, -1]
        if self._at_nodes:
            ratio = self.area_ratio(points)[:, None]
        else:
            _, ratio = self._gathered(contact.rule.area_ratio(fields))
        pressure, friction = (traction / ratio).T
        return ContactTable(self.reference_points, points, gap, pressure, friction, path.problem.comm)

    def area_ratio(self, points: np.ndarray) -> np.ndarray:
        """Return deformed over reference area at contact points (n, 2), (n,), means of edges at shared nodes."""
        n, reference, now = len(points), self.reference_points[self._edges], points[self._edges]
        ratio = np.linalg.norm(_tangents(now), axis=-1) / np.linalg.norm(self._reference_tangents, axis=-1)
        if self._path.problem.scene.kinematics.dimension_of_volume == 3:
            axis = reference[..., 0] < 1e-9 * self._path.problem.forms.length
            ratio = ratio * np.where(axis, ratio, now[..., 0] / np.where(axis, 1.0, reference[..., 0]))
        edges = self._edges.ravel()
        return np.bincount(edges, ratio.ravel(), n) / np.maximum(np.bincount(edges, minlength=n), 1)

    def _gathered(self, *columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (m, 2) of all ranks ordered by R, then Z, and rows of data, (m, all k); collective."""
        rows = gathered(self._path.problem.comm, np.column_stack([self._contact.points, *columns]))
        rows, n = rows[np.lexsort((rows[:, 1], rows[:, 0]))], self._contact.points.shape[1]
        return rows[:, :n], rows[:, n:]

    def _edge_points(self) -> np.ndarray:
        """Return both ends and the middle of each edge on all ranks, ghosts twice, shape (m, 3, 2), length."""
        mesh = self._path.problem.scene.mesh
        X = gathered(mesh.comm, facet_node_positions(mesh.domain, mesh.facets_of(self._contact.contact.on)))
        return X if X.shape[1] == 3 else np.concatenate([X, X.mean(1, keepdims=True)], axis=1)      # straight edges


def contact_of(path: Any, tool: Any, caller: str) -> list[Any]:
    """Return a tool's `FaceContact`s by a name, `Tool`, `Contact` or None for the only one, else an InputError."""
    contacts = path.problem.contacts
    found = [c for c in contacts if tool is None or tool in (c.contact.name, c.contact.on)
             or tool is c.contact.tool or tool is c.contact]
    names = ", ".join(repr(c.contact.label) for c in contacts)
    if not found:
        which = "the scene has no tool" if not contacts else f"the scene has no such tool; it has {names}"
        raise InputError(f"{caller}: " + f"tool = {tool!r}: " * (tool is not None) + which)
    if tool is None and len({c.contact.name for c in found}) > 1:
        raise InputError(f"{caller}: the scene has several tools, name one: {names}")
    return found


def tool_forces(path: Any) -> dict[str, np.ndarray]:
    """Return {tool: forces (states,)} of the body, along the travel, or Z for a fixed tool, stress length^2."""
    return {name: path[column] for name, column in Tooling.of_problem(path.problem).force_columns.items()}


def _tangents(points: np.ndarray) -> np.ndarray:
    """Return dx/ds at both ends and the middle of m edges, s from 0 to 1, as their x, (m, 3, 2), length."""
    a, b, m = points[:, 0], points[:, 1], points[:, 2]
    return np.stack([4 * m - 3 * a - b, a - 4 * m + 3 * b, b - a], axis=1)
