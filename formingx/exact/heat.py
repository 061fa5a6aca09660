r"""One-dimensional heat conduction through a slab, solved without finite elements, for comparison.

.. math:: \rho c \, \frac{\partial T}{\partial t} = k \frac{\partial^2 T}{\partial x^2} + q(x)

`series`: eigenfunctions of a slab with convection at both faces, about the steady state (Carslaw and Jaeger, Conduction
of Heat in Solids, 1959, section 3.11). `sheet_on_tool`: a sheet in contact with a tool, by Laplace transform and
Talbot's inversion (Abate and Valko, Int. J. Numer. Methods Eng. 60 (2004) 979-993). `method_of_lines`: finite volumes
and a stiff solver, for faces that radiate.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Slab:
    """Slab from x = 0 to `thickness`, with heat conduction along x.

    Attributes:
        thickness: thickness d, length.
        conductivity: thermal conductivity k, power/(length temperature).
        capacity: heat capacity per volume, rho c, energy/(length^3 temperature).
    """

    thickness: float
    conductivity: float
    capacity: float

    @property
    def diffusivity(self) -> float:
        """Thermal diffusivity alpha = k / (rho c), length^2/time."""
        return self.conductivity / self.capacity


def series(slab: Slab, start: float, h: tuple[float, float], air: tuple[float, float], x: Any, times: Any,
           source: Callable | None = None, terms: int = 200) -> np.ndarray:
    r"""Return the temperatures of a slab with convection at both faces, as a sum over its modes.

    .. math::
        k T'(0) = h_0 (T(0) - T_{air,0}), \qquad -k T'(d) = h_1 (T(d) - T_{air,1})

    T_s is the steady temperature, d the thickness, k the conductivity and alpha the diffusivity of the slab. b_0 and
    b_1 are the Biot numbers of the faces. The amplitudes A_m give the initial temperature:

    .. math::
        T(x, t) = T_s(x) + \sum_m A_m \, \phi_m(x/d) \, e^{-m^2 \alpha t/d^2}, \quad
        \phi_m(s) = \cos m s + \frac{b_0}{m} \sin m s, \quad
        \tan m = \frac{m (b_0 + b_1)}{m^2 - b_0 b_1}, \quad b_i = \frac{h_i d}{k}

    (Carslaw and Jaeger 1959, section 3.11.) At least one h must be above 0, so that all modes decay.

    Args:
        slab: the slab.
        start: uniform initial temperature.
        h: heat transfer coefficients of the faces x = 0 and x = d, power/(length^2 temperature).
        air: temperatures of the air at the two faces.
        x: positions, shape (n,), length.
        times: times, shape (k,).
        source: heat source per volume, power/length^3, a function of x, any shape; None: no source.
        terms: number of modes.

    Returns:
        Temperatures at the times and positions, shape (k, n).

    >>> from formingx.exact.heat import Slab, series
    >>> sheet = Slab(thickness=2.0, conductivity=0.2, capacity=2.0)
    >>> series(sheet, 180.0, (0.0, 0.01), (0.0, 20.0), [0.0, 2.0], [10.0]).round(3).tolist()
    [[178.436, 171.328]]
    """
    from scipy.optimize import brentq
    d, k = slab.thickness, slab.conductivity
    b0, b1 = h[0] * d / k, h[1] * d / k
    # tan(m) = m (b0 + b1)/(m^2 - b0 b1), one root in each interval of length pi
    roots = np.array([brentq(lambda m: (m * m - b0 * b1) * np.sin(m) - m * (b0 + b1) * np.cos(m),
                             n * np.pi + 1e-9, (n + 1) * np.pi - 1e-12, xtol=1e-14) for n in range(terms)])
    nodes, weights = np.polynomial.legendre.leggauss(4 * terms)                # on (-1, 1)
    s = (nodes + 1) / 2

    def mode_shapes(s):
        m = roots[:, None]
        return np.cos(m * s) + b0 / m * np.sin(m * s)

    steady = _steady(slab, h, air, source)
    modes = mode_shapes(s)
    amplitudes = (modes @ (weights * (start - steady(d * s)))) / (modes**2 @ weights)
    x, times = np.asarray(x, dtype=float), np.asarray(times, dtype=float)
    decay = np.exp(-np.outer(times, roots**2) * slab.diffusivity / d**2)
    return steady(x) + (decay * amplitudes) @ mode_shapes(x / d)


def _steady(slab: Slab, h: tuple, air: tuple, source: Callable | None) -> Callable:
    r"""Return the steady temperature T_s(x) of a slab with a source q(x) and convection at both faces.

    .. math:: -k T_s'' = q, \qquad k T_s'(0) = h_0 (T_s(0) - T_{air,0}), \qquad -k T_s'(d) = h_1 (T_s(d) - T_{air,1})
    """
    d, k = slab.thickness, slab.conductivity
    nodes, weights = np.polynomial.legendre.leggauss(60)

    def integrated(x):                                           # -source/k, integrated from 0 twice and once
        if source is None:
            return 0.0 * x, 0.0 * x
        y = x[..., None] * (nodes + 1) / 2
        S = source(y) * weights * x[..., None] / 2
        return -((x[..., None] - y) * S).sum(-1) / k, -S.sum(-1) / k
    P, dP = (float(v) for v in integrated(np.array(d)))
    # T = a + b x + P(x): k b = h0 (a - air0); -k (b + dP(d)) = h1 (a + b d + P(d) - air1)
    a, b = np.linalg.solve([[-h[0], k], [h[1], k + h[1] * d]], [-h[0] * air[0], h[1] * (air[1] - P) - k * dP])
    return lambda x: a + b * np.asarray(x) + integrated(np.asarray(x, dtype=float))[0]


def sheet_on_tool(sheet: Slab, tool: Slab, conductance: float, start: float, tool_start: float, h: float, air: float,
            x: Any, depths: Any, times: Any) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the temperatures of a sheet and of the tool on which it is laid at t = 0.

    Let x be the distance into the sheet and y the distance into the tool, both from the touching faces. The
    temperatures T of the sheet and T_w of the tool satisfy

    .. math::
        k T'(0) = -k_w T_w'(0) = c \, (T(0) - T_w(0)), \qquad -k T'(d) = h (T(d) - T_{air}), \qquad T_w(d_w) = T_{w,0}

    with the conductivities k, k_w, the thicknesses d, d_w and the contact conductance c. The back of the tool keeps its
    initial temperature. The Laplace transforms of both temperatures are inverted numerically.

    Args:
        sheet: the sheet.
        tool: the tool.
        conductance: thermal contact conductance, power/(length^2 temperature).
        start: initial temperature of the sheet.
        tool_start: initial temperature of the tool.
        h: heat transfer coefficient of the free face, power/(length^2 temperature).
        air: temperature of the air.
        x: distances x into the sheet from the touching face, shape (n,), length.
        depths: distances y into the tool from the touching face, shape (m,), length.
        times: times above 0, shape (k,).

    Returns:
        Temperatures of the sheet, shape (k, n), and of the tool, shape (k, m).
    """
    x, depths = (np.asarray(v, dtype=float) for v in (x, depths))

    def transformed(s):
        p, q = (np.sqrt(s / slab.diffusivity) for slab in (sheet, tool))
        kp, kq = sheet.conductivity * p, tool.conductivity * q
        e_sheet, e_tool = np.exp(-p * sheet.thickness), np.exp(-q * tool.thickness)
        # sheet: start/s + A exp(-p x) + B exp(-p (d - x)); tool: tool_start/s + C exp(-q y) + D exp(-q (L - y))
        matrix = np.array([[kp + conductance, (conductance - kp) * e_sheet, -conductance, -conductance * e_tool],
                           [(h - kp) * e_sheet, kp + h, 0, 0],
                           [-conductance, -conductance * e_sheet, kq + conductance, (conductance - kq) * e_tool],
                           [0, 0, e_tool, 1]])
        gap = conductance * (tool_start - start) / s
        A, B, C, D = np.linalg.solve(matrix, [gap, h * (air - start) / s, -gap, 0])
        return np.concatenate([start / s + A * np.exp(-p * x) + B * np.exp(-p * (sheet.thickness - x)),
                               tool_start / s + C * np.exp(-q * depths) + D * np.exp(-q * (tool.thickness - depths))])
    values = np.array([_talbot(transformed, t) for t in times])
    return values[:, : len(x)], values[:, len(x):]


def _talbot(transformed: Callable, t: float, n: int = 20) -> np.ndarray:
    r"""Return m inverse Laplace transforms at a time t > 0, shape (m,), by the fixed Talbot method with n points.

    .. math:: f(t) = \frac{r}{n} \left[\frac{1}{2} e^{r t} \hat f(r) + \sum_{k=1}^{n-1} \Re (w_k \hat f(s_k))\right]

    .. math:: s_k = r \theta_k (\cot\theta_k + i), \quad w_k = e^{s_k t} (1 + i \sigma_k), \quad r = \frac{2 n}{5 t}

    .. math:: \sigma_k = \theta_k + (\theta_k \cot\theta_k - 1) \cot\theta_k, \quad \theta_k = \frac{k \pi}{n}

    (Abate and Valko 2004.) `transformed` is a function of a complex number s that returns the m transforms.
    """
    theta = np.arange(1, n) * np.pi / n
    r = 2 * n / (5 * t)
    cot = 1 / np.tan(theta)
    points = r * theta * (cot + 1j)
    weights = np.exp(points * t) * (1 + 1j * theta * (1 + cot**2) - 1j * cot)
    total = 0.5 * np.exp(r * t) * transformed(complex(r)).real
    return r / n * (total + sum((w * transformed(s)).real for s, w in zip(points, weights)))


def method_of_lines(slab: Slab, start: float, fluxes: tuple[Callable, Callable], times: Any, cells: int = 400,
          source: Callable | None = None) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the temperatures of a slab with given heat fluxes at its faces, by the method of lines.

    .. math:: \rho c \, \dot T = k T'' + q, \qquad -k T'(0) = f_0(T(0)), \qquad k T'(d) = f_1(T(d))

    Finite volumes of equal size divide the slab. Their error is proportional to the square of this size. Richardson's
    extrapolation from two sizes removes it.

    Args:
        slab: the slab.
        start: uniform initial temperature.
        fluxes: heat fluxes f_0 and f_1 into the faces x = 0 and x = d, power/length^2, functions of the temperature of
            the face.
        times: times in ascending order, shape (k,).
        cells: number of intervals between nodes of the finer division, even.
        source: heat source q per volume, power/length^3, a function of x, shape (n,); None: no source.

    Returns:
        Positions x of the n = cells/2 + 1 nodes, shape (n,), length, and temperatures, shape (k, n).
    """
    coarse, fine = (_finite_volumes(slab, start, fluxes, times, n, source) for n in (cells // 2, cells))
    x = np.linspace(0, slab.thickness, cells // 2 + 1)
    return x, (4 * fine[:, ::2] - coarse) / 3


def _finite_volumes(slab: Slab, start: float, fluxes: tuple, times: Any, cells: int,
                    source: Callable | None) -> np.ndarray:
    """Return the temperatures at the nodes of a slab at k times, by finite volumes, shape (k, cells + 1).

    Two functions of the face temperature give the fluxes into the faces, power/length^2; the source, power/length^3, is
    one of position. Times ascend, (k,).
    """
    from scipy.integrate import solve_ivp
    from scipy.sparse import diags
    n, dx = cells + 1, slab.thickness / cells
    heated = np.zeros(n) if source is None else source(np.linspace(0, slab.thickness, n))
    width = np.full(n, dx)
    width[[0, -1]] /= 2

    def rate(_, T):
        flux = -slab.conductivity * np.diff(T) / dx
        inflow = np.concatenate([[fluxes[0](T[0])], flux]) - np.concatenate([flux, [-fluxes[1](T[-1])]])
        return (inflow + heated * width) / (slab.capacity * width)
    pattern = diags([1.0, 1.0, 1.0], [-1, 0, 1], shape=(n, n))
    solved = solve_ivp(rate, (0, max(times)), np.full(n, start), "Radau", t_eval=times, rtol=1e-9, atol=1e-9,
                       jac_sparsity=pattern)
    return solved.y.T
