"""Strain energies of incompressible, isotropic, hyperelastic materials.

A material has named constants and one energy. What an energy of F leaves as stress at rest, an isotropic pressure,
is removed where it is used: W(F) - rest_stress ln J. (On a thin sheet Newton's method takes half as many iterations
with that form than with the isochoric part of F: see the notes on incompressibility.)
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import ufl
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from ..errors import InputError, finite
from . import kinematics


class Material:
    """A strain energy with named constants.

    Subclasses set `self.parameters` (name to value) and give `strain_energy`. The constants' unit of stress is
    the user's own and fixes that of all pressures and stresses.
    """

    parameters: dict[str, float]

    def strain_energy(self, F: Any, *args: Any, **constants: Any) -> Any:
        """Energy per reference volume of F, shape (3, 3); a UFL scalar, zero at F = I."""
        raise NotImplementedError

    @property
    def shear_modulus(self) -> float:
        """Modulus of small shear, E/3: W(l, l^-1/2, l^-1/2) has the curvature 3 mu at l = 1. Unit: stress."""
        l = ufl.variable(ufl.as_ufl(1.0))
        return _derivative(self, l, (l, l**-0.5, l**-0.5), 2) / 3

    @property
    def rest_stress(self) -> float:
        """dW/dF11 at F = I, stress: for the invariants, 2 (W,1 + 2 W,2)."""
        l = ufl.variable(ufl.as_ufl(1.0))
        return _derivative(self, l, (l, 1, 1), 1)

    def check(self) -> None:
        """Raise an InputError unless constants are finite and the material has a positive stiffness at rest."""
        for name, value in self.parameters.items():
            finite(f"{self}: {name}", value)
        mu = self.shear_modulus
        if not mu > 0:
            raise InputError(f"{self} has no stiffness: its shear modulus at rest is {mu:.6g}, must be positive")

    def __str__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in self.parameters.items())})"

    __repr__ = __str__


class MooneyRivlin(Material):
    """W = c10 (I1 - 3) + c01 (I2 - 3), eq. (4.1) of Song (1993): c10 belongs to I1, c01 to I2.

    Args:
        c10: the I1 constant, stress, at least 0.
        c01: the I2 constant, stress, at least 0 (both at least 0: else W falls without bound).
    """

    def __init__(self, *, c10: float, c01: float):
        self.parameters = {"c10": c10, "c01": c01}
        for name, value in self.parameters.items():
            if finite(f"{self}: {name}", value) < 0:
                raise InputError(f"{self} is not stable: with {name} < 0 the energy falls without bound at large"
                                 f" stretch; {name} must be at least 0")
        self.check()

    def strain_energy(self, F, c10, c01):
        I1, I2 = kinematics.invariants(F)
        return c10 * (I1 - 3) + c01 * (I2 - 3)


class NeoHookean(Material):
    """W = c10 (I1 - 3). The shear modulus is 2 c10.

    Args:
        c10: the I1 constant, stress, greater than 0.
    """

    def __init__(self, *, c10: float):
        self.parameters = {"c10": c10}
        self.check()

    def strain_energy(self, F, c10):
        return c10 * (ufl.inner(F, F) - 3)


class Ogden(Material):
    """W = sum mu_k / alpha_k (l1^alpha_k + l2^alpha_k + l3^alpha_k - 3), eq. (4.3) of Song (1993).

    Args:
        mu: the mu_k, stress; the shear modulus is half the sum of mu_k alpha_k.
        alpha: as many exponents alpha_k, none zero, each with mu_k alpha_k > 0.
    """

    def __init__(self, *, mu: Any, alpha: Any):
        mu, alpha = _as_tuple(mu), _as_tuple(alpha)
        if len(mu) != len(alpha) or not mu:
            raise InputError(f"Ogden: mu = {mu!r} and alpha = {alpha!r} must be as many, and at least one each")
        self.parameters = {f"mu{k}": m for k, m in enumerate(mu, 1)} | {f"alpha{k}": a for k, a in enumerate(alpha, 1)}
        for m, a in zip(mu, alpha, strict=True):
            if not finite(f"{self}: mu", m) * finite(f"{self}: alpha", a) > 0:
                raise InputError(f"{self} is not stable: the pair mu = {m!r}, alpha = {a!r} has mu alpha <= 0;"
                                 f" every pair must have mu alpha > 0")
        self.check()

    def strain_energy(self, F, **constants):
        pairs = [(constants[f"mu{k}"], constants[f"alpha{k}"]) for k in range(1, len(constants) // 2 + 1)]
        return sum(m / a * (kinematics.sum_of_powers(F, a) - 3) for m, a in pairs)


class Hyperelastic(Material):
    """Any energy, written as a function of the invariants or of F.

    Args:
        energy: called as energy(I1, I2, **constants) or energy(F, **constants); returns a UFL scalar.
        of: "invariants" or "F" (shape (3, 3)).
        constants: the energy's named constants. Exponents and the like may be among them.

    Example: ``Hyperelastic(lambda I1, I2, c1, c2: c1 * (I1 - 3) + c2 * (I1 - 3)**2, c1=0.2, c2=0.01)``
    """

    def __init__(self, energy: Callable, of: str = "invariants", **constants: float):
        if of not in ("invariants", "F"):
            raise InputError(f"Hyperelastic: of = {of!r}: must be 'invariants' or 'F'")
        names = list(inspect.signature(energy).parameters)[2 if of == "invariants" else 1:]
        if set(names) != set(constants):
            raise InputError(f"Hyperelastic: the energy takes the constants {names}, given are {sorted(constants)}")
        self.parameters, self._energy, self._of = constants, energy, of
        self.check()

    def strain_energy(self, F, **constants):
        arguments = kinematics.invariants(F) if self._of == "invariants" else (F,)
        return self._energy(*arguments, **constants)


def _derivative(material: Material, variable: Any, stretches: Any, order: int) -> float:
    """d^n W / d variable^n of a homogeneous state, by UFL's own differentiation."""
    l1, l2, l3 = stretches
    W = material.strain_energy(ufl.as_tensor([[l1, 0, 0], [0, l2, 0], [0, 0, l3]]), **material.parameters)
    for _ in range(order):
        W = apply_derivatives(apply_algebra_lowering(ufl.diff(W, variable)))
    return float(W(()))


def _as_tuple(values: Any) -> tuple:
    return tuple(values) if hasattr(values, "__iter__") else (values,)
