"""Material in the forms: its constants as coefficients, its internal variables, its energies."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from ..errors import InputError
from ..materials.constants import Varying
from ..materials.tensors import isochoric
from ..mesh.nodes import own_cells
from .temperature_coefficient import TemperatureCoefficient


class MaterialTerms:
    """Coefficients, internal variables and energies of one material in the forms of a problem.

    Attributes:
        forms: the `Formulation`.
        material: the `Material`.
        names: names of the layers.
        in_law_axes: function that refers F to the directions that the energies of the material take.
        X: reference position (UFL, length, shape (2,)).
        constants: {name: coefficient}, a `Constant` for a number; else a `Function` or another UFL scalar.
        rest_stress: stress dW/dF11 of the energy at F = I (UFL scalar, stress).
        internal: {name: `Function` of a quadrature element}, internal variables at the beginning of the step.
        past_integrals: {name: `Function` of a quadrature element}, coefficients of an integral over past states
            (`IntegralLaw.coefficients`).
        start: process time at the beginning of the step (`Constant`).
        cells: local numbers of the cells of the layers, with ghosts, ascending.
        own_cells: the locally owned ones of `cells`.
        places: quadrature points of the energy in the reference cell, shape (q, dimension).
    """

    def __init__(self, forms: Any, material: Any, names: list[str]):
        self.forms, self.material, self.names = forms, material, names
        self.in_law_axes = forms.law_axes(material, names)
        self.cells = forms.cells_of(names)
        self.own_cells = self.cells[self.cells < len(own_cells(forms.domain))]
        self.X = forms.X
        self._coefficients: list[TemperatureCoefficient] = []
        self.places = forms.rule.places
        self.start = forms.constant(0.0)
        self.constants = {name: self._constant(name, value) for name, value in material.constants().items()}
        self.rest_stress = self._rest_stress(self.constants) if material.varies else forms.constant(
            material.rest_stress)
        self.internal = {name: self.quadrature_function(np.shape(value)) for name, value in material.internal.items()}
        coefficients = material.integral.coefficients if material.integral else {}
        self.past_integrals = {name: self.quadrature_function(np.shape(value)) for name, value in coefficients.items()}

    def _constant(self, name: str, value: Any) -> Any:
        """Return the coefficient (UFL scalar) of the material constant `name`; value: a number or a `Varying`."""
        self._in_middle = name in self.material.flow_constants
        return value.expression(self) if isinstance(value, Varying) else self.forms.constant(value)

    @property
    def depends_on_temperature(self) -> bool:
        """True if a constant depends on the temperature."""
        return bool(self._coefficients)

    @property
    def has_history(self) -> bool:
        """True if the stress of the material depends on past states."""
        return bool(self.internal or self.past_integrals)

    def quadrature_function(self, shape: tuple[int, ...] = ()) -> fem.Function:
        """Return a zero `Function` with a value of a given shape at every quadrature point of the energy."""
        return fem.Function(fem.functionspace(self.forms.domain, self.forms.rule.element(shape)))

    def position_coefficient(self, function: Any) -> fem.Function:
        """Return a quadrature `Function` of f(R, Z) on the first mesh, length; in membranes Z halfway up the layer."""
        found, layer, brought = self.quadrature_function(), self.names[0], self.forms.scene.state_transfer

        def values(X: np.ndarray) -> np.ndarray:
            X = X[:self.forms.domain.geometry.dim]
            R, *others = X if brought is None else brought.original_positions(X.T).T
            others[0] = self.forms.mid(layer, R, others[0])
            return function(R, *others)
        found.interpolate(values, self.cells)
        return found

    def temperature_coefficient(self, function: Any) -> Any:
        """Return f(T) (UFL scalar) at the end of a step, or in its middle for `Material.flow_constants`."""
        forms, found = self.forms, self.quadrature_function()
        law = forms.mean_over_depths(getattr(function, "clamped", function), self)   # a user's may be any function
        coefficient = TemperatureCoefficient(forms, found, [(self.cells, law)], [forms.temperatures(self)])
        self._coefficients.append(coefficient)
        return coefficient.at_time(forms.time - (self._time_step / 2 if self._in_middle else 0))

    def update_temperature(self) -> None:
        """Update the material constants to a changed temperature, else raise `InputError`."""
        temperatures = [self.forms.temperatures(self)] if self._coefficients else []
        for coefficient in self._coefficients:
            coefficient.update(temperatures)

    def mesh_coefficient(self, expression: Any) -> Any:
        """Return a UFL scalar as coefficient; fields on another mesh, as a mid-surface, are an InputError."""
        if self.forms.domain is not self.forms.scene.mesh.domain:
            raise InputError(f"{self.material}: a membrane has its own mesh: give the constant as a function of"
                             f" (R, Z)")
        return expression

    def step_energy(self, F: Any) -> Any:
        """Return the incremental potential of the step per reference volume (UFL, stress); F: elastic."""
        F = self.in_law_axes(F)
        if not self.has_history:
            return self.material.strain_energy(F, **self.constants)
        return self.material.step_energy(F, self.internal | self.past_integrals, self._time_step, **self.constants)

    def stored_energy(self, F: Any) -> Any:
        """Return the stored energy per reference volume (UFL, stress); F: elastic, shape (3, 3)."""
        F = self.in_law_axes(F)
        if not self.has_history:
            return self.material.strain_energy(F, **self.constants)
        return self.material.stored_energy(F, self.internal | self.past_integrals, **self.constants)

    def unsymmetric_work(self, F: Any, derivative: Any) -> Any:
        """Return the virtual work of stresses without a potential, per reference volume (UFL, stress).

        `derivative` gives the variation of a UFL expression. None if the tangent is symmetric.
        """
        if self.material.symmetric:
            return None
        C = isochoric(F)
        return self.material.integral.unsymmetric_work(C, [derivative(c) for c in C], self.past_integrals)

    def equilibrium_energy(self, F: Any) -> Any:
        """Return the energy after complete relaxation, per reference volume (UFL, stress), or None."""
        return self.material.equilibrium_energy(self.in_law_axes(F), **self.constants)

    def elastic_stretches(self, F: Any) -> list[Any]:
        """Return the largest principal elastic stretch of each relaxing branch (UFL scalars)."""
        return self.material.elastic_stretches(self.in_law_axes(F), self.internal, **self.constants)

    def dissipation(self, F: Any) -> Any:
        """Return the dissipated power per reference volume (UFL, stress over time); F: elastic."""
        return self.material.dissipation(self.in_law_axes(F), self.internal, **self.constants)

    def damage_energy(self) -> Any:
        """Return the energy dissipated by damage per reference volume (UFL, stress)."""
        return self.material.damage_energy(self.internal, **self.constants)

    def updated(self, F: Any) -> dict[str, Any]:
        """Return {name: internal variable (UFL)} at the end of the step; F: elastic, UFL, shape (3, 3).

        Raise `InputError` if `Material.updated` returns other names or shapes than `Material.internal` has.
        """
        found = self.material.updated(self.in_law_axes(F), self.internal, self._time_step, **self.constants)
        shapes = {name: ufl.as_ufl(value).ufl_shape for name, value in found.items()}
        requested = {name: np.shape(value) for name, value in self.material.internal.items()}
        if shapes != requested:
            raise InputError(f"{self.material}: updated must return the internal variables {requested}, by shape; it"
                             f" returns {shapes}")
        return found

    @property
    def _time_step(self) -> Any:
        """Length of the step (UFL scalar, time)."""
        return self.forms.time - self.start

    def _rest_stress(self, constants: dict[str, Any]) -> Any:
        """Return the stress dW/dF11 of the strain energy W at F = I (UFL scalar, stress)."""
        F = ufl.variable(ufl.Identity(3))
        return ufl.diff(self.material.strain_energy(F, **constants), F)[0, 0]
