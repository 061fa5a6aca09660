r"""Exact bifurcations of neo-Hookean bodies, for comparison with `Path.stability`.

Small motions v are superposed on a finite deformation (Biot 1965; Green and Adkins 1970; Haughton and Ogden 1979). With
the shear modulus mu = 2 c10, the increment of the nominal stress S and incremental equilibrium are:

.. math:: B = F F^T, \qquad \sigma = \mu B - p I, \qquad L = \nabla v

.. math:: \dot{S}_{ji} = \mu B_{jk} L_{ik} + p L_{ji} - q \, \delta_{ji}, \qquad
          \nabla \cdot \dot{S} = 0, \qquad \nabla \cdot v = 0

On a face with the normal N under a fluid pressure P, the increment of the traction is:

.. math:: \dot{t}_i = P L_{ji} N_j

Three independent motions satisfy the conditions on one face. A bifurcation occurs where the determinant of their
conditions on the other face vanishes.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import iv, ivp, jn_zeros


def block(nu: float, kind: str) -> float:
    r"""Return the stretch at which a compressed block in plane strain buckles in one half wave along the load.

    The block is neo-Hookean and lies between frictionless plates. Let lambda be the stretch along the load, h half
    of the deformed thickness and k = pi over the deformed length. For flexure and for barrelling (Biot 1965):

    .. math:: 4 r \tanh(r k h) = (1 + r^2)^2 \tanh(k h), \qquad 4 r \coth(r k h) = (1 + r^2)^2 \coth(k h), \qquad
              r = \lambda^2

    Args:
        nu: slenderness pi H0/L0, with the reference length L0 along the load and the reference thickness 2 H0.
        kind: "flexure" or "barrelling".

    Returns:
        The first such stretch below 1; nan if the block is stable down to a stretch of 0.3.
    """
    def f(stretch):
        r, kh = stretch**2, nu / stretch**2
        a, b = np.tanh(nu), np.tanh(kh)
        return 4 * r * a - (1 + r**2) ** 2 * b if kind == "flexure" else 4 * r * b - (1 + r**2) ** 2 * a
    return _last_root(f, 0.3)


def cylinder(nu: float, n: int) -> float:
    r"""Return the axial stretch at which a compressed solid cylinder buckles in one half wave along its axis.

    The neo-Hookean cylinder of the deformed length H lies between frictionless plates. Its mode varies as
    cos(pi z/H) cos(n theta), with the height z and the angle theta. Let v be the displacement of the mode, q its
    pressure, mu the shear modulus, lambda the axial stretch and k = pi/H. Incremental equilibrium is

    .. math:: \mathcal{L} v = \frac{\nabla q}{\mu}, \qquad
              \mathcal{L} = \lambda^{-1} \left(\nabla^2 - \frac{\partial^2}{\partial z^2}\right)
              + \lambda^2 \frac{\partial^2}{\partial z^2}

    Three motions satisfy it, with the modified Bessel function I_n. The first is the gradient of I_n(k r). The others
    are the curl, and the curl of the curl, of axial potentials I_n(k lambda^(3/2) r); for these q is 0. The determinant
    of their tractions on the cylindrical face vanishes at the returned stretch.

    Args:
        nu: slenderness pi R0/H0, with the reference radius R0 and the reference length H0.
        n: number of waves round the axis.

    Returns:
        The first such stretch below 1; nan if the cylinder is stable down to a stretch of 0.3.

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
        if n == 0:                                                   # without torsion
            return np.linalg.det(M[np.ix_([0, 2], [0, 2])])
        return np.linalg.det(M)
    return _last_root(f, 0.3)


def tube(ratio: float, n: int) -> tuple[float, float]:
    r"""Return the state at which a neo-Hookean tube of constant length buckles under an outer fluid pressure.

    The mode is constant along the axis. With the inner and outer reference radii A and B and the shear modulus mu the
    pressure is

    .. math:: \frac{P}{\mu} = -\int_A^B \left(\frac{r^2}{R^2} - \frac{R^2}{r^2}\right) \frac{R \, dR}{r^2}, \qquad
              r^2 = R^2 + a^2 - A^2

    Args:
        ratio: inner over outer reference radius, A/B.
        n: number of waves round the axis, 2 or larger.

    Returns:
        P over mu, and the deformed over the reference inner radius, a/A; nan if the tube is stable down to a/A = 0.4.
    """
    def f(inner):
        return _determinant(ratio, inner, n, 0.0, outside=True)
    inner = _last_root(f, 0.4)
    return _pressure(ratio, inner, 1.0), inner


def inflated_tube(ratio: float, kB: float, n: int) -> float:
    """Return the first inner stretch at which an inflated tube bulges or bends in one half wave along its axis.

    The tube is neo-Hookean. Its ends are frictionless and its length is constant. The radial displacement of the mode
    varies as cos(n theta) cos(pi z/length).

    Args:
        ratio: inner over outer reference radius.
        kB: pi B over the length, with the outer reference radius B.
        n: number of waves round the axis, 0 for bulging, 1 for bending.

    Returns:
        Deformed over reference inner radius; nan if the tube is stable up to a value of 5.
    """
    def f(inner):
        return _determinant(ratio, inner, n, kB, outside=False)
    grid = 1 + np.geomspace(1e-3, 4.0, 60)
    last = f(grid[0])
    for a, b in zip(grid, grid[1:]):
        value = f(b)
        if last * value < 0:
            return float(brentq(f, a, b, xtol=1e-13))
        last = value
    return float("nan")


def clamped_plate(n: int) -> float:
    r"""Return the dimensionless buckling load N a^2/D of a thin clamped disc under radial compression.

    .. math:: \frac{N a^2}{D} = j_{n+1,1}^2

    N is the compressive force per length of the edge, a the radius and D the bending stiffness of the disc. j_(n+1,1)
    is the first positive zero of the Bessel function J_(n+1). For n = 0 see Timoshenko and Gere, Theory of Elastic
    Stability, 1961.

    Args:
        n: number of waves round the axis, 0 or larger.

    Returns:
        N a^2/D.

    >>> from formingx.exact.stability import clamped_plate
    >>> round(clamped_plate(0), 2)
    14.68
    """
    return float(jn_zeros(n + 1, 1)[0] ** 2)


def _last_root(f: Callable[[float], float], low: float) -> float:
    """Return the root of f nearest to 1 between `low` and 1; nan if f has none."""
    grid = 1 - np.geomspace(1e-5, 1 - low, 80)
    last = f(grid[0])
    for a, b in zip(grid, grid[1:]):
        value = f(b)
        if last * value < 0:
            return float(brentq(f, b, a, xtol=1e-14))
        last = value
    return float("nan")


def _pressure(ratio: float, inner: float, stretch: float) -> float:
    r"""Return the outer minus the inner pressure of a tube, over its shear modulus.

    .. math:: \frac{P_B - P_A}{\mu} = -\int_A^B (b_\theta - b_r) \frac{R \, dR}{\lambda r^2}, \qquad
              b_\theta = \frac{r^2}{R^2}, \qquad b_r = \frac{R^2}{\lambda^2 r^2}

    P_A and P_B are the pressures on the inner and outer face with the reference radii A and B. At the reference radius
    R the deformed radius is r, and b_theta and b_r are squared stretches. mu is the shear modulus. `inner` is the
    deformed over the reference inner radius.
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)
    R, w = ratio + (1 - ratio) * (nodes + 1) / 2, weights * (1 - ratio) / 2
    r = np.sqrt((inner * ratio) ** 2 + (R**2 - ratio**2) / stretch)
    b_r, b_h = (R / (r * stretch)) ** 2, (r / R) ** 2
    return float(-np.sum(w * (b_h - b_r) * R / (r**2 * stretch)))    # r sigma_r' = sigma_hoop - sigma_r


def _determinant(ratio: float, inner: float, n: int, k: float, outside: bool) -> float:
    r"""Return the determinant that vanishes where a neo-Hookean tube under pressure bifurcates; the axial stretch is 1.

    .. math:: v_r = U \cos n\theta \cos k z, \; v_\theta = V \sin n\theta \cos k z, \; v_z = W \cos n\theta \sin k z

    Three motions v with amplitudes U, V, W, functions of r, satisfy incremental equilibrium and the boundary conditions
    on the inner face. Each motion has three errors in the boundary conditions on the outer face, along r, theta and z.
    The errors form the determinant: a row for each condition, a column for each motion. `inner` is the deformed over
    the reference inner radius; k is multiplied by the outer reference radius. `outside` is the side of the fluid.
    """
    A, a = ratio, inner * ratio
    b = np.sqrt(a**2 + 1 - A**2)
    delta = _pressure(ratio, inner, 1.0)                             # outer less inner pressure
    P_in, P_out = (0.0, delta) if outside else (-delta, 0.0)

    def state(r):
        R = np.sqrt(A**2 + r**2 - a**2)
        return (R / r) ** 2, (r / R) ** 2

    def rates(r, y):
        y, p = y[:-1].reshape(-1, 6), y[-1]
        br, bh = state(r)
        R2 = A**2 + r**2 - a**2
        dbr = 2 * r / r**2 - 2 * R2 / r**3                           # derivative of (R/r)^2
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
        """Return rows (3, 6) of conditions at radius r under pressure P, for (U, V, W, rr, rh, rz)."""
        return np.array([[P / r, P * n / r, P * k, 1, 0, 0], [P * n / r, P / r, 0, 0, 1, 0], [P * k, 0, 0, 0, 0, 1]])
    start = np.hstack([np.eye(3), -free(a, P_in)[:, :3].T])         # tractions that follow from U, V, W
    p0 = state(a)[0] + P_in
    solution = solve_ivp(rates, (a, b), np.append(start.ravel(), p0), method="DOP853", rtol=1e-10, atol=1e-11)
    y = solution.y[:-1, -1].reshape(3, 6)
    M = free(b, P_out) @ y.T
    if n == 0:                                                       # without torsion
        M = M[np.ix_([0, 2], [0, 2])]
    elif k == 0:                                                     # without axial motion
        M = M[np.ix_([0, 1], [0, 1])]
    return float(np.linalg.det(M))
