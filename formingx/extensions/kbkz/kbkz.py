"""Factorised K-BKZ equation: the stress is an integral over all past states, with damping.

The equation is by Kaye (1962), Bernstein, Kearsley and Zapas (1963); factorised, without a term in B^-1, as by Wagner
(1976) and Papanastasiou, Scriven and Macosko (1983). Without damping it is Lodge's (1956) network, `TransientNetwork`.
In a scene its stress is computed at each quadrature point from the past states there (`past_states`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError, check_name, check_type, finite_array, positive
from ...materials import branches
from ...materials.constants import OfTemperature, Sample
from ...materials.homogeneous import MODES
from ...materials.material import Material
from ...materials.relaxation import RelaxingMaterial, checked_pairs, checked_shift
from ...materials.tensors import inner, isochoric
from .damping import Damping
from .integral import MemoryIntegral

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANEL_AGE_RATIO = 1.5
"""Ratio of the ages at the ends of a panel of the memory integral; up to half the shortest relaxation time is one."""
_PANEL_STRAIN = 0.25
"""Largest change of logarithmic strain in a panel of the memory integral."""


class KBKZ(RelaxingMaterial):
    r"""Factorised K-BKZ material, for a melt that is undeformed before the run.

    .. math:: \tau = \int_{-\infty}^{t} \sum_k \frac{G_k}{\tau_k} e^{-(t - t')/\tau_k} \, h(I_1, I_2) \, B(t, t') \, dt'

    tau is the Kirchhoff stress up to a pressure, B the Finger tensor of the deformation since the time t'. I1 = tr B
    and I2 = tr B^-1. In small strains the relaxation modulus is G(t) = G_equilibrium + sum G_k exp(-t/tau_k). The state
    alone does not determine the stored energy of a damped material, so runs with it have no columns of energies.

    Args:
        spectrum: [(G, tau), ...], at least one: modulus, stress, and relaxation time, time; each above 0.
        damping: damping function h, such as `PSM` or `Wagner`; None: h = 1.
        equilibrium: a material without relaxation whose stress is added, or None.
        shift: temperature dependence of the relaxation times, see `Viscoelastic`; None: constant times.
        irreversible: True if h of a past state never increases: its smallest value so far applies.

    Raises:
        InputError: an argument that is not allowed.

    >>> melt = fx.KBKZ([(0.1, 0.5), (0.02, 10.0)], damping=fx.PSM(alpha=14.4, beta=0.05))
    >>> round(melt.shear_modulus, 12)
    0.12
    """

    def __init__(self, spectrum: Any, damping: Damping | None = None, equilibrium: Material | None = None,
                 shift: Any = None, irreversible: bool = False):
        super().__init__(equilibrium)
        self.spectrum = [(positive(f"KBKZ: G_{k}", G), positive(f"KBKZ: tau_{k}", tau))
                         for k, (G, tau) in enumerate(checked_pairs("KBKZ: spectrum", spectrum, "G, tau"), 1)]
        self.branches = self.spectrum
        G, tau = np.array(self.spectrum).T
        if len(G) > 2 and np.all(np.diff(G[np.argsort(tau)]) > 0) and np.ptp(np.log(G)) > 3:
            raise InputError(f"KBKZ: spectrum = {spectrum!r}: the moduli grow with the times, from {G.min():g} to"
                             f" {G.max():g}: must be (G, tau); of (eta, lambda) make KBKZ.of_viscosities(...)")
        if damping is not None:
            check_type("KBKZ: damping", damping, Damping, "PSM(alpha, beta), Wagner(alpha, beta) or None")
        self.damping = damping
        self.integral = MemoryIntegral(self.spectrum, damping, check_type("KBKZ: irreversible", irreversible, bool,
                                                                  "True or False"), shift is not None)
        if shift is not None:
            self.parameters["aT"] = OfTemperature(checked_shift("KBKZ", shift), repr(shift))
        self.check()

    flow_constants = ("aT",)
    stores_energy = False

    @classmethod
    def of_viscosities(cls, spectrum: Sequence[tuple[float, float]], *args: Any, **others: Any) -> KBKZ:
        r"""Return a material from viscosities and relaxation times, with moduli

        .. math:: G_k = \eta_k / \tau_k

        Args:
            spectrum: list of (viscosity, relaxation time), stress times time and time.
            args: further arguments of `KBKZ`, after `spectrum`.
            others: further keyword arguments of `KBKZ`.

        Returns:
            The material.
        """
        return cls([(positive("KBKZ: eta", eta) / positive("KBKZ: lambda", time), time) for eta, time in spectrum],
                   *args, **others)

    @property
    def symmetric(self) -> bool:  # type: ignore[override]  # read only here
        """True if the damping depends on I1 alone, so that the tangent is symmetric."""
        return self.damping is None or self.damping.of_I1_alone

    def shear_modulus_at(self, sample: Sample) -> np.ndarray:
        """Return the instantaneous shear moduli for the values that varying constants have at quadrature points.

        Args:
            sample: the `Sample`, at which the constants of `equilibrium` have n distinct sets of values.

        Returns:
            Modulus for each set, shape (n,), stress; shape (1,) without `equilibrium`.
        """
        equilibrium = 0.0 if self._equilibrium is None else self._equilibrium.shear_modulus_at(sample)
        return np.atleast_1d(sum(G for G, _ in self.spectrum) + equilibrium)

    def strain_energy(self, F, **constants):
        """Return the energy of the instantaneous response without damping, which gives moduli and stresses at F = I."""
        G = sum(G for G, _ in self.spectrum)
        return G / 2 * (inner(isochoric(F), (1, 1, 0, 1)) - 3) + self._relaxed_energy(F, constants)

    def step_energy(self, F, internal, time_step, **constants):
        """Return a potential whose derivative by F is the stress at the end of a step; it is no energy.

        `internal` is {name: coefficient of the form}, with the names of `MemoryIntegral.coefficients`.
        """
        return self.integral.potential(isochoric(F), internal, time_step) + self._relaxed_energy(F, constants)

    def stored_energy(self, F, internal, **constants):
        """Return `step_energy` for a step of length 0: its derivative by F is the stress; its value has no meaning."""
        return self.step_energy(F, internal, 0.0, **constants)

    def _modulus(self, times):
        """Return the relaxation modulus of the spectrum at `times`, any shape, without `equilibrium`, stress."""
        return sum(G * np.exp(-np.asarray(times, float) / tau) for G, tau in self.spectrum)

    def stress(self, mode: str = "biaxial", stretches: ArrayLike = (), times: ArrayLike | None = None,
               between: str = "stretch", *, true: bool = False) -> np.ndarray:
        """Return the nominal stress (force over reference area) of a homogeneous test.

        Its relative error is below 1e-8.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial"; without times "biaxial" too, see `Material.stress`.
            stretches: stretches, any shape without times, shape (n,) with times.
            times: times of the stretches, shape (n,), not descending. The first stretch is applied suddenly; two
                stretches at the same time are a jump. None: every stretch is applied suddenly.
            between: quantity with a constant rate between two times, "stretch" or "strain" (logarithmic).
            true: True for the true stress, force over current area.

        Returns:
            Stress of the shape of `stretches`.

        Raises:
            InputError: unknown mode, a stretch that is not above 0, times that fall or are not one for each stretch.
        """
        if times is None:
            l = np.asarray(stretches, float)
            if mode == "biaxial":
                return self._biaxial(l) * (l if true else 1.0)
            branches.checked(f"{self}: stress", mode, np.zeros(l.size), l.ravel(), between)
            at_once = self._modulus(0.0) * self._damped_difference(mode, l) / l
            return (at_once + self._relaxed_stress(mode, l)) * (l if true else 1.0)
        t, l = branches.checked(f"{self}: stress", mode, times, stretches, between)
        found = np.array([self._true_stress(mode, t[:n + 1], l[:n + 1], between) for n in range(len(t))]) / l
        return (found + self._relaxed_stress(mode, l)) * (l if true else 1.0)

    def shear(self, rate: float, times: ArrayLike) -> np.ndarray:
        r"""Return the shear stress in a simple shear that starts at time 0 with a constant rate.

        .. math:: \sigma_{12} = G(t)\, h(\gamma)\, \gamma + \int_0^t m(s)\, h(\dot\gamma s)\, \dot\gamma s\, ds, \qquad
                  \gamma = \dot\gamma t, \quad m = -\frac{dG}{dt}

        G(t) is the relaxation modulus of the spectrum, h the damping. The stress of `equilibrium` is left out.

        Args:
            rate: shear rate, 1/time, positive.
            times: times t since the start of the shear, shape (n,), not negative.

        Returns:
            Shear stress, shape (n,), stress.

        Raises:
            InputError: a rate that is not above 0, or times that are negative or not finite.

        >>> melt = fx.KBKZ([(1000.0, 1.0)])                                    # viscosity 1000 Pa s
        >>> round(float(melt.shear(0.1, [50.0])[0]), 6)
        100.0
        """
        rate, t = positive(f"{self}: shear: rate", rate), finite_array(f"{self}: shear: times", times)
        if t.ndim > 1 or np.any(t < 0):
            raise InputError(f"{self}: shear: times = {times!r}: must not be negative, of shape (n,)")
        modulus, tau = np.array(self.spectrum).T
        first = 1e-3 * tau.min()                             # largest age in the first interval of the integral

        def damped_strain(strain: np.ndarray) -> np.ndarray:
            """Return the damping h times a shear strain, any shape."""
            return strain * (1.0 if self.damping is None else self.damping(3 + strain**2, 3 + strain**2))
        found = []
        for now in np.atleast_1d(t):
            ends = now * np.append(0.0, np.geomspace(first / max(now, 2 * first), 1.0, 60))
            half = np.diff(ends)[:, None] / 2
            age = ends[:-1, None] + half * (1 + _NODES)
            memory = np.exp(-age[..., None] / tau) @ (modulus / tau)
            found.append(np.sum(half * _WEIGHTS * memory * damped_strain(rate * age))
                         + self._modulus(now) * damped_strain(rate * now))
        return np.array(found)

    def _biaxial(self, l: np.ndarray) -> np.ndarray:
        """Return the nominal stresses in both directions after a sudden biaxial stretch l, shape (2, ...) each."""
        if l.shape[:1] != (2,) or not np.all((l > 0) & np.isfinite(l)):
            raise InputError(f"{self}: stress: stretches of a biaxial test must be (l1, l2), each above 0")
        squares = np.stack([*l**2, 1 / (l[0] * l[1])**2])
        h = 1.0 if self.damping is None else self.damping(squares.sum(0), (1 / squares).sum(0))
        return self._modulus(0.0) * h * (squares[:2] - squares[2]) / l + self._relaxed_stress("biaxial", l)

    def rupture_stretch(self, mode: str) -> float:
        """Return the stretch at which the true stress after a sudden stretch is largest.

        A larger sudden stretch carries no more stress: a damped melt that is stretched faster than it relaxes thins
        without end.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".

        Returns:
            The stretch; infinity without a maximum up to 100.

        Raises:
            InputError: an unknown mode.
        """
        check_name(f"{self}: rupture_stretch: mode", mode, MODES)
        l = np.geomspace(1, 100, 4000)
        stresses = self._modulus(0.0) * self._damped_difference(mode, l) + self._relaxed_stress(mode, l) * l
        falls = np.flatnonzero(stresses[1:] < stresses[:-1])
        return float(l[falls[0]]) if len(falls) else np.inf

    def _true_stress(self, mode: str, times: np.ndarray, stretches: np.ndarray, between: str) -> float:
        """Return tau_1 - tau_3 at the last of times (n,), without equilibrium; `between`: "stretch" or "strain"."""
        now, last = times[-1], stretches[-1]
        modulus, tau = np.array(self.spectrum).T
        initial = self._modulus(now - times[0]) * self._damped_difference(mode, last)
        ends = self._panel_ends(times, stretches)
        half = np.diff(ends)[:, None] / 2
        age = ends[:-1, None] + half * (1 + _NODES)
        memory = np.exp(-age[..., None] / tau) @ (modulus / tau)
        relative = last / _interpolated(now - age, times, stretches, between)
        return float(initial + np.sum(half * _WEIGHTS * memory * self._damped_difference(mode, relative)))

    def _panel_ends(self, times: np.ndarray, stretches: np.ndarray) -> np.ndarray:
        """Return the ends of quadrature panels as ascending ages (k,), from instants to the last of times (n,)."""
        whole, shortest = times[-1] - times[0], min(tau for _, tau in self.spectrum)
        count = max(0, int(np.log(max(2 * whole / shortest, 1)) / np.log(_PANEL_AGE_RATIO)) + 1)
        ages = [np.array([0, whole]), shortest / 2 * _PANEL_AGE_RATIO ** np.arange(count), times[-1] - times]
        for i in np.flatnonzero(np.diff(times) > 0):
            parts = int(np.abs(np.log(stretches[i + 1] / stretches[i])) / _PANEL_STRAIN) + 1
            if parts > 1:
                ages.append(times[-1] - np.linspace(times[i], times[i + 1], parts + 1))
        found = np.unique(np.concatenate(ages))
        return found[found <= whole]

    def _damped_difference(self, mode: str, stretch: np.ndarray) -> np.ndarray:
        """Return h (B_11 - B_33) after a sudden stretch with Finger tensor B, dimensionless, shape of `stretch`."""
        square = np.asarray(stretch, float)[..., None] ** (2 * np.array([1, MODES[mode], -1 - MODES[mode]]))
        difference = square[..., 0] - square[..., 2]
        return difference if self.damping is None else difference * self.damping(square.sum(-1), (1 / square).sum(-1))

    def __str__(self) -> str:
        others = f", equilibrium={self.equilibrium}" if self._equilibrium is not None else ""
        others += f", shift={self.parameters['aT']!r}" if "aT" in self.parameters else ""
        return f"KBKZ({self.spectrum!r}, damping={self.damping}{others}" + ", irreversible=True" * (
            self.integral.irreversible) + ")"

    __repr__ = __str__


def _interpolated(t: np.ndarray, times: np.ndarray, stretches: np.ndarray, between: str) -> np.ndarray:
    """Return the stretches at times t, any shape, of a test (n,) with linear "stretch" or logarithmic "strain"."""
    if between == "stretch":
        return np.interp(t, times, stretches)
    return np.exp(np.interp(t, times, np.log(stretches)))
