"""Check of the element size at edges of tools over which the body slides."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...findings import Finding, coordinates
from ...ranks import gathered

EDGE_ANGLE = 40.0
"""Angle between tool normals at neighbouring contact points above which a run warns, degrees (tests/test_edges.py)."""


class SharpEdge(NamedTuple):
    """Convex edge or fillet of a tool between two neighbouring contact points, at least one of which slides.

    Attributes:
        turn: angle between the tool normals at the two points, degrees.
        tool: name of the `Contact` with the tool, or of its boundary if it has no name.
        point: deformed position (r, z) half-way between the two points, length.
    """

    turn: float
    tool: str
    point: tuple[float, float]


def coarsest(path: Any, state: Any) -> SharpEdge | None:
    """Return the tool edge at which its normal turns most between neighbouring contact points, or None; collective.

    Points are ordered by R, then Z; one of two neighbours must slide. Sticking and inseparable contacts are left out.
    """
    found: list[SharpEdge] = []
    with path.problem.state_context(state) as problem:
        fields = problem.x.array_r.copy()
        free = np.ones(len(fields))
        free[problem.constrained] = 0
        for contact in problem.contact.faces:
            if contact.contact.lagged or contact.contact.sticks or not contact.contact.separates:
                continue
            x, law = contact.positions(fields, state.control), contact.tractions(fields, state.control)
            slides = (law.normal != 0) & (np.abs(law.tangential) >= 0.99 * contact.contact.shear_limit(
                np.abs(law.normal), contact.law.mu)[0])
            slides &= contact.displacement(free).any(axis=1)
            normal = contact.contact.tool.nearest(x).normal
            rows = gathered(problem.comm, np.column_stack([contact.points, contact.rule.lengths, x, normal, slides]))
            X, length, x, normal, slides = np.split(rows[np.lexsort((rows[:, 1], rows[:, 0]))], [2, 3, 5, 7], axis=1)
            steps, normal_change = np.diff(x, axis=0), np.diff(normal, axis=0)
            adjacent = np.hypot(*np.diff(X, axis=0).T) < 1.5 * (length[1:] + length[:-1])[:, 0]
            sliding = np.maximum(slides[1:], slides[:-1])[:, 0] > 0
            convex = (normal_change * steps).sum(1) < 0
            turn = 2 * np.degrees(np.arcsin(np.minimum(np.hypot(*normal_change.T) / 2, 1.0)))
            turn *= adjacent & sliding & convex
            for k in np.argsort(turn)[-1:]:
                r, z = x[k] + steps[k] / 2 + contact.tool_displacement(state.control)
                found.append(SharpEdge(float(turn[k]), contact.contact.label, (float(r), float(z))))
    return max((edge for edge in found if edge.turn > 0), default=None)


def findings(edge: SharpEdge | None) -> list[Finding]:
    """Return a warning in a list if the tool normal turns by 40 degrees or more between contact points; else []."""
    if edge is None or edge.turn < EDGE_ANGLE:
        return []
    return [Finding("warning", edge.tool, f"The body slides over an edge of {edge.tool!r} near (r, z) ="
                    f" {coordinates(edge.point, 5)}, and from one contact point to the next the tool"
                    f" turns by {edge.turn:.0f} degrees: forces go up and down as points leave that edge. Use smaller"
                    f" elements on the face that slides, or a larger fillet.")]
