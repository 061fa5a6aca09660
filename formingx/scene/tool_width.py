"""Check that no tool passes between two contact points of a face, or penetrates the face before it meets a point."""

from typing import Any

import numpy as np

from ..errors import InputError
from ..findings import coordinates
from ..mesh.nodes import facet_node_positions
from ..mesh.triangles import Triangles
from ..physics.contact import Contact
from ..ranks import gathered
from ..values.tolerances import PIECE_POINTS

CUT = 0.1
"""Largest allowed penetration of a tool between contact points, over the thickness of the body."""

_MAX_MOVES = 200
"""Largest number of moves of a tool towards a face."""


def check(mesh: Any, contact: Contact, axisymmetric: bool) -> None:
    """Raise an InputError if the contact points of a face are too sparse to detect a tool.

    It could pass between two, or cut more than 10 % (`CUT`) of the thickness before it meets one.
    """
    ends = gathered(mesh.comm, facet_node_positions(mesh.domain, mesh.facets_of(contact.on))[:, :2])
    if contact.tool.closed:
        _check_width(contact, ends, axisymmetric)
    _check_first_touch(contact, ends, Triangles(mesh).thickness)


def _check_width(contact: Contact, ends: np.ndarray, axisymmetric: bool) -> None:
    """Raise an InputError if a closed tool is narrower than the distance of the contact points nearest to it.

    `ends` are the end points of the element edges of the face, shape (n, 2, 2), length.
    """
    from scipy.spatial import ConvexHull
    outline = contact.tool.surface()[0]
    if axisymmetric and outline[:, 0].min() <= 1e-9 * contact.tool.size:         # its other half
        outline = np.concatenate([outline, outline * (-1, 1)])
    normals = ConvexHull(outline).equations[:, :2]          # the smallest width is across an edge of the hull
    width = float(np.ptp(outline @ normals.T, axis=0).min())
    nearest = ends[np.argmax(contact.tool.signed_distance(ends.mean(1)))]
    points = 2 if contact.points == "nodes" else int(contact.points)
    edge = float(np.hypot(*(nearest[1] - nearest[0])))
    if width < edge / points:
        raise InputError(f"{contact!r}: the tool is {width:.4g} wide, less than the {edge / points:.4g} from one"
                         f" contact point of {contact.on!r} to the next: it would pass between them; use elements of"
                         f" {points * width:.4g} or less there (they are {edge:.4g} long)")


def _check_first_touch(contact: Contact, ends: np.ndarray, thickness: float) -> None:
    """Raise an InputError if a tool would cut more than `CUT` of the thickness before it meets a contact point.

    It moves by its distance from the nearest point (sphere tracing), so it passes none; without a direction it moves
    along its normal. Edges of the face have ends (n, 2, 2), length.
    """
    tool = contact.tool
    near = tool.nearest(ends.mean(1))
    way = -near.normal[np.argmax(near.distance)]
    if contact.direction:
        way = contact.travel_vector / np.hypot(*contact.travel_vector)
    fractions = np.array([0.0, 0.5, 1.0]) if contact.points == "nodes" else (
        np.polynomial.legendre.leggauss(int(contact.points))[0] + 1) / 2
    points, places = (ends[:, :1] + s[:, None] * (ends[:, 1:] - ends[:, :1])
                      for s in (fractions, np.linspace(0, 1, PIECE_POINTS)))
    travel, furthest = 0.0, 2 * (tool.size + float(np.ptp(ends, axis=(0, 1)).max()))
    for _ in range(_MAX_MOVES):
        gap = -float(tool.signed_distance(points.reshape(-1, points.shape[-1]) - travel * way).max())
        if gap < 1e-6 * thickness:
            break
        travel += gap
        if gap > furthest or travel > 5 * furthest:
            return                                          # the tool misses the face
    depth = tool.signed_distance(places.reshape(-1, places.shape[-1]) - travel * way).reshape(places.shape[:2]).max(1)
    worst = int(np.argmax(depth))
    if depth[worst] > CUT * thickness:
        edge = float(np.hypot(*(ends[worst, 1] - ends[worst, 0])))
        r, z = ends[worst].mean(0)
        raise InputError(f"{contact!r}: the tool would be {depth[worst]:.4g} deep in {contact.on!r} near (R, Z) ="
                         f" {coordinates((r, z))}, between two contact points, before it meets one: use elements of"
                         f" {edge * CUT * thickness / depth[worst]:.4g} or less there (they are {edge:.4g} long), or a"
                         f" rounder edge")
