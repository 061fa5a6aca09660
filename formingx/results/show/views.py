"""Three-dimensional pictures drawn with pyvista, without a screen."""

import contextlib
import functools
import io
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ... import figures
from ...errors import InputError, check_name, direction
from .. import files
from ..evaluate.profile import distance_to_line

_CAMERAS = {"front": (0.0, -1.0, 0.0), "side": (1.0, 0.0, 0.0), "top": (0.0, 0.0, 1.0), "bottom": (0.0, 0.0, -1.0)}

_TILT = 0.05               # of a view along z, against the singular case of VTK


def camera_direction(camera: Any, default: tuple[float, float, float]) -> np.ndarray:
    """Return the direction from a part to the camera, shape (3,), for the name of a view or a direction (x, y, z)."""
    if isinstance(camera, str):
        check_name("view3d: camera", camera, tuple(_CAMERAS))
    found = np.array(default) if camera is None else np.array(_CAMERAS[camera]) if isinstance(camera, str) else (
        direction("view3d: camera", camera))
    size = float(np.linalg.norm(found))
    if np.hypot(*found[:2]) < _TILT * size:                  # z points upwards in the picture, y if seen along z
        found[1] -= _TILT * size
    return found


def revolved(profile: Any, file: Any, comm: Any, camera: Any = None) -> None:
    """Draw three quarters of an axisymmetric sheet, coloured by the wall ratio, as a PNG (rank 0 draws).

    A sheet more than twice as high as wide is drawn as one half. Another ending, or no screen, is an InputError.
    """
    low, high = _bounds(profile)
    tall = high[1] - low[1] > 4 * high[0]
    turn, default = (np.pi, (1.2, -3.4, 1.2)) if tall else (1.5 * np.pi, (2.0, -3.4, 1.9))
    place = camera_direction(camera, default)

    def turned(points, angle):
        return points[:, 0] * np.cos(angle), points[:, 0] * np.sin(angle), points[:, 1]

    file = files.named("view3d", file, ".png")
    files.on_root(comm, lambda: _draw(profile, np.linspace(0.0, turn, 181), turned, place, file))


def extruded(profile: Any, file: Any, comm: Any, camera: Any = None) -> None:
    """Draw a sheet in plane strain, extruded to 1.5 times its width, as a PNG (rank 0 draws).

    The colour is the wall ratio. Another ending, or no screen, is an InputError.
    """
    low, high = _bounds(profile)
    width = high[0] - low[0]

    def shifted(points, y):
        return points[:, 0], np.full(len(points), y), points[:, 1]

    file = files.named("view3d", file, ".png")
    place = camera_direction(camera, (1.9, -3.4, 1.7))
    files.on_root(comm, lambda: _draw(profile, 0.75 * width * np.array([-1, 1]), shifted, place, file))


def _bounds(profile: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower left and the upper right corner (r, z) of the box around a deformed sheet, length."""
    return profile.outline.min(0), profile.outline.max(0)


def _draw(profile: Any, stations: np.ndarray, place: Callable, camera: np.ndarray, file: Any) -> None:
    """Draw the surface that a section sweeps out as a PNG on this rank.

    `place` maps points (n, 2) and a station to x, y, z; the camera is a direction from the sheet.
    """
    pyvista = figures.pyvista()

    def swept(line, values):
        points = np.array([place(line, s) for s in stations])                      # (stations, coordinate, point)
        surface = pyvista.StructuredGrid(*(points[:, k, :, None] for k in range(3)))
        surface["ratio"] = np.tile(values, (len(stations), 1)).ravel(order="F")
        return surface

    ratio = profile.wall_ratio
    beyond = distance_to_line(profile.top, profile.bottom) / profile.original_thickness
    rim = np.linspace(profile.bottom[-1], profile.top[-1], 3)[1:-1] if profile.end is None else profile.end[1:-1]
    line = np.vstack([profile.bottom, rim, profile.top[::-1]])
    values = np.concatenate([ratio, np.full(len(rim), ratio[-1]), beyond[::-1]])
    with plotted(file) as plotter:
        shades = shading(values)
        plotter.add_mesh(swept(line, values), **shades, specular=0.25, split_sharp_edges=True)
        for s in (stations[0], stations[-1]):          # the cut faces
            rows = [np.column_stack(place(row, s)) for row in profile.through_wall()]
            section = pyvista.StructuredGrid(*(np.stack([row[:, k] for row in rows], 1)[..., None] for k in range(3)))
            section["ratio"] = np.tile(ratio, len(rows))
            plotter.add_mesh(section, scalars="ratio", cmap=shades["cmap"], clim=shades["clim"], lighting=False,
                             show_scalar_bar=False)
            points = np.column_stack(place(profile.outline, s))
            plotter.add_mesh(pyvista.lines_from_points(points, close=True), color="black", line_width=2)
        look(plotter, camera, np.vstack([np.column_stack(place(line, s)) for s in stations]))


@contextlib.contextmanager
def plotted(file: Any, height: int = 800) -> Iterator[Any]:
    """Write a PNG picture of the meshes that a `with` block adds to the yielded pyvista plotter.

    It is 1000 pixels wide. Without a screen or Xvfb an InputError is raised.
    """
    pyvista = figures.pyvista()
    picture = io.BytesIO()
    with screen():
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=(1000, height))
        try:
            plotter.set_background("white")
            yield plotter
            plotter.enable_anti_aliasing("ssaa")
            plotter.screenshot(picture)
        finally:                                       # before its screen goes
            plotter.close()
    files.replace(file, lambda stream: stream.write(picture.getvalue()), "wb")


def shading(values: np.ndarray, name: str = "") -> dict[str, Any]:
    """Return arguments of pyvista's `add_mesh` that colour by "ratio", (n,), with a colour bar over its range.

    The values are those of `name`; without it they are walls over the original wall.
    """
    least = 1e-6 * float(np.abs(values).max()) if name else 0.01
    middle, half = (values.max() + values.min()) / 2, max(np.ptp(values), least) / 2    # a flat sheet is of one colour
    bar = {"title": f"{name}\n" if name else "thickness /\noriginal\n", "color": "black", "vertical": True,
           "position_x": 0.83, "position_y": 0.2, "height": 0.6, "width": 0.09, "title_font_size": 34,
           "label_font_size": 34, "fmt": "%.3g" if name else "%.2f", "n_labels": 5}
    return {"scalars": "ratio", "cmap": "viridis_r", "clim": (middle - half, middle + half), "scalar_bar_args": bar,
            "smooth_shading": True, "ambient": 0.45, "diffuse": 0.65, "specular_power": 20}


def look(plotter: Any, camera: Any, points: np.ndarray) -> None:
    """Place the camera, at a direction from the sheet, so that points (n, 3) fill the window beside the bar."""
    plotter.camera_position = [tuple(camera), (0, 0, 0), (0, 0, 1)]
    plotter.reset_camera()
    camera, (width, height) = plotter.camera, plotter.window_size
    matrix = camera.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
    matrix = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    projected = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    projected = projected[:, :2] / projected[:, 3:]                        # the window is [-1, 1]^2
    low, high = projected.min(0), projected.max(0)
    zoom = min(np.array([1.5, 1.85]) / (high - low))
    camera.view_angle = 2 * np.degrees(np.arctan(np.tan(np.radians(camera.view_angle) / 2) / zoom))
    camera.SetWindowCenter(*(zoom * (low + high) / 2 - (-0.2, 0.0)))


@contextlib.contextmanager
def screen() -> Iterator[None]:
    """Provide a display within a `with` block: the present one, or a virtual one (Xvfb) that ends with it.

    VTK before 9.5 aborts without; later it needs none with EGL or OSMesa. If one is needed and missing, an InputError
    is raised.
    """
    if os.environ.get("DISPLAY"):
        yield
        return
    if shutil.which("Xvfb") is None:
        window = _window_without_screen()
        if window is None:
            raise InputError("a 3-D view needs a screen (DISPLAY), the program Xvfb, or EGL with VTK >= 9.5: install"
                             " the package xvfb or libegl1")
        os.environ[_WINDOW] = window
        try:
            yield
        finally:
            del os.environ[_WINDOW]
        return
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


_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"
"""Environment variable by which VTK from version 9.5 on chooses its kind of window."""


@functools.cache
def _window_without_screen() -> str | None:
    """Return the kind of window VTK draws here without a display, or None; another process tries, as VTK crashes."""
    script = ("import vtkmodules.vtkRenderingOpenGL2; from vtkmodules.vtkRenderingCore import vtkRenderWindow;"
              "w = vtkRenderWindow(); w.SetOffScreenRendering(1); w.SetSize(8, 8); w.Render()")
    for window in (os.environ.get(_WINDOW, "vtkEGLRenderWindow"), "vtkOSOpenGLRenderWindow"):
        if not subprocess.run([sys.executable, "-c", script], capture_output=True,
                              env=os.environ | {_WINDOW: window}).returncode:
            return window
    return None
