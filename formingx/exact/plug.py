"""Membranes under a plug, solved by ordinary differential equations, for comparison.

A flat circular membrane with a fixed rim is pushed by a flat plug of radius r_p.

**Sharp edge** (Mooney material, `membrane_under_plug`). A sticking membrane keeps r = r_p at R = r_p. A membrane that
slides without friction has the equal biaxial stretch l0 over the face. There N1 is continuous across the edge, at
R = r_p/l0.

**Rounded edge with Coulomb friction** (neo-Hookean material, `membrane_sliding_over_plug`). The flat of the plug
carries no pressure. So the membrane has an equal biaxial stretch l0 there, and all of it that touches the edge and the
side slides outwards. On the side, the curvature kappa is 0. In the free part the contact pressure N = 0 gives kappa. On
the edge, the thickness h of the sheet counts: its middle surface has the radius f + h/2, with the fillet radius f, and
friction acts h/2 below it. Moments about the centre of the edge give the factor f/(f + h/2) of the friction. The travel
is measured at the face of the plug.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, check_name, non_negative, positive
from .inflation import meridional_stretch


@dataclass(frozen=True)
class PlugState:
    """Membrane under a plug, at n points from the edge of the plug to the rim, in the units of the input.

    Attributes:
        force: force of the plug along its travel, stress length^2.
        face_stretch: equibiaxial stretch under the plug, 1 for a sticking membrane.
        R: reference radii of the points, shape (n,), length.
        r: deformed radii, shape (n,), length.
        z: deformed heights, from minus the travel at the plug to 0 at the rim, shape (n,), length.
        thickness_ratio: deformed over reference thickness, shape (n,).
    """

    force: float
    face_stretch: float
    R: np.ndarray
    r: np.ndarray
    z: np.ndarray
    thickness_ratio: np.ndarray


def membrane_under_plug(travel: float, *, radius: float, plug_radius: float, thickness: float, c10: float,
                        c01: float = 0.0, friction: str = "stick") -> PlugState:
    r"""Return a circular membrane with a fixed rim, stretched by a flat plug with a sharp edge.

    Outside the plug, with the components H and V = F/(2 pi) of R N_1 along r and z, and the force F:

    .. math:: \frac{dH}{dR} = N_2, \qquad \frac{dr}{dR} = \frac{\lambda_1 H}{R N_1}, \qquad
              \frac{dz}{dR} = \frac{\lambda_1 V}{R N_1}, \qquad R N_1 = \sqrt{H^2 + V^2}

    N_1 and N_2 are the meridional and circumferential tensions per reference length, R and r the reference and deformed
    radius, z the height. With the stretches lambda_1 (meridional) and lambda_2 = r/R and the reference thickness h0

    .. math:: N_1 = 2 h_0 (\lambda_1 - \lambda_1^{-3} \lambda_2^{-2})(c_{10} + c_{01} \lambda_2^2), \qquad
              N_2 = 2 h_0 (\lambda_2 - \lambda_2^{-3} \lambda_1^{-2})(c_{10} + c_{01} \lambda_1^2)

    Args:
        travel: travel of the plug from the plane of the rim, above 0, length.
        radius: reference radius of the membrane, length.
        plug_radius: radius of the plug, length.
        thickness: reference thickness, length.
        c10: constant of I1, stress.
        c01: constant of I2, stress.
        friction: "stick" or "none", between membrane and plug.

    Returns:
        The membrane outside the plug.

    Raises:
        InputError: a size or constant is not allowed. At this travel the membrane would touch the side of the plug, or
            a frictionless plug does not reach it.

    >>> from formingx.exact.plug import membrane_under_plug
    >>> state = membrane_under_plug(0.5, radius=1.0, plug_radius=0.4, thickness=0.02, c10=1.0)
    >>> round(float(state.force), 5)
    0.08978
    """
    from scipy.optimize import brentq
    travel, radius, thickness = positive("travel", travel), positive("radius", radius), positive("thickness", thickness)
    c10, c01, edge = positive("c10", c10), non_negative("c01", c01), positive("plug_radius", plug_radius) / radius
    check_name("membrane_under_plug: friction", friction, ("stick", "none"))
    if edge >= 1:
        raise InputError(f"plug_radius = {plug_radius!r}: must be below radius = {radius!r}")
    k, depth, slides = c01 / c10, travel / radius, friction == "none"

    def tension(l1, l2):                      # lengths over the radius, tensions over 2 c10 h0
        return (l1 - l1**-3 * l2**-2) * (1 + k * l2**2)

    def stretch(n, l2):                       # meridional stretch of this tension
        return meridional_stretch(n / (1 + k * l2**2), l2)

    def start(p):
        return edge / p[1] if slides else edge

    def derivatives(s, y, p):
        r, _, H = y
        V, width = p[0], 1 - start(p)
        R = 1 - width * (1 - s)
        RN, l2 = np.hypot(H, V), r / R
        l1 = stretch(RN / R, l2)
        return width * np.array([l1 * H / RN, l1 * V / RN, tension(l2, l1)])

    def ends(depth, a, b, p):
        found = [a[0] - edge, a[1] + depth, b[0] - 1, b[1]]
        if slides:
            found.append(np.hypot(a[2], p[0]) - start(p) * tension(p[1], p[1]))
        return np.array(found)

    s = np.linspace(0, 1, 60) ** 2
    first_depth = min(depth, 0.1)                   # the first guess is a cone
    l1 = np.hypot(1, first_depth / (1 - edge))
    RN = (edge + (1 - edge) * s) * tension(l1, 1.0)
    y = np.array([edge + (1 - edge) * s, first_depth * (s - 1), RN / l1])
    p = [edge * tension(l1, 1.0) * first_depth / (1 - edge)]
    if slides:
        p.append(brentq(lambda l: tension(l, l) - tension(l1, 1.0), 1, l1))
    found = _continuation(derivatives, ends, s, y, p, first_depth, depth, radius)
    r = found.y[0]
    if r.min() < edge * (1 - 1e-6):
        raise InputError(f"travel = {travel!r}: the membrane would touch the side of the plug")
    R = 1 - (1 - start(found.p)) * (1 - found.x)
    l1 = stretch(np.hypot(found.y[2], found.p[0]) / R, r / R)
    force = 4 * np.pi * c10 * thickness * radius * found.p[0]
    return PlugState(float(force), float(found.p[1]) if slides else 1.0, R * radius, r * radius, found.y[1] * radius,
                     R / (l1 * r))


def _continuation(derivatives: Callable, ends: Callable, s: np.ndarray, y: np.ndarray, p: list, depth: float,
                  goal: float, radius: float) -> Any:
    """Return the solution of a boundary value problem at a travel by `solve_bvp`, in steps from a smaller travel.

    `derivatives` maps (s, y, p) to dy/ds, (3, n), and `ends` (travel, y(0), y(1), p) to residuals. The guess has s
    (n,), y (3, n) and parameters p; travels are over the radius. A step that fails is an InputError.
    """
    from scipy.integrate import solve_bvp
    while True:
        found = solve_bvp(derivatives, functools.partial(ends, depth), s, y, p, tol=1e-6, max_nodes=5000)
        if not found.success:
            raise InputError(f"travel = {goal * radius!r}: the membrane comes to {depth * radius:.6g} and not further:"
                             f" {found.message}")
        if depth == goal:
            return found
        depth, previous = min(1.25 * depth, goal), depth
        y, p = found.sol(s) * np.array([[1], [depth / previous], [1]]), found.p


@dataclass(frozen=True)
class SlidingState:
    """Membrane that slides over the rounded edge of a plug, in the units of the input.

    Attributes:
        travel: travel of the plug, length.
        force: force of the plug along its travel, stress length^2.
        face_stretch: equibiaxial stretch under the flat face of the plug.
        wrap: angle of the part of the rounded edge in contact, up to pi/2, radians.
        side: length of contact along the side of the plug, length.
    """

    travel: float
    force: float
    face_stretch: float
    wrap: float
    side: float


def membrane_sliding_over_plug(face_stretch: float, *, radius: float, plug_radius: float, fillet: float,
                               thickness: float, c10: float, mu: float) -> SlidingState:
    r"""Return the neo-Hookean membrane that slides over a flat plug with a rounded edge under Coulomb friction.

    T_1 and T_2 are the meridional and circumferential tensions per deformed length. On the edge, with the deformed
    radius r, arc length s, slope phi and curvature kappa of the meridian:

    .. math:: \frac{dT_1}{ds} = (T_2 - T_1) \frac{\cos\phi}{r} + \mu N \frac{f}{f + h/2}, \qquad
              N = T_1 \kappa + T_2 \frac{\sin\phi}{r}, \qquad \kappa = \frac{1}{f + h/2}

    Here f is the fillet radius, h the deformed thickness and N the contact pressure on the middle surface
    (equilibrium: Adkins and Rivlin 1952; friction: Song 1993, eq. 5.9).

    Args:
        face_stretch: equibiaxial stretch under the flat face of the plug, above 1. It increases with the travel.
        radius: reference radius of the membrane, length.
        plug_radius: radius of the plug, length.
        fillet: radius of the edge of the plug, length.
        thickness: reference thickness, length.
        c10: neo-Hookean constant, stress.
        mu: coefficient of friction between membrane and plug, 0 or larger.

    Returns:
        Travel, force and contact lengths at this stretch.

    Raises:
        InputError: a size or constant is not allowed, or this plug does not reach the stretch.
    """
    from scipy.optimize import brentq
    l0, c10, mu = positive("face_stretch", face_stretch), positive("c10", c10), non_negative("mu", mu)
    radius, thickness = positive("radius", radius), positive("thickness", thickness)
    rp, f, h0 = positive("plug_radius", plug_radius) / radius, positive("fillet", fillet) / radius, thickness / radius
    if not (f <= rp < 1 and l0 > 1):
        raise InputError(f"fillet = {fillet!r}, plug_radius = {plug_radius!r}, radius = {radius!r} must rise in this"
                         f" order, and face_stretch = {face_stretch!r} be above 1")

    def upright(_, y):
        return y[3] - np.pi / 2
    upright.terminal = True  # type: ignore[attr-defined]
    flat = np.array([(rp - f) / l0, rp - f, 0, 0, 1 - l0**-6])
    edge = _integrate(2 * (f + h0), flat, _contact_derivatives(mu, h0, f), events=upright, dense_output=True)
    edge_length = edge.t[-1]                        # arc length of the edge

    def separation_point(u):                     # y where contact ends, at the arc length u from the flat
        return _state_after(max(u - edge_length, 0.0), edge.sol(min(u, edge_length)), _contact_derivatives(mu))

    def rim_error(u):                            # 0 if the membrane ends at the rim
        y = separation_point(u)
        return _state_after(1 - y[0], y, _free_derivatives)[1] - 1 if y[0] < 1 else 1.0

    lengths = np.concatenate([np.linspace(0.01, 1, 30) * edge_length, edge_length + np.linspace(0.01, 3, 60)])
    found = [rim_error(lengths[0])]
    with np.errstate(over="ignore", invalid="ignore"):      # lengths beyond the solution
        while not found[-1] <= 0 and len(found) < len(lengths):
            found.append(rim_error(lengths[len(found)]))
    if not (len(found) > 1 and found[-2] > 0 >= found[-1]):
        raise InputError(f"face_stretch = {face_stretch!r}: this plug does not draw the membrane so far")
    u = brentq(rim_error, lengths[len(found) - 2], lengths[len(found) - 1], xtol=1e-13)
    _, r, _, phi, t = y = separation_point(u)
    travel = _state_after(1 - y[0], y, _free_derivatives)[2] * radius + thickness * (1 - l0**-2) / 2
    force = 4 * np.pi * c10 * thickness * radius * r * t * np.sin(phi)
    return SlidingState(float(travel), float(force), l0, float(phi), float(max(u - edge_length, 0.0) * radius))


def _tensions(t: float, l2: float) -> tuple[float, float]:
    r"""Return the meridional stretch and the circumferential tension T2 of a neo-Hookean membrane.

    .. math:: T_1 = \frac{\lambda_1}{\lambda_2} - (\lambda_1 \lambda_2)^{-3}, \qquad
              T_2 = \frac{\lambda_2}{\lambda_1} - (\lambda_1 \lambda_2)^{-3}

    Tensions are per deformed length, over 2 c10 h0 (h0: reference thickness).
    """
    l1 = meridional_stretch(t * l2, l2)
    return l1, l2 / l1 - (l1 * l2)**-3


def _state_after(length: float, y: np.ndarray, derivatives: Callable) -> np.ndarray:
    """Return the state (R, r, z, phi, T1), shape (5,), of the meridian at a `length` from a point with state y."""
    return y if length == 0 else _integrate(length, y, derivatives).y[:, -1]


def _integrate(length: float, y: np.ndarray, derivatives: Callable, **options: Any) -> Any:
    """Return the solution of `solve_ivp` with these `derivatives` over a distance `length`, from the state y."""
    from scipy.integrate import solve_ivp
    return solve_ivp(lambda s, y: derivatives(*y), (0, length), y, rtol=1e-9, atol=1e-12, **options)


def _contact_derivatives(mu: float, h0: float = 0.0, fillet: float = np.inf) -> Callable:
    """Return a function of (R, r, z, phi, T1) that gives the derivatives of the five by arc length, in this order.

    It holds in contact with edge or side of the plug (`membrane_sliding_over_plug`). Lengths are over the reference
    radius, tensions over 2 c10 h0; the side has h0 = 0 and an infinite fillet.
    """
    def derivatives(R, r, z, phi, t):
        l1, t2 = _tensions(t, r / R)
        half = h0 * R / (l1 * r) / 2                        # half of the thickness
        kappa, lever = 1 / (fillet + half), 1 / (1 + half / fillet)
        N = t * kappa + t2 * np.sin(phi) / r
        return [1 / l1, np.cos(phi), np.sin(phi), kappa, (t2 - t) * np.cos(phi) / r + mu * lever * N]
    return derivatives


def _free_derivatives(R: float, r: float, z: float, phi: float, t: float) -> list[float]:
    r"""Return the derivatives of (R, r, z, phi, T1) by R on the part of a membrane that is not in contact.

    .. math:: \frac{d\phi}{ds} = -\frac{T_2}{T_1} \frac{\sin\phi}{r}, \qquad
              \frac{dT_1}{ds} = (T_2 - T_1) \frac{\cos\phi}{r}, \qquad ds = \lambda_1 dR

    Lengths are over the reference radius of the membrane, t is T1 over 2 c10 h0, and phi is in radians.
    """
    l1, t2 = _tensions(t, r / R)
    return [1, l1 * np.cos(phi), l1 * np.sin(phi), -l1 * t2 / t * np.sin(phi) / r, l1 * (t2 - t) * np.cos(phi) / r]
