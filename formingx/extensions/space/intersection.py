"""Intersection of rigid tools in three dimensions: half moulds, and moulds with a cavity of several parts."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ...errors import InputError, check_name, check_type, finite, non_negative
from .bodies import merged
from .edge_fillets import rounded_distances, rounded_minimum
from .lagged_friction import Distances
from .solid_tool import SolidTool
from .surface_mesh import positive_part

_CUT_PIECES = 40           # extent of a surface over the longest edge of triangles that are cut


class HalfSpace(SolidTool):
    """Rigid half space normal to the coordinate axis 0, 1 or 2; `position` is its plane, length.

    The solid lies on the side of larger values if `sign` is 1, of smaller ones if -1.
    """

    sized = False

    def __init__(self, axis: int, sign: float, position: float = 0.0):
        self.axis, self.sign, self.position = axis, sign, position

    def _distance(self, x):
        """Return the signed distances from the unmoved plane, positive inside, shape (n,), length."""
        return self.sign * (x[:, self.axis] - self.position)

    def _distances(self, x):
        """Return distances, normals and Hessians at positions x relative to the unmoved plane, shape (n, 3), length."""
        normal = np.tile(self.sign * np.eye(3)[self.axis], (len(x), 1))
        return Distances(self._distance(x), normal, np.zeros((len(x), 3, 3)))

    def _surface(self):
        """Return no vertices and no triangles: a plane is not drawn."""
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)

    def __repr__(self) -> str:
        return f"half space {'xyz'[self.axis]} {'>' if self.sign > 0 else '<'} {self.position:g}"


class Intersection(SolidTool):
    r"""Rigid tool whose solid is common to two tools, with a rounded edge between their surfaces.

    With the signed distances d_1 and d_2, positive inside, and the radius R of the edge

    .. math::
        d = \max(R, \min(d_1, d_2)) - \sqrt{u_1^2 + u_2^2}, \qquad u_i = \max(R - d_i, 0)

    The edge is an exact fillet of radius R where the surfaces are normal to each other. Between surfaces at another
    angle it is a smooth transition. For R = 0 the edge is sharp.

    Args:
        first: a tool.
        second: another tool.
        fillet: radius of the edge, length.
    """

    def __init__(self, first: SolidTool, second: SolidTool, fillet: float = 0.0):
        self.first, self.second, self.fillet = first, second, fillet
        self.sized = first.sized or second.sized

    def _distances(self, x):
        """Return distances, normals and Hessians at positions x relative to the unmoved tool, shape (n, 3), length."""
        a, b = (tool.distances(x) for tool in (self.first, self.second))
        return rounded_distances(a, b, self.fillet)

    def _distance(self, x):
        """Return the signed distances from the unmoved tool, positive inside, shape (n,), length."""
        return rounded_minimum(self.first.signed_distance(x), self.second.signed_distance(x), self.fillet)

    def _surface(self):
        """Return vertices, shape (n, 3), length, and vertex numbers of triangles, shape (m, 3), of the unmoved tool."""
        return self._visible

    @cached_property
    def _visible(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices and triangles of both surfaces, as far as they lie in the other solid, (n, 3), length, and (m, 3).
        """
        points, triangles, n = [], [], 0
        for tool, other in ((self.first, self.second), (self.second, self.first)):
            x, cells = tool.surface()
            if not len(cells):
                continue
            corners = _inside(x[cells], other, float(np.ptp(x, axis=0).max()))
            points.append(corners.reshape(-1, 3))
            triangles.append(np.arange(3 * len(corners)).reshape(-1, 3) + n)
            n += 3 * len(corners)
        if not points:
            raise InputError(f"{self!r}: has no surface: both tools are half spaces")
        if not n:
            raise InputError(f"{self!r}: has no surface: the surface of neither tool lies in the solid of the other."
                             f" Are both at their places, in the same unit of length?")
        return merged(np.vstack(points), np.vstack(triangles))

    def __repr__(self) -> str:
        return f"intersection({self.first!r}, {self.second!r}{f', fillet={self.fillet:g}' if self.fillet else ''})"


def _inside(corners: np.ndarray, tool: SolidTool, size: float) -> np.ndarray:
    """Return the triangles of a surface that lie in the solid of a tool, cut at its surface, shape (k, 3, 3), length.

    corners: shape (m, 3, 3), length; size: extent. Triangles that may be cut are halved until they are short.
    """
    found, near = [], 1e-9 * size
    while len(corners):
        d = tool.signed_distance(corners.reshape(-1, 3)).reshape(-1, 3)
        edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        longest = edges.max(1)
        inside = (d > -near).all(1)
        away = (d < -longest[:, None]).any(1)
        short = longest < size / _CUT_PIECES
        found.append(corners[inside])
        cut = short & ~inside & ~away
        points, cells, _ = positive_part(corners[cut], d[cut])
        found.append(points[cells])
        rest = ~inside & ~away & ~short
        k = edges[rest].argmax(1)
        a, b, c = corners[rest][np.arange(len(k))[:, None], (k[:, None] + np.arange(3)) % 3].swapaxes(0, 1)
        middle = (a + b) / 2
        corners = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(found)


def intersection(first: SolidTool, second: SolidTool, fillet: float = 0.0) -> Intersection:
    """Return the rigid tool whose solid is common to two tools; its cavity is the union of their cavities.

    Args:
        first: a tool in three dimensions.
        second: another tool in three dimensions.
        fillet: radius of the edge where the surfaces meet, length.

    Returns:
        The tool.

    Raises:
        InputError: an argument that is no tool in three dimensions, or a negative radius.

    >>> body = fx.tools.box(half=(35.0, 35.0), depth=150.0, corner=12.0, fillet=6.0, mouth=-30.0)
    >>> neck = fx.tools.revolved(fx.tools.cup(radius=17.0, depth=60.0).mirrored())
    >>> mould = fx.tools.intersection(body, neck, fillet=4.0)
    """
    for tool in (first, second):
        check_type("intersection: tool", tool, SolidTool, "a tool in three dimensions")
    return Intersection(first, second, non_negative("intersection: fillet", fillet))


def half(tool: SolidTool, normal: str = "x", *, position: float = 0.0) -> Intersection:
    """Return one half of a mould, cut at a plane normal to an axis; the parting plane is solid, too.

    Each half is a contact of its own, with the direction in which it closes.

    Args:
        tool: the whole mould, from a profile, an STL file or a STEP file.
        normal: "x", "y" or "z" for the half on the side of larger coordinates, "-x", "-y" or "-z" for the other half.
        position: coordinate of the parting plane, length.

    Returns:
        The half mould, closed. Move it apart with `moved`.

    Raises:
        InputError: `tool` is no tool in three dimensions, or the normal is unknown.

    >>> mould = fx.tools.box(half=(35.0, 35.0), depth=150.0, corner=12.0, fillet=6.0)
    >>> right = fx.tools.half(mould, normal="x").moved(x=30.0)
    >>> right.signed_distance([[40.0, 0.0, -100.0], [29.0, 50.0, -100.0]]).tolist()
    [-25.0, -1.0]
    """
    check_type("half: tool", tool, SolidTool, "a tool in three dimensions")
    check_name("half: normal", normal, [sign + axis for axis in "xyz" for sign in ("", "-")])
    side = HalfSpace("xyz".index(normal[-1]), -1.0 if normal[0] == "-" else 1.0, finite("half: position", position))
    return Intersection(tool, side)
