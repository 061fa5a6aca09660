"""Figures and axes of matplotlib that a notebook shows at the end of a cell.

A notebook shows matplotlib's own figures only if pyplot creates them. pyplot keeps them open and asks for a screen.
"""

import io

from matplotlib.axes import Axes
from matplotlib.figure import Figure


class ShownFigure(Figure):
    """Figure of matplotlib that a notebook shows as a PNG picture."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=100)
        return stream.getvalue()


class ShownAxes(Axes):
    """Axes of matplotlib; for them, a notebook shows the figure that contains them as a PNG picture."""

    def _repr_png_(self) -> bytes | None:
        show = getattr(self.figure, "_repr_png_", None)
        return show() if show else None
