"""A material that solidifies: as it cools a glassy network forms, free of stress in the shape of the body then."""

import copy
from typing import Any

import numpy as np
import ufl

from ..errors import InputError, finite, instance, positive, several
from ..values.table import Table
from .constants import OfTemperature, Sample
from .material import Material, brief
from .tensors import IDENTITY, cofactor, entries, inner, isochoric, plus

_BEFORE, _LAST, _GLASS, _FRACTION = "C_before", "C_last", "A_glass", "fraction"


class Solidification(Material):
    """A material that sets as it cools, and softens when it is heated again.

    Of the fraction phi(T) that has set, the part added in a cooling step is stress-free in the shape of that moment:

        W = W_base + (G/2) [tr(C A) - 3 phi],   dA = C^-1 dphi as phi grows,   A in proportion to phi as it falls,

    the single-integral network with birth by temperature (Green and Tobolsky, J. Chem. Phys. 14 (1946) 80, with no
    relaxation time). A modulus that only rises as the temperature falls pulls a formed part back to its reference
    configuration. Solidified material keeps its shape, but for the small strain at which it balances the base.
    The scene needs a temperature, and `heat=Cooling(...)` for it to change.

    Args:
        base: any material, also one that relaxes.
        modulus: G, the shear modulus of the solidified part, above 0; stress.
        between: two temperatures; all has set at the lower, nothing at the higher, phi is linear between.
        fraction: phi(T) instead, a `table` from 1 to 0; beyond its ends phi stays as it is there.

    >>> fx.Solidification(fx.NeoHookean(c10=0.4), modulus=800.0, between=(90.0, 110.0))
    Solidification(NeoHookean(c10=0.4), modulus=800.0, between=(90, 110))
    """

    def __init__(self, base: Material, modulus: float, between: Any = None, fraction: Table | None = None):
        instance("Sets: base", base, Material, "a material")
        if isinstance(base, Solidification):
            raise InputError(f"Sets: base = {base}: sets already: give its base, with one fraction")
        self._base, self._phi = base, _fraction(between, fraction)
        for name in {"G_set", "set_end", "set_middle"} & base.parameters.keys():
            raise InputError(f"Sets: the base has a constant {name!r}: that is one of Sets; give it another name")
        # a step takes the logarithm of a constant to go on in proportion to time: so phi goes on, also from 0
        exp_phi = OfTemperature(lambda T: np.exp(self._phi(T)), f"exp({self._phi})")
        self.integral, self.stores_energy, self.symmetric = base.integral, base.stores_energy, base.symmetric
        self.parameters = {**base.parameters, "G_set": positive("Sets: modulus", modulus), "set_end": exp_phi,
                           "set_middle": exp_phi}
        self.check()

    @property
    def base(self) -> Material:
        """The material that has not set."""
        base = copy.copy(self._base)
        base.parameters = self._of_base(self.parameters)
        return base

    def fraction(self, temperature: Any) -> Any:
        """phi, the fraction that has set at temperatures of any shape."""
        return self._phi(np.asarray(temperature, float))

    def check(self, sample: Sample | None = None) -> None:
        if sample is None:
            self.base.check()
        super().check(sample)

    def check_constants(self, **constants):
        self._base.check_constants(**self._of_base(constants))
        if "G_set" in constants:
            positive("Sets: modulus", constants["G_set"])

    @property
    def internal(self) -> dict[str, Any]:  # type: ignore[override]  # read only here
        """See `Material`: the variables of the base, C of the last two states, A, and the fraction phi that A includes.

        A includes the part that solidifies in a step from the beginning of the next step on, when the temperature at
        its end is known.
        """
        return {**self._base.internal, _BEFORE: IDENTITY, _LAST: IDENTITY, _GLASS: (0.0, 0.0, 0.0, 0.0),
                _FRACTION: 0.0}

    @property
    def of_flow(self) -> tuple[str, ...]:
        """See `Material`."""
        return (*self._base.of_flow, "set_middle")

    @property
    def of_motion(self) -> tuple[str, ...]:  # type: ignore[override]  # read only here
        """See `Material`."""
        return self._base.of_motion

    @property
    def shapes(self) -> dict[str, int]:  # type: ignore[override]  # read only here
        """See `Material`."""
        return {**self._base.shapes, _BEFORE: 1, _LAST: 1}

    @property
    def largest_I1(self):
        return self.base.largest_I1

    def strain_energy(self, F, **constants):
        """See `Material`: the response of a body that was never strained before."""
        phi = ufl.max_value(ufl.min_value(ufl.ln(constants["set_end"]), 1.0), 0.0)
        return self._base.strain_energy(F, **self._of_base(constants)) \
            + constants["G_set"] / 2 * phi * (inner(isochoric(F), IDENTITY) - 3)

    def step_energy(self, F, internal, time_step, **constants):
        """See `Material`. Half of the part that solidifies in the step is free of stress in the shape at its beginning,
        half in the shape at its end."""
        A, begin, end = self._begin(internal, constants)
        born = ufl.max_value(end - begin, 0) / 2
        M = plus(tuple(_left(begin, end) * a for a in A), cofactor(entries(internal[_LAST])), born)
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
        """Return (A and phi at the beginning of the step, phi as it will be at its end)."""
        end, before = ufl.ln(constants["set_end"]), internal[_FRACTION]
        begin, end = (ufl.max_value(ufl.min_value(phi, 1.0), 0.0)
                      for phi in (2 * ufl.ln(constants["set_middle"]) - end, end))
        A = tuple(_left(before, begin) * a for a in entries(internal[_GLASS]))
        for shape in (_BEFORE, _LAST):
            A = plus(A, cofactor(entries(internal[shape])), ufl.max_value(begin - before, 0) / 2)
        return A, begin, end

    def _of_base(self, constants: dict[str, Any]) -> dict[str, Any]:
        return {name: constants[name] for name in self._base.parameters if name in constants}

    def _of_base_internal(self, internal: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in internal.items() if name not in (_BEFORE, _LAST, _GLASS, _FRACTION)}

    def __repr__(self) -> str:
        return f"Solidification({self.base!r}, modulus={self.parameters['G_set']!r}, {self._phi})"

    def __str__(self) -> str:
        return f"Solidification({self.base}, modulus={brief(self.parameters['G_set'])}, {self._phi})"


class _Fraction:
    """phi(T): a table, constant beyond its ends, or linear between two temperatures."""

    def __init__(self, low: float, high: float, table: Table | None = None):
        self._low, self._high, self._table = low, high, table

    def __call__(self, T: Any) -> Any:
        inside = np.clip(T, self._low, self._high)
        return (self._high - inside) / (self._high - self._low) if self._table is None else self._table(inside)

    def __repr__(self) -> str:
        return f"between=({self._low:g}, {self._high:g})" if self._table is None else f"fraction={self._table!r}"


def _fraction(between: Any, table: Any) -> _Fraction:
    if (between is None) == (table is None):
        raise InputError(f"Sets: between = {between!r}, fraction = {table!r}: give one of them: the temperatures"
                         f" between=(75, 85) of all and of nothing set, or a table of the fraction over temperature")
    if table is not None:
        y = instance("Sets: fraction", table, Table, "a table, such as table({75: 1, 80: 0.7, 85: 0})").y
        if np.any(np.diff(y) > 0) or abs(y[0] - 1) > 1e-12 or abs(y[-1]) > 1e-12:
            raise InputError(f"Sets: fraction = {table!r}: must fall from 1 to 0 as the temperature rises")
        return _Fraction(table.x[0], table.x[-1], table)
    ends = several("Sets: between", between, "two temperatures")
    if len(ends) != 2 or finite("Sets: between", ends[0]) >= finite("Sets: between", ends[1]):
        raise InputError(f"Sets: between = {between!r}: must be two temperatures, the lower first, as (75, 85)")
    return _Fraction(float(ends[0]), float(ends[1]))


def _left(before: Any, after: Any) -> Any:
    """Return the part of the glass that is left when the solidified fraction falls; 1 when it grows."""
    return ufl.conditional(ufl.lt(after, before), after / ufl.max_value(before, 1e-12), 1.0)
