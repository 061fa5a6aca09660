"""Constants of a material from tests."""

import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, finite, known, place
from ...figures import Axes
from ...materials import homogeneous
from ...materials.material import Material
from ...materials.viscoelastic import RelaxingMaterial
from .fit_in_time import TimedTest, fitted_in_time
from .fit_plot import plotted
from .measured import read_tests
from .uncertainty import uncertainty

_FIRST = 20
"""Evaluations for every first guess."""

_LAST = 400
"""And then for the best three."""


class Fit(NamedTuple):
    """What a fit found.

    Args:
        material: the material with the fitted constants, in the data's unit of stress.
        rms: {test: root mean square of the nominal stress' residual}, same unit; tests in time are numbered.
        rms_total: the same over all points of all tests: what was made small.
        errors: {constant: its standard error}, from the misfit and the derivatives at the optimum; see `uncertainty`.
        undetermined: the names of the constants that the tests leave open: with a noise of 1 % of the largest stress,
            or with the misfit if that is more, the standard error is above half of the constant.
        points: number of measured stresses.
        data: the tests, as `fit` takes them.
    """

    material: Material
    rms: dict[str, float]
    rms_total: float
    errors: dict[str, float]
    undetermined: tuple[str, ...]
    points: int
    data: Any

    def intervals(self, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """{constant: (lowest, highest)} by Student's t, as if the stresses were linear in the constants."""
        from scipy.stats import t
        if not 0 < (confidence := finite("intervals: confidence", confidence)) < 1:
            raise InputError(f"intervals: confidence = {confidence!r}: must be between 0 and 1")
        width = t.ppf((1 + confidence) / 2, max(self.points - len(self.errors), 1))
        return {name: (value - width * self.errors[name], value + width * self.errors[name])
                for name, value in self.material.parameters.items()}

    def plot(self, axes: Axes | Sequence[Axes] | None = None, unit: str = "", unit_of_time: str = "s") -> Any:
        """Draw the data and the material's nominal stress against stretch (held tests: time); returns the axes.

        With tests that are held and tests that are not, two axes are needed: `axes` is then a pair of them.
        """
        return plotted(self.material, self.data, axes, unit, unit_of_time)

    def __str__(self) -> str:
        parts = ", ".join(f"{mode} {value:.4g}" for mode, value in self.rms.items())
        open_ = f"; the data do not determine {', '.join(self.undetermined)}" if self.undetermined else ""
        return f"{self.material}: rms {self.rms_total:.4g} ({parts}){open_}"

    def __repr__(self) -> str:
        return str(self)


def fit(material: type[Material] | Material, data: Any, terms: int | None = None) -> Fit:
    """Fit the constants of a material to tests, all points of all tests with the same weight.

    Least squares of the nominal stress, from several first guesses, of which the best result counts. The constants
    stay admissible, and no step leaves a material's limit (Gent, Arruda-Boyce).

    Args:
        material: a class (`MooneyRivlin`, `Ogden`, ...), or a material whose constants are the first guess: a
            `Hyperelastic` must be given so.
        data: {test: (stretch, nominal stress)}, each of shape (n,), for any of "uniaxial", "pure_shear" (planar)
            and "equibiaxial". Force over reference area, in any unit: the constants get the same.
            For a material that relaxes: a list of `TimedTest`.
            Or the name of a CSV file (see `csv_files.records`) with the columns test, stretch, stress (nominal), in any
            order if the first line names them (units in brackets are checked, not converted), else in this order; for a
            material that relaxes a column with the time, in which each test begins where the time falls (rows as of
            `TimedTest`, a stress that was not measured left empty).
        terms: number of terms if `material` is the class `Ogden`, default 3; number of branches if it is one that
            relaxes (its equilibrium is then neo-Hookean), default as many as the data determine.

    Raises:
        InputError: data that are not finite, not positive stretches, of different length, fewer than the constants,
            all at stretch 1, stresses or stretches that are no test's, or beyond every
            admissible limit.

    >>> stretch = np.array([1.2, 1.6, 2.0])
    >>> found = fx.fit(fx.MooneyRivlin, {"uniaxial": (stretch, 2 * (stretch - stretch**-2) * (0.2 + 0.05 / stretch))})
    >>> {name: round(value, 6) for name, value in found.material.parameters.items()}
    {'c10': 0.2, 'c01': 0.05}
    """
    if isinstance(material, RelaxingMaterial) or isinstance(material, type) and issubclass(material, RelaxingMaterial):
        tests = _tests_in_time(data) if isinstance(data, str | os.PathLike) else data
        relaxing, misfits, errors, undetermined = fitted_in_time(material, tests, terms)
        numbered = {f"{i} {test.mode}": _rms(m) for i, (test, m) in enumerate(zip(tests, misfits), 1)}
        every = np.concatenate(misfits)
        return Fit(relaxing, numbered, _rms(every), errors, undetermined, len(every), tests)
    tests = _tests(data) if isinstance(data, str | os.PathLike) else data
    best, misfit, parts, (errors, undetermined) = _fitted(material, tests, terms)
    rms = {mode: _rms(misfit[part]) for mode, part in parts.items()}
    return Fit(best, rms, _rms(misfit), errors, undetermined, len(misfit), tests)


def _fitted(material: Any, data: Any, terms: int | None) -> tuple[Material, np.ndarray, dict[str, slice], tuple]:
    """(the material, misfits of all points, where each test is in them, errors and what is open)."""
    from scipy.optimize import least_squares
    stretches, measured, parts = _checked(data)
    guesses = _guesses(material, stretches, measured, terms)
    response, n = guesses[0].response, len(guesses[0].parameters)
    if len(measured) < n:
        raise InputError(f"fit: {len(measured)} points cannot fix the {n} constants of {type(guesses[0]).__name__}")
    scale = np.abs(measured).max()

    def refined(guess: Material, start: Any, evaluations: int) -> tuple[float, Material, np.ndarray]:
        """(cost, guess, coordinates) after so many evaluations; the cost is infinite where the stress is."""
        low, high = np.array([bounds for _, *bounds in guess.coordinates()]).T

        def residual(x):
            return (response.stress(stretches, guess.constants_at(x))[0] - measured) / scale

        start = np.clip(start, low + 1e-9 * np.abs(start), high - 1e-9 * np.abs(start))
        if not np.all(np.isfinite(residual(start))):
            return np.inf, guess, start
        # a step to where the stress is not finite is shortened by least_squares itself
        found = least_squares(residual, start, bounds=(low, high), x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12,
                              max_nfev=evaluations)
        return found.cost, guess, found.x

    def cost(trial: tuple) -> float:
        return trial[0]

    trials = sorted((refined(g, [x for x, *_ in g.coordinates()], _FIRST) for g in guesses), key=cost)
    least, guess, x = min((refined(g, x, _LAST) for _, g, x in trials[:3]), key=cost)
    if not np.isfinite(least):
        raise InputError(f"fit: {guess} has no finite stress at some stretch of the data: start with constants whose"
                         f" limit lies beyond them")
    best = guess.with_constants(guess.constants_at(x))
    misfit = response.stress(stretches, best.parameters.values())[0] - measured
    return best, misfit, parts, uncertainty(lambda x: response.stress(stretches, x)[0], best.parameters, measured)


def _tests(file: Any) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{test: (stretch, stress)} of a file; a fourth column is not for a material without time."""
    found: dict[str, list] = {}
    for mode, columns in read_tests(place("fit: data", file)):
        if len(columns) != 2:
            raise InputError(f"fit: data: {file}: has times; a material that does not relax has none: leave the column"
                             f" out")
        found.setdefault(mode, []).append(columns)
    return {mode: tuple(np.hstack(parts)) for mode, parts in found.items()}


def _tests_in_time(file: Any) -> list[TimedTest]:
    tests = read_tests(place("fit: data", file))
    if any(len(columns) != 3 for _, columns in tests):
        raise InputError(f"fit: data: {file}: has no times: a material that relaxes needs a fourth column with"
                         f" the time")
    return [TimedTest(mode, times, stretches, stress) for mode, (stretches, stress, times) in tests]


def _guesses(material: Any, stretches: np.ndarray, measured: np.ndarray, terms: int | None) -> list[Material]:
    l1, l2 = stretches
    if isinstance(material, Material):
        if terms is not None:
            raise InputError(f"fit: terms = {terms!r} is for the class Ogden; {material} has its terms already")
        return [material]
    if not (isinstance(material, type) and issubclass(material, Material)):
        raise InputError(f"fit: {material!r}: must be a formingx material or its class")
    if terms is not None and material.__name__ != "Ogden":
        raise InputError(f"fit: terms = {terms!r}: {material.__name__} has no terms to count, only Ogden has")
    I1 = l1**2 + l2**2 + (l1 * l2) ** -2
    shape = l1 - 1 / (l1**3 * l2**2)                        # neo-Hookean stress over its modulus
    modulus = float(np.median(measured[shape != 0] / shape[shape != 0]))
    if not modulus > 0:
        raise InputError("fit: the stresses do not have the sign of the strains in most points: tension is positive,"
                         " stretch is length over first length")
    return material.guesses(modulus, float(I1.max()), terms)


def _checked(data: Any) -> tuple[np.ndarray, np.ndarray, dict[str, slice]]:
    """Stretches (2, n) and stresses (n,) of all tests, and where each test is."""
    if not isinstance(data, dict) or not data:
        raise InputError(f"fit: data = {data!r}: must be {{test: (stretch, nominal stress)}}")
    stretches, stresses, parts, n = [], [], {}, 0
    for mode, columns in data.items():
        known("fit: data: test", mode, homogeneous.MODES)
        try:
            l, P = (np.asarray(x, float) for x in columns)
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"fit: data[{mode!r}]: must be (stretch, nominal stress), numbers") from None
        if l.ndim != 1 or l.shape != P.shape or not len(l):
            raise InputError(f"fit: data[{mode!r}]: stretch has the shape {l.shape}, stress {P.shape}: must be (n,),"
                             f" the same for both")
        for i in np.flatnonzero(~(np.isfinite(l) & np.isfinite(P) & (l > 0)))[:1]:
            raise InputError(f"fit: data[{mode!r}], point {i}: stretch = {l[i]}, stress = {P[i]}: must be finite,"
                             f" and the stretch greater than 0")
        for i in np.flatnonzero((l < 1e-3) | (l > 1e3))[:1]:
            raise InputError(f"fit: data[{mode!r}], point {i}: stretch = {l[i]}: must be from 0.001 to 1000")
        stretches.append(homogeneous.along(mode, l))
        stresses.append(P)
        parts[mode] = slice(n, n := n + len(l))
    l = np.concatenate(stretches, axis=1)
    if np.all(l[0] == 1):
        raise InputError("fit: data: every stretch is 1: nothing is strained")
    largest = max(np.abs(P).max() for P in stresses)
    if not 1e-50 <= largest <= 1e50:
        raise InputError(f"fit: data: the largest stress is {largest:g}: must be from 1e-50 to 1e50: use another unit")
    return l, np.concatenate(stresses), parts


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
