"""Membranes under a plug, solved by ordinary differential equations, to compare with.

A flat circular membrane (Mooney), rim held, pushed by a flat plug of radius rp. Sharp edge: outside the plug, with
tensions per original length N1 = 2 h0 (l1 - l1^-3 l2^-2)(c10 + c01 l2^2), N2 likewise, and H, V the radial and axial
parts of R N1: dH/dR = N2, V = force/(2 pi), dr/dR = l1 H/(R N1), dz/dR = l1 V/(R N1). A stuck membrane keeps r = rp
at R = rp; one that slides without friction is equally stretched over the face, by l0, and N1 goes on across the edge
at R = rp/l0.

Rounded edge, Coulomb friction (neo-Hookean): the flat carries no pressure, so it is stretched equally, by l0, and
everything that touches the edge and the side slides outwards. With tensions per deformed length
T1 = 2 c10 h0 (l1/l2 - (l1 l2)^-3), T2 likewise, arc length s, slope phi and the meridian's curvature kappa,
dT1/ds = (T2 - T1) cos(phi)/r + mu N,   N = T1 kappa + T2 sin(phi)/r   (equilibrium: Song 1993, 2.2; friction: 5.9),
kappa = 0 on the side; where the membrane is free N = 0 gives kappa. On the edge the sheet's thickness h = h0/(l1 l2)
counts: its middle surface bends with kappa = 1/(fillet + h/2), friction acts h/2 below it, which turns mu N into
mu N fillet/(fillet + h/2) (moments about the centre of the edge), and the travel is measured at the plug's face.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError, known, non_negative, positive
from .inflation import meridional_stretch


@dataclass(frozen=True)
class PlugState:
    """A membrane under a plug, in the units of the input.

    Attributes:
        force: on the plug, stress length^2. face_stretch: in both directions under the plug.
        R, r, z: reference radius and deformed meridian from the plug's edge to the rim, shape (n,), length; rim z = 0.
        thickness_ratio: l3 at those R, shape (n,).
    """

    force: float
    face_stretch: float
    R: np.ndarray
    r: np.ndarray
    z: np.ndarray
    thickness_ratio: np.ndarray


def membrane_under_plug(travel: float, *, radius: float, plug_radius: float, thickness: float, c10: float,
                        c01: float = 0.0, friction: str = "stick") -> PlugState:
    """Return the membrane, rim held, that a sharp-edged flat plug has pushed by `travel` (length, above 0).

    Args:
        friction: on the plug, "stick" or "none".

    Raises:
        InputError: a size or constant that is not allowed; a travel at which the membrane would touch the plug's side,
            or that a frictionless plug does not reach.

    >>> from formingx.exact.plug import membrane_under_plug
    >>> state = membrane_under_plug(0.5, radius=1.0, plug_radius=0.4, thickness=0.02, c10=1.0)
    >>> round(float(state.force), 5)
    0.08978
    """
    from scipy.optimize import brentq
    travel, radius, thickness = positive("travel", travel), positive("radius", radius), positive("thickness", thickness)
    c10, c01, edge = positive("c10", c10), non_negative("c01", c01), positive("plug_radius", plug_radius) / radius
    known("membrane_under_plug: friction", friction, ("stick", "none"))
    if edge >= 1:
        raise InputError(f"plug_radius = {plug_radius!r}: must be below radius = {radius!r}")
    k, depth, slides = c01 / c10, travel / radius, friction == "none"

    def tension(l1, l2):                      # lengths over the radius, tensions over 2 c10 h0
        return (l1 - l1**-3 * l2**-2) * (1 + k * l2**2)

    def stretch(n, l2):                       # l1 of that tension
        return meridional_stretch(n / (1 + k * l2**2), l2)

    def start(p):
        return edge / p[1] if slides else edge

    def slopes(s, y, p):
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
    share = min(depth, 0.1)                   # a cone, pushed on to the travel
    l1 = np.hypot(1, share / (1 - edge))
    RN = (edge + (1 - edge) * s) * tension(l1, 1.0)
    y, p = np.array([edge + (1 - edge) * s, share * (s - 1), RN / l1]), [edge * tension(l1, 1.0) * share / (1 - edge)]
    if slides:
        p.append(brentq(lambda l: tension(l, l) - tension(l1, 1.0), 1, l1))
    found = _pushed(slopes, ends, s, y, p, share, depth, radius)
    r = found.y[0]
    if r.min() < edge * (1 - 1e-6):
        raise InputError(f"travel = {travel!r}: the membrane would touch the side of the plug")
    R = 1 - (1 - start(found.p)) * (1 - found.x)
    l1 = stretch(np.hypot(found.y[2], found.p[0]) / R, r / R)
    force = 4 * np.pi * c10 * thickness * radius * found.p[0]
    return PlugState(float(force), float(found.p[1]) if slides else 1.0, R * radius, r * radius, found.y[1] * radius,
                     R / (l1 * r))


def _pushed(slopes: Callable, ends: Callable, s: np.ndarray, y: np.ndarray, p: list, depth: float, goal: float,
            radius: float) -> Any:
    """Return the solution of the boundary value problem at depth `goal`, in steps from a guess at a smaller depth."""
    from scipy.integrate import solve_bvp
    while True:
        found = solve_bvp(slopes, functools.partial(ends, depth), s, y, p, tol=1e-6, max_nodes=5000)
        if not found.success:
            raise InputError(f"travel = {goal * radius!r}: the membrane comes to {depth * radius:.6g} and not further:"
                             f" {found.message}")
        if depth == goal:
            return found
        depth, before = min(1.25 * depth, goal), depth
        y, p = found.sol(s) * np.array([[1], [depth / before], [1]]), found.p


@dataclass(frozen=True)
class SlidingState:
    """A membrane that slides over the rounded edge of a plug, in the units of the input.

    Attributes:
        travel: of the plug, length. force: on it, stress length^2.
        face_stretch: in both directions under the flat; wrap: angle of the edge that is touched, up to pi/2.
        side: how far the membrane lies on the plug's side, length.
    """

    travel: float
    force: float
    face_stretch: float
    wrap: float
    side: float


def membrane_sliding_over_plug(face_stretch: float, *, radius: float, plug_radius: float, fillet: float,
                               thickness: float, c10: float, mu: float) -> SlidingState:
    """Return the neo-Hookean membrane, rim held, under a flat plug with a rounded edge and Coulomb friction, drawn
    so far.

    Args:
        face_stretch: under the flat of the plug, above 1: it grows with the travel. mu: coefficient of friction.

    Raises:
        InputError: a size or constant that is not allowed; a stretch that this plug does not reach.
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
    edge = _integrated(2 * (f + h0), flat, _touching(mu, h0, f), events=upright, dense_output=True)
    whole = edge.t[-1]                        # of the arc length, around the edge

    def left(u):                              # where the membrane separates, u of arc length up the edge and the side
        return _along(max(u - whole, 0.0), edge.sol(min(u, whole)), _touching(mu))

    def misses(u):                            # the rim
        y = left(u)
        return _along(1 - y[0], y, _free)[1] - 1 if y[0] < 1 else 1.0

    lengths = np.concatenate([np.linspace(0.01, 1, 30) * whole, whole + np.linspace(0.01, 3, 60)])
    found = [misses(lengths[0])]
    with np.errstate(over="ignore", invalid="ignore"):      # too far
        while not found[-1] <= 0 and len(found) < len(lengths):
            found.append(misses(lengths[len(found)]))
    if not (len(found) > 1 and found[-2] > 0 >= found[-1]):
        raise InputError(f"face_stretch = {face_stretch!r}: this plug does not draw the membrane so far")
    u = brentq(misses, lengths[len(found) - 2], lengths[len(found) - 1], xtol=1e-13)
    _, r, _, phi, t = y = left(u)
    travel = _along(1 - y[0], y, _free)[2] * radius + thickness * (1 - l0**-2) / 2
    force = 4 * np.pi * c10 * thickness * radius * r * t * np.sin(phi)
    return SlidingState(float(travel), float(force), l0, float(phi), float(max(u - whole, 0.0) * radius))


def _tensions(t: float, l2: float) -> tuple[float, float]:
    """l1 and T2 where T1 = t, over 2 c10 h0."""
    l1 = meridional_stretch(t * l2, l2)
    return l1, l2 / l1 - (l1 * l2)**-3


def _along(length: float, y: np.ndarray, slopes: Callable) -> np.ndarray:
    """y = (R, r, z, phi, T1) at a distance from where it is known; lengths over the radius, tensions over 2 c10 h0."""
    return y if length == 0 else _integrated(length, y, slopes).y[:, -1]


def _integrated(length: float, y: np.ndarray, slopes: Callable, **options: Any) -> Any:
    """Return the solution of `solve_ivp` from y on; options: of `solve_ivp`."""
    from scipy.integrate import solve_ivp
    return solve_ivp(lambda s, y: slopes(*y), (0, length), y, rtol=1e-9, atol=1e-12, **options)


def _touching(mu: float, h0: float = 0.0, fillet: float = np.inf) -> Callable:
    """dy/ds on a rounded edge, or, without one, on the side of the plug."""
    def slopes(R, r, z, phi, t):
        l1, t2 = _tensions(t, r / R)
        half = h0 * R / (l1 * r) / 2                        # of the thickness
        kappa, lever = 1 / (fillet + half), 1 / (1 + half / fillet)
        N = t * kappa + t2 * np.sin(phi) / r
        return [1 / l1, np.cos(phi), np.sin(phi), kappa, (t2 - t) * np.cos(phi) / r + mu * lever * N]
    return slopes


def _free(R: float, r: float, z: float, phi: float, t: float) -> list[float]:
    """dy/dR where nothing is touched."""
    l1, t2 = _tensions(t, r / R)
    return [1, l1 * np.cos(phi), l1 * np.sin(phi), -l1 * t2 / t * np.sin(phi) / r, l1 * (t2 - t) * np.cos(phi) / r]
