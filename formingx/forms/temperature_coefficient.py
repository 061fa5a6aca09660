"""Temperature-dependent coefficients at the beginning of a step, and their extrapolation within it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem


class TemperatureCoefficient:
    r"""Coefficient f(T) at the quadrature points of the energy, for temperatures that may change with time.

    The temperature is known at the beginning :math:`t_0` of a step. Within the step the coefficient is extrapolated
    with its logarithmic rate in the previous step:

    .. math:: f(t) = f_0 \exp(a (t - t_0)), \qquad a = \frac{\ln f_0 - \ln f_{-1}}{t_0 - t_{-1}}

    The error is of second order in the step length, and f keeps its sign. `values` is set to f(T). parts: groups of
    cells, (local numbers, f). temperatures: of each group at the last accepted state, and before it if known, shape
    (1 or 2, cells, q).
    """

    def __init__(self, forms: Any, values: fem.Function, parts: Sequence[tuple[Any, Callable]],
                 temperatures: Iterable[np.ndarray]):
        self._temperature, self._values, self._parts = forms.temperature, values, parts
        self._rate = None
        self._known: dict[tuple, list[np.ndarray]] = {}      # values and rates at the last two temperatures
        if forms.scene.heat is not None:
            self._rate, self._since = fem.Function(values.function_space), forms.constant(0.0)
        self.update(temperatures)

    def at_time(self, time: Any) -> Any:
        """Return the coefficient (UFL scalar) at a time, extrapolated from the last two accepted states."""
        return self._values if self._rate is None else self._values * ufl.exp(self._rate * (time - self._since))

    def update(self, temperatures: Iterable[np.ndarray]) -> None:
        """Update to temperatures of each of `parts`, now and before, (1 or 2, cells, q), else an InputError."""
        given = list(temperatures)
        key = self._temperature.time, self._temperature.time_before, *(T.tobytes() for T in given)
        known = self._known.pop(key, None)
        if known is None:
            self._evaluate(given)
            known = [function.x.array.copy() for function in self._functions]
        else:
            for function, values in zip(self._functions, known, strict=True):
                function.x.array[:] = values
        if self._rate is not None:
            self._since.value = self._temperature.time
        last = list(self._known.items())[-1:]               # a run alternates between both ends of a step
        self._known = dict([*last, (key, known)])

    @property
    def _functions(self) -> list[fem.Function]:
        """DOLFINx functions of the coefficient f and, if temperatures change, of its logarithmic time rate a."""
        return [self._values] if self._rate is None else [self._values, self._rate]

    def _evaluate(self, temperatures: Sequence[np.ndarray]) -> None:
        """Set the coefficient f and its logarithmic rate a, in time, from temperatures.

        temperatures: for each group of cells, shape (1 or 2, cells, q): at the last accepted state, then at the state
        before. With one of them the rate is 0.
        """
        temperature = self._temperature
        for (cells, function), T in zip(self._parts, temperatures, strict=True):
            rows = self._values.function_space.dofmap.list[cells]
            now, *before = function(T)
            self._values.x.array[rows] = now
            if self._rate is not None and before:
                with np.errstate(all="ignore"):
                    rate = np.log(now / before[0]) / (temperature.time - temperature.time_before)
                self._rate.x.array[rows] = np.where(np.isfinite(rate), rate, 0.0)
            elif self._rate is not None:
                self._rate.x.array[rows] = 0.0
