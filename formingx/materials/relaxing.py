"""Relaxing materials: an equilibrium energy and relaxing branches, each a spring in series with a damper.

The isochoric right Cauchy-Green tensor in the energy of a branch (`GeneralisedMaxwell`) keeps the branches stress-free
in the reference configuration. A step of length dt from a known state has a potential, whose derivative by F is the
stress at the end of the step. The tangent is therefore symmetric and consistent, without iterations at a point. The
potential is regular at dt = 0, where it is the elastic energy. For infinite dt the branch contributes nothing.

A symmetric tensor with one principal direction normal to the section is stored as its entries (11, 22, 12, 33).
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import ufl
from numpy.typing import ArrayLike

from ..errors import InputError, check_name, positive
from ..figures import Axes, new_axes
from ..physics import kinematics
from . import branches as tests
from .constants import OfTemperature, Sample
from .homogeneous import MODES
from .material import Material, brief
from .relaxation import RelaxingMaterial, checked_pairs, checked_shift
from .tensors import IDENTITY, Entries, entries, inner, isochoric


class GeneralisedMaxwell(RelaxingMaterial):
    r"""Base class of materials with an equilibrium energy and relaxing branches; subclasses define the law of a branch.

    .. math:: W = W_{eq}(F) + \sum_k \frac{\mu_k}{2} \left[\mathrm{tr}(\bar C M_k) - 3\right]

    The stress derives from W. W_eq is the equilibrium energy, :math:`\bar C` the isochoric right Cauchy-Green tensor.
    The tensor M_k describes the elastic strain of branch k with the shear modulus mu_k. It is the internal variable of
    the branch or, in `Viscoelastic`, the inverse of this variable.

    The constants are the constants of the equilibrium energy, then mu_1, tau_1, mu_2, and so on. `strain_energy`,
    `shear_modulus`, and `stress` without times give the response before any relaxation.

    Args:
        equilibrium: material that describes the relaxed state; None if all stress relaxes.
        branches: list of (mu, tau), at least one: shear modulus, stress, and relaxation time, time; each positive.
        shift: temperature dependence of the relaxation times: `WLF`, `Arrhenius`, or any function aT(T) of an array.
            The relaxation times are then aT(T) tau, and each tau must be a number. None: no dependence.

    Raises:
        InputError: an argument is not allowed.
    """

    _tensor = ""                    # name of the internal variable of a branch
    _stores_C = True                # C of the last state is an internal variable too
    _power = 1                       # power of the internal variable of a branch, see `Material.tensor_powers`

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
        """Branches, as a list of (shear modulus mu, relaxation time tau), stress and time."""
        return [(mu, tau) for _, mu, tau in self._branches(self.parameters)]

    @property
    def internal(self) -> dict[str, tuple]:  # type: ignore[override]  # read only here
        """Internal variables, symmetric tensors: {name: entries (11, 22, 12, 33) in the reference configuration}."""
        return dict.fromkeys(self.tensor_powers, IDENTITY)

    @property
    def tensor_powers(self) -> dict[str, int]:  # type: ignore[override]  # read only here
        """Internal variables that are tensors, {name: 1 for a tensor like C, -1 for one like its inverse}."""
        branches = {f"{self._tensor}_{k}": self._power for k, *_ in self._branches(self.parameters)}
        return {"C": 1} | branches if self._stores_C else branches

    @property
    def flow_constants(self) -> tuple[str, ...]:
        """Names of the relaxation times of all branches, the constants that determine a rate of flow."""
        return tuple(f"tau_{k}" for k, *_ in self._branches(self.parameters))

    def elastic_stretches(self, F, internal, **constants):
        r"""Return the largest principal elastic stretch of each branch in a state.

        .. math:: \sqrt{\max \mathrm{eig}(J^{-2/3} F M F^T)}, \qquad M = C_v^{-1} \text{ or } A

        Cv or A is the internal variable of the branch, and J the determinant of F.
        """
        scale = kinematics.volume_ratio(F) ** (-2 / 3)
        found = []
        for k, *_ in self._branches(constants):
            M = self._metric(entries(internal[f"{self._tensor}_{k}"]))
            B = scale * F * ufl.as_tensor([[M[0], M[2], 0], [M[2], M[1], 0], [0, 0, M[3]]]) * F.T
            radius = ufl.sqrt((B[0, 0] - B[1, 1]) ** 2 + 4 * B[0, 1] ** 2)
            found.append(ufl.sqrt(ufl.max_value((B[0, 0] + B[1, 1] + radius) / 2, B[2, 2])))
        return found

    def strain_energy(self, F, **constants):
        r"""Return the strain energy per reference volume for a sudden deformation of the undeformed body.

        .. math:: W = W_{eq}(F) + \sum_k \frac{\mu_k}{2} (\mathrm{tr} \, \bar C - 3)

        The first term is the equilibrium energy, mu_k the shear modulus of branch k, and :math:`\bar C` the isochoric
        right Cauchy-Green tensor.
        """
        mu = sum(mu for _, mu, _ in self._branches(constants))
        return self._relaxed_energy(F, constants) + mu / 2 * (inner(isochoric(F), IDENTITY) - 3)

    def stored_energy(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        r"""Return the recoverable energy per reference volume in a state, of the equilibrium and of all branches.

        .. math:: W_{eq}(F) + \sum_k \frac{\mu_k}{2} \psi_k

        For `Viscoelastic` :math:`\psi_k = \mathrm{tr}(\bar C C_{v,k}^{-1}) - 3`, for `TransientNetwork`
        :math:`\psi_k = \mathrm{tr}(\bar C A_k) - 3 - \ln \det A_k`, with the isochoric tensor :math:`\bar C`.
        """
        C = isochoric(F)
        return self._relaxed_energy(F, constants) + sum(
            mu / 2 * self._stored(C, entries(internal[f"{self._tensor}_{k}"]))
            for k, mu, _ in self._branches(constants))

    def dissipation(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        r"""Return the power per reference volume that the flow of all branches dissipates in a state.

        .. math:: \mathcal{D} = \sum_k \frac{\mu_k}{2 \tau_k} d_k(F, \text{internal variable})

        For `Viscoelastic` :math:`d_k = |\mathrm{dev}(\bar F C_{v,k}^{-1} \bar F^T)|^2`, for `TransientNetwork`
        :math:`d_k = \mathrm{tr}(\bar C A_k) + \mathrm{tr}(\bar C A_k)^{-1} - 6`. Bars denote isochoric parts.
        """
        C = isochoric(F)
        return sum(mu / (2 * tau) * ufl.max_value(self._dissipated(C, entries(internal[f"{self._tensor}_{k}"])), 0)
                   for k, mu, tau in self._branches(constants))

    def step_energy(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> Any:
        """Return the potential of a step in time, whose derivative by F is the nominal stress at its end."""
        C = isochoric(F)
        past = self._past(internal, time_step)
        return self._relaxed_energy(F, constants) + sum(
            mu / 2 * self._step(C, past, entries(internal[f"{self._tensor}_{k}"]), time_step / tau)
            for k, mu, tau in self._branches(constants))

    def updated(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> dict[str, Any]:
        """Return the internal variables at the end of a step in time.

        They also change in steps of length 0, because the stored C is the value at the end of the step.
        """
        C = isochoric(F)
        past, after = self._past(internal, time_step), self._deformation_history(C, internal, time_step)
        for k, _, tau in self._branches(constants):
            name = f"{self._tensor}_{k}"
            after[name] = self._advanced(C, past, entries(internal[name]), time_step / tau)
        return {name: ufl.as_vector(value) if isinstance(value, tuple) else value for name, value in after.items()}

    def _modulus(self, times):
        return sum(mu * np.exp(-times / tau) for mu, tau in self.branches)

    def stress(self, mode: str = "biaxial", stretches: ArrayLike = (), times: ArrayLike | None = None,
               between: str = "stretch", *, true: bool = False) -> np.ndarray:
        r"""Return the nominal stress, force over reference area, in a homogeneous test.

        Branch k has the shear modulus mu_k, and the elastic logarithmic strains w_k1 along the load and w_k3 in the
        stress-free direction. With the stretch l in the loaded direction and the stress P_eq of the equilibrium

        .. math:: P(t) = P_{eq}(l) + \sum_k \mu_k \frac{e^{2 w_{k1}} - e^{2 w_{k3}}}{l}

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial"; without times also "biaxial".
            stretches: stretches l in the loaded direction, any shape without times, shape (n,) with times. For
                "biaxial" any in-plane stretches (l1, l2), shape (2, ...).
            times: times of the stretches, shape (n,), not descending. The first stretch is applied suddenly to a body
                in the reference configuration; two stretches at the same time are a jump. None: every stretch is
                applied suddenly to a body in the reference configuration.
            between: quantity with a constant rate between two times, "stretch" or "strain" (logarithmic).
            true: True for the true stress, force over current area.

        Returns:
            Stress of the shape of `stretches`, stress.

        Raises:
            InputError: an unknown mode, a stretch that is not positive, descending times, or numbers of times and
                stretches that differ.
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
        r"""Return the nominal stress of branches over their shear modulus in a homogeneous test over time.

        .. math:: \frac{P}{\mu} = \frac{e^{2 w_1} - e^{2 w_3}}{l}

        Here w are the elastic logarithmic strains of a branch (`branches.elastic_strains`).

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".
            tau: relaxation times of the branches, shape (branches,), time.
            times: times, shape (n,), not descending.
            stretches: stretches l in the loaded direction at these times, shape (n,).
            between: quantity with a constant rate between two times, "stretch" or "strain" (logarithmic).
            accuracy: relative tolerance of the integration in time.

        Returns:
            Stress P over the modulus mu, dimensionless, shape (n, branches).
        """
        w = tests.elastic_strains(cls._flow, tau, mode, times, stretches, between, accuracy)
        return (np.exp(2 * w[..., 0]) - np.exp(2 * w[..., 2])) / stretches[:, None]

    def plot(self, axes: Axes | None = None, stretches: ArrayLike | None = None, unit: str = "",
             mode: str = "uniaxial", rates: ArrayLike | None = None, unit_of_time: str = "s") -> Any:
        """Draw nominal stress against stretch at constant Hencky rates, for sudden stretches, and after relaxation.

        Args:
            axes: matplotlib axes; None: a new figure.
            stretches: stretches above 1, shape (n,); None: from 1 to 6, but at most to 95 % of the stretch at which the
                material locks.
            unit: unit of stress of the constants, for the label.
            mode: "uniaxial", "pure_shear" or "equibiaxial".
            rates: Hencky rates, 1/time; None: decades from 0.1 over the longest relaxation time to 10 over the
                shortest.
            unit_of_time: unit of time of the constants, for labels.

        Returns:
            The matplotlib axes.
        """
        check_name(f"{self}: plot: mode", mode, MODES)
        drawn: Any = new_axes() if axes is None else axes
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
        r"""Return the variables that a fit changes in place of the constants.

        They are the variables of the equilibrium energy, then :math:`\ln \mu_k` and :math:`\ln \tau_k` of each branch.
        """
        first = [] if (rest := self.equilibrium) is None else rest.coordinates()
        return first + [(math.log(value), -math.inf, math.inf) for pair in self.branches for value in pair]

    def constants_at(self, coordinates):
        if (rest := self.equilibrium) is None:
            return list(np.exp(coordinates))
        n = len(rest.parameters)
        return [*rest.constants_at(coordinates[:n]), *np.exp(coordinates[n:])]

    def _branches(self, constants: dict[str, Any]) -> Iterator[tuple[int, Any, Any]]:
        """Yield (number from 1, mu, tau) of every branch, for {name: value} of the constants."""
        k = 0
        while f"mu_{(k := k + 1)}" in constants and f"tau_{k}" in constants:
            yield k, constants[f"mu_{k}"], constants[f"tau_{k}"]

    def _past(self, internal: dict[str, Any], time_step: Any) -> Any:
        """Return the earlier deformation (UFL) that a step of branches needs, by default C at its start; or None."""
        return entries(internal["C"]) if self._stores_C else None

    def _deformation_history(self, C: Entries, internal: dict[str, Any], time_step: Any) -> dict[str, Any]:
        """Return {name: value after the step} of internal variables of past deformation, by default C alone."""
        return {"C": C} if self._stores_C else {}

    # the law of a branch: A is its internal variable, C the isochoric right Cauchy-Green tensor, both as entries

    def _metric(self, A: Entries) -> Entries:
        """Return the tensor M of a branch with internal variable A: F M F^T is its elastic left Cauchy-Green tensor."""
        raise NotImplementedError

    def _stored(self, C: Entries, A: Entries) -> Any:
        """Return the stored energy of a branch over half its shear modulus, of C and internal variable A (UFL)."""
        raise NotImplementedError

    def _dissipated(self, C: Entries, A: Entries) -> Any:
        """Return the dissipated power of a branch over mu/(2 tau), of C and internal variable A (UFL)."""
        raise NotImplementedError

    def _step(self, C: Entries, past: Any, A: Entries, x: Any) -> Any:
        """Return the step potential (UFL) over half the modulus of a branch; its derivative by F is the stress."""
        raise NotImplementedError

    def _advanced(self, C: Entries, past: Any, A: Entries, x: Any) -> Entries:
        """Return the internal variable of a branch after a step of x relaxation times, from C then, `past` and A."""
        raise NotImplementedError

    @staticmethod
    def _flow(w: np.ndarray) -> np.ndarray:
        """Return the flow law f(w), (branches, 3) each, in dw_i/dt = d(ln l_i)/dt - f_i(w)/(2 tau), stretches l_i."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.equilibrium!r}, branches={self.branches!r})"

    def __str__(self) -> str:
        branches = ", ".join(f"({brief(mu)}, {brief(tau)})" for mu, tau in self.branches)
        return f"{type(self).__name__}({self.equilibrium}, branches=[{branches}])"


def _shifted(name: str, tau: Any, shift: Any) -> OfTemperature:
    """Return the relaxation time aT(T) tau as a function of the temperature; `shift` is the law aT."""
    shift, tau = checked_shift(name, shift), positive(name, tau)
    return OfTemperature(lambda T: tau * shift(T), f"{tau!r} * {shift!r}", getattr(shift, "limits", None))
