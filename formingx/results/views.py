"""Three-dimensional pictures with pyvista, drawn without a screen."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import InputError


def revolved(profile: Any, file: Any, comm: Any, title: str = "thickness / original") -> None:
    """The sheet revolved about the axis by three quarters, coloured by thickness ratio, as a PNG (rank 0 draws).

    Raises:
        InputError: there is neither a screen nor Xvfb to draw on.
    """
    if comm.rank == 0:
        FilePath(file).parent.mkdir(parents=True, exist_ok=True)
        with _screen():
            _draw(profile, os.fspath(file), title)


def _draw(profile: Any, file: str, title: str) -> None:
    import pyvista
    ratio = profile.thickness_ratio
    rim = np.linspace(profile.bottom[-1], profile.top[-1], 3)[1:-1]
    line = np.vstack([profile.bottom, rim, profile.top[::-1]])
    values = np.concatenate([ratio, np.full(len(rim), ratio[-1]), ratio[::-1]])
    angle = np.linspace(0, 1.5 * np.pi, 181)[:, None]
    x, y = line[:, 0] * np.cos(angle), line[:, 0] * np.sin(angle)
    surface = pyvista.StructuredGrid(x[..., None], y[..., None], np.broadcast_to(line[:, 1], x.shape)[..., None])
    surface["ratio"] = np.broadcast_to(values, x.shape).ravel(order="F")
    plotter = pyvista.Plotter(off_screen=True, window_size=(1000, 800))
    plotter.set_background("white")
    bar = {"title": title, "color": "black", "vertical": True, "position_x": 0.85, "position_y": 0.2, "height": 0.6,
           "width": 0.07, "title_font_size": 20, "label_font_size": 18, "fmt": "%.2f", "n_labels": 5}
    plotter.add_mesh(surface, scalars="ratio", cmap="viridis_r", smooth_shading=True, scalar_bar_args=bar,
                     ambient=0.45, diffuse=0.65, specular=0.25, specular_power=20, split_sharp_edges=True)
    for a in (0.0, 1.5 * np.pi):                       # the cut faces
        faces = [np.column_stack([side[:, 0] * np.cos(a), side[:, 0] * np.sin(a), side[:, 1]])
                 for side in (profile.bottom, profile.top)]
        section = pyvista.StructuredGrid(*(np.stack([f[:, k] for f in faces], 1)[..., None] for k in range(3)))
        section["ratio"] = np.tile(ratio, 2)
        plotter.add_mesh(section, scalars="ratio", cmap="viridis_r", lighting=False, show_scalar_bar=False)
        points = np.vstack([faces[0], faces[1][::-1]])
        plotter.add_mesh(pyvista.lines_from_points(points, close=True), color="black", line_width=2)
    plotter.camera_position = [(2.0, -3.4, 1.9), (0, 0, 0), (0, 0, 1)]
    plotter.reset_camera()
    plotter.camera.zoom(1.2)
    plotter.enable_anti_aliasing("ssaa")
    plotter.screenshot(file)
    plotter.close()


@contextlib.contextmanager
def _screen() -> Iterator[None]:
    """A display to draw on: the one that is there, or an Xvfb of our own that ends with the block.

    Debian's VTK aborts without one.
    """
    if os.environ.get("DISPLAY"):
        yield
        return
    if shutil.which("Xvfb") is None:
        raise InputError("a 3-D view needs a screen (DISPLAY) or the program Xvfb: install the package xvfb")
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1600x1200x24", "-nolisten", "tcp"],
                              pass_fds=(write,), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as answer:
            number = answer.readline().strip()
        if not number:
            raise InputError("a 3-D view needs a screen: Xvfb did not start")
        os.environ["DISPLAY"] = f":{number}"
        yield
    finally:
        os.environ.pop("DISPLAY", None)
        server.terminate()
        server.wait()
