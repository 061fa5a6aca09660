"""Figures of matplotlib without a screen, which notebooks show; drawing of tools; import of pyvista."""

import importlib
import sys
import types
from typing import Any, Protocol, runtime_checkable

import numpy as np


@runtime_checkable
class Axes(Protocol):
    """Type of matplotlib's axes; a protocol, because matplotlib is imported only where something is drawn."""

    def plot(self, *args: Any, **style: Any) -> Any:
        """Draw lines and markers, as matplotlib's `Axes.plot`."""

    def set(self, **properties: Any) -> Any:
        """Set labels, title and limits, as matplotlib's `Axes.set`."""


def figure(columns: int = 1, width: float = 5.5, height: float = 4.2, ratios: Any = None,
           rows: int = 1) -> tuple[Any, Any]:
    """Return an empty figure of `rows` x `columns` plots, sizes in inches, and their axes or the only one."""
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


def new_axes() -> Any:
    """Return the axes of a new figure with one plot.

    It is the current figure of `matplotlib.pyplot` if the script uses that, not in a notebook, which shows axes.
    """
    pyplot = sys.modules.get("matplotlib.pyplot")
    drawing, axes = figure()
    if pyplot is not None and "ipykernel" not in sys.modules:
        from .notebook import ShownFigure
        current = pyplot.figure(FigureClass=ShownFigure, figsize=drawing.get_size_inches(), layout="constrained")
        drawing.delaxes(axes)
        axes = current.add_subplot(axes_class=type(axes))
        axes.grid(True, color="0.9", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    return axes


def pyvista() -> Any:
    """Return pyvista without `matplotlib.pyplot`, slow to import and for charts only: a placeholder imports that."""
    name = "matplotlib.pyplot"
    if "pyvista" not in sys.modules and name not in sys.modules:
        sys.modules[name] = _LoadedWhenUsed(name)
        try:
            importlib.import_module("pyvista.plotting")
        finally:
            del sys.modules[name]
    return importlib.import_module("pyvista")


class _LoadedWhenUsed(types.ModuleType):
    """Placeholder for a module of the same name, which is imported when one of its attributes is used."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):                               # asked for by the machinery of imports
            raise AttributeError(name)
        return getattr(importlib.import_module(self.__name__), name)


def tools(axes: Any, placed: Any, low: Any, high: Any, mirror: bool = False) -> None:
    """Draw sections of `placed` tools (`Tool`, displacement) in grey within a box (r, z), length, or also mirrored."""
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
