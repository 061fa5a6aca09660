"""Drawings of buckling modes: the whole surface in three dimensions, and the section."""

from typing import Any

import numpy as np

from ... import figures
from ...errors import positive
from ...results import files
from ...results.show.views import plotted


def draw(loss: Any, file: Any, scale: float) -> None:
    """Draw the deformed body with a mode, see `CriticalPoint.view3d`.

    The colour is the amplitude: blue towards the axis (or downwards, where that is larger), red away from it.

    Args:
        loss: the `CriticalPoint`.
        file: path of the PNG file.
        scale: largest amplitude of the mode over the size of the body.
    """
    file = files.named("CriticalPoint.view3d", file, ".png")
    scale = positive("CriticalPoint.view3d: scale", scale)
    lines, comm = _outline(loss), loss.path.problem.comm
    files.on_root(comm, lambda: _draw(loss, lines, file, scale))


def _outline(loss: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return (deformed points, shape (m, 2), amplitudes there, shape (m, 3)) of each boundary; collective."""
    path, state = loss.path, loss.state
    segment = path.segment(loss.left)
    mesh = segment.problem.scene.mesh
    from ...forms.probes import probe
    lines = []
    for name in mesh.boundaries:
        at = mesh.line_of(name)
        if loss.path.problem.scene.kinematics.axisymmetric and at[:, 0].max() < 1e-9 * np.ptp(mesh.nodes_of(name)):
            continue
        with segment.problem.state_context(state) as problem:
            moved = at + probe(problem, at).displacement(problem.x)
        away = np.linalg.norm(at[:, None] - loss.points[None], axis=2)
        lines.append((moved, loss.amplitudes[np.argmin(away, axis=1)]))
    return lines


def _draw(loss: Any, lines: list, file: Any, scale: float) -> None:
    """Draw surface and section to a file."""
    pyvista = figures.pyvista()
    axisymmetric = loss.path.problem.scene.kinematics.axisymmetric
    everything = np.vstack([line for line, _ in lines])
    size = scale * np.ptp(everything, axis=0).max()
    turn = np.linspace(0, 2 * np.pi, 181) if axisymmetric else np.linspace(
        0, 2 * np.pi / loss.number if loss.number else np.ptp(everything, axis=0).max(), 61)
    high, wide = np.ptp(everything[:, 1]), 2 * everything[:, 0].max()
    flat = high < 0.3 * wide
    with plotted(file, 500 if flat else 800) as plotter:
        for points, mode in lines:
            U, W, V = mode.T[..., None] * size
            phase = loss.number * turn
            r = points[:, :1] + U * np.cos(phase)
            z, v = points[:, 1:] + W * np.cos(phase), (V * np.sin(phase) if loss.number else V + 0 * phase)
            place = ((r * np.cos(turn) - v * np.sin(turn), r * np.sin(turn) + v * np.cos(turn), z) if axisymmetric
                     else (r, turn + v, z))
            surface = pyvista.StructuredGrid(*(np.ascontiguousarray(c)[..., None] for c in place))
            most = U if np.abs(U).max() >= 0.3 * np.abs(W).max() else W
            surface["mode"] = (most * np.cos(phase) / size).ravel(order="F")
            plotter.add_mesh(surface, scalars="mode", cmap="coolwarm", clim=(-1, 1), smooth_shading=True,
                             show_scalar_bar=False, ambient=0.4, diffuse=0.65, specular=0.2, split_sharp_edges=True)
        plotter.camera_position = [(2.0, -3.4, 1.2 if high > wide else 1.9), (0, 0, 0), (0, 0, 1)]
        plotter.reset_camera()
        plotter.camera.zoom(0.95 if high > wide else 2.0 if flat else 1.25)
