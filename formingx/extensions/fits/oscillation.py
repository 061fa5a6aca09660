"""Tests by small oscillations (dynamic mechanical analysis): storage and loss modulus over the frequency."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, check_name, finite_array

OSCILLATIONS = {"shear": 1.0, "uniaxial": 3.0}
"""{mode of an oscillation: its modulus over the shear modulus of an incompressible material}."""


class OscillationTest(NamedTuple):
    r"""Test by small oscillations at n frequencies (DMA, rheometer).

    A branch of the shear modulus mu and the relaxation time tau has the storage and the loss modulus

    .. math:: G'(\omega) = \mu \frac{\omega^2 \tau^2}{1 + \omega^2 \tau^2}, \quad
              G''(\omega) = \mu \frac{\omega \tau}{1 + \omega^2 \tau^2}

    In tension E' = 3 G' and E'' = 3 G'', because the material is incompressible (Ferry 1980, chapter 3).

    Args:
        frequencies: angular frequencies omega, 1/time, above 0, shape (n,). It is 2 pi times a frequency in Hz.
        storage: storage moduli, stress, above 0, shape (n,); nan if not measured.
        loss: loss moduli, stress, above 0, shape (n,); nan if not measured.
        mode: "shear" for G' and G'', "uniaxial" for E' and E''.

    >>> omega = np.array([0.1, 1.0, 10.0])
    >>> test = fx.OscillationTest(omega, storage=0.5 * omega**2 / (1 + omega**2), loss=0.5 * omega / (1 + omega**2))
    >>> found = fx.fit(fx.Viscoelastic(None, [(1.0, 3.0)]), [test])
    >>> {name: round(value, 6) for name, value in found.constants.items()}
    {'mu_1': 0.5, 'tau_1': 1.0}
    """

    frequencies: Any
    storage: Any
    loss: Any
    mode: str = "shear"


def checked_oscillation(name: str, test: OscillationTest) -> OscillationTest:
    """Return a test with arrays, in the order of rising frequency; inconsistent arrays are an InputError."""
    check_name(f"{name}: mode", test.mode, OSCILLATIONS)
    omega = finite_array(f"{name}: frequencies", test.frequencies)
    try:
        moduli = [np.asarray(values, float) for values in (test.storage, test.loss)]
    except (TypeError, ValueError):
        raise InputError(f"{name}: storage and loss must be numbers") from None
    if omega.ndim != 1 or not len(omega) or any(values.shape != omega.shape for values in moduli):
        raise InputError(f"{name}: frequencies, storage and loss have the shapes {omega.shape}, {moduli[0].shape} and"
                         f" {moduli[1].shape}: must be (n,), the same for all")
    if not np.all(omega > 0) or any(np.any(values <= 0) or np.any(np.isinf(values)) for values in moduli):
        raise InputError(f"{name}: frequencies, storage and loss must be above 0")
    order = np.argsort(omega, kind="stable")
    return OscillationTest(omega[order], moduli[0][order], moduli[1][order], test.mode)


def complex_modulus(omega: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return storage and loss modulus of branches of unit shear modulus, (n, k), at n frequencies for k times."""
    x = omega[:, None] * tau
    return x**2 / (1 + x**2), x / (1 + x**2)
