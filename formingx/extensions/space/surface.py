r"""Forms of a membrane in three dimensions: a surface of triangles that deforms, with its thickness as data.

The surface may be flat or curved in the reference configuration. Each triangle has its own orthonormal vectors t_1 and
t_2 in its plane. With the columns f_k = F t_k of the deformation gradient of the mid-surface, shape (3, 2), the
deformation gradient of the incompressible material is, up to a rotation,

.. math::
    F = \begin{pmatrix} |f_1| & f_1 \cdot f_2 / |f_1| & 0 \\ 0 & J / |f_1| & 0 \\ 0 & 0 & 1 / J \end{pmatrix},
    \qquad J = |f_1 \times f_2|

It has the block structure of a two-dimensional section, so every material accepts it. Displacements are linear in each
triangle. Quadratic elements gain nothing at a polygonal rim, and give vertices no tributary area. A flat unstretched
membrane has no stiffness normal to itself. A very small stiffness of the displacement gradient keeps its tangent
regular.

In compression a membrane wrinkles. With `Membrane(wrinkles=c)` its energy is

.. math:: c W + (1 - c) W_r

with the energy W of the material and the relaxed energy W_r of tension-field theory (Pipkin, IMA J. Appl. Math. 36
(1986) 85). The principal stretches in the surface are l1 >= l2. Where l2 is below the stretch l1^(-1/2) of simple
tension, W_r is the energy at that stretch; where l1 < 1 it is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from ...forms.energy_rule import EnergyRule
from ...forms.formulation import Formulation
from ...forms.membrane import FIRST_STRETCH
from ...forms.probes import Probe
from ...materials.solidification import Solidification
from ...physics.loads import Pressure
from ...values.tolerances import NEGLIGIBLE
from .crossing import SelfPenetration
from .heat.basis import ColumnBasis, basis_of
from .heat.linear import is_linear
from .heat.temperature import ColumnTemperature
from .pressure_on_tools import PressureOnTools
from .scene_checks import depends_on_direction
from .whole_surface import WholeSurface

_REGULARISING_STIFFNESS = 1e-7
"""Stiffness of the displacement gradient over the shear modulus."""

_DEPTHS, _DEPTHS_OF_SOLIDIFICATION = 5, 9
"""Number of Gauss points through a layer at which its energy is integrated, if the mean of its constants will not do.

Across a sheet of 75 degrees between its faces, in which a tenth has relaxed, 5 points are off by 0.5 % of the stress
(tests/test_warm_sheets.py). The solidified fraction has kinks over the temperature and needs more of them.
"""


class Surface(Formulation):
    """Residual forms of a membrane in three dimensions; the only unknown field is the displacement.

    thicknesses: {layer: reference thickness as a `Function`, length}.
    """

    singular_unloaded = True
    _on_tools: PressureOnTools | None = None

    def face(self, name: str, quadrature_degree: int) -> tuple[Any, ufl.Measure]:
        """Return the normal of a face (UFL, shape (3,)) and the measure over the reference area, of degree 1."""
        return self.mesh.faces[name] * self._axes[2], self.dx(metadata={"quadrature_degree": 1})

    def carried_forces(self, face: Any, fields: np.ndarray, control: float) -> np.ndarray | float:
        """Return the pressure forces on a tool between the m contact points of a face, shape (m, 3), stress length^2.

        They are 0 unless a pressure acts on a sheet that slides. fields: owned unknowns, shape (n,).
        """
        return 0.0 if self._on_tools is None else self._on_tools.carried_forces(face, fields, control)

    def _residual(self, body: Any) -> tuple[Any, Any, Any]:
        residual, by_control, by_time = super()._residual(body)
        pressures = [(load, value) for load, value in self.load_values if isinstance(load, Pressure)]
        if not pressures or all(contact.sticks for contact in self.scene.contacts):
            return residual, by_control, by_time
        self._on_tools = PressureOnTools(self)
        self.refreshed.append(self._on_tools)
        for load, value in pressures:
            face = body.face(load.on, load.quadrature_degree)
            area = self.scene.kinematics.area_vector(self.u, self.X, face.normal)
            applied = load.share(self) * value
            work = self._on_tools.work(applied, area, self._control)
            residual -= self._scale * work
            if load.driven or any(contact.driven for contact in self.scene.contacts):
                change = -self._scale * ufl.diff(work, self._control)
                by_control = change if by_control is None else by_control + change
        return residual, by_control, by_time

    def constraints(self, support: Any) -> list[Any]:
        return self.scene.kinematics.in_axes(support, support.constraints())

    def nearest(self, points: np.ndarray) -> np.ndarray:
        return self.mesh.nearest(points)

    def mid(self, layer: str, R: np.ndarray, Z: np.ndarray) -> np.ndarray:
        return Z

    def weighted(self, density: Any, layers: list[str], metadata: dict | None = None) -> Any:
        return density * sum(self.thicknesses[name] for name in layers) * (
            self.dx(metadata=metadata) if metadata else self.dx)

    def probe(self, problem: Any, points: Any) -> Probe:
        return Probe(problem, points)

    def admissible(self) -> Any:
        """Return the check of the volume ratio, which every state of a membrane passes."""
        return _AlwaysAdmissible()

    def set_stiff(self) -> None:
        """Set the unknowns to a small equal stretch in both directions, whose tension makes the tangent regular."""
        self.w.sub(0).interpolate(lambda X: FIRST_STRETCH / self.length * X)

    @cached_property
    def whole(self) -> WholeSurface:
        """Triangles of the surface on all ranks."""
        return WholeSurface(self)

    @cached_property
    def self_penetration(self) -> SelfPenetration:
        """Check of states for layers that cross each other or a plane of symmetry."""
        return SelfPenetration(self)

    def area_row(self, deformed: bool = False) -> Any:
        """Return the linear form (UFL) of nodes' areas, length^2, in the first of their three entries, else 0."""
        ratio = self.F[0, 0] * self.F[1, 1] if deformed else 1
        return ratio * ufl.split(self.test_function())[0][0] * self.dx(metadata={"quadrature_degree": 1})

    @cached_property
    def deformed_area(self) -> Any:
        """Compiled linear form of the deformed tributary areas of nodes (`area_row`)."""
        return self.compile(self.area_row(deformed=True))

    @property
    def heat_history(self) -> Any:
        """Class of the history of temperatures of a sheet with heat conduction (`Cooling`)."""
        from .heat.column_history import ColumnHistory
        return ColumnHistory

    @property
    def energy_balance(self) -> Any:
        """Class of the energy balance of a sheet."""
        from .sheet_balance import SheetBalance
        return SheetBalance

    @cached_property
    def _columns(self) -> ColumnBasis | None:
        """Basis of the temperatures through the thickness; None without heat conduction."""
        return None if self.scene.heat is None else basis_of(self.scene, self.scene.heat.materials)

    @cached_property
    def energy_depths(self) -> int:
        """Number of depths of each layer at which its energy is integrated; 0 if the mean of the constants will do."""
        if self._columns is None or all(is_linear(self.scene, name) for name in self.scene.mesh.layers):
            return 0
        solidifies = any(isinstance(material, Solidification) for material in self.scene.materials.values())
        return _DEPTHS_OF_SOLIDIFICATION if solidifies else _DEPTHS

    def _energy_rule(self) -> EnergyRule:
        rule = super()._energy_rule()
        if self._columns is None or not self.energy_depths:
            return rule
        return rule.through(next(iter(self._columns.layers.values())).gauss(self.energy_depths)[1])

    def _make_temperature(self) -> Any:
        if self._columns is None:
            return super()._make_temperature()
        return ColumnTemperature(self.scene.temperature, self, self._columns)

    def temperatures(self, terms: Any) -> np.ndarray:
        """Return the temperatures at the quadrature points of `terms`, now and before, shape (1 or 2, cells, q).

        If the mean of the constants will do, the temperatures of the m points of a column follow in a fourth index.
        """
        if self._columns is None:
            return super().temperatures(terms)
        layer, n = self._columns.layers[terms.names[0]], self.energy_depths
        found = self.temperature.last_two_states(terms.cells, terms.places[:: n or 1], terms.names[0])
        if not n:
            return found
        return (found @ layer.gauss(n)[2].T).reshape(*found.shape[:2], -1)

    def mean_over_depths(self, law: Callable, terms: Any) -> Callable:
        if self._columns is None or self.energy_depths:
            return law
        weights = self._columns.layers[terms.names[0]].weights
        return lambda T: law(T) @ weights

    def _make_mesh(self) -> Any:
        return self.scene.mesh

    def _elements(self, cell: Any) -> tuple[Any, list[Any]]:
        element = basix.ufl.element("Lagrange", cell, 1)
        return element, [basix.ufl.blocked_element(element, shape=(3,))]

    def _weight(self) -> Any:
        space, self.thicknesses = fem.functionspace(self.domain, ("Lagrange", 1)), {}
        for name, given in self.scene.thickness.items():
            h = self.thicknesses[name] = fem.Function(space, name=f"thickness of {name}")
            h.interpolate(lambda X, given=given: given(*X))
        return sum(self.thicknesses.values())

    def _deformation_gradient(self) -> Any:
        """Return F of the incompressible membrane, rotated to upper triangular form (UFL, shape (3, 3)).

        Its axes: along the deformed first edge, across it in the surface, and along the normal.
        """
        F = self.scene.kinematics.deformation_gradient(self.u, self.X)
        f1, f2 = (F * t for t in self._axes[:2])
        n = ufl.cross(f1, f2)
        l1, J = ufl.sqrt(ufl.inner(f1, f1)), ufl.sqrt(ufl.inner(n, n))
        return ufl.as_tensor([[l1, ufl.inner(f1, f2) / l1, 0], [0, J / l1, 0], [0, 0, 1 / J]])

    def law_axes(self, material: Any, names: list[str]) -> Callable:
        """Return the function that refers F to directions of the surface, for an energy that depends on the direction.

        The energies of other materials take F in the axes of each triangle.
        """
        return self._in_directions if depends_on_direction(self.scene, names[0]) else super().law_axes(material, names)

    def _in_directions(self, F: Any) -> Any:
        """Return an F of the axes of each triangle, referred to a first direction in the surface, normal and a second.

        Its rows are the deformed first axis, the normal and the other axis (UFL, shape (3, 3)).
        """
        t1, t2, normal = self._axes
        d1, d2 = self._directions
        side = ufl.inner(normal, ufl.cross(d1, d2))          # -1 keeps det F positive
        a, b = ([F[i, 0] * ufl.inner(t1, d) + F[i, 1] * ufl.inner(t2, d) for d in (d1, d2)] for i in (0, 1))
        return ufl.as_tensor([[a[0], 0, a[1]], [0, F[2, 2], 0], [side * b[0], 0, side * b[1]]])

    @property
    def _directions(self) -> tuple[Any, Any]:
        """Unit vectors in the surface to which laws refer (UFL, shape (3,) each).

        They are x and y on a flat sheet or horizontal triangle, else the steepest line up and the horizontal.
        """
        x, y, z = (ufl.as_vector([float(i == k) for k in range(3)]) for i in range(3))
        if self.mesh.flat:
            return x, y
        normal = self._axes[2]
        level = ufl.cross(z, normal)
        size = ufl.sqrt(ufl.inner(level, level))
        steep = ufl.gt(size, NEGLIGIBLE)
        level = level / ufl.conditional(steep, size, 1.0)
        upward = ufl.cross(normal, level)
        return tuple(ufl.as_vector([ufl.conditional(steep, a[i], b[i]) for i in range(3)])
                     for a, b in ((upward, x), (level, y)))

    @cached_property
    def _axes(self) -> tuple[Any, Any, Any]:
        """Reference unit vectors of each triangle: along its first edge, across it, along the normal (UFL, (3,))."""
        J = ufl.Jacobian(self.domain)
        edge, other = (ufl.as_vector([J[i, k] for i in range(3)]) for k in (0, 1))
        first, normal = edge / ufl.sqrt(ufl.inner(edge, edge)), ufl.cross(edge, other)
        normal = normal / ufl.sqrt(ufl.inner(normal, normal))
        return first, ufl.cross(normal, first), normal

    def _groups(self) -> list[tuple[Any, list[str]]]:
        return [(material, [name]) for name, material in self.scene.materials.items()]

    def _energy(self, of: Any) -> Any:
        grad = ufl.grad(self.u)
        energy = self.constant(_REGULARISING_STIFFNESS * self.stress) / 2 * ufl.inner(grad, grad)
        energy = self.weighted(self._scale * energy, list(self.thicknesses))
        for terms in self._terms.values():
            energy += self.weighted(self._scale * self.layer_energy(partial(of, terms), self.F), terms.names)
        return energy

    def layer_energy(self, of: Callable, F: Any) -> Any:
        """Return the energy of a layer per reference volume (UFL, stress): of(F), or its mixture if it wrinkles."""
        left = self.scene.model.wrinkles
        if left is None:
            return of(F)
        c = self.constant(left)
        return c * of(F) + (1 - c) * of(relaxed(F))

    @property
    def frame(self) -> tuple[Any, Any, Any]:
        """Unit vectors of each deformed triangle: along its first edge, across it, along its normal (UFL, (3,))."""
        F = self.scene.kinematics.deformation_gradient(self.u, self.X)
        f1, f2 = (F * t for t in self._axes[:2])
        first, normal = f1 / ufl.sqrt(ufl.inner(f1, f1)), ufl.cross(f1, f2)
        normal = normal / ufl.sqrt(ufl.inner(normal, normal))
        return first, ufl.cross(normal, first), normal


class _AlwaysAdmissible:
    """Check of the volume ratio for membranes, in place of `Admissible`: every state passes, since J > 0."""

    def holds(self) -> bool:
        """Return True: the volume ratio of a membrane is positive in every state."""
        return True

    def extreme_volume_ratio(self) -> None:
        """Return None: the volume of a membrane is constant."""
        return None


def relaxed(F: Any) -> Any:
    r"""Return the F whose energy is the relaxed energy of tension-field theory (UFL, shape (3, 3)).

    Where the membrane is taut, it is F. Where it wrinkles, it is the stretch tensor U of simple tension with the larger
    principal stretch l1 of F, along the same direction; where both stretches are compressive, it is the identity. With
    the angle a of this direction from the first axis and l2 = l1^(-1/2)

    .. math:: U = \frac{l_1 + l_2}{2} I + \frac{l_1 - l_2}{2}
        \begin{pmatrix} \cos 2a & \sin 2a \\ \sin 2a & -\cos 2a \end{pmatrix}

    The direction matters for materials whose internal variables are tensors. F: upper triangular, third axis normal.
    """
    C11, C22, C12 = F[0, 0]**2, F[0, 1]**2 + F[1, 1]**2, F[0, 0] * F[0, 1]
    J = F[0, 0] * F[1, 1]
    squared = ((C11 - C22) / 2) ** 2 + C12**2
    half = ufl.sqrt(ufl.conditional(ufl.lt(squared, 1e-24), 1e-24, squared))       # finite where stretches coincide
    largest = (C11 + C22) / 2 + half                                               # l1^2
    taut = ufl.Or(ufl.gt(J**2, ufl.sqrt(largest)), ufl.lt(squared, 1e-24))          # l2 > l1^(-1/2)
    taut = ufl.And(taut, ufl.gt(largest, 1))
    l1 = ufl.sqrt(ufl.conditional(ufl.gt(largest, 1), largest, 1))
    l2 = 1 / ufl.sqrt(l1)
    mean, deviation = (l1 + l2) / 2, (l1 - l2) / 2
    cos, sin = (C11 - C22) / 2 / half, C12 / half

    def select(a: Any, b: Any) -> Any:
        """Return the UFL expression a where the membrane is taut, else b."""
        return ufl.conditional(taut, a, b)
    return ufl.as_tensor([[select(F[0, 0], mean + deviation * cos), select(F[0, 1], deviation * sin), 0],
                          [select(0, deviation * sin), select(F[1, 1], mean - deviation * cos), 0],
                          [0, 0, select(F[2, 2], l2)]])


def smaller_stress(stretches: np.ndarray) -> np.ndarray:
    """Return l2^2 - (l1 l2)^-2, (n,), of stretches (n, 2), l1 first: the smaller neo-Hookean stress over modulus.

    In compression it is negative for other materials, too.
    """
    return stretches[:, 1] ** 2 - stretches.prod(axis=1) ** -2


def wrinkled(stretches: np.ndarray) -> np.ndarray:
    """Return the mask (n,) of wrinkles: `smaller_stress` < -1e-3, which leaves out elastic slip on a flat tool."""
    return smaller_stress(stretches) < -NEGLIGIBLE
