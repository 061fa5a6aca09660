"""Solidifying material: on cooling a stiff network of chains forms, stress-free in the current shape of the body."""

import copy
from typing import Any

import numpy as np
import ufl

from ..errors import InputError, as_list, check_type, finite, positive
from ..values.table import Table
from .constants import OfTemperature, Sample
from .material import Material, brief
from .tensors import IDENTITY, cofactor, entries, inner, isochoric, plus

_BEFORE, _LAST, _GLASS, _FRACTION = "C_before", "C_last", "A_glass", "fraction"


class Solidification(Material):
    r"""Material that solidifies when it cools, and softens when it is heated again.

    Let phi(T) be the solidified fraction at the temperature T. The material that solidifies in an increment of cooling
    is stress-free in the current shape of the body. With the isochoric right Cauchy-Green tensor C and the energy of
    the base material

    .. math::
        W = W_{base} + \frac{G}{2} \left[\mathrm{tr}(C A) - 3 \varphi\right], \qquad
        dA = C^{-1} d\varphi \;\; (d\varphi > 0), \qquad A \propto \varphi \;\; (d\varphi < 0)

    This is the single-integral network of Green and Tobolsky (J. Chem. Phys. 14 (1946) 80) without relaxation, in which
    chains form by cooling. A modulus that only increases on cooling would pull a formed part back to its reference
    configuration. Solidified material keeps its shape, except for the small strain at which it balances the base. The
    scene needs a temperature, and `heat=Cooling(...)` for changes of it.

    Args:
        base: any material, also one that relaxes.
        modulus: shear modulus G of the solidified material, positive, stress.
        between: two temperatures; phi is 1 at the lower, 0 at the higher, and linear between them.
        fraction: phi(T) as a `table` with values from 1 to 0, constant beyond its ends; in place of `between`.

    Raises:
        InputError: an argument is not allowed.

    >>> fx.Solidification(fx.NeoHookean(c10=0.4), modulus=800.0, between=(90.0, 110.0))
    Solidification(NeoHookean(c10=0.4), modulus=800.0, between=(90, 110))
    """

    def __init__(self, base: Material, modulus: float, between: Any = None, fraction: Table | None = None):
        check_type("Solidification: base", base, Material, "a material")
        if isinstance(base, Solidification):
            raise InputError(f"Solidification: base = {base}: solidifies already: give its base, with one fraction")
        self._base, self._phi = base, _fraction(between, fraction)
        for name in {"G_set", "set_end", "set_middle"} & base.parameters.keys():
            raise InputError(f"Solidification: the base has a constant {name!r}: the name belongs to a constant of"
                             f" Solidification; give it another name")
        # a step extrapolates the logarithm of a constant linearly in time; the logarithm of exp(phi) is phi
        exp_phi = OfTemperature(lambda T: np.exp(self._phi(T)), f"exp({self._phi})")
        self.integral, self.stores_energy, self.symmetric = base.integral, base.stores_energy, base.symmetric
        self.parameters = {**base.parameters, "G_set": positive("Solidification: modulus", modulus), "set_end": exp_phi,
                           "set_middle": exp_phi}
        self.check()

    @property
    def base(self) -> Material:
        """Base material: the material before any part of it has solidified."""
        base = copy.copy(self._base)
        base.parameters = self._of_base(self.parameters)
        return base

    def fraction(self, temperature: Any) -> Any:
        r"""Return the solidified fraction phi(T) at given temperatures.

        With `between` = (T_1, T_2) it is

        .. math:: \varphi = \frac{T_2 - T}{T_2 - T_1} \qquad (T_1 \le T \le T_2)

        and 1 below, 0 above these temperatures. Otherwise it is given by the table `fraction`.

        Args:
            temperature: temperatures T, any shape.

        Returns:
            phi between 0 and 1, the shape of `temperature`.
        """
        return self._phi(np.asarray(temperature, float))

    def check(self, sample: Sample | None = None) -> None:
        if sample is None:
            self.base.check()
        super().check(sample)

    def check_constants(self, **constants):
        self._base.check_constants(**self._of_base(constants))
        if "G_set" in constants:
            positive("Solidification: modulus", constants["G_set"])

    @property
    def internal(self) -> dict[str, Any]:  # type: ignore[override]  # read only here
        """Internal variables, {name: value in the reference configuration}.

        They are the variables of the base material, the isochoric right Cauchy-Green tensors C of the last two states,
        and A, the integral of C^-1 over the solidified fraction. The last one is the fraction phi that A includes. The
        temperature at the end of a step is known when the next step begins. A and phi include the material that
        solidified in a step only from then on.
        """
        return {**self._base.internal, _BEFORE: IDENTITY, _LAST: IDENTITY, _GLASS: (0.0, 0.0, 0.0, 0.0),
                _FRACTION: 0.0}

    @property
    def flow_constants(self) -> tuple[str, ...]:
        """Names of the constants whose values in the middle of a step in time enter the step, not those at its end.

        They are the flow constants of the base material, and the constant from which the solidified fraction follows.
        """
        return (*self._base.flow_constants, "set_middle")

    @property
    def motion_variables(self) -> tuple[str, ...]:  # type: ignore[override]  # read only here
        """Names of the internal variables of the base that describe the motion in the last step."""
        return self._base.motion_variables

    @property
    def tensor_powers(self) -> dict[str, int]:  # type: ignore[override]  # read only here
        """Internal variables that are tensors, {name: 1 for a tensor like C, -1 for one like its inverse}."""
        return {**self._base.tensor_powers, _BEFORE: 1, _LAST: 1}

    @property
    def largest_I1(self):
        return self.base.largest_I1

    def strain_energy(self, F, **constants):
        r"""Return the strain energy per reference volume of a body that solidified in the reference configuration.

        .. math:: W = W_{base}(F) + \frac{G \varphi}{2} (\mathrm{tr} \, C - 3)

        The first term is the energy of the base material. G is the modulus and phi the fraction of the solidified
        material. C is the isochoric right Cauchy-Green tensor.
        """
        phi = ufl.max_value(ufl.min_value(ufl.ln(constants["set_end"]), 1.0), 0.0)
        return self._base.strain_energy(F, **self._of_base(constants)) \
            + constants["G_set"] / 2 * phi * (inner(isochoric(F), IDENTITY) - 3)

    def step_energy(self, F, internal, time_step, **constants):
        r"""Return the potential of a step in time, whose derivative by F is the nominal stress at the end of the step.

        Half of the material that solidifies in the step is stress-free in the shape at its beginning, half in the shape
        at its end. If the solidified fraction phi decreases, the ratio r of the solidified material remains:

        .. math:: W_{base} + \frac{G}{2} \left[\mathrm{tr}(C M) - \mathrm{tr} M\right], \qquad
                  M = r A_n + \tfrac{1}{2} \max(\varphi_{n+1} - \varphi_n, 0) \, C_n^{-1}, \qquad
                  r = \min(1, \varphi_{n+1} / \varphi_n)

        Indices n and n + 1 denote the beginning and the end of the step. C is the isochoric right Cauchy-Green tensor
        at the end, and G the shear modulus of the solidified material. A is the integral of C^-1 over the solidified
        fraction (`Solidification`). The first term is the potential of the base material.
        """
        A, begin, end = self._begin(internal, constants)
        born = ufl.max_value(end - begin, 0) / 2
        M = plus(tuple(_remaining(begin, end) * a for a in A), cofactor(entries(internal[_LAST])), born)
        return self._base.step_energy(F, self._of_base_internal(internal), time_step, **self._of_base(constants)) \
            + constants["G_set"] / 2 * (inner(isochoric(F), M) - (M[0] + M[1] + M[3]))

    def updated(self, F, internal, time_step, **constants):
        A, begin, _ = self._begin(internal, constants)
        return {**self._base.updated(F, self._of_base_internal(internal), time_step, **self._of_base(constants)),
                _BEFORE: internal[_LAST], _LAST: ufl.as_vector(isochoric(F)), _GLASS: ufl.as_vector(A),
                _FRACTION: begin}

    def stored_energy(self, F, internal, **constants):
        A, phi, _ = self._begin(internal, constants)
        return self._base.stored_energy(F, self._of_base_internal(internal), **self._of_base(constants)) \
            + constants["G_set"] / 2 * (inner(isochoric(F), A) - 3 * phi)

    def equilibrium_energy(self, F, **constants):
        return None

    def elastic_stretches(self, F, internal, **constants):
        return self._base.elastic_stretches(F, self._of_base_internal(internal), **self._of_base(constants))

    def dissipation(self, F, internal, **constants):
        return self._base.dissipation(F, self._of_base_internal(internal), **self._of_base(constants))

    def _begin(self, internal: dict[str, Any], constants: dict[str, Any]) -> tuple[Any, Any, Any]:
        """Return A and the solidified fraction phi at the beginning of a step, and phi at its end (UFL).

        A, (11, 22, 12, 33), is the integral of C^-1 over the solidified fraction, with that of the previous step.
        """
        end, before = ufl.ln(constants["set_end"]), internal[_FRACTION]
        begin, end = (ufl.max_value(ufl.min_value(phi, 1.0), 0.0)
                      for phi in (2 * ufl.ln(constants["set_middle"]) - end, end))
        A = tuple(_remaining(before, begin) * a for a in entries(internal[_GLASS]))
        for shape in (_BEFORE, _LAST):
            A = plus(A, cofactor(entries(internal[shape])), ufl.max_value(begin - before, 0) / 2)
        return A, begin, end

    def _of_base(self, constants: dict[str, Any]) -> dict[str, Any]:
        """Return {name: value} of the constants of the base material, from all constants."""
        return {name: constants[name] for name in self._base.parameters if name in constants}

    def _of_base_internal(self, internal: dict[str, Any]) -> dict[str, Any]:
        """Return {name: value} of the internal variables of the base material, from all variables."""
        return {name: value for name, value in internal.items() if name not in (_BEFORE, _LAST, _GLASS, _FRACTION)}

    def __repr__(self) -> str:
        return f"Solidification({self.base!r}, modulus={self.parameters['G_set']!r}, {self._phi})"

    def __str__(self) -> str:
        return f"Solidification({self.base}, modulus={brief(self.parameters['G_set'])}, {self._phi})"


class _Fraction:
    """Solidified fraction phi as a function of the temperature, constant below `low` and above `high`."""

    def __init__(self, low: float, high: float, table: Table | None = None):
        self._low, self._high, self._table = low, high, table

    def __call__(self, T: Any) -> Any:
        inside = np.clip(T, self._low, self._high)
        return (self._high - inside) / (self._high - self._low) if self._table is None else self._table(inside)

    def __repr__(self) -> str:
        return f"between=({self._low:g}, {self._high:g})" if self._table is None else f"fraction={self._table!r}"


def _fraction(between: Any, fraction: Any) -> _Fraction:
    """Return the solidified fraction phi(T), from two temperatures or a `table`.

    Between the two, the lower first, phi decreases from 1 to 0. None, both or a wrong argument is an InputError.
    """
    if (between is None) == (fraction is None):
        raise InputError(f"Solidification: between = {between!r}, fraction = {fraction!r}: give one of them: the"
                         f" temperatures between=(75, 85) at which all and nothing has solidified, or a table of the"
                         f" fraction over temperature")
    if fraction is not None:
        y = check_type("Solidification: fraction", fraction, Table, "a table, such as table({75: 1, 80: 0.7, 85: 0})").y
        if np.any(np.diff(y) > 0) or abs(y[0] - 1) > 1e-12 or abs(y[-1]) > 1e-12:
            raise InputError(f"Solidification: fraction = {fraction!r}: must fall from 1 to 0 as the temperature rises")
        return _Fraction(fraction.x[0], fraction.x[-1], fraction)
    ends = as_list("Solidification: between", between, "two temperatures")
    if len(ends) != 2 or finite("Solidification: between", ends[0]) >= finite("Solidification: between", ends[1]):
        raise InputError(f"Solidification: between = {between!r}: must be two temperatures, the lower first, as"
                         f" (75, 85)")
    return _Fraction(float(ends[0]), float(ends[1]))


def _remaining(before: Any, after: Any) -> Any:
    """Return after/before (UFL) of a decreasing solidified fraction, the part that remains; else 1."""
    return ufl.conditional(ufl.lt(after, before), after / ufl.max_value(before, 1e-12), 1.0)
