"""Free inflation of a thin tube or disc of one or more layers by membrane theory: the pressure at a stretch.

A tube remains a tube, and a disc becomes a spherical cap. The layers have the same stretches, so their forces add up.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .homogeneous import in_plane_stretches
from .material import Material

_HALVINGS = np.finfo(float).nmant + 8      # bisections of the axial stretch, down to round-off


class Peak(NamedTuple):
    """First maximum of the pressure over the stretch in free inflation.

    Attributes:
        stretch: hoop stretch of a tube, or equibiaxial stretch of a disc, at the maximum.
        pressure: pressure at the maximum, stress.
    """

    stretch: float
    pressure: float


class FreeInflation:
    """Free inflation of a thin tube or disc, of a radius, of layers (material, reference thickness), in length."""

    def __init__(self, layers: Sequence[tuple[Material, float]], radius: float):
        self._layers = [(material, list(material.parameters.values()), h) for material, h in layers]
        self._radius = radius

    def tube(self, hoop: np.ndarray) -> np.ndarray:
        r"""Return the pressure in a long tube with closed ends that is free to extend.

        The axial Cauchy stress is half of the hoop stress. This condition gives the axial stretch
        :math:`\lambda_z` at a hoop stretch :math:`\lambda_h`:

        .. math:: P_z \lambda_z = \tfrac{1}{2} P_h \lambda_h, \qquad p = \frac{P_h h_0}{R \lambda_h \lambda_z}

        P are nominal stresses, h0 is the reference thickness and R the reference radius. For several layers P h0 is a
        sum over the layers. Hoop stretches have shape (n,); pressures beyond the largest stretch of a material are
        infinite.
        """
        low, high = np.full_like(hoop, 0.5), hoop + 1.0
        for _ in range(_HALVINGS):
            axial = (low + high) / 2
            around, lengthwise = self._forces(np.stack([hoop, axial]))
            short = lengthwise * axial < around * hoop / 2            # not a number: beyond the limit, so too long
            low, high = np.where(short, axial, low), np.where(short, high, axial)
        found = self._forces(np.stack([hoop, axial]))[0] / (self._radius * hoop * axial)
        return np.where(np.isfinite(found), found, np.inf)

    def disc(self, stretch: np.ndarray) -> np.ndarray:
        r"""Return the pressure on a disc that is blown to a spherical cap with a uniform equibiaxial stretch l.

        Let a be the radius of the opening and s a the height of the cap. With the nominal stress P and the reference
        thickness h0

        .. math:: l^2 = 1 + s^2, \qquad p = \frac{4 s \, P h_0 / l}{a (1 + s^2)}

        For several layers P h0 is a sum over the layers. The maximum of the pressure is 2 to 3 % below the maximum for
        a hinged neo-Hookean disc. Stretches l have shape (n,), 1 or larger; pressures beyond the largest stretch of a
        material are infinite.
        """
        force = self._forces(in_plane_stretches("equibiaxial", stretch))[0]
        found = 4 * np.sqrt(stretch**2 - 1) * force / (self._radius * stretch**3)
        return np.where(np.isfinite(found), found, np.inf)

    def _forces(self, stretches: np.ndarray) -> np.ndarray:
        """Return the in-plane forces per reference length, shape (2, n), stress length, for stretches, shape (2, n)."""
        each = [h * material.response.stress(stretches, constants) for material, constants, h in self._layers]
        return np.sum(each, axis=0)


def first_peak(pressure: Callable[[np.ndarray], np.ndarray]) -> Peak | None:
    """Return the first maximum of a pressure, a function of stretches (n,), from 1 to 20, or None."""
    stretches = np.geomspace(1.0 + 1e-6, 20.0, 2000)
    found = pressure(stretches)
    found = found[: int(np.argmin(np.append(np.isfinite(found), False)))]    # below the limit of the materials
    falls = np.flatnonzero(found[1:] < found[:-1] * (1 - 1e-12))
    return Peak(float(stretches[falls[0]]), float(found[falls[0]])) if len(falls) else None
