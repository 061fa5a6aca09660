r"""Interface of every incompressible material, isotropic or with fibres.

A material has named constants and one energy W. It may have a history: internal variables at every quadrature point,
which are updated from one accepted state to the next. The forms remove the isotropic stress of W in the reference
configuration:

.. math:: W(F) - \sigma_0 \ln J, \qquad \sigma_0 = \left.\frac{\partial W}{\partial F_{11}}\right|_{F = I}

On a thin sheet Newton's method takes half as many iterations with this form as with the isochoric part of F. The page
docs/theory/incompressibility.md states the form. The module `hyperelastic` has the elastic materials.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from numpy.typing import ArrayLike

from ..errors import InputError, check_name, finite, positive
from ..figures import Axes, new_axes
from . import homogeneous
from .constants import OfTemperature, Sample, Varying, varying
from .energies import Energies
from .homogeneous import MODES, MaterialStability, Response

_MAX_SETS = 100            # sets of values of varying constants that `is_isotropic` compares
_TURN = 0.7                # angle by which it turns the stretches, radians


class Material(Energies):
    """Base class of materials: a strain energy with named constants, and possibly a history.

    Subclasses set `self.parameters` and define `strain_energy`. The user chooses the unit of stress of the constants;
    all pressures and stresses have this unit.

    A material with a history also sets `self.internal`, and defines `step_energy` and `updated`. Their argument
    `internal` is {name: UFL expression} with the values at the beginning of the step. Their argument `time_step` is the
    length of the step in process time (UFL scalar); where it is 0 no variable may change by flow.

    Attributes:
        parameters: {name: constant}, each a number or one of the varying constants in `formingx.materials.constants`.
        internal: internal variables at a quadrature point, {name: value in the reference configuration}. A value is a
            number, or nested tuples of the shape of the variable. Empty: no history.
        motion_variables: names of internal variables that describe the rate of deformation in the last step; a law
            extrapolates it to the next step. Their values in `internal` stand for no motion.
        tensor_powers: {name: 1 or -1} of internal variables that are positive definite tensors with entries 11, 22, 12,
            33: 1 for a tensor like C, -1 for one like its inverse. They are transferred to another mesh relative to the
            deformed body, others as numbers.
        rate_dependent: False if the history depends on the strain alone, as damage does, and not on the time.
        integral: law of a stress that depends on all past states (`IntegralLaw`), or None.
        stores_energy: True if `stored_energy` is defined.
        symmetric: True if the tangent is symmetric.
        tested: tests from which the constants were fitted (a `MeasuredRange`), or None if unknown.
        branches: pairs (shear modulus, relaxation time) of a relaxing material, stress and time; else empty.
    """

    @property
    def varies(self) -> bool:
        """True if a constant of the material varies over the body."""
        return any(varying(value) is not None for value in self.parameters.values())

    def constants(self) -> dict[str, float | Varying]:
        """Return the constants in the types that the forms use.

        Returns:
            {name: number, or an object of `Varying` for a constant that varies over the body}.
        """
        return {name: value if (found := varying(value)) is None else found for name, value in self.parameters.items()}

    def _numbers(self) -> list[float]:
        """Return the values of the constants in the order of `parameters`; InputError if any varies over the body."""
        if self.varies:
            raise InputError(f"{self}: its constants vary over the body: use with_constants([...]) for the material at"
                             f" one point of it")
        return list(self.parameters.values())

    def _sampled(self, sample: Sample) -> np.ndarray:
        """Return the n distinct sets of values of the constants at the points of a sample, shape (constants, n)."""
        found = [value.values(sample) if isinstance(value, Varying) else float(value)
                 for value in self.constants().values()]
        columns = np.stack(np.broadcast_arrays(np.zeros(len(sample.points)), *found)[1:])
        return np.unique(columns, axis=1) if columns.size else columns

    @property
    def base(self) -> Material:
        """Material before any part of it has solidified (`Solidification`); by default this material."""
        return self

    @property
    def equilibrium(self) -> Material | None:
        """Material that describes the state after complete relaxation; None if all stress relaxes.

        It is the material itself if the material does not relax, as by default.
        """
        return self

    @property
    def largest_I1(self) -> float:
        """Value of the invariant I1 at which the energy becomes infinite; infinity if there is none."""
        return math.inf

    @property
    def shear_modulus(self) -> float:
        r"""Small-strain shear modulus mu, a third of Young's modulus, stress.

        For small principal strains e with zero sum an isotropic energy is

        .. math:: W = \mu (e_1^2 + e_2^2 + e_3^2).

        In general, as with fibres, mu is half the largest second derivative of W along such strains of unit length.
        """
        return float(self._moduli(self._numbers(), 1)[1, 0])

    def shear_modulus_at(self, sample: Sample) -> np.ndarray:
        """Return the small-strain shear moduli for the values that varying constants have at quadrature points.

        Args:
            sample: quadrature points of a layer.

        Returns:
            Modulus for each of the n distinct sets of values of the constants, shape (n,), stress.
        """
        values = self._sampled(sample)
        return self._moduli(values, values.shape[1])[1]

    def _moduli(self, constants: Any, n: int) -> np.ndarray:
        """Return the smallest and largest small-strain shear modulus for n sets of constants, (2, n), stress.

        They hold for strains along the axes of the section; `constants` follow `parameters`, numbers or shape (n,).
        """
        H = self.response.logarithmic(np.ones((2, n)), constants)[1] / 2
        a, b = (H[0, 0] - 2 * H[0, 1] + H[1, 1]) / 2, (H[0, 0] + 2 * H[0, 1] + H[1, 1]) / 6
        half = np.hypot((a - b) / 2, (H[0, 0] - H[1, 1]) / math.sqrt(12))
        return np.stack([(a + b) / 2 - half, (a + b) / 2 + half])

    @property
    def rest_stress(self) -> float:
        r"""Nominal stress that the strain energy alone gives in the reference configuration, in the unit of stress.

        By default a solid subtracts :math:`\sigma_0 \ln J` from the energy W, so that this configuration is free of
        stress. If W is a function of the invariants I1 and I2

        .. math:: \sigma_0 = \left.\frac{\partial W}{\partial F_{11}}\right|_{F = I}
                  = 2 \frac{\partial W}{\partial I_1} + 4 \frac{\partial W}{\partial I_2}
        """
        return float(self.response.derivatives(np.ones((3, 1)), self._numbers())[0][0, 0])

    @functools.cached_property
    def response(self) -> Response:
        """Derivatives of the strain energy by the principal stretches, at many stretches at once.

        The methods of `Response` take stretches, shape (2 or 3, n), and the constants in the order of `parameters`.
        """
        return Response(self.strain_energy, list(self.parameters))

    def stress(self, mode: str = "biaxial", stretches: ArrayLike = (), *, true: bool = False) -> np.ndarray:
        r"""Return the nominal stress, force over reference area, in a homogeneous test of an incompressible sheet.

        With the strain energy W and the principal stretches l_i

        .. math:: P_i = \frac{\partial W}{\partial l_i} - \frac{l_3}{l_i} \frac{\partial W}{\partial l_3}, \qquad
                  l_1 l_2 l_3 = 1

        Args:
            mode: "uniaxial" for the stretches (l, l^-1/2, l^-1/2), "pure_shear" (planar tension) for (l, 1, 1/l),
                "equibiaxial" for (l, l, l^-2). "biaxial" is for any (l1, l2).
            stretches: stretches l in the loaded direction, any shape, each positive; for "biaxial" stretches (l1, l2),
                shape (2, ...).
            true: True for the true stress P l, force over current area.

        Returns:
            Stress in the loaded direction, for "biaxial" in both directions, of the shape of `stretches`, stress.

        Raises:
            InputError: an unknown mode, or a stretch that is not positive or beyond the limit of the material.
        """
        check_name(f"{self}: stress: mode", mode, [*MODES, "biaxial"])
        l = np.asarray(stretches, dtype=float)
        if mode == "biaxial" and l.shape[:1] != (2,):
            raise InputError(f"{self}: stress: stretches of a biaxial test must be (l1, l2), the shape is {l.shape}")
        flat = l.ravel()
        for bad in flat[~((flat > 0) & np.isfinite(flat))][:1]:
            raise InputError(f"{self}: a stretch of {bad:.6g}: must be finite and greater than 0")
        self._check_isotropic()
        both = flat.reshape(2, -1) if mode == "biaxial" else homogeneous.in_plane_stretches(mode, flat)
        P = self.response.stress(both, self._numbers())[:2 if mode == "biaxial" else 1].ravel()
        for bad in flat[~np.isfinite(P)][:1]:
            raise InputError(self._beyond(mode, bad) if mode in MODES else
                             f"{self}: biaxial stretches are beyond its limit: I1 must be less than"
                             f" {self.largest_I1:.6g}")
        return (P * flat if true else P).reshape(l.shape)[()]

    def largest_stretch(self, mode: str) -> float:
        """Return the stretch l of a test at which the energy becomes infinite.

        .. math:: l^2 + l^{2k} + l^{-2 - 2k} = I_{1,max}

        The right-hand side is the property `largest_I1`.

        Args:
            mode: "uniaxial" (k = -1/2), "pure_shear" (k = 0) or "equibiaxial" (k = 1).

        Returns:
            The stretch, above 1; infinity if the energy is finite for all stretches.
        """
        check_name(f"{self}: largest_stretch: mode", mode, MODES)
        if not math.isfinite(self.largest_I1):
            return math.inf
        from scipy.optimize import brentq
        k = MODES[mode]
        return brentq(lambda l: l**2 + l**(2 * k) + l**(-2 - 2 * k) - self.largest_I1, 1, math.sqrt(self.largest_I1))

    def rupture_stretch(self, mode: str) -> float:
        """Return the stretch beyond which the force decreases, for a sudden stretch in a homogeneous test.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".

        Returns:
            The stretch; infinity if the force always increases. The base class returns infinity.
        """
        return math.inf

    def check_stability(self, stretches: Any) -> MaterialStability:
        r"""Return the ranges of stretch in which the material is stable, in each of the three tests.

        For each of two criteria the range around l = 1 is given in which it holds. With the nominal stress P and the
        Kirchhoff stress tau they are

        .. math:: \frac{dP}{dl} > 0 \text{ (load)}, \qquad d\tau : d \ln l > 0 \text{ (Drucker)}

        The first allows a test under an increasing force to continue. The second holds for every change of the three
        stretches at constant volume: the Hessian of W in the logarithmic strains is positive definite.

        Args:
            stretches: stretches whose smallest and largest value (and 1) bound the examined range.

        Returns:
            The ranges in the tests "uniaxial", "pure_shear" and "equibiaxial".

        Raises:
            InputError: `stretches` is not a range of positive numbers.
        """
        try:
            low, high = (positive(f"{self}: check_stability: stretch", f(stretches)) for f in (min, max))
        except (TypeError, ValueError) as error:
            raise error if isinstance(error, InputError) else InputError(
                f"{self}: check_stability: stretches = {stretches!r}: must be a range such as (0.5, 6)") from None
        return homogeneous.stability(self.response, self._numbers(), min(low, 1.0), max(high, 1.0))

    def plot(self, axes: Axes | None = None, stretches: ArrayLike | None = None, unit: str = "") -> Any:
        """Draw nominal stress against stretch for uniaxial tension, pure shear and equibiaxial tension.

        Args:
            axes: matplotlib axes; None: a new figure.
            stretches: stretches, shape (n,); None: from 1 to 6, or to 95 % of the largest stretch of the material.
            unit: unit of stress of the constants, for the label.

        Returns:
            The matplotlib axes.
        """
        drawn: Any = new_axes() if axes is None else axes
        for mode in MODES:
            l = np.linspace(1, min(6.0, 0.95 * self.largest_stretch(mode)), 200) if stretches is None else stretches
            drawn.plot(l, self.stress(mode, l), label=mode.replace("_", " "))
        drawn.set(xlabel="stretch", ylabel="nominal stress" + f" ({unit})" * bool(unit), title=str(self))
        drawn.legend()
        return drawn

    def report(self, file: Any = "card.html", *, temperatures: Sequence[float] = (),
               rates: Sequence[float] = (0.1, 1.0, 10.0), unit: str = "", unit_of_time: str = "s") -> Any:
        """Write an HTML page with stress-stretch curves and the limits of the material.

        Args:
            file: name of the file.
            temperatures: temperatures of the curves; needed if constants or relaxation times depend on the temperature.
            rates: Hencky rates of the curves, 1/time, for a material that relaxes.
            unit: unit of stress of the constants, for labels.
            unit_of_time: unit of time of the constants, for labels.

        Returns:
            Path of the file.

        Raises:
            InputError: a constant depends on the position, or on a temperature that is not given.
            OSError: the file cannot be written.
        """
        from .card import write
        return write(self, file, temperatures, rates, unit, unit_of_time)

    def check(self, sample: Sample | None = None) -> None:
        """Check that the constants are finite and give a positive stiffness in the reference configuration.

        Numbers of any type are converted to floats.

        Args:
            sample: points at which varying constants are checked; None: only constants that do not vary are checked.

        Raises:
            InputError: a constant is not admissible, or the reference configuration is not stress-free or has no
                stiffness.
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
            raise InputError(f"{self} has no stiffness: its initial shear modulus is {mu:.6g}, must be positive")
        stress = self.response.derivatives(np.ones((3, n)), sets)[0]
        for g in stress.T[np.ptp(stress, axis=0) > 1e-6 * moduli[1]][:1]:
            raise InputError(f"{self} is not free of stress in the reference configuration: dW/dl along r, z and the"
                             f" hoop are {g[0]:.6g}, {g[1]:.6g} and {g[2]:.6g}; only a part that is the same in all"
                             " three, a pressure, is removed")

    def check_constants(self, **constants: Any) -> None:
        """Raise an InputError unless these values of the constants are admissible.

        Args:
            constants: values of the constants by name.
        """
        for name, value in constants.items():
            finite(f"{self}: {name}", value)

    @classmethod
    def guesses(cls, modulus: float, I1: float, terms: int | None) -> list[Material]:
        """Return materials of this class with initial constants for a fit.

        Args:
            modulus: approximate shear modulus of the data, stress.
            I1: largest I1 of the data.
            terms: number of terms of a series, or None.

        Returns:
            The materials.

        Raises:
            InputError: the class defines no initial constants.
        """
        raise InputError(f"fit: {cls.__name__} has no first guess of its own: give a material with constants near the"
                         f" wanted ones instead of the class")

    def coordinates(self) -> list[tuple[float, float, float]]:
        """Return the variables that a fit changes in place of the constants; by default the constants.

        All constants that follow from variables within their bounds are admissible (`constants_at`).

        Returns:
            List of (value for the present constants, lower bound, upper bound).
        """
        return [(float(value), -math.inf, math.inf) for value in self._numbers()]

    def constants_at(self, coordinates: Sequence[float] | np.ndarray) -> list[float]:
        """Return the constants that follow from the variables of a fit.

        Args:
            coordinates: values of the variables, in the order of the method `coordinates`.

        Returns:
            Constants, in the order of `parameters`.
        """
        return list(coordinates)

    def with_constants(self, constants: Sequence[Any]) -> Material:
        """Return a material of the same kind with other constants.

        Args:
            constants: the constants, in the order of `parameters`.

        Returns:
            The material.

        Raises:
            InputError: the number of constants differs, or they are not admissible.
        """
        if len(constants) != len(self.parameters):
            raise InputError(f"{self}: with_constants: {len(constants)} numbers for {', '.join(self.parameters)}")
        other = copy.copy(self)                             # with its `response`, which holds for any constants
        other.parameters = dict(zip(self.parameters, map(float, constants), strict=True))
        other.check()
        return other

    def at_temperature(self, temperature: float) -> Material:
        """Return the material at one temperature, with numbers in place of temperature-dependent constants.

        Args:
            temperature: the temperature.

        Returns:
            The material.

        Raises:
            InputError: a constant depends on the position, or has no value at this temperature.
        """
        found = [float(value(temperature)) if isinstance(value, OfTemperature) else value
                 for value in self.constants().values()]
        if any(isinstance(value, Varying) for value in found):
            raise InputError(f"{self}: at_temperature: a constant depends on the position")
        return self.with_constants(found)

    def is_isotropic(self, sample: Sample | None = None) -> bool:
        """Return True if the strain energy is the same for permuted and for turned stretches.

        Args:
            sample: points at which varying constants are taken; None: no constant varies.

        Returns:
            The property; True for a stress that depends on all past states (`integral`).
        """
        if self.integral is not None:
            return True
        sets = np.array(self._numbers()).reshape(-1, 1) if sample is None else self._sampled(sample)[:, :_MAX_SETS]
        l, n = np.array([1.02, 0.99, 1 / 1.02 / 0.99])[:, None], sets.shape[1]
        if not n:
            return True
        g, permuted, turned = (x * response.derivatives(np.tile(x, (1, n)), sets)[0] for response, x in (
            (self.response, l), (self.response, np.roll(l, 1, axis=0)), (self._turned_response, l)))
        s, permuted, turned = (stress - stress.mean(0) for stress in (g, permuted, turned))     # p takes up the mean
        error = np.maximum(np.abs(np.roll(s, 1, axis=0) - permuted), np.abs(s - turned)).max(0)
        return bool(np.all(error <= 1e-8 * np.abs(g / l).max(0)))

    @functools.cached_property
    def _turned_response(self) -> Response:
        """Derivatives of the strain energy by stretches along axes that are turned in the plane of directions 1, 2."""
        c, s = math.cos(_TURN), math.sin(_TURN)

        def energy(F: Any, **constants: Any) -> Any:
            return self.strain_energy(ufl.as_tensor([[c * F[0, 0], s * F[0, 0], 0], [-s * F[1, 1], c * F[1, 1], 0],
                                                     [0, 0, F[2, 2]]]), **constants)
        return Response(energy, list(self.parameters))

    def _check_isotropic(self) -> None:
        """Raise an InputError unless the strain energy is isotropic."""
        if not self.is_isotropic():
            raise InputError(f"{self} is not isotropic: its stresses depend on the direction that is pulled")

    def _beyond(self, mode: str, stretch: float) -> str:
        """Return the error message for a stretch in the test `mode` that is beyond the limit of the material."""
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
    """Return the value of a constant as text, a number with six significant digits."""
    return repr(float(f"{value:.6g}")) if isinstance(value, float) else repr(value)
