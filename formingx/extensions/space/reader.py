"""Results of a sheet in three dimensions: its wall, the part, pictures, files and reports."""

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
from .part import FillingInSpace, PartInSpace
from .wall import WallInSpace, wall_of


class SheetReader:
    """Reader of a sheet in three dimensions (`formingx.results.reader.Reader`).

    Args:
        path: the path.
    """

    def __init__(self, path: Path):
        self._path = path

    def wall(self, state: State) -> WallInSpace:
        """Return the wall of a state, triangle by triangle."""
        return wall_of(self._path, state)

    def part(self, state: State, density: float | None, trim: Any, heights: Any, units: Units) -> PartInSpace:
        """Return the whole part of a state in numbers."""
        return parts.part(self.wall(state), density, trim, heights, units, self._path.scene.symmetry)

    def filling(self, contact: FaceContact) -> FillingInSpace:
        """Return the gaps between the sheet and a tool."""
        return parts.filling(self._path, contact)

    def view(self, file: Any, state: State, grid: float | None) -> None:
        """Draw the whole part, with the squares that were printed on the flat sheet."""
        show.view(self._path, state, file, grid)

    def solid(self, state: State) -> tuple:
        """Return points, triangles and wall ratios of the whole part."""
        return show.solid(self._path, state)

    def report(self, file: Any, title: str, failure: Any, units: Units, density: float | None, trim: Any) -> FilePath:
        """Write the report of the run."""
        return show.report(self._path, file, title, failure, units, density, trim)


@method_of(Path)
def shell_model(path: Path, file: Any, state: State | None = None) -> None:
    """Write a part in three dimensions as shells, each with its wall, for a structural code (.inp; rank 0 writes).

    Args:
        path: the path of a sheet in three dimensions.
        file: its name ends in .inp.
        state: default the last.

    Raises:
        InputError: the body is a section.
    """
    if path.scene.kinematics.components != 3:
        raise InputError("shell_model: is for a sheet in space; of a section use to_stl, or deformed_mesh()")
    show.shell_model(path, file, state)
