"""Constants of a material that relaxes from tests in time: relaxation, constant rates, any history.

The stress of a branch is mu times a function of tau alone, which is computed once for a row of tau. The best fit of a
spectrum with nonnegative moduli (Lawson and Hanson 1974) is the initial guess. A least-squares fit of all constants
follows, with the logarithms of mu and tau as variables, so every result is admissible.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np

from ...errors import InputError, count, positive, several
from ...materials import branches, homogeneous
from ...materials.hyperelastic import NeoHookean
from ...materials.material import Material
from ...materials.relaxing import RelaxingMaterial
from .uncertainty import Uncertainty, uncertainty
from .weights import in_range, scales

_PER_DECADE = 16
"""Relaxation times a decade at which a branch's stress is computed; between them a cubic spline."""


class TimedTest(NamedTuple):
    """A homogeneous test in time of a body that is undeformed before.

    Args:
        mode: "uniaxial", "pure_shear" or "equibiaxial".
        times: times, shape (n,), not decreasing. The first stretch is applied suddenly at the first time; two stretches
            at the same time are a jump. A constant stretch with a positive first time is applied at time 0.
        stretches: shape (n,).
        stress: nominal, shape (n,); not a number where it was not measured.
        between: the quantity that grows at a constant rate between two times, "stretch" or "strain" (logarithmic).

    >>> held = fx.TimedTest("uniaxial", times=[0.0, 1.0, 5.0], stretches=[1.0, 2.0, 2.0], stress=[0.0, 1.2, 0.9])
    >>> held.between                                                        # constant rate from time 0 to 1
    'stretch'
    """

    mode: str
    times: Any
    stretches: Any
    stress: Any
    between: str = "stretch"

    @classmethod
    def relaxation(cls, mode: str, stretch: float, times: Any, stress: Any) -> TimedTest:
        """Return a relaxation test: a stretch applied at once at time 0 and kept constant.

        Args:
            mode: see the class.
            stretch: the stretch.
            times: times of the stresses, above 0, rising, shape (n,).
            stress: nominal stress at these times, shape (n,).

        Returns:
            The test.
        """
        t = np.append(0.0, np.asarray(times, float))
        return cls(mode, t, np.full(len(t), stretch), np.append(np.nan, stress))

    @classmethod
    def constant_rate(cls, mode: str, rate: float, stretches: Any, stress: Any) -> TimedTest:
        """Return a test at a constant Hencky rate from stretch 1.

        Args:
            mode: see the class.
            rate: Hencky rate, 1/time, above 0.
            stretches: stretches, in order, shape (n,).
            stress: nominal stress at these stretches, shape (n,).

        Returns:
            The test.
        """
        l = np.append(1.0, np.asarray(stretches, float))
        times = np.abs(np.log(l)) / positive("TimedTest: rate", rate)
        return cls(mode, times, l, np.append(np.nan, stress), "strain")


def fitted_in_time(material: type[RelaxingMaterial] | RelaxingMaterial, tests: Any, terms: int | None, relative: bool,
                   weights: list[float], within: Any
                   ) -> tuple[RelaxingMaterial, dict[str, float], list[TimedTest], Uncertainty]:
    """Fit a relaxing material to tests in time; see `fit`.

    Args:
        material: class, or material with initial constants.
        tests: list of `TimedTest`.
        terms: number of branches, or None.
        relative: see `fit`.
        weights: weight of each test.
        within: see `fit`.

    Returns:
        The material, its constants, the tests, and their uncertainty.

    Raises:
        InputError: the tests or arguments do not fit the material.
    """
    data = _Data(checked_tests(tests, within), material if isinstance(material, type) else type(material), relative,
                 weights)
    if isinstance(material, RelaxingMaterial):
        if terms is not None:
            raise InputError(f"fit: terms = {terms!r}: {material} has its branches already")
        best = _refined(data, material, len(material.branches))
    elif terms is not None:
        best = _refined(data, _first(material), count("fit: terms", terms))
    else:
        best = _refined(data, _first(material), 1)
        for n in range(2, 11):                  # a branch more while the misfit falls and the data determine all
            larger = _refined(data, _first(material), n)
            if larger[1] > 0.8 * best[1] or data.uncertainty(larger[0]).undetermined:
                break
            best = larger
    found = best[0]
    return found, dict(found.parameters), data.tests, data.uncertainty(found)


def checked_tests(tests: Any, within: Any = None) -> list[TimedTest]:
    """Return the tests as arrays, with nan for stresses at stretches outside `within`.

    Returns:
        The tests.

    Raises:
        InputError: an argument that is no list of tests, or a test with inconsistent arrays.
    """
    found = []
    for i, test in enumerate(several("fit: data", tests, "TimedTest (a material that relaxes needs the time)"), 1):
        if not isinstance(test, TimedTest):
            raise InputError(f"fit: data: number {i} is {test!r}: must be a TimedTest: a material that relaxes"
                             f" needs the time")
        test = test._replace(**_checked(f"fit: data: number {i}", test))
        found.append(test._replace(stress=np.where(in_range(within, test.stretches), test.stress, np.nan)))
    stress = np.concatenate([test.stress for test in found] or [np.zeros(0)])
    if not np.any(np.isfinite(stress) & (stress != 0)):
        raise InputError("fit: data: no stress is given, or all are 0")
    return found


def _first(kind: type[RelaxingMaterial]) -> RelaxingMaterial:
    return kind(NeoHookean(c10=1.0), [(1.0, 1.0)])


class _Data:
    """The tests, and the stresses of an equilibrium energy and of branches in them; all points in one row."""

    def __init__(self, tests: list[TimedTest], law: type[RelaxingMaterial], relative: bool, weights: list[float]):
        self.tests = tests
        measured = [np.isfinite(t.stress) for t in self.tests]
        self.stress = np.concatenate([t.stress[m] for t, m in zip(self.tests, measured)])
        self.scale = np.abs(self.stress).max()
        self.sizes = scales([t.stress[m] for t, m in zip(self.tests, measured)], relative, weights)
        steps = np.concatenate([np.diff(t.times) for t in self.tests])
        longest = max(t.times[-1] - t.times[0] for t in self.tests)
        if not longest > 0:
            raise InputError("fit: data: no test lasts any time: the times of each are all the same")
        low, high = np.log(steps[steps > 0].min() / 10), np.log(10 * longest)
        self.log_tau = np.linspace(low, high, 2 + int(_PER_DECADE * (high - low) / np.log(10)))
        self._stretches = np.hstack([homogeneous.along(t.mode, t.stretches[m]) for t, m in zip(self.tests, measured)])
        l1, l2 = self._stretches
        self.largest_I1 = float(np.max(l1**2 + l2**2 + (l1 * l2) ** -2))
        from scipy.interpolate import CubicSpline
        unit = [law.unit_stress(t.mode, np.exp(self.log_tau), t.times, t.stretches, t.between, 1e-8)[m]
                for t, m in zip(self.tests, measured)]
        self.branch: Callable = CubicSpline(self.log_tau, np.concatenate(unit), axis=1)

    def relaxed(self, material: Material | None, constants: Any = None) -> np.ndarray:
        """Return the nominal stress of an equilibrium energy at all points, shape (n,); not finite beyond its limit."""
        if material is None:
            return np.zeros(len(self.stress))
        values = material.parameters.values() if constants is None else constants
        return material.response.stress(self._stretches, values)[0]

    def stresses(self, material: RelaxingMaterial, constants: np.ndarray) -> np.ndarray:
        """Return the nominal stress of a material with other, unchecked constants at all points, shape (n,)."""
        n = len(constants) - 2 * len(material.branches)
        mu, tau = constants[n::2], constants[n + 1::2]
        log_tau = np.clip(np.log(tau), self.log_tau[0], self.log_tau[-1])
        return self.relaxed(material.equilibrium, constants[:n]) + self.branch(log_tau) @ mu

    def uncertainty(self, material: RelaxingMaterial) -> Uncertainty:
        """See `uncertainty`."""
        return uncertainty(lambda x: self.stresses(material, x), material.parameters, self.stress, self.sizes)


def _refined(data: _Data, material: RelaxingMaterial, n: int) -> tuple[RelaxingMaterial, float]:
    """Return (the material with its constants and this number of branches fitted, root mean square of the scaled
    misfit)."""
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
    best = cast(RelaxingMaterial, start.with_constants(start.constants_at(x)))
    rest = [] if (relaxed := best.equilibrium) is None else list(relaxed.parameters.values())
    ordered = sorted(best.branches, key=lambda pair: pair[1])
    best = cast(RelaxingMaterial, best.with_constants([*rest, *np.ravel(ordered)]))
    return best, float(np.sqrt(2 * cost / len(data.stress)))


def _guesses(data: _Data, material: RelaxingMaterial, n: int) -> list[RelaxingMaterial]:
    """Return starts with this number of branches: the material's own, and two from the best spectrum."""
    from scipy.optimize import nnls
    rest = material.equilibrium
    shape = data.relaxed(rest)[:, None] / data.sizes[:, None]
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
        found.append(type(material)(_scaled(rest, max(mu[0], 1e-3, 1e-2 * weight), data.largest_I1), pairs))
    return found + [material] * (len(material.branches) == n)


def _scaled(material: Material | None, factor: float, I1: float) -> Material | None:
    """Return a material of this kind with its modulus times a factor, for data up to this I1."""
    if material is None:
        return None
    try:
        return type(material).guesses(factor * material.shear_modulus, I1, None)[0]
    except InputError:                                          # it has no guess of its own
        return material


def _checked(name: str, test: TimedTest) -> dict[str, Any]:
    """Return the arguments of a test as arrays; raise an InputError for inconsistent ones."""
    t, l = branches.checked(name, test.mode, test.times, test.stretches, test.between)
    try:
        stress = np.asarray(test.stress, float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: stress = {test.stress!r}: must be numbers") from None
    if stress.shape != t.shape:
        raise InputError(f"{name}: stress has the shape {stress.shape}, times {t.shape}: must be the same")
    if t[0] != 0 and l[0] != 1:                                 # when was it put on?
        if np.ptp(l) > 0 or t[0] < 0:
            raise InputError(f"{name}: begins at time {t[0]:.6g} with a stretch of {l[0]:.6g}: since when? Begin with"
                             f" the time at which it was put on, the stress left empty (not a number)")
        t, l, stress = np.append(0.0, t), np.append(l[0], l), np.append(np.nan, stress)
    return {"times": t, "stretches": l, "stress": stress}
