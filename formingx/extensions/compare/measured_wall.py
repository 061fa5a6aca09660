"""Comparison of the measured wall thickness of a formed part with a run."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...errors import InputError, file_path, finite_array
from ...io.csv_files import read
from ...results import files
from ...results.path import Path

_MAX_OVERHANG = 0.1
"""Distance of a measured point beyond the end of the computed part, over its length, up to which it is accepted."""
_WALL = ("wall", "thickness", "wall_thickness")
_LENGTH = ("length", "arc_length")
_REFERENCE = ("reference_length", "R")


@dataclass(frozen=True, eq=False)
class MeasuredWall:
    """Measured wall thickness at m points of a formed part.

    The positions of the points are given in one of three ways.

    Args:
        wall: measured thickness, shape (m,), length.
        length: arc lengths along the middle line of the formed part, from the axis, shape (m,), length.
        points: positions (r, z) on the section of the formed part, shape (m, 2), length; or positions (x, y, z) on a
            part in three dimensions, such as a bottle, shape (m, 3). A point of a mirror image counts as its image in
            the modelled part.
        reference_length: arc lengths along the middle line of the undeformed body, from the axis, shape (m,), length;
            for example of a grid that was printed on the flat sheet.

    Raises:
        InputError: not exactly one kind of position, a wall that is not positive, or shapes that do not agree.

    >>> part = fx.MeasuredWall(wall=[0.06, 0.1, 0.2], length=[0.0, 5.0, 14.0])
    >>> round(part.compare(path).mean_percent, 1)
    -22.1
    """

    wall: Any
    length: Any = None
    points: Any = None
    reference_length: Any = None

    def __post_init__(self) -> None:
        wall = finite_array("MeasuredWall: wall", self.wall)
        given = {name: getattr(self, name) for name in ("length", "points", "reference_length")}
        given = {name: value for name, value in given.items() if value is not None}
        if len(given) != 1:
            raise InputError(f"MeasuredWall: {', '.join(given) or 'no places'} given: must be one of length, points and"
                             f" reference_length")
        name, value = next(iter(given.items()))
        positions = finite_array(f"MeasuredWall: {name}", value)
        shapes = [(*wall.shape, n) for n in (2, 3)] if name == "points" else [wall.shape]
        if wall.ndim != 1 or not len(wall) or positions.shape not in shapes:
            raise InputError(f"MeasuredWall: wall has the shape {wall.shape}, {name} {positions.shape}: must be (m,)"
                             f" and {'(m, 2) or (m, 3)' if name == 'points' else '(m,)'}")
        for k in np.flatnonzero(wall <= 0)[:1]:
            raise InputError(f"MeasuredWall: wall[{k}] = {wall[k]:g}: must be above 0")
        object.__setattr__(self, "wall", wall)
        object.__setattr__(self, name, positions)

    @classmethod
    def from_csv(cls, file: Any) -> MeasuredWall:
        """Read a measured wall from a CSV file.

        The file has a column `wall` (or `thickness`), and one of `length`, `reference_length`, both `r` and `z`, or
        `x`, `y` and `z`.
        Numbers are in the unit of length of the run. Units in the header ("wall [mm]") must be the same in all columns.

        Args:
            file: path of the CSV file.

        Returns:
            The measured wall.

        Raises:
            InputError: the file cannot be read, lacks a column, or has columns in different units.
        """
        table = read(file_path("MeasuredWall: file", file))
        units = {unit for unit in table.units.values() if unit is not None}
        if len(units) > 1:
            raise InputError(f"MeasuredWall: {table.name}: columns are in {', '.join(sorted(units))}: must be in one"
                             f" unit, that of the run")

        def column(names: tuple[str, ...]) -> np.ndarray | None:
            """Return the values of the first column that has one of these names, or None."""
            found = [name for name in table.columns if name.replace(" ", "_") in names]
            return table._replace(units=dict.fromkeys(table.units)).take(found[0]) if found else None
        wall, places = column(_WALL), {name: column((name,)) for name in "rxyz"}
        if wall is None:
            raise InputError(f"MeasuredWall: {table.name}: has the columns {', '.join(table.columns)}: needs 'wall'")
        given = {name: values for name, values in places.items() if values is not None}
        axes = next((axes for axes in ("xyz", "rz") if {*axes} <= {*given}), "")
        return cls(wall, length=column(_LENGTH), reference_length=column(_REFERENCE),
                   points=np.column_stack([given[name] for name in axes]) if axes else None)

    def of_path(self, path: Path) -> np.ndarray:
        """Return the computed wall thickness in the last state of a path at the measured points.

        Args:
            path: the computed `Path`.

        Returns:
            Thickness at the m points, shape (m,), length.

        Raises:
            InputError: a measured `length` or `reference_length` lies outside the computed part by more than a tenth of
                its length.
        """
        if self._in_space(path):
            return np.asarray(self._on_surface(path)["wall"])
        profile = path.profile()
        return np.interp(self._locate(profile)[0], np.arange(len(profile.middle)), profile.wall_thickness)

    def compare(self, path: Path) -> WallComparison:
        """Compare the wall thickness in the last state of a path with the measured one; collective.

        Args:
            path: the computed `Path`.

        Returns:
            Computed and measured walls at the m points.

        Raises:
            InputError: a measured `length` or `reference_length` lies outside the computed part by more than a tenth of
                its length; or points that are not in the coordinates of the part.
        """
        if self._in_space(path):
            found = self._on_surface(path)
            lines = (np.asarray(self.points), np.column_stack([found[name] for name in "XYZ"]))
            now, before = (np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))) for line in lines)
            return WallComparison(now, before, self.wall, found["wall"], found["distance"], path.problem.comm,
                                  "the first point")
        profile = path.profile()
        numbers_of_points, distance = self._locate(profile)
        numbers = np.arange(len(profile.middle))

        def interpolated(values: np.ndarray) -> np.ndarray:
            """Return values at the points of the middle line, interpolated to the m measured points, shape (m,)."""
            return np.interp(numbers_of_points, numbers, values)
        return WallComparison(interpolated(profile.arc_length), interpolated(profile.reference_length), self.wall,
                              interpolated(profile.wall_thickness), distance, path.problem.comm)

    def _in_space(self, path: Path) -> bool:
        """Return True for points on a part in three dimensions; raise `InputError` if points and part do not agree."""
        space, given = path.scene.kinematics.components == 3, self.points is not None and self.points.shape[1] == 3
        if space != given:
            raise InputError(f"MeasuredWall: the part is {'in three dimensions' if space else 'a section'}: give"
                             f" {'points (x, y, z)' if space else 'length, points (r, z) or reference_length'}")
        return space

    def _on_surface(self, path: Path) -> dict[str, np.ndarray]:
        """Return wall and reference position at the measured points of a part in three dimensions; collective."""
        points = np.array(self.points)
        for plane in path.scene.symmetry.planes:
            off = np.abs(points[:, plane.axis] - plane.position)
            points[:, plane.axis] = plane.position + (off if plane.above else -off)
        return path.wall().at(points)

    def _locate(self, profile: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return positions of measured points on the middle line, (m,), and distances from it, (m,), length.

        Positions count the points of the polyline (2.5: between points 2 and 3). For arc lengths the distance is that
        beyond an end; more than a tenth of the length is an InputError.
        """
        numbers = np.arange(len(profile.middle), dtype=float)
        if self.points is None:
            name = "length" if self.length is not None else "reference_length"
            line = profile.arc_length if self.length is not None else profile.reference_length
            positions = getattr(self, name)
            beyond = np.maximum(np.maximum(-positions, positions - line[-1]), 0.0)
            for k in np.flatnonzero(beyond > _MAX_OVERHANG * line[-1])[:1]:
                raise InputError(f"MeasuredWall: {name}[{k}] = {positions[k]:.6g}: the computed part goes from 0 to"
                                 f" {line[-1]:.6g}")
            return np.interp(positions, line, numbers), beyond
        a, b = profile.middle[:-1], profile.middle[1:]
        along = np.einsum("mij,ij->mi", self.points[:, None] - a, b - a) / np.einsum("ij,ij->i", b - a, b - a)
        along = np.clip(along, 0, 1)
        distance = np.hypot(*np.moveaxis(self.points[:, None] - a - along[..., None] * (b - a), -1, 0))
        nearest = distance.argmin(1)
        each = np.arange(len(nearest))
        return nearest + along[each, nearest], distance[each, nearest]


class WallComparison:
    """Measured wall thickness of a formed part and the computed one at the same m points; its text is a table.

    The arguments but `comm` are attributes.

    Args:
        length: arc lengths of the points along the computed middle line, from the axis, shape (m,), length. In three
            dimensions along the measured points, from the first one.
        reference_length: arc lengths of the points along the undeformed middle line, shape (m,), length.
        measured: measured thicknesses, shape (m,), length.
        computed: computed thicknesses, shape (m,), length.
        distance: distances of points measured by (r, z) from the computed middle line, shape (m,), length. For points
            measured by arc lengths: the arc length by which they lie beyond an end of the line, 0 between the ends.
        comm: MPI communicator of the run.
        origin: place from which arc lengths are counted, for labels.
    """

    def __init__(self, length: np.ndarray, reference_length: np.ndarray, measured: np.ndarray, computed: np.ndarray,
                 distance: np.ndarray, comm: Any, origin: str = "the axis"):
        self.origin = origin
        self.length, self.reference_length, self.distance = length, reference_length, distance
        self.measured, self.computed, self._comm = measured, computed, comm

    @property
    def deviation_percent(self) -> np.ndarray:
        """Relative deviation of the computed from the measured thickness at each point, shape (m,), %."""
        return 100 * (self.computed / self.measured - 1)

    @property
    def mean_percent(self) -> float:
        """Mean deviation of the computed from the measured thickness over the points, %."""
        return float(self.deviation_percent.mean())

    @property
    def rms_percent(self) -> float:
        """Root mean square of the deviation of the computed from the measured thickness over the points, %."""
        return float(np.sqrt(np.mean(self.deviation_percent**2)))

    def __str__(self) -> str:
        surface = "section" if self.origin == "the axis" else "surface"
        lines = [f"{'length':>10}{'measured':>12}{'computed':>12}{'deviation':>12}"]
        lines += [f"{s:10.4g}{m:12.4g}{c:12.4g}{d:+11.1f} %" + (f"   {a:.3g} off the computed {surface}" * bool(
            a > c)) for s, m, c, d, a in zip(
                self.length, self.measured, self.computed, self.deviation_percent, self.distance)]
        worst = int(np.abs(self.deviation_percent).argmax())
        return "\n".join([*lines, f"mean {self.mean_percent:+.1f} %, root mean square {self.rms_percent:.1f} %, largest"
                                  f" {self.deviation_percent[worst]:+.1f} % at length {self.length[worst]:.4g}"])

    __repr__ = __str__

    def plot(self, axes: Any = None) -> Any:
        """Draw measured and computed walls, and their deviation in %, over the arc length of the part.

        Args:
            axes: a pair of matplotlib axes; default a new figure.

        Returns:
            The two matplotlib axes.
        """
        if axes is None:
            from ...figures import figure
            axes = figure(2, width=5)[1]
        wall, deviation = axes
        order = np.argsort(self.length)
        wall.plot(self.length[order], self.computed[order], "-", label="computed")
        wall.plot(self.length, self.measured, "ko", ms=4, label="measured")
        wall.set(xlabel=f"length from {self.origin}", ylabel="wall", ylim=(0, None))
        wall.legend()
        deviation.axhline(0, color="0.6", linewidth=1)
        deviation.plot(self.length[order], self.deviation_percent[order], "o-", ms=4)
        deviation.set(xlabel=f"length from {self.origin}", ylabel="deviation, %")
        return axes

    def to_csv(self, file: Any) -> FilePath:
        """Write a CSV file with a row for each measured point (rank 0 writes).

        The columns length and reference_length are arc lengths of the points from the axis, along the deformed and the
        undeformed middle line. The columns measured and computed are thicknesses. The column deviation_percent is
        computed minus measured, in percent of the measured thickness. The column distance is the distance of a point
        measured by (r, z) from the computed middle line. For a point measured by its arc length, it is the arc length
        by which the point lies beyond an end of the line.

        Args:
            file: path of the CSV file.

        Returns:
            Path of the file.
        """
        columns: Mapping[str, np.ndarray] = {
            "length": self.length, "reference_length": self.reference_length, "measured": self.measured,
            "computed": self.computed, "deviation_percent": self.deviation_percent, "distance": self.distance}

        def write(stream: Any) -> None:
            """Write the header and the rows to an open text file."""
            out = csv.writer(stream)
            out.writerow(columns)
            out.writerows(zip(*(values.tolist() for values in columns.values())))
        path = file_path("to_csv: file", file)
        files.on_root(self._comm, lambda: files.replace(path, write))
        return path
