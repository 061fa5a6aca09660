"""Initial temperature of the body of a scene as a field on the mesh, and the interface of thermal expansion."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
from dolfinx import fem
from numpy.typing import ArrayLike

from ..mesh import Mesh
from ..mesh.nodes import dof_positions
from ..ranks import gathered
from . import fields


@runtime_checkable
class Expansion(Protocol):
    """Interface of a law of thermal expansion, such as `ThermalExpansion`."""

    def stretch(self, temperature: ArrayLike) -> np.ndarray:
        """Return the stress-free stretch of the material at given temperatures.

        Args:
            temperature: temperatures, any shape.

        Returns:
            Stretches, the shape of `temperature`.

        Raises:
            InputError: a stretch is not positive, or is unknown at a temperature.
        """


class GivenTemperature:
    """Temperature of the body that a scene gives, interpolated to quadratic elements on the mesh.

    A temperature that is not defined all over the body is an InputError.

    Attributes:
        given: the argument `given`.
        mesh: the argument `mesh`.
        T: DOLFINx `Function` (P2) with the given temperature; the changing temperature of a run is a
            `formingx.forms.temperature.Temperature`.
    """

    def __init__(self, given: Any, mesh: Mesh):
        self.given, self._text = given, "a function" if callable(given) and not hasattr(given, "check") else repr(given)
        self.mesh = mesh
        self.T = fem.Function(fem.functionspace(mesh.domain, ("Lagrange", 2)), name="temperature")
        points = dof_positions(self.T.function_space)
        self.T.x.array[:] = fields.values_at(given, points, mesh, "Scene: temperature")

    def in_cells(self, cells: np.ndarray, places: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Return temperatures (..., m, q) at q places (q, 2) of m cells, of `values` (..., n) or of `T`."""
        space = self.T.function_space
        basis = space.element.basix_element.tabulate(0, places)[0, :, :, 0]
        return (self.T.x.array if values is None else values)[..., space.dofmap.list[cells]] @ basis.T

    def at_boundary(self, boundary: str) -> np.ndarray:
        """Return the temperatures at the nodes of a boundary of all ranks, shared ones repeated, (n,); collective."""
        nodes = fem.locate_dofs_topological(self.T.function_space, 1, self.mesh.facets_of(boundary))
        return gathered(self.mesh.comm, self.T.x.array[nodes])

    def __repr__(self) -> str:
        return self._text
