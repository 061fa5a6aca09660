"""A mesh of the sizes that a run asks for, of columns or in space: the next run begins on it from rest."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, positive
from ...mesh.mesh import Columns, Mesh
from .column_factors import column_factors
from .sizes import wanted_sizes

_GROWTH = 0.25
"""By how much a column may be longer than its neighbour, over the neighbour."""

_LEAST = 1 / 8
"""Of the length of a column in the run: shorter ones are not asked for, as what a long one sees there is too rough."""

_SAMPLES = 16
"""Places of a column at which sizes are looked up."""

_MOST = 20_000             # columns


def adapted(path: Any, *, share: float | None = 1 / 3, error: float | None = None) -> Mesh:
    """The mesh of a run made again, with columns of elements as its states ask for: small where they matter, no more.

    A column is as long, in the reference configuration, as the strictest of its states allows, and at most 1.25
    times its neighbour; but not shorter than an eighth of that of the run, as long ones know no better: then adapt
    again, to a run on the new mesh. The subdivision through the sheet stays: elements, layers and their interfaces. For
    meshes of `disc`, `sphere`, `parison` and `from_lines`; of a `sheet` in three dimensions triangles are made
    smaller, to a quarter at the least, never larger. Collective.

    Args:
        path: a run, on coarse elements for one (a pilot run), as far as it came.
        share: the amount by which a column may turn as the sheet bends, radians; where one lies on a fillet of a
            tool, its length there over the radius of the fillet. In space: from triangle to triangle. None: it does
            not count.
        error: the estimated error of the stress, over all the body, relative (`StressError.relative`), that no state is
            to be above; columns share it, as an error of the second order. (More of them do not help where too few
            elements lie through the sheet.) In space: the change of the wall from triangle to triangle, relative. None:
            it does not count.

    Raises:
        InputError: an argument that is not allowed; a mesh that is not one of columns; nothing asks for a size: the
            sheet neither bends nor touches a fillet, and no `error` is given.

    >>> plug = fx.tools.male(radius=3.0, height=60.0, base=-60.0, fillet=0.5).mirrored().moved(z=0.5)
    >>> scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(20, 1)),
    ...                  materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
    ...                  contacts=[fx.Contact("top", plug, direction=(0, -1))])
    >>> pilot = fx.trace(scene, until=fx.travel(3.0), progress=False)
    >>> mesh = fx.mesh.adapted(pilot, share=0.5)
    >>> 20 < len(mesh.columns.ends) < 40
    True
    """
    share = None if share is None else positive("adapted: share", share)
    error = None if error is None else positive("adapted: error", error)
    if not hasattr(path, "problem"):
        raise InputError(f"adapted: path = {path!r}: must be what trace or Process.run gave back")
    mesh = path.problem.scene.mesh
    if path.problem.scene.kinematics.components == 3:
        return _sheet(mesh, *wanted_sizes(path, share, error))
    columns = of_columns(mesh)
    factors = column_factors(path, share, error)
    if not np.any(np.isfinite(factors)):
        raise InputError("adapted: the run gives no reason for other elements: nothing bends or touches a fillet, and"
                         " error is None: give error=0.02, or a run that goes further")
    return columns.make(_ends(columns, factors))


def _sheet(mesh: Any, points: np.ndarray, sizes: np.ndarray) -> Mesh:
    """With triangles of sizes at points, linear between these."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import cKDTree
    if mesh.of_size is None:
        raise InputError("adapted: must be a sheet made by fx.mesh.sheet: of another the outline is not known")
    inside, near = LinearNDInterpolator(points, sizes), cKDTree(points)

    def size(x: float, y: float) -> float:
        found = float(inside(x, y))
        return found if np.isfinite(found) else float(sizes[near.query((x, y))[1]])
    return mesh.of_size(size)


def of_columns(mesh: Mesh) -> Columns:
    """The columns of a mesh; an InputError if it has none, or its nodes were moved."""
    columns = mesh.columns
    if columns is None:
        raise InputError("adapted: must be a mesh made by disc, sphere, parison or from_lines, or, in space, by sheet")
    nodes = np.concatenate(list(columns.place(columns.ends)[[0, -1]]))
    off = max(np.min(np.linalg.norm(nodes[:, None] - mesh.nodes_of(name), axis=2), axis=1).reshape(2, -1)[k].max()
              for k, name in enumerate(columns.faces))
    if off > 1e-9 * np.ptp(nodes, axis=0).max():
        raise InputError(f"adapted: nodes of the mesh were moved by {off:.3g} since it was made: make it at its place")
    return columns


def _ends(columns: Columns, factors: np.ndarray) -> np.ndarray:
    """Ends of columns of `factors` times the present lengths, shape (n,), inf: as long as the longest."""
    old = columns.ends
    at = np.append((old[:-1, None] + np.diff(old)[:, None] * np.arange(_SAMPLES) / _SAMPLES).ravel(), old[-1])
    faces = columns.place(at)[[0, -1]]
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(faces, axis=1), axis=2).mean(0))])
    joints = s[::_SAMPLES]
    length = np.diff(joints)
    wanted = np.minimum(np.maximum(factors, _LEAST) * length, length.max())
    away = np.maximum(np.maximum(joints[:-1] - s[:, None], s[:, None] - joints[1:]), 0.0)
    size = (wanted + _GROWTH * away).min(1)
    number = np.concatenate([[0.0], np.cumsum(np.diff(s) * (1 / size[1:] + 1 / size[:-1]) / 2)])
    if number[-1] > _MOST:
        raise InputError(f"adapted: share and error ask for {number[-1]:.3g} elements along the sheet, at most {_MOST}"
                         f" are allowed: make share or error larger")
    pieces = np.union1d(columns.fixed, old[[0, -1]])
    marks = np.interp(pieces, at, number)
    ends = [pieces[:1]]
    for a, b, last in zip(marks, marks[1:], pieces[1:]):
        n = max(int(np.ceil(b - a - 1e-6)), 1)
        ends += [np.interp(a + (b - a) * np.arange(1, n) / n, number, at), np.array([last])]
    return np.concatenate(ends)
