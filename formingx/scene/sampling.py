"""Quadrature points of a layer, at which material constants that vary over the body are checked."""

from typing import Any

import basix
import basix.ufl
import numpy as np

from .. import _compat
from ..materials.constants import Sample
from ..mesh.mesh import Mesh
from ..mesh.nodes import cell_node_positions, own_cells
from .temperature import GivenTemperature


def sample(mesh: Mesh, layer: str, degree: int, temperature: GivenTemperature | None = None) -> Sample:
    """Return the quadrature points of a degree in the owned cells of a layer, cell by cell.

    In m cells with q points each: positions (m q, 2 or 3), length, cells (m,), places in the reference cell (q, 2),
    temperatures (m q,) or None.
    """
    domain = mesh.domain
    cells = mesh.cells.find(mesh.layers[layer])
    cells = np.sort(cells[cells < len(own_cells(domain))])
    places: Any = basix.make_quadrature(basix.CellType.triangle, degree)[0]
    geometry = basix.ufl.element("Lagrange", "triangle", _compat.coordinate_map(domain).degree)
    shapes: Any = geometry.tabulate(0, places)
    nodes = cell_node_positions(domain, cells)
    T = None if temperature is None else temperature.in_cells(cells, places).ravel()
    return Sample(np.einsum("qk,nkd->nqd", shapes[0], nodes).reshape(-1, nodes.shape[-1]), cells, places, domain, T)
