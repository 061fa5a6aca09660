"""Target of a search for a wall, and the distance of its answer from the target."""

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
        held: weight of the volume that is held, relative, beside relative walls.
        spare: part by which a volume that is to be kept is aimed lower, so that round-off does not exceed it.
        kept: a volume or a minimum wall that is missed by more than this part is said.
        reached: a wanted wall is reached where it deviates by less than this part of it.
        less: the reason for the end of a search is told if the deviation without it would be less than this part of
            what it is.
        damped: Levenberg's damping over the largest singular value of the sensitivities: less effect counts as none.
        damped_measured: likewise, where a measured wall, which scatters, is fitted.
        worth: the search ends after two runs that lower the sum of squares by less than this part of it.
        shortest: a step is halved, where it is no better, down to this part of it.
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


def lack(what: str, wanted: float | None, found: float) -> str:
    """Return the part of the target that was not reached, as text, or ""."""
    if wanted is None or abs(found / wanted - 1) < SEARCH.kept:
        return ""
    return f"the {what} that was asked for, {wanted:.5g}, was not reached: {found:.5g}"


class Aim:
    """A wanted wall as least squares: relative deviations, and that of the volume where it is held.

    Attributes:
        inside: the places of the wall that count, shape (k,).
        held: the volume that is held, length^3, or None.
        wanted: the wanted wall at the m places that count, shape (m,), length; None: an even or a measured one.
        measured: the `MeasuredWall`, or None.
        damped: see `Search`.
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
        """Shape (m,), and its derivatives, (m, n)."""
        by = run.derivative("wall")[1][self.inside]
        wall = run.wall[self.inside]
        wanted = wall.mean() if self.wanted is None else self.wanted
        left = wall / wanted - 1
        slopes = by / np.reshape(wanted, (-1, 1))
        if self.wanted is None:
            slopes -= np.outer(wall / wanted**2, by.mean(0))
        return self._with_volume(run, left, slopes)

    def _with_volume(self, run: DesignRun, left: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals and their derivatives, with those of the volume where it is held."""
        if self.held is not None:
            grows = run.derivative("volume")[1][0] / self.held
            weight = SEARCH.held * np.sqrt(len(left))
            left = np.append(left, weight * (run.volume / self.held - 1))
            slopes = np.vstack([slopes, weight * grows])
        return left, slopes

    def cost(self, run: DesignRun) -> float:
        """Mean square of the relative deviations, and of the volume's."""
        wall = run.wall[self.inside]
        left = np.mean((wall / (wall.mean() if self.wanted is None else self.wanted) - 1) ** 2)
        return float(left + (0.0 if self.held is None else (run.volume / self.held - 1) ** 2))

    def shortfall(self, run: DesignRun) -> str:
        """Return how far the best run is from the wanted wall, and the reason for the end of the search, or ""."""
        if self.wanted is None:
            return ""
        wall = run.wall[self.inside]
        off = wall / self.wanted - 1
        worst = int(np.argmax(np.abs(off)))
        if abs(off[worst]) < SEARCH.reached:
            return ""
        s = run.profile.reference_length[self.inside]
        return (f"the wanted wall was not reached: wanted {_range(self.wanted)}, reached {_range(wall)}; the largest"
                f" deviation is {100 * off[worst]:+.3g} %, at reference length {s[worst]:.4g}. {self._stop(run)}.")

    def _stop(self, run: DesignRun) -> str:
        """Return the bounds, or the kept volume, that prevent the wanted wall, by the derivatives of a run."""
        try:
            left, by = self.residual(run)
        except InputError as error:
            return f"No further step is known: {error}"
        p = run.parameters
        low, high = (p.low - run.vector) / p.size - 1e-12, (p.high - run.vector) / p.size + 1e-12
        m = len(self.wanted) if self.wanted is not None else len(left)
        far = np.full(len(p.size), np.inf)
        now, step = _deviation(left, by * p.size, m, low, high)
        free = _deviation(left[:m], by[:m] * p.size, m, low, high)[0] if self.held is not None else now
        unbounded = _deviation(left, by * p.size, m, -far, far)[0]
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


class MeasuredAim(Aim):
    """A measured wall as least squares: relative deviations at its points, wherever they are on the part.

    Args:
        run: the first.
        measured: a `MeasuredWall`.
        held: see `Aim`.
    """

    damped = SEARCH.damped_measured

    def __init__(self, run: DesignRun, measured: Any, held: float | None):
        super().__init__(run, None, None, held)
        self.measured = measured

    def residual(self, run: DesignRun) -> tuple[np.ndarray, np.ndarray]:
        """Shape (m,), and its derivatives, (m, n)."""
        wall, by = run.derivative(self.measured.of_path)
        return self._with_volume(run, wall / self.measured.wall - 1, by / self.measured.wall[:, None])

    def cost(self, run: DesignRun) -> float:
        """Mean square of the relative deviations, and of the volume's."""
        left = self.measured.of_path(run.path) / self.measured.wall - 1
        return float(np.mean(left**2) + (0.0 if self.held is None else (run.volume / self.held - 1) ** 2))


def _deviation(left: np.ndarray, by: np.ndarray, m: int, low: np.ndarray, high: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the root mean square of the first m residuals after the best step within bounds, and that step."""
    from scipy.optimize import lsq_linear
    step = lsq_linear(by, -left, bounds=(low, high)).x
    return float(np.sqrt(np.mean((left + by @ step)[:m] ** 2))), step


def _range(values: np.ndarray) -> str:
    """Return the mean of values in words, and their range where they differ."""
    low, high = values.min(), values.max()
    return f"{values.mean():.4g}" + (f" on the mean ({low:.4g} to {high:.4g})" if high - low > 1e-9 * high else "")


def inside_of(run: DesignRun, within: tuple[float, float] | None) -> np.ndarray:
    """Return which places of the wall count, shape (k,).

    Raises:
        InputError: fewer than two do.
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
