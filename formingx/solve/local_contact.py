r"""Local solve for the few contact points whose gap closes, or whose status changes between Newton iterations.

A Newton iteration linearises the contact law of each point at the status (open, stick, slip) of the iteration before.
The iteration can cycle where the statuses of points depend on each other. Where gaps close, at the outer edge of the
ramp of the contact law, an iteration only halves the penetration. The local solve replaces the body by its compliance C
at these few points, the inverse tangent condensed to them. To first order their motions y satisfy

.. math:: y - y_0 + C \, (f(y) - f_0 - S_0 \, y) = 0,

with the contact law f and its linearisation f_0 + S_0 y in the iteration, which led to y_0. This small problem is
solved by itself. For a linear f the solution is Woodbury's formula, which updates a tangent for a few changed
stiffnesses.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ..physics.contact_law import Tractions
from ..ranks import combined, listed
from .equations import Array, Equations
from .linear import CONDENSATION, DirectSolver

Border: TypeAlias = Callable[[Array], Array]
"""Function that maps solutions V = K^-1 E, shape (n, m), to the bordered system, in place; it returns the changes of
the control, shape (m,)."""

Moved: TypeAlias = Callable[[Array, Array | float], Array]
"""Linear function of an update of the unknowns, shape (n,), and of the control; it returns motions, shape (k,). Several
updates are columns: it maps the shapes (n, m) and (m,) to (k, m)."""


@dataclass(frozen=True)
class BorderedTangent:
    r"""Border of the linear system of F = 0 with a constraint c = 0, as a function.

    It maps a solution V = K^-1 E with the tangent K to the solution (V', dlambda) of the bordered system:

    .. math:: \Delta\lambda = -\frac{\nabla c \cdot V}{s}, \qquad V' = V + b \, \Delta\lambda

    Here s is the slope, the derivative of c with respect to the control along the path.

    Attributes:
        gradient: vector dc/dx.
        b: vector dx/dcontrol along the path.
        slope: total derivative dc/dcontrol along the path.
    """

    gradient: PETSc.Vec
    b: PETSc.Vec
    slope: float

    def __call__(self, V: Array) -> Array:
        """Map K^-1 E, owned rows (n, m), to the bordered system in place; return changes of the control (m,)."""
        steps: Array = -combined(self.b.comm.tompi4py(), self.gradient.array_r @ V) / self.slope
        V += np.outer(self.b.array_r, steps)
        return steps


class BorderedColumns:
    """Solutions of the bordered system for m right-hand sides, such as unit forces at contact points.

    The bordered system is K dx = E, E of shape (n, m), for the factorised tangent K, with the constraint of the step as
    a further row. `border` maps K^-1 E to it in place, and returns the changes of the control, shape (m,).

    Attributes:
        steps: change of the control for each right-hand side, shape (m,).
    """

    def __init__(self, solver: DirectSolver, E: Array, border: Border):
        self._values = solver.solve_all(E)
        self.steps = border(self._values)

    def motions(self, moved: Moved) -> Array:
        """Return the motions of contact points, shape (k, m), length; `moved` maps (dx, dcontrol) to these motions."""
        return np.asfortranarray(moved(self._values, self.steps))         # a column of each force in one piece

    def update(self, factors: Array) -> tuple[Array, float]:
        """Return the updates of x, shape (n,), and of the control by factors of the right-hand sides, shape (m,)."""
        return self._values @ factors, float(self.steps @ factors)

    def updates(self, factors: Array) -> Array:
        """Return the updates of x, shape (n, k), by k columns of factors of the right-hand sides, shape (m, k)."""
        return self._values @ factors


class CondensedColumns:
    """Solutions of the bordered system (`BorderedColumns`) for m right-hand sides that are zero in most rows.

    Only the entries of K^-1 in the nonzero `rows`, shape (k,), of the right-hand sides are computed: `inverse`, shape
    (k, k). They give the solutions in these rows, and so the motions of contact points that depend on no other
    unknowns. One solution with the transposed K gives the changes of the control for all right-hand sides. Each update
    of all unknowns takes one solution with K.

    Attributes:
        steps: change of the control for each right-hand side, shape (m,).
    """

    def __init__(self, solver: DirectSolver, E: Array, border: BorderedTangent, inverse: Array, rows: Array):
        self._solver, self._rows, self._E, self._border = solver, rows, E[rows], border
        self._found = inverse @ self._E
        adjoint = border.b.duplicate()
        solver.solve_transposed(border.gradient, adjoint)
        self.steps = -(adjoint.array_r[rows] @ self._E) / border.slope
        adjoint.destroy()

    def motions(self, moved: Moved) -> Array:
        """Return the motions of contact points, shape (k, m), length; `moved` maps (dx, dcontrol) to these motions."""
        V = np.zeros((self._border.b.getLocalSize(), self._found.shape[1]))
        V[self._rows] = self._found
        return moved(V, np.zeros(V.shape[1])) + np.outer(moved(self._border.b.array_r, 1.0), self.steps)

    def update(self, factors: Array) -> tuple[Array, float]:
        """Return the updates of x, shape (n,), and of the control by factors of the right-hand sides, shape (m,)."""
        rhs, out, step = self._border.b.duplicate(), self._border.b.duplicate(), float(self.steps @ factors)
        rhs.array_w[:] = 0.0
        rhs.array_w[self._rows] = self._E @ factors
        self._solver.solve(rhs, out)
        dx = out.array_r + step * self._border.b.array_r
        rhs.destroy()
        out.destroy()
        return dx, step

    def updates(self, factors: Array) -> Array:
        """Return the updates of x, shape (n, k), by k columns of factors of the right-hand sides, shape (m, k)."""
        return np.array([self.update(column)[0] for column in factors.T]).T


def columns(solver: DirectSolver, E: Array, border: Border) -> BorderedColumns | CondensedColumns:
    """Solve the bordered system for right-hand sides E, locally owned rows, shape (n, m); K is the factorised tangent.

    Entries of K^-1 are used if they cost less than m solutions and `border` is a `BorderedTangent`.
    """
    worthwhile = len(E) >= CONDENSATION.min_rows and E.shape[1] >= CONDENSATION.min_columns
    if isinstance(border, BorderedTangent) and worthwhile:
        rows = np.flatnonzero(E.any(axis=1))
        inverse = solver.inverse(rows)
        if inverse is not None:
            return CondensedColumns(solver, E, border, inverse, rows)
    return BorderedColumns(solver, E, border)


@dataclass(frozen=True)
class LocalContact:
    """Settings of the local solve for a few contact points.

    The ramp is the range of gaps in which the contact stiffness grows from zero.

    Attributes:
        max_points: largest number of points in a local solve; with more points Newton's method continues without it.
            The prediction of contact events solves for at most as many sliding points.
        max_changes: number of changed points up to which Woodbury's formula costs less than another factorisation.
        max_iterations: largest number of iterations of the local solve.
        full_corrections: number of full corrections at the start, which may cycle. In later corrections sticking points
            stop near the outer edge of the ramp. If a point slides, a correction that increases the residual is halved.
        max_halvings: largest number of halvings of a correction. More halvings would stall at a kink of the law.
        kept_depth: if a correction would move a point out of the ramp, the point stops at this fraction of the depth
            that it had in the ramp before the correction. `entry_depth` grows by its inverse from one entry to the
            next.
        min_depth: depth in the ramp, over its width, below which a point may leave the ramp.
        entry_depth: depth in the ramp, over its width, at which a point stops when it enters the ramp again.
        accuracy: tolerance of the motions of the points, over the half-width of the ramp.
    """

    max_points: int = 80
    max_changes: int = 3
    max_iterations: int = 40
    full_corrections: int = 8
    max_halvings: int = 4
    kept_depth: float = 0.1
    min_depth: float = 1e-9
    entry_depth: float = 1e-6
    accuracy: float = 1e-4


LOCAL = LocalContact()


class LocalSolve:
    """Local solve for the contact points whose gap closed, or whose status changed, in one run of Newton's method.

    Attributes:
        failed: number of local solves without a solution that satisfies the contact law.
    """

    def __init__(self, problem: Equations):
        self._problem, self._contacts = problem, problem.contact.faces
        self._marked: list[Array] = []
        self._status: list[Array] = []
        self.failed = 0

    def mark_changes(self) -> None:
        """Mark points whose gap closed or status changed since the last call, once after each linearisation."""
        now = [contact.increment.last.status for contact in self._contacts]
        self._marked = self._marked or [contact.increment.newly_closed for contact in self._contacts]
        for mark, a, b in zip(self._marked, self._status, now):
            mark |= a != b
        self._status = now

    def correct(self, solver: DirectSolver, dx: PETSc.Vec, step: float, border: Border) -> float:
        """Correct a Newton update (dx in place, step of the control) so that marked points satisfy the contact law.

        `solver` has the factors of K. `border` maps K^-1 E, shape (n, m), to the bordered system in place, and returns
        dcontrol, shape (m,). Return the new step; without a solution nothing changes.
        """
        for _ in range(4):
            chosen = [np.flatnonzero(mark) for mark in self._marked]
            points = combined(self._problem.comm, sum(map(len, chosen)), MPI.SUM)
            if not 0 < points <= LOCAL.max_points:
                return step
            small = _Points(self._problem, chosen, solver, border)
            change = small.solve(dx, step)
            if change is None:
                self.failed += 1
                return step
            correction, step_correction = change
            if not self._mark_further(dx.array_r + correction, step + step_correction):
                break
        dx.array_w += correction
        return step + step_correction

    def _mark_further(self, dx: Array, step: float) -> bool:
        """Mark the points whose status would change in a Newton update, dx of shape (n,); True if any rank marked one.

        The direction of sliding that the update gives to marked points is stored for the next linearisation.
        """
        found = False
        for contact, mark, status in zip(self._contacts, self._marked, self._status):
            law = contact.increment.after(contact.relative_motion(dx, step))
            new = (law.status != status) & ~mark
            mark |= new
            found |= bool(new.any())
            contact.increment.expect(mark, law.sense)
        return bool(combined(self._problem.comm, found, MPI.LOR))


Update: TypeAlias = Callable[[Array, float], "Array | None"]
"""Function (V, step) that returns V for another tangent than the factorised K, or None if this tangent is singular.
V holds dx/dcontrol (then step is 1) or K^-1 E (then step is 0), locally owned rows, shape (n, m)."""


def woodbury(problem: Equations, changes: list[Array], solver: DirectSolver) -> Update | None:
    """Return a function that updates solutions for a few changed contact stiffnesses, shape (n, c, c), stress/length.

    It maps V = K^-1 E (step 0) or dx/dcontrol (step 1), shape (n, m), to those of the changed tangent, or to None if
    singular. Return None for more points than `LocalContact.max_changes`: a factorisation then costs less.
    """
    chosen = [np.flatnonzero(change.any((1, 2))) for change in changes]
    points = combined(problem.comm, sum(map(len, chosen)), MPI.SUM)
    if points > LOCAL.max_changes:
        return None
    if not points:
        return lambda V, step: V
    small = _Points(problem, chosen, solver, lambda V: np.zeros(V.shape[1]))
    return lambda V, step: small.updated(V, step, changes)


class FacePoints:
    """Chosen contact points of several faces on all ranks, such as those with a known compliance of the body.

    m is the number of these points. n is the number of all points of the faces that this rank owns, one face after the
    other.

    Attributes:
        ids: (rank, number among the n points of this rank) of each of the m points.
        starts: number of the first of the n points of each face, and n, shape (faces + 1,).
    """

    def __init__(self, faces: Sequence[Any]):
        self._faces, self._comm = faces, faces[0].comm
        self.starts = [0, *np.cumsum([len(face.points) for face in faces]).tolist()]
        self.ids: list[tuple[int, int]] = []
        self._mine: Any = slice(0)                          # which of the m points are owned
        self._rows = np.zeros(0, dtype=int)                 # their numbers among the n points

    def choose(self, chosen: list[Array]) -> None:
        """Add chosen owned points of each face, by their local numbers, at the end: by rank, face and point."""
        new = [(self._comm.rank, first + int(i)) for first, numbers in zip(self.starts, chosen) for i in numbers]
        self.ids = [*self.ids, *itertools.chain.from_iterable(listed(self._comm, new))]
        ranks, rows = np.array(self.ids, dtype=int).reshape(-1, 2).T
        self._mine = slice(None) if self._comm.size == 1 else np.flatnonzero(ranks == self._comm.rank)
        self._rows = rows[self._mine]

    def of_faces(self, values: Array) -> list[Array]:
        """Return the parts of values at the n owned points of all faces, shape (n, ...), that belong to each face."""
        return [values[a:b] for a, b in itertools.pairwise(self.starts)]

    def values_at(self, values: Array) -> Array:
        """Return the values at the m points, shape (m, ...), from those at the n owned ones, shape (n, ...)."""
        return self.of_all_ranks(values[self._rows])

    def of_all_ranks(self, own: Array) -> Array:
        """Return values at the m points of all ranks, shape (m, ...), from those at the owned ones."""
        if self._comm.size == 1:
            return own
        found = np.zeros((len(self.ids), *own.shape[1:]))
        found[self._mine] = own
        return np.asarray(combined(self._comm, found, MPI.SUM))

    def spread(self, values: Array, among: Array) -> None:
        """Write values at the m points, shape (m, ...), into an array of the n owned points, in place."""
        among[self._rows] = values[self._mine]


class _Points(FacePoints):
    """A few contact points of all ranks, with the compliance of the body at these points.

    There are m points with c components. An array of the shape (m c,) has the components of the points one after the
    other, in the order of ranks, faces and points. chosen: for each face, local numbers of owned points. border: see
    `BorderedColumns`.
    """

    def __init__(self, problem: Equations, chosen: list[Array], solver: DirectSolver, border: Border):
        super().__init__(problem.contact.faces)
        self.choose(chosen)
        self._c = self._faces[0].points.shape[1]            # number of components
        self._columns = columns(solver, problem.contact.unit_forces(chosen), border)
        self._scale = np.repeat(self.values_at(np.concatenate([face.scale for face in self._faces])), self._c)
        self._C = self._columns.motions(self._moved) * self._scale

    def solve(self, dx: PETSc.Vec, step: float) -> tuple[Array, float] | None:
        """Solve for motions of the points that satisfy the contact law and the compliance of the body at them.

        Return the change of dx, locally owned entries, shape (n,), and of step; None if no solution was found.
        """
        y0 = self._moved(dx.array_r, step)
        f0, S0 = self._tractions([face.increment.last for face in self._faces])
        y, dy, entry_depth = y0, np.zeros_like(y0), np.full(len(y0) // self._c, LOCAL.entry_depth)
        before, halvings = np.inf, 0                        # residual before the correction dy; how often to halve dy
        accuracy = LOCAL.accuracy * min([face.law.theta for face in self._faces])
        for k in range(LOCAL.max_iterations):
            f, S = self._tractions([face.increment.after(m) for face, m in zip(self._faces, self._motions(y))])
            added = f - f0 + np.einsum("nij,nj->ni", S - S0, y.reshape(-1, self._c)).ravel()
            with np.errstate(over="ignore", invalid="ignore"):
                R = y - y0 + self._C @ added
            miss = np.abs(R).max()
            if not np.isfinite(miss):                       # the corrections diverge
                return None
            if miss < accuracy:
                return self._columns.update(-self._scale * added)
            if miss > before and halvings:
                dy, halvings = dy / 2, halvings - 1
                y = y - dy
                continue
            before, correction = miss, self._with_added_stiffness(S - S0, R)
            if correction is None:
                return None
            new = y - correction
            if k >= LOCAL.full_corrections:
                new, keep = self._stop_at_edge(y, new, entry_depth)
                halvings = 0 if keep else LOCAL.max_halvings
            y, dy = new, new - y
        return None

    def _stop_at_edge(self, y: Array, new: Array, entry_depth: Array) -> tuple[Array, bool]:
        """Shorten a correction of motions y to `new`, shape (m c,), length, at the outer edge of the ramp.

        The stiffness of a sticking point falls to zero there, so full corrections would take a point out and in again.
        `entry_depth`, shape (m,), grows in place. Also return True if the correction must not be halved: a point was
        stopped, or all points stick.
        """
        before, depth = [self.values_at(np.concatenate([
            face.increment.ramp_depth(m) for face, m in zip(self._faces, self._motions(z))])) for z in (y, new)]
        path = self.values_at(np.concatenate([face.increment.ramp_normal for face in self._faces]))
        leaves, enters = (before > LOCAL.min_depth) & (depth <= 0), (before <= 0) & (depth > 0)
        stopped = np.where(leaves, LOCAL.kept_depth * np.minimum(before, 1.0),
                           np.where(enters, np.minimum(depth, entry_depth), depth))
        entry_depth[enters] /= LOCAL.kept_depth
        back = (stopped - depth)[:, None] * path
        return new + back.ravel(), bool(back.any() or path.any(axis=1).all())

    def updated(self, V: Array, step: float, changes: list[Array]) -> Array | None:
        """Return V, shape (n, k), for other contact stiffnesses than in K, by Woodbury's formula; None if singular.

        step: change of the control in V. changes: for each face, of its p owned points, shape (p, c, c), stress/length.
        """
        added = self.values_at(np.concatenate(changes))
        y = self._with_added_stiffness(added, self._moved(V, np.full(V.shape[1], step)))
        if y is None:
            return None
        forces = np.einsum("nij,njm->nim", added, y.reshape(len(added), self._c, -1)).reshape(y.shape)
        return V - self._columns.updates(self._scale[:, None] * forces)

    def _with_added_stiffness(self, added: Array, y: Array) -> Array | None:
        """Return (1 + C S)^-1 y, shape (m c,) or (m c, k): motions with added stiffnesses S; None if singular.

        C is the compliance of the body at the points, shape (m c, m c). added: S of each point, shape (m, c, c),
        stress/length.
        """
        n = len(y)
        J = np.eye(n) + np.einsum("mni,nij->mnj", self._C.reshape(n, -1, self._c), added).reshape(n, n)
        try:
            found = np.linalg.solve(J, y)
        except np.linalg.LinAlgError:
            return None
        return found if np.isfinite(found).all() else None

    def _moved(self, dx: Array, step: Array | float) -> Array:
        """Return motions relative to tools, (m c[, k]), length, by dx (n[, k]) and step; collective."""
        motions = np.concatenate([face.relative_motion(dx, step) for face in self._faces])
        return self.values_at(motions).reshape(-1, *dx.shape[1:])

    def _motions(self, y: Array) -> list[Array]:
        """Return motions (p, c), length, of owned points of each face from y (m c,), 0 for points not chosen."""
        motions = np.zeros((self.starts[-1], self._c))
        self.spread(y.reshape(-1, self._c), motions)
        return self.of_faces(motions)

    def _tractions(self, found: list[Tractions]) -> tuple[Array, Array]:
        """Return the tractions, shape (m c,), and stiffnesses, shape (m, c, c), from those of each face; collective."""
        force = self.values_at(np.concatenate([tractions.force for tractions in found]))
        return force.ravel(), self.values_at(np.concatenate([tractions.stiffness for tractions in found]))
