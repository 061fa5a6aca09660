r"""Second variation of the energy of an accepted state for modes that vary round the axis (or along the depth).

A mode is

.. math:: u_r = U \cos n\theta, \quad u_z = W \cos n\theta, \quad u_\theta = V \sin n\theta, \quad
    p = Q \cos n\theta

and in plane strain the same with k x3 for n theta. Modes of different n are not coupled. The change H of F by a mode
has entries within the blocks of F (from U, W and the hoop stretch) and across them. By reflection the two parts are
not coupled at second order, so

.. math:: \delta^2 E = \delta^2 E(F + H_{within}) + \delta^2 E(F + H_{across})

with H from `Kinematics.mode_gradient`. Each term is the second derivative of the potential of the scene. One form
serves all n. At n = 0, V is torsion, and U and W give the tangent of the path. Amplitudes are normalised alike at all n
(the mean of cos^2 round the axis is 1/2, not 1).

A follower pressure has an energy only on a closed face or with a fixed rim: the symmetric part of its tangent is used.
Friction has none: a sliding point has the stiffness of the normal traction alone, so it is free along the tool, also
round the axis. This gives a lower bound of critical loads. A relaxing material has its instantaneous stiffness.

The unknowns are (U, W, V + m U, Q), with m = 1 for n = 1 and 0 else. So the quantity that vanishes on the axis is an
unknown.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from ...errors import InputError
from ...forms.loaded_body import LoadedBody
from ...forms.tangent import ExtendedMatrix
from ...physics.kinematics import BLOCK
from ...physics.supports import Constrained, Symmetry

_FREE_MOTION_FORCE = 1e-6
"""Force that a rigid motion causes, over the forces of its single unknowns, below which the motion is free."""


class _BodyWithMode(LoadedBody):
    """Loaded body with a circumferential mode, as `Load.mode_work` expects it.

    mode: amplitudes (u_r, u_z, u_hoop) (UFL, length), `dmode` their variation, H the change of F, (3, 3).
    """

    def __init__(self, forms: Any, mode: Any, dmode: Any, H: Any):
        super().__init__(forms)
        self.mode, self.dmode, self.H = mode, dmode, H


class SecondVariation:
    """Second variation of the energy of a solid at the present state of its problem, for one wave number n at a time.

    A mode is u_r = U cos(n theta), u_z = W cos(n theta), u_theta = V sin(n theta), p = Q cos(n theta). In plane strain
    k x3 replaces n theta. Its unknowns are U, W, V + m U and Q at the nodes, with m = 1 for n = 1 and 0 else. A mode
    antisymmetric about a symmetry plane is possible if the support has `mirror=True`. A membrane, an elastic support,
    or a load without a second variation is an InputError.

    Attributes:
        matrix: symmetric PETSc matrix for the modes of the last `fill`. One unknown of each free rigid motion is
            constrained. This leaves other modes unchanged and makes the matrix regular.
        rigid_motions: rigid motions that the supports and contacts leave free, each a mode, shape (n,), locally owned
            entries.
        negative_pivots: number of negative pivots of `matrix` in a stable state.
        nodes: reference positions of the locally owned nodes, shape (m, 2), length.
        mirrors: names of the symmetry planes about which modes may be antisymmetric.
    """

    def __init__(self, problem: Any):
        forms = problem.forms
        if forms.domain.geometry.dim == 3:
            raise InputError("stability: is not available yet for a sheet in three dimensions")
        if forms.domain.topology.dim != 2:
            raise InputError("stability: a membrane has no bending stiffness: under hoop compression it wrinkles in"
                             " ever shorter waves; look at its stresses, or use a solid model, MixedPressure()")
        for support, _ in forms.elastic_supports:
            raise InputError(f"stability: is not available with an elastic support, {support!r}")
        self.problem, self.comm, self._forms = problem, problem.comm, forms
        self.space = forms.mode_space()
        self._axisymmetric = problem.scene.kinematics.axisymmetric
        self._number, self._m = forms.constant(0.0), forms.constant(0.0)
        self._number_unknowns()
        self.mirrors = [s.on for s in problem.scene.supports if isinstance(s, Symmetry) and s.mirror]
        self._means = list(self._mean_rows())
        self._matrix = ExtendedMatrix(forms.compile(self._form()), self.space.dofmap.index_map, [],
                                      [(row != 0) + (u != 0) for _, row, u in self._means], self.comm, True)
        self.matrix = self._matrix.mat
        self._constrained = np.zeros(0, dtype=np.int32)

    def fill(self, number: float, antisymmetric_about: str | None = None) -> Any:
        """Assemble and return `matrix` at the present state for the modes of a wave number and symmetry.

        In plane strain the number is per length along the depth. antisymmetric_about: name of a symmetry plane.
        """
        problem, m = self.problem, float(self._axisymmetric and number == 1)
        self._number.value, self._m.value = number, m
        self._constrained = self._find_constrained(number, antisymmetric_about)
        owned = self._constrained[self._constrained < self._owned]
        inactive, rows = problem.setting.inactive, []
        for item_number, row, u in self._means:
            rows.append((row - m * u) * (item_number not in inactive))
            rows[-1][owned] = 0
        self._matrix.constrain([fem.dirichletbc(fem.Function(self.space), self._constrained)], rows)
        self._rows = rows
        self.negative_pivots = self._pressures + sum(bool(self.comm.allreduce(int(np.any(row)))) for row in rows)
        fields = problem.x.array_r[: problem.n_owned]
        blocks = [self._contact_stiffness(contact, fields, m) for contact in problem.contact.faces]
        guided = [self._guided_stiffness(fields, m)] if self._axisymmetric else []
        self._matrix.fill([*blocks, *guided])
        self.rigid_motions = self._find_rigid()
        self._constrain_rigid()
        return self.matrix

    def mass(self, x: np.ndarray) -> np.ndarray:
        """Return the lumped mass matrix times a mode, owned entries, shape (n,); pressures have no mass."""
        U, W, V = self._unknowns.T
        m, out = self._m.value, np.zeros_like(x)
        round_axis = self._lumped * (x[V] - m * x[U])
        out[V], out[W], out[U] = round_axis, self._lumped * x[W], self._lumped * x[U] - m * round_axis
        out[self._constrained[self._constrained < self._owned]] = 0
        return out

    def amplitudes(self, x: np.ndarray) -> np.ndarray:
        """Return amplitudes (U, W, V) of a mode, shape (n,), at owned nodes over the length unit, shape (m, 3)."""
        U, W, V = self._unknowns[~self._bubble].T
        return np.column_stack([x[U], x[W], x[V] - self._m.value * x[U]])

    def problem_unknowns(self, x: np.ndarray) -> np.ndarray:
        """Return U, W and pressures of a mode, owned entries, shape (n,), in the order of `Problem.x`."""
        found = np.zeros(self.problem.x.getLocalSize())
        found[: self.problem.n_owned] = x[self._to_mode[: self.problem.n_owned]]
        return found

    def _find_rigid(self) -> list[np.ndarray]:
        """Return free rigid motions of the wave number without force, unit Euclidean norm, owned entries."""
        kinematics, owned = self.problem.scene.kinematics, self._constrained[self._constrained < self._owned]
        R = np.array([self._unknowns_of(mode) for mode in kinematics.rigid_modes(float(self._number.value))])
        if not len(R):
            return []
        penalty = [self.comm.allreduce(R[:, owned] @ R[:, owned].T)]
        penalty += [np.outer(v, v) for v in (self.comm.allreduce(R[:, : self._owned] @ row) for row in self._rows)]
        size, vectors = np.linalg.eigh(sum(penalty))
        free = [vector @ R for s, vector in zip(size, vectors.T) if s < 1e-14]
        return [mode / np.sqrt(self._sum(mode * mode)) for mode in free if self._moves_freely(mode)]

    def _moves_freely(self, mode: np.ndarray) -> bool:
        """Return True if a rigid motion, owned entries (n,), causes no force: its product with `matrix` is 0."""
        x, y, diagonal = self.matrix.createVecRight(), self.matrix.createVecRight(), self.matrix.getDiagonal()
        x.array_w[:] = mode
        self.matrix.mult(x, y)
        forces = y.norm()
        diagonal.array_w[:] = diagonal.array_r * mode
        single = diagonal.norm()
        for vector in (x, y, diagonal):
            vector.destroy()
        return bool(forces < _FREE_MOTION_FORCE * single)

    def _constrain_rigid(self) -> None:
        """Constrain one unknown in `matrix` for each rigid motion that supports and contacts leave free.

        It is the unknown in which the motion is largest. Before it is chosen, multiples of the earlier motions are
        subtracted from the motion, so that it vanishes in the unknowns that are constrained already.
        """
        first, remaining = self.matrix.getOwnershipRange()[0], [mode.copy() for mode in self.rigid_motions]
        rows = []
        while remaining:
            mode = remaining.pop(0)
            largest = int(np.argmax(abs(mode))) if len(mode) else 0
            parts = self.comm.allgather((float(abs(mode).max(initial=0.0)), first + largest,
                                         [float(entry[largest]) if len(mode) else 0.0 for entry in [mode, *remaining]]))
            _, row, (pivot, *others) = max(parts, key=lambda part: part[0])
            rows.append(row)
            remaining = [entry - other / pivot * mode for entry, other in zip(remaining, others, strict=True)]
        if rows:
            self.matrix.zeroRowsColumns(rows if self.comm.rank == 0 else [], 1.0)

    def _sum(self, values: np.ndarray) -> float:
        """Return the sum of the locally owned entries `values`, shape (n,), over all ranks."""
        return float(self.comm.allreduce(values.sum()))

    def _form(self) -> Any:
        """Return the bilinear form (UFL) of the second variation of energy and work of loads, dimensionless."""
        forms, kinematics = self._forms, self.problem.scene.kinematics
        h, v, w = fem.Function(self.space), ufl.TestFunction(self.space), ufl.TrialFunction(self.space)

        def displacement(mode: Any) -> Any:
            """Return the radial, axial and hoop displacement amplitudes of a mode (UFL, shape (3,), length)."""
            U, W, V = (ufl.split(mode)[0][i] for i in range(3))
            return forms.constant(forms.length) * ufl.as_vector([U, W, V - self._m * U])

        def gradient(mode: Any) -> Any:
            """Return the change of the deformation gradient by a mode (UFL, shape (3, 3))."""
            return kinematics.mode_gradient(displacement(mode), forms.X, self._number)
        F, H = forms.elastic_F, forms.elastic(gradient(h))

        def changed(within: bool) -> Any:
            """Return F plus entries of H in the blocks of F (section and hoop) if `within`, else outside (UFL, (3, 3)).
            """
            return ufl.as_tensor([[(F[i, j] if (i, j) in BLOCK else 0) + (H[i, j] if ((i, j) in BLOCK) is within
                                                                            else 0)
                                   for j in range(3)] for i in range(3)])
        pressures_now, change = ufl.split(forms.w)[1:], ufl.split(h)[1:]
        pressures_changed = [p + q for p, q in zip(pressures_now, change, strict=True)]
        scale, energy = forms.constant(1 / (forms.stress * forms.volume)), 0
        for _, names in forms.bodies:
            for F_changed, pressures in ((changed(True), pressures_changed), (changed(False), pressures_now)):
                for density, metadata in forms.elastic_densities(names, F_changed, pressures):
                    energy += forms.weighted(scale * density, names, metadata)
        form = ufl.replace(ufl.derivative(ufl.derivative(energy, h, v), h, w), {h: ufl.zero(h.ufl_shape)})
        half = forms.constant(0.5 / (forms.stress * forms.volume))
        for load, value in forms.load_values:
            for a, b in ((v, w), (w, v)):
                work = load.mode_work(_BodyWithMode(forms, displacement(b), displacement(a), gradient(b)), value)
                form = form if work is None else form - half * work
        return form

    def _number_unknowns(self) -> None:
        """Set nodes, their unknowns (radial U, axial W, hoop V), and the map from the problem's to a mode's."""
        forms, problem = self._forms, self.problem
        index_map, old, new = self.space.dofmap.index_map, forms.space, self.space
        self._owned, size = index_map.size_local, index_map.size_local + index_map.num_ghosts
        ours = old.dofmap.index_map
        self._to_mode = np.zeros(ours.size_local + ours.num_ghosts, dtype=np.int32)
        components = range(forms.scene.kinematics.components)
        pairs = [(old.sub(0).sub(i), new.sub(0).sub(i)) for i in components]
        pairs += [(old.sub(i), new.sub(i)) for i in range(1, old.num_sub_spaces)]
        for a, b in pairs:
            self._to_mode[np.asarray(a.dofmap.list)] = np.asarray(b.dofmap.list)
        lists = [np.asarray(new.sub(0).sub(i).dofmap.list) for i in range(3)]
        all_U, first = np.unique(lists[0], return_index=True)
        all_W, all_V = (found.ravel()[first] for found in lists[1:])
        self._V_of = np.zeros(size, dtype=np.int32)
        self._V_of[all_U] = all_V
        old_lists = [np.asarray(old.sub(0).sub(i).dofmap.list).ravel()[first] for i in components]
        bubble = (first % lists[0].shape[1]) >= 6
        axis, numbers = new.sub(0).sub(0).collapse()
        X = np.zeros((size, len(components)))                           # bubble unknowns are no nodal values
        place = fem.Function(axis)
        for i in components:
            place.interpolate(lambda X, i=i: X[i])
            X[np.asarray(numbers), i] = place.x.array
        on_axis = self._axisymmetric & (X[all_U, 0] < 1e-9 * forms.length) & ~bubble
        self._axis = np.column_stack([all_U, all_W, all_V])[on_axis]
        own = all_U < self._owned
        self._unknowns = np.column_stack([all_U, all_W, all_V])[own]
        self._old, self._bubble, self._X = np.column_stack(old_lists)[own], bubble[own], X[all_U[own]]
        self.nodes = self._X[~self._bubble]
        ones, mass = problem.x.duplicate(), problem.x.duplicate()
        ones.set(1.0)
        problem.metric_times(ones, mass)
        self._lumped = mass.array_r[self._old[:, 0]].copy()
        ones.destroy()
        mass.destroy()
        idle = [(np.asarray(dofs), dofs[dofs < ours.size_local]) for _, dofs in forms.idle_unknowns()]
        self._idle = [self._to_mode[dofs] for dofs, _ in idle]
        mine = sum(int(np.sum(np.unique(old.sub(i).dofmap.list) < ours.size_local))
                   for i in range(1, old.num_sub_spaces)) - sum(len(own) for _, own in idle)
        self._pressures = int(self.comm.allreduce(mine))

    def _dofs(self, component: int, item: Any) -> np.ndarray:
        """Return local unknowns, with ghosts, that a support constrains in U, W or V + m U (component 0, 1, 2)."""
        space, forms = self.space.sub(0).sub(component), self._forms
        if item.on is not None:
            return fem.locate_dofs_topological(space, 1, forms.mesh.facets_of(item.on))
        near, point = 1e-8 * forms.length, np.array(item.point)
        return fem.locate_dofs_geometrical((space, space.collapse()[0]),
                                           lambda X: np.hypot(X[0] - point[0], X[1] - point[1]) < near)[0]

    def _find_constrained(self, number: float, antisymmetric_about: str | None) -> np.ndarray:
        """Return the local numbers of the constrained unknowns of modes, with ghosts.

        A boundary or node constrained in r and z, such as a clamped rim, is also constrained round the axis.
        """
        problem, constrained, supports = self.problem, [*self._idle], {0: [], 1: []}     # type: ignore[var-annotated]
        for i, scene_item in enumerate(problem.scene.items):
            items = [] if i in problem.setting.inactive else self._forms.constraints(scene_item)
            for item in items:
                if isinstance(item, Constrained):
                    if isinstance(scene_item, Symmetry) and scene_item.mirror and scene_item.on == antisymmetric_about:
                        constrained += [self._dofs(c, item) for c in (1 - item.component, 2)]
                    else:
                        constrained.append(self._dofs(item.component, item))
                        supports[item.component].append(item)
        empty = np.zeros(0, dtype=np.int32)
        facets = [np.concatenate([empty, *(self._forms.mesh.facets_of(item.on) for item in found
                                          if item.on is not None)]) for found in supports.values()]
        both = np.intersect1d(*facets).astype(np.int32)
        fixed_round_axis = [fem.locate_dofs_topological(self.space.sub(0).sub(2), 1, both)]
        fixed_round_axis += [self._dofs(2, item) for item in supports[0] if item.on is None
                    and any(item.point == other.point for other in supports[1])]
        marks = np.zeros(len(self._V_of), dtype=bool)
        marks[np.concatenate(constrained + fixed_round_axis)] = True
        U, W, V = self._axis.T
        fixed = marks[V]
        marks[V] = True
        marks[U], marks[W] = (fixed, True) if number == 1 else (True, marks[W] | (number > 1))
        return np.flatnonzero(marks).astype(np.int32)

    def _mean_rows(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Yield (item number, row of each constraint of a mean displacement, row to subtract from it for one wave).

        Both rows have the owned unknowns. A mean radial and axial constraint also fixes the mean V; the third unknown
        is V + U for one wave, so U is subtracted.
        """
        forms, problem = self._forms, self.problem
        n = problem.n_owned
        for number, scene_item in enumerate(problem.scene.items):
            means = {item.component: item for item in forms.constraints(scene_item)
                     if not isinstance(item, Constrained)}
            for item in means.values():
                row = np.zeros(self._owned)
                row[self._to_mode[:n]] = problem.assemble(forms.compile(forms.mean_row(item)))
                yield number, row, np.zeros(self._owned)
                if item.component == 0 and 1 in means:
                    round_axis = np.zeros(self._owned)
                    round_axis[self._V_of[: self._owned][row != 0]] = row[row != 0]
                    yield number, round_axis, row

    def _contact_stiffness(self, contact: Any, fields: np.ndarray, m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the unknowns, shape (n, k), and stiffness matrices, shape (n, k, k), of the n points of a contact.

        The k unknowns of a point are U and W of its nodes, then their third unknowns V + m U.
        """
        plane, turn = contact.mode_stiffness(fields, self.problem.control)
        dofs = self._to_mode[contact.rule.dofs]
        k = dofs.shape[1]
        values = np.zeros((len(dofs), k + k // 2, k + k // 2))
        values[:, :k, :k] = plane
        values[:, 0:k:2, 0:k:2] += m**2 * turn
        values[:, 0:k:2, k:] = values[:, k:, 0:k:2] = -m * turn
        values[:, k:, k:] = turn
        return np.column_stack([dofs, self._V_of[dofs[:, ::2]]]), values

    def _guided_stiffness(self, fields: np.ndarray, m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return unknowns (n, 3) and stiffness matrices (n, 3, 3) from support forces f of nodes fixed in r alone.

        A hoop displacement V moves such a node along a circle, inwards by V^2/(2 r), so the second variation is -f
        V^2/r. The third unknown is V + m U.
        """
        r = self._X[:, 0] + self._forms.length * fields[self._old[:, 0]]
        constrained = np.zeros(len(self._V_of), dtype=bool)
        constrained[self._constrained] = True
        guided = constrained[self._unknowns[:, 0]] & ~constrained[self._unknowns[:, 2]]
        force = self.problem.forces(self.problem.x, self.problem.control)[self._old[guided, 0]]
        turn = -self._forms.length * force / r[guided]
        values = np.zeros((len(turn), 3, 3))
        values[:, 0, 0], values[:, 2, 2] = m**2 * turn, turn
        values[:, 0, 2] = values[:, 2, 0] = -m * turn
        return self._unknowns[guided], values

    def _unknowns_of(self, mode: Any) -> np.ndarray:
        """Return a rigid motion, a function of positions (k, 2) to amplitudes (k, 3), as a mode (n,), owned entries."""
        forms, fields = self._forms, self.problem.x.array_r
        u = forms.length * fields[self._old]
        values = mode(self._X + u) / forms.length
        x = np.zeros(self.matrix.getLocalSize()[0])
        U, W, V = self._unknowns.T
        x[U], x[W], x[V] = values[:, 0], values[:, 1], values[:, 2] + self._m.value * values[:, 0]
        return x

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._matrix.destroy()
