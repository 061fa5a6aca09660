r"""Relaxing branches in homogeneous tests: integration of their elastic strains in time.

In principal direction i the body has the stretch l_i. A branch has the elastic part w_i of the logarithmic strain, the
modulus mu, and the Kirchhoff stress :math:`\mu \exp(2 w_i)` besides a pressure. The elastic strain relaxes by the flow
law of the material (`formingx.materials.viscoelastic`).
"""

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..errors import ConvergenceError, InputError, check_name
from .homogeneous import MODES

BETWEEN = ("stretch", "strain")
"""Quantities that may have a constant rate between two times: the stretch, or the logarithmic strain (Hencky rate)."""


def elastic_strains(flow: Callable, tau: Any, mode: str, times: np.ndarray, stretches: np.ndarray,
                    between: str = "stretch", accuracy: float = 1e-10) -> np.ndarray:
    r"""Integrate the elastic logarithmic strains w of relaxing branches over the time of a homogeneous test.

    .. math:: \frac{dw_i}{dt} = \frac{d \ln l_i}{dt} - \frac{f_i(w)}{2 \tau}

    Here :math:`l_i` is the principal stretch of the body, w_i the elastic strain and tau the relaxation time of a
    branch. The flow law of the material is f, for example :math:`f_i = e^{2 w_i} - \tfrac{1}{3} \sum_j e^{2 w_j}`.
    Branches have relaxation times (branches,), and f maps w to f(w), both (branches, 3). Times and stretches have shape
    (n,); two stretches at one time are a jump, and `between` has a constant rate, "stretch" or "strain". The result has
    shape (n, branches, 3); a ConvergenceError says where the integration stopped.
    """
    from scipy.integrate import solve_ivp
    check_name("elastic_strains: mode", mode, MODES)
    direction = np.array([1, MODES[mode], -1 - MODES[mode]])
    strain, tau = np.log(stretches), np.asarray(tau, float)[:, None]
    w = np.empty((len(times), len(tau), 3))
    w[0] = strain[0] * direction
    for first, last in _pieces(times, stretches if between == "stretch" else strain):
        duration = times[last] - times[first]
        if duration == 0:
            w[last] = w[first] + (strain[last] - strain[first]) * direction
            continue
        start, speed = stretches[first], (stretches[last] - stretches[first]) / duration

        def rate(t, x, start=start, speed=speed, constant=(strain[last] - strain[first]) / duration):
            r = speed / (start + speed * t) if between == "stretch" else constant
            x = x.reshape(-1, 3)
            return (r * direction - flow(x) / (2 * tau)).ravel()

        found = solve_ivp(rate, (0, duration), w[first].ravel(), method="LSODA", t_eval=times[first + 1:last + 1]
                          - times[first], rtol=accuracy, atol=accuracy / 10, lband=2, uband=2)
        if not found.success or not np.all(np.isfinite(found.y)):
            raise ConvergenceError(f"the branches cannot be integrated in time: {found.message}")
        w[first + 1:last + 1] = found.y.T.reshape(last - first, -1, 3)
    return w


def checked(name: str, mode: Any, times: Any, stretches: Any, between: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return times and stretches of a homogeneous test as arrays, shape (n,) each, checked.

    An unknown mode or `between` ("stretch" or "strain"), other shapes, descending times or stretches that are not
    positive are an InputError.
    """
    check_name(f"{name}: mode", mode, MODES)
    check_name(f"{name}: between", between, BETWEEN)
    try:
        t, l = np.asarray(times, float), np.asarray(stretches, float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: times and stretches must be numbers") from None
    if t.ndim != 1 or t.shape != l.shape or not len(t):
        raise InputError(f"{name}: stretches have the shape {l.shape}, times {t.shape}: must be (n,), a time for each")
    for i in np.flatnonzero(~(np.isfinite(t) & np.isfinite(l) & (l > 0)))[:1]:
        raise InputError(f"{name}, point {i}: time = {t[i]:.6g}, stretch = {l[i]:.6g}: must be finite, and the stretch"
                         f" greater than 0")
    for i in np.flatnonzero(np.diff(t) < 0)[:1]:
        raise InputError(f"{name}: time {t[i + 1]:.6g} comes after {t[i]:.6g}: times must not fall")
    return t, l


def _pieces(times: np.ndarray, values: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield the indices (first, last) of the ends of each interval of `times` in which `values` change linearly."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.diff(values) / np.diff(times)
    scale = 1e-9 * np.abs(rates[np.isfinite(rates)]).max(initial=0)
    whole = np.where(np.isfinite(rates), np.abs(np.diff(rates, prepend=np.nan)), np.inf) <= scale
    begins = [*np.flatnonzero(~whole), len(rates)]
    yield from itertools.pairwise(begins)
