"""Homogeneous test in time of a material that relaxes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, finite_array, positive
from ...materials import branches


class TimedTest(NamedTuple):
    """Homogeneous test in time, with n points, of a body that is undeformed and relaxed before the test.

    Args:
        mode: "uniaxial", "pure_shear" or "equibiaxial".
        times: times of the points, shape (n,), not decreasing. The first stretch is applied suddenly, at the first
            time. If all stretches are equal and the first time is positive, it is applied at time 0 instead. Two
            stretches at the same time are a jump.
        stretches: stretches at these times, shape (n,).
        stress: nominal stresses at these times, shape (n,); nan where the stress was not measured.
        between: quantity that changes at a constant rate between two points, "stretch" or "strain" (logarithmic).

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
        """Return a relaxation test, with a stretch that is applied suddenly at time 0 and then constant.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".
            stretch: the constant stretch.
            times: times of the measured stresses, above 0, increasing, shape (n,).
            stress: nominal stresses at these times, shape (n,).

        Returns:
            The test.

        Raises:
            InputError: times that are not finite numbers.
        """
        t = np.append(0.0, finite_array("TimedTest: times", times))
        return cls(mode, t, np.full(len(t), stretch), np.append(np.nan, stress))

    @classmethod
    def constant_rate(cls, mode: str, rate: float, stretches: Any, stress: Any) -> TimedTest:
        """Return a test at a constant Hencky rate (rate of the logarithmic strain), which begins at stretch 1.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".
            rate: Hencky rate, 1/time, above 0.
            stretches: stretches of the measured stresses, in order, shape (n,).
            stress: nominal stresses at these stretches, shape (n,).

        Returns:
            The test.

        Raises:
            InputError: a rate or a stretch that is not a positive number.
        """
        l = np.append(1.0, finite_array("TimedTest: stretches", stretches))
        if not np.all(l > 0):
            raise InputError(f"TimedTest: stretches = {stretches!r}: must be above 0")
        times = np.abs(np.log(l)) / positive("TimedTest: rate", rate)
        return cls(mode, times, l, np.append(np.nan, stress), "strain")


def checked_timed_test(name: str, test: TimedTest) -> TimedTest:
    """Return a test with arrays; inconsistent ones, or a first stretch unlike 1 at an unknown time, are an InputError.
    """
    t, l = branches.checked(name, test.mode, test.times, test.stretches, test.between)
    try:
        stress = np.asarray(test.stress, float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: stress = {test.stress!r}: must be numbers") from None
    if stress.shape != t.shape:
        raise InputError(f"{name}: stress has the shape {stress.shape}, times {t.shape}: must be the same")
    if t[0] != 0 and l[0] != 1:                                 # applied at an unknown time
        if np.ptp(l) > 0 or t[0] < 0:
            raise InputError(f"{name}: begins at time {t[0]:.6g} with a stretch of {l[0]:.6g}: since when? Begin with"
                             f" the time at which it was put on, the stress left empty (not a number)")
        t, l, stress = np.append(0.0, t), np.append(l[0], l), np.append(np.nan, stress)
    return test._replace(times=t, stretches=l, stress=stress)
