"""Measured values of one test as rows of a least-squares problem: tests in time and small oscillations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from ...materials import homogeneous
from ...materials.material import Material
from .oscillation import OSCILLATIONS, OscillationTest, complex_modulus
from .timed_test import TimedTest
from .weights import MIN_DIVISOR, divisors

_STRAIN = 1e-4
"""Strain of the difference quotient that gives the modulus of an equilibrium at rest; its error is its square."""


class Rows(Protocol):
    """Measured values of a test, n rows.

    Attributes:
        name: name of the test in a fit, such as "uniaxial".
        measured: measured stresses or moduli, stress, shape (n,).
        floor: smallest divisor of a relative misfit, over the largest value of the test.
        shortest: shortest time that the test resolves.
        longest: longest time that the test resolves.
        stretches: in-plane stretches at which the stress of the equilibrium is needed, shape (2, m).
    """

    name: str
    measured: np.ndarray
    floor: float
    shortest: float
    longest: float
    stretches: np.ndarray

    def branch(self, law: Any, log_tau: np.ndarray, accuracy: float) -> Callable[[np.ndarray], np.ndarray]:
        """Return a function of log tau (k,), within `log_tau`, to the values (n, k) of k branches of unit modulus."""

    def equilibrium(self, stress: np.ndarray) -> np.ndarray:
        """Return the values of the equilibrium, shape (n,), from its stresses at `stretches`, shape (m,)."""

    def values(self, material: Any) -> np.ndarray:
        """Return the values of a material with its own constants, shape (n,)."""


class TimedRows:
    """Nominal stresses of a test in time (`Rows`)."""

    floor = MIN_DIVISOR

    def __init__(self, test: TimedTest):
        steps = np.diff(test.times)
        self._test, self._given = test, np.isfinite(test.stress)
        self.name = test.mode
        self.measured = test.stress[self._given]
        self.shortest = float(min(steps[steps > 0], default=np.inf))
        self.longest = float(np.ptp(test.times))
        self.stretches = homogeneous.in_plane_stretches(test.mode, test.stretches[self._given])

    def branch(self, law: Any, log_tau: np.ndarray, accuracy: float) -> Callable[[np.ndarray], np.ndarray]:
        from scipy.interpolate import CubicSpline
        test, tau = self._test, np.exp(log_tau)
        unit = law.unit_stress(test.mode, tau, test.times, test.stretches, test.between, accuracy)
        return CubicSpline(log_tau, unit[self._given], axis=1)

    def equilibrium(self, stress: np.ndarray) -> np.ndarray:
        return stress

    def values(self, material: Any) -> np.ndarray:
        test = self._test
        return material.stress(test.mode, test.stretches, times=test.times, between=test.between)[self._given]


class OscillationRows:
    """Storage moduli of a test by oscillations, then its loss moduli (`Rows`)."""

    floor = 0.0

    def __init__(self, test: OscillationTest):
        self._test = test
        self._given = np.isfinite(np.append(test.storage, test.loss))
        self.name = f"{test.mode} oscillation"
        self.measured = np.append(test.storage, test.loss)[self._given]
        self.shortest, self.longest = 1 / float(test.frequencies.max()), 1 / float(test.frequencies.min())
        self.stretches = homogeneous.in_plane_stretches("uniaxial", np.array([1 + _STRAIN, 1 - _STRAIN]))

    def branch(self, law: Any, log_tau: np.ndarray, accuracy: float) -> Callable[[np.ndarray], np.ndarray]:
        return self._unit_moduli

    def values(self, material: Any) -> np.ndarray:
        mu, tau = np.reshape(material.branches, (-1, 2)).T
        return equilibrium_values([self], material.equilibrium) + self._unit_moduli(np.log(tau)) @ mu

    def equilibrium(self, stress: np.ndarray) -> np.ndarray:
        shear_modulus = (stress[0] - stress[1]) / (6 * _STRAIN)
        storage = OSCILLATIONS[self._test.mode] * shear_modulus
        return np.append(np.full(len(self._test.storage), storage), np.zeros(len(self._test.loss)))[self._given]

    def _unit_moduli(self, log_tau: np.ndarray) -> np.ndarray:
        """Return the moduli of k branches of unit shear modulus, (n, k)."""
        moduli = np.concatenate(complex_modulus(self._test.frequencies, np.exp(log_tau)))
        return OSCILLATIONS[self._test.mode] * moduli[self._given]


def row_divisors(rows: list[Rows], relative: Any, weights: list[float]) -> np.ndarray:
    """Return the divisors of the misfits in all rows, shape (n,) (`divisors`)."""
    return divisors([part.measured for part in rows], relative, weights, [part.floor for part in rows])


def largest_I1(rows: list[Rows]) -> float:
    """Return the largest first invariant of C at the stretches of all rows."""
    l1, l2 = np.hstack([part.stretches for part in rows])
    return float(np.max(l1**2 + l2**2 + (l1 * l2) ** -2))


def rows_of(test: TimedTest | OscillationTest) -> Rows:
    """Return the rows of a checked test."""
    return OscillationRows(test) if isinstance(test, OscillationTest) else TimedRows(test)


def equilibrium_values(rows: list[Rows], material: Material | None, constants: Any = None) -> np.ndarray:
    """Return an equilibrium's values (n,), None: 0, with `constants` if given; inf or nan beyond its limit."""
    if material is None:
        return np.zeros(sum(len(part.measured) for part in rows))
    values = material.parameters.values() if constants is None else constants
    stress = material.response.stress(np.hstack([part.stretches for part in rows]), values)[0]
    ends = np.cumsum([part.stretches.shape[1] for part in rows])[:-1]
    return np.concatenate([part.equilibrium(own) for part, own in zip(rows, np.split(stress, ends))])


def at_reference(test: TimedTest | OscillationTest, factor: float) -> TimedTest | OscillationTest:
    """Return a test with the times or frequencies that it has at the reference temperature, for its shift aT."""
    if isinstance(test, OscillationTest):
        return test._replace(frequencies=np.asarray(test.frequencies, float) * factor)
    return test._replace(times=np.asarray(test.times, float) / factor)
