"""Empty figures, drawn without a screen and shown by notebooks, and the tools of a scene in them."""

import importlib
import sys
import types
from typing import Any, Protocol, runtime_checkable

import numpy as np


@runtime_checkable
class Axes(Protocol):
    """Axes of matplotlib, which is imported where something is drawn."""

    def plot(self, *args: Any, **style: Any) -> Any:
        """Draw a line."""

    def set(self, **properties: Any) -> Any:
        """Set labels, title and limits."""


def figure(columns: int = 1, width: float = 5.5, height: float = 4.2, ratios: Any = None,
           rows: int = 1) -> tuple[Any, Any]:
    """Return an empty figure and its axes, row by row (a single one as itself); it is saved without a screen.

    Args:
        columns, rows: numbers of plots.
        width, height: size of one plot, inches.
        ratios: relative widths of the columns; default equal.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from .notebook import ShownAxes, ShownFigure
    drawing = ShownFigure(figsize=(width * columns, height * rows), layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(rows, columns, squeeze=False, width_ratios=ratios,
                            subplot_kw={"axes_class": ShownAxes}).ravel()
    for a in axes:
        a.grid(True, color="0.9", linewidth=0.7)
        a.set_axisbelow(True)
        a.spines[["top", "right"]].set_visible(False)
    return drawing, axes[0] if len(axes) == 1 else axes


def pyvista() -> Any:
    """Return the module pyvista, imported without `matplotlib.pyplot`: it is loaded if pyvista uses it, for charts."""
    name = "matplotlib.pyplot"
    if "pyvista" not in sys.modules and name not in sys.modules:
        sys.modules[name] = _LoadedWhenUsed(name)
        try:
            importlib.import_module("pyvista.plotting")
        finally:
            del sys.modules[name]
    return importlib.import_module("pyvista")


class _LoadedWhenUsed(types.ModuleType):
    """A module that is imported when one of its names is used."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):                               # asked for by the machinery of imports
            raise AttributeError(name)
        return getattr(importlib.import_module(self.__name__), name)


def tools(axes: Any, placed: Any, low: Any, high: Any, mirror: bool = False) -> None:
    """Draw rigid tools in grey, as far as they reach into a box.

    Args:
        axes: matplotlib axes.
        placed: [(tool, its shift (r, z))].
        low, high: corners (r, z) of the box, length.
        mirror: True to draw their mirror images at r = 0, too.
    """
    box = np.array([low, high], dtype=float)
    n = np.maximum(300 * (box[1] - box[0]) / np.max(box[1] - box[0]), 40).astype(int)
    r, z = (np.linspace(box[0, k], box[1, k], n[k]) for k in (0, 1))
    points = np.stack(np.meshgrid(np.abs(r) if mirror else r, z), axis=-1)
    for tool, shift in placed:
        depth = tool.signed_distance(points.reshape(-1, points.shape[-1]) - shift).reshape(points.shape[:2])
        if depth.max() <= 0 or depth.min() >= 0:
            continue
        axes.contourf(r, z, depth, levels=[0, np.inf], colors=["0.88"], zorder=0.5)
        axes.contour(r, z, depth, levels=[0], colors=["0.35"], linewidths=1.5, zorder=1.5)
