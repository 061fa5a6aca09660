"""Exact solutions in time to compare with: a block under a dead force, the thick tube and sphere, the thin balloon.

All are incompressible, of W = c10 (I1 - 3) and the branches of `Viscoelastic`, and have one degree of freedom s. Their
points have logarithmic strains e(s) along fixed directions; a branch has there the elastic strains w,
dw_i/dt = de_i/dt - [exp(2 w_i) - (1/3) sum_j exp(2 w_j)]/(2 tau). With T = 2 c10 (l_1^2 - l_3^2)
+ sum mu [exp(2 w_1) - exp(2 w_3)], the difference of the stresses along 1 and 3, the load is a sum over
points, c(s) T::

    block under a nominal stress P:  P = T/l,  s = ln l
    thick wall, r^n = R^n + s, s = a^n - A^n, n = 2 (tube in plane strain) or 3 (sphere), 1 = hoop, 3 = radial:
        p = integral of (n - 1) T R^(n-1)/r^n dR, by Gauss's rule
    thin balloon, R0 and H0 in the reference configuration:  p R0/H0 = 2 T/l^3,  s = ln l, 3 = through the wall

If s is prescribed, the branches are integrated. If the load is constant, its zero rate gives ds/dt.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, known, non_negative, positive
from ..materials.homogeneous import MODES
from ..materials.viscoelastic import Viscoelastic

_TOLERANCES = {"rtol": 1e-12, "atol": 1e-13}


@dataclass
class Body:
    """A body of one degree of freedom s, and its state; free of stress at s = 0 at first.

    Attributes:
        c10, branches: of the material, stress and (stress, time).
        direction: de_i/de in the three directions, shape (3,).
        strain: called with s, gives e and de/ds of all points, each of shape (n,).
        weight: called with s, gives c and dc/ds, each of shape (n,).
        time, s: where it is. w: elastic strains, shape (n, branches, 3).

    >>> from formingx.exact.time import block
    >>> bar = block("uniaxial", c10=0.5, branches=[(1.0, 2.0)])
    >>> bar.jump(0.2)
    >>> bar.hold([1.0, 10.0]).round(4).tolist()
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
        """The load of the state."""
        return self._load(self.s, self.w)

    def jump(self, s: float) -> None:
        """Go to s at once."""
        self.w = self._jumped(s)
        self.s = s

    def jump_to_load(self, load: float, bracket: tuple[float, float]) -> None:
        """Go at once to the s, within `bracket`, at which the load is `load`."""
        from scipy.optimize import brentq
        self.jump(brentq(lambda s: self._load(s, self._jumped(s)) - load, *bracket, xtol=1e-15, rtol=1e-14))

    def drive(self, path: Callable, times: Any) -> np.ndarray:
        """Return the loads at times (ascending, above the present one) at which path(t) gives s and ds/dt; ends at
        the last."""
        def rate(t, y):
            s, ds = path(t)
            return self._flow(s, ds, y.reshape(self.w.shape)).ravel()

        found = self._integrate(rate, self.w.ravel(), times)
        states = [(path(t)[0], y.reshape(self.w.shape)) for t, y in zip(times, found)]
        self.s, self.w = states[-1]
        return np.array([self._load(*state) for state in states])

    def hold(self, times: Any) -> np.ndarray:
        """Return the loads at these times while s keeps its present value."""
        s = self.s
        return self.drive(lambda t: (s, 0.0), times)

    def creep(self, times: Any) -> np.ndarray:
        """Return s at these times while the load keeps its present value."""
        def rate(t, y):
            s, w = y[0], y[1:].reshape(self.w.shape)
            ds = 1 / self._time_per_s(s, w)
            return np.append(ds, self._flow(s, ds, w))

        found = self._integrate(rate, np.append(self.s, self.w), times)
        self.s, self.w = found[-1, 0], found[-1, 1:].reshape(self.w.shape)
        return found[:, 0]

    def creep_through(self, targets: Any, end: float) -> tuple[np.ndarray, float | None]:
        """Return (times at which s grows to the targets under the present load, time at which no state follows).

        A target that is passed already has the present time, one that is not met nan; the second is None if s reaches
        `end`. There must be no s up to `end` at which the body stays.
        """
        from scipy.integrate import solve_ivp

        def rate(s, y):
            w = y[1:].reshape(self.w.shape)
            dt = self._time_per_s(s, w)
            return np.append(dt, self._strain_rate(s) - dt * self._relaxing(w).ravel())

        def fold(s, y):
            return self._time_per_s(s, y[1:].reshape(self.w.shape))

        fold.terminal = True                              # type: ignore[attr-defined]
        found = solve_ivp(rate, (self.s, end), np.append(self.time, self.w), method="DOP853", dense_output=True,
                          events=fold, max_step=0.01, **_TOLERANCES)
        met = [self.time if s <= self.s else found.sol(s)[0] if s <= found.t[-1] else np.nan for s in targets]
        return np.array(met), float(found.y_events[0][0][0]) if len(found.t_events[0]) else None

    def _load(self, s: float, w: np.ndarray) -> float:
        return float(self.weight(s)[0] @ self._difference(s, w))

    def _difference(self, s: float, w: np.ndarray) -> np.ndarray:
        """T, shape (n,)."""
        l2 = np.exp(2 * self.strain(s)[0][:, None] * self.direction)
        m = np.exp(2 * w)
        return 2 * self.c10 * (l2[:, 0] - l2[:, 2]) + (m[..., 0] - m[..., 2]) @ self.mu

    def _jumped(self, s: float) -> np.ndarray:
        return self.w + (self.strain(s)[0] - self.strain(self.s)[0])[:, None, None] * self.direction

    def _strain_rate(self, s: float) -> np.ndarray:
        """Return dw/ds without flow."""
        return np.broadcast_to(self.strain(s)[1][:, None, None] * self.direction, self.w.shape).ravel()

    def _flow(self, s: float, ds: float, w: np.ndarray) -> np.ndarray:
        """dw/dt."""
        return self._strain_rate(s) * ds - self._relaxing(w).ravel()

    def _relaxing(self, w: np.ndarray) -> np.ndarray:
        m = np.exp(2 * w)
        return (m - m.mean(axis=-1, keepdims=True)) / (2 * self.tau[:, None])

    def _time_per_s(self, s: float, w: np.ndarray) -> float:
        """Return dt/ds under a constant load."""
        (e, de), (c, dc), d = self.strain(s), self.weight(s), self.direction
        m, l2 = np.exp(2 * w), np.exp(2 * e[:, None] * self.direction)
        stiffness = 4 * self.c10 * (d[0] * l2[:, 0] - d[2] * l2[:, 2])
        stiffness += 2 * (d[0] * m[..., 0] - d[2] * m[..., 2]) @ self.mu
        lost = 2 * m * self._relaxing(w)
        lost = (lost[..., 0] - lost[..., 2]) @ self.mu
        return float((dc @ self._difference(s, w) + (c * de) @ stiffness) / (c @ lost))

    def _integrate(self, rate: Callable, start: np.ndarray, times: Any) -> np.ndarray:
        from scipy.integrate import solve_ivp
        found = solve_ivp(rate, (self.time, times[-1]), start, method="DOP853", t_eval=times, **_TOLERANCES)
        if not found.success:
            raise InputError(f"times = {times!r}: no solution beyond {found.t[-1] if len(found.t) else self.time:.6g}")
        self.time = float(times[-1])
        return found.y.T


def block(mode: str, *, c10: float, branches: Any) -> Body:
    """Return a block in a homogeneous test; s = ln l, its load is the nominal stress."""
    known("block: mode", mode, MODES)
    k = MODES[mode]
    return Body(c10, branches, np.array([1, k, -1 - k]), lambda s: (np.array([s]), np.ones(1)),
                lambda s: (np.array([math.exp(-s)]), np.array([-math.exp(-s)])))


def wall(kind: str, *, inner_radius: float, outer_radius: float, c10: float, branches: Any, points: int = 40) -> Body:
    """Return a thick "tube" or "sphere" under an inner pressure, its load; s = a^n - A^n, with a its inner radius."""
    known("wall: kind", kind, ("tube", "sphere"))
    A, B, n = positive("inner_radius", inner_radius), positive("outer_radius", outer_radius), 2 if kind == "tube" else 3
    if not A < B:
        raise InputError(f"outer_radius = {outer_radius!r}: must be above inner_radius = {inner_radius!r}")
    x, gauss = np.polynomial.legendre.leggauss(points)
    R, rn = (A + B + (B - A) * x) / 2, n - 1
    share = (B - A) / 2 * gauss * rn * R**rn
    hoop_third_radial = np.array([1, 0, -1.0]) if kind == "tube" else np.array([1, 1, -2.0])
    return Body(c10, branches, hoop_third_radial,
                lambda s: (np.log1p(s / R**n) / n, 1 / (n * (R**n + s))),
                lambda s: (share / (R**n + s), -share / (R**n + s) ** 2))


def balloon(*, c10: float, branches: Any) -> Body:
    """Return a thin spherical balloon; s = ln(r/R0), its load is p R0/H0."""
    return Body(c10, branches, np.array([1, 1, -2.0]), lambda s: (np.array([s]), np.ones(1)),
                lambda s: (np.array([2 * math.exp(-3 * s)]), np.array([-6 * math.exp(-3 * s)])))
