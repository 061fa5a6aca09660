"""The factorised K-BKZ equation: a fading memory of all past states, each damped by how far it is away.

    tau(t) = integral over t' of m(t - t') h(I1, I2) B(t, t') dt',    m(s) = sum (G_k/tau_k) exp(-s/tau_k),

tau the Kirchhoff stress up to a pressure, B(t, t') the Finger tensor of the deformation from t' to t, I1 = tr B,
I2 = tr B^-1: Kaye (1962), Bernstein, Kearsley and Zapas (1963); factorised, without a term in B^-1, as by Wagner (1976)
and Papanastasiou, Scriven and Macosko (1983). Without damping it is Lodge's (1956) network, `TransientNetwork`.
For homogeneous tests: no material of a scene (`docs/kbkz.md` says why).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError, finite, instance, positive, several
from . import branches
from .homogeneous import MODES
from .in_time import HistoryTests

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS = 1.5
"""Ratio of the ages between which one rule is used; below half the shortest relaxation time there is one panel."""
_STRAIN = 0.25
"""Longest logarithmic strain in a panel."""


class Damping:
    """How much of a past state's stress is left, h(I1, I2), 1 where I1 = I2 = 3.

    With a term in I2 the stress h B has no potential: only functions of I1 alone have one.
    """

    def __call__(self, I1: Any, I2: Any) -> Any:
        """h at invariants of any shape."""
        raise NotImplementedError

    def __str__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in vars(self).items())})"

    __repr__ = __str__


class PSM(Damping):
    """h = alpha/[(alpha - 3) + beta I1 + (1 - beta) I2]: Papanastasiou, Scriven and Macosko, J. Rheol. 27 (1983) 387.

    Args:
        alpha: above 0; the larger, the less is damped.
        beta: from 0 to 1; the smaller, the less is damped in uniaxial, and the more in equibiaxial extension.
    """

    def __init__(self, alpha: float, beta: float):
        self.alpha, self.beta = positive("PSM: alpha", alpha), _share("PSM: beta", beta)

    def __call__(self, I1, I2):
        return self.alpha / (self.alpha - 3 + self.beta * I1 + (1 - self.beta) * I2)


class Wagner(Damping):
    """h = exp(-beta sqrt(alpha I1 + (1 - alpha) I2 - 3)): Wagner, Rheol. Acta 15 (1976) 136 and 18 (1979) 33.

    Args:
        alpha: from 0 to 1, the share of I1.
        beta: above 0; the larger, the more is damped.
    """

    def __init__(self, alpha: float, beta: float):
        self.alpha, self.beta = _share("Wagner: alpha", alpha), positive("Wagner: beta", beta)

    def __call__(self, I1, I2):
        return np.exp(-self.beta * np.sqrt(np.maximum(self.alpha * I1 + (1 - self.alpha) * I2 - 3, 0)))


class KBKZ(HistoryTests):
    """The factorised K-BKZ equation in homogeneous tests, the body at rest before.

    In small strains G(t) = sum G_k exp(-t/tau_k); after a step of strain the stress is G(t) h times that of a neo-
    Hookean body of unit modulus, so that time and strain separate.

    Args:
        spectrum: [(G, tau), ...], at least one: modulus, stress, and relaxation time, time; each above 0.
        damping: `PSM` or `Wagner`, or None: h = 1.
    """

    def __init__(self, spectrum: Any, damping: Damping | None = None):
        pairs = several("KBKZ: spectrum", spectrum, "(G, tau)")
        if not pairs:
            raise InputError(f"KBKZ: spectrum = {spectrum!r}: must be at least one (G, tau)")
        self.spectrum = []
        for k, pair in enumerate(pairs, 1):
            if len(values := several(f"KBKZ: spectrum: number {k}", pair, "G and tau")) != 2:
                raise InputError(f"KBKZ: spectrum: number {k} is {pair!r}: must be (G, tau)")
            self.spectrum.append((positive(f"KBKZ: G_{k}", values[0]), positive(f"KBKZ: tau_{k}", values[1])))
        if damping is not None:
            instance("KBKZ: damping", damping, Damping, "PSM(alpha, beta), Wagner(alpha, beta) or None")
        self.damping = damping

    def relaxation_modulus(self, times: Any) -> np.ndarray:
        """G(t) = sum G exp(-t/tau) of small shear, at times of any shape; stress."""
        t = np.asarray(times, float)
        return sum((G * np.exp(-t / tau) for G, tau in self.spectrum), np.zeros(t.shape))

    def stress(self, mode: str, stretches: Any, times: Any = None, between: str = "stretch") -> np.ndarray:
        """Nominal stress, force over reference area, of a test; stress. Error below 1e-8 of it.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".
            stretches: of any shape without times, (n,) with them.
            times: when the stretches are met, shape (n,), not falling; a step from one stretch to another at the same
                time is put on at once, and so is the first stretch. None: every stretch is put on at once.
            between: what grows at a constant rate between two times, "stretch" or "strain" (logarithmic).

        Raises:
            InputError: unknown mode, a stretch that is not above 0, times that fall or are not one for each stretch.
        """
        if times is None:
            l = np.asarray(stretches, float)
            branches.checked(f"{self}: stress", mode, np.zeros(l.size), l.ravel(), between)
            return self.relaxation_modulus(0.0) * self._strained(mode, l) / l
        t, l = branches.checked(f"{self}: stress", mode, times, stretches, between)
        return np.array([self._at(mode, t[:n + 1], l[:n + 1], between) for n in range(len(t))]) / l

    def _at(self, mode: str, times: np.ndarray, stretches: np.ndarray, between: str) -> float:
        """tau_1 - tau_3 at the last of the times."""
        now, last = times[-1], stretches[-1]
        modulus, tau = np.array(self.spectrum).T
        rested = self.relaxation_modulus(now - times[0]) * self._strained(mode, last)
        ends = self._ages(times, stretches)
        half = np.diff(ends)[:, None] / 2
        age = (ends[:-1, None] + half * (1 + _NODES))
        memory = np.exp(-age[..., None] / tau) @ (modulus / tau)
        relative = last / _between(now - age, times, stretches, between)
        return float(rested + np.sum(half * _WEIGHTS * memory * self._strained(mode, relative)))

    def _ages(self, times: np.ndarray, stretches: np.ndarray) -> np.ndarray:
        """Ages between which the integrand is smooth, rising from 0."""
        whole, shortest = times[-1] - times[0], min(tau for _, tau in self.spectrum)
        count = max(0, int(np.log(max(2 * whole / shortest, 1)) / np.log(_PANELS)) + 1)
        ages = [np.array([0, whole]), shortest / 2 * _PANELS ** np.arange(count), times[-1] - times]
        for i in np.flatnonzero(np.diff(times) > 0):
            parts = int(np.abs(np.log(stretches[i + 1] / stretches[i])) / _STRAIN) + 1
            if parts > 1:
                ages.append(times[-1] - np.linspace(times[i], times[i + 1], parts + 1))
        found = np.unique(np.concatenate(ages))
        return found[found <= whole]

    def _strained(self, mode: str, stretch: np.ndarray) -> np.ndarray:
        """h (B_11 - B_33) of a stretch."""
        square = np.asarray(stretch, float)[..., None] ** (2 * np.array([1, MODES[mode], -1 - MODES[mode]]))
        difference = square[..., 0] - square[..., 2]
        return difference if self.damping is None else difference * self.damping(square.sum(-1), (1 / square).sum(-1))

    def __str__(self) -> str:
        return f"KBKZ({self.spectrum!r}, damping={self.damping})"

    __repr__ = __str__


def _between(at: np.ndarray, times: np.ndarray, stretches: np.ndarray, between: str) -> np.ndarray:
    """The stretches of a history at these times."""
    if between == "stretch":
        return np.interp(at, times, stretches)
    return np.exp(np.interp(at, times, np.log(stretches)))


def _share(name: str, value: Any) -> float:
    if not 0 <= (number := finite(name, value)) <= 1:
        raise InputError(f"{name} = {value!r}: must be from 0 to 1")
    return number
