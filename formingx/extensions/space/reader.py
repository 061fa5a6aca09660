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
        path: the computed `Path`.
    """

    def __init__(self, path: Path):
        self._path = path

    def wall(self, state: State) -> WallInSpace:
        """Return the wall of a state for each triangle.

        Args:
            state: a `State` of the path.

        Returns:
            The wall.
        """
        return wall_of(self._path, state)

    def part(self, state: State, density: float | None, trim: Any, heights: Any, units: Units) -> PartInSpace:
        """Return the whole part of a state as numbers.

        Args:
            state: a `State` of the path.
            density: density in g/cm3, or None.
            trim: see `Path.part`.
            heights: see `Path.part`.
            units: units of the labels.

        Returns:
            The part.
        """
        return parts.part(self.wall(state), density, trim, heights, units, self._path.scene.symmetry)

    def filling(self, contact: FaceContact) -> FillingInSpace:
        """Return the gaps between the sheet and a tool.

        Args:
            contact: the `FaceContact`.

        Returns:
            The filling.
        """
        return parts.filling(self._path, contact)

    def view(self, file: Any, state: State, grid: float | None) -> None:
        """Draw the whole part, with the squares of a grid printed on the flat sheet.

        Args:
            file: path of the PNG file.
            state: a `State` of the path.
            grid: size of the squares, length, or None.
        """
        show.view(self._path, state, file, grid)

    def solid(self, state: State) -> tuple:
        """Return the surface of the whole part with its wall.

        Args:
            state: a `State` of the path.

        Returns:
            Points, triangles and wall ratios, see `show.solid`.
        """
        return show.solid(self._path, state)

    def report(self, file: Any, title: str, failure: Any, units: Units, density: float | None, trim: Any) -> FilePath:
        """Write the report of the run.

        Args:
            file: path of the file.
            title: heading of the page.
            failure: failure of the run, or None.
            units: units of the labels.
            density: density in g/cm3, or None.
            trim: see `Path.part`.

        Returns:
            Path of the file.
        """
        return show.report(self._path, file, title, failure, units, density, trim)


@method_of(Path)
def shell_model(path: Path, file: Any, state: State | None = None) -> None:
    """Write a part in three dimensions as shells with their wall, for a structural code (.inp; rank 0 writes).

    Args:
        path: the path of a sheet in three dimensions.
        file: path of the file, ending in .inp.
        state: the state; default the last.

    Raises:
        InputError: the body is a section.
    """
    if path.scene.kinematics.components != 3:
        raise InputError("shell_model: is for a sheet in space; of a section use to_stl, or deformed_mesh()")
    show.shell_model(path, file, state)
