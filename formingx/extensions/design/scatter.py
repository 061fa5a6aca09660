"""Uncertain design parameters: their covariance, and the confidence band of an output quantity, to first order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, fraction, non_negative
from .parameters import Parameters


@dataclass(frozen=True)
class Band:
    """Confidence band of an output quantity of a run with uncertain parameters, to first order; its text is a table.

    Attributes:
        measure: name of the quantity.
        coordinates: abscissa of the values, shape (m,). For the wall it is the reference length of the node: the
            distance from the axis along the undeformed middle line, length. Otherwise it counts from 0 to m - 1.
        value: values of the quantity in the run, shape (m,).
        deviation: standard deviations of the values, shape (m,).
        confidence: confidence level of the band between `low` and `high`, for a normal distribution.

    >>> band = fx.Design(lambda c10: (fx.Scene(
    ...     mesh=sheet, materials=fx.NeoHookean(c10=c10), loads=[fx.Pressure("bottom")],
    ...     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")]), fx.pole_height(4.0)),
    ...     {"c10": 0.4}).run().band({"c10": 0.02}, "pressure")
    >>> round(float(band.deviation[0] / band.value[0]), 6)                              # of a pressure in proportion
    0.05
    """

    measure: str
    coordinates: np.ndarray
    value: np.ndarray
    deviation: np.ndarray
    confidence: float

    @property
    def low(self) -> np.ndarray:
        """Lower edge of the confidence band of the m values, shape (m,)."""
        return self.value - self._width

    @property
    def high(self) -> np.ndarray:
        """Upper edge of the confidence band of the m values, shape (m,)."""
        return self.value + self._width

    @property
    def _width(self) -> np.ndarray:
        """Half width of the confidence band of the m values, shape (m,)."""
        from scipy.stats import norm
        return norm.ppf((1 + self.confidence) / 2) * self.deviation

    def plot(self, axes: Any = None, **options: Any) -> Any:
        """Draw the values of the output quantity and their confidence band over `coordinates`.

        Args:
            axes: matplotlib axes; default a new figure.
            options: options of the line for matplotlib's `plot`.

        Returns:
            The matplotlib axes.
        """
        if axes is None:
            from ...figures import figure
            axes = figure(width=7)[1]
        line, = axes.plot(self.coordinates, self.value, **options)
        axes.fill_between(self.coordinates, self.low, self.high, color=line.get_color(), alpha=0.2, linewidth=0,
                          label=f"{100 * self.confidence:g} % band")
        axes.set(xlabel="reference length" if self.measure == "wall" else "", ylabel=self.measure)
        axes.legend()
        return axes

    def __str__(self) -> str:
        rows = np.unique(np.linspace(0, len(self.value) - 1, min(len(self.value), 12)).round().astype(int))
        lines = [f"{'at':>10}{self.measure[:11]:>12}{'deviation':>12}{'lowest':>12}{'highest':>12}"]
        lines += [f"{self.coordinates[k]:10.4g}{self.value[k]:12.5g}{self.deviation[k]:12.3g}{self.low[k]:12.5g}"
                  f"{self.high[k]:12.5g}" for k in rows]
        return "\n".join(lines)

    __repr__ = __str__


def covariance_of(caller: str, parameters: Parameters, given: Any) -> np.ndarray:
    """Return the covariance, shape (n, n), of the parameters of a design; each knot of a profile counts as one.

    `given` is {parameter: standard deviation}, a `Fit`, a `Confidence`, or a list of such, independent of each other.
    Unknown names and undetermined constants are an InputError.
    """
    found = np.zeros((len(parameters), len(parameters)))
    for part in given if isinstance(given, list | tuple) and not hasattr(given, "covariance") else [given]:
        if isinstance(part, Mapping):
            for name, size in part.items():
                numbers = [k for k, entry in enumerate(parameters.names)
                           if entry == name or entry.startswith(f"{name}[")]
                if not numbers:
                    raise _unknown(caller, name, parameters)
                found[numbers, numbers] += non_negative(f"{caller}: {name}", size) ** 2
        elif hasattr(part, "covariance"):
            names = list(part.constants if hasattr(part, "constants") else part.names)
            for name in names:
                if name not in parameters.names:
                    raise _unknown(caller, name, parameters)
            undetermined = [name for name, row in zip(names, part.covariance) if not np.all(np.isfinite(row))]
            if undetermined:
                raise InputError(f"{caller}: the tests of this fit leave {', '.join(undetermined)} open: no deviation"
                                 f" is known; fit it to more points than it has constants, or a law with fewer"
                                 f" constants")
            numbers = [parameters.names.index(name) for name in names]
            found[np.ix_(numbers, numbers)] += part.covariance
        else:
            raise InputError(f"{caller}: {part!r}: must be {{parameter: standard deviation}}, a Fit, a Confidence, or a"
                             f" list of these")
    return found


def band(run: Any, given: Any, measure: Any, confidence: float) -> Band:
    """Return an output quantity of a run with its confidence band, to first order; arguments as in `DesignRun`."""
    confidence = fraction("band: confidence", confidence)
    effects = run.sensitivities(measure)
    deviation = deviations(effects.jacobian, covariance_of("band", run.parameters, given))
    return Band(effects.measure, effects.coordinates, effects.value, deviation, confidence)


def deviations(jacobian: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return standard deviations (m,) of values from their derivatives (m, n) and the covariance (n, n)."""
    return np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", jacobian, covariance, jacobian), 0.0))


def _unknown(caller: str, name: Any, parameters: Parameters) -> InputError:
    """Return the InputError for an unknown parameter, whose message lists the known ones."""
    known = dict.fromkeys(entry.partition("[")[0] for entry in parameters.names)
    return InputError(f"{caller}: parameter {name!r} is not known; known: {', '.join(known)}")
