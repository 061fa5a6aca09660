"""The discrete equations of a scene, F(x, control) = 0: the interface of `solve`. Everything in it is created once.

x holds the fields (dimensionless, see `formulation`) and, at the end of the last rank's part, one Lagrange multiplier
for each `ConstrainedMean` support.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from .. import _compat
from ..contact.face import FaceContact
from ..contact.resultants import penetration
from ..contact.step_limit import StepLimit
from ..errors import InputError, together
from ..forms.admissible import WorstValue
from ..forms.constraints import Active, Constraints
from ..forms.formulations import formulate
from ..forms.histories import Histories
from ..forms.history import History
from ..forms.schedule import StepData
from ..forms.step_error import StepError
from ..forms.tangent import Tangent
from ..forms.temperature import Temperature
from ..forms.viscosity import Viscosity
from ..scene.scene import Scene
from .examine import Examination
from .units import Units


class _Stage(NamedTuple):
    """Equations of a setting, from a state on.

    Attributes:
        setting: the `StepData`.
        active: the active constraints.
        place, rate: the constrained owned unknowns are place + rate * control, shape (n,) each.
        means: values of the constrained means.
        left: unbalanced forces that a fading setting removes, over 1 - control, locally owned entries of F; or None.
    """

    setting: StepData
    active: Active
    place: np.ndarray
    rate: np.ndarray
    means: list[float]
    left: np.ndarray | None = None


class Problem(Histories, Units):
    """Residual, tangent and derivative by the control of a scene.

    Attributes:
        scene: the scene.
        forms: its fields, forms and scales (a `Formulation`).
        comm: communicator.
        x: a vector of unknowns; inside `state_context` the unknowns of the state.
        matrix: the tangent, refilled by `tangent`.
        contacts: the scene's contacts (`FaceContact`); present: the active contacts.
        histories: arguments of F besides x and control (`History`); limit: limits of a step (`StepLimit`).
        setting: the present `StepData`; see `enter`.
        admissible: check of the admissibility of the body, and its volume ratios (`Admissible`).
        force_scale: norm of all support forces at the state whose residual was last computed.
    """

    def __init__(self, scene: Scene):
        self.scene, self.forms = scene, formulate(scene)
        self.comm = self.forms.comm
        forms = self.forms
        index_map = forms.space.dofmap.index_map
        self._n = index_map.size_local
        self._buffer = la.vector(index_map, 1)
        self._residual = forms.compile(forms.residual)
        self.contacts = [FaceContact(forms, contact, self.assemble) for contact in scene.contacts]
        forms.faces = self.contacts
        if scene.heat is not None:                              # after the materials, which heat it
            forms.histories.append(scene.heat.history(self))
        self.histories: list[History] = [*(c for c in self.contacts if c.remembers), *forms.histories]
        self.limit = StepLimit(self)
        self.admissible = forms.admissible()
        self._constraints = Constraints(forms, self.assemble)
        last = self.comm.rank == self.comm.size - 1             # it has the multipliers
        self.x = PETSc.Vec().createMPI((self._n + last * len(self._constraints.means), None), comm=self.comm)
        self._stage: Any = None
        self.enter(StepData.first(scene), np.zeros(self.x.getLocalSize()), 0.0)
        self.force_scale = 0.0

    @cached_property
    def _tangent(self) -> Tangent:
        made, stage = Tangent(self.forms, self._constraints, self.symmetric), self._stage
        made.enter(stage.active, stage.setting.rate, True)
        return made

    matrix: PETSc.Mat = cached_property(lambda self: self._tangent.matrix.mat)  # type: ignore[assignment]

    @cached_property
    def _metric(self) -> np.ndarray:
        return np.asarray(np.maximum(self.assemble(self.forms.compile(self.forms.metric_row())), 0))

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns: fields and multipliers, all ranks."""
        return int(self.x.getSize())

    @property
    def n_owned(self) -> int:
        """Number of fields' unknowns that this rank owns."""
        return int(self._n)

    @property
    def symmetric(self) -> bool:
        """True if the tangent is symmetric: so are the parts of all loads, contacts and materials."""
        return all(x.symmetric for x in (*self.scene.loads, *self.scene.contacts, *self.scene.materials.values()))

    @property
    def setting(self) -> StepData:
        """Step data of the present stage."""
        return self._stage.setting

    @property
    def control(self) -> float:
        """The present control of the forms; inside `state_context` the control of the state."""
        return float(self.forms.control.value)

    @property
    def held(self) -> np.ndarray:
        """Local numbers of the owned unknowns that are constrained in the present stage."""
        return self._stage.active.dofs[self._stage.active.owned]

    @property
    def held_rate(self) -> np.ndarray:
        """Derivative of the constrained unknowns by the control, in the order of `held`."""
        return self._stage.rate

    @property
    def has_kinks(self) -> bool:
        """True if F has kinks, where the tangent ahead of a state differs from that behind it (`tangent`)."""
        return bool(self.present)

    @property
    def active_set(self) -> Any:
        """Active set of the last residual, the same on all ranks; hashable; None: no contact."""
        status = tuple(c.increment.status.tobytes() for c in self.present)
        return tuple(self.comm.allgather(status)) if self.present else None

    @property
    def temperature(self) -> Temperature | None:
        """Temperature of the body at the last accepted state, inside `state_context` of that state; None: there is
        none."""
        return self.forms.temperature

    def examine(self, last: Any, attempt: Any) -> Examination:
        """Examine the last good state (or None) and a failed attempt (or None); collective."""
        return Examination(self, last, attempt)

    def bring_in(self, number: int, x: np.ndarray, control: float) -> None:
        """Activate an item of the scene, without history. x: locally owned entries.

        Raises:
            InputError: a tool comes in where the body is.
        """
        for contact in self.contacts:
            if contact.contact is self.scene.items[number]:
                contact.come_in(x, control)
                depth = penetration(contact, x, control)
                if depth > 1e-6 * self.forms.length:
                    raise InputError(f"{contact.contact!r} takes part again where the body is, which reaches"
                                     f" {depth:.6g} into the tool")

    def followed(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on this mesh of points of the first mesh of a run, shape (n, 2), length."""
        preformed = self.scene.preformed
        return points if preformed is None else preformed.followed(self, points)

    @contextlib.contextmanager
    def state_context(self, state: Any) -> Iterator[Problem]:
        """Set the problem to a state inside the context: setting, histories, unknowns (`x`, `forms.w`) and control.

        On leaving, the values before are restored.

        Args:
            state: object with x (locally owned entries), control, time, setting (a `StepData` as plain data, or empty)
                and memory.
        """
        fields, control, clock = self.forms.w.x.array.copy(), self.control, self.forms.clock
        stage, memory, x, predicted = self._stage, self.memory, self.x.array_r.copy(), self._predicted
        try:
            self.restore(state)
            self.x.array_w[:] = state.x
            self.set_state(self.x, state.control)
            yield self
        finally:
            self.memory, self._predicted = memory, predicted
            self._take(stage)
            self.forms.clock = clock
            self.x.array_w[:] = x
            self.forms.w.x.array[:] = fields
            self.forms.control.value = control

    def restore(self, state: Any) -> None:
        """Restore the stage data and history variables of an accepted state, to start a step from it."""
        if self.has_history:
            self.memory = state.memory
        if state.setting:
            self.enter(StepData(**state.setting), state.x, state.control)
        if not self.setting.rate[-1]:
            self.forms.clock = state.time

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """out = F(x, control); sets `force_scale`."""
        stage, multipliers, fields = self._stage, self.set_state(x, control), x.array_r[: self._n]
        values = self._forces(fields, control)
        self.force_scale = np.sqrt(self._dot(values, values))
        for multiplier, row in zip(multipliers, stage.active.rows, strict=True):
            values += multiplier * row
        held = self.held
        values[held] = fields[held] - stage.place - stage.rate * control
        self.fill(out, values, [self._dot(row, fields) - mean if present else multiplier
                                for row, mean, present, multiplier in
                                zip(stage.active.rows, stage.means, stage.active.present, multipliers, strict=True)])
        if stage.left is not None:
            out.array_w += (control - 1) * stage.left

    def reaction(self, number: int, x: PETSc.Vec, control: float) -> float:
        """Force of the body on a driven support (by its number in the scene), along its motion, all ranks.

        Stress length^2 (per depth: stress length): minus the sum of the unbalanced forces at its unknowns.
        """
        left = self.forces(x, control)[self.driven_unknowns(number)].sum()
        forms = self.forms
        return -float(self.comm.allreduce(left, MPI.SUM)) * forms.stress * forms.volume / forms.length

    def driven_unknowns(self, number: int) -> np.ndarray:
        """Return the local numbers of the owned unknowns that a support (its number in the scene) drives."""
        return self._constraints.driven_by(number)

    def forces(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Return the internal less external forces at (x, control), carried by supports; owned, shape (n,)."""
        self.set_state(x, control)
        return self._forces(x.array_r[: self._n], control)

    def body_forces(self, x: np.ndarray, control: float) -> np.ndarray:
        """Return `forces` without contact: reactions of supports and tools. x: locally owned; shape (n,)."""
        self.look_at(x, control)
        return self.assemble(self._residual)

    def look_at(self, x: np.ndarray, control: float) -> None:
        """Set the fields of the forms to x, locally owned entries, and their control."""
        self.forms.control.value = control
        self.place(x)

    @property
    def fading_forces(self) -> np.ndarray | None:
        """Forces on the body, shape (n,), that a fading setting removes as the control goes to 1, or None; owned."""
        return None if self._stage.left is None else self._stage.left[: self._n]

    def _forces(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return `forces` at the state last set."""
        values = self.assemble(self._residual)
        for contact in self.present:
            contact.add_residual(values, fields, control)
        return values

    def folded(self, x: PETSc.Vec, control: float) -> bool:
        """Return True if a hoop stretch or an in-plane determinant is not positive (`Admissible`)."""
        self.set_state(x, control)
        return not self.admissible.holds()

    def furthest_volume_ratio(self, state: Any) -> WorstValue | None:
        """Return the place where J is furthest from 1 in a state, see `Admissible.furthest_volume_ratio`;
        collective."""
        with self.state_context(state):
            return self.admissible.furthest_volume_ratio()

    def volume_error_away(self, state: Any, places: np.ndarray, distance: float) -> float:
        """See `Admissible.volume_error_away`, in a state; collective."""
        with self.state_context(state):
            return self.admissible.volume_error_away(places, distance)

    def inside_out(self) -> tuple[int, int, tuple[float, float]]:
        """See `Admissible.inside_out`; of the state last set."""
        return self.admissible.inside_out()

    def begin(self, old: Any = None) -> None:
        """Prepare the contacts for Newton's method, which begins at a guess ahead of a state (None: of no state)."""
        for contact in self.present:
            contact.begin(*((None, 0.0) if old is None else (old.x[: self._n], old.control)))

    def linearise(self, x: PETSc.Vec, control: float, F: PETSc.Vec) -> None:
        """Ready the tangent at (x, control) for an iteration, and F, the residual there, for the solve with it."""
        if self.contacts:
            values = F.array_r[: self._n].copy()
            for contact in self.present:
                contact.linearise(values, x.array_r[: self._n], control)
            values[self.held] = F.array_r[: self._n][self.held]
            F.array_w[: self._n] = values

    def tangent(self, x: PETSc.Vec, control: float, ahead: bool = False) -> PETSc.Mat:
        """Return dF/dx at (x, control): `matrix`, refilled.

        ahead: the derivative towards the next step, where F has a kink at an accepted state.
        """
        self.set_state(x, control)
        fields = x.array_r[: self._n]
        return self._tangent.matrix.fill([(c.rule.dofs, c.tangent(fields, control, ahead)) for c in self.present])

    def viscosity(self) -> Viscosity:
        """Return the viscosity of the body with its present constraints; to be destroyed."""
        return Viscosity(self._viscosity, self._stage.active.bcs)

    @cached_property
    def _step_error(self) -> StepError:
        return StepError(self)

    def step_error(self, past: Sequence[Any], share: np.ndarray, x: np.ndarray, control: float) -> tuple[float, float]:
        """See `StepError.of`."""
        return self._step_error.estimate(past, share, x, control)

    @cached_property
    def _viscosity(self) -> Any:
        return self.forms.compile(self.forms.viscosity())

    def changes_ahead(self, x: PETSc.Vec, control: float) -> list[np.ndarray]:
        """Return for each active contact the difference of the tangent `ahead` from the last tangent."""
        return [contact.change_ahead(x.array_r[: self._n], control) for contact in self.present]

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec, ahead: bool = False) -> None:
        """out = dF/dcontrol at (x, control); `ahead`: as in `tangent`."""
        self.set_state(x, control)
        values = self._tangent.by_control(self.setting.rate, self.assemble, self._n)
        for contact in self.present:
            contact.add_control_derivative(values, x.array_r[: self._n], control, ahead)
        values[self.held] = -self._stage.rate
        self.fill(out, values)
        if self._stage.left is not None:
            out.array_w += self._stage.left

    def take_temperature(self) -> None:
        """Update constants and friction to a changed temperature; collective.

        Raises:
            InputError: a constant or friction has no value at a temperature.
        """
        together(self.comm, [self.forms.take_temperature, *(contact.take_temperature for contact in self.contacts)])

    def motion(self, control: float) -> np.ndarray:
        """Return the constrained unknowns at their values for a control, all others 0; locally owned entries of x."""
        values = np.zeros(self.x.getLocalSize())
        values[self.held] = self._stage.place + self._stage.rate * control
        return values

    def inner(self, a: PETSc.Vec, b: PETSc.Vec) -> float:
        """Return the mean over the reference volume of the product of two displacement fields (dimensionless)."""
        return self._dot(self._metric * a.array_r[: self._n], b.array_r[: self._n])

    def metric_times(self, a: PETSc.Vec, out: PETSc.Vec) -> None:
        """out with inner(a, b) = out . b."""
        self.fill(out, self._metric * a.array_r[: self._n])

    def set_state(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Set the fields of the forms to x, and their control; return the multipliers, all ranks."""
        self.forms.control.value = control
        self.place(x.array_r)
        multipliers, last = np.zeros(len(self._stage.active.rows)), self.comm.size - 1
        if self.comm.rank == last:
            multipliers[:] = x.array_r[self._n:]
        if last and len(multipliers):
            self.comm.Bcast(multipliers, root=last)
        return multipliers

    def place(self, x: np.ndarray) -> None:
        """Set the fields of the forms to x, locally owned entries, and update the coefficients that depend on them."""
        w = self.forms.w.x
        w.array[: self._n] = x[: self._n]
        w.scatter_forward()
        self.forms.refresh()

    def stiff_state(self, out: PETSc.Vec) -> None:
        """out = a state near the reference configuration with a regular tangent, for the first direction of a path."""
        self.forms.set_stiff()
        self.fill(out, self.forms.w.x.array[: self._n])

    def assemble(self, form: Any) -> np.ndarray:
        """Return the vector of a compiled linear form at the state last set, locally owned entries, shape (n,)."""
        return _compat.assemble_vector(self._buffer, form).copy()

    def assemble_scalar(self, form: Any) -> float:
        """Return the value of a compiled scalar form at the state last set, all ranks."""
        return float(self.comm.allreduce(fem.assemble_scalar(form), MPI.SUM))

    def fill(self, out: PETSc.Vec, values: np.ndarray, tail: list[float] | None = None) -> None:
        """out = values of the owned fields, shape (n,), and of the multipliers (default 0)."""
        array = out.array_w
        array[: self._n] = values
        array[self._n:] = 0.0 if tail is None or self.comm.rank < self.comm.size - 1 else tail

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        if "_tangent" in vars(self):
            self._tangent.matrix.destroy()
        self.x.destroy()

    def enter(self, setting: StepData, x: np.ndarray, control: float) -> None:
        """Enter a setting: from here on F is the residual of the setting, and (x, control) is a state on its path.

        Constrained unknowns stay at their values in x; driven ones have these values at this control. A fading
        setting removes the unbalanced forces at (x, control). x: locally owned entries.
        """
        before = self._stage
        if before is not None and setting == before.setting:
            return
        same = before is not None and before.setting.inactive == setting.inactive
        active = before.active if same else self._constraints.active(set(setting.inactive))
        rate = np.append(setting.rate, 0.0)[active.driver][active.owned]
        place = x[active.dofs[active.owned]] - rate * control
        stage = _Stage(setting, active, place, rate, [self._dot(row, x[: self._n]) for row in active.rows])
        self._take(stage)
        if setting.fading and control < 1:
            at, left = self.x.duplicate(), self.x.duplicate()
            at.array_w[:] = x
            self.residual(at, control, left)
            self._stage = stage._replace(left=left.array_r / (1 - control))
            at.destroy()
            left.destroy()

    def _take(self, stage: _Stage) -> None:
        """Set the forms, the contacts and the matrix to a stage."""
        before, self._stage = self._stage, stage
        if before is stage:
            return
        setting, number = stage.setting, {id(item): i for i, item in enumerate(self.scene.items)}
        self.forms.set_loads(setting)
        for contact in self.contacts:
            i = number[id(contact.contact)]
            contact.enter(setting.base[i], setting.rate[i], i not in setting.inactive)
        self.present = [contact for contact in self.contacts if contact.present]
        if "_tangent" in vars(self):
            self._tangent.enter(stage.active, setting.rate, before is None or before.active is not stage.active)

    def _dot(self, a: np.ndarray, b: np.ndarray) -> float:
        own = float(np.dot(a, b))
        return own if self.comm.size == 1 else float(self.comm.allreduce(own, MPI.SUM))
