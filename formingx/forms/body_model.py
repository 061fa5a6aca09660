"""Interface of the kinds of bodies: solids, membranes and sheets implement it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import ufl


class BodyModel(ABC):
    """Interface of the fields, boundaries and integrals of a body (solid, membrane or sheet in three dimensions).

    `Formulation` derives from it.
    """

    @abstractmethod
    def face(self, name: str, quadrature_degree: int) -> tuple[Any, ufl.Measure]:
        """Return the outward normal and the measure of a boundary on which a load acts.

        Args:
            name: name of the boundary.
            quadrature_degree: degree of the quadrature on it.

        Returns:
            Outward reference normal (UFL, shape (2,)) and measure.
        """

    @abstractmethod
    def constraints(self, support: Any) -> list[Any]:
        """Return the constraints that a support imposes on the displacement field.

        Args:
            support: the `Support`.

        Returns:
            List of `Constrained` and `ConstrainedMean`.
        """

    @abstractmethod
    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Map points of the body to the mesh on which the fields live.

        For a solid they are the points themselves, for a membrane the points of the mid-surface at the same R.

        Args:
            points: reference positions in the body, shape (n, 2), length.

        Returns:
            Reference positions on the mesh of the fields, shape (n, 2), length.
        """

    @abstractmethod
    def weighted(self, density: Any, layers: list[str], metadata: dict | None = None) -> Any:
        """Return the integral of a density over the reference volume of some layers.

        Args:
            density: density per reference volume (UFL scalar), such as an energy density.
            layers: names of the layers.
            metadata: metadata of the UFL measure, such as the quadrature degree; None: the scene's quadrature.

        Returns:
            The integral (UFL form), density times length^3; in plane strain per unit depth.
        """

    @abstractmethod
    def mid(self, layer: str, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        """Return the heights at which functions of the position are evaluated in a layer.

        For a solid they are the heights Z of the points. For a membrane, whose mesh is the mid-surface of all layers,
        they are the heights halfway between the faces of the layer.

        Args:
            layer: name of the layer.
            R: radii of the points, shape (n,), length.
            Z: heights of the points on the mesh of the fields, shape (n,), length.

        Returns:
            Heights in the layer, shape (n,), length.
        """

    @abstractmethod
    def _make_mesh(self) -> Any:
        """Return the `Mesh` of the fields."""

    @abstractmethod
    def _elements(self, cell: Any) -> tuple[Any, list[Any]]:
        """Return the scalar element of a displacement component, and the elements of all fields."""

    @abstractmethod
    def _groups(self) -> list[tuple[Any, list[str]]]:
        """Return a list of (material, names of its layers), one for each term of the energy."""

    @abstractmethod
    def _weight(self) -> Any:
        """Return the reference volume per measure `dx` of the mesh (UFL scalar), such as 2 pi R."""

    @abstractmethod
    def _deformation_gradient(self) -> Any:
        """Return the deformation gradient (UFL, shape (3, 3))."""

    @abstractmethod
    def _energy(self, density: Any) -> Any:
        """Return the integral of an energy density over the body, divided by stress times volume (UFL form).

        density: function of (`MaterialTerms`, deformation gradient) that returns the density of a material (stress).
        """
