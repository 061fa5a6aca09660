"""The body as loads and elastic supports use it: the fields, and its integrals."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import ufl
from dolfinx import fem, la

from .. import _compat
from ..errors import InputError, known


class Face(NamedTuple):
    """A boundary of the body. normal: outward, in the reference configuration (UFL); measure: reference length;
    weight: area per length."""

    normal: Any
    measure: Any
    weight: Any

    def integral(self, integrand: Any) -> Any:
        """Return the integral (UFL) over the reference area."""
        return integrand * self.weight * self.measure


class LoadedBody:
    """The body of a scene as `Load.virtual_work` sees it, a solid or a membrane.

    Attributes:
        u, du, X: displacement, virtual displacement and reference position (UFL, length, shape (2,): components r, z).
        F: deformation gradient (UFL, shape (3, 3)).
        kinematics: the `Kinematics` of the scene.
        stress, length, volume: largest shear modulus, largest extent and reference volume, in the user's units.
    """

    def __init__(self, forms: Any):
        self._forms = forms
        self.u, self.du, self.X, self.F = forms.u, forms.test_displacement(), forms.X, forms.F
        self.kinematics = forms.scene.kinematics
        self.stress, self.length, self.volume = forms.stress, forms.length, forms.volume

    def integral(self, integrand: Any, layer: str | None = None) -> Any:
        """Return the integral (UFL) over the reference volume, of all layers or of one; per unit depth in plane
        strain."""
        layers = self._forms.mesh.layers
        if layer is not None:
            known("body.integral: layer", layer, layers)
        return self._forms.weighted(integrand, list(layers) if layer is None else [layer])

    def face(self, on: str, quadrature_degree: int = 5) -> Face:
        """Return a boundary by its name (of a membrane its lower or its upper face)."""
        normal, measure = self._forms.face(on, quadrature_degree)
        return Face(normal, measure, self.kinematics.weight(self.X))

    def constant(self, value: float) -> fem.Constant:
        """Return a number for a form, which is not compiled again when it changes."""
        return self._forms.constant(value)

    def thickness(self, boundary: str) -> float:
        """Volume of the body over the area of a boundary, length."""
        return self._forms.thickness(boundary)

    def stored(self, support: Any) -> Any:
        """Return the energy of a support, or None; raise an InputError unless it is a form without `body.du`."""
        form = support.stored_energy(self)
        if form is not None and (not isinstance(form, ufl.Form) or form.arguments()):
            raise InputError(f"{support!r}: stored_energy must return a UFL form without body.du, such as"
                             f" body.face(on).integral(k / 2 * body.u[1]**2); this is {str(form)[:60]}")
        return form

    def work(self, load: Any, value: Any) -> Any:
        """Return the virtual work of a load; raise an InputError unless it is a form that is linear in `du`."""
        form = load.virtual_work(self, value)
        if not isinstance(form, ufl.Form) or [v.number() for v in form.arguments()] != [0]:
            raise InputError(f"{load!r}: virtual_work must return a UFL form linear in body.du, such as"
                             f" body.integral(b * body.du[1]); this is {str(form)[:60]}")
        return form

    def unit(self, load: Any) -> float:
        """Return the value at which the nodal forces of a load in the reference configuration add up to stress times
        volume over length."""
        form = self._forms.compile(self.work(load, self.constant(1.0)))
        index_map = self._forms.space.dofmap.index_map
        forces = _compat.assemble_vector(la.vector(index_map, 1), form)
        total = self._forms.comm.allreduce(float(np.abs(forces).sum()))
        if not 0 < total < np.inf:
            raise InputError(f"{load!r}: a load of value 1 on the undeformed body has forces that add up to {total:g},"
                             f" so its size cannot be scaled: give it a method unit(body)")
        return self.stress * self.volume / total
