"""Time-temperature superposition: tests of a relaxing material at several temperatures, and the shift between them.

A test at the temperature T with the times t equals a test at the reference temperature with the times t/aT. The moduli
are the same at all temperatures. The shift and the constants of the material minimise the misfit of all tests together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np

from ...errors import InputError, check_name
from ...materials.relaxing import GeneralisedMaxwell
from ...values.table import Table
from ...values.temperature import ABSOLUTE_ZERO, GAS_CONSTANT, WLF, Arrhenius
from .fit_in_time import ShiftedTests, checked_tests
from .rows import at_reference
from .uncertainty import Uncertainty, uncertainty

SHIFTS = ("WLF", "Arrhenius", "table")
_EVALUATIONS = 60
"""Largest number of fits of a spectrum for each unknown of the shift, and once more, in the search for the shift."""

_POLISHING = 100
"""Largest number of steps of the last fit of all constants together."""

_MOST_DECADES = 12
"""Largest magnitude of log10 aT in the search."""


class _ShiftLaw(NamedTuple):
    """Shift law with p unknowns.

    Attributes:
        names: names of its constants, p entries.
        start: values from which the search starts, shape (p,).
        factors: function of the unknowns, shape (p,), that returns log10 aT at the temperatures of the tests, shape
            (n,).
        constants: function of the unknowns that returns the constants, shape (p,).
        law: function of the unknowns that returns the shift as a function of the temperature.
    """

    names: list[str]
    start: np.ndarray
    factors: Callable[[np.ndarray], np.ndarray]
    constants: Callable[[np.ndarray], np.ndarray]
    law: Callable[[np.ndarray], Any]


class ShiftedFit(NamedTuple):
    """Fit of tests at several temperatures.

    Attributes:
        material: the material with its shift.
        shift: the shift aT(T).
        constants: {constant: value} of the material at the reference temperature and of the shift.
        tests: the tests with their times and frequencies at the reference temperature.
        uncertainty: uncertainty of all constants.
    """

    material: GeneralisedMaxwell
    shift: Any
    constants: dict[str, float]
    tests: list[Any]
    uncertainty: Uncertainty


def fit_shift(fitted: Callable, material: Any, tests: list[Any], temperatures: np.ndarray, kind: str,
              reference: float, unit: str, terms: int | None, relative: bool, weights: list[float], within: Any
              ) -> ShiftedFit:
    """Fit the constants of a relaxing material and their shift with the temperature.

    `fitted` fits at one temperature; tests have temperatures (n,) in "C" or "K"; the kind is "WLF", "Arrhenius" or
    "table". An unknown shift, or too few temperatures, is an InputError.
    """
    from scipy.optimize import minimize
    check_name("fit: shift", kind, SHIFTS)
    law = _law(kind, np.asarray(temperatures, float), reference, unit)

    def shifted(unknowns: np.ndarray) -> list[Any]:
        """Return the tests with the times and frequencies that they have at the reference temperature."""
        return [at_reference(test, a) for test, a in zip(tests, 10.0 ** law.factors(unknowns))]

    data = ShiftedTests(checked_tests(tests, within), material, relative, weights)

    def misfit(unknowns: np.ndarray) -> float:
        """Return the misfit of the best spectrum for a shift."""
        log_factors = law.factors(unknowns)
        return data.spectrum_misfit(10.0**log_factors) if np.all(np.abs(log_factors) < _MOST_DECADES) else math.inf
    simplex = np.vstack([law.start, law.start + 0.5 * np.eye(len(law.start))])
    found = minimize(misfit, law.start, method="Nelder-Mead", options={
        "maxfev": _EVALUATIONS * (1 + len(law.start)), "xatol": 1e-4, "fatol": 1e-12, "initial_simplex": simplex})
    base = fitted(material, shifted(found.x), terms, relative, weights, within)[0]
    base, unknowns = _polished(base, law, found.x, data)
    return _result(base, law, unknowns, data, checked_tests(shifted(unknowns), within))


def _polished(base: GeneralisedMaxwell, law: _ShiftLaw, unknowns: np.ndarray, data: ShiftedTests
              ) -> tuple[GeneralisedMaxwell, np.ndarray]:
    """Return material and unknowns of the shift after a least-squares fit of all of them together."""
    from scipy.optimize import least_squares
    p, coordinates = len(unknowns), base.coordinates()
    start = np.array([*(x for x, *_ in coordinates), *unknowns], float)
    low, high = (np.array([*(bounds[k] for _, *bounds in coordinates), *[sign * np.inf] * p])
                 for k, sign in ((0, -1), (1, 1)))

    def residual(x: np.ndarray) -> np.ndarray:
        """Return the misfits over their sizes."""
        computed = data.stresses(base, base.constants_at(x[:-p]), 10.0 ** law.factors(x[-p:]))
        return (computed - data.stress) / data.sizes
    start = np.clip(start, low + 1e-9 * np.abs(start), high - 1e-9 * np.abs(start))
    found = least_squares(residual, start, bounds=(low, high), x_scale="jac", max_nfev=_POLISHING)
    if not found.cost < 0.5 * np.sum(residual(start) ** 2):
        return base, unknowns
    return cast(GeneralisedMaxwell, base.with_constants(base.constants_at(found.x[:-p]))), found.x[-p:]


def _result(base: GeneralisedMaxwell, law: _ShiftLaw, unknowns: np.ndarray, data: ShiftedTests,
            used: list[Any]) -> ShiftedFit:
    """Return the fit with the uncertainty of all constants, those of the material and those of the shift together."""
    p, p_base = len(unknowns), len(base.parameters)
    scales = np.maximum(np.abs(unknowns), 0.1)                # the values are 1 + (unknown - its value)/scale

    def stress(values: np.ndarray) -> np.ndarray:
        """Return the stresses of all tests for constants of the material and scaled unknowns."""
        return data.stresses(base, values[:p_base], 10.0 ** law.factors(unknowns + (values[p_base:] - 1) * scales))
    names = [*base.parameters, *(f"unknown {k}" for k in range(p))]
    start = dict(zip(names, [*base.parameters.values(), *np.ones(p)]))
    found = uncertainty(stress, start, data.stress, data.sizes)
    # to the constants of the shift, by their derivatives with respect to the unknowns
    change = np.eye(p_base + p)
    for k in range(p):
        step = 1e-5 * scales[k]
        up, down = (law.constants(unknowns + sign * step * np.eye(p)[k]) for sign in (1, -1))
        change[p_base:, p_base + k] = (up - down) / (2 * step) * scales[k]
    finite = np.where(np.isfinite(found.covariance), found.covariance, 0.0)
    covariance = np.where(np.isfinite(found.covariance), change @ finite @ change.T, found.covariance)
    values = dict(base.parameters) | dict(zip(law.names, map(float, law.constants(unknowns))))
    errors = dict(zip(values, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()))
    undetermined = tuple(name for name in values if name in found.undetermined
                         or name in law.names and errors[name] > 0.5 * abs(values[name]))
    shift = law.law(unknowns)
    material = type(base)(base.equilibrium, list(base.branches), shift=shift)
    slopes = None if found.slopes is None else found.slopes @ np.linalg.inv(change)
    return ShiftedFit(material, shift, values, used, Uncertainty(errors, undetermined, covariance, slopes))


def _law(kind: str, temperatures: np.ndarray, reference: float, unit: str) -> _ShiftLaw:
    """Return the shift law of a kind for tests at given temperatures. Too few temperatures are an InputError."""
    other = sorted({float(T) for T in temperatures if reference != T})
    zero = ABSOLUTE_ZERO[unit]
    if kind == "Arrhenius":
        inverse = 1 / (temperatures - zero) - 1 / (reference - zero)

        def energy(x: np.ndarray) -> np.ndarray:
            """Return the activation energy, J/mol."""
            return np.array([1000 + 50e3 * math.exp(x[0])])
        return _ShiftLaw(["activation_energy"], np.array([0.5]),
                         lambda x: energy(x)[0] / GAS_CONSTANT * inverse / math.log(10), energy,
                         lambda x: Arrhenius(float(energy(x)[0]), reference, unit=unit))
    if kind == "table":
        if len(other) < 1:
            raise InputError("fit: shift: the tests have one temperature: a shift needs at least two")
        columns = np.array([[float(t == T) for t in other] for T in temperatures])
        slope = -4e-2                                         # a decade in 25 degrees
        return _ShiftLaw([f"log10_aT({t:g})" for t in other], np.array([slope * (t - reference) for t in other]),
                         lambda x: columns @ x, lambda x: np.asarray(x),
                         lambda x: _LogTable({reference: 0.0} | dict(zip(other, x))))
    if len(other) < 2:
        raise InputError(f"fit: shift: WLF has two constants: tests at {len(other) + 1} temperatures do not determine"
                         f" them; give shift='Arrhenius' or 'table', or tests at a third temperature")
    low = float(reference - temperatures.min())

    def constants(x: np.ndarray) -> np.ndarray:
        """Return c1 and c2, with c2 above the distance from the reference to the lowest temperature."""
        return np.array([10 * math.exp(x[0]), max(low, 0.0) + 50 * math.exp(x[1])])

    def factors(x: np.ndarray) -> np.ndarray:
        """Return log10 aT at the temperatures of the tests."""
        c1, c2 = constants(x)
        return -c1 * (temperatures - reference) / (c2 + temperatures - reference)
    return _ShiftLaw(["c1", "c2"], np.array([-0.3, 0.7]), factors, constants,
                     lambda x: WLF(float(constants(x)[0]), float(constants(x)[1]), reference))


class _LogTable:
    """Shift aT(T) whose logarithm is a smooth curve through {temperature: log10 aT}, constant beyond."""

    def __init__(self, points: dict[float, float]):
        self._table = Table(points)
        self.limits = self._table.limits

    def __call__(self, temperature: Any) -> Any:
        """Return aT at temperatures, of their shape; numbers or a UFL expression."""
        return 10.0 ** self._table(temperature)

    def __repr__(self) -> str:
        return f"shift({{{', '.join(f'{T:g}: {10**y:.4g}' for T, y in zip(self._table.x, self._table.y))}}})"
