"""Damping functions h(I1, I2) of the stress that a past state contributes, for `KBKZ`."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ...errors import InputError, finite, positive

_MIN_ROOT = 1e-4
"""Smallest square root s in Wagner's exponent for the slope of h, which is infinite at s = 0."""


class Damping:
    """Damping function h(I1, I2) of the Finger tensor B of the deformation since a past state, for `KBKZ`.

    It is 1 where I1 = tr B and I2 = tr B^-1 are both 3. With a term in I2 the stress h B has no potential: only
    functions of I1 alone have one.

    Attributes:
        bounds: {constant: (lowest, highest)} of the constants that `fit` varies, in the order of the arguments.
    """

    def __call__(self, I1: Any, I2: Any) -> Any:
        """Return the damping h, the factor of a past state's stress, at invariants I1 and I2 of equal shape."""
        return self.derivatives(I1, I2)[0]

    def derivatives(self, I1: Any, I2: Any) -> tuple[Any, Any, Any]:
        """Return the damping h, the factor of a past state's stress, and its derivatives by the invariants.

        Args:
            I1: trace of the Finger tensor B of the deformation since the past state, any shape.
            I2: trace of the inverse of B, the same shape.

        Returns:
            h, dh/dI1 and dh/dI2, the same shape each.
        """
        raise NotImplementedError

    bounds: Mapping[str, tuple[float, float]] = MappingProxyType({})

    @property
    def of_I1_alone(self) -> bool:
        """True if h depends on I1 alone, so that the stress has a potential and the tangent is symmetric."""
        return not np.any(self.derivatives(np.array(5.0), np.array(5.0))[2])

    def __str__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in vars(self).items())})"

    __repr__ = __str__


class PSM(Damping):
    r"""Damping of Papanastasiou, Scriven and Macosko, J. Rheol. 27 (1983) 387.

    .. math:: h = \frac{\alpha}{(\alpha - 3) + \beta I_1 + (1 - \beta) I_2}

    Args:
        alpha: constant, above 0; damping decreases with it.
        beta: share of I1, from 0 to 1; damping increases with it in uniaxial, and decreases in equibiaxial extension.

    Raises:
        InputError: a constant that is not allowed.

    >>> melt = fx.KBKZ([(0.1, 1.0), (0.02, 10.0)], damping=fx.PSM(alpha=10.0, beta=0.5))         # (modulus, time)
    """

    def __init__(self, alpha: float, beta: float):
        self.alpha, self.beta = positive("PSM: alpha", alpha), _share("PSM: beta", beta)

    bounds = MappingProxyType({"alpha": (1e-3, 1e3), "beta": (0.0, 1.0)})

    def derivatives(self, I1, I2):
        h = self.alpha / (self.alpha - 3 + self.beta * I1 + (1 - self.beta) * I2)
        return h, -self.beta * h**2 / self.alpha, -(1 - self.beta) * h**2 / self.alpha


class Wagner(Damping):
    r"""Damping of Wagner, Rheol. Acta 15 (1976) 136 and 18 (1979) 33.

    .. math:: h = \exp\left(-\beta \sqrt{\alpha I_1 + (1 - \alpha) I_2 - 3}\right)

    Args:
        alpha: share of I1, from 0 to 1.
        beta: exponent, above 0; damping increases with it.

    Raises:
        InputError: a constant that is not allowed.

    >>> fx.Wagner(alpha=0.1, beta=0.2)
    Wagner(alpha=0.1, beta=0.2)
    """

    def __init__(self, alpha: float, beta: float):
        self.alpha, self.beta = _share("Wagner: alpha", alpha), positive("Wagner: beta", beta)

    bounds = MappingProxyType({"alpha": (0.0, 1.0), "beta": (1e-4, 10.0)})

    def derivatives(self, I1, I2):
        return _exponential(self.alpha, [(1.0, self.beta)], I1, I2)


def LuoTanner(n: float, beta: float) -> Wagner:  # noqa: N802  a card's name for a law
    r"""Return Wagner's damping in the notation of Luo and Tanner.

    .. math:: h = \exp\left(-n \sqrt{\beta I_1 + (1 - \beta) I_2 - 3}\right)

    Args:
        n: exponent n, positive; damping increases with it.
        beta: share of I1, from 0 to 1.

    Returns:
        The damping function.

    Raises:
        InputError: a constant that is not allowed.

    >>> fx.LuoTanner(n=0.2, beta=0.1)
    Wagner(alpha=0.1, beta=0.2)
    """
    return Wagner(alpha=_share("LuoTanner: beta", beta), beta=positive("LuoTanner: n", n))


class DoubleWagner(Damping):
    r"""Damping by two exponentials: Osaki (1976), Laun (1978).

    .. math:: h = f e^{-n_1 s} + (1 - f) e^{-n_2 s}, \qquad s = \sqrt{\alpha I_1 + (1 - \alpha) I_2 - 3}

    Args:
        alpha: share of I1, from 0 to 1.
        f: share of the first exponential, from 0 to 1.
        n1: exponent of the first exponential, above 0.
        n2: exponent of the second exponential, above 0.

    Raises:
        InputError: a constant that is not allowed.

    >>> fx.DoubleWagner(alpha=0.05, f=0.57, n1=0.31, n2=0.106)
    DoubleWagner(alpha=0.05, f=0.57, n1=0.31, n2=0.106)
    """

    def __init__(self, alpha: float, f: float, n1: float, n2: float):
        self.alpha, self.f = _share("DoubleWagner: alpha", alpha), _share("DoubleWagner: f", f)
        self.n1, self.n2 = positive("DoubleWagner: n1", n1), positive("DoubleWagner: n2", n2)

    bounds = MappingProxyType({"alpha": (0.0, 1.0), "f": (0.0, 1.0), "n1": (1e-4, 10.0), "n2": (1e-4, 10.0)})

    def derivatives(self, I1, I2):
        return _exponential(self.alpha, [(self.f, self.n1), (1 - self.f, self.n2)], I1, I2)


class SoskeyWinter(Damping):
    r"""Damping of Soskey and Winter, J. Rheol. 28 (1984) 625, with a mixed invariant in place of the squared shear.

    .. math:: h = 1/(1 + a J^{b/2}), \quad J = \alpha I_1 + (1 - \alpha) I_2 - 3

    In shear J is the square of the shear strain, so h = 1/(1 + a shear^b), for any alpha. With b = 2 it is `PSM` with
    1/a in place of alpha and alpha in place of beta.

    Args:
        alpha: share of I1, from 0 to 1.
        a: factor, above 0; damping increases with it.
        b: power of the strain, above 0; 2 in `PSM`.

    Raises:
        InputError: a constant that is not allowed.

    >>> round(float(fx.SoskeyWinter(alpha=0.1, a=0.3, b=1.5)(4.0, 4.0)), 4)                        # a shear of 1
    0.7692
    """

    def __init__(self, alpha: float, a: float, b: float):
        self.alpha = _share("SoskeyWinter: alpha", alpha)
        self.a, self.b = positive("SoskeyWinter: a", a), positive("SoskeyWinter: b", b)

    bounds = MappingProxyType({"alpha": (0.0, 1.0), "a": (1e-4, 10.0), "b": (0.2, 5.0)})

    def derivatives(self, I1, I2):
        J = self.alpha * I1 + (1 - self.alpha) * I2 - 3
        power = self.a * np.maximum(J, 0) ** (self.b / 2)
        h = 1 / (1 + power)
        slope = -h**2 * self.b / 2 * self.a * np.maximum(J, _MIN_ROOT**2) ** (self.b / 2 - 1)
        return h, self.alpha * slope, (1 - self.alpha) * slope


def _exponential(alpha: float, terms: list[tuple[float, float]], I1: Any, I2: Any) -> tuple[Any, Any, Any]:
    """Return the damping h as a sum of exponentials f exp(-n s), and its derivatives dh/dI1 and dh/dI2.

    The strain s is sqrt(alpha I1 + (1 - alpha) I2 - 3) with I1 = tr B, I2 = tr B^-1 of the Finger tensor B.
    """
    s = np.sqrt(np.maximum(alpha * I1 + (1 - alpha) * I2 - 3, 0))
    each = [f * np.exp(-n * s) for f, n in terms]
    slope = -sum(n * h for (_, n), h in zip(terms, each)) / (2 * np.maximum(s, _MIN_ROOT))
    return sum(each), alpha * slope, (1 - alpha) * slope


def _share(name: str, value: Any) -> float:
    """Return a number that must lie between 0 and 1; raise an InputError with its name otherwise."""
    if not 0 <= (number := finite(name, value)) <= 1:
        raise InputError(f"{name} = {value!r}: must be from 0 to 1")
    return number
