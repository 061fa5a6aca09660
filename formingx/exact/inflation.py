"""Exact solutions for comparison: the inflated circular membrane, the thick tube and the thick sphere.

**Membrane** (Adkins and Rivlin, Phil. Trans. R. Soc. A 244 (1952) 505-531): the equations of `membrane_inflation` are
integrated from the pole until the circumferential stretch is 1. Only the product p R enters, so this point is the rim
for some radius, and scaling gives the result for the required one. If c10 varies with R, the secant method finds the
pressure instead, such that the circumferential stretch is 1 at the rim.

**Thick wall** (Green and Adkins, Large Elastic Deformations, 1970; Mooney material): equilibrium is integrated in
closed form from the free outer face (`thick_wall`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, check_name, non_negative, positive


@dataclass(frozen=True)
class MembraneState:
    """Membrane inflated to a given pole stretch, at n points from the pole to the rim, in the units of the input.

    Attributes:
        pressure: pressure, stress.
        height: height of the pole above the rim, length.
        R: reference radii, shape (n,), length.
        r: deformed radii, shape (n,), length.
        z: deformed heights above the rim, shape (n,), length.
        thickness_ratio: deformed over reference thickness, shape (n,).
    """

    pressure: float
    height: float
    R: np.ndarray
    r: np.ndarray
    z: np.ndarray
    thickness_ratio: np.ndarray


def membrane_inflation(pole_stretch: float, *, radius: float, thickness: float,
                       c10: float | Callable[[float], float], c01: float = 0.0) -> MembraneState:
    r"""Return a flat circular membrane with a fixed rim, inflated to a given stretch at its pole.

    Equilibrium of the meridian under the pressure p, with its slope theta, arc length s and deformed radius r (Adkins
    and Rivlin 1952):

    .. math:: \frac{d(T_1 r)}{dr} = T_2, \qquad T_1 \frac{d\theta}{ds} + T_2 \frac{\sin\theta}{r} = p

    T_1 and T_2 are the meridional and circumferential tensions per deformed length. With the reference thickness h0 and
    the stretches lambda_1 (meridional), lambda_2 = r/R and lambda_3 = 1/(lambda_1 lambda_2) they are

    .. math:: T_1 = 2 h_0 \lambda_3 (\lambda_1^2 - \lambda_3^2)(c_{10} + c_{01} \lambda_2^2), \qquad
              T_2 = 2 h_0 \lambda_3 (\lambda_2^2 - \lambda_3^2)(c_{10} + c_{01} \lambda_1^2)

    Args:
        pole_stretch: stretch at the pole, above 1.
        radius: reference radius, length.
        thickness: reference thickness, length.
        c10: constant of I1, stress; a number, or a smooth function of the reference radius R, length.
        c01: constant of I2, stress.

    Returns:
        The inflated membrane.

    Raises:
        InputError: a size or constant is not allowed, or no pressure gives this stretch.

    >>> from formingx.exact.inflation import membrane_inflation
    >>> state = membrane_inflation(2.0, radius=1.25, thickness=0.082, c10=2.0)
    >>> round(float(state.pressure), 4), round(float(state.height), 4)
    (0.4906, 1.3538)
    """
    from scipy.integrate import solve_ivp
    radius, thickness = positive("radius", radius), positive("thickness", thickness)
    c01 = non_negative("c01", c01)
    if not positive("pole_stretch", pole_stretch) > 1:
        raise InputError(f"pole_stretch = {pole_stretch!r}: must be above 1")
    if callable(c10):
        return _varying_membrane(pole_stretch, radius, thickness, c10, c01)
    k = c01 / positive("c10", c10)

    def derivatives(R, y):                         # lengths over c10 h0/p, tensions over c10 h0: pressure is 1
        l1, r, _, theta = y.tolist()          # floats: several times faster here than NumPy's scalars
        l2 = r / R
        l3 = 1 / (l1 * l2)
        a1, a2 = 1 + k * l2**2, 1 + k * l1**2
        T1, T2 = 2 * l3 * (l1**2 - l3**2) * a1, 2 * l3 * (l2**2 - l3**2) * a2
        dr = l1 * math.cos(theta)
        T1_1 = 2 / l2 * (1 + 3 / (l1**4 * l2**2)) * a1
        T1_2 = 2 * (-l1 / l2**2 + 3 / (l1**3 * l2**4)) * a1 + 4 * k * l2 * l3 * (l1**2 - l3**2)
        dl1 = ((T2 - T1) * dr / r - T1_2 * (dr - l2) / R) / T1_1
        return [dl1, dr, -l1 * math.sin(theta), l1 * (1 - T2 * math.sin(theta) / r) / T1]

    def rim(R, y):
        return y[1] / R - 1

    rim.terminal, rim.direction = True, -1          # type: ignore[attr-defined]
    start, l3 = 1e-6, pole_stretch**-2        # a spherical cap at the pole: curvature 1/(2 T)
    T = 2 * l3 * (pole_stretch**2 - l3**2) * (1 + k * pole_stretch**2)
    r0 = pole_stretch * start
    solution = solve_ivp(derivatives, (start, 1e3), [pole_stretch, r0, 0.0, r0 / (2 * T)], events=rim, rtol=1e-10,
                         atol=1e-12, method="DOP853", dense_output=True, max_step=0.5)
    end = solution.t_events[0][0]
    R = np.linspace(start, end, 400)
    l1, r, z, _ = solution.sol(R)
    scale = radius / end
    return MembraneState(end * c10 * thickness / radius, -z[-1] * scale, R * scale, r * scale, (z - z[-1]) * scale,
                         R / (l1 * r))


def _varying_membrane(pole_stretch: float, radius: float, thickness: float, c10: Callable[[float], float],
                      c01: float) -> MembraneState:
    r"""Return a flat circular membrane with a fixed rim, inflated to a given stretch at its pole, if c10 varies with R.

    .. math:: R N_1 \sin\theta = \frac{p r^2}{2}, \qquad \frac{d(R N_1 \cos\theta)}{dR} = N_2 - p r \lambda_1 \sin\theta

    N_1 and N_2 are the meridional and circumferential tensions per reference length, p the pressure, theta the slope of
    the meridian and lambda_1 its stretch. R and r are the reference and deformed radius. The pole stretch increases in
    steps. The secant method finds the pressure of each step, for which the circumferential stretch is 1 at the rim.
    Lengths are in the reference configuration, c10 is a function of R, and both constants are stresses. A search
    without pressure raises an InputError.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import root_scalar
    unit = positive("c10 at R = 0", float(c10(0.0)))       # lengths over radius, tensions over 2 c10(0) h0

    def derivatives(s, y, p):
        r, _, H = map(float, y)
        V, a, k = p * r**2 / 2, float(c10(radius * s)) / unit, c01 / unit
        sN, l2 = math.hypot(H, V), r / s
        l1 = meridional_stretch(sN / s / (a + k * l2**2), l2)
        N2 = (l2 - l2**-3 * l1**-2) * (a + k * l1**2)
        return [l1 * H / sN, -l1 * V / sN, N2 - p * r * l1 * V / sN]

    def integrate(p, stretch):
        start = 1e-4                                       # a flat pole: errors of start^2
        N = (stretch - stretch**-5) * (1 + c01 / unit * stretch**2)
        return solve_ivp(derivatives, (start, 1), [stretch * start, 0.0, start * N], args=(p,), rtol=1e-9, atol=1e-12,
                         method="DOP853", dense_output=True)

    stretches = np.geomspace(1.02, pole_stretch, max(2, int(np.ceil(np.log(pole_stretch) / 0.1))))
    p = membrane_inflation(1.02, radius=1, thickness=0.5, c10=1).pressure
    for stretch in stretches:
        found = root_scalar(lambda p, stretch=stretch: integrate(p, stretch).y[0, -1] - 1, x0=p, x1=1.02 * p,
                            rtol=1e-9 if stretch == stretches[-1] else 1e-3)
        if not found.converged:
            raise InputError(f"pole_stretch = {pole_stretch!r}: no pressure was found at a stretch of {stretch:.6g}")
        p = found.root
    s = np.linspace(1e-4, 1, 400)
    r, z, H = integrate(p, pole_stretch).sol(s)
    a, l2 = np.array([c10(radius * x) for x in s]) / unit, r / s
    N = np.hypot(H, p * r**2 / 2) / s / (a + c01 / unit * l2**2)
    l1 = meridional_stretch(N, l2)
    return MembraneState(2 * unit * thickness / radius * p, -z[-1] * radius, s * radius, r * radius,
                         (z - z[-1]) * radius, 1 / (l1 * l2))


def meridional_stretch(n: Any, l2: Any) -> Any:
    r"""Return the meridional stretch lambda_1 of a neo-Hookean membrane under a meridional tension, by Newton's method.

    .. math:: \lambda_1 - \lambda_1^{-3} \lambda_2^{-2} = n

    Args:
        n: meridional tension per reference length over 2 c10 h0 (h0: reference thickness), shape (k,) or a number.
        l2: circumferential stretch lambda_2, shape (k,) or a number.

    Returns:
        lambda_1, shape (k,) or a number.
    """
    l1 = n + l2**-0.5
    for _ in range(20):
        l1 = l1 - (l1 - l1**-3 * l2**-2 - n) / (1 + 3 * l1**-4 * l2**-2)
    return l1


def membrane_limit_point(*, radius: float, thickness: float, c10: float,
                         c01: float = 0.0) -> tuple[float, MembraneState] | None:
    """Return the first pressure maximum of an inflated circular membrane with a fixed rim.

    The pole stretch is varied from 1.2 to 12.

    Args:
        radius: reference radius, length.
        thickness: reference thickness, length.
        c10: constant of I1, stress.
        c01: constant of I2, stress.

    Returns:
        The pole stretch and the state at the maximum; None if the pressure has no maximum in this range.

    >>> from formingx.exact.inflation import membrane_limit_point
    >>> stretch, state = membrane_limit_point(radius=1.25, thickness=0.082, c10=2.0)
    >>> round(stretch, 3), round(float(state.pressure), 4)
    (2.196, 0.4931)
    """
    def state(stretch):
        return membrane_inflation(stretch, radius=radius, thickness=thickness, c10=c10, c01=c01)

    def pressures(stretches):
        return np.array([state(s).pressure for s in stretches])

    stretches, found = np.geomspace(1.2, 12, 40), []
    for stretch in stretches:
        found.append(state(stretch).pressure)
        if len(found) > 2 and found[-3] < found[-2] > found[-1]:
            break
    else:
        return None
    p = np.polynomial.Chebyshev.interpolate(pressures, 8, stretches[[len(found) - 3, len(found) - 1]])
    s = next(r.real for r in p.deriv().roots() if not r.imag and abs(p.mapparms()[0] + p.mapparms()[1] * r.real) <= 1
             and p.deriv(2)(r.real) < 0)
    return float(s), state(s)


@dataclass(frozen=True)
class ThickWallState:
    """Thick tube or sphere inflated to a given stretch of its inner face, at n points through the wall.

    Attributes:
        pressure: pressure on the inner face, stress; the outer face is free.
        R: reference radii of the points, shape (n,), length.
        r: deformed radii, shape (n,), length.
        radial: radial Cauchy stress, shape (n,), stress.
        hoop: hoop Cauchy stress, shape (n,), stress.
        third: axial Cauchy stress of a tube, second hoop stress of a sphere, shape (n,), stress.
    """

    pressure: float
    R: np.ndarray
    r: np.ndarray
    radial: np.ndarray
    hoop: np.ndarray
    third: np.ndarray

    @property
    def hydrostatic_pressure(self) -> np.ndarray:
        """Hydrostatic pressure: minus the mean of radial, hoop and third Cauchy stress, shape (n,), stress."""
        return -(self.radial + self.hoop + self.third) / 3

    def cauchy(self, direction: Any) -> np.ndarray:
        r"""Return the Cauchy stress tensors at the n points through the wall, in components r, z, hoop.

        .. math:: \sigma = \sigma_\mathrm{radial} \, n \otimes n + \sigma_\mathrm{third} \, t \otimes t
                  + \sigma_\mathrm{hoop} \, e_\theta \otimes e_\theta, \qquad t \perp n, e_\theta

        Args:
            direction: vector (r, z) along n of any length, which points outwards through the wall, shape (2,) or
                (n, 2); (1, 0) for a tube.

        Returns:
            Stress tensors, shape (n, 3, 3), stress.
        """
        radial = np.broadcast_to(np.asarray(direction, dtype=float), (len(self.R), 2))
        radial = radial / np.linalg.norm(radial, axis=1)[:, None]
        tangent = np.column_stack([-radial[:, 1], radial[:, 0]])
        sigma = np.zeros((len(self.R), 3, 3))
        sigma[:, 2, 2] = self.hoop
        for value, unit in ((self.radial, radial), (self.third, tangent)):
            sigma[:, :2, :2] += np.einsum("n,ni,nj->nij", value, unit, unit)
        return sigma


def thick_wall(kind: str, inner_stretch: float, *, inner_radius: float, outer_radius: float, c10: float,
               c01: float = 0.0, R: Any = None) -> ThickWallState:
    r"""Return the exact state of a thick tube (plane strain) or sphere with a given stretch of its inner face.

    With n = 2 for a tube and 3 for a sphere, the reference radius R, the deformed radius r and the deformed inner
    radius a (Green and Adkins 1970):

    .. math:: r^n = R^n + a^n - A^n, \qquad \lambda = r/R, \qquad \sigma_{rr} = g(\lambda_B) - g(\lambda), \qquad
              p = g(\lambda_A) - g(\lambda_B)

    .. math:: g_\mathrm{tube} = 2 (c_{10} + c_{01}) (\ln\lambda - \tfrac{1}{2} \lambda^{-2}), \qquad
              g_\mathrm{sphere} = -c_{10} (4 \lambda^{-1} + \lambda^{-4}) + c_{01} (4 \lambda - 2 \lambda^{-2})

    The hoop stresses of tube and sphere are

    .. math:: \sigma_{rr} + 2 (c_{10} + c_{01}) (\lambda^2 - \lambda^{-2}), \qquad
              \sigma_{rr} + 2 c_{10} (\lambda^2 - \lambda^{-4}) + 2 c_{01} (\lambda^4 - \lambda^{-2})

    Args:
        kind: "tube" or "sphere".
        inner_stretch: deformed over reference inner radius.
        inner_radius: reference inner radius A, length.
        outer_radius: reference outer radius B, length.
        c10: constant of I1, stress.
        c01: constant of I2, stress.
        R: reference radii R at which the stresses are evaluated, shape (n,), length; None: the two faces.

    Returns:
        Pressure on the inner face, and radii and Cauchy stresses at the points R.

    Raises:
        InputError: a size or constant is not allowed.

    >>> from formingx.exact.inflation import thick_wall
    >>> state = thick_wall("sphere", 2.0, inner_radius=1.0, outer_radius=2.0, c10=1.0)
    >>> round(float(state.pressure), 4)
    1.6139
    """
    check_name("thick_wall: kind", kind, ("tube", "sphere"))
    A, B = positive("inner_radius", inner_radius), positive("outer_radius", outer_radius)
    if not A < B:
        raise InputError(f"outer_radius = {outer_radius!r}: must be above inner_radius = {inner_radius!r}")
    c10, c01 = non_negative("c10", c10), non_negative("c01", c01)
    n = 2 if kind == "tube" else 3
    grown = (positive("inner_stretch", inner_stretch) ** n - 1) * A**n
    R = np.array([A, B]) if R is None else np.asarray(R, dtype=float)
    r = (R**n + grown) ** (1 / n)

    def g(l):
        if kind == "tube":
            return 2 * (c10 + c01) * (np.log(l) - l**-2 / 2)
        return -c10 * (4 / l + l**-4) + c01 * (4 * l - 2 * l**-2)

    l, outer = r / R, (1 + grown / B**n) ** (1 / n)
    radial = g(outer) - g(l)
    if kind == "tube":
        hoop = radial + 2 * (c10 + c01) * (l**2 - l**-2)
        third = radial + 2 * c10 * (1 - l**-2) + 2 * c01 * (l**2 - 1)
    else:
        hoop = third = radial + 2 * c10 * (l**2 - l**-4) + 2 * c01 * (l**4 - l**-2)
    return ThickWallState(float(g(inner_stretch) - g(outer)), R, r, radial, hoop, third)


def thick_sphere_limit_point(**wall: float) -> tuple[float, ThickWallState] | None:
    """Return the first pressure maximum of an inflated thick sphere.

    The stretch of the inner face is varied from 1.01 to 20.

    Args:
        wall: arguments inner_radius, outer_radius, c10, c01 and R of `thick_wall`.

    Returns:
        The stretch of the inner face and the state at the maximum; None if the pressure has no maximum in this range.
    """
    from scipy.optimize import minimize_scalar

    def pressure(stretch):
        return thick_wall("sphere", stretch, **wall).pressure

    stretches = np.geomspace(1.01, 20, 200)
    p = [pressure(s) for s in stretches]
    i = next((i for i in range(1, 199) if p[i - 1] < p[i] > p[i + 1]), None)
    if i is None:
        return None
    found = minimize_scalar(lambda s: -pressure(s), bounds=(stretches[i - 1], stretches[i + 1]), method="bounded",
                            options={"xatol": 1e-10})
    return float(found.x), thick_wall("sphere", found.x, **wall)
