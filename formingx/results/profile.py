"""The outline of a sheet and its thickness, against reference radius and against arc length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .probes import Probe, probe


@dataclass(frozen=True)
class Profile:
    """A sheet in one state, at the n nodes of its bottom face, from the axis to the rim.

    Attributes:
        reference_radius: R, shape (n,), length.
        bottom, top: deformed points (r, z) of the two faces at that R, shape (n, 2), length.
        original_thickness: distance of the two points at rest, shape (n,), length.
    """

    reference_radius: np.ndarray
    bottom: np.ndarray
    top: np.ndarray
    original_thickness: np.ndarray

    @property
    def thickness(self) -> np.ndarray:
        """Distance between the deformed top and bottom points of the same R, shape (n,), length."""
        return np.hypot(*(self.top - self.bottom).T)

    @property
    def thickness_ratio(self) -> np.ndarray:
        """Thickness over original thickness, shape (n,)."""
        return self.thickness / self.original_thickness

    @property
    def middle(self) -> np.ndarray:
        """Midpoints (r, z) of top and bottom, shape (n, 2), length."""
        return (self.top + self.bottom) / 2

    @property
    def arc_length(self) -> np.ndarray:
        """Length of the deformed middle line from the axis, shape (n,), length."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.middle, axis=0).T))])

    def thickness_ratio_at(self, radius: float) -> float:
        """Thickness ratio at a reference radius, linear between the nodes."""
        return float(np.interp(radius, self.reference_radius, self.thickness_ratio))


class Profiles:
    """Makes the `Profile` of a state; the mesh must have boundaries `bottom` and `top`, one above the other."""

    def __init__(self, problem: Any):
        self._problem = problem
        self._probe: Probe | None = None

    def of(self, state: Any) -> Profile:
        """The profile of a state (collective)."""
        self._probe = at = self._probe or self._make_probe()
        self._problem.x.array_w[:] = state.x
        self._problem.forms.control.value = state.control
        deformed = at.points + at.displacement(self._problem.x)
        n = len(at.points) // 2
        rest = np.hypot(*(at.points[n:] - at.points[:n]).T)
        return Profile(at.points[:n, 0].copy(), deformed[:n], deformed[n:], rest)

    def _make_probe(self) -> Probe:
        mesh = self._problem.scene.mesh
        for name in ("bottom", "top"):
            if name not in mesh.boundaries:
                raise InputError(f"a profile needs boundaries 'bottom' and 'top'; the mesh has {list(mesh.boundaries)}")
        bottom, top = mesh.nodes_of("bottom"), mesh.nodes_of("top")
        above = np.column_stack([bottom[:, 0], np.interp(bottom[:, 0], top[:, 0], top[:, 1])])
        return probe(self._problem, np.vstack([bottom, above]))
