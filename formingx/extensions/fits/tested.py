"""Range of the deformations in which a material was tested, and distances of other deformations from it."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InputError, check_name, check_type, finite_array
from ...materials.homogeneous import MODES, in_plane_stretches
from ...materials.material import Material
from ...values.tolerances import ROUND_OFF

_TESTED_DISTANCE = 0.1
"""Distance of strains from the tested ones, over their norm, up to which a deformation counts as tested."""
_TESTED_STRAIN = 0.02
"""Distance of logarithmic strains from the tested ones up to which every deformation counts as tested."""



@dataclass(frozen=True)
class MeasuredRange:
    """Range of the tests to which the constants of a material were fitted.

    A deformation is described by its largest and its middle principal logarithmic strain. It counts as tested if these
    lie in the convex hull of the tested strains and zero strain, or near the hull. Near is a distance of at most 0.02,
    or 10 % of the norm of the two strains if that is more. A deformation between two tested modes therefore counts as
    tested.

    Attributes:
        ranges: {test: (lowest, highest stretch)}; the test is "uniaxial", "pure_shear", "equibiaxial" or "biaxial".
        strains: largest and middle logarithmic strain of the n measured points, shape (n, 2).
        undetermined: names of the constants that these tests do not determine.
        rates: lowest and highest Hencky rate of tests in time, 1/time, or None.
    """

    ranges: dict[str, tuple[float, float]]
    strains: np.ndarray
    undetermined: tuple[str, ...] = ()
    rates: tuple[float, float] | None = None

    @classmethod
    def from_stretches(cls, stretches: Mapping[str, Any], undetermined: tuple[str, ...] = (),
                       rates: tuple[float, float] | None = None) -> MeasuredRange:
        """Return the range of tests with given stretches.

        Args:
            stretches: {test: stretches, shape (n,)}; of "biaxial" shape (2, n).
            undetermined: names of the constants that these tests do not determine.
            rates: lowest and highest Hencky rate of tests in time, 1/time, or None.

        Returns:
            Range of the tests.

        Raises:
            InputError: unknown test, or a stretch that is not above 0.
        """
        ranges, strains = {}, []
        for mode, given in stretches.items():
            check_name("tests: test", mode, [*MODES, "biaxial"])
            l = finite_array(f"tests: {mode}", given)
            if l.size == 0 or not np.all(l > 0):
                raise InputError(f"tests: {mode}: stretches must be above 0")
            ranges[mode] = (float(l.min()), float(l.max()))
            in_plane = l.reshape(2, -1) if mode == "biaxial" else in_plane_stretches(mode, l.ravel())
            strains.append(principal_strains(in_plane))
        return cls(ranges, np.concatenate(strains), undetermined, rates)

    def distance(self, strains: np.ndarray) -> np.ndarray:
        """Return the distances of deformations from the tested range, in logarithmic strain.

        Args:
            strains: largest and middle logarithmic strain of m deformations, shape (m, 2).

        Returns:
            Distances from the convex hull of the tested strains and zero strain, shape (m,); 0 inside the hull.
        """
        corners = self._corners
        after = np.roll(corners, -1, axis=0)
        edges = after - corners
        from_corner = strains[:, None] - corners
        lengths = np.sum(edges**2, axis=1)
        share = np.sum(from_corner * edges, axis=2) / np.where(lengths > 0, lengths, 1.0)
        nearest = corners + np.clip(share, 0, 1)[..., None] * edges
        found = np.sqrt(np.sum((strains[:, None] - nearest) ** 2, axis=2)).min(axis=1)
        side = edges[:, 0] * from_corner[..., 1] - edges[:, 1] * from_corner[..., 0]
        return np.where(np.all(side >= 0, axis=1) & (len(corners) > 2), 0.0, found)

    def outside(self, strains: np.ndarray) -> np.ndarray:
        """Return the mask of the deformations that do not count as tested.

        Args:
            strains: largest and middle logarithmic strain of m deformations, shape (m, 2).

        Returns:
            Mask, shape (m,).
        """
        size = np.hypot(*strains.T)
        return self.distance(strains) > np.maximum(_TESTED_DISTANCE * size, _TESTED_STRAIN)

    def rows(self) -> list[tuple[str, str]]:
        """Return rows of a table about the tests, for the report of a material.

        Returns:
            List of (label, text): tested stretches, undetermined constants and tested rates.
        """
        found = [("tested at stretches", str(self))]
        if self.undetermined:
            found.append(("not determined by these tests", ", ".join(self.undetermined)))
        if self.rates is not None:
            found.append(("tested at rates", f"{self.rates[0]:.3g} to {self.rates[1]:.3g}"))
        return found

    @property
    def single_mode(self) -> bool:
        """True if all tests are of one mode: their strains lie on one line through zero strain."""
        return len(self._corners) < 3

    @cached_property
    def _corners(self) -> np.ndarray:
        """Return the convex hull of tested (largest, middle) logarithmic strains and zero, (k, 2)."""
        return _hull(np.vstack([np.zeros(2), self.strains]))

    def __repr__(self) -> str:
        return ", ".join(f"{mode.replace('_', ' ')} {low:.3g} to {high:.3g}" for mode, (low, high)
                         in self.ranges.items())


def with_tests(material: Material, **stretches: Any) -> Material:
    """Return a copy of a material that stores the range of its tests; runs warn of deformations beyond it.

    `fit` stores this range in its material by itself.

    Args:
        material: any material.
        stretches: stretches of each test, any shape, such as uniaxial=(1, 4), equibiaxial=(1, 2.5); of "biaxial" shape
            (2, n).

    Returns:
        The copy; its attribute `tested` is the range.

    Raises:
        InputError: no test, an unknown test, or a stretch that is not above 0.

    >>> fx.with_tests(fx.NeoHookean(c10=0.4), uniaxial=(1.0, 3.0)).tested
    uniaxial 1 to 3
    """
    other = copy.copy(check_type("with_tests: material", material, Material, "a material"))
    if not stretches:
        raise InputError("with_tests: no test is given: must be stretches of tests, such as uniaxial=(1, 4)")
    other.tested = MeasuredRange.from_stretches(stretches)
    return other


def principal_strains(stretches: Any) -> np.ndarray:
    """Return the largest and middle logarithmic strain, (n, 2), of incompressible stretches (2, n)."""
    e = np.log(np.asarray(stretches, float))
    return -np.sort(-np.stack([*e, -e[0] - e[1]]), axis=0)[:2].T


def nearest_test(largest: float, middle: float) -> str:
    """Return "uniaxial", "pure shear" or "equibiaxial", nearest to two logarithmic strains."""
    share = middle / largest if largest > 0 else 0.0
    return min(MODES, key=lambda mode: abs(MODES[mode] - share)).replace("_", " ")


def _hull(points: np.ndarray) -> np.ndarray:
    """Return the corners of the convex hull of points (n, 2), counter-clockwise (k, 2), by Andrew's monotone chain."""
    ordered = sorted(map(tuple, np.unique(points.round(10), axis=0)))
    if len(ordered) < 3:
        return np.array(ordered)

    def half(chain: Any) -> list[tuple[float, float]]:
        """Return a half of the hull without its last corner: the lower from ascending, the upper from descending."""
        found: list[tuple[float, float]] = []
        for x, y in chain:
            while len(found) > 1 and ((found[-1][0] - found[-2][0]) * (y - found[-2][1])
                                      - (found[-1][1] - found[-2][1]) * (x - found[-2][0])) <= ROUND_OFF:
                found.pop()
            found.append((x, y))
        return found[:-1]
    return np.array(half(ordered) + half(reversed(ordered)))
