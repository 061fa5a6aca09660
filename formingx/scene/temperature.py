"""Temperature of a body as the scene gives it: a field on the mesh."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
from dolfinx import fem
from numpy.typing import ArrayLike

from ..mesh import Mesh
from ..mesh.nodes import of_space
from ..ranks import gathered
from . import fields


@runtime_checkable
class Expansion(Protocol):
    """Law of thermal expansion."""

    def stretch(self, temperature: ArrayLike) -> np.ndarray:
        """Return the stress-free stretch.

        Args:
            temperature: temperatures.

        Returns:
            Stretches, the same shape.

        Raises:
            InputError: a stretch is not positive or not known.
        """


class GivenTemperature:
    """Temperature on the mesh of a scene, quadratic in each element.

    Args:
        given: field as in `fields.values_at`.
        mesh: mesh of the scene.

    Attributes:
        given: the argument `given`.
        mesh: the argument `mesh`.
        T: DOLFINx `Function` (P2), constant in time; `formingx.forms.temperature.Temperature` changes.

    Raises:
        InputError: the temperature is not defined all over the body.
    """

    def __init__(self, given: Any, mesh: Mesh):
        self.given, self._text = given, "a function" if callable(given) and not hasattr(given, "check") else repr(given)
        self.mesh = mesh
        self.T = fem.Function(fem.functionspace(mesh.domain, ("Lagrange", 2)), name="temperature")
        points = of_space(self.T.function_space)
        self.T.x.array[:] = fields.values_at(given, points, mesh, "Scene: temperature")

    def in_cells(self, cells: np.ndarray, places: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Return the temperatures in some cells at points of the reference cell.

        Args:
            cells: local numbers of the cells.
            places: positions in the reference cell, shape (q, 2).
            values: coefficients in place of T.x.array, with ghosts, shape (..., n).

        Returns:
            Temperatures, shape (..., cells, q).
        """
        space = self.T.function_space
        basis = space.element.basix_element.tabulate(0, places)[0, :, :, 0]
        return (self.T.x.array if values is None else values)[..., space.dofmap.list[cells]] @ basis.T

    def on(self, boundary: str) -> np.ndarray:
        """Return the temperatures at the nodes of T on a boundary, on all ranks; collective.

        Args:
            boundary: name of the boundary.

        Returns:
            Temperatures, shape (n,).
        """
        nodes = fem.locate_dofs_topological(self.T.function_space, 1, self.mesh.facets_of(boundary))
        return gathered(self.mesh.comm, self.T.x.array[nodes])

    def __repr__(self) -> str:
        return self._text
