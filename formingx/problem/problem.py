"""Discrete equations of a scene, F(x, control) = 0: the interface of the solver. All objects are created once.

The vector x holds the fields (dimensionless, see `formulation`). One Lagrange multiplier for each `ConstrainedMean`
follows at the end of the last rank's entries.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import la
from mpi4py import MPI
from petsc4py import PETSc

from .. import _compat
from ..contact.face import FaceContact
from ..contact.resultants import penetration
from ..contact.step_limit import StepLimit
from ..errors import InputError, call_on_all_ranks
from ..forms.admissible import WorstValue
from ..forms.constraints import Constraints
from ..forms.formulations import formulate
from ..forms.history import History
from ..forms.schedule import StepData
from ..forms.step_error import StepError
from ..forms.temperature import Temperature
from ..forms.viscosity import Viscosity
from ..ranks import combined, listed
from ..scene.scene import Scene
from .examine import Examination
from .stages import Stages
from .units import Units


class Problem(Stages, Units):
    """Discrete problem of a scene: its residual F, and the derivatives of F by the unknowns x and by the control.

    `formingx.solve.equations` describes the members that the solver calls.

    Args:
        scene: the `Scene`.

    Attributes:
        scene: the `Scene`.
        forms: fields, forms and scales of the scene (a `Formulation`).
        comm: MPI communicator.
        x: vector of unknowns; inside `state_context` the unknowns of the state.
        matrix: the tangent, reassembled by `tangent`.
        contacts: contacts of the scene (`FaceContact`).
        active_contacts: contacts that are active in the current stage.
        histories: history variables on which F depends (`History`): contacts, then materials, then the temperature.
        limit: limits that the contacts set to the length of a step (`StepLimit`).
        admissible: check for inverted elements and points beyond the axis, and volume ratios (`Admissible`).
        force_scale: norm of all support forces at the state whose residual was last computed.
    """

    def __init__(self, scene: Scene):
        _compat.collect_communicators()
        self.scene, self.forms = scene, formulate(scene)
        self.comm, forms = self.forms.comm, self.forms
        forms.compile_ahead(*forms.path_forms())
        index_map = forms.space.dofmap.index_map
        self._n = index_map.size_local
        self._buffer = la.vector(index_map, 1)
        self._residual = forms.compile(forms.residual)
        self.contacts = [FaceContact(forms, contact, self.assemble) for contact in scene.contacts]
        forms.faces = self.contacts
        if scene.heat is not None:                              # after the materials, which heat it
            forms.histories.append(scene.heat.history(self))
        self.histories: list[History] = [*(c for c in self.contacts if c.has_history), *forms.histories]
        self.limit = StepLimit(self)
        self.admissible = forms.admissible()
        self._constraints = Constraints(forms, self.assemble)
        last = self.comm.rank == self.comm.size - 1             # it has the multipliers
        self.x = PETSc.Vec().createMPI((self._n + last * len(self._constraints.means), None), comm=self.comm)
        self._stage: Any = None
        self.enter(StepData.first(scene), np.zeros(self.x.getLocalSize()), 0.0)
        self.force_scale = 0.0

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns of all ranks, fields and multipliers."""
        return int(self.x.getSize())

    @property
    def has_kinks(self) -> bool:
        return bool(self.active_contacts)

    @property
    def active_set(self) -> Any:
        status = tuple(c.increment.status.tobytes() for c in self.active_contacts)
        return tuple(listed(self.comm, status)) if self.active_contacts else None

    @property
    def temperature(self) -> Temperature | None:
        """Temperature of the body at the last accepted state; None if the scene has no temperature.

        Inside `state_context` it is the temperature at the state of the context.
        """
        return self.forms.temperature

    def examine(self, last: Any, attempt: Any) -> Examination:
        return Examination(self, last, attempt)

    def activate(self, number: int, x: np.ndarray, control: float) -> None:
        for contact in self.contacts:
            if contact.contact is self.scene.items[number]:
                contact.activate(x, control)
                depth = penetration(contact, x, control)
                if depth > 1e-6 * self.forms.length:
                    raise InputError(f"{contact.contact!r} takes part again where the body is, which reaches"
                                     f" {depth:.6g} into the tool")

    def followed(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on this mesh of material points that are given on the first mesh of a run.

        Args:
            points: reference positions on the first mesh, shape (n, 2), length.

        Returns:
            Reference positions on this mesh, shape (n, 2), length.
        """
        state_transfer = self.scene.state_transfer
        return points if state_transfer is None else state_transfer.followed(self, points)

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        stage, multipliers, fields = self._stage, self.set_state(x, control), x.array_r[: self._n]
        values = self._forces(fields, control)
        self.force_scale = np.sqrt(self._dot(values, values))
        for multiplier, row in zip(multipliers, stage.active.rows, strict=True):
            values += multiplier * row
        constrained = self.constrained
        values[constrained] = fields[constrained] - stage.base - stage.rate * control
        constraints = stage.active
        self.fill(out, values, [self._dot(row, fields) - mean if active else multiplier
                                for row, mean, active, multiplier in
                                zip(constraints.rows, stage.means, constraints.means_active, multipliers, strict=True)])
        if stage.unbalanced is not None:
            out.array_w += (control - 1) * stage.unbalanced

    def reaction(self, number: int, x: PETSc.Vec, control: float) -> float:
        """Return the force of the body on a driven support, positive along the displacement component; collective.

        The force is the sum of external minus internal forces at the driven unknowns of all ranks.

        Args:
            number: number of the support in `Scene.items`.
            x: unknowns.
            control: load parameter (control), dimensionless.

        Returns:
            Force, stress times length^2; per unit depth in plane strain, stress times length.
        """
        left = self.forces(x, control)[self.driven_unknowns(number)].sum()
        forms = self.forms
        return -float(combined(self.comm, left, MPI.SUM)) * forms.stress * forms.volume / forms.length

    def driven_unknowns(self, number: int) -> np.ndarray:
        """Return the unknowns whose values a driven support prescribes.

        Args:
            number: number of the support in `Scene.items`.

        Returns:
            Local numbers of the locally owned unknowns, ascending, shape (n,).
        """
        return self._constraints.driven_by(number)

    def forces(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Return the internal minus the external forces, contact included, without the constraints of supports.

        Args:
            x: unknowns.
            control: load parameter (control), dimensionless.

        Returns:
            Dimensionless forces, locally owned field unknowns, shape (n,).
        """
        self.set_state(x, control)
        return self._forces(x.array_r[: self._n], control)

    def body_forces(self, x: np.ndarray, control: float) -> np.ndarray:
        """Return the internal minus the external forces without contact forces and constraints.

        In equilibrium these are the forces that supports and tools must supply.

        Args:
            x: unknowns, locally owned entries, shape (n,).
            control: load parameter (control), dimensionless.

        Returns:
            Dimensionless forces, locally owned field unknowns, shape (n,).
        """
        self.set_fields_and_control(x, control)
        return self.assemble(self._residual)

    def _forces(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return the internal minus the external forces, contact included, at the state to which the forms are set.

        fields: the locally owned field unknowns of this state, shape (n,). control: its load parameter (control). The
        forces are dimensionless, for the same unknowns, shape (n,).
        """
        values = self.assemble(self._residual)
        for contact in self.active_contacts:
            contact.add_residual(values, fields, control)
        return values

    def has_inverted_element(self, x: PETSc.Vec, control: float) -> bool:
        """Return True if an element of the body is inverted in a state, or if a point lies beyond the axis; collective.

        Args:
            x: unknowns.
            control: load parameter (control), dimensionless.

        Returns:
            True if a hoop stretch or an in-plane determinant of the deformation gradient is not positive.
        """
        self.set_state(x, control)
        return not self.admissible.holds()

    def extreme_volume_ratio(self, state: Any) -> WorstValue | None:
        """Return the volume ratio J with the largest |ln J| in a state; collective.

        Args:
            state: a `State` of the path.

        Returns:
            The volume ratio with its reference position; None for a membrane.
        """
        with self.state_context(state):
            return self.admissible.extreme_volume_ratio()

    def volume_error_away(self, state: Any, places: np.ndarray, distance: float) -> float:
        """Return the root mean square of the volume change J - 1 over elements far from given positions; collective.

        Args:
            state: a `State` of the path.
            places: reference positions, shape (k, 2), length.
            distance: elements with a quadrature point nearer to one of the positions are left out, length.

        Returns:
            Volume-weighted root mean square (dimensionless).
        """
        with self.state_context(state):
            return self.admissible.volume_error_away(places, distance)

    def inverted_elements(self) -> tuple[int, int, tuple[float, float]]:
        """Count the inverted elements for the current fields of the forms; collective.

        Returns:
            Number of elements with a point at which the volume ratio J is not positive, number of all elements,
            reference position (R, Z) of the smallest J.
        """
        return self.admissible.inverted_elements()

    def begin(self, old: Any = None) -> None:
        for contact in self.active_contacts:
            contact.begin(*((None, 0.0) if old is None else (old.x[: self._n], old.control)))

    def linearise(self, x: PETSc.Vec, control: float, F: PETSc.Vec) -> None:
        if self.contacts:
            values = F.array_r[: self._n].copy()
            for contact in self.active_contacts:
                contact.linearise(values, x.array_r[: self._n], control)
            values[self.constrained] = F.array_r[: self._n][self.constrained]
            F.array_w[: self._n] = values

    def tangent(self, x: PETSc.Vec, control: float, one_sided: bool = False) -> PETSc.Mat:
        self.set_state(x, control)
        fields = x.array_r[: self._n]
        return self._tangent.matrix.fill([(c.rule.dofs, c.tangent(fields, control, one_sided))
                                          for c in self.active_contacts])

    def viscosity(self) -> Viscosity:
        return Viscosity(self._viscosity, self._stage.active.bcs)

    @cached_property
    def _step_error(self) -> StepError:
        return StepError(self)

    def step_error(self, past: Sequence[Any], share: np.ndarray, x: np.ndarray, control: float) -> tuple[float, float]:
        return self._step_error.estimate(past, share, x, control)

    @cached_property
    def _viscosity(self) -> Any:
        return self.forms.compile(self.forms.viscosity())

    def one_sided_changes(self, x: PETSc.Vec, control: float) -> list[np.ndarray]:
        return [contact.one_sided_change(x.array_r[: self._n], control) for contact in self.active_contacts]

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec, one_sided: bool = False) -> None:
        self.set_state(x, control)
        values = self._tangent.by_control(self.setting.rate, self.assemble, self._n)
        for contact in self.active_contacts:
            contact.add_control_derivative(values, x.array_r[: self._n], control, one_sided)
        values[self.constrained] = -self._stage.rate
        self.fill(out, values)
        if self._stage.unbalanced is not None:
            out.array_w += self._stage.unbalanced

    def update_temperature(self) -> None:
        """Update material constants and coefficients of friction to a changed temperature; collective.

        Raises:
            InputError: a constant or friction has no value at a temperature.
        """
        call_on_all_ranks(self.comm, [self.forms.update_temperature,
                                      *(contact.update_temperature for contact in self.contacts)])

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        if "_tangent" in vars(self):
            self._tangent.matrix.destroy()
        self.x.destroy()
