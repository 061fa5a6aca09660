"""Nodal displacements: export for other solvers, and comparison with their results."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import mesh as meshes
from ...errors import InputError, known
from ...forms.probes import probe
from ...io import csv_files
from ...mesh import text as grid
from ...results import files
from ...results.show import plots

_REST = {2: ("R", "Z"), 3: ("X", "Y")}
"""Columns of reference coordinates, by the number of displacement components; a sheet with three is flat at first."""


@dataclass(frozen=True)
class NodalComparison:
    """Result of `compare_nodes`; its text is a report.

    Attributes:
        nodes: numbers of the n nodes, shape (n,).
        points: reference positions (R, Z), in three dimensions (X, Y), shape (n, 2), our unit of length.
        ours: displacements (u_r, u_z) of the run, shape (n, 2), in three dimensions (u_x, u_y, u_z), shape (n, 3),
            length.
        theirs: displacements of the other program, in the same shape and unit.
        largest: our largest displacement, the scale of the differences.
    """

    nodes: np.ndarray
    points: np.ndarray
    ours: np.ndarray
    theirs: np.ndarray
    largest: float

    @property
    def difference(self) -> np.ndarray:
        """Norm of the displacement difference at each node, shape (n,)."""
        return np.linalg.norm(self.theirs - self.ours, axis=1)

    @property
    def maximum(self) -> float:
        """The largest difference."""
        return float(self.difference.max())

    @property
    def rms(self) -> float:
        """Root mean square of the difference over the nodes."""
        return float(np.sqrt(np.mean(self.difference**2)))

    def __str__(self) -> str:
        k = int(np.argmax(self.difference))
        at, ours, theirs = (", ".join(f"{v:.{digits}g}" for v in row[k]) for row, digits in (
            (self.points, 6), (self.ours, 8), (self.theirs, 8)))
        size, rest = self.largest or 1.0, ", ".join(_REST[self.ours.shape[1]])
        return (f"{len(self.nodes)} nodes; our largest displacement is {self.largest:.6g}\n"
                f"largest difference {self.maximum:.5g} ({100 * self.maximum / size:.2g} %), at node {self.nodes[k]},"
                f" ({rest}) = ({at}): ours ({ours}), theirs ({theirs})\n"
                f"root mean square {self.rms:.5g} ({100 * self.rms / size:.2g} %)")

    __repr__ = __str__

    def plot(self) -> Any:
        """Draw the deformed nodes of both sides, z over r (in three dimensions over x).

        Returns:
            The matplotlib figure.
        """
        figure, axes = plots.figure()
        rest = np.pad(self.points, ((0, 0), (0, self.ours.shape[1] - 2)))               # flat in three dimensions
        for u, style, label in ((self.ours, {"marker": "o", "fillstyle": "none"}, "ours"),
                                (self.theirs, {"marker": "x", "color": "k"}, "theirs")):
            axes.plot(*(rest + u)[:, [0, -1]].T, linestyle="none", markersize=5, label=label, **style)
        axes.set(xlabel="r" if self.ours.shape[1] == 2 else "x", ylabel="z",
                 title=f"largest difference {self.maximum:.3g}")
        axes.set_aspect("equal")
        axes.legend(frameon=False)
        return figure


def write_nodes(path: Any, file: Any, *, state: Any = None, mesh: str | os.PathLike | None = None) -> None:
    """Write node, R, Z, u_r, u_z of every node of a state as CSV, in the user's unit of length (rank 0 writes).

    For a sheet in three dimensions the columns are node, X, Y, u_x, u_y, u_z.

    Args:
        path: the computed `Path`.
        file: path of the CSV file.
        state: a state of the path; default: the last.
        mesh: a text mesh file (`formingx.mesh.Grid`) that gives the nodes and their numbers. Default: the run's own
            mesh, numbered as by `mesh.write` (one rank only).

    Raises:
        InputError: the mesh file cannot be read, or one of its nodes lies outside the run's mesh.

    >>> fx.write_nodes(path, "nodes.csv")
    >>> open("nodes.csv").readline().strip()
    'node,R,Z,u_r,u_z'
    """
    plain = meshes.to_grid(path.problem.scene.mesh) if mesh is None else grid.read(mesh)
    u = _displacements(path, state, plain.points)
    rows = [[int(n), *X, *v] for n, X, v in zip(plain.numbers, plain.points.tolist(), u.tolist())]
    files.write_rows(file, ["node", *_columns(path)], rows, path.problem.comm)


def compare_nodes(path: Any, theirs: Any, *, state: Any = None, mesh: str | os.PathLike | None = None,
                  columns: Mapping[str, str] | None = None,
                  units: Mapping[str, float | str] | None = None) -> NodalComparison:
    """Compare a state with another program's nodal displacements, at its nodes; the meshes may differ.

    Args:
        path: the computed `Path`.
        theirs: a CSV file or {column: values} with u_r, u_z and either R, Z or, with `mesh`, node. For a sheet in three
            dimensions u_x, u_y, u_z and X, Y.
        state: a state of the path; default: the last. To compare at a pressure: `path.at(formingx.pressure(...))`.
        mesh: a text mesh file (`formingx.mesh.Grid`) with the coordinates of the numbered nodes, in our unit.
        columns: {our name: their name} for columns with other names.
        units: as for `compare`, by our column names: R, Z, u_r, u_z.

    Returns:
        The `NodalComparison`.

    Raises:
        InputError: a file that cannot be read, an unknown column, unit or node, or a node outside our mesh.

    >>> fx.write_nodes(path, "nodes.csv")                                   # or what another program wrote
    >>> found = fx.compare_nodes(path, "nodes.csv")
    >>> len(found.nodes), float(abs(found.ours - found.theirs).max()) < 1e-12
    (51, True)
    """
    table = (csv_files.from_arrays("compare_nodes: theirs", theirs) if isinstance(theirs, Mapping)
             else csv_files.read(theirs))
    names, units = dict(columns or {}), dict(units or {})
    for name in (*names, *units):
        known("compare_nodes: column", name, ("node", *_columns(path)))

    def take(name: str) -> np.ndarray:
        return table.take(names.get(name, name), units.get(name))
    def take_nodes() -> np.ndarray:
        numbers = take("node")
        if np.any(numbers != np.round(numbers)):
            raise InputError(f"{table.name}: column {names.get('node', 'node')!r}: node numbers must be whole numbers")
        return numbers.astype(int)
    if mesh is None:
        points = np.column_stack([take(name) for name in _columns(path)[:2]])
        numbered = names.get("node", "node") in table.columns
        nodes = take_nodes() if numbered else np.arange(1, len(points) + 1)
    else:
        plain = grid.read(mesh)
        nodes = take_nodes()
        at = {int(n): k for k, n in enumerate(plain.numbers)}
        for node in nodes.tolist():
            if node not in at:
                raise InputError(f"{table.name}: node {node} is not in the mesh file {os.fspath(mesh)!r}")
        points = plain.points[[at[int(n)] for n in nodes]]
    ours = _displacements(path, state, points)
    return NodalComparison(nodes, points, ours, np.column_stack([take(c) for c in _columns(path)[2:]]),
                           float(np.linalg.norm(ours, axis=1).max()))


def _columns(path: Any) -> list[str]:
    """Return the columns of files of nodal displacements: reference coordinates, then components."""
    axes = path.problem.scene.kinematics.axes
    return [*_REST[len(axes)], *(f"u_{axis}" for axis in axes)]


def _displacements(path: Any, state: Any, points: np.ndarray) -> np.ndarray:
    """Return the displacements at reference points in a state (default: the last), shape (n, components)."""
    problem, state = path.problem, state or path.last
    with problem.state_context(state):
        return probe(problem, points).displacement(problem.x)
