"""Materials that relax: an equilibrium energy and branches, each a spring that flows.

Every branch has a modulus mu and a relaxation time tau, and the energy (mu/2) [tr(Cbar A) - 3] of its elastic strain;
Cbar = J^(-2/3) C keeps the branches free of a stress in the reference configuration. The state of a branch is the
tensor Cv, or A, of its law. A step of length dt from a known state has a potential whose derivative by F is the
stress at its end, so its tangent is symmetric and consistent, and nothing is iterated at a point. With x = dt/tau it
is regular at dt = 0, where it is the elastic energy, and for dt without bound it has no branch.

A symmetric tensor with the block structure of F (`physics.kinematics`) is kept as its entries (11, 22, 12, 33).
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import ufl
from numpy.typing import ArrayLike

from ..errors import InputError, known, positive
from ..figures import Axes, figure
from ..physics import kinematics
from . import branches as tests
from .constants import OfTemperature, Sample
from .homogeneous import MODES
from .in_time import Relaxing, checked_pairs, checked_shift
from .material import Material, brief
from .tensors import IDENTITY, Entries, cofactor, determinant, deviator_squared, entries, inner, isochoric, plus


class RelaxingMaterial(Relaxing):
    """An equilibrium energy and relaxing branches, for any law of the branches.

    It has the constants of the equilibrium energy, then mu_1, tau_1, mu_2, ... Without times, `strain_energy`,
    `shear_modulus` and `stress` give the instantaneous response, before any relaxation.

    Args:
        equilibrium: the material that is left when all has relaxed, or None.
        branches: [(mu, tau), ...], at least one: shear modulus, stress, and relaxation time, time; each above 0.
        shift: how relaxation times depend on the temperature of the scene: `WLF`, `Arrhenius`, or any aT(T) of an
            array; the taus, which must be numbers, are those where aT = 1. None: they do not.
    """

    _tensor = ""                    # name of the branches' state
    _remembers = True               # the last state's C is needed, too
    _sign = 1                       # of the branches' state: see `Material.shapes`

    def __init__(self, equilibrium: Material | None, branches: Any, shift: Any = None):
        super().__init__(equilibrium)
        name = type(self).__name__
        for k, values in enumerate(checked_pairs(f"{name}: branches", branches, "mu, tau"), 1):
            for constant, value in zip((f"mu_{k}", f"tau_{k}"), values):
                if constant in self.parameters:
                    raise InputError(f"{name}: the equilibrium energy has a constant {constant!r}: that is the name of"
                                     f" a branch's; give it another")
                self.parameters[constant] = value
            if shift is not None:
                self.parameters[f"tau_{k}"] = _shifted(f"{name}: tau_{k}", values[1], shift)
        self.check()

    def check(self, sample: Sample | None = None) -> None:
        if sample is None and (rest := self.equilibrium) is not None:
            rest.check()
        super().check(sample)

    def check_constants(self, **constants):
        for k, mu, tau in self._branches(constants):
            positive(f"{type(self).__name__}: mu_{k}", mu)
            positive(f"{type(self).__name__}: tau_{k}", tau)
        super().check_constants(**constants)

    @property
    def branches(self) -> list[tuple[float, float]]:
        """[(mu, tau), ...]."""
        return [(mu, tau) for _, mu, tau in self._branches(self.parameters)]

    @property
    def internal(self) -> dict[str, tuple]:  # type: ignore[override]  # read only here
        """{name: value in the reference configuration} of its history variables: entries (11, 22, 12, 33) of
        tensors."""
        return dict.fromkeys(self.shapes, IDENTITY)

    @property
    def shapes(self) -> dict[str, int]:  # type: ignore[override]  # read only here
        """See `Material`."""
        branches = {f"{self._tensor}_{k}": self._sign for k, *_ in self._branches(self.parameters)}
        return {"C": 1} | branches if self._remembers else branches

    @property
    def of_flow(self) -> tuple[str, ...]:
        """See `Material`: the relaxation times."""
        return tuple(f"tau_{k}" for k, *_ in self._branches(self.parameters))

    def elastic_stretches(self, F, internal, **constants):
        """See `Material`: the roots of the eigenvalues of F M F^T, M = Cv^-1 or A, J^(-1/3) F for F."""
        scale = kinematics.volume_ratio(F) ** (-2 / 3)
        found = []
        for k, *_ in self._branches(constants):
            M = self._metric(entries(internal[f"{self._tensor}_{k}"]))
            B = scale * F * ufl.as_tensor([[M[0], M[2], 0], [M[2], M[1], 0], [0, 0, M[3]]]) * F.T
            radius = ufl.sqrt((B[0, 0] - B[1, 1]) ** 2 + 4 * B[0, 1] ** 2)
            found.append(ufl.sqrt(ufl.max_value((B[0, 0] + B[1, 1] + radius) / 2, B[2, 2])))
        return found

    def strain_energy(self, F, **constants):
        """Return the energy of F before anything has flowed."""
        mu = sum(mu for _, mu, _ in self._branches(constants))
        return self._relaxed_energy(F, constants) + mu / 2 * (inner(isochoric(F), IDENTITY) - 3)

    def stored_energy(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Energy per reference volume of F in the state `internal`; a UFL scalar, stress."""
        C = isochoric(F)
        return self._relaxed_energy(F, constants) + sum(
            mu / 2 * self._stored(C, entries(internal[f"{self._tensor}_{k}"]))
            for k, mu, _ in self._branches(constants))

    def dissipation(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Energy dissipated per reference volume and time, at least 0; a UFL scalar, stress over time."""
        C = isochoric(F)
        return sum(mu / (2 * tau) * ufl.max_value(self._dissipated(C, entries(internal[f"{self._tensor}_{k}"])), 0)
                   for k, mu, tau in self._branches(constants))

    def step_energy(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> Any:
        """Return a UFL scalar whose derivative by F is the stress at the end of a step that began with `internal`.

        Args:
            F: deformation gradient at the end, shape (3, 3).
            internal: {name: its entries, shape (4,)}, names as in `internal`.
            time_step: length of the step, time, at least 0.
        """
        C = isochoric(F)
        past = self._past(internal, time_step)
        return self._relaxed_energy(F, constants) + sum(
            mu / 2 * self._step(C, past, entries(internal[f"{self._tensor}_{k}"]), time_step / tau)
            for k, mu, tau in self._branches(constants))

    def updated(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> dict[str, Any]:
        """{name: its entries, shape (4,)} at the end of a step; arguments as of `step_energy`.

        It must be called after steps of length 0 too: the next step begins with the stored C.
        """
        C = isochoric(F)
        past, after = self._past(internal, time_step), self._left(C, internal, time_step)
        for k, _, tau in self._branches(constants):
            name = f"{self._tensor}_{k}"
            after[name] = self._advanced(C, past, entries(internal[name]), time_step / tau)
        return {name: ufl.as_vector(value) if isinstance(value, tuple) else value for name, value in after.items()}

    def _modulus(self, times):
        return sum(mu * np.exp(-times / tau) for mu, tau in self.branches)

    def stress(self, mode: str = "biaxial", stretches: ArrayLike = (), times: ArrayLike | None = None,
               between: str = "stretch", *, true: bool = False) -> np.ndarray:
        """Nominal stress, force over reference area, of a test (`true`: over the area as it is); stress.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial"; without times "biaxial" too.
            stretches: of any shape without times, (n,) with them.
            times: when the stretches are met, shape (n,), not falling; a step from one stretch to another at the same
                time is put on at once, and so is the first stretch, to a body in the reference configuration. None:
                every stretch is put on at once.
            between: the quantity that grows at a constant rate between two times, "stretch" or "strain" (logarithmic).

        Raises:
            InputError: as without times; times that fall or are not as many as the stretches.
        """
        if times is None:
            return super().stress(mode, stretches, true=true)
        t, l = tests.checked(f"{self}: stress", mode, times, stretches, between)
        mu, tau = np.array(self.branches).T
        P = self._relaxed_stress(mode, l) + self.unit_stress(mode, tau, t, l, between) @ mu
        return P * l if true else P

    @classmethod
    def unit_stress(cls, mode: str, tau: Any, times: np.ndarray, stretches: np.ndarray,
                    between: str = "stretch", accuracy: float = 1e-10) -> np.ndarray:
        """Nominal stress over mu, shape (n, branches), of branches with these tau; see `branches.elastic_strains`."""
        w = tests.elastic_strains(cls._flow, tau, mode, times, stretches, between, accuracy)
        return (np.exp(2 * w[..., 0]) - np.exp(2 * w[..., 2])) / stretches[:, None]

    def plot(self, axes: Axes | None = None, stretches: ArrayLike | None = None, unit: str = "",
             mode: str = "uniaxial", rates: ArrayLike | None = None, unit_of_time: str = "s") -> Any:
        """Draw nominal stress against stretch at constant Hencky rates, at once and relaxed; returns the axes.

        Args:
            axes, stretches, unit: as in `Material.plot`; all stretches above 1.
            mode: the test.
            rates: 1/time; default from 0.1 over the longest tau to 10 over the shortest, by decades.
        """
        known(f"{self}: plot: mode", mode, MODES)
        drawn: Any = figure()[1] if axes is None else axes
        l = np.linspace(1, min(6.0, 0.95 * self.largest_stretch(mode)), 200) if stretches is None else np.asarray(
            stretches, dtype=float)
        if rates is None:
            tau = [tau for _, tau in self.branches]
            rates = 10.0 ** np.arange(math.floor(-math.log10(max(tau))) - 1, math.ceil(-math.log10(min(tau))) + 2)
        drawn.plot(l, self.stress(mode, l), "k", label="at once")
        for rate in sorted(np.atleast_1d(np.asarray(rates, dtype=float)), reverse=True):
            drawn.plot(l, self.constant_rate(mode, rate, l), label=f"{rate:g}/{unit_of_time}")
        if (rest := self.equilibrium) is not None:
            drawn.plot(l, rest.stress(mode, l), "k--", label="relaxed")
        drawn.set(xlabel="stretch", ylabel="nominal stress" + f" ({unit})" * bool(unit),
                 title=f"{mode.replace('_', ' ')} tension at constant Hencky rates")
        drawn.legend()
        return drawn

    def coordinates(self):
        """Return the coordinates of the equilibrium energy, then the logarithms of mu and tau."""
        first = [] if (rest := self.equilibrium) is None else rest.coordinates()
        return first + [(math.log(value), -math.inf, math.inf) for pair in self.branches for value in pair]

    def constants_at(self, coordinates):
        if (rest := self.equilibrium) is None:
            return list(np.exp(coordinates))
        n = len(rest.parameters)
        return [*rest.constants_at(coordinates[:n]), *np.exp(coordinates[n:])]

    def _branches(self, constants: dict[str, Any]) -> Iterator[tuple[int, Any, Any]]:
        """Yield (number, mu, tau) of every branch."""
        k = 0
        while f"mu_{(k := k + 1)}" in constants and f"tau_{k}" in constants:
            yield k, constants[f"mu_{k}"], constants[f"tau_{k}"]

    def _past(self, internal: dict[str, Any], time_step: Any) -> Any:
        """Return the data of earlier states that a step of the branches needs, independent of tau."""
        return entries(internal["C"]) if self._remembers else None

    def _left(self, C: Entries, internal: dict[str, Any], time_step: Any) -> dict[str, Any]:
        """Return the history variables of this step that the next one needs besides the states of the branches."""
        return {"C": C} if self._remembers else {}

    # the law of a branch: energies over mu/2, times over tau, tensors as entries, C with det C = 1; `_metric` is M of
    # the elastic strain F M F^T

    def _metric(self, A: Entries) -> Entries:
        raise NotImplementedError

    def _stored(self, C: Entries, A: Entries) -> Any:
        raise NotImplementedError

    def _dissipated(self, C: Entries, A: Entries) -> Any:
        raise NotImplementedError

    def _step(self, C: Entries, before: Entries | None, A: Entries, x: Any) -> Any:
        raise NotImplementedError

    def _advanced(self, C: Entries, before: Entries | None, A: Entries, x: Any) -> Entries:
        raise NotImplementedError

    @staticmethod
    def _flow(w: np.ndarray) -> np.ndarray:
        """f of `branches` for elastic strains w; shapes (branches, 3)."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.equilibrium!r}, branches={self.branches!r})"

    def __str__(self) -> str:
        branches = ", ".join(f"({brief(mu)}, {brief(tau)})" for mu, tau in self.branches)
        return f"{type(self).__name__}({self.equilibrium}, branches=[{branches}])"


class Viscoelastic(RelaxingMaterial):
    """Finite viscoelasticity with Gaussian springs.

    W = W_eq(C) + sum (mu_k/2) [tr(C Cv_k^-1) - 3], dCv_k/dt = (1/tau_k) [C - (1/3) tr(C Cv_k^-1) Cv_k],
    det Cv_k = 1, Cv_k = I in the reference configuration: Leonov (1976), Simo and Miehe (1992), Le Tallec, Rahier
    and Kaiss (1993), Reese and Govindjee (1998), Kumar and Lopez-Pamies (2016). In small strains G(t) = G_eq + sum
    mu_k exp(-t/tau_k); in steady extension the stress of a branch grows in proportion to the rate, with the
    viscosity 3 mu tau.

    A step of implicit Euler has a closed form (Shutov, Landgraf and Ihlemann 2013): with G = Cv_n, x' = dt/tau,
    a = det G, b = det(G + x' C) it is Cv = (G + x' C)/b^(1/3), and its potential is, regular at dt = 0,
    (3 mu/2) [cof G : C + x' cof C : G + x'^2 det C] / (b^(2/3) + (a b)^(1/3) + a^(2/3)). The same with
    G = Cv_n + (x/2) C_n, x' = (x/2) [1 + (x/3) tr(C_n Cv_n^-1)] and x = dt/tau is of second order in time.

    Args:
        equilibrium, branches: as of `RelaxingMaterial`.
        order: of a step in time, 2 or 1.
        shift: as of `RelaxingMaterial`.

    >>> melt = fx.Viscoelastic(fx.NeoHookean(c10=0.1), branches=[(0.6, 0.1), (0.3, 2.0)])
    >>> round(melt.shear_modulus, 12)
    1.1
    """

    _tensor = "Cv"

    def __init__(self, equilibrium: Material | None, branches: Any, order: int = 2, shift: Any = None):
        known("Viscoelastic: order", order, (1, 2))
        self._remembers = order == 2
        super().__init__(equilibrium, branches, shift)

    def _metric(self, Cv):
        return cofactor(Cv)

    def _stored(self, C, Cv):
        return inner(C, self._metric(Cv)) - 3

    def _dissipated(self, C, Cv):
        return deviator_squared(C, self._metric(Cv))

    def _step(self, C, before, Cv, x):
        G, x = self._start(before, Cv, x)
        a, s = determinant(G), inner(cofactor(G), C) + x * inner(cofactor(C), G) + x**2
        p, q = a ** (1 / 3), (a + x * s) ** (1 / 3)
        return 3 * s / (q**2 + p * q + p**2) - 3

    def _advanced(self, C, before, Cv, x):
        G, x = self._start(before, Cv, x)
        grown = plus(G, C, x)
        scale = determinant(grown) ** (-1 / 3)
        return tuple(scale * g for g in grown)

    def _start(self, before, Cv, x):
        """Return G and x'."""
        if before is None:
            return Cv, x
        return plus(Cv, before, x / 2), x / 2 * (1 + x / 3 * inner(before, cofactor(Cv)))

    @staticmethod
    def _flow(w):
        m = np.exp(2 * w)
        return m - m.mean(axis=-1, keepdims=True)


class TransientNetwork(RelaxingMaterial):
    """Networks whose chains break and form again free of stress: Green and Tobolsky (1946), the upper-convected
    Maxwell law.

    The Kirchhoff stress of a branch is mu F A F^T (and a pressure), with dA/dt = (C^-1 - A)/tau and A = I in the
    reference configuration. The law is linear in C^-1: in steady extension faster than 1/(2 tau) the stress grows
    without bound.

    A step is exact if C^-1 is a parabola in time, through its value at the end of the step and the two values known
    before. So it is of third order, and of second however short tau is: for dt >> tau the stress follows the rate
    at the end of the step, by the backward difference of three points (BDF2 with variable steps). With x = dt/tau
    the step has the potential (mu/2) tr(C M), A = M + (1 - m - p) C^-1, m = (1 - e^-x)/x, M = e^-x A_n
    + (m - e^-x + p) C_n^-1 + p s (C_n^-1 - C_n-1^-1), p = [x - 2 + (x + 2) e^-x]/x^2 s/(1 + s), where s is the length
    of the step over the length of the step before. The stored energy is (mu/2) [tr(C A) - 3 - ln det A].

    >>> fx.TransientNetwork(None, branches=[(0.05, 1.0)]).shear_modulus
    0.05
    """

    _tensor, _sign = "A", -1
    of_motion = ("change", "pace")

    @property
    def internal(self) -> dict[str, Any]:  # type: ignore[override]  # read only here
        return super().internal | {"change": (0.0,) * 4, "pace": 0.0}

    def _past(self, internal, time_step):
        """Return (C_n^-1, s (C_n^-1 - C_n-1^-1), s/(1 + s)), see the class.

        The last two are 0 if the motion before is unknown; the last is reduced where BDF2 would be unstable.
        """
        s, change = time_step * internal["pace"], entries(internal["change"])
        near = ufl.max_value(0, ufl.min_value(1, 2 - s / 2))        # steps that grow by more leave BDF2 unstable
        small = ufl.lt(-inner(entries(internal["C"]), change), 1)       # else M is not positive definite
        share = ufl.conditional(small, near * s / (1 + s), 0)
        return cofactor(entries(internal["C"])), tuple(s * c for c in change), share

    def _left(self, C, internal, time_step):
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
        return inner(C, self._kept(past, A, x)) - 3

    def _advanced(self, C, past, A, x):
        return plus(self._kept(past, A, x), cofactor(C), 1 - _mean_decay(x) - past[2] * _bulge(x))

    def _kept(self, past, A, x):
        """Return M."""
        before, change, share = past
        decay, p = ufl.exp(-x), share * _bulge(x)
        return tuple(decay * a + (_mean_decay(x) - decay + p) * c + p * d for a, c, d in zip(A, before, change))

    @staticmethod
    def _flow(w):
        return 1 - np.exp(-2 * w)


def _shifted(name: str, tau: Any, shift: Any) -> OfTemperature:
    """Return the relaxation time aT(T) tau."""
    shift, tau = checked_shift(name, shift), positive(name, tau)
    return OfTemperature(lambda T: tau * shift(T), f"{tau!r} * {shift!r}", getattr(shift, "limits", None))


def _mean_decay(x: Any) -> Any:
    """(1 - e^-x)/x, by its series where x is small."""
    small = ufl.lt(x, 1e-2)
    y = ufl.conditional(small, 1, x)                            # the branch not taken must be finite too
    return ufl.conditional(small, 1 - x / 2 + x**2 / 6 - x**3 / 24 + x**4 / 120 - x**5 / 720, (1 - ufl.exp(-y)) / y)


def _bulge(x: Any) -> Any:
    """[x - 2 + (x + 2) e^-x]/x^2, by its series where x is small."""
    small = ufl.lt(x, 1e-2)
    y = ufl.conditional(small, 1, x)
    series = x * (1 / 6 - x / 12 + x**2 / 40 - x**3 / 180 + x**4 / 1008)
    return ufl.conditional(small, series, (y - 2 + (y + 2) * ufl.exp(-y)) / y**2)
