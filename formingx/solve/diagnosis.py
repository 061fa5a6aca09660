"""Why a run could not go on, in numbers, words and a picture."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import figures
from ..discrete.elements import Body
from ..errors import InputError
from ..mesh.triangles import Place


@dataclass(frozen=True)
class Diagnosis:
    """What was found when a run could not go on. Numbers are None where they could not be had; a membrane has no J.

    Attributes:
        reason: how the last attempt ended.
        step: number of the state that could not be reached (1: the first after the start).
        control, aimed: the driven pressure (stress) or travel (length) of the last good state, and where the failed
            attempt had got to.
        residual: {"displacement", "pressure", "multipliers": norm of the forces left over, over that of the support
            forces} in the failed attempt; inf where they were not finite.
        worst: where the largest force was left over.
        smallest_J, at_J: det F at the quadrature points of the last good state, its smallest, and where.
        failed_J, at_failed_J: the same in the failed attempt.
        shape: the worst shape of a deformed element of the last good state, over its shape at rest.
        I1, limit: (I1 - 3) / (limit - 3) of the point nearest to its material's limit, and where; None: no limit.
        turned: [(control before, after)] between which the determinant of the tangent changed its sign.
        limit_points: controls of the limit points on the path.
        limit_ahead: the control at which a limit point lies ahead, as the last slopes tell; or None.
        flipped: nodes that came into contact, left it or changed between stick and slip in the last iteration.
        touching: nodes in contact in the last good state.
        condition, condition_before: 1-norm condition numbers (estimates) of the tangent of the last good state, and
            some states before it.
        causes: what the numbers prove or make likely, in plain words, the strongest first.
        advice: what to try.
    """

    reason: str
    step: int
    control: float
    aimed: float | None = None
    residual: dict[str, float] = field(default_factory=dict)
    worst: Place | None = None
    smallest_J: float | None = None
    at_J: Place | None = None
    failed_J: float | None = None
    at_failed_J: Place | None = None
    shape: float | None = None
    I1: float | None = None
    limit: Place | None = None
    turned: tuple = ()
    limit_points: tuple = ()
    limit_ahead: float | None = None
    flipped: int | None = None
    touching: int = 0
    condition: float | None = None
    condition_before: float | None = None
    causes: tuple = ()
    advice: tuple = ()
    what: str = "control"
    picture_data: Any = field(default=None, repr=False)

    def __str__(self) -> str:
        at = f", at {self.what} {self.aimed:.8g}" if self.aimed is not None else ""
        lines = [f"Step {self.step} failed after {self.what} {self.control:.8g}{at}: {self.reason}." if self.step else
                 f"There is no first state: {self.reason}."]
        lines += [f"Cause: {cause}." for cause in self.causes] or ["Cause: the numbers below single out none."]
        if self.residual:
            parts = ", ".join(f"{k} {v:.3g}" if np.isfinite(v) else f"{k} not finite" for k, v in self.residual.items())
            at = f"; the largest at {self.worst}" if self.worst else ""
            lines.append(f"Forces left over, over the support forces: {parts}{at}.")
        if self.smallest_J is not None:
            new = self.failed_J is not None and abs(self.failed_J - self.smallest_J) > 0.01 * abs(self.smallest_J)
            failed = f"; in the failed attempt {self.failed_J:.4g} at {self.at_failed_J}" if new else ""
            lines.append(f"Smallest J: {self.smallest_J:.4g} at {self.at_J}{failed}.")
        if self.condition is not None:
            lines.append(f"Condition number of the tangent: {self.condition:.2g}.")
        if self.touching or self.flipped:
            flips = f"; {self.flipped} changed state in the last iteration" if self.flipped is not None else ""
            lines.append(f"Nodes in contact: {self.touching}{flips}.")
        lines += [f"Try {'; '.join(self.advice)}."] if self.advice else []
        return "\n".join(lines)

    def picture(self, file: Any) -> None:
        """Draw the last good state, deformed, its elements coloured by J, the worst places marked, and the tools.

        Rank 0 draws.

        Raises:
            InputError: a membrane has no elements to draw, nor has a run without a good state.
        """
        if self.picture_data is None:
            raise InputError("Diagnosis.picture: there are no elements to draw: a membrane has none across its"
                             " thickness, and without a good state there is no shape")
        rank, shape, marks, tools = self.picture_data
        if rank == 0:
            os.makedirs(os.path.dirname(os.path.abspath(file)), exist_ok=True)
            _draw(shape, marks, tools, f"last good state: {self.what} {self.control:.5g}", file)


def _draw(shape: Body, marks: list, tools: list, title: str, file: Any) -> None:
    from matplotlib.collections import PolyCollection
    size = np.ptp(shape.outline.reshape(-1, 2), axis=0)
    wide = size[0] > 4 * size[1]
    height = float(np.clip(7.0 * size[1] / size[0], 2.0, 7.0)) + 1.2
    figure, axes = figures.figure(width=8.0, height=height)
    J = shape.J[np.arange(len(shape.J)), np.argmax(np.abs(shape.J - 1), axis=1)]
    reach = float(np.clip(np.abs(J - 1).max(), 1e-3, 1.0))
    drawn = PolyCollection(list(shape.outline), array=J, cmap="RdBu", edgecolors="0.35", linewidths=0.4,
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
    figure.colorbar(drawn, ax=axes, label="J where it is farthest from 1 in the element", shrink=0.85, extend="both")
    if marks:
        figure.legend(loc="outside lower center", ncols=len(marks), frameon=False, fontsize=9)
    figure.draw_without_rendering()                        # the aspect changes the limits
    axes.autoscale(False)
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    figures.tools(axes, tools, low, high, mirror=shape.outline[..., 0].min() > -1e-9 * size[0])
    figure.savefig(file, dpi=150)
