"""Step data of a problem: active items, constrained unknowns, and the equations of a state."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from petsc4py import PETSc

from ..contact.face import FaceContact
from ..forms.constraints import Active, Constraints
from ..forms.schedule import StepData
from ..forms.tangent import Tangent
from ..scene.scene import Scene
from .vectors import Vectors


class _Stage(NamedTuple):
    """Equations of one set of step data, for steps from the state at which it was set.

    Attributes:
        setting: the `StepData`.
        active: the active constraints.
        constrained: local numbers of the n locally owned constrained unknowns, shape (n,).
        base: values of these unknowns at control 0, shape (n,).
        rate: derivative of these values with respect to the control, shape (n,).
        means: prescribed mean displacement for each `ConstrainedMean` of the scene, dimensionless.
        unbalanced: forces f that the change of step data leaves out of balance, locally owned entries. While they fade,
            (1 - control) f is subtracted from the residual F. None without fading.
    """

    setting: StepData
    active: Active
    constrained: np.ndarray
    base: np.ndarray
    rate: np.ndarray
    means: list[float]
    unbalanced: np.ndarray | None = None


class Stages(Vectors):
    """Part of `Problem` that follows the step data: constraints, loads and contacts; see `formingx.solve.equations`.

    Attributes:
        scene: the `Scene`.
        x: vector of unknowns; inside `state_context` the unknowns of the state.
        contacts: contacts of the scene.
        active_contacts: the active contacts.
        matrix: the tangent dF/dx of the residual, with the constraints.
    """

    scene: Scene
    x: PETSc.Vec
    contacts: list[FaceContact]
    active_contacts: list[FaceContact]
    _constraints: Constraints
    _stage: Any

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        raise NotImplementedError

    @cached_property
    def _tangent(self) -> Tangent:
        """Tangent matrix of the scene, with the constraints of the current stage."""
        made, stage = Tangent(self.forms, self._constraints, self.symmetric), self._stage
        made.enter(stage.active, stage.setting.rate, True)
        return made

    matrix: PETSc.Mat = cached_property(lambda self: self._tangent.matrix.mat)  # type: ignore[assignment]

    @property
    def symmetric(self) -> bool:
        return all(x.symmetric for x in (*self.scene.loads, *self.scene.contacts, *self.scene.materials.values()))

    @property
    def setting(self) -> StepData:
        return self._stage.setting

    @property
    def control(self) -> float:
        """Current control of the forms; inside `state_context` the control of the state."""
        return float(self._control)

    @property
    def constrained(self) -> np.ndarray:
        return self._stage.constrained

    @property
    def constrained_rate(self) -> np.ndarray:
        """Derivative of the constrained unknowns with respect to the control, for the n unknowns `constrained`."""
        return self._stage.rate

    @contextlib.contextmanager
    def state_context(self, state: Any) -> Iterator[Self]:
        """Set the problem to a state inside the context, and restore the previous values at its end.

        Step data, history variables, unknowns (`x`, `forms.w`) and control are set.

        Args:
            state: object with x (locally owned entries), control, time, setting (`StepData` as plain data, or empty)
                and history_variables.

        Yields:
            The problem.
        """
        fields, control, clock = self._fields.copy(), self.control, self.forms.clock
        stage, variables, x, predicted = self._stage, self.history_variables, self.x.array_r.copy(), self._predicted
        try:
            self.restore(state)
            self.x.array_w[:] = state.x
            self.set_state(self.x, state.control)
            yield self
        finally:
            self.history_variables, self._predicted = variables, predicted
            self._set_stage(stage)
            self.forms.clock = clock
            self.x.array_w[:] = x
            self._fields[:], self._control[()] = fields, control

    def restore(self, state: Any) -> None:
        """Restore step data, history variables and process time of an accepted state, to start a step from it.

        Args:
            state: object with x (locally owned entries), control, time, setting (`StepData` as plain data, or empty)
                and history_variables.
        """
        if self.has_history:
            self.history_variables = state.history_variables
        if state.setting:
            self.enter(StepData(**state.setting), state.x, state.control)
        if not self.setting.rate[-1]:
            self.forms.clock = state.time

    @property
    def fading_forces(self) -> np.ndarray | None:
        """Forces f that a change of loads, supports or contacts left out of balance, for the locally owned fields.

        They fade as the control goes from 0 to 1: at a control, (1 - control) f is subtracted from the residual. Shape
        (n,), dimensionless; None if the step data have no fading.
        """
        return None if self._stage.unbalanced is None else self._stage.unbalanced[: self._n]

    def motion(self, control: float) -> np.ndarray:
        """Return a vector of unknowns with the prescribed values of the constrained ones, and 0 elsewhere.

        Args:
            control: dimensionless control, on which prescribed displacements depend.

        Returns:
            Locally owned entries, shape (n,).
        """
        values = np.zeros(self.x.getLocalSize())
        values[self.constrained] = self._stage.base + self._stage.rate * control
        return values

    def set_state(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Set the fields and the control of the forms from a vector of unknowns.

        Args:
            x: unknowns.
            control: load parameter (control), dimensionless.

        Returns:
            Lagrange multipliers of the constrained mean displacements of boundaries (`ConstrainedMean`), shape
            (means,), the same on all ranks.
        """
        values, last = x.array_r, self.comm.size - 1
        self.set_fields_and_control(values, control)
        if not last:
            return values[self._n:].copy()
        multipliers = np.zeros(len(self._stage.active.rows))
        if self.comm.rank == last:
            multipliers[:] = values[self._n:]
        if len(multipliers):
            self.comm.Bcast(multipliers, root=last)
        return multipliers

    def enter(self, setting: StepData, x: np.ndarray, control: float) -> None:
        before = self._stage
        if before is not None and setting == before.setting:
            return
        same = before is not None and before.setting.inactive == setting.inactive
        active = before.active if same else self._constraints.active(set(setting.inactive))
        rate, constrained = np.append(setting.rate, 0.0)[active.driver][active.owned], active.dofs[active.owned]
        stage = _Stage(setting, active, constrained, x[constrained] - rate * control, rate,
                       [self._dot(row, x[: self._n]) for row in active.rows])
        self._set_stage(stage)
        if setting.fading and control < 1:
            unknowns, unbalanced = self.x.duplicate(), self.x.duplicate()
            unknowns.array_w[:] = x
            self.residual(unknowns, control, unbalanced)
            self._stage = stage._replace(unbalanced=unbalanced.array_r / (1 - control))
            unknowns.destroy()
            unbalanced.destroy()

    def _set_stage(self, stage: _Stage) -> None:
        """Set the loads of the forms, the active contacts and the constraints of the matrix from `stage`."""
        before, self._stage = self._stage, stage
        if before is stage:
            return
        setting, number = stage.setting, {id(item): i for i, item in enumerate(self.scene.items)}
        self.forms.set_loads(setting)
        for contact in self.contacts:
            i = number[id(contact.contact)]
            contact.enter(setting.base[i], setting.rate[i], i not in setting.inactive)
        self.active_contacts = [contact for contact in self.contacts if contact.active]
        if "_tangent" in vars(self):
            self._tangent.enter(stage.active, setting.rate, before is None or before.active is not stage.active)
