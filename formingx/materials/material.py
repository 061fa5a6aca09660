"""Interface of every incompressible, isotropic material; the materials are in `hyperelastic`.

A material has named constants and one energy, and may have a history: internal variables at every quadrature point,
which advance from one accepted state to the next. The isotropic stress of an energy of F in the reference
configuration is removed where the energy is used: W(F) - rest_stress ln J. (On a thin sheet Newton's method takes half
as many iterations with this form as with the isochoric part of F: see the notes on incompressibility.)
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import ufl
from numpy.typing import ArrayLike

from ..errors import InputError, finite, known, positive
from ..figures import Axes, figure
from . import homogeneous
from .constants import OfTemperature, Sample, Varying, varying
from .homogeneous import MODES, Response, Stability


class Material:
    """A strain energy with named constants.

    Subclasses set `self.parameters` (name to number, or to a varying coefficient: see `constants`) and give
    `strain_energy`. The constants' unit of stress is the user's own; all pressures and stresses have it.

    A material with a history sets `self.internal` too, and gives `step_energy` and `updated`. In their arguments and
    results, `internal` is {name: UFL expression} with the values at the beginning of the step, and `time_step` the
    process time since then (UFL scalar; 0 where no time passes, then nothing may change).

    Attributes:
        parameters: {name: constant}.
        internal: {name: value in the reference configuration}, a number or nested tuples, of the shape
            of the variable; of a quantity per quadrature point. Empty: no history.
        of_motion: names of internal variables that describe the motion in the last step, for the rate in the next; with
            their values in the reference configuration they predict nothing.
        shapes: {name: 1 or -1} of internal variables that are positive tensors, as C or its inverse, with entries 11,
            22, 12, 33: they are transferred to another mesh relative to the deformed body, all others as numbers.
        rate_dependent: False if the history depends on the strain alone, as damage does, and not on the time.
        integral: the law of a stress that depends on all past states (`IntegralLaw`), or None.
        stores_energy: True if `stored_energy` is defined.
        symmetric: True if the tangent is symmetric.
        tested: the tests that its constants come from (a `MeasuredRange`), or None: not known.
        branches: [(modulus, relaxation time)] of a material that relaxes.
    """

    parameters: dict[str, Any]
    internal: dict[str, Any] = {}
    of_motion: Any = ()
    shapes: Any = MappingProxyType({})
    rate_dependent = True
    integral: Any = None
    stores_energy: Any = True
    symmetric: Any = True
    tested: Any = None
    branches: Any = ()

    def strain_energy(self, F: Any, *args: Any, **constants: Any) -> Any:
        """Energy per reference volume of F, shape (3, 3); a UFL scalar, zero at F = I.

        For a material with a history: the instantaneous energy of a body that was in the reference
        configuration before.
        """
        if not self.internal:
            raise NotImplementedError
        rest = {name: ufl.as_ufl(value) if np.ndim(value) == 0 else ufl.as_tensor(value)
                for name, value in self.internal.items()}
        return self.step_energy(F, rest, ufl.as_ufl(0.0), **constants)

    @property
    def of_flow(self) -> tuple[str, ...]:
        """Names of constants that set a rate of flow: a step uses their values at its middle."""
        return ()

    def step_energy(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> Any:
        """Return the potential of a step, per reference volume: its derivative by F is the stress at the end of the
        step."""
        return self.strain_energy(F, **constants)

    def updated(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> dict[str, Any]:
        """{name: UFL expression}: the internal variables at the end of a step that ends at F."""
        return {}

    def stored_energy(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the energy per reference volume that is stored at F, with the internal variables as they are then."""
        return self.strain_energy(F, **constants)

    def equilibrium_energy(self, F: Any, **constants: Any) -> Any:
        """Return the energy per reference volume that is left at F when all has relaxed; None: none is left, or not
        known."""
        return None if self.internal else self.strain_energy(F, **constants)

    def elastic_stretches(self, F: Any, internal: dict[str, Any], **constants: Any) -> list[Any]:
        """Return the largest principal elastic stretch of each relaxing branch, with the present internal variables.

        UFL scalars: 1 for a relaxed branch, the largest isochoric stretch of F before any relaxation.
        """
        return []

    def dissipation(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the dissipated power per reference volume at F, stress over time; 0 without a history."""
        return ufl.as_ufl(0.0)

    def damage_energy(self, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the energy per reference volume that damage has cost, with the internal variables as they are then."""
        return ufl.as_ufl(0.0)

    @property
    def varies(self) -> bool:
        """True if a constant varies over the body."""
        return any(varying(value) is not None for value in self.parameters.values())

    def constants(self) -> dict[str, float | Varying]:
        """{name: number, or a varying coefficient}."""
        return {name: value if (found := varying(value)) is None else found for name, value in self.parameters.items()}

    def _numbers(self) -> list[float]:
        """Return the constants' values, in order; an InputError if they vary."""
        if self.varies:
            raise InputError(f"{self}: its constants vary over the body: use with_constants([...]) for the material at"
                             f" one point of it")
        return list(self.parameters.values())

    def _sampled(self, sample: Sample) -> np.ndarray:
        """Return the different sets of values that the constants have over a sample, shape (constants, n)."""
        found = [value.values(sample) if isinstance(value, Varying) else float(value)
                 for value in self.constants().values()]
        columns = np.stack(np.broadcast_arrays(np.zeros(len(sample.points)), *found)[1:])
        return np.unique(columns, axis=1) if columns.size else columns

    @property
    def base(self) -> Material:
        """The material without solidification."""
        return self

    @property
    def equilibrium(self) -> Material | None:
        """The material that is left when all has relaxed, or None."""
        return self

    @property
    def largest_I1(self) -> float:
        """The value of I1 at which the energy is infinite; infinity if there is none."""
        return math.inf

    @property
    def shear_modulus(self) -> float:
        """Modulus of small shear, E/3; for fibres in the stiffest direction. Unit: stress.

        Half the largest W'' of small strains e = ln l with zero sum: if isotropic, W = mu (e1^2 + e2^2 + e3^2).
        """
        return float(self._moduli(self._numbers(), 1)[1, 0])

    def shear_modulus_at(self, sample: Sample) -> np.ndarray:
        """`shear_modulus` for the values that the constants have over a sample, shape (n,)."""
        values = self._sampled(sample)
        return self._moduli(values, values.shape[1])[1]

    def _moduli(self, constants: Any, n: int) -> np.ndarray:
        """Return the smallest and the largest modulus of small strains along the axes, for n sets of constants, (2,
        n)."""
        H = self.response.logarithmic(np.ones((2, n)), constants)[1] / 2
        a, b = (H[0, 0] - 2 * H[0, 1] + H[1, 1]) / 2, (H[0, 0] + 2 * H[0, 1] + H[1, 1]) / 6
        half = np.hypot((a - b) / 2, (H[0, 0] - H[1, 1]) / math.sqrt(12))
        return np.stack([(a + b) / 2 - half, (a + b) / 2 + half])

    @property
    def rest_stress(self) -> float:
        """dW/dF11 at F = I, stress: for the invariants, 2 (W,1 + 2 W,2)."""
        return float(self.response.derivatives(np.ones((3, 1)), self._numbers())[0][0, 0])

    @functools.cached_property
    def response(self) -> Response:
        """The energy's derivatives by the principal stretches, for any constants."""
        return Response(self.strain_energy, list(self.parameters))

    def stress(self, mode: str = "biaxial", stretches: ArrayLike = (), *, true: bool = False) -> np.ndarray:
        """Nominal stress, force over reference area, of a test (`true`: over the area as it is). Unit: stress.

        P = dW/dl / n along the test, with n = 1 direction pulled, or 2. The true stress is P l.

        Args:
            mode: "uniaxial" (l, l^-1/2, l^-1/2), "pure_shear" (l, 1, 1/l), also called planar tension, or
                "equibiaxial" (l, l, l^-2); "biaxial": (l1, l2), any two, as in `stress(stretches=(l1, l2))`.
            stretches: l, any shape, each greater than 0; the result has this shape. Of "biaxial" shape (2, ...).

        Raises:
            InputError: unknown mode, a stretch that is not positive or beyond the material's limit.
        """
        known(f"{self}: stress: mode", mode, [*MODES, "biaxial"])
        l = np.asarray(stretches, dtype=float)
        if mode == "biaxial" and l.shape[:1] != (2,):
            raise InputError(f"{self}: stress: stretches of a biaxial test must be (l1, l2), the shape is {l.shape}")
        flat = l.ravel()
        for bad in flat[~((flat > 0) & np.isfinite(flat))][:1]:
            raise InputError(f"{self}: a stretch of {bad:.6g}: must be finite and greater than 0")
        self._check_isotropic()
        both = flat.reshape(2, -1) if mode == "biaxial" else homogeneous.along(mode, flat)
        P = self.response.stress(both, self._numbers())[:2 if mode == "biaxial" else 1].ravel()
        for bad in flat[~np.isfinite(P)][:1]:
            raise InputError(self._beyond(mode, bad) if mode in MODES else
                             f"{self}: biaxial stretches are beyond its limit: I1 must be less than"
                             f" {self.largest_I1:.6g}")
        return (P * flat if true else P).reshape(l.shape)[()]

    def largest_stretch(self, mode: str) -> float:
        """Return the stretch of a test at which the energy is infinite."""
        known(f"{self}: largest_stretch: mode", mode, MODES)
        if not math.isfinite(self.largest_I1):
            return math.inf
        from scipy.optimize import brentq
        k = MODES[mode]
        return brentq(lambda l: l**2 + l**(2 * k) + l**(-2 - 2 * k) - self.largest_I1, 1, math.sqrt(self.largest_I1))

    def rupture_stretch(self, mode: str) -> float:
        """Return the sudden stretch of a test beyond which the force falls; infinity if it does not."""
        return math.inf

    def check_stability(self, stretches: Any) -> Stability:
        """Return the ranges of stretch in which the material is stable, in each of the three tests.

        Two criteria, each with the part of the range around l = 1 in which it holds:
        "load": dP/dl > 0, a test under a growing force goes on (P nominal);
        "Drucker": d tau : d(ln l) > 0 for every change of the three stretches that keeps the volume (tau Kirchhoff
        stress): the Hessian of W in the logarithmic strains is positive definite at every stretch of the test.

        Args:
            stretches: the range: any number of stretches, of which the smallest and the largest (and 1) count.
        """
        try:
            low, high = (positive(f"{self}: check_stability: stretch", f(stretches)) for f in (min, max))
        except (TypeError, ValueError) as error:
            raise error if isinstance(error, InputError) else InputError(
                f"{self}: check_stability: stretches = {stretches!r}: must be a range such as (0.5, 6)") from None
        return homogeneous.stability(self.response, self._numbers(), min(low, 1.0), max(high, 1.0))

    def plot(self, axes: Axes | None = None, stretches: ArrayLike | None = None, unit: str = "") -> Any:
        """Draw nominal stress against stretch of the three tests; returns the matplotlib axes.

        Args:
            axes: matplotlib axes; default a new figure.
            stretches: the stretches, shape (n,); default 1 to 6, and to 95 % of the limit where there is one.
            unit: the constants' unit of stress, for the label.
        """
        drawn: Any = figure()[1] if axes is None else axes
        for mode in MODES:
            l = np.linspace(1, min(6.0, 0.95 * self.largest_stretch(mode)), 200) if stretches is None else stretches
            drawn.plot(l, self.stress(mode, l), label=mode.replace("_", " "))
        drawn.set(xlabel="stretch", ylabel="nominal stress" + f" ({unit})" * bool(unit), title=str(self))
        drawn.legend()
        return drawn

    def report(self, file: Any = "card.html", *, temperatures: Sequence[float] = (),
               rates: Sequence[float] = (0.1, 1.0, 10.0), unit: str = "", unit_of_time: str = "s") -> Any:
        """Write one HTML page on the response of the material and its limits; return its path.

        Args:
            temperatures: needed if constants or relaxation times depend on the temperature, in the unit of their laws.
            rates: Hencky rates of forming, 1/time, of a material that relaxes.
            unit, unit_of_time: units of stress and of time of the constants, for the labels.

        Raises:
            InputError: a constant depends on the position, or on a temperature that is not given.
            OSError: the file cannot be written.
        """
        from .card import write
        return write(self, file, temperatures, rates, unit, unit_of_time)

    def check(self, sample: Sample | None = None) -> None:
        """Raise an InputError unless the constants are admissible: finite, with a positive stiffness in the
        reference configuration.

        Numbers of any type are kept as floats.
        sample: points at which varying constants are checked; None: only constants that do not vary are checked.
        """
        self.parameters = {name: value if varying(value) is not None else finite(f"{self}: {name}", value)
                           for name, value in self.parameters.items()}
        if self.varies and sample is None:
            return
        sets = self._sampled(sample) if sample is not None else np.array(self._numbers()).reshape(-1, 1)
        for values in sets.T.tolist():
            self.check_constants(**dict(zip(self.parameters, values, strict=True)))
        n = sets.shape[1]
        moduli = self._moduli(sets, n)
        for mu in moduli[~((moduli > 0) & np.isfinite(moduli))][:1]:
            raise InputError(f"{self} has no stiffness: its shear modulus at rest is {mu:.6g}, must be positive")
        stress = self.response.derivatives(np.ones((3, n)), sets)[0]
        for g in stress.T[np.ptp(stress, axis=0) > 1e-6 * moduli[1]][:1]:
            raise InputError(f"{self} is not free of stress at rest: dW/dl along r, z and the hoop are {g[0]:.6g},"
                             f" {g[1]:.6g} and {g[2]:.6g}; only a part that is the same in all three, a pressure, is"
                             " removed")

    def check_constants(self, **constants: Any) -> None:
        """Raise an InputError unless these values of the constants are admissible."""
        for name, value in constants.items():
            finite(f"{self}: {name}", value)

    @classmethod
    def guesses(cls, modulus: float, I1: float, terms: int | None) -> list[Material]:
        """Materials from which a fit may start, for data with about this shear modulus and this largest I1."""
        raise InputError(f"fit: {cls.__name__} has no first guess of its own: give a material with constants near the"
                         f" wanted ones instead of the class")

    def coordinates(self) -> list[tuple[float, float, float]]:
        """[(value, lowest, highest)]: the variables of a fit. All constants within are admissible."""
        return [(float(value), -math.inf, math.inf) for value in self._numbers()]

    def constants_at(self, coordinates: Sequence[float] | np.ndarray) -> list[float]:
        """Return the constants at coordinates."""
        return list(coordinates)

    def with_constants(self, constants: Sequence[Any]) -> Material:
        """Return the same kind of material with other constants, in the order of `parameters`."""
        if len(constants) != len(self.parameters):
            raise InputError(f"{self}: with_constants: {len(constants)} numbers for {', '.join(self.parameters)}")
        other = copy.copy(self)                             # with its `response`, which holds for any constants
        other.parameters = dict(zip(self.parameters, map(float, constants), strict=True))
        other.check()
        return other

    def at_temperature(self, temperature: float) -> Material:
        """Return the material at one temperature: constants that depend on it are numbers there.

        Raises:
            InputError: a constant depends on the position, or has no value at this temperature.
        """
        found = [float(value(temperature)) if isinstance(value, OfTemperature) else value
                 for value in self.constants().values()]
        if any(isinstance(value, Varying) for value in found):
            raise InputError(f"{self}: at_temperature: a constant depends on the position")
        return self.with_constants(found)

    def _check_isotropic(self) -> None:
        """Raise an InputError unless permuted stretches give permuted stresses."""
        l = np.array([1.02, 0.99, 1 / 1.02 / 0.99])
        g = self.response.derivatives(np.stack([l, np.roll(l, 1)], axis=1), self._numbers())[0]
        if np.any(np.abs(np.roll(g[:, 0], 1) - g[:, 1]) > 1e-8 * np.abs(g).max()):
            raise InputError(f"{self} is not isotropic: its stresses depend on the direction that is pulled")

    def _beyond(self, mode: str, stretch: float) -> str:
        k = MODES[mode]
        if math.isfinite(self.largest_I1):
            I1 = stretch**2 + stretch**(2 * k) + stretch**(-2 - 2 * k)
            return (f"{self}: a stretch of {stretch:.6g} in {mode} tension is beyond its limit: I1 = {I1:.6g} must be"
                    f" less than {self.largest_I1:.6g}, stretches less than {self.largest_stretch(mode):.6g}")
        return f"{self}: the stress at a stretch of {stretch:.6g} in {mode} tension is not a finite number"

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in self.parameters.items())})"

    def __str__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={brief(v)}' for k, v in self.parameters.items())})"


def brief(value: Any) -> str:
    """Return a constant as text: a number with six digits."""
    return repr(float(f"{value:.6g}")) if isinstance(value, float) else repr(value)
