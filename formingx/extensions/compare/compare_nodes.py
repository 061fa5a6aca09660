"""Nodal displacements: export for other solvers, and comparison with their results."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import figures
from ... import mesh as meshes
from ...errors import InputError, check_name
from ...findings import coordinates, percent
from ...forms.probes import probe
from ...io import csv_files
from ...mesh import text as grid
from ...results import files

_COORDINATES_OF = {2: ("R", "Z"), 3: ("X", "Y", "Z")}
"""{number of displacement components: columns of the reference coordinates}; a sheet in three dimensions is flat."""


@dataclass(frozen=True)
class NodalComparison:
    """Result of `compare_nodes`; its text is a report.

    "Ours" are the displacements of the run, "theirs" the displacements of the other program.

    Attributes:
        nodes: numbers of the n nodes, shape (n,).
        points: reference positions (R, Z), in three dimensions (X, Y), shape (n, 2), our unit of length.
        ours: displacements (u_r, u_z) of the run, shape (n, 2), in three dimensions (u_x, u_y, u_z), shape (n, 3),
            length.
        theirs: displacements of the other program, of the same shape and unit.
        largest: largest norm of our displacements at these nodes, the scale of the differences, length.
    """

    nodes: np.ndarray
    points: np.ndarray
    ours: np.ndarray
    theirs: np.ndarray
    largest: float

    @property
    def difference(self) -> np.ndarray:
        """Norm of the difference between both programs' displacements at each node, shape (n,), length."""
        return np.linalg.norm(self.theirs - self.ours, axis=1)

    @property
    def maximum(self) -> float:
        """Largest norm of the difference between both programs' displacements at a node, length."""
        return float(self.difference.max())

    @property
    def rms(self) -> float:
        """Root mean square over the nodes of the difference between both programs' displacements, length."""
        return float(np.sqrt(np.mean(self.difference**2)))

    def __str__(self) -> str:
        k = int(np.argmax(self.difference))
        position, ours, theirs = (coordinates(row[k], digits) for row, digits in (
            (self.points, 6), (self.ours, 8), (self.theirs, 8)))
        size, reference = self.largest or 1.0, ", ".join(_COORDINATES_OF[self.ours.shape[1]][:self.points.shape[1]])
        return (f"{len(self.nodes)} nodes; our largest displacement is {self.largest:.6g}\n"
                f"largest difference {self.maximum:.5g} ({percent(self.maximum / size)}), at node {self.nodes[k]},"
                f" ({reference}) = {position}: ours {ours}, theirs {theirs}\n"
                f"root mean square {self.rms:.5g} ({percent(self.rms / size)})")

    __repr__ = __str__

    def plot(self) -> Any:
        """Draw the deformed nodes of both programs, and the distance between them in colours.

        The nodes are drawn as z over r, in three dimensions as z over x.

        Returns:
            The matplotlib figure.
        """
        figure, (both, apart) = figures.figure(2)
        reference = np.pad(self.points, ((0, 0), (0, self.ours.shape[1] - self.points.shape[1])))     # a flat sheet
        for u, style, label in ((self.ours, {"marker": "o", "fillstyle": "none"}, "ours"),
                                (self.theirs, {"marker": "x", "color": "k"}, "theirs")):
            both.plot(*(reference + u)[:, [0, -1]].T, linestyle="none", markersize=5, label=label, **style)
        drawn = apart.scatter(*(reference + self.ours)[:, [0, -1]].T, c=self.difference, s=14, cmap="viridis")
        k = int(np.argmax(self.difference))
        apart.plot(*(reference + self.ours)[k, [0, -1]], "o", color="C3", markersize=10, fillstyle="none")
        figure.colorbar(drawn, ax=apart, label="distance, ours to theirs")
        for axes in (both, apart):
            axes.set(xlabel="r" if self.ours.shape[1] == 2 else "x", ylabel="z", aspect="equal")
        apart.set(title=f"largest difference {self.maximum:.3g}")
        both.legend(frameon=False)
        return figure


def write_nodes(path: Any, file: Any, *, state: Any = None, mesh: str | os.PathLike | None = None) -> None:
    """Write a CSV file with the reference position and displacement of every node in a state (rank 0 writes).

    The columns are node, R, Z, u_r, u_z, in the user's unit of length. For a sheet in three dimensions they are node,
    X, Y, u_x, u_y, u_z.

    Args:
        path: the computed `Path`.
        file: path of the CSV file.
        state: a state of the path; default: the last.
        mesh: a text mesh file (`formingx.mesh.Grid`) that gives the nodes and their numbers. Default: the mesh of the
            run, numbered as by `mesh.write` (one rank only).

    Raises:
        InputError: the mesh file cannot be read, or one of its nodes lies outside the mesh of the run.

    >>> fx.write_nodes(path, "nodes.csv")
    >>> open("nodes.csv").readline().strip()
    'node,R,Z,u_r,u_z'
    """
    mesh_grid = meshes.to_grid(path.problem.scene.mesh) if mesh is None else grid.read(mesh)
    points = mesh_grid.points[:, :len(_coordinates(path))]
    u = _displacements(path, state, points)
    rows = [[int(n), *row] for n, row in zip(mesh_grid.numbers, np.hstack([points, u]).tolist())]
    files.write_rows(file, ["node", *_columns(path)], rows, path.problem.comm)


def compare_nodes(path: Any, theirs: Any, *, state: Any = None, mesh: str | os.PathLike | None = None,
                  columns: Mapping[str, str] | None = None,
                  units: Mapping[str, float | str] | None = None) -> NodalComparison:
    """Compare the displacements in a state ("ours") with nodal displacements of another program ("theirs").

    The comparison is at the nodes of the other program; its mesh may differ from the mesh of the run.

    Args:
        path: the computed `Path`.
        theirs: a CSV file or {column: values} with the displacements u_r, u_z, and the reference positions R, Z or,
            with `mesh`, the numbers node. In three dimensions u_x, u_y, u_z and X, Y, and Z unless
            the sheet is flat.
        state: a state of the path; default the last. To compare at a pressure: `path.state_at(formingx.pressure(...))`.
        mesh: a text mesh file (`formingx.mesh.Grid`) with the reference positions of the numbered nodes, in our unit.
        columns: {our name: their name} for columns with other names.
        units: {our name: factor} from their units to ours, or {our name: our unit} if their header states their unit.

    Returns:
        Displacements of both sides at the nodes, and their differences.

    Raises:
        InputError: a file that cannot be read, an unknown column, unit or node, or a node outside the mesh of the run.

    >>> fx.write_nodes(path, "nodes.csv")                                   # or what another program wrote
    >>> found = fx.compare_nodes(path, "nodes.csv")
    >>> len(found.nodes), float(abs(found.ours - found.theirs).max()) < 1e-12
    (51, True)
    """
    table = (csv_files.from_arrays("compare_nodes: theirs", theirs) if isinstance(theirs, Mapping)
             else csv_files.read(theirs))
    names, units = dict(columns or {}), dict(units or {})
    for name in (*names, *units):
        check_name("compare_nodes: column", name, ("node", *_columns(path)))

    def column(name: str) -> np.ndarray:
        """Return the other program's values of a column, in the unit of the run, by our name of the column."""
        return table.take(names.get(name, name), units.get(name))

    def node_numbers() -> np.ndarray:
        """Return the other program's node numbers; raise an InputError unless they are whole."""
        numbers = column("node")
        if np.any(numbers != np.round(numbers)):
            raise InputError(f"{table.name}: column {names.get('node', 'node')!r}: node numbers must be whole numbers")
        return numbers.astype(int)
    if mesh is None:
        points = np.column_stack([column(name) for name in _coordinates(path)])
        numbered = names.get("node", "node") in table.columns
        nodes = node_numbers() if numbered else np.arange(1, len(points) + 1)
    else:
        mesh_grid = grid.read(mesh)
        nodes = node_numbers()
        rows = {int(n): k for k, n in enumerate(mesh_grid.numbers)}
        for node in nodes.tolist():
            if node not in rows:
                raise InputError(f"{table.name}: node {node} is not in the mesh file {os.fspath(mesh)!r}")
        points = mesh_grid.points[[rows[int(n)] for n in nodes]]
    ours = _displacements(path, state, points)
    displacements = _columns(path)[len(_coordinates(path)):]
    return NodalComparison(nodes, points, ours, np.column_stack([column(c) for c in displacements]),
                           float(np.linalg.norm(ours, axis=1).max()))


def _columns(path: Any) -> list[str]:
    """Return the names of columns with reference positions and displacements, such as R, Z, u_r, u_z."""
    return [*_coordinates(path), *(f"u_{axis}" for axis in path.problem.scene.kinematics.axes)]


def _coordinates(path: Any) -> tuple[str, ...]:
    """Return the names of columns with reference positions: R, Z; X, Y of a flat sheet, X, Y, Z of another surface."""
    scene = path.problem.scene
    names = _COORDINATES_OF[scene.kinematics.components]
    return names[:2] if len(names) == 3 and scene.mesh.flat else names


def _displacements(path: Any, state: Any, points: np.ndarray) -> np.ndarray:
    """Return the displacements in a state (None: the last) at reference points (n, 2), shape (n, 2) or (n, 3)."""
    problem, state = path.problem, state or path.last
    with problem.state_context(state):
        return probe(problem, points).displacement(problem.x)
