"""Mirror planes of a scene, and the images of the modelled body that form the whole part with it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..mesh.nodes import SAME_PLACE, span
from ..physics.supports import Symmetry

_PARTS = {1: "half", 2: "quarter", 3: "eighth"}


class MirrorPlane(NamedTuple):
    """Plane across which the part continues as the mirror image of the body.

    Attributes:
        axis: index of the coordinate that is constant in the plane.
        position: value of that coordinate, length.
        above: True if the body lies on the side of larger values of this coordinate.
        boundary: name of the boundary of the body that lies in the plane.
    """

    axis: int
    position: float
    above: bool
    boundary: str


class MirrorPlanes:
    """Mirror planes of a scene: the modelled body is a half, a quarter or an eighth of the whole part.

    With m planes the whole part consists of :math:`2^m` images of the body. A `Symmetry` is a mirror plane if its
    boundary is flat and lies at an end of the body, unless it has `guide=True`. The axis of an axisymmetric body does
    not count: results belong to the whole ring. Two parallel planes do not count: the body is one period of an endless
    body, and results belong to this period.

    Attributes:
        planes: mirror planes with different normals.
        near: tolerance of positions, length.
    """

    def __init__(self, planes: tuple[MirrorPlane, ...] = (), near: float = 0.0):
        self.planes, self.near = planes, near

    @classmethod
    def of_description(cls, scene: dict[str, Any]) -> MirrorPlanes:
        """Return the mirror planes of a scene from the data of `formingx.results.files.description.describe`."""
        found = scene.get("symmetry")
        return cls(tuple(MirrorPlane(*plane) for plane in found["planes"]), found["near"]) if found else cls()

    @property
    def factor(self) -> int:
        """Number of images of the modelled body in the whole part, a factor of 2 for every plane."""
        return 2 ** len(self.planes)

    @property
    def part_name(self) -> str:
        """Name of the modelled part: "half", "quarter" or "eighth"; "" without a plane."""
        return _PARTS.get(len(self.planes), "")

    def basis(self, depth: str | None) -> str:
        """Return what results belong to, such as "the whole part (a half was modelled)", or ""; `depth` is a unit."""
        part = f"the whole part (a {self.part_name} was modelled)" if self.planes else "the part"
        return f"{part}, per {depth} of depth" if depth else part * bool(self.planes)

    def factor_of(self, extent: np.ndarray, direction: np.ndarray) -> int:
        """Return the ratio, a power of 2, of the force on a whole tool or support to that on its part in the model.

        A plane counts if `extent`, (2, components), reaches it and the direction (components,) has no component normal
        to it.
        """
        low, high = extent
        cut = [plane for plane in self.planes if abs(direction[plane.axis]) < 1e-9 and (
            low[plane.axis] <= plane.position + self.near if plane.above
            else high[plane.axis] >= plane.position - self.near)]
        return int(2 ** len(cut))

    def images(self, components: int, extent: np.ndarray | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
        r"""Return the maps of positions x in the modelled body, or on a tool, to its images in the whole part.

        .. math:: x_i \to a_i x_i + b_i

        `extent`, shape (2, components), length, of a tool leaves out planes that it crosses. The first map (a, b),
        shape (components,) each, is the identity.
        """
        found = [(np.ones(components), np.zeros(components))]
        for plane in self.planes:
            sign = 1 if plane.above else -1
            if extent is not None and (sign * (extent[:, plane.axis] - plane.position)).min() < -self.near:
                continue
            unit = np.eye(components)[plane.axis]
            found += [(scale * (1 - 2 * unit), shift * (1 - 2 * unit) + 2 * plane.position * unit)
                      for scale, shift in found]
        return found


NO_PLANES = MirrorPlanes()
"""Mirror planes of a part that is modelled as a whole: there are none."""


def mirror_planes(scene: Any) -> MirrorPlanes:
    """Return the mirror planes of a scene, found from its `Symmetry` supports; collective."""
    if scene.state_transfer is not None:
        return scene.first.symmetry
    mesh, kinematics, found = scene.mesh, scene.kinematics, []
    body, near = span(mesh.domain, mesh.comm), SAME_PLACE * float(max(scene.extent))
    for support in scene.supports:
        if not isinstance(support, Symmetry) or support.guide:
            continue
        (constraint,) = kinematics.in_axes(support, support.constraints())
        axis = constraint.component
        if kinematics.axisymmetric and axis == 0:
            continue
        low, high = body[:, axis]
        positions = mesh.nodes_of(support.on)[:, axis]
        flat = np.ptp(positions) < near < high - low
        ends = [end for end in (low, high) if flat and abs(positions.mean() - end) < near]
        found += [MirrorPlane(axis, float(end), bool(end == low), str(support.on)) for end in ends]
    first = {(plane.axis, plane.above): plane for plane in reversed(found)}.values()
    alone = [plane for plane in first if not any(o.axis == plane.axis and o.above != plane.above for o in first)]
    return MirrorPlanes(tuple(sorted(alone)), near) if alone else NO_PLANES
