"""What contact asks of a rigid tool."""

from typing import Protocol

import numpy as np

from .profile import Nearest


class RigidTool(Protocol):
    """A rigid tool at rest, which moves as a whole: n points are seen from it. A `Tool` is one, by its profile.

    Distances must be exact near the surface: a penalty 1e5 times as stiff as the body multiplies their errors.
    """

    def signed_distance(self, x: np.ndarray) -> np.ndarray:
        """Distance of points x, shape (n, components), to the surface, positive inside the tool, shape (n,), length."""

    def nearest(self, x: np.ndarray) -> Nearest:
        """That distance, its gradient and its curvature."""

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest coordinates of the surface as drawn, shape (2, components), length."""
