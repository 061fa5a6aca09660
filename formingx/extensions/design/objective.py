"""Least-squares objectives of a search for a wall thickness, and the reasons why a search missed them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, finite, pair, values
from ...findings import percent
from ...values.tolerances import MEASURED_ACCURACY, NOTICEABLE
from .run import DesignRun


@dataclass(frozen=True)
class SearchSettings:
    """Weights, damping and stopping criteria of the searches for design parameters.

    Attributes:
        volume_weight: weight of the relative deviation of a prescribed volume; deviations of the wall have weight 1.
        volume_margin: relative reduction of the first run's volume as a target, so that round-off does not exceed it.
        limiting_share: a report names the bounds or the prescribed volume as the reason of a deviation of the wall if
            the deviation without them would be below this share of the present one.
        damping: Levenberg damping over the largest singular value of the sensitivities; for a measured wall, which
            contains scatter, it is `formingx.values.tolerances.MEASURED_ACCURACY`, 0.01.
        min_improvement: smallest relative decrease of the cost. The search ends after two runs that each decrease it by
            less, or before a step for which the derivatives predict less.
        shortest_step: smallest fraction of a step that is tried; a step that brings no improvement is halved.
    """

    volume_weight: float = 1e2
    volume_margin: float = 1e-6
    limiting_share: float = 0.8
    damping: float = 1e-6
    min_improvement: float = 0.02
    shortest_step: float = 1 / 64


SETTINGS = SearchSettings()


def missed_target(what: str, requested: float | None, found: float) -> str:
    """Return a text on the requested and the found value; "" if they agree to 0.5 %, or without a request."""
    if requested is None or abs(found / requested - 1) < NOTICEABLE:
        return ""
    return f"the {what} that was asked for, {requested:.5g}, was not reached: {found:.5g}"


class WallObjective:
    """Least-squares objective of a search: a wanted or an even wall thickness, and possibly a prescribed volume.

    The residuals are the relative deviations of the wall thickness at the nodes of the bottom face. The reference
    length of a node is its distance from the axis along the middle line of the undeformed body. The wanted thickness is
    a number, a function of the reference length or None for an even wall, and wrong ones are an InputError. Nodes
    within the lowest and highest reference length `within` count; None: all.

    Attributes:
        inside: mask of the nodes that count, shape (k,).
        volume: prescribed reference volume, length^3, or None.
        target_wall: wanted thickness at the m nodes that count, shape (m,), length; None for an even or measured wall.
        measured: the `MeasuredWall` of a fit, or None.
        damping: Levenberg damping over the largest singular value of the sensitivities.
    """

    measured: Any = None
    damping = SETTINGS.damping

    def __init__(self, run: DesignRun, wall: Any, within: tuple[float, float] | None, volume: float | None):
        self.inside, self.volume = mask_of_range(run, within), volume
        self.target_wall: np.ndarray | None = None
        if wall is not None:
            s = run.reference_length[self.inside]
            self.target_wall = (values("fit: wall", wall, {"reference length": s}) if callable(wall)
                           else np.full(len(s), finite("fit: wall", wall)))
            if not np.all(self.target_wall > 0):
                raise InputError("fit: wall: must be greater than 0 at all reference lengths")

    def residual(self, run: DesignRun) -> tuple[np.ndarray, np.ndarray]:
        r"""Return the residuals of a run and their derivatives by the n parameters.

        .. math:: r_i = \frac{h_i}{w_i} - 1, \quad i = 1, \dots, m, \qquad
            r_{m+1} = 100 \sqrt{m} \left(\frac{V}{V_0} - 1\right)

        with the thickness h at the m nodes that count, the wanted thickness w (for an even wall the mean of h), and the
        volume V. The last residual is left out without a prescribed volume V0. Residuals have shape (m,) or (m + 1,),
        derivatives (m, n) or (m + 1, n). A run without derivative raises an InputError.
        """
        jacobian = run.derivative("wall")[1][self.inside]
        wall = run.wall[self.inside]
        target = wall.mean() if self.target_wall is None else self.target_wall
        residual = wall / target - 1
        slopes = jacobian / np.reshape(target, (-1, 1))
        if self.target_wall is None:
            slopes -= np.outer(wall / target**2, jacobian.mean(0))
        return self._with_volume(run, residual, slopes)

    def _with_volume(self, run: DesignRun, residual: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals (m,) and derivatives (m, n), extended by a row for the volume if it is prescribed."""
        if self.volume is not None:
            volume_slope = run.derivative("volume")[1][0] / self.volume
            weight = SETTINGS.volume_weight * np.sqrt(len(residual))
            residual = np.append(residual, weight * (run.volume / self.volume - 1))
            slopes = np.vstack([slopes, weight * volume_slope])
        return residual, slopes

    def cost(self, run: DesignRun) -> float:
        """Return the mean square deviation of the wall plus that of a prescribed volume, relative; least is best."""
        wall = run.wall[self.inside]
        residual = np.mean((wall / (wall.mean() if self.target_wall is None else self.target_wall) - 1) ** 2)
        return float(residual + (0.0 if self.volume is None else (run.volume / self.volume - 1) ** 2))

    def shortfall(self, run: DesignRun) -> str:
        """Return text on the best run's deviation from the wanted wall and its reason; "" below 1 % or without one."""
        if self.target_wall is None:
            return ""
        wall = run.wall[self.inside]
        deviation = wall / self.target_wall - 1
        worst = int(np.argmax(np.abs(deviation)))
        if abs(deviation[worst]) < MEASURED_ACCURACY:
            return ""
        s = run.reference_length[self.inside]
        return (f"the wanted wall was not reached: wanted {_range(self.target_wall)}, reached {_range(wall)}; the"
                f" largest deviation is {100 * deviation[worst]:+.3g} %, at reference length {s[worst]:.4g}."
                f" {self._limits(run)}.")

    def _limits(self, run: DesignRun) -> str:
        """Return a sentence that names the bounds or the prescribed volume that prevent the wanted wall.

        The derivatives of the run predict how much of the deviation would remain without the bounds, or the volume.
        """
        try:
            residual, jacobian = self.residual(run)
        except InputError as error:
            return f"No further step is known: {error}"
        p = run.parameters
        low, high = (p.low - run.vector) / p.size - 1e-12, (p.high - run.vector) / p.size + 1e-12
        m = len(self.target_wall) if self.target_wall is not None else len(residual)
        infinite = np.full(len(p.size), np.inf)
        present, step = _deviation(residual, jacobian * p.size, m, low, high)
        free = _deviation(residual[:m], jacobian[:m] * p.size, m, low, high)[0] if self.volume is not None else present
        unbounded = _deviation(residual, jacobian * p.size, m, -infinite, infinite)[0]
        at_bounds = np.minimum(step - low, high - step) <= 1e-6 * (high - low)
        names = ", ".join(name for name, at_bound in zip(p.names, at_bounds) if at_bound)
        limits = []
        if free < SETTINGS.limiting_share * present and self.volume is not None:
            limits.append(f"the volume, which is held at {self.volume:.5g} (volume=None would leave {percent(free)}"
                          f" of deviation on the mean)")
        if unbounded < SETTINGS.limiting_share * present and names:
            limits.append(f"bounds: {names} (wider ones would leave {percent(unbounded)})")
        if limits:
            return f"It is stopped by {'; '.join(limits)}; now it is {percent(present)}"
        return f"These parameters bring it no nearer: by the derivatives {percent(present)} is left on the mean"


class MeasuredWallObjective(WallObjective):
    """Least-squares objective of a search: relative deviations from a measured wall, and possibly a volume."""

    damping = MEASURED_ACCURACY

    def __init__(self, run: DesignRun, measured: Any, volume: float | None):
        super().__init__(run, None, None, volume)
        self.measured = measured

    def residual(self, run: DesignRun) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals of a run, shape (m,) or (m + 1,), and their derivatives, shape (m, n) or (m + 1, n)."""
        wall, jacobian = run.derivative(self.measured.of_path)
        return self._with_volume(run, wall / self.measured.wall - 1, jacobian / self.measured.wall[:, None])

    def cost(self, run: DesignRun) -> float:
        """Return the mean square deviation from the measured wall plus that of a prescribed volume, relative."""
        residual = self.measured.of_path(run.path) / self.measured.wall - 1
        return float(np.mean(residual**2) + (0.0 if self.volume is None else (run.volume / self.volume - 1) ** 2))


def _deviation(residual: np.ndarray, jacobian: np.ndarray, m: int, low: np.ndarray,
               high: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the root mean square of the wall's m residuals after the best step in bounds, and the step (n,)."""
    from scipy.optimize import lsq_linear
    step = lsq_linear(jacobian, -residual, bounds=(low, high)).x
    return float(np.sqrt(np.mean((residual + jacobian @ step)[:m] ** 2))), step


def _range(wall: np.ndarray) -> str:
    """Return the mean of wall thicknesses as text, with the lowest and the highest if they differ."""
    low, high = wall.min(), wall.max()
    return f"{wall.mean():.4g}" + (f" on the mean ({low:.4g} to {high:.4g})" if high - low > 1e-9 * high else "")


def mask_of_range(run: DesignRun, within: tuple[float, float] | None) -> np.ndarray:
    """Return the mask (k,) of bottom nodes in a range of reference lengths, None: all; below two are an InputError."""
    s = run.reference_length
    if within is None:
        return np.ones(len(s), dtype=bool)
    low, high = pair("within", within)
    inside = (s >= low) & (s <= high)
    if inside.sum() < 2:
        raise InputError(f"within = {within!r}: has fewer than two places of the sheet, whose reference length goes"
                         f" from 0 to {s[-1]:.6g}")
    return inside
