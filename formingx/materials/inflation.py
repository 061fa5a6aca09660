"""Thin bodies of one or more layers that are inflated freely: the pressure that they bear at a stretch.

Membrane theory: a tube stays a tube, a disc becomes a cap of a sphere. The layers have the same stretches, so their
forces add up.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .homogeneous import along
from .material import Material

_HALVINGS = 60             # bisections of a stretch, down to round-off


class Peak(NamedTuple):
    """The first maximum of the pressure: the stretch, and the pressure, stress."""

    stretch: float
    pressure: float


class Inflated:
    """A thin body, inflated freely.

    Args:
        layers: (material, thickness in the reference configuration, length) of each layer; all constants are numbers.
        radius: mean radius of the tube, or radius of the opening that holds the disc, in the reference configuration.
    """

    def __init__(self, layers: Sequence[tuple[Material, float]], radius: float):
        self._layers = [(material, list(material.parameters.values()), h) for material, h in layers]
        self._radius = radius

    def tube(self, hoop: np.ndarray) -> np.ndarray:
        """Return the pressure in a long tube with closed ends, free to grow longer, at hoop stretches, shape (n,),
        stress.

        The Cauchy stress along it is half of that around: P2 lz = P1 lh / 2 gives its stretch lz, and p = P1 h0 / (R
        lh lz). Infinity where a material cannot be stretched so far.
        """
        low, high = np.full_like(hoop, 0.5), hoop + 1.0
        for _ in range(_HALVINGS):
            axial = (low + high) / 2
            around, lengthwise = self._forces(np.stack([hoop, axial]))
            short = lengthwise * axial < around * hoop / 2            # not a number (beyond the limit): too long
            low, high = np.where(short, axial, low), np.where(short, high, axial)
        found = self._forces(np.stack([hoop, axial]))[0] / (self._radius * hoop * axial)
        return np.where(np.isfinite(found), found, np.inf)

    def disc(self, stretch: np.ndarray) -> np.ndarray:
        """Return the pressure on a disc blown to a cap of a sphere that is stretched evenly, shape (n,), stress.

        With the height s a the area ratio is l^2 = 1 + s^2, and p = 4 s (P h0 / l) / (a (1 + s^2)). The largest is
        2 to 3 % below the pressure of a hinged neo-Hookean disc.
        """
        force = self._forces(along("equibiaxial", stretch))[0]
        found = 4 * np.sqrt(stretch**2 - 1) * force / (self._radius * stretch**3)
        return np.where(np.isfinite(found), found, np.inf)

    def _forces(self, stretches: np.ndarray) -> np.ndarray:
        """Return the forces per length in the reference configuration, shape (2, n)."""
        each = [h * material.response.stress(stretches, constants) for material, constants, h in self._layers]
        return np.sum(each, axis=0)


def first_peak(pressure: Callable[[np.ndarray], np.ndarray]) -> Peak | None:
    """Return the first maximum of a pressure over stretches from 1 to 20; None: it only grows."""
    stretches = np.geomspace(1.0 + 1e-6, 20.0, 2000)
    found = pressure(stretches)
    found = found[: int(np.argmin(np.append(np.isfinite(found), False)))]    # up to the largest stretch
    falls = np.flatnonzero(found[1:] < found[:-1] * (1 - 1e-12))
    return Peak(float(stretches[falls[0]]), float(found[falls[0]])) if len(falls) else None
