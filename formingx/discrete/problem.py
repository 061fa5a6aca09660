"""The discrete equations of a scene, F(x, control) = 0: what `solve` sees. Everything in it is created once.

x holds the fields (dimensionless, see `solid`) and, at the end of the last rank's part, one Lagrange multiplier for
each `MeanHeld` support.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from ..errors import InputError
from ..physics.supports import Held
from ..scene.scene import Scene
from .contact_nodes import NodalContact
from .formulations import formulate
from .matrix import ExtendedMatrix
from .schedule import Setting


class Problem:
    """Residual, tangent and derivative by the control of a scene.

    Attributes:
        scene: the scene.
        forms: its fields, forms and scales (a `Formulation`).
        comm: communicator.
        x: a vector of unknowns to duplicate.
        matrix: the tangent, refilled by `tangent`.
        contacts: the nodal forces of the scene's contacts (`NodalContact`); touching: of those that are there now.
        setting: the `Setting` that x and control are seen under; see `enter`.
        force_scale: norm of all support forces at the state whose residual was last computed.
    """

    def __init__(self, scene: Scene):
        self.scene, self.forms = scene, formulate(scene)
        self.comm = self.forms.comm
        forms = self.forms
        index_map = forms.space.dofmap.index_map
        self._n = index_map.size_local
        self._buffer = la.vector(index_map, 1)
        tangent = ufl.derivative(forms.residual, forms.w, ufl.TrialFunction(forms.space))
        self._residual = forms.compile(forms.residual)
        self._by_control = forms.control_derivative and forms.compile(forms.control_derivative)
        self.contacts = [NodalContact(forms, contact, self.assemble) for contact in scene.contacts]
        folded = ufl.conditional(ufl.gt(forms.J, forms.constant(0.0)), forms.constant(0.0), forms.constant(1.0))
        self._folded = forms.compile(folded * forms.dx)
        self._left: Any = None
        self._motors: list[int] = []
        self._collect()
        self._by_motion = self._lift = None
        if any(thing.constraints() for thing in scene.drivable):
            self._lift = fem.Function(forms.space)              # held unknowns move the others through the tangent
            self._by_motion = forms.compile(ufl.action(tangent, self._lift))
        self._matrix = ExtendedMatrix(forms.compile(tangent), index_map, [bc for _, bc, _, _ in self._holds],
                                      [row for _, row in self._means], self.comm, self.symmetric)
        self.matrix = self._matrix.mat
        self.x = self.matrix.createVecRight()
        self.setting: Any = None
        self.enter(Setting.first(scene), np.zeros(self.x.getLocalSize()), 0.0)
        self._metric = np.maximum(self.assemble(forms.compile(forms.metric_row())), 0)
        self.force_scale = 0.0

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns: fields and multipliers, all ranks."""
        return int(self.x.getSize())

    @property
    def symmetric(self) -> bool:
        """True if the tangent is symmetric: no follower load in the scene."""
        return all(x.symmetric for x in (*self.scene.loads, *self.scene.contacts))

    @property
    def has_kinks(self) -> bool:
        """True if F has kinks, where the tangent ahead of a state differs from that behind it (`tangent`)."""
        return bool(self.touching)

    @property
    def branch(self) -> Any:
        """On which side of its kinks F was when the residual was last computed, the same on all ranks; hashable."""
        return tuple(self.comm.allgather(tuple(c.branch for c in self.touching))) if self.touching else None

    @property
    def memory(self) -> list[Any]:
        """What F depends on besides x and control: of every contact with friction, its last accepted state."""
        return [contact.memory for contact in self.contacts if contact.memory is not None]

    @memory.setter
    def memory(self, memory: list[Any]) -> None:
        for contact, touch in zip([c for c in self.contacts if c.memory is not None], memory, strict=True):
            contact.memory = touch

    @property
    def why_not_finite(self) -> str:
        """What makes a residual infinite or not a number in this scene."""
        limits = {f"{m} came to its limit, I1 < {m.largest_I1:.6g}": None
                  for m in self.scene.materials.values() if m.largest_I1 < np.inf}
        return ", or ".join(["an element turned inside out", *(limits or ["the material left its domain"])])

    def shown(self, control: float) -> tuple[str, float]:
        """What the control stands for, in words, and its value in the user's units."""
        number, things = self.setting.leading, self.scene.things
        if number is None:
            return "control", control
        name = "process time" if number == len(things) else self.scene.column(things[number]).replace("_", " ")
        return name, self.forms.scales[number] * self.setting.amplitude(number, control)

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """out = F(x, control); sets `force_scale`."""
        multipliers, fields = self.set_state(x, control), x.array_r[: self._n]
        values = self._forces(fields, control)
        self.force_scale = np.sqrt(self._dot(values, values))
        for multiplier, row in zip(multipliers, self._rows, strict=True):
            values += multiplier * row
        values[self._held] = fields[self._held] - self._place - self._motion * control
        self.fill(out, values, [self._dot(row, fields) - mean if there else multiplier for row, mean, there, multiplier
                                in zip(self._rows, self._at, self._there, multipliers, strict=True)])
        if self._left is not None:
            out.axpy(control - 1, self._left)

    def reaction(self, number: int, x: PETSc.Vec, control: float) -> float:
        """Force of the body on what a support (its number in the scene) drives, along its motion, all ranks.

        Stress length^2 (per depth: length): of the forces that are left over at the unknowns that it holds.
        """
        self.set_state(x, control)
        dofs = np.unique(np.concatenate([dofs for i, _, dofs, driven in self._holds if i == number and driven]))
        left = self._forces(x.array_r[: self._n], control)[dofs[dofs < self._n]].sum()
        forms = self.forms
        return -float(self.comm.allreduce(left, MPI.SUM)) * forms.stress * forms.volume / forms.length

    def _forces(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Internal less external forces at the state last set, which supports carry; owned part, shape (n,)."""
        values = self.assemble(self._residual)
        for contact in self.touching:
            contact.add_residual(values, fields, control)
        return values

    def folded(self, x: PETSc.Vec, control: float) -> bool:
        """True if an element is turned inside out: J is not positive at some quadrature point."""
        self.set_state(x, control)
        return self.assemble_scalar(self._folded) > 0

    def begin(self) -> None:
        """Newton's method begins."""
        for contact in self.touching:
            contact.begin()

    def linearise(self, x: PETSc.Vec, control: float, F: PETSc.Vec) -> None:
        """Ready the tangent at (x, control) for an iteration, and F, the residual there, for the solve with it."""
        if self.contacts:
            values = F.array_r[: self._n].copy()
            for contact in self.touching:
                contact.linearise(values, x.array_r[: self._n], control)
            values[self._held] = F.array_r[: self._n][self._held]
            F.array_w[: self._n] = values

    def tangent(self, x: PETSc.Vec, control: float, ahead: bool = False) -> PETSc.Mat:
        """dF/dx at (x, control): `matrix`, refilled.

        `ahead`: as it will be in the step ahead of an accepted state, where F has a kink there.
        """
        self.set_state(x, control)
        fields = x.array_r[: self._n]
        return self._matrix.fill([(c.dofs, c.stiffness(fields, control, ahead)) for c in self.touching])

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec, ahead: bool = False) -> None:
        """out = dF/dcontrol at (x, control); `ahead`: as in `tangent`."""
        self.set_state(x, control)
        values = self.assemble(self._by_control) if self._by_control else np.zeros(self._n)
        if self._moving:
            values += self.assemble(self._by_motion)
        for contact in self.touching:
            contact.add_control_derivative(values, x.array_r[: self._n], control, ahead)
        values[self._held] = -self._motion
        self.fill(out, values)
        if self._left is not None:
            out.axpy(1.0, self._left)

    def advance(self, x: np.ndarray, control: float) -> None:
        """A state is accepted: what has a history takes it up. x: own part, shape (n,)."""
        for contact in self.touching:
            contact.advance(x[: self._n], control)

    def remember(self, state: Any) -> None:
        """Go on from a state that was accepted before: its history is what it was then."""
        if state.setting:
            self.enter(Setting(**state.setting), state.x, state.control)
        self.advance(state.x, state.control)
        self.memory = state.memory

    def reach(self, x: np.ndarray, control: float, direction: np.ndarray, slope: float, length: float) -> float:
        """How long a step of at most `length` from x along (direction, slope) may be. Arrays: own part."""
        n = self._n
        return min([c.reach(x[:n], control, direction[:n], slope, length) for c in self.touching], default=length)

    def prepare(self, x: np.ndarray, control: float, direction: np.ndarray, slope: float, length: float) -> None:
        """A step of this length from x along (direction, slope) is about to be taken. Arrays: own part."""
        n = self._n
        for contact in self.touching:
            contact.prepare(x[:n], control, direction[:n], slope, length)

    def too_far(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """True if more happened between two states than one step may bring. Arrays: own part."""
        n = self._n
        return any([c.grew_too_much(old[:n], old_control, new[:n], control) for c in self.touching])

    def motion(self, control: float) -> np.ndarray:
        """The held unknowns at their values for a control, all else 0, shape (owned part of x,)."""
        values = np.zeros(self.x.getLocalSize())
        values[self._held] = self._place + self._motion * control
        return values

    def inner(self, a: PETSc.Vec, b: PETSc.Vec) -> float:
        """Mean over the reference volume of the product of two displacement fields: no mesh, no unit in it."""
        return self._dot(self._metric * a.array_r[: self._n], b.array_r[: self._n])

    def metric_times(self, a: PETSc.Vec, out: PETSc.Vec) -> None:
        """out with inner(a, b) = out . b."""
        self.fill(out, self._metric * a.array_r[: self._n])

    def set_state(self, x: PETSc.Vec, control: float) -> np.ndarray:
        """Put the fields of x and the control where the forms see them; returns the multipliers, all ranks."""
        w = self.forms.w.x
        self.forms.control.value = control
        w.array[: self._n] = x.array_r[: self._n]
        w.scatter_forward()
        if not self._rows:
            return np.zeros(0)
        last = self.comm.size - 1
        return self.comm.bcast(x.array_r[self._n:].copy() if self.comm.rank == last else None, root=last)

    def stiff_state(self, out: PETSc.Vec) -> None:
        """out = a state near rest with a regular tangent, for the first direction of a path: for a solid, rest."""
        self.forms.set_stiff()
        self.fill(out, self.forms.w.x.array[: self._n])

    def assemble(self, form: Any) -> np.ndarray:
        """A compiled linear form at the state last set, owned part, shape (n,)."""
        array = self._buffer.array
        array[:] = 0
        fem.assemble_vector(array, form)
        self._buffer.scatter_reverse(la.InsertMode.add)
        return array[: self._n].copy()

    def assemble_scalar(self, form: Any) -> float:
        """A compiled scalar form at the state last set, all ranks."""
        return float(self.comm.allreduce(fem.assemble_scalar(form), MPI.SUM))

    def fill(self, out: PETSc.Vec, values: np.ndarray, tail: list[float] | None = None) -> None:
        """out = values of the owned fields, shape (n,), and of the multipliers (default 0)."""
        array = out.array_w
        array[: self._n] = values
        array[self._n:] = 0.0 if tail is None or self.comm.rank < self.comm.size - 1 else tail

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._matrix.destroy()
        self.x.destroy()
        if self._left is not None:
            self._left.destroy()

    def enter(self, setting: Setting, x: np.ndarray, control: float) -> None:
        """Take a setting: from here on F is that of the setting, and (x, control) is a state on its path.

        What is held is held where x has it, now or, if it is driven, at this control; if the setting fades what is left
        without balance, that is what makes (x, control) a state. x: own part.
        """
        if setting == self.setting:
            return
        forms, before, off = self.forms, self.setting, set(setting.off)
        self.setting, number = setting, {id(thing): i for i, thing in enumerate(self.scene.things)}
        forms.set_loads(setting)
        for contact in self.contacts:
            i = number[id(contact.contact)]
            contact.base, contact.rate = setting.base[i], setting.rate[i]
        self.touching = [c for c in self.contacts if number[id(c.contact)] not in off]
        if before is None or before.off != setting.off:
            self._hold(off)
        rate = np.append(setting.rate, 0.0)[self._movers]
        self._motion = rate[self._own]
        self._place = x[self._held] - self._motion * control
        self._moving = bool(np.any(np.array(setting.rate)[self._motors])) if self._by_motion else False
        if self._lift is not None:
            self._lift.x.array[:] = 0
            self._lift.x.array[self._holding] = rate
        self._at = [self._dot(row, x[: self._n]) for row in self._rows]
        self._leave(x, control)

    def _leave(self, x: np.ndarray, control: float) -> None:
        """`_left`: the forces without balance that a fading setting takes away, or None."""
        if self._left is not None:
            self._left.destroy()
            self._left = None
        if self.setting.fading and control < 1:
            at, left = self.x.duplicate(), self.x.duplicate()
            at.array_w[:] = x
            self.residual(at, control, left)
            left.scale(1 / (1 - control))
            self._left = left
            at.destroy()

    def _collect(self) -> None:
        """Everything that can be held: `_holds` [(thing's number, bc, local dofs, driven)], `_means` [(number, row)].

        The number is -1 for unknowns that no equation holds.
        """
        forms, zero = self.forms, PETSc.ScalarType(0)
        self._holds: list[tuple[int, Any, np.ndarray, bool]] = []
        self._means: list[tuple[int, np.ndarray]] = []
        for i, support in enumerate(self.scene.things):
            for item in forms.constraints(support):
                if isinstance(item, Held):
                    sub = forms.space.sub(0).sub(item.component)
                    found = self._dofs_of(support, sub, item)
                    self._holds.append((i, fem.dirichletbc(zero, found, sub), found, item.driven))
                else:
                    self._means.append((i, self.assemble(forms.compile(forms.mean_row(item)))))
        for sub, found in forms.idle_unknowns():
            self._holds.append((-1, fem.dirichletbc(zero, found, sub), found, False))
        self._motors = sorted({i for i, _, _, driven in self._holds if driven})

    def _hold(self, off: set[int]) -> None:
        """Hold what is not off: `_held` (owned dofs), `_holding` (all), `_movers` (thing that moves each, or -1),
        `_rows`, `_there` (which of them hold)."""
        holds = [hold for hold in self._holds if hold[0] not in off]
        numbers = np.concatenate([np.zeros(0, dtype=np.int32), *(dofs for _, _, dofs, _ in holds)])
        movers = np.concatenate([np.zeros(0, dtype=int),
                                 *(np.full(len(dofs), i if driven else -1) for i, _, dofs, driven in holds)])
        order = np.argsort(movers < 0, kind="stable")           # where two supports meet, the driven one counts
        self._holding, first = np.unique(numbers[order], return_index=True)
        self._movers, self._own = movers[order][first], self._holding < self._n
        self._held = self._holding[self._own]
        self._there = [i not in off for i, _ in self._means]
        self._rows = [there * row for (_, row), there in zip(self._means, self._there, strict=True)]
        for row in self._rows:
            row[self._held] = 0
        self._matrix.hold([bc for _, bc, _, _ in holds], self._rows)

    def _dofs_of(self, support: Any, sub: Any, item: Held) -> np.ndarray:
        if item.on is not None:
            mesh = self.forms.mesh
            return fem.locate_dofs_topological(sub, mesh.facets.dim, mesh.facets_of(item.on))
        near, point = 1e-8 * self.forms.length, self.forms.nearest(np.array([item.point])).T
        found = fem.locate_dofs_geometrical((sub, sub.collapse()[0]),
                                            lambda X: np.hypot(*(X[:2] - point)) < near)[0]
        if self.comm.allreduce(len(found), MPI.MAX) == 0:
            raise InputError(f"{support!r}: the mesh has no node at this place")
        return found

    def _dot(self, a: np.ndarray, b: np.ndarray) -> float:
        return float(self.comm.allreduce(float(np.dot(a, b)), MPI.SUM))
