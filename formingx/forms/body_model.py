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
        """Return the outward reference normal (UFL, shape (2,)) and the measure of a boundary on which a load acts."""

    @abstractmethod
    def constraints(self, support: Any) -> list[Any]:
        """Return the `Constrained` and `ConstrainedMean` that a support imposes on the displacement field."""

    @abstractmethod
    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Return the points on the mesh of the fields for points of the body, shape (n, 2), length.

        For a solid they are the points themselves, for a membrane those of the mid-surface at the same R.
        """

    @abstractmethod
    def weighted(self, density: Any, layers: list[str], metadata: dict | None = None) -> Any:
        """Return the integral of a density (UFL scalar) over the reference volume of layers; per depth in plane strain.

        metadata: of the UFL measure; None: the scene's quadrature.
        """

    @abstractmethod
    def mid(self, layer: str, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        """Return the heights at which functions of the position are evaluated in a layer, shape (n,), length.

        For a solid they are Z. For a membrane, the mid-surface of all layers, they lie halfway between the layer's
        faces.
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
        """Return the integral over the body of density(`MaterialTerms`, F) (stress), over stress times volume (UFL)."""
