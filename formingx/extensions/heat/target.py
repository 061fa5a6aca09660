"""Target that a material point reaches a temperature, for stages of heat conduction such as an oven."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import InputError, as_points, finite
from ...measures.quantities import Quantity
from ...measures.targets import Target
from ...values.tolerances import NEGLIGIBLE, ROUND_OFF
from .cooling_history import CoolingHistory

_MAX_ITERATIONS = 20
"""Largest number of steps of regula falsi to the time at which the point has the wanted temperature."""

_GROWTH = 4.0
"""Factor by which the time ahead grows until the point has passed the wanted temperature."""

_NEAR = 1e-4
"""Difference from the wanted temperature, degrees, at which these steps end."""


class PointTemperature(Quantity):
    """Temperature of a material point; for a trial state the heat equation is solved from the last accepted one."""

    size, smooth = 1.0, False

    def __init__(self, problem: Any, history: CoolingHistory, point: np.ndarray, depth: float | None):
        self._problem, self._history, self._point, self._depth = problem, history, point, depth
        self._known: dict[float, float] = {}                 # temperatures found before, by time
        self._crossed: tuple[float, float] | None = None     # time of the last state, and the time of the target
        scene = problem.scene
        thickness = (problem.forms.thickness(next(iter(scene.mesh.faces))) if scene.kinematics.components == 3 else
                     float(min(scene.extent)))
        self._short = NEGLIGIBLE * scene.heat.time_through(scene.mesh, thickness)

    def value(self, x, control):
        return self._at(self._problem.history.time_at(control), control)

    def _at(self, time: float, control: float) -> float:
        """Return the temperature at a process time; that of an accepted state is the one found before it."""
        if time not in self._known:
            def read() -> float:
                return float(self._problem.temperature.at_points(self._point, self._depth)[0])
            self._known = dict([*self._known.items()][-3:]) | {time: self._history.ahead(time, control, read)}
        return self._known[time]

    def equation(self, target):
        def c(x, control, gradient):
            gradient.set(0)
            forms, rate, last = self._problem.forms, self._problem.setting.rate[-1], self._history.time
            if self._crossed is None or self._crossed[0] != last:
                self._crossed = last, self._crossing(target, last, control)
            length = self._crossed[1] - last or self._short
            return (forms.time_at(control) - self._crossed[1]) / abs(length), rate / abs(length)
        return c

    def _crossing(self, target: float, last: float, control: float) -> float:
        """Return the time, far ahead if never, when the target is reached after the last state, by regula falsi."""
        before = self._crossed[1] - last if self._crossed else 0.0
        a, b = last, last + max(before, self._short)
        fa, fb = self._at(a, control) - target, self._at(b, control) - target
        while fa * fb > 0:
            a, b, fa = b, last + _GROWTH * (b - last), fb
            if b > last + self._short / ROUND_OFF**0.5:
                return b
            fb = self._at(b, control) - target
        for _ in range(_MAX_ITERATIONS):
            if min(abs(fa), abs(fb)) < _NEAR:
                break
            middle = b - fb * (b - a) / (fb - fa)
            f = self._at(middle, control) - target
            a, fa, b, fb = (b, fb, middle, f) if f * fb < 0 else (a, fa / 2, middle, f)       # the Illinois rule
        return a if abs(fa) < abs(fb) else b


def temperature(value: float, *, at: Sequence[float], depth: float | None = None) -> Target:
    """Return the target that a material point reaches a temperature, such as the core of a sheet in an oven.

    Args:
        value: the temperature, in the unit of the scene.
        at: reference position of the point, length: (R, Z), of a flat sheet in three dimensions (x, y), of another
            surface (x, y, z).
        depth: depth of the point in a sheet in three dimensions, from 0 at its bottom (inner) face to 1 at its top
            (outer) face; None: 0.5, the core.

    Returns:
        The target, for `Stage.until` of a scene with `Cooling`.

    Raises:
        InputError: the scene has no heat conduction, the point lies outside the body, or the depth is not from 0 to 1.

    >>> fx.Stage("oven", duration=60.0, until=fx.temperature(150.0, at=(0.0, 0.0)))
    Stage('oven')
    """
    wanted = finite("temperature", value)
    if depth is not None and not 0 <= finite("temperature: depth", depth) <= 1:
        raise InputError(f"temperature: depth = {depth!r}: must be from 0, the bottom face, to 1, the top face")

    def bind(problem: Any) -> PointTemperature:
        found = [history for history in problem.history.parts if isinstance(history, CoolingHistory)]
        scene = problem.scene
        if not found:
            raise InputError(f"temperature = {wanted:g}: the temperature of the scene does not change: give Scene"
                             f" heat=fx.Cooling(...)")
        in_space = scene.kinematics.components == 3
        if depth is not None and not in_space:
            raise InputError(f"temperature = {wanted:g}: depth = {depth!r}: is for a sheet in three dimensions: a point"
                             f" of a section has its depth in Z")
        point = as_points("temperature: at", [at], 3 if in_space and not scene.mesh.flat else 2)
        point = problem.forms.nearest(point) if in_space else problem.followed(point)
        quantity = PointTemperature(problem, found[0], point, depth)
        quantity.value(None, problem.control)                # the point must lie in the body
        return quantity
    return Target("temperature", wanted, bind)
