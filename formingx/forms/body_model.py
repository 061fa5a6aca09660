"""Interface of the kinds of bodies: solids, membranes and sheets implement it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import ufl


class BodyModel(ABC):
    """Fields, boundaries and integrals of one kind of body; the base of `Formulation`."""

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
        """Return the constraints that a support imposes.

        Args:
            support: the `Support`.

        Returns:
            List of `Constrained` and `ConstrainedMean`.
        """

    @abstractmethod
    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Return the points of the mesh of the fields that represent points of the body.

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
            density: density per reference volume (UFL scalar).
            layers: names of the layers.
            metadata: quadrature options of the measure.

        Returns:
            The integral (UFL).
        """

    @abstractmethod
    def mid(self, layer: str, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        """Return the heights in a layer of points that are given on the mesh of the fields.

        For a solid they are Z, for a membrane the heights halfway between the faces of the layer.

        Args:
            layer: name of the layer.
            R: radii of the points, shape (n,), length.
            Z: heights of the points on the mesh of the fields, shape (n,), length.

        Returns:
            Z in the layer, shape (n,), length.
        """

    @abstractmethod
    def _make_mesh(self) -> Any:
        """Return the `Mesh` of the fields."""

    @abstractmethod
    def _elements(self, cell: Any) -> tuple[Any, list[Any]]:
        """Return the scalar element of a displacement component, and the elements of all fields."""

    @abstractmethod
    def _groups(self) -> list[tuple[Any, list[str]]]:
        """Return a list of (material, layers), one for each form of the energy."""

    @abstractmethod
    def _weight(self) -> Any:
        """Return the reference volume per measure `dx` of the mesh (UFL scalar), such as 2 pi R."""

    @abstractmethod
    def _deformation_gradient(self) -> Any:
        """Return the deformation gradient (UFL, shape (3, 3))."""

    @abstractmethod
    def _energy(self, density: Any) -> Any:
        """Return the integral of an energy density over the body, over stress times volume (UFL form).

        density: function of (`MaterialTerms`, deformation gradient) that returns the density of a material (stress).
        """
