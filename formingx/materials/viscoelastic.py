"""Two laws of relaxing branches: finite viscoelasticity with Gaussian springs, and transient networks."""

from typing import Any

import numpy as np
import ufl

from ..errors import check_name
from .material import Material
from .relaxing import GeneralisedMaxwell
from .tensors import cofactor, determinant, deviator_squared, entries, inner, plus


class Viscoelastic(GeneralisedMaxwell):
    r"""Finite viscoelasticity with Gaussian springs.

    .. math::
        W = W_{eq}(C) + \sum_k \frac{\mu_k}{2} \left[\mathrm{tr}(C C_{v,k}^{-1}) - 3\right], \qquad
        \frac{dC_{v,k}}{dt} = \frac{1}{\tau_k} \left[C - \tfrac{1}{3} \mathrm{tr}(C C_{v,k}^{-1}) C_{v,k}\right].

    Branch k has the shear modulus mu_k, the relaxation time tau_k and the internal variable Cv_k. Its determinant is 1,
    and it equals I in the reference configuration. C is the isochoric right Cauchy-Green tensor, W_eq the equilibrium
    energy. The law is known from Leonov (1976), Simo and Miehe (1992), Le Tallec, Rahier and Kaiss (1993), Reese and
    Govindjee (1998), Kumar and Lopez-Pamies (2016). With the equilibrium modulus mu_eq the small-strain relaxation
    modulus is

    .. math:: \mu(t) = \mu_{eq} + \sum_k \mu_k \exp(-t / \tau_k).

    In steady extension the stress of a branch is proportional to the rate, with the viscosity 3 mu tau.

    A step of the implicit Euler method has a closed form (Shutov, Landgraf and Ihlemann 2013). Let Cv_n be the internal
    variable at the beginning of the step, and G = Cv_n, x' = dt/tau. With a = det G and b = det(G + x' C), the internal
    variable at the end of the step and the potential of the step are

    .. math::
        C_v = \frac{G + x' C}{b^{1/3}}, \qquad
        \frac{3 \mu}{2} \, \frac{\mathrm{cof}\, G : C + x' \, \mathrm{cof}\, C : G + x'^2 \det C}
        {b^{2/3} + (a b)^{1/3} + a^{2/3}}.

    The potential is regular at dt = 0. The step is of second order in time with

    .. math::
        G = C_{v,n} + \frac{x}{2} C_n, \qquad
        x' = \frac{x}{2} \left[1 + \frac{x}{3} \mathrm{tr}(C_n C_{v,n}^{-1})\right],
        \qquad x = \frac{dt}{\tau}

    Args:
        equilibrium: material that describes the relaxed state; None if all stress relaxes.
        branches: list of (mu, tau), at least one: shear modulus, stress, and relaxation time, time; each positive.
        order: order of a step in time, 2 or 1.
        shift: `WLF`, `Arrhenius`, or any function aT(T) of an array of temperatures, by which each tau is multiplied.
            None: the relaxation times do not depend on the temperature.

    >>> melt = fx.Viscoelastic(fx.NeoHookean(c10=0.1), branches=[(0.6, 0.1), (0.3, 2.0)])
    >>> round(melt.shear_modulus, 12)
    1.1
    """

    _tensor = "Cv"

    def __init__(self, equilibrium: Material | None, branches: Any, order: int = 2, shift: Any = None):
        check_name("Viscoelastic: order", order, (1, 2))
        self._stores_C = order == 2
        super().__init__(equilibrium, branches, shift)

    def _metric(self, Cv):
        return cofactor(Cv)

    def _stored(self, C, Cv):
        return inner(C, self._metric(Cv)) - 3

    def _dissipated(self, C, Cv):
        return deviator_squared(C, self._metric(Cv))

    def _step(self, C, past, Cv, x):
        G, x = self._step_start(past, Cv, x)
        a, s = determinant(G), inner(cofactor(G), C) + x * inner(cofactor(C), G) + x**2
        p, q = a ** (1 / 3), (a + x * s) ** (1 / 3)
        return 3 * s / (q**2 + p * q + p**2) - 3

    def _advanced(self, C, past, Cv, x):
        G, x = self._step_start(past, Cv, x)
        grown = plus(G, C, x)
        scale = determinant(grown) ** (-1 / 3)
        return tuple(scale * g for g in grown)

    def _step_start(self, past, Cv, x):
        r"""Return the tensor G, entries (11, 22, 12, 33), and the factor x' of the closed form of a step.

        At the end of the step the internal variable is G + x' C, scaled to the determinant 1. C is the isochoric right
        Cauchy-Green tensor there.

        .. math:: G = C_{v,n} + \frac{x}{2} C_n, \qquad
                  x' = \frac{x}{2} \left[1 + \frac{x}{3} \mathrm{tr}(C_n C_{v,n}^{-1})\right]

        A step of first order has G = Cv_n and x' = x. C_n is `past`, None for a step of first order, Cv_n is `Cv`, and
        x is the step over the relaxation time.
        """
        if past is None:
            return Cv, x
        return plus(Cv, past, x / 2), x / 2 * (1 + x / 3 * inner(past, cofactor(Cv)))

    @staticmethod
    def _flow(w):
        m = np.exp(2 * w)
        return m - m.mean(axis=-1, keepdims=True)


class TransientNetwork(GeneralisedMaxwell):
    r"""Networks whose chains break and form again stress-free, equal to the upper-convected Maxwell law.

    The law is by Green and Tobolsky (1946). The Kirchhoff stress of a branch, besides a pressure, is

    .. math:: \tau_K = \mu F A F^T, \qquad \frac{dA}{dt} = \frac{C^{-1} - A}{\tau},

    with the internal variable A, which equals I in the reference configuration. C is the isochoric right Cauchy-Green
    tensor, mu the shear modulus and tau the relaxation time. The law is linear in C^-1: in steady extension faster than
    1/(2 tau) the stress grows without bound. The stored energy is

    .. math:: \frac{\mu}{2} \left[\mathrm{tr}(C A) - 3 - \ln \det A\right].

    A step takes C^-1 as a parabola in time, through its value at the end of the step and two earlier values. It is
    therefore of third order in time, and of second order however small tau is. For dt >> tau the stress follows the
    rate at the end of the step, by BDF2 with variable steps. Let n denote the beginning of the step, x = dt/tau, and s
    the ratio of the step to the previous one. The potential of the step and A at its end are

    .. math::
        W_{step} &= \frac{\mu}{2} \mathrm{tr}(C M), \qquad A = M + (1 - m - p) C^{-1}, \\
        M &= e^{-x} A_n + (m - e^{-x} + p) C_n^{-1} + p s (C_n^{-1} - C_{n-1}^{-1}), \\
        m &= \frac{1 - e^{-x}}{x}, \qquad p = \frac{x - 2 + (x + 2) e^{-x}}{x^2} \, \frac{s}{1 + s}.

    Args:
        equilibrium: material that describes the relaxed state; None if all stress relaxes.
        branches: list of (mu, tau), at least one: shear modulus, stress, and relaxation time, time; each positive.
        shift: `WLF`, `Arrhenius`, or any function aT(T) of an array of temperatures, by which each tau is multiplied.
            None: the relaxation times do not depend on the temperature.

    >>> fx.TransientNetwork(None, branches=[(0.05, 1.0)]).shear_modulus
    0.05
    """

    _tensor, _power = "A", -1
    motion_variables = ("change", "pace")

    @property
    def internal(self) -> dict[str, Any]:  # type: ignore[override]  # read only here
        return super().internal | {"change": (0.0,) * 4, "pace": 0.0}

    def _past(self, internal, time_step):
        r"""Return the earlier deformation that a step needs: two tensors, entries (11, 22, 12, 33), and a factor.

        .. math:: C_n^{-1}, \qquad s \, (C_n^{-1} - C_{n-1}^{-1}), \qquad \frac{s}{1 + s}

        C_n and C_n-1 are the isochoric right Cauchy-Green tensors at the beginning of the step and of the previous
        step. The length of the step over the length of the previous one is s; it is 0 if the previous step is unknown.
        The factor s/(1 + s) is multiplied by 2 - s/2 for s from 2 to 4, and is 0 for larger s, because BDF2 would be
        unstable. It is also 0 where the tensor M of the step (`_past_tensor`) would not be positive definite.
        `internal` has {name: internal variable at the beginning of the step (UFL, shape () or (4,))}.
        """
        s, change = time_step * internal["pace"], entries(internal["change"])
        near = ufl.max_value(0, ufl.min_value(1, 2 - s / 2))        # steps that grow faster make BDF2 unstable
        small = ufl.lt(-inner(entries(internal["C"]), change), 1)       # else M is not positive definite
        share = ufl.conditional(small, near * s / (1 + s), 0)
        return cofactor(entries(internal["C"])), tuple(s * c for c in change), share

    def _deformation_history(self, C, internal, time_step):
        moves = ufl.gt(time_step, 0)
        return {"C": C, "change": plus(cofactor(C), cofactor(entries(internal["C"])), -1),
                "pace": ufl.conditional(moves, 1 / ufl.conditional(moves, time_step, 1), 0)}

    def _metric(self, A):
        return A

    def _stored(self, C, A):
        return inner(C, A) - 3 - ufl.ln(determinant(A))

    def _dissipated(self, C, A):
        return inner(C, A) + inner(cofactor(C), cofactor(A)) / determinant(A) - 6

    def _step(self, C, past, A, x):
        return inner(C, self._past_tensor(past, A, x)) - 3

    def _advanced(self, C, past, A, x):
        return plus(self._past_tensor(past, A, x), cofactor(C), 1 - _mean_decay(x) - past[2] * _parabola_weight(x))

    def _past_tensor(self, past, A, x):
        r"""Return the tensor M in the potential mu/2 [tr(C M) - 3] of a branch in a step, entries (11, 22, 12, 33).

        Here mu is the shear modulus of the branch, and C the isochoric right Cauchy-Green tensor at the end of the
        step. Its value at the beginning is C_n, at the beginning of the previous step C_n-1:

        .. math:: M = e^{-x} A_n + (m - e^{-x} + p) C_n^{-1} + p s (C_n^{-1} - C_{n-1}^{-1}), \qquad
                  m = \frac{1 - e^{-x}}{x}, \qquad p = \frac{x - 2 + (x + 2) e^{-x}}{x^2} \, \frac{s}{1 + s}

        `past` is the result of `_past`, A is A_n, and x is the step over the relaxation time.
        """
        before, change, share = past
        decay, p = ufl.exp(-x), share * _parabola_weight(x)
        return tuple(decay * a + (_mean_decay(x) - decay + p) * c + p * d for a, c, d in zip(A, before, change))

    @staticmethod
    def _flow(w):
        return 1 - np.exp(-2 * w)


def _mean_decay(x: Any) -> Any:
    """Return (1 - e^-x)/x (UFL), the mean of e^-x over a step of x relaxation times, by its series for x < 0.01."""
    small = ufl.lt(x, 1e-2)
    y = ufl.conditional(small, 1, x)                            # the value that is not taken must be finite too
    return ufl.conditional(small, 1 - x / 2 + x**2 / 6 - x**3 / 24 + x**4 / 120 - x**5 / 720, (1 - ufl.exp(-y)) / y)


def _parabola_weight(x: Any) -> Any:
    """Return [x - 2 + (x + 2) e^-x]/x^2 (UFL), a factor of p in a step, by its series for x < 0.01.

    Here x is the length of the step over the relaxation time. The other factor of p is s/(1 + s), with the ratio s of
    the step to the previous one.
    """
    small = ufl.lt(x, 1e-2)
    y = ufl.conditional(small, 1, x)
    series = x * (1 / 6 - x / 12 + x**2 / 40 - x**3 / 180 + x**4 / 1008)
    return ufl.conditional(small, series, (y - 2 + (y + 2) * ufl.exp(-y)) / y**2)
