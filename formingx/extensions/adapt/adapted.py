"""Adapted meshes: element sizes from the states of a run, for a new run from the undeformed body."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, positive
from ...mesh.divisions import MAX_RECTANGLES
from ...mesh.mesh import Columns, Mesh
from ...mesh.sizes import GROWTH, ends_of_columns, moved_nodes, number_of_columns
from .column_factors import column_factors
from .sizes import required_sizes

_SHORTEST = 1 / 8
"""Smallest length of a new column over its length in the run: finer sizes are unreliable on coarse columns."""

_COLUMN_SAMPLES = 16
"""Number of sampling points of a column for sizes."""



def adapted(path: Any, *, max_rotation: float | None = 1 / 3, error: float | None = None) -> Mesh:
    """Return a new mesh of the body of a run, with columns of elements as short as its states require; collective.

    A column consists of the elements through the sheet between two successive cross-sections. Its new length is the
    smallest that a state requires, and at most 1.25 times the length of its neighbour. It is at least an eighth of the
    column's length in the run, because lengths estimated on coarse columns are inaccurate. To refine further, adapt a
    second time from a run on the new mesh. The elements through the sheet, layers and interfaces stay.

    The mesh must come from `disc`, `sphere`, `parison` or `from_lines`. In a `sheet` in three dimensions triangles
    become smaller, at most to a quarter of their edge length, and never larger.

    Args:
        path: a run on a coarse mesh (a pilot run); it may be incomplete.
        max_rotation: largest angle by which the sheet turns from one end of a column to the other, radians. On a fillet
            of a tool, the length of a column is also at most `max_rotation` times the fillet radius. In three
            dimensions: largest angle between neighbouring triangles. None: ignored.
        error: largest estimated error of the stress over the stress, both as norms over the body. The error of a column
            is assumed to decrease with the square of its length. More columns do not help if too few elements lie
            through the sheet. In three dimensions: largest relative change of the wall between neighbouring triangles.
            None: ignored.

    Returns:
        The new mesh.

    Raises:
        InputError: an argument that is not allowed, or a mesh without columns. Also a sheet that neither bends nor
            touches a fillet, if no `error` is given.

    >>> plug = fx.tools.male(radius=3.0, height=60.0, base=-60.0, fillet=0.5).mirrored().moved(z=0.5)
    >>> scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(20, 1)),
    ...                  materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
    ...                  contacts=[fx.Contact("top", plug, direction=(0, -1))])
    >>> pilot = fx.trace(scene, until=fx.travel(3.0), progress=False)
    >>> mesh = fx.mesh.adapted(pilot, max_rotation=0.5)
    >>> 20 < len(mesh.columns.ends) < 40
    True
    """
    max_rotation = None if max_rotation is None else positive("adapted: max_rotation", max_rotation)
    error = None if error is None else positive("adapted: error", error)
    if not hasattr(path, "problem"):
        raise InputError(f"adapted: path = {path!r}: must be what trace or Process.run gave back")
    mesh = path.problem.scene.mesh
    if path.problem.scene.kinematics.components == 3:
        return _adapted_sheet(mesh, *required_sizes(path, max_rotation, error))
    columns = checked_columns(mesh)
    factors = column_factors(path, max_rotation, error)
    if not np.any(np.isfinite(factors)):
        raise InputError("adapted: the run gives no reason for other elements: nothing bends or touches a fillet, and"
                         " error is None: give error=0.02, or a run that goes further")
    return columns.make(_new_ends(columns, factors))


def _adapted_sheet(mesh: Any, points: np.ndarray, sizes: np.ndarray) -> Mesh:
    """Return a mesh of a flat `sheet` by sizes (n,), linear between points (n, 2), length; others are an InputError."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import cKDTree
    if mesh.of_size is None:
        raise InputError("adapted: must be a sheet made by fx.mesh.sheet: of another the outline is not known")
    inside, outside = LinearNDInterpolator(points, sizes), cKDTree(points)

    def size(x: float, y: float) -> float:
        """Return the edge length of triangles at (x, y), length."""
        found = float(inside(x, y))
        return found if np.isfinite(found) else float(sizes[outside.query((x, y))[1]])
    return mesh.of_size(size)


def checked_columns(mesh: Mesh) -> Columns:
    """Return the columns along the sheet of a mesh; none, or nodes that were moved, are an InputError."""
    columns = mesh.columns
    if columns is None:
        raise InputError("adapted: must be a mesh made by disc, sphere, parison or from_lines, or, in three dimensions,"
                         " by sheet")
    moved = moved_nodes(mesh)
    if moved > 1e-9:
        raise InputError(f"adapted: nodes of the mesh were moved by {moved:.3g} of its size since it was made: make it"
                         f" at its place")
    return columns


def _new_ends(columns: Columns, factors: np.ndarray) -> np.ndarray:
    """Return coordinates of ends of k new columns (k + 1,), longer by `factors` (n,); too many are an InputError."""
    old = columns.ends
    fractions = np.arange(_COLUMN_SAMPLES) / _COLUMN_SAMPLES
    samples = np.append((old[:-1, None] + np.diff(old)[:, None] * fractions).ravel(), old[-1])
    faces = columns.place(samples)[[0, -1]]
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(faces, axis=1), axis=2).mean(0))])
    joints = s[::_COLUMN_SAMPLES]
    length = np.diff(joints)
    requested = np.minimum(np.maximum(factors, _SHORTEST) * length, length.max())
    distance = np.maximum(np.maximum(joints[:-1] - s[:, None], s[:, None] - joints[1:]), 0.0)
    size = (requested + GROWTH * distance).min(1)
    number = number_of_columns(s, size)[-1]
    if number > MAX_RECTANGLES:
        raise InputError(f"adapted: max_rotation and error ask for {number:.3g} elements along the sheet, at most"
                         f" {MAX_RECTANGLES} are allowed: make max_rotation or error larger")
    return ends_of_columns(samples, s, size, np.union1d(columns.fixed, old[[0, -1]]))
