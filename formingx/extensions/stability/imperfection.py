"""Geometric imperfections in the shape of a buckling mode."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, check_type, finite
from ...findings import coordinates
from ...mesh.grid import gathered, to_mesh
from ...mesh.mesh import Mesh
from .instability import CriticalPoint


def with_imperfection(mesh: Mesh, mode: Any, amplitude: float) -> Mesh:
    """Return a stress-free mesh with its nodes moved along a buckling mode; collective.

    Args:
        mesh: the perfect mesh.
        mode: a `CriticalPoint` whose mode is axisymmetric (n = 0), of a run on this mesh or one with the same nodes.
        amplitude: largest displacement of a node, length; negative: against the mode.

    Returns:
        The new mesh.

    Raises:
        InputError: the mode varies round the axis or has other nodes, or the moved elements are inverted.

    >>> column = fx.mesh.disc(radius=1.0, thickness=3.0, elements=(1, 4))
    >>> pressed = fx.Scene(mesh=column, materials=fx.NeoHookean(c10=0.5), supports=[
    ...     fx.Symmetry("axis"), fx.Symmetry("bottom", "z"), fx.PrescribedDisplacement("top", "z")])
    >>> point = fx.trace(pressed, until=fx.travel(-1.9), progress=False).stability([0]).first
    >>> bent = fx.with_imperfection(column, point, 0.01)
    """
    check_type("with_imperfection: mesh", mesh, Mesh, "a mesh")
    mode = check_type("with_imperfection: mode", mode, CriticalPoint, "a CriticalPoint that Path.stability found")
    amplitude = finite("with_imperfection: amplitude", amplitude)
    if mode.number or mode.antisymmetric_about:
        raise InputError(f"with_imperfection: mode: {mode!r}: varies round the body, or is antisymmetric about a mirror"
                         " plane: no mesh of the section can have it; give a mode of n = 0")
    grid = gathered(mesh)
    of_mode, of_mesh = (np.round(points / (1e-7 * np.ptp(grid.points))).astype(np.int64) for points in (
        mode.points, grid.points))
    numbers = {tuple(key): k for k, key in enumerate(of_mode.tolist())}
    found = [numbers.get(tuple(key), -1) for key in of_mesh.tolist()]
    if min(found) < 0:
        R, Z = grid.points[int(np.argmin(found))]
        raise InputError(f"with_imperfection: mode: it has no node at (R, Z) = {coordinates((R, Z), 6)}: it is of"
                         " another mesh")
    moved = grid.points + amplitude * mode.amplitudes[found][:, : grid.points.shape[1]]
    return to_mesh(lambda: grid._replace(points=moved), mesh.comm, "with_imperfection: the moved mesh")
