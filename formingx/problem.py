"""The discrete equations of a scene, F(x, control) = 0: what `solve` sees. Everything in it is created once.

x holds the fields (dimensionless, see `solid`) and, at the end of the last rank's part, one Lagrange multiplier for
each `MeanHeld` support.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from .errors import InputError
from .extended import ExtendedMatrix
from .membrane import MidSurface
from .nodal import NodalContact
from .physics.supports import Held
from .scene import Scene
from .solid import Solid

_FORMULATIONS = {"solid": Solid, "membrane": MidSurface}


class Problem:
    """Residual, tangent and derivative by the control of a scene.

    Attributes:
        scene: the scene.
        forms: its fields, forms and scales (a `Formulation`).
        comm: communicator.
        x: a vector of unknowns to duplicate.
        matrix: the tangent, refilled by `tangent`.
        contacts: the nodal forces of the scene's contacts (`NodalContact`) that are active.
        force_scale: norm of all support forces at the state whose residual was last computed.
    """

    def __init__(self, scene: Scene):
        self.scene, self.forms = scene, _FORMULATIONS[scene.model.body](scene)
        self.comm = self.forms.comm
        forms = self.forms
        index_map = forms.space.dofmap.index_map
        self._amplitudes = list(dict.fromkeys(forms.amplitudes.values()))
        self._n = index_map.size_local
        self._buffer = la.vector(index_map, 1)
        tangent = ufl.derivative(forms.residual, forms.w, ufl.TrialFunction(forms.space))
        self._residual = forms.compile(forms.residual)
        self._by_control = [forms.compile(f) for f in (forms.control_derivative,) if f is not None]
        self._contacts = [NodalContact(forms, contact, self.assemble) for contact in scene.contacts]
        folded = ufl.conditional(ufl.gt(forms.J, forms.constant(0.0)), forms.constant(0.0), forms.constant(1.0))
        self._folded = forms.compile(folded * forms.dx)
        self._hold(tangent)
        self.drive(scene.driven, 0.0)
        self._matrix = ExtendedMatrix(forms.compile(tangent), index_map, self._bcs, self._rows, self.comm,
                                      self.symmetric)
        self.matrix = self._matrix.mat
        self.x = self.matrix.createVecRight()
        self._metric = np.maximum(self.assemble(forms.compile(forms.metric_row())), 0)
        self.force_scale = 0.0

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns: fields and multipliers, all ranks."""
        return int(self.x.getSize())

    @property
    def symmetric(self) -> bool:
        """True if the tangent is symmetric: no follower load in the scene."""
        return all(getattr(x, "symmetric", False) for x in (*self.scene.loads, *self.scene.contacts))

    @property
    def contacts(self) -> list[NodalContact]:
        """The contacts that are active."""
        return [contact for contact in self._contacts if contact.active]

    @property
    def setting(self) -> tuple:
        """What a control means: what is driven, where everything else stands, which contacts are active."""
        return (self.forms.driven, tuple(a.line for a in self._amplitudes),
                tuple(contact.active for contact in self._contacts))

    @setting.setter
    def setting(self, setting: tuple) -> None:
        self.forms.driven, lines, active = setting
        for amplitude, line in zip(self._amplitudes, lines, strict=True):
            amplitude.line = line
        for contact, on in zip(self._contacts, active, strict=True):
            contact.active = on
        if self._lift is not None:
            self._lift.x.array[self._lifted] = sum(a.rate * moved for a, moved in self._all_moves)

    def drive(self, thing: Any, control: float, without: Sequence[Any] = ()) -> float:
        """From a control on, `thing` is driven, all else stays where it is; returns the control that says the same."""
        driven = self.forms.amplitudes.get(thing)
        now = 0.0 if driven is None else driven.at(control)
        self.setting = (thing, tuple((0.0, 1.0) if a is driven else (a.at(control), 0.0) for a in self._amplitudes),
                        tuple(contact.contact not in without for contact in self._contacts))
        return now

    @property
    def has_kinks(self) -> bool:
        """True if F has kinks, where the tangent ahead of a state differs from that behind it (`tangent`)."""
        return bool(self.contacts)

    @property
    def branch(self) -> Any:
        """On which side of its kinks F was when the residual was last computed, the same on all ranks; hashable."""
        return tuple(self.comm.allgather(tuple(c.branch for c in self.contacts))) if self.contacts else None

    @property
    def memory(self) -> list[Any]:
        """What F depends on besides x and control: of every contact with friction, its last accepted state."""
        return [contact.memory for contact in self._contacts if contact.memory is not None]

    @memory.setter
    def memory(self, memory: list[Any]) -> None:
        for contact, touch in zip([c for c in self._contacts if c.memory is not None], memory, strict=True):
            contact.memory = touch

    @property
    def why_not_finite(self) -> str:
        """What makes a residual infinite or not a number in this scene."""
        limits = {f"{m} came to its limit, I1 < {m.largest_I1:.6g}": None
                  for m in self.scene.materials.values() if m.largest_I1 < np.inf}
        return ", or ".join(["an element turned inside out", *(limits or ["the material left its domain"])])

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """out = F(x, control); sets `force_scale`."""
        multipliers = self.set_state(x, control)
        values, fields = self.assemble(self._residual), x.array_r[: self._n]
        for contact in self.contacts:
            contact.add_residual(values, fields, control)
        self.force_scale = np.sqrt(self._dot(values, values))
        for multiplier, row in zip(multipliers, self._rows, strict=True):
            values += multiplier * row
        values[self._held] = fields[self._held] - self._held_at(control)
        self.fill(out, values, [self._dot(row, fields) for row in self._rows])

    def folded(self, x: PETSc.Vec, control: float) -> bool:
        """True if an element is turned inside out: J is not positive at some quadrature point."""
        self.set_state(x, control)
        return self.assemble_scalar(self._folded) > 0

    def begin(self) -> None:
        """Newton's method begins."""
        for contact in self.contacts:
            contact.begin()

    def linearise(self, x: PETSc.Vec, control: float, F: PETSc.Vec) -> None:
        """Ready the tangent at (x, control) for an iteration, and F, the residual there, for the solve with it."""
        if self.contacts:
            values = F.array_r[: self._n].copy()
            for contact in self.contacts:
                contact.linearise(values, x.array_r[: self._n], control)
            values[self._held] = F.array_r[: self._n][self._held]
            F.array_w[: self._n] = values

    def tangent(self, x: PETSc.Vec, control: float, ahead: bool = False) -> PETSc.Mat:
        """dF/dx at (x, control): `matrix`, refilled.

        `ahead`: as it will be in the step ahead of an accepted state, where F has a kink there.
        """
        self.set_state(x, control)
        fields = x.array_r[: self._n]
        return self._matrix.fill([(c.dofs, c.stiffness(fields, control, ahead)) for c in self.contacts])

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """out = dF/dcontrol at (x, control)."""
        self.set_state(x, control)
        values = sum((self.assemble(form) for form in self._by_control), np.zeros(self._n))
        for contact in self.contacts:
            contact.add_control_derivative(values, x.array_r[: self._n], control)
        values[self._held] = -sum((a.rate * moved for a, moved in self._moves), np.zeros(len(self._held)))
        self.fill(out, values)

    def advance(self, x: np.ndarray, control: float) -> None:
        """A state is accepted: what has a history takes it up. x: own part, shape (n,)."""
        for contact in self._contacts:
            contact.advance(x[: self._n], control)

    def remember(self, state: Any) -> None:
        """Go on from a state that was accepted before: its history is what it was then."""
        self.advance(state.x, state.control)
        self.memory = state.memory

    def reach(self, x: np.ndarray, control: float, direction: np.ndarray, slope: float, length: float) -> float:
        """How long a step of at most `length` from x along (direction, slope) may be. Arrays: own part."""
        n = self._n
        return min([c.reach(x[:n], control, direction[:n], slope, length) for c in self.contacts], default=length)

    def prepare(self, x: np.ndarray, control: float, direction: np.ndarray, slope: float, length: float) -> None:
        """A step of this length from x along (direction, slope) is about to be taken. Arrays: own part."""
        n = self._n
        for contact in self.contacts:
            contact.prepare(x[:n], control, direction[:n], slope, length)

    def too_far(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """True if more happened between two states than one step may bring. Arrays: own part."""
        n = self._n
        return any([c.grew_too_much(old[:n], old_control, new[:n], control) for c in self.contacts])

    def motion(self, control: float) -> np.ndarray:
        """The held unknowns at their values for a control, all else 0, shape (owned part of x,)."""
        values = np.zeros(self.x.getLocalSize())
        values[self._held] = self._held_at(control)
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

    def _hold(self, tangent: Any) -> None:
        """Collect what is held: `_held` (owned dofs), `_moves` ((amplitude, their value per it)), `_bcs`, `_rows`."""
        forms, zero = self.forms, PETSc.ScalarType(0)
        self._bcs, dofs, owners, means = [], [np.zeros(0, dtype=np.int32)], [np.zeros(0, dtype=int)], []
        movers = [x for x in forms.amplitudes if hasattr(x, "constraints")]
        for support in self.scene.supports:
            for item in forms.constraints(support):
                if not isinstance(item, Held):
                    means.append(forms.compile(forms.mean_row(item)))
                    continue
                sub = forms.space.sub(0).sub(item.component)
                found = self._dofs_of(support, sub, item)
                self._bcs.append(fem.dirichletbc(zero, found, sub))
                dofs.append(found)
                owner = movers.index(support) if item.driven else len(movers)
                owners.append(np.full(len(found), owner))
        for sub, found in forms.idle_unknowns():
            self._bcs.append(fem.dirichletbc(zero, found, sub))
            dofs.append(found)
            owners.append(np.full(len(found), len(movers)))
        numbers, owner = np.concatenate(dofs), np.concatenate(owners)
        order = np.argsort(owner, kind="stable")                # where two supports meet, the driven one counts
        held, first = np.unique(numbers[order], return_index=True)
        own, amplitudes = held < self._n, [forms.amplitudes[mover] for mover in movers]
        self._all_moves = [(a, a.scale / forms.length * (owner[order][first] == i)) for i, a in enumerate(amplitudes)]
        self._held, self._moves = held[own], [(a, moved[own]) for a, moved in self._all_moves]
        self._rows = [self.assemble(form) for form in means]
        for row in self._rows:
            row[self._held] = 0
        self._lift, self._lifted = fem.Function(forms.space) if movers else None, held
        if movers:                                               # held unknowns move the others through the tangent
            self._by_control.append(forms.compile(ufl.action(tangent, self._lift)))

    def _held_at(self, control: float) -> np.ndarray:
        """Values of the owned held unknowns."""
        return sum((a.at(control) * moved for a, moved in self._moves), np.zeros(len(self._held)))

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
