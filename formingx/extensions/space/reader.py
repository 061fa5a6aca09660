"""Results of a run of a sheet in three dimensions: wall, part, filling, pictures, files and reports."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

from ...contact.face import FaceContact
from ...errors import InputError
from ...results.extend import method_of
from ...results.path import Path
from ...solve.state import State
from ...units import Units
from . import part as parts
from . import show
from .part import SheetFilling, SheetPart
from .wall import SheetWall, wall_of


class SheetReader:
    """Evaluation of a run of a sheet in three dimensions, which the methods of `Path` call.

    It implements the interface `formingx.results.reader.Reader`.

    Args:
        path: the computed `Path`.
    """

    def __init__(self, path: Path):
        self._path = path

    def wall(self, state: State) -> SheetWall:
        """Return the wall thickness of each triangle in a state; collective."""
        return wall_of(self._path, state)

    def part(self, state: State, density: float | None, trim: Any, heights: Any, units: Units) -> SheetPart:
        """Return numbers of the whole formed part in a state (`part.part`); collective."""
        return parts.part(self.wall(state), density, trim, heights, units, self._path.scene.symmetry)

    def filling(self, contact: FaceContact) -> SheetFilling:
        """Return the filling of a tool by the sheet in all states; collective."""
        return parts.filling(self._path, contact)

    def view(self, file: Any, state: State, grid: float | None, camera: Any) -> None:
        """Draw the whole part in a state as PNG, coloured by its wall thickness (rank 0 draws)."""
        show.view(self._path, state, file, grid, camera)

    def solid(self, state: State) -> tuple:
        """Return points, triangles and wall ratios of the part as a closed surface (`show.solid`)."""
        return show.solid(self._path, state)

    def report(self, file: Any, title: str, failure: Any, units: Units, density: float | None, trim: Any) -> FilePath:
        """Write the report of the run as an HTML page, and return its path (rank 0 writes)."""
        return show.report(self._path, file, title, failure, units, density, trim)


@method_of(Path)
def shell_model(path: Path, file: Any, state: State | None = None) -> None:
    """Write a formed part in three dimensions as shell elements with their wall thickness, for a structural code.

    The file is an input file for Abaqus or CalculiX (rank 0 writes). It contains the modelled part. Each triangle is an
    S3 element whose section thickness is its deformed wall thickness. The user adds the material POLYMER, and
    constrains a half or a quarter at its planes of symmetry.

    Args:
        path: the computed `Path` of a sheet in three dimensions.
        file: path of the file, ending in .inp.
        state: a state of the path; default the last.

    Raises:
        InputError: the body is a section.
    """
    if path.scene.kinematics.components != 3:
        raise InputError("shell_model: is for a sheet in three dimensions; of a section use to_stl, or deformed_mesh()")
    show.shell_model(path, file, state)
