r"""Exact solutions in time for comparison: a block under a dead load, a thick tube or sphere, a thin balloon.

All bodies are incompressible with one degree of freedom s. The material is W = c10 (I1 - 3) with the branches of
`Viscoelastic`. The principal directions are fixed, with logarithmic strains e(s). A branch with the shear modulus mu
and the relaxation time tau has the elastic logarithmic strains w:

.. math:: \dot{w}_i = \dot{e}_i - \frac{1}{2 \tau} \left(e^{2 w_i} - \frac{1}{3} \sum_j e^{2 w_j}\right)

The load is a sum over points (`ThickBody`), by Gauss quadrature in a thick wall. If s is prescribed, the branches are
integrated in time. If the load is constant, its zero rate gives ds/dt.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, check_name, non_negative, positive
from ..materials.homogeneous import MODES
from ..materials.viscoelastic import Viscoelastic

_TOLERANCES = {"rtol": 1e-12, "atol": 1e-13}


@dataclass
class ThickBody:
    r"""Viscoelastic body with one degree of freedom s, and its present state; initially s = 0 and the stress is 0.

    For a block and a thin balloon s is the logarithm of the stretch. For a thick wall s is a^n - A^n, with the deformed
    and the reference inner radius a and A. There n is 2 for a tube, 3 for a sphere. The load is a sum over points. T is
    the difference of the Cauchy stresses in the principal directions 1 and 3. Direction 1 is along a block or a wall,
    3 is stress-free in a block and through a wall. With the principal stretches lambda_1 and lambda_3 of the body and
    the elastic logarithmic strains w_k of branch k:

    .. math:: \text{load} = \sum_{i=1}^n c_i(s) \, T_i, \qquad
              T = 2 c_{10} (\lambda_1^2 - \lambda_3^2) + \sum_k \mu_k \left(e^{2 w_{k1}} - e^{2 w_{k3}}\right)

    Attributes:
        c10: neo-Hookean constant of the equilibrium, stress.
        branches: (shear modulus mu, relaxation time tau) of each branch, stress and time.
        direction: ratios of the logarithmic strains in the principal directions 1, 2, 3 to the strain in direction 1,
            shape (3,).
        strain: function of s that returns the logarithmic strain e in direction 1 and de/ds at all points, shape (n,)
            each.
        weight: function of s that returns the weight c of the load and dc/ds at all points, shape (n,) each.
        time: present time.
        s: present value of the degree of freedom.
        w: present elastic logarithmic strains of the branches, shape (n, branches, 3).
        mu: shear moduli of the branches, shape (branches,), stress.
        tau: relaxation times of the branches, shape (branches,), time.

    >>> from formingx.exact.time import block
    >>> bar = block("uniaxial", c10=0.5, branches=[(1.0, 2.0)])
    >>> bar.jump(0.2)
    >>> bar.relax([1.0, 10.0]).round(4).tolist()
    [0.8545, 0.5541]
    """

    c10: float
    branches: list[tuple[float, float]]
    direction: np.ndarray
    strain: Callable
    weight: Callable

    def __post_init__(self):
        checked = Viscoelastic(None, self.branches)
        self.mu, self.tau = np.array(checked.branches).T
        self.c10 = non_negative("c10", self.c10)
        self.time = self.s = 0.0
        self.w = np.zeros((len(self.strain(0.0)[0]), len(self.mu), 3))

    @property
    def load(self) -> float:
        """Load of the body in its present state, stress.

        For a block it is the nominal stress, for a thick wall the inner pressure. For a thin balloon it is the inner
        pressure times reference radius over reference thickness.
        """
        return self._load(self.s, self.w)

    def jump(self, s: float) -> None:
        """Deform the body instantaneously, without relaxation.

        Args:
            s: new value of the degree of freedom. It is the logarithm of the stretch of a block or a balloon, or
                a^n - A^n for the inner radius of a wall (`ThickBody`).
        """
        self.w = self._after_jump(s)
        self.s = s

    def jump_to_load(self, load: float, bracket: tuple[float, float]) -> None:
        """Deform the body instantaneously, without relaxation, until it carries a given load.

        Args:
            load: the load, stress, such as the inner pressure of a wall (`load`).
            bracket: two values of the degree of freedom s (`ThickBody`), between which the load is reached.
        """
        from scipy.optimize import brentq
        self.jump(brentq(lambda s: self._load(s, self._after_jump(s)) - load, *bracket, xtol=1e-15, rtol=1e-14))

    def deform(self, path: Callable, times: Any) -> np.ndarray:
        """Return the loads, stress, shape (n,), while the degree of freedom s is a prescribed function of time.

        For a block s is the logarithm of its stretch and the load its stress; see `ThickBody` for walls.

        Args:
            path: function of time that returns s and ds/dt.
            times: times after the present time, ascending, shape (n,). The last one becomes the present time.
        """
        def rate(t, y):
            s, ds = path(t)
            return self._elastic_rate(s, ds, y.reshape(self.w.shape)).ravel()

        found = self._integrate(rate, self.w.ravel(), times)
        states = [(path(t)[0], y.reshape(self.w.shape)) for t, y in zip(times, found)]
        self.s, self.w = states[-1]
        return np.array([self._load(*state) for state in states])

    def relax(self, times: Any) -> np.ndarray:
        """Return the loads at ascending times, shape (n,), while the degree of freedom s is constant (relaxation)."""
        s = self.s
        return self.deform(lambda t: (s, 0.0), times)

    def creep(self, times: Any) -> np.ndarray:
        """Return the degree of freedom s during creep, while the present load stays constant.

        Args:
            times: ascending times, shape (n,).

        Returns:
            Values of s, shape (n,): the logarithm of the stretch of a block or a balloon, or a^n - A^n of a wall
            (`ThickBody`).
        """
        def rate(t, y):
            s, w = y[0], y[1:].reshape(self.w.shape)
            ds = 1 / self._time_per_s(s, w)
            return np.append(ds, self._elastic_rate(s, ds, w))

        found = self._integrate(rate, np.append(self.s, self.w), times)
        self.s, self.w = found[-1, 0], found[-1, 1:].reshape(self.w.shape)
        return found[:, 0]

    def creep_times(self, targets: Any, end: float) -> tuple[np.ndarray, float | None]:
        """Return the times at which the degree of freedom s reaches given values in creep under the present load.

        The load must be larger than the load of the completely relaxed body at every s up to `end`. Otherwise creep
        would approach an equilibrium and stop.

        Args:
            targets: values of s, shape (n,): logarithms of the stretch of a block or a balloon, or a^n - A^n of a wall
                (`ThickBody`).
            end: value of s at which the integration ends.

        Returns:
            Times, shape (n,): the present time for a target below the present s, nan for a target that is not reached.
            Then the time of the limit point, at which ds/dt becomes infinite; None if s reaches `end`.
        """
        from scipy.integrate import solve_ivp

        def rate(s, y):
            w = y[1:].reshape(self.w.shape)
            dt = self._time_per_s(s, w)
            return np.append(dt, self._strain_rate(s) - dt * self._relaxation_rate(w).ravel())

        def limit_point(s, y):
            return self._time_per_s(s, y[1:].reshape(self.w.shape))

        limit_point.terminal = True                              # type: ignore[attr-defined]
        found = solve_ivp(rate, (self.s, end), np.append(self.time, self.w), method="DOP853", dense_output=True,
                          events=limit_point, max_step=0.01, **_TOLERANCES)
        times = [self.time if s <= self.s else found.sol(s)[0] if s <= found.t[-1] else np.nan for s in targets]
        return np.array(times), float(found.y_events[0][0][0]) if len(found.t_events[0]) else None

    def _load(self, s: float, w: np.ndarray) -> float:
        """Return the load, stress, for the degree of freedom s and the elastic strains w, shape (n, branches, 3)."""
        return float(self.weight(s)[0] @ self._difference(s, w))

    def _difference(self, s: float, w: np.ndarray) -> np.ndarray:
        """Return differences of principal stresses at all points, (n,), from s and elastic strains (n, branches, 3)."""
        l2 = np.exp(2 * self.strain(s)[0][:, None] * self.direction)
        m = np.exp(2 * w)
        return 2 * self.c10 * (l2[:, 0] - l2[:, 2]) + (m[..., 0] - m[..., 2]) @ self.mu

    def _after_jump(self, s: float) -> np.ndarray:
        """Return the elastic strains after an instantaneous deformation to s, shape (n, branches, 3)."""
        return self.w + (self.strain(s)[0] - self.strain(self.s)[0])[:, None, None] * self.direction

    def _strain_rate(self, s: float) -> np.ndarray:
        """Return the derivatives of the elastic strains w by s without relaxation, shape (3 n branches,)."""
        return np.broadcast_to(self.strain(s)[1][:, None, None] * self.direction, self.w.shape).ravel()

    def _elastic_rate(self, s: float, ds: float, w: np.ndarray) -> np.ndarray:
        """Return the time derivatives, (3 n branches,), of the elastic strains w, (n, branches, 3); ds is that of s."""
        return self._strain_rate(s) * ds - self._relaxation_rate(w).ravel()

    def _relaxation_rate(self, w: np.ndarray) -> np.ndarray:
        """Return the rates of relaxation (e^(2 w_i) - (1/3) sum_j e^(2 w_j))/(2 tau), (n, branches, 3), 1/time."""
        m = np.exp(2 * w)
        return (m - m.mean(axis=-1, keepdims=True)) / (2 * self.tau[:, None])

    def _time_per_s(self, s: float, w: np.ndarray) -> float:
        r"""Return the derivative of the time by the degree of freedom s in creep under a constant load.

        .. math:: \frac{dt}{ds} = \frac{\sum (c' T + c \, e' \, \partial T / \partial e)}
                  {\sum c \sum_k 2 \mu_k (e^{2 w_{k1}} \rho_{k1} - e^{2 w_{k3}} \rho_{k3})}

        Sums without limits are over the n points. There c(s) is the weight of the load, e(s) the strain of the body and
        T the stress difference; a prime is a derivative by s. Sums over k are over the branches, with the shear moduli
        mu_k and the elastic strains w. The rates at which these decrease by relaxation are rho. The elastic strains
        have shape (n, branches, 3).
        """
        (e, de), (c, dc), d = self.strain(s), self.weight(s), self.direction
        m, l2 = np.exp(2 * w), np.exp(2 * e[:, None] * self.direction)
        stiffness = 4 * self.c10 * (d[0] * l2[:, 0] - d[2] * l2[:, 2])
        stiffness += 2 * (d[0] * m[..., 0] - d[2] * m[..., 2]) @ self.mu
        relaxation = 2 * m * self._relaxation_rate(w)
        relaxation = (relaxation[..., 0] - relaxation[..., 2]) @ self.mu
        return float((dc @ self._difference(s, w) + (c * de) @ stiffness) / (c @ relaxation))

    def _integrate(self, rate: Callable, start: np.ndarray, times: Any) -> np.ndarray:
        """Return the solution of an initial value problem at n times, shape (n, k), and update the present time.

        `rate` maps (time, solution) to derivatives, (k,). An end before the last time is an InputError.
        """
        from scipy.integrate import solve_ivp
        found = solve_ivp(rate, (self.time, times[-1]), start, method="DOP853", t_eval=times, **_TOLERANCES)
        if not found.success:
            raise InputError(f"times = {times!r}: no solution beyond {found.t[-1] if len(found.t) else self.time:.6g}")
        self.time = float(times[-1])
        return found.y.T


def block(mode: str, *, c10: float, branches: Any) -> ThickBody:
    r"""Return a block in a homogeneous test as a `ThickBody`, whose load is the nominal stress P.

    .. math:: P = T / \lambda

    T is the difference of the Cauchy stresses along the load and in the stress-free direction. The degree of freedom is
    s = ln(lambda), with the stretch lambda along the load.

    Args:
        mode: "uniaxial", "pure_shear" or "equibiaxial".
        c10: neo-Hookean constant of the equilibrium, stress.
        branches: (shear modulus, relaxation time) of each branch, stress and time.
    """
    check_name("block: mode", mode, MODES)
    k = MODES[mode]
    return ThickBody(c10, branches, np.array([1, k, -1 - k]), lambda s: (np.array([s]), np.ones(1)),
                lambda s: (np.array([math.exp(-s)]), np.array([-math.exp(-s)])))


def wall(kind: str, *, inner_radius: float, outer_radius: float, c10: float, branches: Any,
         points: int = 40) -> ThickBody:
    r"""Return a thick tube (plane strain) or sphere as a `ThickBody`, whose load is the inner pressure p.

    Its degree of freedom s is given by the deformed and the reference inner radius a and A. T is the difference of
    circumferential and radial Cauchy stress at the reference radius R, whose deformed radius is r:

    .. math:: s = a^n - A^n, \qquad r^n = R^n + s, \qquad p = \int_A^B \frac{(n - 1) \, T \, R^{n-1}}{r^n} \, dR

    Here n is 2 for a tube and 3 for a sphere.

    Args:
        kind: "tube" or "sphere".
        inner_radius: reference inner radius A, length.
        outer_radius: reference outer radius B, length.
        c10: neo-Hookean constant of the equilibrium, stress.
        branches: (shear modulus, relaxation time) of each branch, stress and time.
        points: number of Gauss points through the wall.

    Raises:
        InputError: a size or constant is not allowed.
    """
    check_name("wall: kind", kind, ("tube", "sphere"))
    A, B, n = positive("inner_radius", inner_radius), positive("outer_radius", outer_radius), 2 if kind == "tube" else 3
    if not A < B:
        raise InputError(f"outer_radius = {outer_radius!r}: must be above inner_radius = {inner_radius!r}")
    x, gauss = np.polynomial.legendre.leggauss(points)
    R, rn = (A + B + (B - A) * x) / 2, n - 1
    share = (B - A) / 2 * gauss * rn * R**rn
    hoop_third_radial = np.array([1, 0, -1.0]) if kind == "tube" else np.array([1, 1, -2.0])
    return ThickBody(c10, branches, hoop_third_radial,
                lambda s: (np.log1p(s / R**n) / n, 1 / (n * (R**n + s))),
                lambda s: (share / (R**n + s), -share / (R**n + s) ** 2))


def balloon(*, c10: float, branches: Any) -> ThickBody:
    r"""Return a thin spherical balloon under the inner pressure p as a `ThickBody`, whose load is p R0/H0.

    .. math:: \frac{p R_0}{H_0} = \frac{2 T}{\lambda^3}, \qquad \lambda = \frac{r}{R_0}

    r and R0 are the deformed and the reference radius, H0 is the reference thickness. T is the difference of the Cauchy
    stresses along and through the wall. The degree of freedom is s = ln(lambda).

    Args:
        c10: neo-Hookean constant of the equilibrium, stress.
        branches: (shear modulus, relaxation time) of each branch, stress and time.
    """
    return ThickBody(c10, branches, np.array([1, 1, -2.0]), lambda s: (np.array([s]), np.ones(1)),
                lambda s: (np.array([2 * math.exp(-3 * s)]), np.array([-6 * math.exp(-3 * s)])))
