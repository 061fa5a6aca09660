"""Search for the wall of a parison, programmed along its meridian, that gives a bottle a wanted minimum wall."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, as_list, count, non_negative, positive
from ...measures.targets import Target
from ...results.numbers import KeyNumbers
from ...runs import Process, trace
from ...units import NONE, Units

log = logging.getLogger("formingx")


@dataclass(frozen=True, repr=False)
class WallProgramme(KeyNumbers):
    """Result of `wall_programme`.

    Attributes:
        thickness: thickness of the parison at equidistant knots along the meridian, from the neck, shape (knots,),
            length.
        path: path of the run with this thickness.
        tried: thickness at the knots in each run, shape (runs, knots), length.
        min_walls: minimum wall in each run, shape (runs,), length.
        wanted: wanted minimum wall, length.
        converged: True if the minimum wall is within the tolerance of the wanted one.
        units: units of the labels.
        bounded: True if the search ended because the next thickness would be the same, at the bounds.
    """

    thickness: np.ndarray
    path: Any
    tried: np.ndarray
    min_walls: np.ndarray
    wanted: float
    converged: bool
    units: Units = NONE
    bounded: bool = False

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Rows of the printed table: pairs (name, value with its unit)."""
        volume, first = self.path.part().volume, float(self.tried[0].mean())
        state = "" if self.converged else ", not converged" + ": the thickness is at its bounds" * self.bounded
        return [("runs", f"{len(self.tried)}{state}"),
                ("wanted minimum wall", self._length(self.wanted)),
                ("minimum wall", f"{self._length(float(self.min_walls[-1]))}, at first {self.min_walls[0]:.5g}"),
                ("thickness at the knots, from the neck", ", ".join(f"{t:.4g}" for t in self.thickness)),
                ("mean of the knots", f"{self._length(float(self.thickness.mean()))}, at first {first:.5g}"),
                ("volume", self._with_unit(volume, self.units.volume))]


def wall_programme(build: Callable[[Callable], tuple[Any, Any]], min_wall: float, *, start: float,
                   low: float, high: float, knots: int = 6, tolerance: float = 0.02, damping: float = 0.6,
                   max_runs: int = 30, units: Units = NONE) -> WallProgramme:
    r"""Find the thickness of a parison along its meridian for which the part has a wanted minimum wall.

    Each run changes the thickness t_k at every knot by the smallest wall h_k of the material near this knot:

    .. math:: t_k \leftarrow t_k \left(\frac{h}{h_k}\right)^{d}

    h is the wanted minimum wall and d the damping. The wall is proportional to the thickness where the pattern of
    contact stays, so the update needs no derivatives. At the end the wall has its minimum near every knot that is not
    at a bound, so the parison is light. It need not be the lightest one.

    Args:
        build: function that takes the thickness, a function of lengths from 0 at the neck to 1 at the end of the
            meridian, and returns (scene, target) or (scene, stages) for `trace` or `Process.run`. The mesh must be a
            `fx.mesh.tube` or `fx.mesh.revolved`.
        min_wall: wanted minimum wall, length.
        start: thickness of the first run, length.
        low: lower bound of the thickness, length.
        high: upper bound of the thickness, length.
        knots: number of equidistant knots; the thickness is linear between them.
        tolerance: largest relative difference of the minimum wall from the wanted one.
        damping: exponent d, from 0 to 1.
        max_runs: largest number of runs.
        units: units of the labels.

    Returns:
        The thickness, the path of its run, and what each run gave.

    Raises:
        InputError: an argument that is not allowed, or a mesh without a meridian.
        ConvergenceError: the first run fails.

    >>> def build(wall):
    ...     tube = fx.mesh.tube(radius=10.0, length=40.0, elements=(6, 4), part="quarter", end="closed")
    ...     scene = fx.Scene(mesh=tube, thickness=lambda x, y, z: wall(tube.arc_length(x, y, z) / 45.7),
    ...                      materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
    ...                      supports=[fx.Clamped("neck"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
    ...     return scene, fx.enclosed_volume(6000.0)
    >>> found = fx.wall_programme(build, min_wall=0.9, start=1.0, low=0.5, high=2.0, knots=3)
    >>> found.converged, bool(abs(found.min_walls[-1] / 0.9 - 1) < 0.02)
    (True, True)
    """
    wanted, t0 = positive("wall_programme: min_wall", min_wall), positive("wall_programme: start", start)
    bounds = positive("wall_programme: low", low), positive("wall_programme: high", high)
    if not bounds[0] <= t0 <= bounds[1]:
        raise InputError(f"wall_programme: start = {start!r}: must be from low = {low!r} to high = {high!r}")
    number, allowed = count("wall_programme: knots", knots), positive("wall_programme: tolerance", tolerance)
    if number < 2 or not 0 < non_negative("wall_programme: damping", damping) <= 1:
        raise InputError(f"wall_programme: knots = {knots!r} and damping = {damping!r}: must be at least 2, and above 0"
                         f" and at most 1")
    s = np.linspace(0.0, 1.0, number)
    values, tried, walls, path, bounded = np.full(number, t0), [], [], None, False
    for run in range(1, count("wall_programme: max_runs", max_runs) + 1):
        try:
            found = _run(*build(lambda x, t=values: np.interp(x, s, t)))
        except ConvergenceError:
            if path is None:
                raise
            values = np.sqrt(values * tried[-1])             # halve the change that failed
            continue
        path = found
        wall = path.wall()
        tried.append(values)
        walls.append(float(wall.wall.min()))
        log.info("wall_programme: run %d: minimum wall %.5g, wanted %.5g", run, walls[-1], wanted)
        if abs(walls[-1] / wanted - 1) <= allowed:
            break
        mesh = path.scene.mesh
        at = mesh.arc_length(*wall.reference_points[wall.triangles].mean(1).T)
        length = float(np.linalg.norm(np.diff(mesh.meridian, axis=0), axis=1).sum())
        nearest = np.abs(at[:, None] / length - s).argmin(1)
        local = np.array([wall.wall[nearest == k].min(initial=np.inf) for k in range(number)])
        factor = np.where(np.isfinite(local), (wanted / local) ** damping, 1.0)
        values = np.clip(values * factor, *bounds)
        if bounded := np.array_equal(values, tried[-1]):
            break
    return WallProgramme(tried[-1], path, np.array(tried), np.array(walls), wanted,
                         abs(walls[-1] / wanted - 1) <= allowed, units, bounded)


def _run(scene: Any, until: Any) -> Any:
    """Return the path of a scene to a target, or through stages."""
    if isinstance(until, Target):
        return trace(scene, until=until, progress=False)
    return Process(scene).run(as_list("wall_programme: build: stages", until, "a target, or stages"), progress=False)
