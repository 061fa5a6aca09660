"""Fit of the constants of a material to tests."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, finite, place
from ...figures import Axes
from ...materials.material import Material
from ...materials.relaxing import RelaxingMaterial
from .fit_in_time import TimedTest, fitted_in_time
from .fit_plot import plotted
from .measured import read_tests
from .points import Points
from .tested import MeasuredRange
from .uncertainty import Uncertainty, uncertainty
from .weights import of_numbers

_FIRST = 20
"""Evaluations for every first guess."""

_LAST = 400
"""Evaluations for the best three."""

IN_TIME: list[tuple[type, Callable]] = [(RelaxingMaterial, fitted_in_time)]
"""Kinds of material that are fitted to tests in time, each with its function."""


class Fit(NamedTuple):
    """Result of a fit.

    Attributes:
        material: the material with the fitted constants, in the data's unit of stress. Its `tested` is the range of the
            tests; runs warn of deformations beyond it.
        constants: {name: value} of the fitted constants.
        rms: {test: root mean square of the nominal stress' misfit}, stress; tests in time are numbered.
        rms_total: the same over all points.
        deviations: {test: root mean square of the misfit over the measured stress}; stresses below 2 % of the test's
            largest count as these 2 %.
        errors: {constant: its standard error}, see `uncertainty`.
        undetermined: names of the constants whose standard error exceeds half of their value. The error is computed for
            a noise of 1 % of the stress, or for the misfit if that is larger.
        covariance: of the constants, shape (p, p), in the order of `constants`.
        points: number of measured stresses.
        data: the tests, as `fit` takes them.
    """

    material: Material
    constants: dict[str, float]
    rms: dict[str, float]
    rms_total: float
    deviations: dict[str, float]
    errors: dict[str, float]
    undetermined: tuple[str, ...]
    covariance: np.ndarray
    points: int
    data: Any

    def intervals(self, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return {constant: (lowest, highest)} by Student's t distribution, for stresses linear in the constants.

        Args:
            confidence: confidence level, between 0 and 1.

        Returns:
            {constant: (lowest, highest)}.

        Raises:
            InputError: a confidence outside (0, 1).
        """
        from scipy.stats import t
        if not 0 < (confidence := finite("intervals: confidence", confidence)) < 1:
            raise InputError(f"intervals: confidence = {confidence!r}: must be between 0 and 1")
        width = t.ppf((1 + confidence) / 2, max(self.points - len(self.errors), 1))
        return {name: (value - width * self.errors[name], value + width * self.errors[name])
                for name, value in self.constants.items()}

    def plot(self, axes: Axes | Sequence[Axes] | None = None, unit: str = "", unit_of_time: str = "s") -> Any:
        """Draw the data and the material's nominal stress against stretch, of relaxation tests against time.

        Args:
            axes: matplotlib axes; a pair if only some of the tests are relaxation tests; default a new figure.
            unit: unit of stress, for the label.
            unit_of_time: unit of time, for the label.

        Returns:
            The matplotlib axes.
        """
        return plotted(self.material, self.data, axes, unit, unit_of_time)

    def __str__(self) -> str:
        parts = ", ".join(f"{mode} {value:.4g} ({100 * self.deviations[mode]:.2g} %)"
                          for mode, value in self.rms.items())
        open_ = f"; the data do not determine {', '.join(self.undetermined)}" if self.undetermined else ""
        return f"{self.material}: rms {self.rms_total:.4g} ({parts}){open_}"

    def __repr__(self) -> str:
        return str(self)


def fit(material: type[Material] | Material, data: Any, terms: int | None = None, *, relative: bool = True,
        weights: Any = None, within: tuple[float, float] | None = None) -> Fit:
    """Fit the constants of a material to tests by least squares of the nominal stress.

    From several first guesses the best result counts. The constants stay admissible, and no step leaves a material's
    limit (Gent, Arruda-Boyce). A misfit counts relative to the measured stress. For Treloar's rubber an absolute misfit
    weighs the last points of the uniaxial test alone. Its constants miss the limit pressure of his sheet by 12 to 31 %,
    constants of a relative misfit by 1 to 16 % (`demos/measured_treloar.py`).

    Args:
        material: a class (`MooneyRivlin`, `Ogden`, ...), or a material whose constants are the first guess: a
            `Hyperelastic` must be given so. A `KBKZ` with a damping is given so too: the damping is fitted, and its
            spectrum stays (see `fit_spectrum`).
        data: {test: (stretch, nominal stress)}, each of shape (n,), for any of "uniaxial", "pure_shear" (planar) and
            "equibiaxial". For "biaxial" it is (stretch 1, stretch 2, nominal stress 1, nominal stress 2); a stress that
            was not measured is nan. Force over reference area, in any unit: the constants get the same.
            For a material that relaxes: a list of `TimedTest`.
            Or the name of a CSV file (see `csv_files.records`) with the columns test, stretch, stress (nominal), in any
            order if the first line names them, else in this order. Units in brackets are checked, not converted. A file
            for a relaxing material has a column with the time; each test begins where the time decreases. Its rows are
            as in `TimedTest`; a stress that was not measured is left empty.
        terms: number of terms if `material` is the class `Ogden`, default 3. For a relaxing class it is the number of
            branches, default as many as the data determine; the equilibrium is then neo-Hookean.
        relative: True: misfits over the measured stress, or over 2 % of the test's largest if that is more. False:
            misfits in stress, every point with the same weight.
        weights: {test: weight} of the squared misfits of its points, or for tests in time one number each; default 1.
        within: (lowest, highest): only points at such stretches count; of biaxial tests both stretches.

    Returns:
        The `Fit`.

    Raises:
        InputError: data that are not finite, stretches that are not positive, arrays of different length, fewer points
            than constants, or no strain at all. Also an unknown test, stresses whose sign differs from the sign of the
            strains, or stretches beyond every admissible limit.

    >>> stretch = np.array([1.2, 1.6, 2.0])
    >>> found = fx.fit(fx.MooneyRivlin, {"uniaxial": (stretch, 2 * (stretch - stretch**-2) * (0.2 + 0.05 / stretch))})
    >>> {name: round(value, 6) for name, value in found.material.parameters.items()}
    {'c10': 0.2, 'c01': 0.05}
    """
    for kind, fitted in IN_TIME:
        if isinstance(material, kind) or isinstance(material, type) and issubclass(material, kind):
            return _of_time(fitted, material, data, terms, relative, weights, within)
    points = Points(_tests(data) if isinstance(data, str | os.PathLike) else data, relative, weights, within)
    best, found = _fitted(material, points, terms)
    misfit = points.stress(best.response, best.parameters.values()) - points.measured
    return _result(best, dict(best.parameters), points.parts, misfit, points.measured, found,
                   MeasuredRange.of(points.stretches_of, found.undetermined), points.data)


def _of_time(fitted: Callable, material: Any, data: Any, terms: int | None, relative: bool, weights: Any,
             within: Any) -> Fit:
    """Return the fit of a material that relaxes."""
    tests = _tests_in_time(data) if isinstance(data, str | os.PathLike) else data
    many = len(tests) if isinstance(tests, list | tuple) else 0
    relaxing, constants, used, found = fitted(material, tests, terms, relative, of_numbers(weights, many), within)
    misfits, measured, parts, n = [], [], {}, 0
    stretches: dict[str, list] = {}
    rates = []
    for i, test in enumerate(used, 1):
        given = np.isfinite(test.stress)
        computed = relaxing.stress(test.mode, test.stretches, times=test.times, between=test.between)
        misfits.append((computed - test.stress)[given])
        measured.append(test.stress[given])
        parts[f"{i} {test.mode}"] = slice(n, n := n + int(given.sum()))
        stretches.setdefault(test.mode, []).append(test.stretches[given])
        steps = np.diff(test.times)
        rates.append(np.abs(np.diff(np.log(test.stretches)))[steps > 0] / steps[steps > 0])
    moved = np.concatenate(rates)
    moved = moved[moved > 0]
    tested = MeasuredRange.of({mode: np.concatenate(rows) for mode, rows in stretches.items()}, found.undetermined,
                              (float(moved.min()), float(moved.max())) if len(moved) else None)
    return _result(relaxing, constants, parts, np.concatenate(misfits), np.concatenate(measured), found, tested, tests)


def _result(material: Any, constants: dict[str, float], parts: dict[str, slice], misfit: np.ndarray,
            measured: np.ndarray, found: Uncertainty, tested: MeasuredRange, data: Any) -> Fit:
    """Return the result of a fit from its misfits."""
    card = copy.copy(material)
    card.tested = tested
    deviations = {name: _rms(misfit[part] / np.maximum(abs(measured[part]), 0.02 * abs(measured[part]).max()))
                  for name, part in parts.items()}
    return Fit(card, constants, {name: _rms(misfit[part]) for name, part in parts.items()}, _rms(misfit), deviations,
               found.errors, found.undetermined, found.covariance, len(misfit), data)


def _fitted(material: Any, points: Points, terms: int | None) -> tuple[Material, Uncertainty]:
    """Return (the material, the uncertainty of its constants)."""
    from scipy.optimize import least_squares
    guesses = _guesses(material, points, terms)
    response, n, measured = guesses[0].response, len(guesses[0].parameters), points.measured
    if len(measured) < n:
        raise InputError(f"fit: {len(measured)} points cannot fix the {n} constants of {type(guesses[0]).__name__}")

    def refined(guess: Material, start: Any, evaluations: int) -> tuple[float, Material, np.ndarray]:
        """Return (cost, guess, coordinates) after this number of evaluations; the cost is infinite where stress is."""
        low, high = np.array([bounds for _, *bounds in guess.coordinates()]).T

        def residual(x):
            return (points.stress(response, guess.constants_at(x)) - measured) / points.sizes

        start = np.clip(start, low + 1e-9 * np.abs(start), high - 1e-9 * np.abs(start))
        if not np.all(np.isfinite(residual(start))):
            return np.inf, guess, start
        # a step to where the stress is not finite is shortened by least_squares itself
        found = least_squares(residual, start, bounds=(low, high), x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12,
                              max_nfev=evaluations)
        return found.cost, guess, found.x

    def cost(trial: tuple) -> float:
        """Return the cost of a trial, for sorting."""
        return trial[0]

    trials = sorted((refined(g, [x for x, *_ in g.coordinates()], _FIRST) for g in guesses), key=cost)
    least, guess, x = min((refined(g, x, _LAST) for _, g, x in trials[:3]), key=cost)
    if not np.isfinite(least):
        raise InputError(f"fit: {guess} has no finite stress at some stretch of the data: start with constants whose"
                         f" limit lies beyond them")
    best = guess.with_constants(guess.constants_at(x))
    return best, uncertainty(lambda x: points.stress(response, x), best.parameters, measured, points.sizes)


def _tests(file: Any) -> dict[str, tuple[np.ndarray, ...]]:
    """Return {test: (stretch, stress)} of a file.

    Raises:
        InputError: a fourth column, the time: the material does not relax.
    """
    found: dict[str, list] = {}
    for mode, columns in read_tests(place("fit: data", file)):
        if len(columns) != 2:
            raise InputError(f"fit: data: {file}: has times; a material that does not relax has none: leave the column"
                             f" out")
        found.setdefault(mode, []).append(columns)
    return {mode: tuple(np.hstack(parts)) for mode, parts in found.items()}


def _tests_in_time(file: Any) -> list[TimedTest]:
    """Return the tests in time of a file."""
    tests = read_tests(place("fit: data", file))
    if any(len(columns) != 3 for _, columns in tests):
        raise InputError(f"fit: data: {file}: has no times: a material that relaxes needs a fourth column with"
                         f" the time")
    return [TimedTest(mode, times, stretches, stress) for mode, (stretches, stress, times) in tests]


def _guesses(material: Any, points: Points, terms: int | None) -> list[Material]:
    """Return the initial materials of a fit."""
    if isinstance(material, Material):
        if terms is not None:
            raise InputError(f"fit: terms = {terms!r} is for the class Ogden; {material} has its terms already")
        return [material]
    if not (isinstance(material, type) and issubclass(material, Material)):
        raise InputError(f"fit: {material!r}: must be a formingx material or its class")
    if terms is not None and material.__name__ != "Ogden":
        raise InputError(f"fit: terms = {terms!r}: {material.__name__} has no terms to count, only Ogden has")
    modulus = points.modulus()
    if not modulus > 0:
        raise InputError("fit: the stresses do not have the sign of the strains in most points: tension is positive,"
                         " stretch is length over first length. A column of strain is given as 1 + strain")
    return material.guesses(modulus, points.largest_I1, terms)


def _rms(values: np.ndarray) -> float:
    """Return the root mean square of values."""
    return float(np.sqrt(np.mean(values**2)))
