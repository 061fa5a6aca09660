"""Stress of a material as an integral over all its past states, at points: `KBKZ` in a scene.

The weight of past state k in the sum of `MemoryIntegral` is the sum of G_j w_kj over the relaxation modes j. The
weights w_kj are exact if h C_k^-1 is linear in the age between states. The first state, undeformed, represents all
earlier time; the last one contributes only a pressure. In a form S is linear in Cbar and in the time step, exact where
it is refreshed, with the consistent tangent.
"""

from typing import Any

import numpy as np

from ...materials.tensors import cofactor, entries
from .past_states import PastStates

_MULTIPLICITY = np.array([1.0, 1.0, 2.0, 1.0])[:, None]
"""Number of times that each entry (11, 22, 12, 33) occurs in the tensor."""


class MemoryIntegral:
    r"""Stress as a sum over the past states of a material with relaxation modes (G, tau).

    .. math:: S = \sum_k W_k \, h(I_1, I_2) \, \bar C_k^{-1}, \quad
        I_1 = \bar C : \bar C_k^{-1}, \quad I_2 = \bar C^{-1} : \bar C_k

    S is the second Piola-Kirchhoff stress up to a pressure, W_k the weight of past state k, h the damping function.
    Tensors at n points are stored as entries 11, 22, 12, 33, shape (4, n). Cbar = J^(-2/3) C. `spectrum` is a list of
    (G, tau), stress and time; without a `damping`, h = 1. It is `irreversible` if h of a past state never increases,
    and `shifted` if the reduced time depends on the temperature.
    """

    coefficients = {"past_S": (0.0,) * 4, "past_C": (1.0, 1.0, 0.0, 1.0), "past_D": ((0.0,) * 4,) * 4,
                    "past_T": (0.0,) * 4}
    """Initial values of the coefficients of a form: S - T dt, Cbar, dS/dCbar and T = dS/dt at the last refresh.

    The entries of S and T are multiplied by their number in the tensor.
    """

    def __init__(self, spectrum: list[tuple[float, float]], damping: Any, irreversible: bool, shifted: bool):
        self.modulus, self.tau = np.array(spectrum).T
        self.damping, self.irreversible, self.shifted = damping, irreversible, shifted

    def history(self, forms: Any, terms: Any) -> PastStates:
        """Return the history variables of a material with this integral: its past states."""
        return PastStates(forms, terms)

    def weights(self, ages: np.ndarray) -> np.ndarray:
        """Return weights (K, modes[, n]) of past states for unit modes, by ages in reduced time (K[, n]), down to 0."""
        x = ages[:, None] / (self.tau if ages.ndim == 1 else self.tau[:, None])
        step, young = x[:-1] - x[1:], np.exp(-x[1:])
        mean = _mean_decay(step)
        w = np.zeros_like(x)
        w[0] = np.exp(-x[0])
        w[:-1] += young * (mean - np.exp(-step))
        w[1:] += young * (1 - mean)
        known = step[:-1] > 0                                   # a step before allows a parabola
        s = np.where(known, step[1:] / np.where(known, step[:-1], 1), np.inf)
        ends, middle, first = (young[1:] * _quadratic_weight(step[1:]) * c for c in _parabola_factors(s))
        w[2:] -= ends
        w[1:-1] += middle
        w[:-2] -= first
        return w

    def weights_after(self, weights: np.ndarray, step: Any, last_step: Any = 0.0,
                      allowed: Any = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the weights W of K past states after a step in reduced time, stress, and their slopes by its length.

        The stress is the sum of W h Cbar_k^-1; results have shape (K, n) or (K, 1), the given weights (K, modes[, n]).
        They are exact for a parabola of h Cbar_k^-1 in time, so long steps are of second order too. Steps are numbers
        or (n,); without `last_step`, or where `allowed` is 0, it is linear.
        """
        each = weights.ndim == 3
        y = np.atleast_1d(step) / self.tau[:, None]                         # (modes, n or 1)
        decay, G = np.exp(-y), self.modulus[:, None]
        decayed = decay * (weights if each else weights[:, :, None])
        W, slope = np.sum(G * decayed, axis=1), -np.sum(G / self.tau[:, None] * decayed, axis=1)
        mean = _mean_decay(y)
        W[-1] += np.sum(G * (mean - decay), axis=0)
        slope[-1] += np.sum(G / self.tau[:, None] * (_mean_decay_slope(y) + decay), axis=0)
        if len(W) > 1 and np.any(last_step):
            known = np.asarray(last_step) > 0
            rate = np.where(known, allowed / np.where(known, last_step, 1), 0)
            shape = len(W), max(W.shape[1], np.size(rate))
            W, slope = np.broadcast_to(W, shape).copy(), np.broadcast_to(slope, shape).copy()
            quadratic = np.sum(G * _quadratic_weight(y), axis=0)
            by_step = np.sum(G / self.tau[:, None] * _quadratic_weight_slope(y), axis=0)
            _, middle, first = _parabola_factors(step * rate)
            middle_slope, first_slope = _parabola_factor_slopes(step * rate)
            for k, c, by_s in ((-1, middle, middle_slope), (-2, -first, -first_slope)):
                W[k] += quadratic * c
                slope[k] += by_step * c + quadratic * by_s * rate
        return W, slope

    def inverses_and_damping(self, C: np.ndarray, past: np.ndarray,
                             smallest_h: np.ndarray | None = None) -> tuple[Any, ...]:
        """Return Cbar_k^-1 of K past states, shape (K, 4, n), damping h, and dh/dI1 and dh/dI2, shape (K, n) each.

        Entries are 11, 22, 12, 33: C (4, n), `past` (K, 4, n). `smallest_h`, (K, n), bounds h; None: no bound.
        """
        inverse = _inverse(past)
        if self.damping is None:
            ones = np.ones((len(past), C.shape[1]))
            return inverse, ones, 0 * ones, 0 * ones
        I1 = np.sum(_MULTIPLICITY * inverse * C, axis=1)
        I2 = np.sum(_MULTIPLICITY * past * _inverse(C), axis=1)
        h, h1, h2 = self.damping.derivatives(I1, I2)
        if smallest_h is not None:
            limited = h > smallest_h
            h, h1, h2 = np.where(limited, smallest_h, h), np.where(limited, 0, h1), np.where(limited, 0, h2)
        return inverse, h, h1, h2

    def stress(self, C: np.ndarray, past: np.ndarray, W: np.ndarray, slope: np.ndarray,
               smallest_h: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the stress S without pressure, shape (4, n), dS/dCbar, shape (4, 4, n), and dS/dt, shape (4, n).

        C has shape (4, n), `past` (K, 4, n), W and its slope by t (K, n) or (K, 1), the bound of damping (K, n).
        """
        inverse, h, h1, h2 = self.inverses_and_damping(C, past, smallest_h)
        S, T = (np.einsum("kn,kin->in", np.broadcast_to(w, h.shape) * h, inverse) for w in (W, slope))
        if self.damping is None:
            return S, np.zeros((4, *S.shape)), T
        by_I2 = np.stack([C[3] * past[:, 1] + C[1] * past[:, 3], C[3] * past[:, 0] + C[0] * past[:, 3],
                          -2 * (C[3] * past[:, 2] + C[2] * past[:, 3]),
                          C[1] * past[:, 0] + C[0] * past[:, 1] - 2 * C[2] * past[:, 2]], axis=1)
        slopes = (W * h1)[:, None] * _MULTIPLICITY * inverse + (W * h2)[:, None] * by_I2
        return S, np.einsum("kin,kjn->ijn", inverse, slopes), T

    def potential(self, C: Any, coefficients: dict[str, Any], time_step: Any) -> Any:
        r"""Return a potential whose derivative by F is the stress, without the unsymmetric part of dS/dCbar.

        .. math:: \tfrac12 (S_0 + T \Delta t) : \bar C
            + \tfrac14 (\bar C - \bar C_0) : D : (\bar C - \bar C_0)

        S is linearised about the state of the last refresh, with the isochoric right Cauchy-Green tensor Cbar_0 and the
        time step dt_0. There T = dS/dt and D = dS/dCbar, and S_0 is S - T dt_0. The present ones are Cbar and Delta t.
        The coefficients (UFL) are "past_S" for S_0, "past_C" for Cbar_0, "past_D" for D and "past_T" for T.
        """
        S, D, T = (coefficients[name] for name in ("past_S", "past_D", "past_T"))
        change = _change(C, coefficients)
        linear = sum((S[i] + T[i] * time_step) * C[i] for i in range(4))
        return (linear + sum(D[i, j] * change[i] * change[j] for i in range(4) for j in range(4)) / 2) / 2

    def unsymmetric_work(self, C: Any, dC: Any, coefficients: dict[str, Any]) -> Any:
        r"""Return the virtual work of the unsymmetric part of D = dS/dCbar, which has no potential.

        .. math:: \tfrac14 \delta \bar C : (D - D^T) : (\bar C - \bar C_0)

        Cbar_0 is the isochoric right Cauchy-Green tensor at the last refresh, about which the stress S is linearised.
        There the work is 0. The coefficients (UFL) are "past_C" for Cbar_0 and "past_D" for D; C and dC have the
        entries 11, 22, 12, 33.
        """
        D, change = coefficients["past_D"], _change(C, coefficients)
        return sum((D[i, j] - D[j, i]) * change[j] * dC[i] for i in range(4) for j in range(4)) / 4


def _inverse(C: np.ndarray) -> np.ndarray:
    """Return the inverses of tensors of determinant 1, both as entries 11, 22, 12, 33, shape (..., 4, n)."""
    return np.stack(cofactor(entries(np.moveaxis(C, -2, 0))), axis=-2)


def _change(C: Any, coefficients: dict[str, Any]) -> list[Any]:
    """Return the change of the entries 11, 22, 12, 33 of Cbar since the stress was last linearised (UFL)."""
    return [C[i] - coefficients["past_C"][i] for i in range(4)]


def _mean_decay(x: np.ndarray) -> np.ndarray:
    """Return (1 - e^-x)/x, the mean of e^-t for t from 0 to x; x is an array of any shape."""
    return np.where(x < 1e-12, 1.0, -np.expm1(-x) / np.where(x < 1e-12, 1.0, x))


def _mean_decay_slope(x: np.ndarray) -> np.ndarray:
    """Return the derivative of (1 - e^-x)/x by x, an array of any shape."""
    small = x < 1e-2
    y = np.where(small, 1.0, x)
    series = -1 / 2 + x / 3 - x**2 / 8 + x**3 / 30 - x**4 / 144
    return np.where(small, series, (np.exp(-y) * (1 + y) - 1) / y**2)


def _parabola_factors(s: Any) -> tuple[Any, Any, Any]:
    r"""Return the factors of the three states that fix a parabola in time, shape of s each.

    At a fraction t of the step, from 0 to 1, the parabola deviates from its chord by

    .. math:: -t (1 - t) \left(f y_1 - f (1 + s) y_0 + f s y_{-1}\right), \qquad f = \frac{s}{1 + s}

    with the values y_1 at the end of the step, y_0 at its start and y_-1 at the start of the previous step. The results
    are f, f (1 + s) and f s. For s from 2 to 4 all three are reduced gradually to 0, since BDF2 is unstable for long
    steps. s is the length of the step over the length of the previous one.
    """
    s = np.minimum(s, 4.0)
    share = np.minimum(1.0, 2 - s / 2) * s
    return share / (1 + s), share, share * s / (1 + s)


def _parabola_factor_slopes(s: Any) -> tuple[Any, Any]:
    """Return the derivatives by s of the last two results of `_parabola_factors`, shape of s each."""
    s = np.minimum(s, 4.0)
    share, slope = np.minimum(1.0, 2 - s / 2) * s, np.where(s < 2, 1.0, np.where(s < 4, 2 - s, 0.0))
    return slope, slope * s / (1 + s) + share / (1 + s) ** 2


def _quadratic_weight(x: np.ndarray) -> np.ndarray:
    """Return [x - 2 + (x + 2) e^-x]/x^2, the weight of a parabola's deviation; x is step over relaxation time."""
    small = x < 1e-2
    y = np.where(small, 1.0, x)
    series = x * (1 / 6 - x / 12 + x**2 / 40 - x**3 / 180 + x**4 / 1008)
    return np.where(small, series, (y - 2 + (y + 2) * np.exp(-y)) / y**2)


def _quadratic_weight_slope(x: np.ndarray) -> np.ndarray:
    """Return d/dx of [x - 2 + (x + 2) e^-x]/x^2, in the shape of x, the step over the relaxation time."""
    small = x < 1e-2
    y = np.where(small, 1.0, x)
    series = 1 / 6 - x / 6 + 3 * x**2 / 40 - x**3 / 45 + 5 * x**4 / 1008
    return np.where(small, series, (1 - (y + 1) * np.exp(-y)) / y**2 - 2 * _quadratic_weight(y) / y)
