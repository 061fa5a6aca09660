"""Fit of the constants of a material to tests."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, check_name, file_path, finite
from ...figures import Axes
from ...findings import percent
from ...materials.constants import OfTemperature
from ...materials.material import Material
from ...materials.relaxing import GeneralisedMaxwell
from ...values.intervals import t_intervals
from ...values.table import table
from ...values.temperature import ABSOLUTE_ZERO
from .fit_in_time import fit_timed_tests
from .fit_plot import draw_fit
from .fit_shift import fit_shift
from .measured import MeasuredOscillation, MeasuredTest, read_tests
from .oscillation import OscillationTest
from .points import Points
from .rows import rows_of
from .tested import MeasuredRange
from .timed_test import TimedTest
from .uncertainty import Uncertainty, uncertainty
from .weights import MIN_DIVISOR, numbered_weights

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
        conversions: what was done to the columns of files, such as "stretch = 1 + strain/100".
        shift: shift of the relaxation times of tests at several temperatures, or None.
        shares: {constant: {test: part of the information on the constant that the test carries, 0 to 1}}, the sum of
            the squared derivatives of its stresses by the constant over that of all tests.
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
    conversions: tuple[str, ...] = ()
    shift: Any = None
    shares: dict[str, Any] = {}

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

        Moduli of oscillations are drawn over the angular frequency.

        Args:
            axes: matplotlib axes, one for each kind of tests: relaxation tests first, then others, then oscillations.
                Default: a new figure.
            unit: unit of stress, for the label.
            unit_of_time: unit of time, for the label.

        Returns:
            The matplotlib axes.
        """
        if isinstance(self.data, dict) and any(not isinstance(name, str) for name in self.data):
            raise InputError("Fit.plot: the fit has a card for each temperature: plot a fit of tests at one of them")
        material: Any = self.material
        if self.shift is not None:                          # the tests have their times at the reference temperature
            material = type(material)(material.equilibrium, [(self.constants[f"mu_{k}"], self.constants[f"tau_{k}"])
                                                             for k in range(1, len(material.branches) + 1)])
        return draw_fit(material, self.data, axes, unit, unit_of_time)

    def __str__(self) -> str:
        parts = ", ".join(f"{mode} {value:.4g} ({percent(self.deviations[mode])})"
                          for mode, value in self.rms.items())
        undetermined = f"; the data do not determine {', '.join(self.undetermined)}" if self.undetermined else ""
        lines = [f"{self.material}: rms {self.rms_total:.4g} ({parts}){undetermined}"]
        if self.shift is not None:
            lines.append(f"shift {self.shift!r}")
        return "\n".join([*lines, *self.conversions])

    def __repr__(self) -> str:
        return str(self)


def fit(material: type[Material] | Material, data: Any, terms: int | None = None, *, relative: bool = True,
        weights: Any = None, within: tuple[float, float] | None = None, test: str | None = None, specimen: Any = None,
        temperature: Any = None, reference: float | None = None, shift: str = "WLF", unit: str = "C") -> Fit:
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
            For a relaxing material: a list of `TimedTest` and `OscillationTest`.
            Or the name of a CSV file, or a list of such, with the columns test, stretch, stress (nominal), and for a
            relaxing material time. The columns may be in any order if a line names them, else in this order. In place
            of the stretch there may be a strain, a true strain (also in %) or a displacement, in place of the stress a
            true stress or a force; `Fit.conversions` says what was done. Other units in brackets are checked, not
            converted. A test ends where its name or temperature changes or the time decreases. A stress that was not
            measured is left empty in a test in time. A column of numbers that is not used is refused.
        terms: number of terms if `material` is the class `Ogden`, default 3. For a relaxing class it is the number of
            branches, default as many as the tests determine; the equilibrium is then neo-Hookean.
        relative: True: each misfit is divided by the measured stress, or by 2 % of the largest stress of the test if
            that is more. False: misfits in stress, every point with the same weight.
        weights: {test: weight of the squared misfits of its points}; for tests in time a list with the weight of each
            test. Default: 1.
        within: lowest and highest stretch of the points that count, or None for all. In biaxial tests both stretches
            must lie in the range.
        test: name of the test in files without a column of it, such as "uniaxial"; of oscillations "shear" or
            "uniaxial".
        specimen: {"length": gauge length, "width": ..., "thickness": ...}, or "area", for files with displacement and
            force.
        temperature: temperature of the tests, one for each test or file, or one for all; the files may have a column of
            it. With several, the constants of an elastic material become tables over the temperature. A relaxing
            material gets a shift of its relaxation times, fitted together with its constants.
        reference: reference temperature of the shift; default the temperature of the first test.
        shift: "WLF", "Arrhenius" or "table" (one factor for each temperature).
        unit: unit of the temperatures, "C" or "K".

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
    check_name("fit: unit", unit, ABSOLUTE_ZERO)
    files = _files(data, test, specimen)
    given = _temperatures(data, files, temperature)
    conversions = tuple(dict.fromkeys(f"{entry.source}: {done}" for entry in files for done in entry.conversions))
    several = given is not None and len(set(given)) > 1
    if reference is not None and not several:
        raise InputError(f"fit: reference = {reference!r}: is for tests at several temperatures: give temperature=..."
                         f" or a column of it")
    for kind, fitted in IN_TIME:
        if isinstance(material, kind) or isinstance(material, type) and issubclass(material, kind):
            tests = _in_time(files) if files else data
            if several:
                assert given is not None
                found = _fit_shifted(fitted, material, tests, given, shift, reference, unit, terms, relative, weights,
                                     within)
            else:
                found = _fit_timed(fitted, material, tests, terms, relative, weights, within)
            return found._replace(conversions=conversions)
    if several and not files:
        raise InputError("fit: temperature: elastic tests at several temperatures must be files, or one fit each")
    if several:
        assert given is not None
        return _fit_by_temperature(material, files, given, terms, relative, weights, within, conversions)
    points = Points(_elastic(files) if files else data, relative, weights, within)
    best, sure = _fit_elastic(material, points, terms)
    misfit = points.stress(best.response, best.parameters.values()) - points.measured
    return _result(best, dict(best.parameters), points.parts, misfit, points.measured, sure,
                   MeasuredRange.from_stretches(points.stretches_of, sure.undetermined), points.data
                   )._replace(conversions=conversions)


def _files(data: Any, test: str | None, specimen: Any) -> list[MeasuredTest | MeasuredOscillation]:
    """Return the tests of the files among the data, if any; a `test` or `specimen` without files is an InputError."""
    names = [data] if isinstance(data, str | os.PathLike) else data
    if not (isinstance(names, list | tuple) and names and all(isinstance(name, str | os.PathLike) for name in names)):
        if test is not None or specimen is not None:
            raise InputError("fit: test and specimen are for data in files")
        return []
    found = [entry for name in names for entry in read_tests(file_path("fit: data", name), test, specimen)]
    units = {entry.unit: entry.source for entry in found if entry.unit is not None}
    if len(units) > 1:
        raise InputError(f"fit: data: the files have stresses in several units:"
                         f" {', '.join(f'{unit} in {source}' for unit, source in units.items())}: convert them to one")
    return found


def _temperatures(data: Any, files: Sequence[MeasuredTest | MeasuredOscillation], given: Any) -> list[float] | None:
    """Return the temperature of each test, or None if unknown; another number, or ones in files too: InputError."""
    columns = [entry.temperature for entry in files]
    if given is None:
        if any(T is None for T in columns) and any(T is not None for T in columns):
            raise InputError("fit: temperature: some of the files have a column of it, others do not")
        return None if not columns or columns[0] is None else [T for T in columns if T is not None]
    if any(T is not None for T in columns):
        raise InputError(f"fit: temperature = {given!r}: the files have a column of it: give only one of them")
    names = list(dict.fromkeys(entry.source for entry in files))
    several = given if isinstance(given, list | tuple | np.ndarray) else [given]
    values = [finite("fit: temperature", T) for T in several]
    number = len(files) if files else len(data) if isinstance(data, list | tuple) else 1
    if len(values) == 1:
        return values * number
    if files and len(values) == len(names):
        return [values[names.index(entry.source)] for entry in files]
    if len(values) != number:
        raise InputError(f"fit: temperature: {len(values)} for {number} tests: give one for each, or one for all")
    return values


def _fit_shifted(fitted: Callable, material: Any, tests: Any, temperatures: list[float], shift: str,
                 reference: float | None, unit: str, terms: int | None, relative: bool, weights: Any, within: Any
                 ) -> Fit:
    """Fit a relaxing material and its shift to tests at several temperatures (`fit`), and return the result."""
    reference = temperatures[0] if reference is None else finite("fit: reference", reference)
    if fitted is not fit_timed_tests:
        raise InputError("fit: temperature: a damping does not depend on the temperature: fit each temperature, or one")
    found = fit_shift(fitted, material, list(tests), np.array(temperatures), shift, reference, unit, terms, relative,
                      numbered_weights(weights, len(tests)), within)
    result = _timed_result(found.material.at_temperature(reference), found.constants, found.tests, found.uncertainty)
    found.material.tested = result.material.tested
    names = {name: f"{name} at {T:g} {unit}" for name, T in zip(result.rms, temperatures)}
    return result._replace(material=found.material, rms={names[k]: v for k, v in result.rms.items()},
                           deviations={names[k]: v for k, v in result.deviations.items()}, shift=found.shift)


def _fit_by_temperature(material: Any, files: Sequence[MeasuredTest | MeasuredOscillation], temperatures: list[float],
                        terms: int | None, relative: bool, weights: Any, within: Any, conversions: tuple[str, ...]
                        ) -> Fit:
    """Fit an elastic material at each temperature, by tables; a constant that cannot be one is an InputError."""
    each: dict[float, Fit] = {}
    for T in sorted(set(temperatures)):
        points = Points(_elastic([f for f, at in zip(files, temperatures) if at == T]), relative, weights, within)
        best, sure = _fit_elastic(material, points, terms)
        misfit = points.stress(best.response, best.parameters.values()) - points.measured
        each[T] = _result(best, dict(best.parameters), points.parts, misfit, points.measured, sure,
                          MeasuredRange.from_stretches(points.stretches_of, sure.undetermined), points.data)
    names = list(next(iter(each.values())).constants)
    card = copy.copy(next(iter(each.values())).material)
    if any(name.startswith("alpha") for name in names):
        raise InputError(f"fit: {type(card).__name__} at several temperatures: an exponent cannot depend on the"
                         f" temperature; fit each temperature by itself, or another material")
    vars(card).pop("response", None)
    tables = {name: table({T: found.constants[name] for T, found in each.items()}) for name in names}
    card.parameters = {name: OfTemperature(curve) for name, curve in tables.items()}
    elastic = _elastic(files)
    card.tested = MeasuredRange.from_stretches({mode: stretch for mode, (stretch, _) in elastic.items()}, ())

    def merged(attribute: str) -> dict[str, Any]:
        """Return the entries of an attribute of the fits, with their temperatures."""
        return {f"{name} at {T:g}": value for T, found in each.items() for name, value in getattr(found, attribute
                                                                                                    ).items()}
    sizes = [len(found.covariance) for found in each.values()]
    covariance = np.zeros((sum(sizes), sum(sizes)))
    for k, found in enumerate(each.values()):
        part = slice(sum(sizes[:k]), sum(sizes[:k + 1]))
        covariance[part, part] = found.covariance
    total = np.sqrt(np.average([found.rms_total**2 for found in each.values()],
                               weights=[found.points for found in each.values()]))
    undetermined = tuple(f"{name} at {T:g}" for T, found in each.items() for name in found.undetermined)
    return Fit(card, merged("constants"), merged("rms"), float(total), merged("deviations"), merged("errors"),
               undetermined, covariance, sum(found.points for found in each.values()),
               {T: found.data for T, found in each.items()}, conversions, shares=merged("shares"))


def _fit_timed(fitted: Callable, material: Any, tests: Any, terms: int | None, relative: bool, weights: Any,
             within: Any) -> Fit:
    """Fit a relaxing material to tests in time by the function `fitted`, and return the result."""
    number = len(tests) if isinstance(tests, list | tuple) else 0
    relaxing, constants, used, found = fitted(material, tests, terms, relative, numbered_weights(weights, number),
                                              within)
    return _timed_result(relaxing, constants, used, found)


def _timed_result(relaxing: Any, constants: dict[str, float], used: list[Any], found: Uncertainty) -> Fit:
    """Return the `Fit` of a relaxing material with its {constant: value}, checked tests and uncertainty."""
    rows = [rows_of(test) for test in used]
    measured, computed = [part.measured for part in rows], [part.values(relaxing) for part in rows]
    ends = np.cumsum([0, *map(len, measured)])
    parts = {f"{i} {part.name}": slice(*ends[i - 1:i + 1]) for i, part in enumerate(rows, 1)}
    floors = {name: part.floor for name, part in zip(parts, rows)}
    stretches: dict[str, list] = {}
    rates = [np.zeros(0)]
    for test in used:
        if isinstance(test, OscillationTest):
            stretches.setdefault("uniaxial", []).append(np.ones(1))
            continue
        stretches.setdefault(test.mode, []).append(test.stretches[np.isfinite(test.stress)])
        steps = np.diff(test.times)
        rates.append(np.abs(np.diff(np.log(test.stretches)))[steps > 0] / steps[steps > 0])
    strain_rates = np.concatenate(rates)
    strain_rates = strain_rates[strain_rates > 0]
    tested = MeasuredRange.from_stretches(
        {mode: np.concatenate(several) for mode, several in stretches.items()}, found.undetermined,
        (float(strain_rates.min()), float(strain_rates.max())) if len(strain_rates) else None)
    misfit = np.concatenate(computed) - np.concatenate(measured)
    return _result(relaxing, constants, parts, misfit, np.concatenate(measured), found, tested, used, floors)


def _result(material: Any, constants: dict[str, float], parts: dict[str, slice], misfit: np.ndarray,
            measured: np.ndarray, found: Uncertainty, tested: MeasuredRange, data: Any,
            floors: dict[str, float] | None = None) -> Fit:
    """Return the `Fit` with a copy of a fitted material that stores the range of its tests, and with its misfits.

    `misfit` is computed minus measured stress at m points, both (m,); `parts` has the slice of each test, `floors` its
    smallest divisor over its largest stress.
    """
    fitted_material = copy.copy(material)
    fitted_material.tested = tested
    least = dict.fromkeys(parts, MIN_DIVISOR) if floors is None else floors
    deviations = {name: _rms(misfit[part] / np.maximum(abs(measured[part]), least[name] * abs(measured[part]).max()))
                  for name, part in parts.items()}
    rms = {name: _rms(misfit[part]) for name, part in parts.items()}
    return Fit(fitted_material, constants, rms, _rms(misfit), deviations, found.errors, found.undetermined,
               found.covariance, len(misfit), data, shares=_shares(found, parts))


def _shares(found: Uncertainty, parts: dict[str, slice]) -> dict[str, dict[str, float]]:
    """Return {constant: {test: part of the information on the constant that the test carries, 0 to 1}}."""
    if found.slopes is None:
        return {}
    squares = found.slopes**2
    total = np.maximum(squares.sum(0), 1e-300)
    return {name: {test: float(squares[part, k].sum() / total[k]) for test, part in parts.items()}
            for k, name in enumerate(found.errors)}


def _fit_elastic(material: Any, points: Points, terms: int | None) -> tuple[Material, Uncertainty]:
    """Fit a material to elastic tests, which state no times; return it with the uncertainty of its constants.

    `terms` are those of the class `Ogden`. Fewer points than constants, or no finite stress, are an InputError.
    """
    from scipy.optimize import least_squares
    guesses = _guesses(material, points, terms)
    response, n, measured = guesses[0].response, len(guesses[0].parameters), points.measured
    if len(measured) < n:
        raise InputError(f"fit: {len(measured)} points cannot fix the {n} constants of {type(guesses[0]).__name__}")

    def refined(guess: Material, start: Any, evaluations: int | None) -> tuple[float, Material, np.ndarray]:
        """Return (cost, guess, fitted coordinates of the constants) after a least-squares fit.

        It starts at coordinates (constants,), with at most `evaluations` (None: 100 for each). A stress that is not
        finite costs infinity.
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


def _elastic(files: Sequence[MeasuredTest | MeasuredOscillation]) -> dict[str, tuple[np.ndarray, ...]]:
    """Return {test: (stretches, stresses)} of tests from files without times. A file with times is an InputError."""
    found: dict[str, list] = {}
    for entry in files:
        if isinstance(entry, MeasuredOscillation):
            raise InputError(f"fit: data: {entry.source}: has oscillations: give a material that relaxes, such as"
                             f" Viscoelastic")
        if entry.times is not None:
            raise InputError(f"fit: data: {entry.source}: has times; a material that does not relax has none: leave the"
                             f" column out")
        found.setdefault(entry.mode, []).append((entry.stretch, entry.stress))
    return {mode: tuple(np.hstack(column) for column in zip(*parts)) for mode, parts in found.items()}


def _in_time(files: Sequence[MeasuredTest | MeasuredOscillation]) -> list[TimedTest | OscillationTest]:
    """Return the tests in time and by oscillations from files; a file with neither is an InputError."""
    found: list[TimedTest | OscillationTest] = []
    for entry in files:
        if isinstance(entry, MeasuredOscillation):
            found.append(OscillationTest(entry.frequencies, entry.storage, entry.loss, entry.mode))
        elif entry.times is None:
            raise InputError(f"fit: data: {entry.source}: has no times: a material that relaxes needs a fourth column"
                             f" with the time")
        else:
            found.append(TimedTest(entry.mode, entry.times, entry.stretch, entry.stress))
    return found


def _guesses(material: Any, points: Points, terms: int | None) -> list[Material]:
    """Return materials from which a fit starts; no material, wrong terms or stresses of wrong sign: InputError."""
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
