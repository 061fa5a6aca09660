"""Results whose evaluation depends on the kinematics: the wall, the part, pictures and reports.

This module evaluates axisymmetric and plane-strain sections. An extension provides the reader of sheets in three
dimensions as `Kinematics.reader`.
"""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Protocol

from ..errors import InputError
from ..solve.state import State
from ..units import Units
from .evaluate.profile import Profile, whole_part
from .evaluate.wall import Walls
from .numbers import KeyNumbers

if TYPE_CHECKING:
    from ..contact.face import FaceContact
    from .evaluate.filling import Filling
    from .evaluate.stress import StressField
    from .evaluate.wall import Wall
    from .files.column_table import ColumnTable


class Reader(Protocol):
    """Interface of classes that evaluate the states of one path for one kinematics: section or three dimensions."""

    def wall(self, state: State) -> ColumnTable:
        """Return the wall thickness of the part in a state as a table, one row per point or triangle."""

    def part(self, state: State, density: float | None, trim: object, heights: object, units: Units) -> KeyNumbers:
        """Return the key numbers of the part in a state.

        density: g/cm3, or None. trim: radius at which the part is cut off, ("height", h), or None, length; in three
        dimensions z of a plane beyond which the part lies. heights: axial distances from the pole with a wall, length;
        none in three dimensions.
        """

    def stress(self, state: State, depth: float | None) -> Any:
        """Return the stresses of the body in a state; depth: in a sheet in three dimensions, from 0 to 1, or None."""

    def filling(self, contact: FaceContact) -> ColumnTable:
        """Return the remaining gaps between the body and the tool of a contact as a table, one row per state.

        In a section the columns are the controls, such as the pressure, and the gap in each corner of the tool.
        """

    def view(self, file: object, state: State, grid: float | None, camera: object) -> None:
        """Draw the body in a state as a PNG file, coloured by its wall over the original thickness.

        grid: size of the squares of a grid printed on a flat sheet in three dimensions, length, or None. camera: name
        of a view, direction from the part to the camera, or None.
        """

    def solid(self, state: State) -> tuple:
        """Return the part in a state as a closed surface of triangles.

        Points (x, y, z), shape (n, 3), length; row numbers of corners, shape (m, 3); wall over original thickness at
        the points, shape (n,).
        """

    def report(self, file: object, title: str, failure: object, units: Units, density: float | None,
               trim: object) -> FilePath:
        """Write the report of the run as an HTML file with a title, and return its path.

        failure: the `ConvergenceError` that ended the run, or None. density: g/cm3, or None. trim: see `part`.
        """


class SectionReader:
    """Reader of an axisymmetric or plane-strain section."""

    def __init__(self, path: Any):
        self._path, self._walls = path, Walls(path)
        self._axisymmetric = path.scene.kinematics.axisymmetric

    def wall(self, state: State) -> Wall:
        """Return the wall thickness along the section in a state."""
        return self._walls.evaluate(state)

    def part(self, state: State, density: float | None, trim: Any, heights: Any, units: Units) -> KeyNumbers:
        """Return the key numbers of the part in a state; see `Path.part`."""
        from .evaluate.part import part
        return part(self.wall(state), self._axisymmetric, density, trim, heights, units, self._path.scene.symmetry)

    def stress(self, state: State, depth: float | None) -> StressField:
        """Return the stress field of a solid in a state; InputError for a depth, or a membrane."""
        if depth is not None:
            raise InputError(f"Path.stress: depth = {depth!r}: is for a sheet in three dimensions: a point of a section"
                             f" has its depth in Z")
        return self._path.stress_field(state)

    def filling(self, contact: FaceContact) -> Filling:
        """Return the gaps in the corners of a tool (`Path.filling`); InputError for several meshes or no corner."""
        if len(self._path.record.segments) > 1:
            raise InputError("filling: is not available for a remeshed run as a whole: evaluate the states of one"
                             " mesh by path.wall(state) or path.contact(state=state)")
        from .evaluate.filling import filling
        return filling(self._path, contact)

    def view(self, file: Any, state: State, grid: float | None, camera: Any) -> None:
        """Draw the revolved or extruded section in a state as a PNG file; `grid` is not used."""
        from .show import views
        draw = views.revolved if self._axisymmetric else views.extruded
        draw(self._whole(state), file, self._path.problem.comm, camera)

    def solid(self, state: State) -> tuple:
        """Return points (n, 3), triangles (m, 3) and wall ratios (n,) of the whole part in a state."""
        from .files.solid import coloured
        return coloured(self._whole(state), self._axisymmetric)

    def _whole(self, state: State) -> Profile:
        """Return the profile of the whole part in a state, also if a half or a quarter is modelled."""
        return whole_part(self._path.profile(state), self._path.scene.symmetry)

    def report(self, file: Any, title: str, failure: Any, units: Units, density: float | None, trim: Any) -> FilePath:
        """Write the report of the run as an HTML file, and return its path; see `Path.report`."""
        from .show import report
        return report.write(report.of_path(self._path), file, title, failure, self._path.problem.comm, units, density,
                            trim)


def section_only(scene: Any, what: str, instead: str = "") -> None:
    """Raise an `InputError` for the method `what` of a sheet in three dimensions, with the advice `instead`."""
    if scene.kinematics.components == 3:
        raise InputError(f"{what}: is not available yet for a sheet in three dimensions"
                         + (f": {instead}" if instead else ""))
