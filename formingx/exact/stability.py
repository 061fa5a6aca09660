"""Exact bifurcations of neo-Hookean bodies (shear modulus mu = 2 c10), for comparison with `Path.stability`.

Small motions v superposed on a finite deformation (Biot 1965; Haughton and Ogden 1979; Green and Adkins 1970): with
B = F F^T, sigma = mu B - p I and L = grad v, the change of nominal stress is

    S_ji = mu B_jk L_ik + p L_ji - q delta_ji,      div S = 0,  div v = 0,

and on a face under a fluid pressure P its traction is P L_ji N_j. A bifurcation is where three motions that meet the
conditions on one face leave a determinant of 0 on the other.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import iv, ivp, jn_zeros


def block(nu: float, kind: str) -> float:
    """Stretch at which a plane-strain block, length L0 = pi H0/nu, thickness 2 H0, between frictionless plates loses
    stability in one half wave along the load (Biot 1965).

    kind: "flexure" or "barrelling". With r = lambda^2: 4 r tanh(r k h) = (1 + r^2)^2 tanh(k h), or with coth for tanh.
    """
    def f(stretch):
        r, kh = stretch**2, nu / stretch**2
        a, b = np.tanh(nu), np.tanh(kh)
        return 4 * r * a - (1 + r**2) ** 2 * b if kind == "flexure" else 4 * r * b - (1 + r**2) ** 2 * a
    return _last_root(f, 0.3)


def cylinder(nu: float, n: int) -> float:
    """Axial stretch at which a solid cylinder, length H0 = pi R0/nu, between frictionless plates loses stability in one
    half wave cos(pi z/H) along it and cos(n theta) round it.

    With L = lambda^-1 (d2/dr2 + ...) + lambda^2 d2/dz2: L v = grad q/mu, so v is a gradient (of I_n(k r)), or L v = 0
    (I_n(k lambda^(3/2) r): curls of two potentials along the axis).

    >>> from formingx.exact.stability import cylinder
    >>> round(cylinder(1.0, 1), 4)
    0.7517
    """
    def f(stretch):
        a, k = stretch**-0.5, nu / stretch                           # radius and wave number now, R0 = 1
        B = (1 / stretch, 1 / stretch, stretch**2)
        p = B[0]                                                     # no traction on the side
        q = k * stretch**1.5
        columns = []
        I, J = iv(n, k * a), iv(n, q * a)
        dI, dJ = k * ivp(n, k * a), q * ivp(n, q * a)
        ddI, ddJ = k**2 * ivp(n, k * a, 2), q**2 * ivp(n, q * a, 2)
        # (U, U', V, V', W, W', pressure) of: the gradient; curl of psi e_z; curl of curl of chi e_z
        gradient = dI, ddI, -n * I / a, -n * dI / a + n * I / a**2, -k * I, -k * dI, (B[0] - B[2]) * k**2 * I
        turn = (n * J / a, n * dJ / a - n * J / a**2, -dJ, -ddJ, 0.0, 0.0, 0.0)
        bulge = (k * dJ, k * ddJ, -k * n * J / a, -k * n * dJ / a + k * n * J / a**2, -(q**2) * J, -(q**2) * dJ, 0.0)
        for U, dU, V, dV, _, dW, pressure in (gradient, turn, bulge):
            columns.append([(B[0] + p) * dU - pressure, B[0] * dV - p * (n * U + V) / a, B[0] * dW - p * k * U])
        M = np.array(columns).T
        M = M / np.abs(M).max(0)
        if n == 0:                                                   # torsion apart
            return np.linalg.det(M[np.ix_([0, 2], [0, 2])])
        return np.linalg.det(M)
    return _last_root(f, 0.3)


def tube(ratio: float, n: int) -> tuple[float, float]:
    """(pressure over mu, inner radius ratio) at which a tube of inner over outer radius `ratio` under an outer fluid
    pressure, its axial stretch held at 1, buckles in n waves round it."""
    def f(inner):
        return _determinant(ratio, inner, n, 0.0, outside=True)
    inner = _last_root(f, 0.4)
    return _pressure(ratio, inner, 1.0), inner


def inflated_tube(ratio: float, kB: float, n: int) -> float:
    """Inner radius ratio at which a tube inflated at its length pi B/kB (B: outer radius, `ratio`: inner over it), the
    ends frictionless, bulges (n = 0) or bends (n = 1) in one half wave along it: the first one."""
    def f(inner):
        return _determinant(ratio, inner, n, kB, outside=False)
    grid = 1 + np.geomspace(1e-3, 4.0, 60)
    before = f(grid[0])
    for a, b in zip(grid, grid[1:]):
        now = f(b)
        if before * now < 0:
            return float(brentq(f, a, b, xtol=1e-13))
        before = now
    return float("nan")


def clamped_plate(n: int) -> float:
    """N a^2/D at which a thin clamped disc under equal radial compression buckles in n waves round it.

    >>> from formingx.exact.stability import clamped_plate
    >>> round(clamped_plate(0), 2)
    14.68
    """
    return float(jn_zeros(n + 1, 1)[0] ** 2)


def _last_root(f: Callable[[float], float], low: float) -> float:
    """Return the root below 1 that is nearest to 1, or nan."""
    grid = 1 - np.geomspace(1e-5, 1 - low, 80)
    before = f(grid[0])
    for a, b in zip(grid, grid[1:]):
        now = f(b)
        if before * now < 0:
            return float(brentq(f, b, a, xtol=1e-14))
        before = now
    return float("nan")


def _pressure(ratio: float, inner: float, stretch: float) -> float:
    """Pressure outside less that inside, over mu, of a tube of outer radius 1."""
    at, weights = np.polynomial.legendre.leggauss(60)
    R, w = ratio + (1 - ratio) * (at + 1) / 2, weights * (1 - ratio) / 2
    r = np.sqrt((inner * ratio) ** 2 + (R**2 - ratio**2) / stretch)
    b_r, b_h = (R / (r * stretch)) ** 2, (r / R) ** 2
    return float(-np.sum(w * (b_h - b_r) * R / (r**2 * stretch)))    # r sigma_r' = sigma_hoop - sigma_r


def _determinant(ratio: float, inner: float, n: int, k: float, outside: bool) -> float:
    """Return the determinant of the outer face's conditions for three motions that meet the inner face's conditions."""
    A, a = ratio, inner * ratio
    b = np.sqrt(a**2 + 1 - A**2)
    delta = _pressure(ratio, inner, 1.0)                             # outside less inside
    P_in, P_out = (0.0, delta) if outside else (-delta, 0.0)

    def state(r):
        R = np.sqrt(A**2 + r**2 - a**2)
        return (R / r) ** 2, (r / R) ** 2

    def rates(r, y):
        y, p = y[:-1].reshape(-1, 6), y[-1]
        br, bh = state(r)
        R2 = A**2 + r**2 - a**2
        dbr = 2 * r / r**2 - 2 * R2 / r**3                           # of (R/r)^2
        U, V, W, rr, rh, rz = y.T
        hoop = (n * V + U) / r
        dU = -hoop - k * W
        dV = (rh + p * (n * U + V) / r) / br
        dW = (rz + p * k * U) / br
        q = (br + p) * dU - rr
        hr, hh, hz = -bh * (n * U + V) / r + p * dV, (bh + p) * hoop - q, -bh * n * W / r - p * k * V
        zr, zh, zz = -k * U + p * dW, -k * V - p * n * W / r, (1 + p) * k * W - q
        found = [dU, dV, dW, -(rr - hh) / r - n * hr / r - k * zr, -(rh + hr) / r + n * hh / r - k * zh,
                 -rz / r - n * hz / r + k * zz]
        return np.append(np.array(found).T.ravel(), dbr - (bh - br) / r)

    def free(r, P):
        """Rows that are 0 on a face under a pressure, of (U, V, W, rr, rh, rz); U' from div v = 0."""
        return np.array([[P / r, P * n / r, P * k, 1, 0, 0], [P * n / r, P / r, 0, 0, 1, 0], [P * k, 0, 0, 0, 0, 1]])
    start = np.hstack([np.eye(3), -free(a, P_in)[:, :3].T])         # tractions that follow from U, V, W
    p0 = state(a)[0] + P_in
    done = solve_ivp(rates, (a, b), np.append(start.ravel(), p0), method="DOP853", rtol=1e-10, atol=1e-11)
    y = done.y[:-1, -1].reshape(3, 6)
    M = free(b, P_out) @ y.T
    if n == 0:                                                       # torsion apart
        M = M[np.ix_([0, 2], [0, 2])]
    elif k == 0:                                                     # motion along the tube apart
        M = M[np.ix_([0, 1], [0, 1])]
    return float(np.linalg.det(M))
