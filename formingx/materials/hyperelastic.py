"""Hyperelastic materials, and user-defined energies."""

import functools
import inspect
import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import ufl

from ..errors import InputError, count, finite, positive
from ..physics import kinematics
from .constants import varying
from .homogeneous import Response
from .material import Material


class NeoHookean(Material):
    """Neo-Hookean material; its shear modulus is 2 c10.

    .. math:: W = c_{10} (I_1 - 3)

    Args:
        c10: constant of I1, stress, greater than 0.

    >>> rubber = fx.NeoHookean(c10=0.4)
    >>> rubber.shear_modulus, round(float(rubber.stress("uniaxial", 2.0)), 6)      # 2 c10 (l - l^-2)
    (0.8, 1.4)
    """

    def __init__(self, *, c10: float):
        self.parameters = {"c10": c10}
        self.check()

    def strain_energy(self, F, c10):
        return c10 * (ufl.inner(F, F) - 3)

    @classmethod
    def guesses(cls, modulus, I1, terms):
        return [cls(c10=modulus / 2)]

    def coordinates(self):
        return [(self.parameters["c10"], 0, math.inf)]


class MooneyRivlin(Material):
    """Mooney-Rivlin material, eq. (4.1) of Song (1993): c10 belongs to I1, c01 to I2.

    .. math:: W = c_{10} (I_1 - 3) + c_{01} (I_2 - 3)

    Args:
        c10: constant of I1, stress, not negative. With a negative constant W would decrease without bound.
        c01: constant of I2, stress, not negative.

    >>> rubber = fx.MooneyRivlin(c10=0.3, c01=0.1)
    >>> round(float(rubber.stress("uniaxial", 2.0)), 6)                            # 2 (c10 + c01/l) (l - l^-2)
    1.225
    """

    def __init__(self, *, c10: float, c01: float):
        self.parameters = {"c10": c10, "c01": c01}
        self.check()

    def check_constants(self, **constants):
        for name, value in constants.items():
            if finite(f"{self}: {name}", value) < 0:
                raise InputError(f"{self} is not stable: with {name} < 0 the energy falls without bound at large"
                                 f" stretch; {name} must be at least 0")

    def strain_energy(self, F, c10, c01):
        I1, I2 = kinematics.invariants(F)
        return c10 * (I1 - 3) + c01 * (I2 - 3)

    @classmethod
    def guesses(cls, modulus, I1, terms):
        return [cls(c10=0.4 * modulus, c01=0.1 * modulus)]

    def coordinates(self):
        return [(value, 0, math.inf) for value in self.parameters.values()]


class Yeoh(Material):
    r"""Material of Yeoh (1993); its shear modulus is 2 c10.

    .. math:: W = c_{10} (I_1 - 3) + c_{20} (I_1 - 3)^2 + c_{30} (I_1 - 3)^3

    W increases with I1 everywhere if

    .. math:: c_{10} > 0, \qquad c_{20} > -\sqrt{3 \, c_{10} c_{30}}, \qquad c_{30} \ge 0

    Args:
        c10: constant of I1 - 3, stress.
        c20: constant of (I1 - 3)^2, stress; 0 is allowed also if c30 is 0.
        c30: constant of (I1 - 3)^3, stress.

    >>> round(float(fx.Yeoh(c10=0.2, c20=0.01, c30=0.001).shear_modulus), 6)
    0.4
    """

    def __init__(self, *, c10: float, c20: float, c30: float):
        self.parameters = {"c10": c10, "c20": c20, "c30": c30}
        self.check()

    def check_constants(self, **constants):
        super().check_constants(**constants)
        c10, c20, c30 = constants.values()
        positive(f"{self}: c10", c10)
        lowest = 0.0 - math.sqrt(3 * c10 * max(c30, 0.0))
        if c30 < 0 or c20 < 0 and c20 <= lowest:
            raise InputError(f"{self} is not stable: its energy does not grow with I1 everywhere; c30 must be at least"
                             f" 0 and c20 greater than -sqrt(3 c10 c30) = {lowest:.6g}")

    def strain_energy(self, F, c10, c20, c30):
        x = ufl.inner(F, F) - 3
        return c10 * x + c20 * x**2 + c30 * x**3

    @classmethod
    def guesses(cls, modulus, I1, terms):
        return [cls(c10=modulus / 2, c20=0, c30=0.1 * modulus / I1**2)]

    def coordinates(self):
        r"""Return the variables that a fit changes in place of the constants, with their bounds.

        .. math:: c_{10}, \qquad c_{20} + 0.99 \sqrt{3 \, c_{10} c_{30}}, \qquad \sqrt{c_{30}}

        All lower bounds are 0: then the constants are admissible, with a margin of 1 % for c20.
        """
        c10, c20, c30 = self.parameters.values()
        return [(x, 0, math.inf) for x in (c10, c20 + 0.99 * math.sqrt(3 * c10 * c30), math.sqrt(c30))]

    def constants_at(self, coordinates):
        c10, above, root = coordinates
        return [c10, above - 0.99 * root * math.sqrt(3 * c10), root**2]


class Gent(Material):
    r"""Material of Gent (1996): the stress grows without bound as I1 - 3 reaches Jm.

    .. math:: W = -\frac{\mu J_m}{2} \ln\left(1 - \frac{I_1 - 3}{J_m}\right)

    Args:
        mu: shear modulus, stress, greater than 0.
        Jm: limit of I1 - 3, greater than 0. In uniaxial tension the largest stretch is about :math:`\sqrt{J_m + 3}`.

    >>> stiffens = fx.Gent(mu=0.8, Jm=50.0)
    >>> round(stiffens.largest_stretch("uniaxial"), 3)                             # l^2 + 2/l - 3 = Jm
    7.261
    """

    def __init__(self, *, mu: float, Jm: float):
        self.parameters = {"mu": mu, "Jm": Jm}
        self.check()

    def check_constants(self, **constants):
        for name, value in constants.items():
            positive(f"{self}: {name}", value)

    @property
    def largest_I1(self):
        return math.inf if self.varies else self.parameters["Jm"] + 3

    def strain_energy(self, F, mu, Jm):
        return -mu * Jm / 2 * _ln(1 - (ufl.inner(F, F) - 3) / Jm)

    @classmethod
    def guesses(cls, modulus, I1, terms):
        return [cls(mu=modulus, Jm=factor * (I1 - 3)) for factor in (1.1, 2, 10)]

    def coordinates(self):
        return [(value, 0, math.inf) for value in self.parameters.values()]


class ArrudaBoyce(Material):
    r"""Eight-chain model of Arruda and Boyce (1993).

    .. math:: \frac{dW}{dy} = \mu N b(y), \qquad y = \sqrt{\frac{I_1}{3 N}},

    with the inverse b of the Langevin function :math:`L(b) = \coth b - 1/b`; y is the stretch of the chains over the
    largest one. The approximation of Kroeger (2015)

    .. math:: b = \frac{3 y - (6 y^3 + y^5 - 2 y^7)/5}{1 - y^2}

    has a relative error of at most 0.28 % for every y, and 0 at y = 0 and 1. With s = y^2 its integral is

    .. math:: W = \mu N \left(\frac{s}{2} - \frac{s^2}{20} - \frac{s^3}{15} - \ln(1 - s)\right),

    minus its value at s = 1/N.

    Args:
        mu: number of chains per volume times Boltzmann's constant times temperature, stress, positive. The initial
            shear modulus is larger: :math:`\mu \, (1 + 3/(5 N) + \dots)`.
        N: number of segments in a chain, greater than 1; I1 stays below 3 N. In uniaxial tension the largest stretch is
            about :math:`\sqrt{3 N}`.

    >>> fx.ArrudaBoyce(mu=0.8, N=25.0).largest_I1                                  # 3 N
    75.0
    """

    def __init__(self, *, mu: float, N: float):
        self.parameters = {"mu": mu, "N": N}
        self.check()

    def check_constants(self, **constants):
        mu, N = constants.values()
        positive(f"{self}: mu", mu)
        if finite(f"{self}: N", N) <= 1:
            raise InputError(f"{self}: N = {N!r}: must be greater than 1, or the chains are fully stretched in the"
                             f" reference configuration")

    @property
    def largest_I1(self):
        return math.inf if self.varies else 3 * self.parameters["N"]

    def strain_energy(self, F, mu, N):
        def w(s):
            return s / 2 - s**2 / 20 - s**3 / 15 - _ln(1 - s)
        return mu * N * (w(ufl.inner(F, F) / (3 * N)) - w(1 / N))

    @classmethod
    def guesses(cls, modulus, I1, terms):
        return [cls(mu=modulus, N=factor * I1 / 3) for factor in (1.1, 2, 10)]

    def coordinates(self):
        mu, N = self.parameters.values()
        return [(mu, 0, math.inf), (N, 1, math.inf)]


class Ogden(Material):
    r"""Material of Ogden, eq. (4.3) of Song (1993).

    .. math:: W = \sum_k \frac{\mu_k}{\alpha_k}
              \left(\lambda_1^{\alpha_k} + \lambda_2^{\alpha_k} + \lambda_3^{\alpha_k} - 3\right)

    The shear modulus is :math:`\tfrac{1}{2} \sum_k \mu_k \alpha_k`. A power with a negative exponent is replaced:

    .. math:: \lambda_1^{\alpha_k} \to (\lambda_2 \lambda_3)^{-\alpha_k}, \ldots \qquad (\alpha_k < 0)

    Both are equal at constant volume (alpha_k = -2 gives I2), but the second is finite in an element that is squeezed
    flat during Newton's method. Otherwise Newton's method fails at the stretches of a blown sheet.

    Args:
        mu: list of the mu_k, stress.
        alpha: list of as many exponents alpha_k, each with mu_k alpha_k > 0.

    >>> same = fx.Ogden(mu=[0.8], alpha=[2.0])                                     # neo-Hookean, c10 = mu/2
    >>> round(float(same.stress("equibiaxial", 2.0)), 6)                           # mu (l - l^-5)
    1.575
    """

    def __init__(self, *, mu: Any, alpha: Any):
        mu, alpha = _as_tuple(mu), _as_tuple(alpha)
        if len(mu) != len(alpha) or not mu:
            raise InputError(f"Ogden: mu = {mu!r} and alpha = {alpha!r} must be as many, and at least one each")
        for exponent in alpha:
            if varying(exponent) is not None:
                raise InputError(f"Ogden: alpha = {alpha!r}: exponents must be numbers; the mu may vary")
        self.parameters = {f"mu{k}": m for k, m in enumerate(mu, 1)} | {f"alpha{k}": a for k, a in enumerate(alpha, 1)}
        self.check()

    def check_constants(self, **constants):
        for m, a in self._pairs(constants):
            if not finite(f"{self}: mu", m) * finite(f"{self}: alpha", a) > 0:
                raise InputError(f"{self} is not stable: the pair mu = {m!r}, alpha = {a!r} has mu alpha <= 0;"
                                 f" every pair must have mu alpha > 0")

    def strain_energy(self, F, **constants):
        energy, J = 0, kinematics.volume_ratio(F)
        for (m, a), (_, exponent) in zip(self._pairs(constants), self._pairs(self.parameters), strict=True):
            powers = kinematics.sum_of_powers(F, a)
            energy += m / a * ((powers if exponent > 0 else J**-a * powers) - 3)
        return energy

    @staticmethod
    def _pairs(constants):
        """Return the list of pairs (mu_k, alpha_k) for {name: value} of the constants."""
        return [(constants[f"mu{k}"], constants[f"alpha{k}"]) for k in range(1, len(constants) // 2 + 1)]

    @classmethod
    def guesses(cls, modulus, I1, terms):
        """Return the initial materials of a fit, one for every choice of `terms` exponents.

        Args:
            modulus: approximate shear modulus of the data, stress.
            I1: not used.
            terms: number of exponents, chosen from 1.3, 2, 5, 10, -2 and -5; None for 3.

        Returns:
            The materials.

        Raises:
            InputError: more than six exponents.
        """
        exponents = (1.3, 2, 5, 10, -2, -5)
        n = count("fit: terms", 3 if terms is None else terms)
        if n > len(exponents):
            raise InputError(f"fit: terms = {terms!r}: Ogden can be fitted with at most {len(exponents)}")
        first = cls(mu=[modulus] * n, alpha=[2.0] * n)
        return [first.with_constants([2 * modulus / n / a / 4 ** max(abs(a) - 2, 0) for a in some] + list(some))
                for some in itertools.combinations(exponents, n)]

    def coordinates(self):
        """Return the variables that a fit changes: all mu_k, then all alpha_k, with bounds.

        Each variable keeps its sign, and alpha_k lies between -30 and 30.
        """
        values = list(self.parameters.values())
        largest = [math.inf] * (len(values) // 2) + [30.0] * (len(values) // 2)
        return [(x, 0, top) if x > 0 else (x, -top, 0) for x, top in zip(values, largest, strict=True)]


class Hyperelastic(Material):
    r"""Material with a user-defined energy, a function of the invariants or of F.

    With :math:`W_i = \partial W / \partial I_i`, a solid without volume term resists a change of its volume by

    .. math:: K = 12 W_1 + 48 W_2 + 36 W_{11} + 144 (W_{12} + W_{22})

    in the reference configuration. If K is negative, the energy is taken at :math:`J^{-1/3} F` in place of F. At
    constant volume both are equal.

    Args:
        energy: function `energy(I1, I2, **constants)` or `energy(F, **constants)` that returns the strain energy per
            reference volume as a UFL scalar (stress). Outside its range the energy and its derivatives should be
            infinite or not a number: a step that leaves the range is halved.
        of: "invariants" for the arguments I1 and I2 of the energy, "F" for the deformation gradient, shape (3, 3).
        constants: values of the constants of the energy by name; exponents may be among them.

    Raises:
        InputError: `energy` is no function of these arguments.

    Example: ``Hyperelastic(lambda I1, I2, c1, c2: c1 * (I1 - 3) + c2 * (I1 - 3)**2, c1=0.2, c2=0.01)``

    >>> def energy(I1, I2, c1, c2):
    ...     return c1 * (I1 - 3) + c2 * (I1 - 3) ** 2
    >>> round(float(fx.Hyperelastic(energy, c1=0.2, c2=0.01).stress("uniaxial", 2.0)), 6)
    0.84
    """

    def __init__(self, energy: Callable, of: str = "invariants", **constants: float):
        if not callable(energy):
            raise InputError(f"Hyperelastic: energy = {energy!r}: must be a function of I1, I2 or of F, and constants")
        if not isinstance(of, str) or of not in ("invariants", "F"):
            raise InputError(f"Hyperelastic: of = {of!r}: must be 'invariants' or 'F'")
        try:
            names = list(inspect.signature(energy).parameters)[2 if of == "invariants" else 1:]
        except ValueError:
            raise InputError(f"Hyperelastic: energy = {energy!r}: its arguments cannot be read; give a Python function"
                             ) from None
        if set(names) != set(constants):
            raise InputError(f"Hyperelastic: the energy takes the constants {names}, given are {sorted(constants)}")
        self.parameters, self._energy, self._of = constants, energy, of
        self.check()

    def strain_energy(self, F, **constants):
        return self._energy_of(kinematics.volume_ratio(F) ** (-1 / 3) * F if self._isochoric else F, constants)

    @property
    def _isochoric(self) -> bool:
        """True if the energy is taken at constant volume: by itself it does not resist a change of the volume."""
        if self.varies:
            return True
        first, second = self._own_response.derivatives(np.ones((3, 1)), self._numbers())
        return bool(first.sum() + second.sum() < 0)

    @functools.cached_property
    def _own_response(self) -> Response:
        """Derivatives of the energy as the user gave it."""
        return Response(lambda F, **constants: self._energy_of(F, constants), list(self.parameters))

    def _energy_of(self, F: Any, constants: dict[str, Any]) -> Any:
        """Return the energy that the user gave, at a deformation gradient F (UFL, shape (3, 3)), as a UFL scalar."""
        arguments = kinematics.invariants(F) if self._of == "invariants" else (F,)
        try:
            energy = ufl.as_ufl(self._energy(*arguments, **constants))
        except Exception as error:
            raise InputError(f"Hyperelastic: the energy fails: {type(error).__name__}: {error}") from error
        if energy.ufl_shape != ():
            raise InputError(f"Hyperelastic: the energy has the shape {energy.ufl_shape}: must be a UFL scalar")
        return energy


def _ln(x: Any) -> Any:
    """Return ln x (UFL). For x < 0 its derivatives too are not a number, unlike the derivatives of `ufl.ln`."""
    return 2 * ufl.ln(ufl.sqrt(x))


def _as_tuple(values: Any) -> tuple:
    """Return a sequence of values as a tuple, and a single value as a tuple with one entry."""
    alone = varying(values) is not None or not hasattr(values, "__iter__") or getattr(values, "ndim", 1) == 0
    return (values,) if alone else tuple(values)
