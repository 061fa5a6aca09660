"""Results that depend on the kinematics: the wall, the part, pictures and reports.

A section is read here. An extension provides the reader of other bodies as `Kinematics.reader`.
"""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import InputError
from ..solve.state import State
from ..units import Units
from .evaluate.wall import Walls
from .numbers import KeyNumbers

if TYPE_CHECKING:
    from ..contact.face import FaceContact
    from .evaluate.filling import Filling
    from .evaluate.wall import Wall
    from .files.sheet import Sheet


class Reader(Protocol):
    """Reader of the states of one path."""

    def wall(self, state: State) -> Sheet:
        """Return the wall of the part, place by place."""

    def part(self, state: State, density: float | None, trim: object, heights: object, units: Units) -> KeyNumbers:
        """Return the part in numbers; arguments: see `Path.part`."""

    def filling(self, contact: FaceContact) -> Sheet:
        """Return the gap between the body and a tool in every state."""

    def view(self, file: object, state: State, grid: float | None) -> None:
        """Draw the body of a state as PNG; arguments: see `Path.view3d`."""

    def solid(self, state: State) -> tuple:
        """Return points, shape (n, 3), triangles, shape (m, 3), and wall ratios, shape (n,), of the part as a solid."""

    def report(self, file: object, title: str, failure: object, units: Units, density: float | None,
               trim: object) -> FilePath:
        """Write the report of the run; arguments: see `Path.report`."""


class SectionReader:
    """Reader of an axisymmetric or plane-strain section.

    Args:
        path: the path.
    """

    def __init__(self, path: Any):
        self._path, self._walls = path, Walls(path)
        self._axisymmetric = path.scene.kinematics.axisymmetric

    def wall(self, state: State) -> Wall:
        """Return the `Wall` of a state."""
        return self._walls.of(state)

    def part(self, state: State, density: float | None, trim: Any, heights: Any, units: Units) -> KeyNumbers:
        """Return the `Part` of a state."""
        from .evaluate.part import part
        return part(self.wall(state), self._axisymmetric, density, trim, heights, units, self._path.scene.symmetry)

    def filling(self, contact: FaceContact) -> Filling:
        """Return the `Filling` of a tool.

        Raises:
            InputError: the run has several meshes, or the tool has no corner that the body must fill.
        """
        if len(self._path.segments) > 1:
            raise InputError("filling: is not available for a remeshed run as a whole: take that of one mesh,"
                             " path.alone(state).filling()")
        from .evaluate.filling import filling
        return filling(self._path, contact)

    def view(self, file: Any, state: State, grid: float | None) -> None:
        """Draw the revolved or extruded section of a state; `grid` is not used."""
        from .show import views
        draw = views.revolved if self._axisymmetric else views.extruded
        draw(self._path.profile(state), file, self._path.problem.comm)

    def solid(self, state: State) -> tuple:
        """Return points, triangles and wall ratios of the revolved or extruded section."""
        from .files.solid import coloured
        return coloured(self._path.profile(state), self._axisymmetric)

    def report(self, file: Any, title: str, failure: Any, units: Units, density: float | None, trim: Any) -> FilePath:
        """Write the report of the run."""
        from .show import report
        return report.write(report.of_path(self._path), file, title, failure, self._path.problem.comm, units, density,
                            trim)
