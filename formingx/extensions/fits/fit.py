"""Fit of the constants of a material to tests."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, file_path
from ...figures import Axes
from ...findings import percent
from ...materials.material import Material
from ...materials.relaxing import GeneralisedMaxwell
from ...values.intervals import t_intervals
from .fit_in_time import TimedTest, fit_timed_tests
from .fit_plot import draw_fit
from .measured import read_tests
from .points import Points
from .tested import MeasuredRange
from .uncertainty import Uncertainty, uncertainty
from .weights import numbered_weights

_FIRST_EVALUATIONS = 20
"""Largest number of evaluations of the residual from each first guess."""


IN_TIME: list[tuple[type, Callable]] = [(GeneralisedMaxwell, fit_timed_tests)]
"""Classes of materials that are fitted to tests in time, each with the function that fits it."""


class Fit(NamedTuple):
    """Result of `fit`; its text is a summary.

    The misfit is the computed minus the measured nominal stress. Tests in time are numbered.

    Attributes:
        material: the material with the fitted constants, in the unit of stress of the tests. Its attribute `tested`
            stores the range of the tests; runs warn of deformations beyond it.
        constants: {constant: value} of the p fitted constants.
        rms: {test: root mean square of the misfit}, stress.
        rms_total: root mean square of the misfit over the points of all tests, stress.
        deviations: {test: root mean square of the misfit over the measured stress}. Stresses below 2 % of the largest
            stress of the test count as these 2 %.
        errors: {constant: standard error}; nan if there are no more points than constants, infinite for a constant
            without effect on the stresses.
        undetermined: names of the constants whose standard error exceeds half of their value. This error is computed
            for a noise of 1 % of the stress, or for the misfit if that is larger.
        covariance: covariance of the constants, shape (p, p), in the order of `constants`.
        points: number of measured stresses.
        data: the tests, as they were given to `fit`.
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
        """Return the confidence interval of each constant by Student's t distribution.

        The intervals hold if the stresses are linear in the constants.

        Args:
            confidence: confidence level, between 0 and 1.

        Returns:
            {constant: (lowest, highest)}.

        Raises:
            InputError: a confidence outside (0, 1).
        """
        return t_intervals(self.constants, self.errors, self.points, confidence)

    def plot(self, axes: Axes | Sequence[Axes] | None = None, unit: str = "", unit_of_time: str = "s") -> Any:
        """Draw measured and fitted nominal stresses over the stretch, for relaxation tests over the time.

        Args:
            axes: matplotlib axes; a pair if only some tests are relaxation tests, which are drawn on the first.
                Default: a new figure.
            unit: unit of stress, for the label.
            unit_of_time: unit of time, for the label.

        Returns:
            The matplotlib axes.
        """
        return draw_fit(self.material, self.data, axes, unit, unit_of_time)

    def __str__(self) -> str:
        parts = ", ".join(f"{mode} {value:.4g} ({percent(self.deviations[mode])})"
                          for mode, value in self.rms.items())
        undetermined = f"; the data do not determine {', '.join(self.undetermined)}" if self.undetermined else ""
        return f"{self.material}: rms {self.rms_total:.4g} ({parts}){undetermined}"

    def __repr__(self) -> str:
        return str(self)


def fit(material: type[Material] | Material, data: Any, terms: int | None = None, *, relative: bool = True,
        weights: Any = None, within: tuple[float, float] | None = None) -> Fit:
    """Fit the constants of a material to tests by least squares of the nominal stress.

    The fit starts from several first guesses, and the best result counts. All constants are admissible, and no stretch
    of the tests exceeds the limit of the material (Gent, Arruda-Boyce). By default each misfit of a stress is divided
    by the measured stress. With absolute misfits, the fit to Treloar's rubber follows the last points of the uniaxial
    test alone. These constants give a limit pressure of his sheet that is wrong by 12 to 31 %, constants of relative
    misfits by 1 to 16 % (`demos/measured_treloar.py`).

    Args:
        material: a class (`MooneyRivlin`, `Ogden`, ...), or a material whose constants are the first guess. A
            `Hyperelastic` must be given as a material, and so must a `KBKZ` with a damping. Only the damping of a
            `KBKZ` is fitted; `fit_spectrum` fits its spectrum.
        data: {test: (stretches, nominal stresses)}, arrays of shape (n,), for any of "uniaxial", "pure_shear" (planar)
            and "equibiaxial". For "biaxial": (stretches 1, stretches 2, nominal stresses 1, nominal stresses 2); nan
            for a stress that was not measured. The constants get the unit of the stress, force over reference area.
            For a relaxing material: a list of `TimedTest`.
            Or the name of a CSV file with the columns test, stretch, stress (nominal), and for a relaxing material
            time. The columns may be in any order if the first line names them, else in this order. Units in brackets
            are checked, not converted. A test ends where its name changes or the time decreases. A stress that was not
            measured is left empty in a test in time.
        terms: number of terms if `material` is the class `Ogden`, default 3. For a relaxing class it is the number of
            branches, default as many as the tests determine; the equilibrium is then neo-Hookean.
        relative: True: each misfit is divided by the measured stress, or by 2 % of the largest stress of the test if
            that is more. False: misfits in stress, every point with the same weight.
        weights: {test: weight of the squared misfits of its points}; for tests in time a list with the weight of each
            test. Default: 1.
        within: lowest and highest stretch of the points that count, or None for all. In biaxial tests both stretches
            must lie in the range.

    Returns:
        Fitted material, with misfits and uncertainty of the constants.

    Raises:
        InputError: tests with numbers that are not finite, stretches that are not positive, arrays of different length,
            fewer points than constants, or no strain at all. Also an unknown test, stresses whose sign differs from the
            sign of the strains, or stretches beyond every admissible limit.

    >>> stretch = np.array([1.2, 1.6, 2.0])
    >>> found = fx.fit(fx.MooneyRivlin, {"uniaxial": (stretch, 2 * (stretch - stretch**-2) * (0.2 + 0.05 / stretch))})
    >>> {name: round(value, 6) for name, value in found.material.parameters.items()}
    {'c10': 0.2, 'c01': 0.05}
    """
    for kind, fitted in IN_TIME:
        if isinstance(material, kind) or isinstance(material, type) and issubclass(material, kind):
            return _fit_timed(fitted, material, data, terms, relative, weights, within)
    points = Points(_tests(data) if isinstance(data, str | os.PathLike) else data, relative, weights, within)
    best, found = _fit_elastic(material, points, terms)
    misfit = points.stress(best.response, best.parameters.values()) - points.measured
    return _result(best, dict(best.parameters), points.parts, misfit, points.measured, found,
                   MeasuredRange.from_stretches(points.stretches_of, found.undetermined), points.data)


def _fit_timed(fitted: Callable, material: Any, data: Any, terms: int | None, relative: bool, weights: Any,
             within: Any) -> Fit:
    """Fit a relaxing material to tests in time, and return the result.

    Args:
        fitted: function that fits the constants of materials of this class.
        material: class, or material with initial constants.
        data: list of `TimedTest`, or the name of a CSV file.
        terms: number of branches; None: as many as the tests determine.
        relative: True for misfits over the measured stress, False for misfits in stress.
        weights: weight of each test, or None.
        within: lowest and highest stretch of the points that count, or None.
    """
    tests = _tests_in_time(data) if isinstance(data, str | os.PathLike) else data
    number = len(tests) if isinstance(tests, list | tuple) else 0
    relaxing, constants, used, found = fitted(material, tests, terms, relative, numbered_weights(weights, number),
                                              within)
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
    strain_rates = np.concatenate(rates)
    strain_rates = strain_rates[strain_rates > 0]
    tested = MeasuredRange.from_stretches(
        {mode: np.concatenate(rows) for mode, rows in stretches.items()}, found.undetermined,
        (float(strain_rates.min()), float(strain_rates.max())) if len(strain_rates) else None)
    return _result(relaxing, constants, parts, np.concatenate(misfits), np.concatenate(measured), found, tested, tests)


def _result(material: Any, constants: dict[str, float], parts: dict[str, slice], misfit: np.ndarray,
            measured: np.ndarray, found: Uncertainty, tested: MeasuredRange, data: Any) -> Fit:
    """Return the `Fit` with a copy of a fitted material that stores the range of its tests, and with its misfits.

    Args:
        material: material with the fitted constants.
        constants: {constant: value} of the fitted constants.
        parts: {test: slice of its points in `misfit` and `measured`}.
        misfit: computed minus measured stress at all m points, shape (m,).
        measured: measured stress at all points, shape (m,).
        found: uncertainty of the constants.
        tested: range of the tests.
        data: the tests, as they were given to `fit`.
    """
    fitted_material = copy.copy(material)
    fitted_material.tested = tested
    deviations = {name: _rms(misfit[part] / np.maximum(abs(measured[part]), 0.02 * abs(measured[part]).max()))
                  for name, part in parts.items()}
    rms = {name: _rms(misfit[part]) for name, part in parts.items()}
    return Fit(fitted_material, constants, rms, _rms(misfit), deviations, found.errors, found.undetermined,
               found.covariance, len(misfit), data)


def _fit_elastic(material: Any, points: Points, terms: int | None) -> tuple[Material, Uncertainty]:
    """Fit a material to elastic tests, which state no times; return it with the uncertainty of its constants.

    Args:
        material: class, or material with initial constants.
        points: measured stresses of all tests.
        terms: number of terms of the class `Ogden`, or None.

    Raises:
        InputError: fewer points than constants, or no finite stress at some stretch of the tests.
    """
    from scipy.optimize import least_squares
    guesses = _guesses(material, points, terms)
    response, n, measured = guesses[0].response, len(guesses[0].parameters), points.measured
    if len(measured) < n:
        raise InputError(f"fit: {len(measured)} points cannot fix the {n} constants of {type(guesses[0]).__name__}")

    def refined(guess: Material, start: Any, evaluations: int | None) -> tuple[float, Material, np.ndarray]:
        """Return (cost, guess, fitted coordinates of the constants) after a least-squares fit.

        The cost is infinite if the stress of the guess is not finite at some stretch.

        Args:
            guess: material whose class and coordinates are fitted.
            start: coordinates of the constants from which the fit starts, shape (constants,).
            evaluations: largest number of evaluations of the stresses; None: 100 for each constant.
        """
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
        """Return the first element of a result of `refined`, its cost, to sort by it."""
        return trial[0]

    trials = sorted((refined(g, [x for x, *_ in g.coordinates()], _FIRST_EVALUATIONS) for g in guesses), key=cost)
    lowest_cost, guess, x = min((refined(g, x, None) for _, g, x in trials[:3]), key=cost)
    if not np.isfinite(lowest_cost):
        raise InputError(f"fit: {guess} has no finite stress at some stretch of the data: start with constants whose"
                         f" limit lies beyond them")
    best = guess.with_constants(guess.constants_at(x))
    return best, uncertainty(lambda x: points.stress(response, x), best.parameters, measured, points.sizes)


def _tests(file: Any) -> dict[str, tuple[np.ndarray, ...]]:
    """Return {test: (stretches, stresses)} of a CSV file without times.

    Raises:
        InputError: the file has a fourth column with the time.
    """
    found: dict[str, list] = {}
    for mode, columns in read_tests(file_path("fit: data", file)):
        if len(columns) != 2:
            raise InputError(f"fit: data: {file}: has times; a material that does not relax has none: leave the column"
                             f" out")
        found.setdefault(mode, []).append(columns)
    return {mode: tuple(np.hstack(parts)) for mode, parts in found.items()}


def _tests_in_time(file: Any) -> list[TimedTest]:
    """Return the tests in time of a CSV file.

    Raises:
        InputError: the file has no fourth column with the time.
    """
    tests = read_tests(file_path("fit: data", file))
    if any(len(columns) != 3 for _, columns in tests):
        raise InputError(f"fit: data: {file}: has no times: a material that relaxes needs a fourth column with"
                         f" the time")
    return [TimedTest(mode, times, stretches, stress) for mode, (stretches, stress, times) in tests]


def _guesses(material: Any, points: Points, terms: int | None) -> list[Material]:
    """Return materials with the constants from which a fit starts.

    Args:
        material: class, or material with initial constants.
        points: measured stresses of all tests.
        terms: number of terms of the class `Ogden`, or None.

    Raises:
        InputError: no material, terms that it does not have, or stresses whose sign differs from the strains.
    """
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
