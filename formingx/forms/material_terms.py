"""A material in the forms: its constants as coefficients, its internal variables, its energies."""

from __future__ import annotations

from typing import Any

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from ..errors import InputError
from ..materials.constants import Varying
from ..materials.tensors import isochoric
from ..mesh.nodes import own_cells
from .followed import Followed


class MaterialTerms:
    """One material of some layers.

    Args:
        forms: the `Formulation`.

    Attributes:
        constants: {name: coefficient}: a `Constant` for a number; for a varying coefficient a `Function` or another
            UFL scalar.
        rest_stress: stress that the energy leaves at F = I (UFL scalar).
        internal: {name: `Function` of a quadrature element} of the internal variables at the beginning of the step.
        held: {name: `Function` of a quadrature element} of an integral over past states at the present fields
            (`IntegralLaw.coefficients`).
        start: the process time at the beginning of the step (`Constant`).
        cells, own_cells: local numbers of its cells, with ghosts, and the locally owned ones.
        places: quadrature points of the energy in the reference cell, shape (q, dimension).
    """

    def __init__(self, forms: Any, material: Any, names: list[str]):
        self.forms, self.material, self.names = forms, material, names
        self.cells = forms.cells_of(names)
        self.own_cells = self.cells[self.cells < len(own_cells(forms.domain))]
        self.X = forms.X
        self._followed: list[Followed] = []
        cell, degree = forms.domain.basix_cell(), forms.scene.quadrature_degree
        self.places = basix.make_quadrature(cell, degree)[0]
        self.start = forms.constant(0.0)
        self.constants = {name: self._constant(name, value) for name, value in material.constants().items()}
        self.rest_stress = self._rest_stress(self.constants) if material.varies else forms.constant(
            material.rest_stress)
        self.internal = {name: self.quadrature_function(np.shape(value)) for name, value in material.internal.items()}
        self.held = {name: self.quadrature_function(np.shape(value)) for name, value in
                     (material.integral.coefficients if material.integral else {}).items()}

    def _constant(self, name: str, value: Any) -> Any:
        self._in_middle = name in self.material.of_flow
        return value.expression(self) if isinstance(value, Varying) else self.forms.constant(value)

    @property
    def follows_temperature(self) -> bool:
        """True if a constant depends on the temperature."""
        return bool(self._followed)

    @property
    def remembers(self) -> bool:
        """True if the stress of the material depends on more than the deformation."""
        return bool(self.internal or self.held)

    def quadrature_function(self, shape: tuple[int, ...] = ()) -> fem.Function:
        """Return a `Function` with a value of a shape at every quadrature point of the energy."""
        element = basix.ufl.quadrature_element(self.forms.domain.basix_cell(), value_shape=shape, scheme="default",
                                               degree=self.forms.scene.quadrature_degree)
        return fem.Function(fem.functionspace(self.forms.domain, element))

    def of_position(self, function: Any) -> fem.Function:
        """f(R, Z) at the quadrature points of the energy, exactly."""
        found, layer, brought = self.quadrature_function(), self.names[0], self.forms.scene.preformed

        def values(X: np.ndarray) -> np.ndarray:
            R, Z = X[:2] if brought is None else brought.first_places(X[:2].T).T
            return function(R, self.forms.mid(layer, R, Z))
        found.interpolate(values, self.cells)
        return found

    def of_temperature(self, function: Any) -> Any:
        """f(T) at the quadrature points of the energy, exactly, at the end of a step, or in its middle."""
        forms, found = self.forms, self.quadrature_function()
        law = getattr(function, "clamped", function)          # a user's own constant may be any function
        followed = Followed(forms, found, [(self.cells, law)], [forms.temperatures(self)])
        self._followed.append(followed)
        return followed.at(forms.time - (self._time_step / 2 if self._in_middle else 0))

    def take_temperature(self) -> None:
        """Update the constants to a changed temperature.

        Raises:
            InputError: a constant has no finite value at a temperature.
        """
        temperatures = [self.forms.temperatures(self)] if self._followed else []
        for followed in self._followed:
            followed.take(temperatures)

    def of_mesh(self, expression: Any) -> Any:
        """Return a UFL scalar of the scene's mesh, where the fields live on it."""
        if self.forms.domain is not self.forms.scene.mesh.domain:
            raise InputError(f"{self.material}: a membrane has its own mesh: give the constant as a function of"
                             f" (R, Z)")
        return expression

    def step_energy(self, F: Any) -> Any:
        """Return the potential of the step, per reference volume (UFL, stress)."""
        if not self.remembers:
            return self.material.strain_energy(F, **self.constants)
        return self.material.step_energy(F, self.internal | self.held, self._time_step, **self.constants)

    def stored_energy(self, F: Any) -> Any:
        """Return the energy that is stored, per reference volume (UFL, stress)."""
        if not self.remembers:
            return self.material.strain_energy(F, **self.constants)
        return self.material.stored_energy(F, self.internal | self.held, **self.constants)

    def unsymmetric_work(self, F: Any, derivative: Any) -> Any:
        """Virtual work beside the step's potential, per reference volume (UFL, stress), or None.

        derivative: a function that returns the virtual change of a UFL expression.
        """
        if self.material.symmetric:
            return None
        C = isochoric(F)
        return self.material.integral.unsymmetric_work(C, [derivative(c) for c in C], self.held)

    def equilibrium_energy(self, F: Any) -> Any:
        """Return the energy that is left when all has relaxed, per reference volume (UFL, stress), or None."""
        return self.material.equilibrium_energy(F, **self.constants)

    def elastic_stretches(self, F: Any) -> list[Any]:
        """Return the largest principal elastic stretch of each relaxing branch (UFL)."""
        return self.material.elastic_stretches(F, self.internal, **self.constants)

    def dissipation(self, F: Any) -> Any:
        """Return the power that is dissipated, per reference volume (UFL, stress over time)."""
        return self.material.dissipation(F, self.internal, **self.constants)

    def damage_energy(self) -> Any:
        """Return the energy that damage has cost, per reference volume (UFL, stress)."""
        return self.material.damage_energy(self.internal, **self.constants)

    def updated(self, F: Any) -> dict[str, Any]:
        """{name: internal variable at the end of the step (UFL)}."""
        found = self.material.updated(F, self.internal, self._time_step, **self.constants)
        shapes = {name: ufl.as_ufl(value).ufl_shape for name, value in found.items()}
        requested = {name: np.shape(value) for name, value in self.material.internal.items()}
        if shapes != requested:
            raise InputError(f"{self.material}: updated must return the internal variables {requested}, by shape; it"
                             f" returns {shapes}")
        return found

    @property
    def _time_step(self) -> Any:
        return self.forms.time - self.start

    def _rest_stress(self, constants: dict[str, Any]) -> Any:
        """dW/dF11 at F = I (UFL scalar)."""
        F = ufl.variable(ufl.Identity(3))
        return ufl.diff(self.material.strain_energy(F, **constants), F)[0, 0]
