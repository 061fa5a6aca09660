r"""Local solve of the few contact points whose gap closes, or whose status changes between iterations.

An iteration of Newton's method linearises the contact law of every point at its status (open, stick, slip) of the
iteration before. The iteration can cycle where the statuses of points depend on each other. Where gaps close, at the
outer edge of the ramp of the contact law, it only halves the penetration. For these few points the body is a compliance
C, the inverse tangent condensed to them. Their motions y satisfy, to first order,

.. math:: y - y_0 + C \, (f(y) - f_0 - S_0 \, y) = 0,

with the contact law f and its linearisation f_0 + S_0 y in the iteration, which led to y_0. This small problem is
solved by itself. For a linear f it is Woodbury's formula, which updates a tangent for a few changed stiffnesses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from .equations import Array, ContactFace, Equations
from .linear import DirectSolver

Border: TypeAlias = Callable[[Array], Array]
"""Maps solutions V = K^-1 E, shape (n, m), to the bordered system, in place; returns changes of the control, (m,)."""

@dataclass(frozen=True)
class LocalContact:
    """Settings of the local problem of a few contact points.

    Attributes:
        most: largest number of points that are solved for together; with more points Newton's method goes on alone.
        few: number of changed points up to which Woodbury's formula costs less than another factorisation.
        iterations: largest number of local iterations.
        full: number of full corrections, which may cycle. Later corrections of sticking points stop near the outer edge
            of the ramp. Others are halved where they increase the residual.
        halved: largest number of times that a correction is halved; at a kink it would stall.
        stays: a point that would leave the ramp stops at this part of its depth.
        least: depth over the width of the ramp from which on a point may leave.
        behind: depth over the width at which a point that enters the ramp again stops.
        farther: factor of `behind` from one entry to the next.
        accuracy: tolerance of positions over the half-width of the ramp.
    """

    most: int = 40
    few: int = 3
    iterations: int = 40
    full: int = 8
    halved: int = 4
    stays: float = 0.1
    least: float = 1e-9
    behind: float = 1e-6
    farther: float = 10.0
    accuracy: float = 1e-4


_LOCAL = LocalContact()


class LocalSolve:
    """Local solve of the points whose gap closed, or whose status changed, in one run of Newton's method.

    Attributes:
        failed: number of corrections without a consistent state of these points.
    """

    def __init__(self, problem: Equations):
        self._problem, self._contacts = problem, problem.present
        self._marked: list[Array] = []
        self._status: list[Array] = []
        self.failed = 0

    def look(self) -> None:
        """Mark the points of an iteration; call it once after each linearisation."""
        now = [contact.increment.status for contact in self._contacts]
        self._marked = self._marked or [contact.increment.arrivals for contact in self._contacts]
        for mark, a, b in zip(self._marked, self._status, now):
            mark |= a != b
        self._status = now

    def correct(self, solver: DirectSolver, dx: PETSc.Vec, step: float, border: Border) -> float:
        """Correct a Newton update so that points whose status changes satisfy the contact law.

        Args:
            solver: solver with the LU factors of the tangent K.
            dx: update of x, changed in place.
            step: update of the control.
            border: see `Border`.

        Returns:
            The new update of the control.
        """
        for _ in range(4):
            chosen = [np.flatnonzero(mark) for mark in self._marked]
            points = self._problem.comm.allreduce(sum(map(len, chosen)), MPI.SUM)
            if not 0 < points <= _LOCAL.most:
                return step
            small = _Points(self._problem, self._contacts, chosen, solver, border)
            change = small.solve(dx, step)
            if change is None:
                self.failed += 1
                return step
            more, by = change
            if not self._others(dx.array_r + more, step + by):
                break
        dx.array_w += more
        return step + by

    def _others(self, dx: Array, step: float) -> bool:
        """Mark more points whose status changes on the way; True if there are any."""
        found = False
        for contact, mark, status in zip(self._contacts, self._marked, self._status):
            law = contact.increment.foretold(contact.moved(dx, step))
            new = (law.status != status) & ~mark
            mark |= new
            found |= bool(new.any())
            contact.increment.expect(mark, law.sense)
        return self._problem.comm.allreduce(found, MPI.LOR)


Update: TypeAlias = Callable[[Array, float], "Array | None"]
"""V = dx/dcontrol or K^-1 E, locally owned rows, shape (n, m), with change of the control, by another tangent than
K."""


def woodbury(problem: Equations, changes: list[Array], solver: DirectSolver) -> Update | None:
    """Return the update of solutions for a tangent that differs from the factorised one at a few points (Woodbury).

    Args:
        problem: the equations.
        changes: for each contact, changes of the stiffness per area of its points, shape (n, c, c).
        solver: solver with the LU factors.

    Returns:
        The update, which gives None for a singular tangent. None if so many points change that another factorisation
        costs less.
    """
    chosen = [np.flatnonzero(change.any((1, 2))) for change in changes]
    points = problem.comm.allreduce(sum(map(len, chosen)), MPI.SUM)
    if points > _LOCAL.few:
        return None
    if not points:
        return lambda V, step: V
    small = _Points(problem, problem.present, chosen, solver, lambda V: np.zeros(V.shape[1]))
    stiffer = [change[i] for change, i in zip(changes, chosen)]
    return lambda V, step: small.updated(V, step, stiffer)


def unit_forces(problem: Equations, contacts: Sequence[ContactFace], chosen: list[Array]) -> Array:
    """Return the unit forces at locally owned points of contacts in F, locally owned rows, shape (n, m): point by
    point of all ranks."""
    unit, components = np.zeros(problem.x.getLocalSize()), contacts[0].points.shape[1]
    own = [(c, point, way) for c, points in zip(contacts, chosen) for point in points for way in range(components)]
    units = []
    for rank, count in enumerate(problem.comm.allgather(len(own))):
        for k in range(count):
            mine, point, way = own[k] if rank == problem.comm.rank else (None, 0, 0)
            for contact in contacts:                        # on all ranks: the force may act on nodes of another
                forces = np.zeros_like(contact.points)
                if contact is mine:
                    forces[point, way] = 1.0
                contact.add(unit, forces)
            units.append(unit.copy())
            unit[:] = 0
    E = np.array(units).reshape(-1, len(unit)).T
    E[problem.held] = 0
    return E


class _Points:
    """A few contact points with the compliance of the body. Arrays are of all ranks, but for locally owned ones."""

    def __init__(self, problem: Equations, contacts: Sequence[ContactFace], chosen: list[Array],
                 solver: DirectSolver, border: Border):
        self._comm, self._contacts, self._chosen = problem.comm, contacts, chosen
        self._c = contacts[0].points.shape[1]               # components
        self._some = [(c, i) for c, i in zip(contacts, chosen) if len(i)]
        counts = self._comm.allgather(self._c * sum(map(len, chosen)))
        first = sum(counts[: self._comm.rank])
        self._own = slice(first, first + counts[self._comm.rank])
        ends = np.cumsum([0, *(len(i) for _, i in self._some)])
        self._parts = [slice(a, b) for a, b in zip(ends, ends[1:])]     # of the owned points of each contact
        self._columns = solver.solve_all(unit_forces(problem, contacts, chosen))        # locally owned rows
        self._steps = border(self._columns)
        scale = np.concatenate([np.repeat(c.scale[i], self._c) for c, i in zip(contacts, chosen)])
        self._scale = self._gather(scale)
        moved = [self._moved(column, step) for column, step in zip(self._columns.T, self._steps)]
        self._C = self._gather(np.array(moved).T.reshape(counts[self._comm.rank], len(moved))) * self._scale

    def solve(self, dx: PETSc.Vec, step: float) -> tuple[Array, float] | None:
        """Return the changes of a correction and of its step, locally owned; None if no consistent state was found."""
        y0 = self._gather(self._moved(dx.array_r, step))
        f0, S0 = self._taken()
        laws, ramps = [c.increment.ahead(i) for c, i in self._some], [c.increment.in_ramp(i) for c, i in self._some]
        y, by, behind = y0, np.zeros_like(y0), np.full(len(y0) // self._c, _LOCAL.behind)
        least, halved = np.inf, _LOCAL.halved
        accuracy = _LOCAL.accuracy * min(c.increment.ramp for c in self._contacts)
        for k in range(_LOCAL.iterations):
            f, S = self._law(laws, y)
            more = f - f0 + np.einsum("nij,nj->ni", S - S0, y.reshape(-1, self._c)).ravel()
            R = y - y0 + self._C @ more
            miss = np.abs(R).max()
            if miss < accuracy:
                forces = -self._scale * more
                return self._columns @ forces, float(self._steps @ forces)
            if miss > least and halved < _LOCAL.halved:
                by, halved = by / 2, halved + 1
                y = y + by
                continue
            least, found = miss, self._within(S - S0, R)
            if found is None:
                return None
            new = y - found
            if k >= _LOCAL.full:
                new, stopped = self._to_foot(ramps, y, new, behind)
                halved = _LOCAL.halved if stopped else 0
            y, by = new, y - new
        return None

    def _to_foot(self, ramps: list[Any], y: Array, new: Array, behind: Array) -> tuple[Array, bool]:
        """Return the motions `new`, after y, stopped at the outer edge of the ramp, and True if a point was stopped.

        `behind` grows where points enter.

        The stiffness of a sticking point, k s g, falls with the slope s of the ramp, to zero next to its outer edge. A
        point that is pulled along its tool and hardly pressed is in equilibrium there. Full corrections then overshoot
        from either side.
        """
        (was, _), (now, way) = (self._all(self._each(ramps, at), (), (self._c,)) for at in (y, new))
        leaves, enters = (was > _LOCAL.least) & (now <= 0), (was <= 0) & (now > 0)
        at = np.where(leaves, _LOCAL.stays * np.minimum(was, 1.0), np.where(enters, np.minimum(now, behind), now))
        behind[enters] *= _LOCAL.farther
        stops = (at - now)[:, None] * way
        return new + stops.ravel(), bool(stops.any())

    def updated(self, V: Array, step: float, changes: list[Array]) -> Array | None:
        """Return solutions V, locally owned rows, shape (n, m), for changed stiffnesses per area; None: singular."""
        more = self._gather(np.concatenate(changes))
        y = self._within(more, self._gather(np.array([self._moved(column, step) for column in V.T]).T))
        if y is None:
            return None
        forces = np.einsum("nij,njm->nim", more, y.reshape(len(more), self._c, -1)).reshape(y.shape)
        return V - self._columns @ (self._scale[:, None] * forces)

    def _within(self, more: Array, y: Array) -> Array | None:
        """Return the motions y with points stiffer by `more`, (1 + C more)^-1 y; None if there is no answer."""
        n = len(y)
        J = np.eye(n) + np.einsum("mni,nij->mnj", self._C.reshape(n, -1, self._c), more).reshape(n, n)
        try:
            found = np.linalg.solve(J, y)
        except np.linalg.LinAlgError:
            return None
        return found if np.isfinite(found).all() else None

    def _moved(self, dx: Array, step: float) -> Array:
        """Return the motion of owned points in a correction, seen from their tools, flat. Collective."""
        return np.concatenate([c.moved(dx, step)[i].ravel() for c, i in zip(self._contacts, self._chosen)])

    def _taken(self) -> tuple[Array, Array]:
        """Return the forces, flat, and stiffnesses that the iteration has taken."""
        return self._forces([c.increment.taken(i) for c, i in self._some])

    def _law(self, laws: list[Any], y: Array) -> tuple[Array, Array]:
        """Return the forces, flat, and stiffnesses of the law, linearised where the points would be."""
        return self._forces([(there.force, there.stiffness) for there in self._each(laws, y)])

    def _forces(self, parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
        force, stiffness = self._all(parts, (self._c,), (self._c, self._c))
        return force.ravel(), stiffness

    def _each(self, functions: list[Any], y: Array) -> list[Any]:
        """Return the values of the functions of each contact's points for motions y."""
        owned = y[self._own].reshape(-1, self._c)
        return [f(owned[part]) for f, part in zip(functions, self._parts, strict=True)]

    def _all(self, parts: list[tuple[Array, Array]], *shapes: tuple[int, ...]) -> list[Array]:
        """Gather values of all contacts and ranks, of pairs with these shapes a point. (A rank may have no points.)"""
        found = zip(*parts) if parts else ([np.zeros((0, *shape))] for shape in shapes)
        return [self._gather(np.concatenate(part)) for part in found]

    def _gather(self, values: Array) -> Array:
        return values if self._comm.size == 1 else np.concatenate(self._comm.allgather(values))
