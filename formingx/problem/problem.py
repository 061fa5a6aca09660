"""Discrete equations of a scene, F(x, control) = 0, and their parts. All objects are created once.

The vector x holds the fields (dimensionless, see `formulation`). One Lagrange multiplier for each `ConstrainedMean`
follows at the end of the last rank's entries.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from .. import _compat
from ..contact.face import FaceContact
from ..contact.resultants import penetration
from ..contact.step_limit import StepLimit
from ..errors import InputError, call_on_all_ranks
from ..forms.admissible import WorstValue
from ..forms.constraints import Active, Constraints
from ..forms.formulations import formulate
from ..forms.history import ConstitutiveHistory, History, Start
from ..forms.schedule import StepData
from ..forms.step_error import StepError
from ..forms.tangent import Tangent
from ..forms.temperature import Temperature
from ..forms.viscosity import Viscosity
from ..ranks import combined, listed
from ..scene.scene import Scene
from ..scene.target_checks import implausible
from .examine import Examination

_NOTHING_PREDICTED: tuple[Any, list[Any]] = (None, [])


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


class Problem:
    """Discrete problem of a scene: its residual F, and the derivatives of F by the unknowns x and by the control.

    `formingx.solve.equations` describes the members that the solver calls.

    Attributes:
        scene: the `Scene`.
        forms: fields, forms and scales of the scene (a `Formulation`).
        comm: MPI communicator.
        x: vector of unknowns; inside `state_context` the unknowns of the state.
        n_owned: number of field unknowns that this rank owns.
        setting: current step data (`StepData`).
        constrained: local numbers of the constrained unknowns that this rank owns, shape (n,).
        matrix: the tangent, reassembled by `tangent`.
        contacts: contacts of the scene (`FaceContact`).
        contact: the active ones and their limits to a step (`Contacts`).
        history: history variables and process time (`ProblemHistories`).
        reference: the body in the reference configuration (`UnloadedBody`).
        description: names and units (`SceneDescription`).
        admissible: check for inverted elements and points beyond the axis, and volume ratios (`Admissible`).
        force_scale: norm of all support forces at the state whose residual was last computed.
    """

    def __init__(self, scene: Scene):
        _compat.collect_communicators()
        self.scene, self.forms = scene, formulate(scene)
        self.comm, forms = self.forms.comm, self.forms
        forms.compile_ahead(*forms.path_forms())
        index_map = forms.space.dofmap.index_map
        self.n_owned = index_map.size_local
        self._buffer = la.vector(index_map, 1)
        self._residual = forms.compile(forms.residual)
        self.contacts = [FaceContact(forms, contact, self.assemble) for contact in scene.contacts]
        forms.faces = self.contacts
        if scene.heat is not None:                              # after the materials, which heat it
            forms.histories.append(scene.heat.history(self))
        self.contact, self.history = Contacts(self), ProblemHistories(self)
        self.reference, self.description = UnloadedBody(self), SceneDescription(self)
        self.admissible = forms.admissible()
        self._constraints = Constraints(forms, self.assemble)
        last = self.comm.rank == self.comm.size - 1             # it has the multipliers
        self.x = PETSc.Vec().createMPI((self.n_owned + last * len(self._constraints.means), None), comm=self.comm)
        self._stage: Any = None
        self.enter(StepData.first(scene), np.zeros(self.x.getLocalSize()), 0.0)
        self.force_scale = 0.0

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns of all ranks, fields and multipliers."""
        return int(self.x.getSize())

    @cached_property
    def _fields(self) -> np.ndarray:
        """Fields of the forms on this rank, with ghosts: writable view of the unknowns of `forms.w`."""
        return np.asarray(self.forms.w.x.array)

    @cached_property
    def _control(self) -> np.ndarray:
        """Control of the forms, shape (): writable view of the value of `forms.control`."""
        return np.asarray(self.forms.control.value)

    @cached_property
    def _metric(self) -> np.ndarray:
        """Lumped mass matrix of the displacement for density 1/volume, locally owned diagonal entries, shape (n,)."""
        return np.asarray(np.maximum(self.assemble(self.forms.compile(self.forms.metric_row())), 0))

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
    def control(self) -> float:
        """Current control of the forms; inside `state_context` the control of the state."""
        return float(self._control)

    @property
    def constrained_rate(self) -> np.ndarray:
        """Derivative of the constrained unknowns with respect to the control, for the n unknowns `constrained`."""
        return self._stage.rate

    def constrained_values(self, control: float) -> np.ndarray:
        """Return the prescribed values of the n unknowns `constrained` at a control, shape (n,), dimensionless."""
        return np.asarray(self._stage.base + self._stage.rate * control)

    @property
    def temperature(self) -> Temperature | None:
        """Temperature of the body at the last accepted state, or of `state_context`; None without one."""
        return self.forms.temperature

    def set_fields(self, x: np.ndarray, control: float | None = None) -> None:
        """Set the fields from x (n,), coefficients that depend on them, and the control, None: as it is."""
        if control is not None:
            self._control[()] = control
        self._fields[: self.n_owned] = x[: self.n_owned]
        if self.comm.size > 1:
            self.forms.w.x.scatter_forward()
        for coefficients in self.forms.refreshed:
            coefficients.refresh()

    def set_state(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Set the fields and the control of the forms from a vector of unknowns.

        Return the Lagrange multipliers of the means of boundaries (`ConstrainedMean`), shape (means,), on all ranks.
        """
        values, last = x.array_r, self.comm.size - 1
        self.set_fields(values, control)
        if not last:
            return values[self.n_owned:].copy()
        multipliers = np.zeros(len(self._stage.active.rows))
        if self.comm.rank == last:
            multipliers[:] = values[self.n_owned:]
        if len(multipliers):
            self.comm.Bcast(multipliers, root=last)
        return multipliers

    def inner(self, a: PETSc.Vec, b: PETSc.Vec) -> float:
        """Return (1/V) int a . b dV of two displacement fields over L, by a lumped mass matrix; dimensionless."""
        return self._dot(self._metric * a.array_r[: self.n_owned], b.array_r[: self.n_owned])

    def metric_times(self, a: PETSc.Vec, out: PETSc.Vec) -> None:
        self.fill(out, self._metric * a.array_r[: self.n_owned])

    def assemble(self, form: Any) -> np.ndarray:
        """Assemble a compiled linear form at the current fields and control; owned entries, shape (n,)."""
        return _compat.assemble_vector(self._buffer, form).copy()

    def assemble_scalar(self, form: Any) -> float:
        """Assemble a compiled scalar form at the current fields and control, over all ranks."""
        return float(combined(self.comm, fem.assemble_scalar(form), MPI.SUM))

    def fill(self, out: PETSc.Vec, values: np.ndarray, tail: list[float] | None = None) -> None:
        """Set a vector from owned field values, shape (n,), and multipliers of the last rank; None: 0."""
        array = out.array_w
        array[: self.n_owned] = values
        array[self.n_owned:] = 0.0 if tail is None or self.comm.rank < self.comm.size - 1 else tail

    def _dot(self, a: np.ndarray, b: np.ndarray) -> float:
        """Return the dot product of two vectors of locally owned entries over all ranks."""
        return float(combined(self.comm, float(np.dot(a, b)), MPI.SUM))

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        stage, multipliers, fields = self._stage, self.set_state(x, control), x.array_r[: self.n_owned]
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
        """Return the force of the body on driven support `number`, positive along its component; collective.

        The unit is stress length^2; in plane strain per unit depth, stress length.
        """
        left = self.forces(x, control)[self.driven_unknowns(number)].sum()
        forms = self.forms
        return -float(combined(self.comm, left, MPI.SUM)) * forms.stress * forms.volume / forms.length

    def driven_unknowns(self, number: int) -> np.ndarray:
        """Return the local numbers of owned unknowns that a driven support prescribes, ascending, shape (n,)."""
        return self._constraints.driven_by(number)

    def forces(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Return the internal minus external forces, contact included, without constraints; dimensionless, shape (n,).
        """
        self.set_state(x, control)
        return self._forces(x.array_r[: self.n_owned], control)

    def body_forces(self, x: np.ndarray, control: float) -> np.ndarray:
        """Return internal minus external forces (n,), dimensionless, which contact and supports balance."""
        self.set_fields(x, control)
        return self.assemble(self._residual)

    def _forces(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return the internal minus external forces, contact included, at the state to which the forms are set.

        fields: its locally owned field unknowns, shape (n,). The forces are dimensionless, shape (n,).
        """
        values = self.assemble(self._residual)
        for contact in self.contact.faces:
            contact.add_residual(values, fields, control)
        return values

    def has_inverted_element(self, x: PETSc.Vec, control: float) -> bool:
        """Return True if a hoop stretch or in-plane determinant of F is not positive on any rank; collective."""
        self.set_state(x, control)
        return not self.admissible.holds()

    def extreme_volume_ratio(self, state: Any) -> WorstValue | None:
        """Return the volume ratio J with the largest |ln J| and its position; None for a membrane; collective."""
        with self.state_context(state):
            return self.admissible.extreme_volume_ratio()

    def volume_error_away(self, state: Any, places: np.ndarray, distance: float) -> float:
        """Return the root mean square of J - 1 in elements over `distance` from places (k, 2), length; collective."""
        with self.state_context(state):
            return self.admissible.volume_error_away(places, distance)

    def tangent(self, x: PETSc.Vec, control: float, one_sided: bool = False) -> PETSc.Mat:
        self.set_state(x, control)
        fields = x.array_r[: self.n_owned]
        return self._tangent.matrix.fill([(c.rule.dofs, c.tangent(fields, control, one_sided))
                                          for c in self.contact.faces])

    def viscosity(self) -> Viscosity:
        return Viscosity(self._viscosity, self._stage.active.bcs)

    @cached_property
    def _viscosity(self) -> Any:
        return self.forms.compile(self.forms.viscosity())

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec, one_sided: bool = False) -> None:
        self.set_state(x, control)
        values = self._tangent.by_control(self.setting.rate, self.assemble, self.n_owned)
        for contact in self.contact.faces:
            contact.add_control_derivative(values, x.array_r[: self.n_owned], control, one_sided)
        values[self.constrained] = -self._stage.rate
        self.fill(out, values)
        if self._stage.unbalanced is not None:
            out.array_w += self._stage.unbalanced

    @property
    def time(self) -> float:
        """Process time at the current load parameter (control)."""
        return self.forms.time_at(self.control)

    @contextlib.contextmanager
    def state_context(self, state: Any) -> Iterator[Self]:
        """Set the problem to a state inside the context, and restore the previous values at its end.

        Step data, history variables, unknowns (`x`, `forms.w`) and control are set. The state has x (locally owned
        entries), control, time, setting (`StepData` as plain data, or empty) and history_variables.
        """
        fields, control, clock = self._fields.copy(), float(self._control), self.forms.clock
        stage, x = self._stage, self.x.array_r.copy()
        variables, predicted = self.history.variables, self.history.predicted
        try:
            self.restore(state)
            self.x.array_w[:] = state.x
            self.set_state(self.x, state.control)
            yield self
        finally:
            self.history.variables, self.history.predicted = variables, predicted
            self._set_stage(stage)
            self.forms.clock = clock
            self.x.array_w[:] = x
            self._fields[:], self._control[()] = fields, control

    def restore(self, state: Any) -> None:
        """Restore step data, history variables and process time of an accepted state, to start a step from it."""
        if self.history.path_dependent:
            self.history.variables = state.history_variables
        if state.setting:
            self.enter(StepData(**state.setting), state.x, state.control)
        if not self.setting.rate[-1]:
            self.forms.clock = state.time

    @property
    def fading_forces(self) -> np.ndarray | None:
        """Unbalanced forces f of changed items, (n,), dimensionless, or None: the residual loses (1 - control) f."""
        return None if self._stage.unbalanced is None else self._stage.unbalanced[: self.n_owned]

    def enter(self, setting: StepData, x: np.ndarray, control: float) -> None:
        before = self._stage
        if before is not None and setting == before.setting:
            return
        same = before is not None and before.setting.inactive == setting.inactive
        active = before.active if same else self._constraints.active(set(setting.inactive))
        rate, constrained = np.append(setting.rate, 0.0)[active.driver][active.owned], active.dofs[active.owned]
        stage = _Stage(setting, active, constrained, x[constrained] - rate * control, rate,
                       [self._dot(row, x[: self.n_owned]) for row in active.rows])
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
        self.contact.note_active()
        self.setting, self.constrained = setting, stage.constrained
        if "_tangent" in vars(self):
            self._tangent.enter(stage.active, setting.rate, before is None or before.active is not stage.active)

    def followed(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on this mesh of material points on the first mesh of a run, shape (n, 2), length."""
        state_transfer = self.scene.state_transfer
        return points if state_transfer is None else state_transfer.followed(self, points)

    def update_temperature(self) -> None:
        """Update material constants and friction to a changed temperature, else raise an InputError; collective."""
        call_on_all_ranks(self.comm, [self.forms.update_temperature,
                                      *(contact.update_temperature for contact in self.contacts)])

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        if "_tangent" in vars(self):
            self._tangent.matrix.destroy()
        self.x.destroy()


class Contacts:
    """Contacts of a problem: the active ones, their linearisation, and the limits that they set to a step.

    Attributes:
        faces: contacts that are active in the current stage.
        limit: limits to the length of a step (`StepLimit`).
    """

    def __init__(self, problem: Problem):
        self._problem, self._n = problem, problem.n_owned
        self.faces: list[FaceContact] = []
        self.limit = StepLimit(problem)

    def note_active(self) -> None:
        """Set the contacts that are active after a change of the stage."""
        self.faces = [face for face in self._problem.contacts if face.active]
        self.limit.note_active()

    @property
    def status(self) -> Any:
        status = [face.increment.last.status.tobytes() for face in self.faces]
        return tuple(map(tuple, listed(self._problem.comm, status))) if status else None

    def begin(self, old: Any = None) -> None:
        for face in self.faces:
            face.begin(*((None, 0.0) if old is None else (old.x[: self._n], old.control)))

    def linearise(self, x: PETSc.Vec, control: float, F: PETSc.Vec) -> None:
        if self.faces:
            values, fields, constrained = F.array_r[: self._n].copy(), x.array_r[: self._n], self._problem.constrained
            for face in self.faces:
                face.linearise(values, fields, control)
            values[constrained] = F.array_r[: self._n][constrained]
            F.array_w[: self._n] = values

    def one_sided_changes(self, x: PETSc.Vec, control: float) -> list[np.ndarray]:
        return [face.one_sided_change(x.array_r[: self._n], control) for face in self.faces]

    def unit_forces(self, chosen: list[np.ndarray]) -> np.ndarray:
        comm, components = self._problem.comm, self.faces[0].points.shape[1]
        counts = listed(comm, [len(points) * components for points in chosen])
        E, end = np.zeros((self._problem.x.getLocalSize(), sum(map(sum, counts)))), 0
        for rank, of_faces in enumerate(counts):
            for face, points, count in zip(self.faces, chosen, of_faces):
                first, end = end, end + count
                face.rule.add_unit_forces(E[:, first:end], points if rank == comm.rank else None)
        E[self._problem.constrained] = 0
        return E

    def activate(self, number: int, x: np.ndarray, control: float) -> None:
        for face in self._problem.contacts:
            if face.contact in self._problem.scene.items[number: number + 1]:       # a law of heat has no item
                face.activate(x, control)
                depth = penetration(face, x, control)
                if depth > 1e-6 * self._problem.forms.length:
                    raise InputError(f"{face.contact!r} takes part again where the body is, which reaches"
                                     f" {depth:.6g} into the tool")


class ProblemHistories:
    """History variables and process time of a problem.

    Attributes:
        parts: histories on which F depends (`History`): contacts, then materials, then the temperature.
        materials: history of each material with internal variables or past states (`ConstitutiveHistory`).
        path_dependent: True if F depends on earlier states.
        body_path_dependent: True if materials or the temperature have history variables.
        rate_dependent: True if the body depends on process time, through a material or through its temperature.
        predicted: x, and the history variables of materials and temperature there, from the last call of `predict`.
        time_at: function of the control that returns the process time.
    """

    def __init__(self, problem: Problem):
        self._problem, self._forms = problem, problem.forms
        of_body = self._forms.histories
        self.parts: list[History] = [*(c for c in problem.contacts if c.has_history), *of_body]
        self.materials = [history for history in of_body if isinstance(history, ConstitutiveHistory)]
        self.path_dependent, self.body_path_dependent = bool(self.parts), bool(of_body)
        self.rate_dependent = len(self.materials) < len(of_body) or any(m.rate_dependent for m in self.materials)
        self.time_at, self.predicted = self._forms.time_at, _NOTHING_PREDICTED

    @property
    def variables(self) -> list[Any]:
        """History variables of the last accepted state: the result of `History.get` for each of `parts`."""
        return [history.get() for history in self.parts]

    @variables.setter
    def variables(self, variables: list[Any]) -> None:
        self.predicted = _NOTHING_PREDICTED
        for history, stored in zip(self.parts, variables, strict=True):
            history.put(stored)

    @property
    def clock(self) -> float:
        """Process time at control 0; a run that chooses its own time steps sets it before each step."""
        return self._forms.clock

    @clock.setter
    def clock(self, time: float) -> None:
        self._forms.clock = time

    def advance(self, x: np.ndarray, control: float) -> None:
        if self.body_path_dependent:
            self._problem.set_fields(x, control)
        known = self.predicted[1] if self.predicted[0] is x else []
        for history in self.parts[: len(self.parts) - len(known)]:
            history.advance(x[: self._problem.n_owned], control)
        for history, variables in zip(self._forms.histories, known):
            history.put(variables)
        self.predicted = _NOTHING_PREDICTED

    def predict(self, start: Start, x: np.ndarray, control: float) -> list[Any]:
        """Return the history variables of materials and temperature at the end of a step that is not yet accepted.

        They are stored, and `advance` uses them if it accepts the same x, shape (n,). The caller must restore the
        earlier ones.
        """
        self._problem.set_fields(x, control)
        for history in self._forms.histories:
            history.advance(x[: self._problem.n_owned], control, start)
        after = [history.get() for history in self._forms.histories]
        self.predicted = x, after
        return after

    @cached_property
    def _step_error(self) -> StepError:
        return StepError(self._problem)

    def step_error(self, past: Sequence[Any], share: np.ndarray, x: np.ndarray, control: float) -> tuple[float, float]:
        return self._step_error.estimate(past, share, x, control)


class UnloadedBody:
    """Body in the reference configuration; `singular` is True if it has no stiffness in some direction there."""

    def __init__(self, problem: Problem):
        self._problem, self.singular = problem, problem.forms.singular_unloaded

    def stiff_state(self, out: PETSc.Vec) -> None:
        forms = self._problem.forms
        forms.set_stiff()
        self._problem.fill(out, forms.w.x.array[: self._problem.n_owned])

    def motion(self, control: float) -> np.ndarray:
        values = np.zeros(self._problem.x.getLocalSize())
        values[self._problem.constrained] = self._problem.constrained_values(control)
        return values


class SceneDescription:
    """Names, units and explanations of the numbers of a problem.

    Attributes:
        scales: value in the user's units over dimensionless amplitude of each item; at the end 1.0 for process time.
        units: units of the dimensionless energy of the whole part (stress length^3) and of length, in the user's units.
        fixed_loads: loads that act already at control 0, as text.
        main_columns: names of the output quantities that `Record.describe` states.
    """

    def __init__(self, problem: Problem):
        scene, forms = problem.scene, problem.forms
        self._problem, self._scene = problem, scene
        self.scales: Sequence[float] = forms.scales
        self.units: tuple[float, float] = (scene.symmetry_factor * forms.stress * forms.volume, forms.length)
        self.fixed_loads: Sequence[str] = [repr(load) for load in scene.loads if not load.driven]
        self.main_columns: Sequence[str] = [
            "process_time", *map(scene.column, scene.drivable), "pole_height", "pole_stretch"]

    @cached_property
    def _names(self) -> list[str]:
        """Name of each item that can be controlled, then "process time"."""
        columns = [self._scene.column(item) if item.quantity else "" for item in self._scene.items]
        return [*(column.replace("_", " ") for column in columns), "process time"]

    @property
    def control_kind(self) -> str | None:
        number, items = self._problem.setting.controlled, self._scene.items
        return None if number is None else "time" if number == len(items) else items[number].quantity

    def shown(self, control: float) -> tuple[str, float]:
        setting = self._problem.setting
        number = setting.controlled
        return ("control", control) if number is None else (
            self._names[number], self.scales[number] * setting.amplitude(number, control))

    def implausible(self, control: float) -> str | None:
        return implausible(self._scene, self.control_kind, self.shown(control)[1])

    @property
    def why_not_finite(self) -> str:
        limits = {f"{m} was stretched beyond its limit, I1 < {m.largest_I1:.6g}": None
                  for m in self._scene.materials.values() if m.largest_I1 < np.inf}
        strained = limits or ["a material was strained beyond what its law allows"]
        return ", or ".join(["an element turned inside out", *strained])

    def examine(self, last: Any, attempt: Any) -> Examination:
        return Examination(self._problem, last, attempt)
