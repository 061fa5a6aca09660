"""Picture of the deformed elements of a section."""

from typing import Any

import numpy as np

from . import figure
from . import tools as draw_tools


def draw_volume_ratios(elements: Any, marks: list, tools: list, title: str, file: Any) -> None:
    """Write deformed elements coloured by J, with `marks` (label, position) and `tools` (tool, displacement)."""
    from matplotlib.collections import PolyCollection
    size = np.ptp(elements.outline, axis=(0, 1))
    wide = size[0] > 4 * size[1]
    height = float(np.clip(7.0 * size[1] / size[0], 2.0, 7.0)) + 1.2
    drawing, axes = figure(width=8.0, height=height)
    J = elements.J[np.arange(len(elements.J)), np.argmax(np.abs(elements.J - 1), axis=1)]
    reach = float(np.clip(np.abs(J - 1).max(), 1e-3, 1.0))
    drawn = PolyCollection(list(elements.outline), array=J, cmap="RdBu", edgecolors="0.35", linewidths=0.4,
                           clim=(1 - reach, 1 + reach))
    axes.add_collection(drawn)
    for (label, point), mark, colour in zip(marks, "osD^", ("tab:red", "black", "tab:purple", "tab:green")):
        axes.plot(*point, mark, label=label, markersize=11, fillstyle="none", markeredgewidth=1.8, color=colour,
                  zorder=3, clip_on=False)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim" if wide else "box")
    axes.set_xlabel("r")
    axes.set_ylabel("z")
    axes.set_title(title, fontsize=10)
    drawing.colorbar(drawn, ax=axes, label="J where it is farthest from 1 in the element", shrink=0.85, extend="both")
    if marks:
        drawing.legend(loc="outside lower center", ncols=len(marks), frameon=False, fontsize=9)
    drawing.draw_without_rendering()                        # the aspect changes the limits
    axes.autoscale(False)
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    draw_tools(axes, tools, low, high, mirror=elements.outline[..., 0].min() > -1e-9 * size[0])
    drawing.savefig(file, dpi=150)
