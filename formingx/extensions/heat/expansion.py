"""Thermal expansion: the stress-free volume of a material as a function of its temperature."""

from typing import Any

import numpy as np

from ...errors import InputError, finite
from ...materials.constants import varying
from ...values.temperature import FunctionOfTemperature


class ThermalExpansion:
    r"""Isotropic stress-free volume ratio J_T(T) of a material.

    The energy and the volume constraint depend on the elastic part of F (Lu and Pister, Int. J. Solids Struct. 11
    (1975) 927), so det F = J_T for an incompressible material:

    .. math:: F = J_T^{1/3} F_e, \qquad
              J_T = [1 + a (T - T_0)]^3 \;\text{ or }\; J_T = \frac{v(T)}{v(T_0)}

    Args:
        linear: coefficient a of linear expansion, 1/degree, at most 0.01; polymers have 5e-5 to 2e-4.
        specific_volume: v(T) instead, in any unit, a `table` or the result of `of_temperature`.
        stress_free: temperature T_0 at which the mesh is stress-free.

    Raises:
        InputError: neither or both laws are given, a coefficient is above 0.01 per degree, or a volume is not positive.

    >>> float(fx.ThermalExpansion(linear=1e-4, stress_free=120.0).stretch(20.0).round(6))
    0.99
    """

    def __init__(self, *, linear: float | None = None, specific_volume: Any = None, stress_free: float):
        if (linear is None) == (specific_volume is None):
            raise InputError("ThermalExpansion: give linear=..., a number, or specific_volume=..., by temperature")
        self.stress_free = finite("ThermalExpansion: stress_free", stress_free)
        self.linear = None if linear is None else finite("ThermalExpansion: linear", linear)
        if self.linear is not None and abs(self.linear) > 0.01:
            raise InputError(f"ThermalExpansion: linear = {linear!r} per degree: must be at most 0.01: polymers have"
                             f" 5e-5 to 2e-4 per degree, metals 1e-5 to 3e-5; {linear!r} in 1e-6/K is"
                             f" {1e-6 * self.linear:.3g}")
        self.specific_volume: Any = varying(specific_volume)
        if linear is None and not isinstance(self.specific_volume, FunctionOfTemperature):
            raise InputError(f"ThermalExpansion: specific_volume = {specific_volume!r}: must be table({{T: v, ...}}) or"
                             f" of_temperature(f)")
        self.stretch(np.array([self.stress_free]))

    def volume_ratio(self, temperature: Any) -> np.ndarray:
        """Return the stress-free volume at a temperature over the volume at T_0, the argument `stress_free`.

        Args:
            temperature: temperatures, any shape.

        Returns:
            Volume ratios J_T, the same shape.
        """
        return self.stretch(temperature) ** 3

    def stretch(self, temperature: Any, clamped: bool = False) -> np.ndarray:
        """Return the stress-free length at a temperature over the length at T_0, the argument `stress_free`: J_T^(1/3).

        Args:
            temperature: temperatures, any shape.
            clamped: True to use the end value of a table for temperatures beyond it, as a run does.

        Returns:
            Stretches, the same shape.

        Raises:
            InputError: the volume is not positive, or unknown at a temperature.
        """
        T = np.asarray(temperature, dtype=float)
        if self.linear is not None:
            found = 1 + self.linear * (T - self.stress_free)
        else:
            volume = self.specific_volume.clamped if clamped else self.specific_volume
            found = np.cbrt(volume(T) / self.specific_volume(np.array([self.stress_free]))[0])
        wrong = ~(found > 0)
        if np.any(wrong):
            raise InputError(f"{self!r}: the stress-free stretch is {found[wrong].flat[0]:.6g} at a temperature of"
                             f" {T[wrong].flat[0]:.6g}: must be above 0")
        return found

    def __repr__(self) -> str:
        law = f"linear={self.linear!r}" if self.linear is not None else f"specific_volume={self.specific_volume!r}"
        return f"ThermalExpansion({law}, stress_free={self.stress_free!r})"
