"""Loads, elastic supports and process time of the forms, as functions of the control."""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem
from petsc4py import PETSc
from ufl.algorithms.analysis import extract_constants

from .body_model import BodyModel
from .loaded_body import LoadedBody


class ControlledLoads(BodyModel):
    """Part of `Formulation`: residual, loads, elastic supports and process time as functions of the control.

    `Formulation` describes the attributes.
    """

    scene: Any
    domain: Any
    w: Any
    control: fem.Constant
    potential: Any
    energy: Any
    elastic_F: Any
    terms: list[Any]
    scales: list[float]
    load_values: list[tuple[Any, Any]]
    load_works: list[Any]
    elastic_supports: list[tuple[Any, fem.Constant]]
    _control: Any
    _scale: fem.Constant
    _time: tuple[fem.Constant, fem.Constant]
    _loads: list[tuple[Any, fem.Constant, fem.Constant]]

    def test_function(self) -> Any:
        """Return the test function of all fields (UFL, dimensionless)."""
        raise NotImplementedError

    def constant(self, value: float) -> fem.Constant:
        """Return a UFL constant; a new value needs no new compilation of the forms that contain it."""
        return fem.Constant(self.domain, PETSc.ScalarType(value))

    @property
    def clock(self) -> float:
        """Process time at control 0; a run that chooses its own time steps sets it before each step."""
        return float(self._time[0].value)

    @clock.setter
    def clock(self, time: float) -> None:
        self._time[0].value = time

    def time_at(self, control: float) -> float:
        """Return the process time at a control, for the current step data (`StepData`)."""
        base, rate = self._time
        return float(base.value + rate.value * control)

    @property
    def time_now(self) -> float:
        """Process time at the current control of the forms."""
        return self.time_at(float(self.control.value))

    def set_loads(self, setting: Any) -> None:
        """Set loads, elastic supports and process time as functions of the control, from step data (`StepData`)."""
        for support, factor in self.elastic_supports:
            factor.value = float(not any(self.scene.items[i] is support for i in setting.inactive))
        for i, (load, base, rate) in enumerate(self._loads):
            active = i not in setting.inactive
            base.value = active * (setting.base[i] if load.driven else load.value)
            rate.value = active * setting.rate[i]
        for constant, value in zip(self._time, (setting.base[-1], setting.rate[-1])):
            constant.value = value

    def _add_supports(self, body: LoadedBody) -> None:
        """Add the energies of elastic supports."""
        self.elastic_supports = []
        for support in self.scene.supports:
            energy = body.stored(support)
            if energy is not None:
                active = self.constant(1.0)
                self.elastic_supports.append((support, active))
                self.potential, self.energy = (None if e is None else e + self._scale * active * energy
                                               for e in (self.potential, self.energy))

    def _residual(self, body: LoadedBody) -> tuple[Any, Any, Any]:
        """Return the residual and its derivatives by the control, through loads and through time (UFL, rank 1).

        body: fields and integrals for the virtual works. A derivative that the scene does not have is None.
        """
        v, control = self.test_function(), self._control
        residual = ufl.derivative(self.potential, self.w, v)
        for entry in self.terms:
            if work := entry.unsymmetric_work(self.elastic_F, lambda f: ufl.derivative(f, self.w, v)):
                residual += self.weighted(self._scale * work, entry.names)
        timed = ufl.Form([i for i in self.potential.integrals() if self.control in extract_constants(i.integrand())])
        by_time = ufl.derivative(ufl.diff(timed, control), self.w, v) if timed.integrals() else None
        terms = []
        self._loads, self.load_works, self.load_values = [], [], []
        for load, scale in zip(self.scene.loads, self.scales):
            base, rate = self.constant(0.0 if load.driven else load.value), self.constant(0.0)
            self._loads.append((load, base, rate))
            value = self.constant(scale) * (base + rate * control) if load.driven else base
            self.load_values.append((load, value))
            work = body.work(load, value)
            self.load_works.append(work)
            residual -= self._scale * work
            if load.driven:
                terms.append(-self._scale * ufl.diff(work, control))
        return residual, sum(terms[1:], terms[0]) if terms else None, by_time
