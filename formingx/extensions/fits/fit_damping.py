"""Fits of the relaxation spectrum of a melt to oscillation tests, and of its damping to tests at large strain."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, count, finite_array
from ..kbkz.damping import Damping
from ..kbkz.kbkz import KBKZ
from .fit import IN_TIME
from .fit_in_time import checked_tests
from .oscillation import OscillationTest
from .timed_test import TimedTest
from .uncertainty import Uncertainty, uncertainty
from .weights import divisors

_TIMES_PER_DECADE = 2.0
"""Number of relaxation times for each decade of frequency."""
_RANGE_FACTOR = 1.5
"""Factor by which the range of relaxation times exceeds the range of inverse frequencies at both ends."""


class Spectrum(NamedTuple):
    """Relaxation spectrum of a melt, fitted to its storage and loss moduli.

    Attributes:
        pairs: list of (modulus G, relaxation time tau), stress and time, for `KBKZ`.
        deviation: root mean square of the relative misfits of storage and loss modulus.
    """

    pairs: list[tuple[float, float]]
    deviation: float

    @property
    def viscosity(self) -> float:
        """Zero-shear viscosity of the melt, sum of modulus times relaxation time over the pairs; stress times time."""
        return math.fsum(G * tau for G, tau in self.pairs)


def fit_spectrum(frequencies: Any, storage: Any, loss: Any, terms: int | None = None) -> Spectrum:
    r"""Fit a relaxation spectrum to the storage and loss moduli of small oscillations.

    .. math:: G'(\omega) = \sum_k G_k \frac{\omega^2 \tau_k^2}{1 + \omega^2 \tau_k^2}, \quad
              G''(\omega) = \sum_k G_k \frac{\omega \tau_k}{1 + \omega^2 \tau_k^2}

    The relaxation times tau are in geometric progression. The moduli G are nonnegative and minimise the sum of the
    squared relative misfits (Lawson and Hanson 1974). Times with a zero modulus are left out.

    Args:
        frequencies: angular frequencies omega, 1/time, shape (n,).
        storage: storage moduli G' at these frequencies, stress, shape (n,).
        loss: loss moduli G'' at these frequencies, stress, shape (n,).
        terms: number of relaxation times; default two for each decade of frequency.

    Returns:
        Pairs of modulus and relaxation time, with the misfit.

    Raises:
        InputError: arrays of different length, or a number that is not above 0.

    >>> omega = np.geomspace(0.01, 100, 20)
    >>> found = fx.fit_spectrum(omega, omega**2 / (1 + omega**2), omega / (1 + omega**2))              # one time, 1 s
    >>> round(found.viscosity, 2)
    1.0
    """
    from scipy.optimize import nnls
    w, G1, G2 = (finite_array(f"fit_spectrum: {name}", x) for name, x in
                 (("frequencies", frequencies), ("storage", storage), ("loss", loss)))
    if w.ndim != 1 or not w.shape == G1.shape == G2.shape or len(w) < 2:
        raise InputError(f"fit_spectrum: frequencies, storage and loss have the shapes {w.shape}, {G1.shape} and"
                         f" {G2.shape}: must be (n,), the same for all, with 2 or more")
    if not (np.all(w > 0) and np.all(G1 > 0) and np.all(G2 > 0)):
        raise InputError("fit_spectrum: frequencies, storage and loss must be above 0")
    decades = math.log10(w.max() / w.min())
    n = max(2, math.ceil(_TIMES_PER_DECADE * decades) + 1) if terms is None else count("fit_spectrum: terms", terms)
    tau = np.geomspace(1 / (_RANGE_FACTOR * w.max()), _RANGE_FACTOR / w.min(), n)
    x = w[:, None] * tau
    rows = np.vstack([x**2 / (1 + x**2) / G1[:, None], x / (1 + x**2) / G2[:, None]])
    G, misfit = nnls(rows, np.ones(2 * len(w)))
    pairs = [(float(g), float(t)) for g, t in zip(G, tau) if g > 0]
    return Spectrum(pairs, float(misfit / math.sqrt(2 * len(w))))


def fit_damping(material: Any, tests: Any, terms: int | None, relative: bool, weights: list[float], within: Any
                   ) -> tuple[KBKZ, dict[str, float], list[TimedTest], Uncertainty]:
    """Fit the damping function of a melt to tests in time; its spectrum does not change.

    The results are the material, {constant: value}, the tests as arrays and the uncertainty. A material without a
    damping, `terms`, fewer points than constants or wrong tests are an InputError.
    """
    from scipy.optimize import least_squares
    if not isinstance(material, KBKZ) or material.damping is None or not material.damping.bounds:
        raise InputError("fit: KBKZ: give a card with a spectrum and a damping to begin with, such as"
                         " KBKZ(fit_spectrum(...).pairs, SoskeyWinter(0.1, 0.3, 1.5)): its damping is fitted")
    if terms is not None:
        raise InputError(f"fit: terms = {terms!r}: {material} has its times already")
    used = checked_tests(tests, within)
    if any(isinstance(test, OscillationTest) for test in used):
        raise InputError("fit: KBKZ: small oscillations do not depend on the damping: fit_spectrum fits the spectrum to"
                         " them")
    measured = [test.stress[np.isfinite(test.stress)] for test in used]
    sizes, stresses = divisors(measured, relative, weights), np.concatenate(measured)
    law, names = type(material.damping), list(material.damping.bounds)
    low, high = np.array(list(material.damping.bounds.values())).T
    if len(stresses) < len(names):
        raise InputError(f"fit: {len(stresses)} points cannot fix the {len(names)} constants of {law.__name__}")

    def with_damping(damping: Damping) -> KBKZ:
        """Return the melt with another damping; spectrum and equilibrium are unchanged."""
        return KBKZ(material.spectrum, damping, material.equilibrium, irreversible=material.integral.irreversible)

    def stress(x: np.ndarray) -> np.ndarray:
        """Return the nominal stresses at all n measured points for constants x of the damping; nan beyond bounds."""
        if np.any(x < low) or np.any(x > high):
            return np.full(len(stresses), np.nan)
        melt = with_damping(law(*map(float, x)))
        return np.concatenate([melt.stress(t.mode, t.stretches, times=t.times, between=t.between)[
            np.isfinite(t.stress)] for t in used])

    start = np.array([getattr(material.damping, name) for name in names])
    starts = [start, *([np.where(high == 1, 1e-2, start)] if np.any(high == 1) else [])]
    trials = [least_squares(lambda x: (stress(x) - stresses) / sizes, np.clip(x, low + 1e-9, high - 1e-9),
                            bounds=(low, high), x_scale="jac") for x in starts]
    best = min(trials, key=lambda trial: trial.cost).x
    found = dict(zip(names, map(float, best)))
    return with_damping(law(**found)), found, used, uncertainty(stress, found, stresses, sizes)


IN_TIME.append((KBKZ, fit_damping))
