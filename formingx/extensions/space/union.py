"""Rigid tools in three dimensions that consist of several solids, such as a box with a rib."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np

from ...errors import InputError, as_list, check_type, non_negative
from .edge_fillets import complement, rounded_distances, rounded_minimum
from .solid_tool import SolidTool, nearest_of


class Union(SolidTool):
    """Union of several rigid solids, which are one tool with one contact.

    The signed distance is the largest of the distances from the parts, positive inside. It is exact outside. Where two
    parts meet, their common surface is sharp, or has a fillet.

    Args:
        parts: the solids; each may be moved.
        names: name of each part, in reports and tables.
        fillet: radius of the edges where parts meet, length.

    Attributes:
        parts: the solids.
        names: their names.
        fillet: radius of the edges where parts meet, length.
    """

    def __init__(self, parts: Sequence[SolidTool], names: Sequence[str], fillet: float = 0.0):
        self.parts, self.names, self.fillet = list(parts), list(names), fillet
        self.sized = all(part.sized for part in parts)

    def nearest_parts(self, x: np.ndarray) -> np.ndarray:
        """Return the number of the part that is nearest to each point, shape (n,); x: positions, shape (n, 3), length.
        """
        return np.asarray(np.argmax([part.signed_distance(x - self.shift) for part in self.parts], axis=0))

    def _distance(self, x):
        """Return the signed distances from the unmoved tool, positive inside, shape (n,), length."""
        found = [part.signed_distance(x) for part in self.parts]
        return -reduce(lambda a, b: rounded_minimum(a, -b, self.fillet), found[1:], -found[0]) if self.fillet else (
            np.max(found, axis=0))

    def _distances(self, x):
        """Return distances, normals and Hessians at positions x relative to the unmoved tool, shape (n, 3), length."""
        found = [part.distances(x) for part in self.parts]
        return complement(reduce(lambda a, b: rounded_distances(a, b, self.fillet), map(
            complement, found))) if self.fillet else nearest_of(found)

    def _surface(self):
        """Return vertices, shape (n, 3), length, and vertex numbers of triangles, shape (m, 3), of the unmoved tool."""
        points, triangles = zip(*(part.surface() for part in self.parts))
        begin = np.cumsum([0, *map(len, points)])
        return np.concatenate(points), np.concatenate([part + k for part, k in zip(triangles, begin)])

    def __repr__(self) -> str:
        return f"union({', '.join(map(repr, self.parts))}{f', fillet={self.fillet:g}' if self.fillet else ''})"


def union(*parts: SolidTool, names: Sequence[str] | None = None, fillet: float = 0.0) -> Union:
    """Return one rigid tool that consists of several solids, such as a box with a rib, or two halves of a mould.

    A face of a sheet must have one contact with all parts of a mould. With a contact for each part, a point that one
    part holds could not touch the other.

    Args:
        parts: the solids, such as `fx.tools.box(...)` and `fx.tools.solid("rib.stl")`.
        names: name of each part, in reports and tables; default "part 1", "part 2" and so on.
        fillet: radius of the concave edges where parts meet, length. The drawn surface has none.

    Returns:
        The tool.

    Raises:
        InputError: fewer than two parts, a part that is no tool in three dimensions, or names that do not fit.

    >>> tray = fx.tools.box(half=(60.0, 40.0), depth=20.0, corner=15.0, fillet=5.0)
    >>> rib = fx.tools.extruded(fx.Tool([(3.0, -20.0), (1.0, -10.0), (-1.0, -10.0), (-3.0, -20.0)]))
    >>> fx.tools.union(tray, rib, names=["tray", "rib"]).signed_distance([[0.0, 0.0, -8.0]]).tolist()
    [-2.0]
    """
    solids: list[Any] = [check_type("union: part", part, SolidTool, "a tool in three dimensions") for part in parts]
    if len(solids) < 2:
        raise InputError(f"union: {len(solids)} parts: must be at least two tools")
    words = [f"part {k + 1}" for k in range(len(solids))] if names is None else as_list("union: names", names, "words")
    for word in words:
        check_type("union: names: name", word, str, "a word")
    if len(words) != len(solids) or len(set(words)) < len(words):
        raise InputError(f"union: names = {words!r}: must be one for each of the {len(solids)} parts, and each another")
    return Union(solids, words, non_negative("union: fillet", fillet))
