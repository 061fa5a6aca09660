"""Body as loads and elastic supports see it: fields and integrals."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import ufl
from dolfinx import fem, la

from .. import _compat
from ..errors import InputError, check_name


class Face(NamedTuple):
    """Boundary of the body on which a load or an elastic support acts.

    Attributes:
        normal: outward normal in the reference configuration (UFL, shape (2,)).
        measure: UFL measure of the reference boundary.
        weight: reference area per length of the boundary (UFL scalar): 2 pi R if axisymmetric, in plane strain 1.
    """

    normal: Any
    measure: Any
    weight: Any

    def integral(self, integrand: Any) -> Any:
        """Return an integral over the reference area of the boundary; per unit depth in plane strain.

        Args:
            integrand: value per reference area (UFL scalar).

        Returns:
            The integral (UFL form).
        """
        return integrand * self.weight * self.measure


class LoadedBody:
    """Body as the argument of `Load.virtual_work` and `Support.stored_energy`: its fields and integrals.

    Attributes:
        u: displacement (UFL, length, shape (2,): components r, z).
        du: virtual displacement (UFL, length, shape (2,)).
        X: reference position (UFL, length, shape (2,)).
        F: deformation gradient (UFL, shape (3, 3)).
        kinematics: the `Kinematics` of the scene.
        stress: largest shear modulus, stress.
        length: largest extent, length.
        volume: reference volume, length^3; in plane strain per depth, length^2.
    """

    def __init__(self, forms: Any):
        self._forms = forms
        self.u, self.du, self.X, self.F = forms.u, forms.test_displacement(), forms.X, forms.F
        self.kinematics = forms.scene.kinematics
        self.stress, self.length, self.volume = forms.stress, forms.length, forms.volume

    def integral(self, integrand: Any, layer: str | None = None) -> Any:
        """Return an integral over the reference volume; per unit depth in plane strain.

        Args:
            integrand: value per reference volume (UFL scalar).
            layer: name of a layer; None for all layers.

        Returns:
            The integral (UFL form).
        """
        layers = self._forms.mesh.layers
        if layer is not None:
            check_name("body.integral: layer", layer, layers)
        return self._forms.weighted(integrand, list(layers) if layer is None else [layer])

    def face(self, on: str, quadrature_degree: int = 5) -> Face:
        """Return a boundary of the body, for the integrals of a load or an elastic support.

        Args:
            on: name of the boundary; for a membrane its lower or its upper face.
            quadrature_degree: degree of the quadrature on it.

        Returns:
            The `Face`.
        """
        normal, measure = self._forms.face(on, quadrature_degree)
        return Face(normal, measure, self.kinematics.weight(self.X))

    def constant(self, value: float) -> fem.Constant:
        """Return a UFL constant; a new value needs no new compilation of the forms that contain it.

        Args:
            value: initial value.

        Returns:
            The `Constant`.
        """
        return self._forms.constant(value)

    def thickness(self, boundary: str) -> float:
        """Return the mean thickness of the body behind a boundary.

        Args:
            boundary: name of the boundary.

        Returns:
            Reference volume of the body divided by the reference area of the boundary, length.
        """
        return self._forms.thickness(boundary)

    def stored(self, support: Any) -> Any:
        """Return the stored energy of an elastic support (UFL, rank 0, user's units), or None; else an InputError."""
        form = support.stored_energy(self)
        if form is not None and (not isinstance(form, ufl.Form) or form.arguments()):
            raise InputError(f"{support!r}: stored_energy must return a UFL form without body.du, such as"
                             f" body.face(on).integral(k / 2 * body.u[1]**2); this is {str(form)[:60]}")
        return form

    def work(self, load: Any, value: Any) -> Any:
        """Return the virtual work of a load at a value (UFL, rank 1, user's units).

        If it is not linear in `du`, it is an InputError.
        """
        form = load.virtual_work(self, value)
        if not isinstance(form, ufl.Form) or [v.number() for v in form.arguments()] != [0]:
            raise InputError(f"{load!r}: virtual_work must return a UFL form linear in body.du, such as"
                             f" body.integral(b * body.du[1]); this is {str(form)[:60]}")
        return form

    def unit(self, load: Any) -> float:
        r"""Return the unit of a load, in the user's units: its value divided by its dimensionless amplitude.

        In the reference configuration, the nodal forces :math:`f_i` of a unit load add up to

        .. math:: \sum_i |f_i| = \frac{\mu V}{L}

        with the largest shear modulus mu (`stress`), the volume V and the largest extent L (`length`). Forces that
        vanish or are not finite are an InputError.
        """
        form = self._forms.compile(self.work(load, self.constant(1.0)))
        index_map = self._forms.space.dofmap.index_map
        forces = _compat.assemble_vector(la.vector(index_map, 1), form)
        total = self._forms.comm.allreduce(float(np.abs(forces).sum()))
        if not 0 < total < np.inf:
            raise InputError(f"{load!r}: a load of value 1 on the undeformed body has forces that add up to {total:g},"
                             f" so its size cannot be scaled: give it a method unit(body)")
        return self.stress * self.volume / total
