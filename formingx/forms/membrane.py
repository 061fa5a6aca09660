r"""Scene as a membrane: the mid-surface as a line, the thickness as data (Adkins and Rivlin 1952).

The stretches are the meridional one, along the reference arc length S, and the hoop stretch, which is 1 in plane
strain. The energy per reference area of the mid-surface is summed over the layers of thickness h:

.. math::
    \Psi = \sum h \, W\!\left(\lambda_1, \lambda_2, \frac{1}{\lambda_1 \lambda_2}\right), \qquad
    \lambda_1 = \left|\frac{dx}{dS}\right|, \quad \lambda_2 = \frac{r}{R}

The volume is preserved exactly without a pressure field. The follower pressure acts on the mid-surface.

A flat unstretched membrane has no stiffness normal to itself: its pressure grows with the cube of the pole height. A
path therefore leaves the reference configuration along the deflection under a vanishing tension. Every state on the
path solves the unchanged equations.
"""

from __future__ import annotations

from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dolfinx_mesh

from .. import _compat
from ..errors import InputError
from ..mesh.mesh import Mesh
from ..mesh.nodes import cell_node_positions, own_cells
from ..physics.supports import Constrained
from ..ranks import gathered
from .formulation import Formulation
from .probes import MidSurfaceProbe

FIRST_STRETCH = 1e-6
"""Stretch for the first direction of a path; no state is solved for at this stretch."""


class MidSurface(Formulation):
    """Forms of a scene as a membrane; the only field is the displacement of the mid-surface.

    A sheet that is no graph over R, or a load or support not on a face or an end, is an InputError.

    Attributes:
        thicknesses: {layer: thickness along Z in the reference configuration (`Function`, length)}.
    """

    singular_unloaded = True

    @property
    def bodies(self) -> list[tuple[Any, list[str]]]:
        """Undefined for a membrane: raises `InputError`."""
        raise InputError("a membrane has no stress through its thickness, nor between its layers: use a solid model,"
                         " MixedPressure()")

    def face(self, name: str, quadrature_degree: int) -> tuple[Any, ufl.Measure]:
        """Return the normal (UFL, (2,)) away from a whole face, else an InputError, and the mid-surface's measure."""
        nodes = self.scene.mesh.nodes_of(name)
        near = 1e-8 * self.length
        whole = len(nodes) and np.allclose([nodes[0, 0], nodes[-1, 0]], [self._R[0], self._R[-1]], rtol=0, atol=near)
        for side, Z in ((-1.0, self._low), (1.0, self._high)):
            if whole and np.abs(nodes[:, 1] - np.interp(nodes[:, 0], self._R, Z)).max() < near:
                t = self._tangent
                return side * ufl.as_vector([-t[1], t[0]]), self.dx(metadata={"quadrature_degree": quadrature_degree})
        raise InputError(f"boundary {name!r}: a membrane takes loads on the whole of its lower or of its upper face"
                         f" only")

    def constraints(self, support: Any) -> list[Any]:
        """Return the constraints of a support at an end, whose mean is a single point; elsewhere: InputError."""
        items = [c if isinstance(c, Constrained) else Constrained(c.component, on=c.on) for c in support.constraints()]
        for item in items:
            if item.on is not None and item.on not in self.mesh.boundaries:
                raise InputError(f"{support!r}: a membrane can be held at its ends only, which are"
                                 f" {list(self.mesh.boundaries)}")
        return items

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Return the points of the mid-surface at the same R, shape (n, 2), length."""
        R = np.asarray(points, dtype=float)[:, 0]
        return np.column_stack([R, np.interp(R, self._R, (self._low + self._high) / 2)])

    def mid(self, layer: str, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        """Return the heights halfway between the faces of a layer at radii R, shape (n,), length."""
        low, high = self._ends[layer]
        return np.interp(R, self._R, (low + high) / 2)

    def weighted(self, density: Any, layers: list[str], metadata: dict | None = None) -> Any:
        dx = self.dx(metadata=metadata) if metadata else self.dx
        return sum(density * self.thicknesses[name] * self._area() * dx for name in layers)

    def cells_of(self, layers: list[str]) -> np.ndarray:
        topology = self.domain.topology
        return np.arange(topology.index_map(1).size_local + topology.index_map(1).num_ghosts, dtype=np.int32)

    def temperatures(self, terms: Any) -> np.ndarray:
        """Return the temperatures halfway between the faces of a layer, shape (1, cells, q); they stay constant."""
        nodes = cell_node_positions(self.domain, terms.cells)
        geometry = basix.ufl.element("Lagrange", "interval", _compat.coordinate_map(self.domain).degree)
        shapes: Any = geometry.tabulate(0, terms.places)
        R, Z = np.einsum("qk,nkd->dnq", shapes[0], nodes)
        points = np.column_stack([R.ravel(), self.mid(terms.names[0], R.ravel(), Z.ravel())])
        return self.temperature.at_points(points).reshape(1, *R.shape)

    def probe(self, problem: Any, points: Any) -> MidSurfaceProbe:
        return MidSurfaceProbe(problem, points)

    def set_stiff(self) -> None:
        """Set `w` to a small stretch in all directions, whose tension makes the tangent regular (`Formulation`)."""
        self.w.sub(0).interpolate(lambda X: FIRST_STRETCH / self.length * X[:self.scene.kinematics.components])

    def _make_mesh(self) -> Mesh:
        """Return the line halfway between the two faces, with a node at the R of each node of the lower face."""
        mesh = self.scene.mesh
        comm = mesh.comm
        if "bottom" not in mesh.boundaries:
            raise InputError(f"Membrane: the mesh needs a boundary named 'bottom'; it has {list(mesh.boundaries)}")
        R = self._R = mesh.nodes_of("bottom")[:, 0]
        near = 1e-9 * self.length
        self._ends = {name: _faces(mesh, name, R, near) for name in mesh.layers}
        self._low = np.min([low for low, _ in self._ends.values()], axis=0)
        self._high = np.max([high for _, high in self._ends.values()], axis=0)
        self._layers = {name: np.maximum(high - low, 0.0) for name, (low, high) in self._ends.items()}
        if np.any(np.diff(R) < near) or not np.all(self._high - self._low > near):
            raise InputError("Membrane: the sheet must have a single lower and upper point at each R")
        degree = _compat.coordinate_map(mesh.domain).degree
        first = np.arange(0, len(R) - degree, degree)
        cells = np.column_stack([first, first + degree, *([first + 1] if degree == 2 else [])])
        points = np.column_stack([R, (self._low + self._high) / 2])
        if comm.rank:
            cells, points = cells[:0], points[:0]
        element = basix.ufl.element("Lagrange", "interval", degree, shape=(points.shape[1],))
        domain = dolfinx_mesh.create_mesh(comm, cells=cells.astype(np.int64), x=points, e=element)
        domain.topology.create_connectivity(0, 1)
        ends, tags = [], []
        for tag, end in enumerate((R[0], R[-1]), 1):
            found = dolfinx_mesh.locate_entities(domain, 0, lambda X, end=end: np.abs(X[0] - end) < near)
            ends.append(found)
            tags.append(np.full(len(found), tag, dtype=np.int32))
        numbers, order = np.unique(np.concatenate(ends).astype(np.int32), return_index=True)
        facets = dolfinx_mesh.meshtags(domain, 0, numbers, np.concatenate(tags)[order])
        boundaries: dict[str, tuple[int, ...]] = {}
        for name in mesh.boundaries:
            at = mesh.nodes_of(name)[:, 0]
            for tag, end in enumerate((R[0], R[-1]), 1):
                if len(at) and np.all(np.abs(at - end) < near):
                    boundaries[name] = (tag,)
        return Mesh(domain, None, facets, mesh.layers, boundaries, comm)

    def _elements(self, cell: Any) -> tuple[Any, list[Any]]:
        element = basix.ufl.element("Lagrange", cell, 2)
        return element, [basix.ufl.blocked_element(element, shape=(self.scene.kinematics.components,))]

    def _weight(self) -> Any:
        """Return the reference volume per arc length of the mid-surface: 2 pi R (plane strain: 1) times thickness."""
        direction = ufl.Jacobian(self.domain)[:, 0]
        direction = direction / ufl.sqrt(ufl.inner(direction, direction))
        self._tangent = ufl.sign(direction[0]) * direction                     # towards growing R
        space = fem.functionspace(self.domain, ("Lagrange", 2))
        self.thicknesses = {}
        for name, values in self._layers.items():
            h = self.thicknesses[name] = fem.Function(space, name=f"thickness of {name}")
            h.interpolate(lambda X, values=values: np.interp(X[0], self._R, values))
        return self._area() * sum(self.thicknesses.values())

    def _area(self) -> Any:
        """Return the factor from a thickness along Z to the reference volume per arc length S: (2 pi R or 1) dR/dS."""
        return self.scene.kinematics.weight(self.X) * self._tangent[0]

    def _deformation_gradient(self) -> Any:
        """Return diag(l1, 1/(l1 l2), l2), with the stretches along meridian, normal and circumference (hoop)."""
        F = self.scene.kinematics.deformation_gradient(self.u, self.X)         # of the surface: its normal is kept
        t = F * ufl.as_vector([self._tangent[0], self._tangent[1], 0])
        l1, l2 = ufl.sqrt(ufl.inner(t, t)), F[2, 2]
        return ufl.diag(ufl.as_vector([l1, 1 / (l1 * l2), l2]))

    def _groups(self) -> list[tuple[Any, list[str]]]:
        return [(material, [name]) for name, material in self.scene.materials.items()]

    def _energy(self, density: Any) -> Any:
        return sum(self.weighted(self._scale * density(terms, self.F), terms.names) for terms in self._terms.values())


def _faces(mesh: Mesh, layer: str, R: np.ndarray, near: float) -> tuple[np.ndarray, np.ndarray]:
    """Return lowest and highest Z of a layer at ascending R, (n,) each, equal within `near`; (inf, -inf) without."""
    cells = mesh.cells.find(mesh.layers[layer])
    nodes = cell_node_positions(mesh.domain, cells[cells < len(own_cells(mesh.domain))])
    edges = [(1, 2, 3), (0, 2, 4), (0, 1, 5)]                                  # ends, and the node between them
    halves = [(a, b) for a, b, _ in edges]
    if nodes.shape[1] == 6:
        halves = [pair for a, b, m in edges for pair in ((a, m), (m, b))]
    pieces = np.concatenate([nodes[:, pair] for pair in (*halves, *((b, a) for a, b in halves))])
    pieces = gathered(mesh.comm, pieces)
    first = np.searchsorted(R, pieces[:, :, 0].min(axis=1) - near)
    last = np.searchsorted(R, pieces[:, :, 0].max(axis=1) + near)
    which = np.repeat(np.arange(len(pieces)), last - first)                    # every piece meets some of the R
    at = np.arange(len(which)) - np.repeat(np.cumsum(last - first) - (last - first), last - first) + first[which]
    (Ra, Za), (Rb, Zb) = pieces[which, 0].T, pieces[which, 1].T
    steep = np.abs(Rb - Ra) < near
    Z = Za + (Zb - Za) * np.clip(np.where(steep, 0.0, (R[at] - Ra) / np.where(steep, 1.0, Rb - Ra)), 0, 1)
    low, high = np.full(len(R), np.inf), np.full(len(R), -np.inf)
    np.minimum.at(low, at, Z)
    np.maximum.at(high, at, Z)
    return low, high
