"""Interface of a rigid tool for contact, checks and pictures."""

from typing import Protocol

import numpy as np

from .profile import Nearest


class RigidTool(Protocol):
    """Rigid tool at a travel of 0, such as a `Tool` or a `SolidTool`.

    It moves as a rigid body, so the coordinates of points are relative to it. Distances must be exact near the surface:
    contact multiplies their errors by a penalty of 1e5 times the stiffness of the body.
    """

    def signed_distance(self, x: np.ndarray) -> np.ndarray:
        """Return the signed distance of points from the surface of the tool.

        Args:
            x: points, shape (n, components), length.

        Returns:
            Distances, positive inside the tool, shape (n,), length.
        """

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return straight pieces of the tool's surface, for drawing and for checks.

        Returns:
            Points, shape (n, components), length. Point numbers of the pieces: lines, shape (m, 2), or in three
            dimensions triangles, shape (m, 3).
        """

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest coordinates of the points of `surface`, shape (2, components), length."""


class PlaneTool(RigidTool, Protocol):
    """Rigid tool of a section; it is smooth between corners, so its distance has derivatives."""

    def nearest(self, x: np.ndarray) -> Nearest:
        """Return the signed distance of points from the surface, with its gradient and curvature.

        Args:
            x: points, shape (n, 2), length.

        Returns:
            Distances, positive inside the tool, shape (n,), length; gradients, shape (n, 2); curvatures of the level
            lines of the distance, shape (n,), 1/length.
        """
