"""The temperature of a body as a scene gives it: a field on the mesh that constants may depend on."""

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
    """A law of thermal expansion."""

    def stretch(self, temperature: ArrayLike) -> np.ndarray:
        """Return the stretch without stress at temperatures, of their shape.

        Raises:
            InputError: it is not above 0, or not known there.
        """


class GivenTemperature:
    """A temperature on the scene's own mesh, quadratic in each element.

    Args:
        given: an argument of `fields.values_at`.
        mesh: of the scene.

    Attributes:
        given: the argument `given`.
        T: the DOLFINx `Function` (P2). It never changes; `formingx.forms.temperature.Temperature` does.

    Raises:
        InputError: it is not given all over the body.
    """

    def __init__(self, given: Any, mesh: Mesh):
        self.given, self._text = given, "a function" if callable(given) and not hasattr(given, "check") else repr(given)
        self.mesh = mesh
        self.T = fem.Function(fem.functionspace(mesh.domain, ("Lagrange", 2)), name="temperature")
        points = of_space(self.T.function_space)
        self.T.x.array[:] = fields.values_at(given, points, mesh, "Scene: temperature")

    def in_cells(self, cells: np.ndarray, places: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Return the temperatures in some cells (local numbers) at points of the reference cell, shape (cells, q).

        Args:
            places: the points, shape (q, 2).
            values: coefficients in place of T.x.array, ghosts included, shape (..., n): the result is (..., cells, q).
        """
        space = self.T.function_space
        basis = space.element.basix_element.tabulate(0, places)[0, :, :, 0]
        return (self.T.x.array if values is None else values)[..., space.dofmap.list[cells]] @ basis.T

    def on(self, boundary: str) -> np.ndarray:
        """Return the temperatures at the nodes of T on a boundary, shape (n,), all ranks; collective."""
        nodes = fem.locate_dofs_topological(self.T.function_space, 1, self.mesh.facets_of(boundary))
        return gathered(self.mesh.comm, self.T.x.array[nodes])

    def __repr__(self) -> str:
        return self._text
