"""Pictures of buckling modes on the deformed surface of a body, for `CriticalPoint.view3d`."""

from typing import Any

import numpy as np

from ... import figures
from ...errors import positive
from ...results import files
from ...results.show.views import plotted

_STEEPNESS = 0.1
"""Default of the largest displacement of a drawn mode over the length of its waves: higher waves look like spikes."""


def draw(point: Any, file: Any, scale: float | None) -> None:
    """Draw the deformed body with a buckling mode, coloured by its larger amplitude, to a PNG file; collective."""
    file = files.named("CriticalPoint.view3d", file, ".png")
    scale = None if scale is None else positive("CriticalPoint.view3d: scale", scale)
    lines, comm = _outline(point), point.path.problem.comm
    files.on_root(comm, lambda: _draw(point, lines, file, scale))


def _outline(point: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return for each boundary but the axis deformed positions (m, 2), length, and U, W, V (m, 3); collective."""
    path, state = point.path, point.state
    segment = path.record.segment(point.left)
    mesh = segment.problem.scene.mesh
    from ...forms.probes import probe
    lines = []
    for name in mesh.boundaries:
        points = mesh.line_of(name)
        if point.path.problem.scene.kinematics.axisymmetric and points[:, 0].max() < 1e-9 * np.ptp(mesh.nodes_of(name)):
            continue
        with segment.problem.state_context(state) as problem:
            moved = points + probe(problem, points).displacement(problem.x)
        distances = np.linalg.norm(points[:, None] - point.points[None], axis=2)
        lines.append((moved, point.amplitudes[np.argmin(distances, axis=1)]))
    return lines


def _draw(point: Any, lines: list, file: Any, scale: float | None) -> None:
    """Draw the surface that the outlines sweep round the axis, or along the depth in plane strain, to a PNG file.

    Lines: (positions (m, 2), amplitudes (m, 3)); scale: largest displacement over size, None: at most 0.15.
    """
    pyvista = figures.pyvista()
    axisymmetric = point.path.problem.scene.kinematics.axisymmetric
    everything = np.vstack([line for line, _ in lines])
    size = (0.15 if scale is None else scale) * np.ptp(everything, axis=0).max()
    if scale is None and point.number:
        radius = everything[:, 0].max() if axisymmetric else 1.0
        size = min(size, _STEEPNESS * 2 * np.pi * radius / point.number)
    turn = np.linspace(0, 2 * np.pi, max(181, 24 * int(point.number) + 1)) if axisymmetric else np.linspace(
        0, 2 * np.pi / point.number if point.number else np.ptp(everything, axis=0).max(), 61)
    high, wide = np.ptp(everything[:, 1]), 2 * everything[:, 0].max()
    flat = high < 0.3 * wide
    with plotted(file, 500 if flat else 800) as plotter:
        for points, mode in lines:
            U, W, V = mode.T[..., None] * size
            phase = point.number * turn
            r = points[:, :1] + U * np.cos(phase)
            z, v = points[:, 1:] + W * np.cos(phase), (V * np.sin(phase) if point.number else V + 0 * phase)
            place = ((r * np.cos(turn) - v * np.sin(turn), r * np.sin(turn) + v * np.cos(turn), z) if axisymmetric
                     else (r, turn + v, z))
            surface = pyvista.StructuredGrid(*(np.ascontiguousarray(c)[..., None] for c in place))
            largest = U if np.abs(U).max() >= 0.3 * np.abs(W).max() else W
            surface["mode"] = (largest * np.cos(phase) / size).ravel(order="F")
            plotter.add_mesh(surface, scalars="mode", cmap="coolwarm", clim=(-1, 1), smooth_shading=True,
                             show_scalar_bar=False, ambient=0.4, diffuse=0.65, specular=0.2, split_sharp_edges=True)
        plotter.camera_position = [(2.0, -3.4, 1.2 if high > wide else 1.9), (0, 0, 0), (0, 0, 1)]
        plotter.reset_camera()
        plotter.camera.zoom(0.95 if high > wide else 2.0 if flat else 1.25)
