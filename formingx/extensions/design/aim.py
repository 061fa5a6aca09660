"""Target of a search for a wall thickness, and the deviation of its result from the target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, finite, pair
from .run import DesignRun


@dataclass(frozen=True)
class Search:
    """Weights of searches and their stopping criteria.

    Attributes:
        held: weight of a prescribed volume, relative to relative wall thicknesses.
        spare: relative reduction of the target of a prescribed volume, so that round-off does not exceed it.
        kept: relative deviation of the volume or the minimum wall above which it is reported.
        reached: relative deviation of the wall below which the wanted wall is reached.
        less: a bound or the volume is reported as the reason for the end of a search by this criterion. Without it the
            deviation would decrease below this part.
        damped: Levenberg damping over the largest singular value of the sensitivities. Smaller effects are ignored.
        damped_measured: Levenberg damping for the fit to a measured wall, which contains scatter.
        worth: the search ends after two runs that each lower the sum of squares by less than this part.
        shortest: smallest part of a step to which it is halved if the result is no better.
    """

    held: float = 1e2
    spare: float = 1e-6
    kept: float = 5e-3
    reached: float = 0.01
    less: float = 0.8
    damped: float = 1e-6
    damped_measured: float = 1e-2
    worth: float = 0.02
    shortest: float = 1 / 64


SEARCH = Search()


def lack(what: str, requested: float | None, found: float) -> str:
    """Return a missed target and the value found, as text.

    Args:
        what: name of the quantity.
        requested: its target, or None.
        found: the value found.

    Returns:
        The text; "" if the target was met.
    """
    if requested is None or abs(found / requested - 1) < SEARCH.kept:
        return ""
    return f"the {what} that was asked for, {requested:.5g}, was not reached: {found:.5g}"


class WallTarget:
    """Least-squares target of a wall: relative deviations of the wall, and of a prescribed volume.

    Args:
        run: the first run.
        wall: wanted thickness, length: a number, a function of the reference length, or None for an even wall.
        within: reference lengths that count, (low, high); None for all.
        held: prescribed volume, length^3, or None.

    Attributes:
        inside: mask of the nodes of the wall that count, shape (k,).
        held: prescribed volume, length^3, or None.
        wanted: wanted wall at the m nodes that count, shape (m,), length; None for an even or a measured wall.
        measured: the `MeasuredWall`, or None.
        damped: Levenberg damping, see `Search`.

    Raises:
        InputError: a wanted wall that is not positive at all reference lengths.
    """

    measured: Any = None
    damped = SEARCH.damped

    def __init__(self, run: DesignRun, wall: Any, within: tuple[float, float] | None, held: float | None):
        self.inside, self.held = inside_of(run, within), held
        self.wanted: np.ndarray | None = None
        if wall is not None:
            s = run.profile.reference_length[self.inside]
            given = wall(s) if callable(wall) else np.full(len(s), finite("fit: wall", wall))
            self.wanted = np.asarray(given, dtype=float)
            if self.wanted.shape != s.shape or not np.all(self.wanted > 0):
                raise InputError("fit: wall: must be greater than 0 at all reference lengths")

    def residual(self, run: DesignRun) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals and their derivatives by the parameters.

        Args:
            run: the run.

        Returns:
            Residuals, shape (m,), and derivatives, shape (m, n).
        """
        jacobian = run.derivative("wall")[1][self.inside]
        wall = run.wall[self.inside]
        target = wall.mean() if self.wanted is None else self.wanted
        residual = wall / target - 1
        slopes = jacobian / np.reshape(target, (-1, 1))
        if self.wanted is None:
            slopes -= np.outer(wall / target**2, jacobian.mean(0))
        return self._with_volume(run, residual, slopes)

    def _with_volume(self, run: DesignRun, left: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Append the weighted residual of a prescribed volume and its derivatives."""
        if self.held is not None:
            grows = run.derivative("volume")[1][0] / self.held
            weight = SEARCH.held * np.sqrt(len(left))
            left = np.append(left, weight * (run.volume / self.held - 1))
            slopes = np.vstack([slopes, weight * grows])
        return left, slopes

    def cost(self, run: DesignRun) -> float:
        """Return the cost of a run.

        It is the mean square of the relative deviations of the wall, plus the square of the volume's relative
        deviation.

        Args:
            run: the run.

        Returns:
            The cost.
        """
        wall = run.wall[self.inside]
        left = np.mean((wall / (wall.mean() if self.wanted is None else self.wanted) - 1) ** 2)
        return float(left + (0.0 if self.held is None else (run.volume / self.held - 1) ** 2))

    def shortfall(self, run: DesignRun) -> str:
        """Return the deviation of the best run from the wanted wall, and the reason for the end of the search.

        Args:
            run: the best run.

        Returns:
            The text; "" if the wall was reached.
        """
        if self.wanted is None:
            return ""
        wall = run.wall[self.inside]
        deviation = wall / self.wanted - 1
        worst = int(np.argmax(np.abs(deviation)))
        if abs(deviation[worst]) < SEARCH.reached:
            return ""
        s = run.profile.reference_length[self.inside]
        return (f"the wanted wall was not reached: wanted {_range(self.wanted)}, reached {_range(wall)}; the largest"
                f" deviation is {100 * deviation[worst]:+.3g} %, at reference length {s[worst]:.4g}."
                f" {self._stop(run)}.")

    def _stop(self, run: DesignRun) -> str:
        """Return the bounds or the prescribed volume that prevent the wanted wall, predicted by the derivatives."""
        try:
            left, sensitivity = self.residual(run)
        except InputError as error:
            return f"No further step is known: {error}"
        p = run.parameters
        low, high = (p.low - run.vector) / p.size - 1e-12, (p.high - run.vector) / p.size + 1e-12
        m = len(self.wanted) if self.wanted is not None else len(left)
        far = np.full(len(p.size), np.inf)
        now, step = _deviation(left, sensitivity * p.size, m, low, high)
        free = _deviation(left[:m], sensitivity[:m] * p.size, m, low, high)[0] if self.held is not None else now
        unbounded = _deviation(left, sensitivity * p.size, m, -far, far)[0]
        met = np.minimum(step - low, high - step) <= 1e-6 * (high - low)
        names = ", ".join(name for name, at_bound in zip(p.names, met) if at_bound)
        stops = []
        if free < SEARCH.less * now and self.held is not None:
            stops.append(f"the volume, which is held at {self.held:.5g} (volume=None would leave {100 * free:.2g} % of"
                         f" deviation on the mean)")
        if unbounded < SEARCH.less * now and names:
            stops.append(f"bounds: {names} (wider ones would leave {100 * unbounded:.2g} %)")
        if stops:
            return f"It is stopped by {'; '.join(stops)}; now it is {100 * now:.2g} %"
        return f"These parameters bring it no nearer: by the derivatives {100 * now:.2g} % is left on the mean"


class MeasuredWallTarget(WallTarget):
    """Least-squares target of a measured wall: relative deviations at the measured points of the part.

    Args:
        run: the first run.
        measured: a `MeasuredWall`.
        held: prescribed volume, length^3, or None.
    """

    damped = SEARCH.damped_measured

    def __init__(self, run: DesignRun, measured: Any, held: float | None):
        super().__init__(run, None, None, held)
        self.measured = measured

    def residual(self, run: DesignRun) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals and their derivatives by the parameters.

        Args:
            run: the run.

        Returns:
            Residuals, shape (m,), and derivatives, shape (m, n).
        """
        wall, jacobian = run.derivative(self.measured.of_path)
        return self._with_volume(run, wall / self.measured.wall - 1, jacobian / self.measured.wall[:, None])

    def cost(self, run: DesignRun) -> float:
        """Return the cost of a run.

        It is the mean square of the relative deviations of the wall, plus the square of the volume's relative
        deviation.

        Args:
            run: the run.

        Returns:
            The cost.
        """
        left = self.measured.of_path(run.path) / self.measured.wall - 1
        return float(np.mean(left**2) + (0.0 if self.held is None else (run.volume / self.held - 1) ** 2))


def _deviation(residual: np.ndarray, jacobian: np.ndarray, m: int, low: np.ndarray,
               high: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the root mean square of the first m residuals after the best step within bounds, and that step."""
    from scipy.optimize import lsq_linear
    step = lsq_linear(jacobian, -residual, bounds=(low, high)).x
    return float(np.sqrt(np.mean((residual + jacobian @ step)[:m] ** 2))), step


def _range(values: np.ndarray) -> str:
    """Return the mean of values as text, with their range if they differ."""
    low, high = values.min(), values.max()
    return f"{values.mean():.4g}" + (f" on the mean ({low:.4g} to {high:.4g})" if high - low > 1e-9 * high else "")


def inside_of(run: DesignRun, within: tuple[float, float] | None) -> np.ndarray:
    """Return the mask of the nodes of the wall that count.

    Args:
        run: the run.
        within: reference lengths (low, high), or None for all.

    Returns:
        Mask, shape (k,).

    Raises:
        InputError: fewer than two nodes count.
    """
    s = run.profile.reference_length
    if within is None:
        return np.ones(len(s), dtype=bool)
    low, high = pair("within", within)
    inside = (s >= low) & (s <= high)
    if inside.sum() < 2:
        raise InputError(f"within = {within!r}: has fewer than two places of the sheet, whose reference length goes"
                         f" from 0 to {s[-1]:.6g}")
    return inside
