"""Frames of an animation of a sheet in three dimensions with its tools."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ... import figures
from ...contact.tooling import Tooling
from ...results.show.animation import between, spread
from ...results.show.views import look, screen, shading
from .show import add_part
from .wall import wall_of

_LARGEST_TOOL = 20_000
"""Largest number of triangles of a tool that is drawn."""


def frame_pictures(path: Any, frames: int) -> Callable[[], list[Any]]:
    """Return a function that draws the whole part and tools in evenly spaced frames on rank 0; collective."""
    tooling, walls, travels, words = Tooling.of_problem(path.problem), [], [], []
    for a, b, fraction in spread(path, frames, sheet=False):
        state = between(path.record, a, b, fraction)
        walls.append(wall_of(path, state))
        travels.append(tooling.travels(state.setting, state.control))
        time = a.time + fraction * (b.time - a.time)
        words.append(f"{b.stage}  {time:.4g}" if path.last.time else b.stage)
    planes = path.scene.symmetry
    tools = []
    for contact in tooling.contacts:
        points, triangles = contact.tool.surface()
        tools.append((points, triangles, planes.images(3, contact.tool.bounds)) if len(triangles) <= _LARGEST_TOOL
                     else None)
    vectors = [contact.travel_vector for contact in tooling.contacts]

    def draw() -> list[Any]:
        """Draw the frames, on rank 0."""
        from PIL import Image
        pyvista = figures.pyvista()
        ratios = np.concatenate([wall.ratio for wall in walls])
        ends = np.vstack([wall.deformed_points * scale + shift for wall in (walls[0], walls[-1])
                          for scale, shift in planes.images(3)])
        below = ends[:, 2].min() < -ends[:, 2].max()
        camera = np.array([0.8, -2.0, 3.6] if below and walls[0].flat else [1.7, -2.4, 1.7])
        found = []
        with screen():
            for wall, travel, text in zip(walls, travels, words):
                plotter: Any = pyvista.Plotter(off_screen=True, window_size=(800, 640))
                try:
                    plotter.set_background("white")
                    add_part(plotter, wall, wall.ratio, planes.images(3),
                             **(shading(ratios) | {"smooth_shading": False}))
                    for tool, along, vector in zip(tools, travel, vectors):
                        if tool is not None and along is not None:
                            _add_tool(plotter, pyvista, tool, along * vector)
                    plotter.add_text(text, position="upper_left", font_size=11, color="black")
                    look(plotter, camera, ends)
                    found.append(Image.fromarray(plotter.screenshot(None, return_img=True)).convert("RGB"))
                finally:
                    plotter.close()
        return found
    return draw


def _add_tool(plotter: Any, pyvista: Any, tool: Any, moved: np.ndarray) -> None:
    """Add a transparent tool, displaced by `moved`, shape (3,), length, with its images in the planes of symmetry."""
    points, triangles, images = tool
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    for scale, shift in images:
        plotter.add_mesh(pyvista.PolyData((points + moved) * scale + shift, faces), color="grey", opacity=0.15)
