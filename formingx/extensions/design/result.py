"""Result of a search for design parameters: the first and the best run, and the confidence of the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...errors import InputError
from ...findings import percent, without_notes
from ...units import NONE, Units
from ...values.tolerances import NEGLIGIBLE
from .confidence import Confidence, confidence
from .run import DesignRun


def unevenness(wall: np.ndarray) -> float:
    """Return the standard deviation of wall thicknesses, shape (k,), length, over their mean."""
    return float(wall.std() / wall.mean())


@dataclass(frozen=True)
class DesignResult:
    """Result of a search for design parameters (`Design.fit`, `Design.minimum_weight`); its text is a report.

    Walls are thicknesses at the k nodes of the bottom face; in three dimensions at the k triangles.

    Attributes:
        before: the first `DesignRun` of the search.
        best: the best `DesignRun` of the search.
        runs: all successful runs, in order.
        failed: error messages of the failed runs.
        inside: mask of the nodes that count in the search, shape (k,).
        reason: reason for the end of the search, as text.
        predicted: wall of the best run as predicted by the derivatives of the run before it, shape (k,), length.
        missed: text that names the missed targets (volume, wall or minimum wall) and the reason; "" if all were met.
        target_wall: wanted wall at the m nodes that count, shape (m,), length; None if no wall was wanted.
        measured: the `MeasuredWall` of a fit, or None.
        difference_runs: number of whole runs for derivatives by differences; 0 with exact derivatives.
        differences: text on these runs, with their number at a time; "" with exact derivatives.
    """

    before: DesignRun
    best: DesignRun
    runs: list[DesignRun]
    failed: list[str]
    inside: np.ndarray
    reason: str
    predicted: np.ndarray
    missed: str = ""
    target_wall: np.ndarray | None = None
    measured: Any = None
    difference_runs: int = 0
    differences: str = ""

    @cached_property
    def confidence(self) -> Confidence:
        """Standard errors and covariance of the parameters after a fit to a measured wall.

        Raises:
            InputError: the fit used no measured wall, or a wall with no more points than parameters.
        """
        if self.measured is None:
            raise InputError("confidence: needs a fit to a MeasuredWall")
        return confidence(self.best, self.measured)

    @property
    def values(self) -> dict[str, Any]:
        """Values of the parameters in the best run: {parameter: number or `Knots`}."""
        return self.best.values

    @property
    def paths(self) -> int:
        """Number of runs that the search took, including the failed ones and those for differences."""
        return len(self.runs) + len(self.failed) + self.difference_runs

    @property
    def cv(self) -> tuple[float, float]:
        """Standard deviation over mean of the wall thickness, in the first and in the best run of the search.

        Only the nodes in the searched range of reference lengths count.
        """
        return unevenness(self.before.wall[self.inside]), unevenness(self.best.wall[self.inside])

    def at_bounds(self) -> list[str]:
        """Return the parameters of the best run that lie on a bound.

        Returns:
            A text for each such parameter, with its name, the bound and the value.
        """
        p, v = self.best.parameters, self.best.vector
        near = 1e-6 * p.size
        return [f"{name} at its {'lowest' if x <= a + h else 'highest'}, {x:.6g}"
                for name, x, a, b, h in zip(p.names, v, p.low, p.high, near) if x <= a + h or x >= b - h]

    def without_effect(self) -> list[str]:
        """Return the names of the parameters without effect on the wall.

        By the derivatives of the first run, the whole range of such a parameter changes the wall by less than 0.1 % of
        its mean.

        Returns:
            Names of the parameters.
        """
        jacobian = self.before.derivative("wall")[1][self.inside] * self.before.parameters.size
        mean = self.before.wall[self.inside].mean()
        return [name for name, d in zip(self.before.parameters.names, abs(jacobian).max(0) / mean) if d < NEGLIGIBLE]

    def attainable(self) -> float:
        """Return the lowest unevenness of the wall that the parameters can reach within their bounds, for any volume.

        The derivatives of the best run predict it.

        Returns:
            Standard deviation over mean of the wall at the nodes that count.
        """
        from scipy.optimize import lsq_linear
        p, v, (wall, jacobian) = self.best.parameters, self.best.vector, self.best.derivative("wall")
        wall, jacobian, mean = wall[self.inside], jacobian[self.inside] * p.size, wall[self.inside].mean()
        found = lsq_linear((jacobian - np.outer(wall / mean, jacobian.mean(0))) / mean, 1 - wall / mean,
                           bounds=((p.low - v) / p.size - 1e-12, (p.high - v) / p.size + 1e-12))
        return float(np.sqrt(2 * found.cost / len(wall)))

    def __str__(self) -> str:
        (a, b), before, after = self.cv, self.before.wall[self.inside], self.best.wall[self.inside]
        deviation = abs(self.predicted - self.best.wall)[self.inside].max() / after.mean()
        of_which = [f"{len(self.failed)} failed"] * bool(self.failed) + [self.differences] * bool(self.differences)
        lines = [f"{self.paths} runs{', of which ' * bool(of_which)}{' and '.join(of_which)}; {self.reason}",
                 f"{'':24}{'before':>12}{'after':>12}",
                 f"{'unevenness (std/mean)':24}{a:12.4f}{b:12.4f}",
                 f"{'minimum wall':24}{before.min():12.5g}{after.min():12.5g}",
                 f"{'mean wall':24}{before.mean():12.5g}{after.mean():12.5g}",
                 f"{'volume':24}{self.before.volume:12.5g}{self.best.volume:12.5g}"]
        if self.target_wall is not None:
            lines.insert(3, f"{'wanted wall, mean':24}{'':12}{self.target_wall.mean():12.5g}")
            a, b = (np.abs(wall / self.target_wall - 1).max() for wall in (before, after))
            lines.insert(4, f"{'largest deviation, %':24}{100 * a:12.4g}{100 * b:12.4g}")
        if self.measured is not None:
            a, b = (self.measured.compare(run.path).rms_percent for run in (self.before, self.best))
            lines.insert(2, f"{'deviation, rms, %':24}{a:12.4g}{b:12.4g}")
        p = self.best.parameters
        lines += [f"{name:24}{x:12.5g}{y:12.5g}" for name, x, y in zip(p.names, self.before.vector, self.best.vector)]
        lines += [f"the run before predicted the wall to {percent(deviation)}"]
        lines += [f"bounds: {', '.join(met)}" for met in [self.at_bounds()] if met]
        lines += [f"no effect: {', '.join(absent)}" for absent in [self.without_effect()] if absent]
        lines += [f"the best run: {found.text}" for found in without_notes(self.best.path.findings())]
        return "\n".join([*lines, *[self.missed] * bool(self.missed), *(f"failed: {text}" for text in self.failed)])

    __repr__ = __str__

    def plot_wall(self, axes: Any = None) -> Any:
        """Draw the walls of the first and the best run, and the wanted or measured wall, over the reference length.

        Args:
            axes: matplotlib axes; default a new figure.

        Returns:
            The matplotlib axes.
        """
        if axes is None:
            from ...figures import figure
            axes = figure(width=7)[1]
        for run, label, colour in ((self.before, "before", "0.6"), (self.best, "after", "C0")):
            axes.plot(run.reference_length, run.wall, "." if run.in_space else "-", color=colour, label=label)
        if self.target_wall is not None:
            s = self.best.reference_length[self.inside]
            axes.plot(s, self.target_wall, "k--", linewidth=1, label="wanted")
        if self.measured is not None:
            found = self.measured.compare(self.best.path)
            axes.plot(found.reference_length, found.measured, "ko", markersize=4, label="measured")
        axes.set_xlabel("reference length")
        axes.set_ylabel("wall")
        axes.set_ylim(bottom=0)
        axes.legend()
        return axes

    def report(self, file: Any = "design.html", title: str = "", *, deviations: Any = None,
               units: Units | None = None) -> FilePath:
        """Write an HTML report of the search (rank 0 writes).

        It shows the part, the walls and the profiles of the first and the best run, and the effect of each parameter on
        the wall.

        Args:
            file: path of the HTML file.
            title: heading of the page.
            deviations: {parameter: standard deviation}, a `Fit` with its covariance, or a list of such. The report
                then shows the standard deviations of the wall, volume, pressures and forces.
            units: a `formingx.Units`, for the labels; default without units.

        Returns:
            Path of the file.

        Raises:
            InputError: the best run has no derivative.
            OSError: the file cannot be written.
        """
        from .report import of_search
        return of_search(self, file, title, deviations, units or NONE)
