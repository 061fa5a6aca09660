"""Temperature at points of a body from a number, a function, a table, a file, or an earlier run."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from ..errors import InputError, finite, values
from ..findings import coordinates
from ..io import csv_files
from ..mesh import Mesh
from ..mesh.locate import locate
from ..mesh.nodes import arguments, axes
from ..ranks import gathered, original
from ..values.table import Table

_WHAT = ("a number, a table({{{0}: value}}), a function of ({0}, {1}), a CSV file, what fx.heat returned, or a DOLFINx"
         " Function")


def values_at(field: Any, points: np.ndarray, mesh: Mesh, name: str = "temperature") -> np.ndarray:
    """Return the given temperature at reference points (n, 2 or 3), shape (n,); collective."""
    comm: Any = mesh.comm
    first = comm.scan(len(points)) - len(points)
    # all ranks look at all points, so that they raise the same errors
    return _values(field, gathered(mesh.comm, points), name, axes(mesh.domain))[first: first + len(points)]


def _values(field: Any, points: np.ndarray, name: str, axes: str) -> np.ndarray:
    """Return the values of a temperature at n points, shape (n,), equal on all ranks; collective.

    `field` is as in `Scene`; the points are the same on all ranks, shape (n, 2), length; axes are "RZ" or "xyz".
    """
    if isinstance(field, type | Mapping | Sequence) and not isinstance(field, str):
        raise InputError(f"{name} = {field!r}: must be {_WHAT.format(*axes)}")
    if isinstance(field, Table):
        field.check(points[:, 0], axes[0])
        found = field(points[:, 0])
    elif isinstance(field, str | os.PathLike):
        found = _from_file(field, points, axes)
    elif isinstance(field, fem.Function):
        found = PointReader(field.function_space, points).read(field.x.array)
    elif hasattr(field, "temperature"):
        return _values(field.temperature(), points, name, axes)
    elif callable(field):
        return values(name, field, arguments(field, dict(zip(axes, points.T))))
    else:
        found = np.full(len(points), finite(name, field))
    if not np.all(np.isfinite(found)):
        raise InputError(f"{name} = {field!r}: is not a finite number at"
                         f" {_first_false(points, np.isfinite(found), axes)}")
    return found


class PointReader:
    """Evaluation of scalar finite element functions at fixed points of a mesh.

    The reference points have shape (n, 2), length, equal on all ranks. A point outside the mesh is an InputError.
    """

    def __init__(self, space: Any, points: np.ndarray):
        domain, element = space.mesh, space.element.basix_element
        X = domain.geometry.x
        self._comm, self._n = original(domain.comm), len(points)
        size = float(self._comm.allreduce(np.abs(X).max(initial=0.0), MPI.MAX))
        self._mine, cells, reference = locate(domain, points, size)
        self._dofs = space.dofmap.list[cells]
        self._weights = (element.tabulate(0, reference)[0, :, :, 0] if len(cells)
                         else np.zeros((0, element.dim)))

    def read(self, array: np.ndarray) -> np.ndarray:
        """Return a function with coefficients of this rank, ghosts included, at n points, (n,); collective."""
        values = np.zeros(self._n)
        values[self._mine] = (self._weights * array[self._dofs]).sum(1)
        return self._comm.allreduce(values)


def _from_file(file: Any, points: np.ndarray, names: str) -> np.ndarray:
    """Return the temperatures at points, shape (n, 2), by linear interpolation in a CSV file, shape (n,).

    The file has the column T and one or more coordinates as columns. `names` is "RZ" or "xyz", their names.
    """
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError
    table = csv_files.read(file)
    axes = [k for k, name in enumerate(names) if name in table.columns]
    if not axes:
        raise InputError(f"{table.name}: has the columns {', '.join(table.columns)}: must have T, and"
                         f" {', '.join(names)}{' or both' if len(names) == 2 else ', one or more of them'}")
    for name in ("T", *(names[k] for k in axes)):
        if name in table.units and table.units[name] is not None:
            raise InputError(f"{table.name}: column {name!r} is in {table.units[name]!r}: a temperature is read as it"
                             f" is: turn it into the script's units and leave the unit out of the header")
    nodes, T = np.column_stack([table.take(names[k]) for k in axes]), table.take("T")
    nodes, place = np.unique(nodes, axis=0, return_inverse=True)
    low, high = np.full(len(nodes), np.inf), np.full(len(nodes), -np.inf)
    np.minimum.at(low, place.ravel(), T)
    np.maximum.at(high, place.ravel(), T)
    if np.any(low != high):
        k = int(np.argmax(high - low))
        raise InputError(f"{table.name}: two temperatures, {low[k]:.6g} and {high[k]:.6g}, at"
                         f" {' and '.join(names[axis] for axis in axes)} = {', '.join(f'{x:.6g}' for x in nodes[k])}")
    requested, spans = points[:, axes], np.ptp(nodes, axis=0)
    if len(axes) == 1:
        x, near = requested[:, 0], 1e-9 * spans[0]
        _check_inside(table.name, points, names, (x >= nodes[0, 0] - near) & (x <= nodes[-1, 0] + near))
        return np.interp(x, nodes[:, 0], low)
    if spans.min() <= 1e-9 * spans.max():
        name = names[int(np.argmin(spans))]
        raise InputError(f"{table.name}: all its points have the same {name}, and the body is not flat: leave the"
                         f" column {name} out if the temperature is the same along it")
    centre = nodes.mean(0)
    inner = centre + (requested - centre) * (1 - 1e-9)         # a point on the outline is inside
    try:
        found = LinearNDInterpolator(nodes / spans, low)(inner / spans)
    except QhullError:
        raise InputError(f"{table.name}: its {len(nodes)} points lie on one line: give {names[0]} and T alone,"
                         f" {names[1]} and T alone, or points all around the body") from None
    _check_inside(table.name, points, names, np.isfinite(found))
    return found


def _check_inside(name: str, points: np.ndarray, axes: str, inside: np.ndarray) -> None:
    """Raise an InputError unless the mask `inside` is True for all points; `name` is the file, `axes` "RZ" or "xyz"."""
    if not np.all(inside):
        raise InputError(f"{name}: point {_first_false(points, inside, axes)} of the body lies outside the points of"
                         f" the file")


def _first_false(points: np.ndarray, mask: np.ndarray, axes: str) -> str:
    """Return the coordinates of the first of points (n, 2) with False in the mask (n,), as text."""
    return f"({', '.join(axes)}) = {coordinates(points[np.argmin(mask)], 6)}"
