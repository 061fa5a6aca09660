"""Results of a run of a sheet in three dimensions: wall, part, filling, pictures, files and reports."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...contact.face import FaceContact
from ...errors import InputError
from ...mesh.nodes import own_cells
from ...results.extend import method_of
from ...results.path import Path
from ...solve.state import State
from ...units import Units
from . import part as parts
from . import show
from .frames import frame_pictures
from .part import SheetFilling, SheetPart
from .stress import SheetStress, stress_of
from .wall import SheetWall, wall_of


class SheetReader:
    """Evaluation of a run of a sheet, which the methods of `Path` call, as a `formingx.results.reader.Reader`."""

    def __init__(self, path: Path):
        self._path = path

    def wall(self, state: State) -> SheetWall:
        """Return the wall thickness of each triangle in a state; collective."""
        return wall_of(self._path, state)

    def part(self, state: State, density: float | None, trim: Any, heights: Any, units: Units) -> SheetPart:
        """Return numbers of the whole formed part in a state (`part.part`); collective."""
        return parts.part(self.wall(state), density, trim, heights, units, self._path.scene.symmetry)

    def stress(self, state: State, depth: float | None) -> SheetStress:
        """Return the principal stresses of the triangles in a state, means or at a depth; collective."""
        return stress_of(self._path, state, depth)

    def fields(self, state: State, places: np.ndarray) -> dict[str, np.ndarray]:
        """Return fields at k places of the m owned triangles in a state, shape (m, k, components), by name; collective.

        They are principal stresses, means over the thickness, and temperatures of a sheet that conducts heat.
        """
        problem, found = self._path.problem, {}
        cells = own_cells(problem.forms.domain)
        if not any(material.integral for material in problem.scene.materials.values()):
            rows = problem.forms.domain.topology.original_cell_index[cells]
            principal = self.stress(state, None).principal[rows]
            found["principal_stresses"] = np.repeat(principal[:, None], len(places), axis=1)
        if hasattr(problem.temperature, "through"):
            with problem.state_context(state):
                T = problem.temperature.through(cells, places, np.array([0.0, 0.5, 1.0]))
            found |= {f"temperature_{name}": T[..., k:k + 1] for k, name in enumerate(("bottom", "middle", "top"))}
        return found

    def filling(self, contact: FaceContact) -> SheetFilling:
        """Return the filling of a tool by the sheet in all states; collective."""
        return parts.filling(self._path, contact)

    def pictures(self, frames: int) -> Callable[[], list[Any]]:
        """Return a function that draws the frames of an animation on rank 0; collective."""
        return frame_pictures(self._path, frames)

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
