"""Interface of a rigid tool for contact, checks and pictures."""

from typing import Protocol

import numpy as np

from .profile import Nearest


class RigidTool(Protocol):
    """A rigid tool at a travel of 0, such as a `Tool` or a `SolidTool`. It moves as a whole, so that points are given
    relative to it.

    Distances must be exact near the surface: a penalty 1e5 times as stiff as the body multiplies their errors.
    """

    def signed_distance(self, x: np.ndarray) -> np.ndarray:
        """Distance of points x, shape (n, components), to the surface, positive inside the tool, shape (n,), length."""

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Points of the surface, shape (n, components), length, and its straight pieces, for drawing and for checks.

        A piece is the numbers of its ends, shape (m, 2), in three dimensions of its corners, shape (m, 3).
        """

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest coordinates of the surface as drawn, shape (2, components), length."""


class PlaneTool(RigidTool, Protocol):
    """A rigid tool of a section: smooth up to its corners, so its distance has derivatives."""

    def nearest(self, x: np.ndarray) -> Nearest:
        """Return the signed distance of points x, shape (n, 2), its gradient and its curvature."""
