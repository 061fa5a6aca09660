"""Figures, and axes with their figure, that show themselves at the end of a notebook's cell.

matplotlib's own do so only if pyplot makes them, which keeps them open and asks for a screen.
"""

import io

from matplotlib.axes import Axes
from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure that a notebook shows."""

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=100)
        return stream.getvalue()


class ShownAxes(Axes):
    """Axes for which a notebook shows their figure."""

    def _repr_png_(self) -> bytes | None:
        show = getattr(self.figure, "_repr_png_", None)
        return show() if show else None
