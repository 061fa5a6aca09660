"""Fits of the constants of a material that relaxes to tests in time: relaxation, constant rates, or any history.

A branch has a modulus mu and a relaxation time tau. Its stress in a test is mu times a function of tau alone, which is
computed once for a sequence of tau. The best fit of a spectrum with nonnegative moduli (Lawson and Hanson 1974) is the
initial guess. A least-squares fit of all constants follows, with the logarithms of mu and tau as variables, so that
every result is admissible.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from ...errors import InputError, as_list, count
from ...materials.hyperelastic import NeoHookean
from ...materials.material import Material
from ...materials.relaxing import GeneralisedMaxwell
from .oscillation import OscillationTest, checked_oscillation
from .rows import equilibrium_values, largest_I1, row_divisors, rows_of
from .timed_test import TimedTest, checked_timed_test
from .uncertainty import Uncertainty, uncertainty
from .weights import in_range

_TIMES_PER_DECADE = 16
"""Number of relaxation times per decade at which the stress of a branch is computed; a cubic spline connects them."""


def fit_timed_tests(material: type[GeneralisedMaxwell] | GeneralisedMaxwell, tests: Any, terms: int | None,
                   relative: bool, weights: list[float], within: Any
                   ) -> tuple[GeneralisedMaxwell, dict[str, float], list[Any], Uncertainty]:
    """Fit the constants of a relaxing material to tests in time.

    The results are the material, {constant: value}, the tests as arrays and the uncertainty. `terms` are branches, None
    for at most 10. Wrong tests, fewer points than constants or no finite stress are an InputError.
    """
    law = material if isinstance(material, type) else type(material)
    data = _TimedData(checked_tests(tests, within), law, relative, weights)
    if isinstance(material, GeneralisedMaxwell):
        if terms is not None:
            raise InputError(f"fit: terms = {terms!r}: {material} has its branches already")
        best = _fit_branches(data, material, len(material.branches))
    elif terms is not None:
        best = _fit_branches(data, _initial_material(material), count("fit: terms", terms))
    else:
        best = _fit_branches(data, _initial_material(material), 1)
        for n in range(2, 11):        # add branches while the misfit decreases and all constants are determined
            larger = _fit_branches(data, _initial_material(material), n)
            if larger[1] > 0.8 * best[1] or data.uncertainty(larger[0]).undetermined:
                break
            best = larger
    found = best[0]
    return found, dict(found.parameters), data.tests, data.uncertainty(found)


def checked_tests(tests: Any, within: Any = None) -> list[Any]:
    """Return tests as arrays, nan outside `within`; a constant stretch starts at time 0; wrong tests: InputError."""
    found: list[Any] = []
    for i, test in enumerate(as_list("fit: data", tests, "TimedTest (a material that relaxes needs the time)"), 1):
        name = f"fit: data: number {i}"
        if isinstance(test, OscillationTest):
            found.append(checked_oscillation(name, test))
            continue
        if not isinstance(test, TimedTest):
            raise InputError(f"{name} is {test!r}: must be a TimedTest or an OscillationTest: a material that relaxes"
                             f" needs the time")
        test = checked_timed_test(name, test)
        found.append(test._replace(stress=np.where(in_range(within, test.stretches), test.stress, np.nan)))
    if not any(np.any(rows_of(test).measured) for test in found):
        raise InputError("fit: data: no stress is given, or all are 0")
    return found


def _initial_material(kind: type[GeneralisedMaxwell]) -> GeneralisedMaxwell:
    """Return the initial material of a class: a neo-Hookean equilibrium and one branch, with all constants 1."""
    return kind(NeoHookean(c10=1.0), [(1.0, 1.0)])


class _TimedData:
    """Measured values of all tests as one vector, and the values of a relaxing material in the same n rows.

    Tests whose times are all the same are an InputError.

    Attributes:
        tests: the checked tests.
        rows: their rows.
        stress: measured nominal stresses and moduli, shape (n,).
        scale: largest absolute measured value, the unit of bounds and first guesses of moduli.
        sizes: stress by which each misfit is divided, shape (n,).
        log_tau: logarithms of the relaxation times at which the values of a branch are computed, shape (k,).
        largest_I1: largest first invariant of C at the points.
    """

    def __init__(self, tests: list[Any], law: type[GeneralisedMaxwell], relative: bool, weights: list[float]):
        self.tests, self.rows = tests, [rows_of(test) for test in tests]
        self.stress = np.concatenate([part.measured for part in self.rows])
        self.scale = np.abs(self.stress).max()
        self.sizes = row_divisors(self.rows, relative, weights)
        longest = max(part.longest for part in self.rows)
        if not longest > 0:
            raise InputError("fit: data: no test lasts any time: the times of each are all the same")
        low, high = np.log(min(part.shortest for part in self.rows) / 10), np.log(10 * longest)
        self.log_tau = np.linspace(low, high, 2 + int(_TIMES_PER_DECADE * (high - low) / np.log(10)))
        self.largest_I1 = largest_I1(self.rows)
        self._branches = [part.branch(law, self.log_tau, 1e-8) for part in self.rows]

    def branch(self, log_tau: Any) -> np.ndarray:
        """Return the values of j branches of unit modulus, (n, j), for the logarithms of their relaxation times, (j,).
        """
        return np.concatenate([part(log_tau) for part in self._branches])

    def equilibrium_stress(self, material: Material | None, constants: Any = None) -> np.ndarray:
        """Return the values of the equilibrium (None: 0) in all rows, (n,); inf or nan beyond its limit."""
        return equilibrium_values(self.rows, material, constants)

    def stresses(self, material: GeneralisedMaxwell, constants: np.ndarray) -> np.ndarray:
        """Return stresses (n,) of a material with b branches, for constants of equilibrium and b pairs, unchecked."""
        n = len(constants) - 2 * len(material.branches)
        mu, tau = constants[n::2], constants[n + 1::2]
        log_tau = np.clip(np.log(tau), self.log_tau[0], self.log_tau[-1])
        return self.equilibrium_stress(material.equilibrium, constants[:n]) + self.branch(log_tau) @ mu

    def uncertainty(self, material: GeneralisedMaxwell) -> Uncertainty:
        """Return the uncertainty of the fitted constants of a relaxing material."""
        return uncertainty(lambda x: self.stresses(material, x), material.parameters, self.stress, self.sizes)


class ShiftedTests:
    """Values of a relaxing material in tests at several temperatures.

    A branch with the relaxation time tau at the reference temperature has the time aT tau in a test with the shift aT.
    The stresses of branches are computed once, over a wide range of times.

    Attributes:
        stress: measured nominal stresses, shape (n,).
        sizes: stress by which each misfit is divided, shape (n,).
    """

    def __init__(self, tests: list[Any], material: Any, relative: bool, weights: list[float]):
        given = _initial_material(material) if isinstance(material, type) else material
        self._rows = [rows_of(test) for test in tests]
        self.stress = np.concatenate([part.measured for part in self._rows])
        self.sizes = row_divisors(self._rows, relative, weights)
        self._branches: list[tuple[float, float, Callable]] = []
        for part in self._rows:
            if not part.longest > 0:
                raise InputError("fit: data: a test lasts no time: its times are all the same")
            low, high = np.log(part.shortest / 1000), np.log(1000 * part.longest)
            grid = np.linspace(low, high, 2 + int(_TIMES_PER_DECADE / 2 * (high - low) / np.log(10)))
            self._branches.append((low, high, part.branch(type(given), grid, 1e-6)))
        self._equilibrium = _scaled(given.equilibrium, 1.0, largest_I1(self._rows))

    def branches(self, tau: np.ndarray, factors: np.ndarray) -> np.ndarray:
        """Return stresses (n, j) of branches of unit modulus with times tau (j,) at the reference, shifts `factors`."""
        found = []
        for (low, high, branch), a in zip(self._branches, factors):
            log_tau = np.log(tau) + np.log(a)
            viscous = np.exp(np.minimum(log_tau - low, 0.0))               # a fast branch: stress is tau times rate
            found.append(viscous * branch(np.clip(log_tau, low, high)))
        return np.concatenate(found)

    def spectrum_misfit(self, factors: np.ndarray) -> float:
        """Return the squared misfit of the best nonnegative spectrum, two times per decade, with shifts `factors`."""
        from scipy.optimize import nnls
        low = min(first - np.log(a) for (first, _, _), a in zip(self._branches, factors))
        high = max(last - np.log(a) for (_, last, _), a in zip(self._branches, factors))
        tau = np.exp(np.linspace(low, high, 2 + int(2 * (high - low) / np.log(10))))
        columns = self.branches(tau, factors)
        if self._equilibrium is not None:
            columns = np.column_stack([equilibrium_values(self._rows, self._equilibrium), columns])
        return float(nnls(columns / self.sizes[:, None], self.stress / self.sizes)[1] ** 2)

    def stresses(self, material: GeneralisedMaxwell, constants: Any, factors: np.ndarray) -> np.ndarray:
        """Return nominal stresses (n,) at all points with shifts; constants, at the reference, follow `parameters`."""
        values, n = np.asarray(constants, float), len(material.parameters) - 2 * len(material.branches)
        rest = equilibrium_values(self._rows, material.equilibrium, values[:n])
        return rest + self.branches(values[n + 1::2], factors) @ values[n::2]


def _fit_branches(data: _TimedData, material: GeneralisedMaxwell, n: int) -> tuple[GeneralisedMaxwell, float]:
    """Return a material of n fitted branches, ascending in time, and the root mean square of relative misfits.

    A given material of n branches is one guess. Fewer points than constants, or no finite stress: InputError.
    """
    from scipy.optimize import least_squares
    if len(data.stress) < (needed := len(material.parameters) - 2 * len(material.branches) + 2 * n):
        raise InputError(f"fit: {len(data.stress)} points cannot fix the {needed} constants of"
                         f" {type(material).__name__}")
    trials = []
    for start in _guesses(data, material, n):
        bounds = np.array([x for _, *x in start.coordinates()]).T
        bounds[:, len(bounds.T) - 2 * n + 1::2] = [[data.log_tau[0]], [data.log_tau[-1]]]
        bounds[:, len(bounds.T) - 2 * n::2] = [[np.log(1e-9 * data.scale)], [np.log(1e9 * data.scale)]]
        x = np.array([x for x, *_ in start.coordinates()])
        x = np.clip(x, bounds[0] + 1e-9 * np.abs(x) + 1e-300, bounds[1] - 1e-9 * np.abs(x))

        def residual(x, start=start):
            return (data.stresses(start, np.array(start.constants_at(x))) - data.stress) / data.sizes

        if not np.all(np.isfinite(residual(x))):                # beyond the limit of the equilibrium energy
            continue
        found = least_squares(residual, x, bounds=bounds, x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-14,
                              max_nfev=200)
        trials.append((found.cost, start, found.x))
    if not trials:
        raise InputError(f"fit: {material} has no finite stress at some stretch of the data: start with constants whose"
                         f" limit lies beyond them")
    cost, start, x = min(trials, key=lambda trial: trial[0])
    best = cast(GeneralisedMaxwell, start.with_constants(start.constants_at(x)))
    constants = [] if (equilibrium := best.equilibrium) is None else list(equilibrium.parameters.values())
    ordered = sorted(best.branches, key=lambda pair: pair[1])
    best = cast(GeneralisedMaxwell, best.with_constants([*constants, *np.ravel(ordered)]))
    return best, float(np.sqrt(2 * cost / len(data.stress)))


def _guesses(data: _TimedData, material: GeneralisedMaxwell, n: int) -> list[GeneralisedMaxwell]:
    """Return materials with n branches from which a fit starts.

    A spectrum of many times is fitted first. Times stand for equal shares of its moduli, then lie at equal ratios; the
    given material is third if it has n branches.
    """
    from scipy.optimize import nnls
    equilibrium = material.equilibrium
    shape = data.equilibrium_stress(equilibrium)[:, None] / data.sizes[:, None]
    row = np.linspace(data.log_tau[0], data.log_tau[-1], len(data.log_tau) // 4)
    columns = np.hstack([shape, data.branch(row) / data.sizes[:, None]])
    weight, *spectrum = nnls(columns, data.stress / data.sizes)[0]
    spectrum = np.array(spectrum)
    used = np.flatnonzero(spectrum > 1e-3 * spectrum.max(initial=1e-300))
    share = np.cumsum(spectrum) / max(spectrum.sum(), 1e-300)
    ends = (row[used[0]], row[used[-1]]) if len(used) else (row[0], row[-1])
    found = []
    for log_tau in (np.interp((np.arange(n) + 0.5) / n, share, row), np.linspace(*ends, n + 2)[1:-1]):
        mu = nnls(np.hstack([shape, data.branch(log_tau) / data.sizes[:, None]]), data.stress / data.sizes)[0]
        pairs = [(max(m, 1e-3 * mu[1:].max(initial=1e-3 * data.scale)), t) for m, t in zip(mu[1:], np.exp(log_tau))]
        found.append(type(material)(_scaled(equilibrium, max(mu[0], 1e-3, 1e-2 * weight), data.largest_I1), pairs))
    return found + [material] * (len(material.branches) == n)


def _scaled(material: Material | None, factor: float, I1: float) -> Material | None:
    """Return the first guess of an equilibrium, if it has any, with `factor` times the modulus and finite up to I1."""
    if material is None:
        return None
    try:
        return type(material).guesses(factor * material.shear_modulus, I1, None)[0]
    except InputError:                                          # the class has no first guess
        return material
