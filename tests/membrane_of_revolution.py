"""Axisymmetric membrane theory of a neo-Hookean tube whose ends are held, by a shooting method of its own.

Lengths over the radius R, stresses over the shear modulus mu, the pressure as p R / (mu H). With the energy
W = (l_1^2 + l_2^2 + (l_1 l_2)^-2 - 3) / 2, the stretches l_1 along the meridian and l_2 = r, and the reference
coordinate Z along the tube (Adkins and Rivlin, Phil. Trans. A 244 (1952) 505):

    (W_1 r' / l_1)' = W_2 - p r z',      W_1 z' / l_1 = p r^2 / 2 + c
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

LENGTH = 4.0
"""Length of the tube over its radius."""


def meridional_stretch(tension, hoop):
    """The stretch l_1 at which W_1 has a value, by Newton's method."""
    stretch = max(1.0, tension)
    for _ in range(50):
        change = (stretch - 1 / (stretch**3 * hoop**2) - tension) / (1 + 3 / (stretch**4 * hoop**2))
        stretch -= change
        if abs(change) < 1e-13:
            break
    return stretch


def half_tube(middle, stretch, pressure):
    """(r, z, volume) at the end of the half of the tube, from its middle with the radius and the stretch there."""
    constant = stretch - 1 / (stretch**3 * middle**2) - pressure * middle**2 / 2

    def slopes(_, y):
        r, _, radial, _ = y
        axial = constant + pressure * r**2 / 2
        tension = np.hypot(radial, axial)
        along = meridional_stretch(tension, r)
        dz = along * axial / tension
        return [along * radial / tension, dz, r - 1 / (along**2 * r**3) - pressure * r * dz, np.pi * r**2 * dz]
    found = solve_ivp(slopes, (0, LENGTH / 2), [middle, 0.0, 0.0, 0.0], rtol=1e-8, atol=1e-10).y[:, -1]
    return found[0], found[1], found[3]


def limit_point():
    """The largest pressure p R / (mu H), and the volume there over the first volume, by a polynomial in the radius."""
    radii, rows, guess = (1.75, 1.8, 1.85, 1.9, 1.95), [], (1.21, 0.906)
    for middle in radii:
        guess, _, success, message = fsolve(
            lambda v, middle=middle: np.subtract(half_tube(middle, *v)[:2], (1, LENGTH / 2)), guess, full_output=True)
        assert success == 1, message
        rows.append((guess[1], half_tube(middle, *guess)[2] / (np.pi * LENGTH / 2)))
    pressure, volume = (np.polynomial.Polynomial.fit(radii, column, 4) for column in zip(*rows))
    roots = pressure.deriv().roots()
    top = min(roots[abs(roots.imag) < 1e-9].real, key=lambda root: abs(root - np.mean(radii)))
    return float(pressure(top)), float(volume(top))
