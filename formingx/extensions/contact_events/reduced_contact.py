r"""Frictional contact of a few points, condensed onto their contact forces.

Coulomb's law is solved for m points alone; the body enters by its compliance C at them. The factorised tangent of a
state contains a contact stiffness S at points that were closed. For contact forces F instead, the condensed equations
of motion per arc length are

.. math:: dx = u - C (dF - S \, dx)

where u is the motion along the tangent, and C is taken in the plane normal to the path. A sticking point has dx = 0. A
sliding point stays on its tool with T = mu N. On a tool of curvature c its force rotates with the motion:

.. math:: dF = c \, (t \cdot dx) (N t - T n)

with the normal n into the tool and its tangent t: the geometric stiffness of contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...physics.contact_law import FAR, ContactStatus
from .response import Response


@dataclass(frozen=True)
class StatusSearch:
    """Limits and tolerances of the active-set search for contact statuses that satisfy Coulomb's law.

    Attributes:
        all_at_once: number of trials in which all violating statuses change; later only one changes at a time.
        tries: maximum number of status sets that are tried.
        none: fraction of the largest rate of force or motion below which a rate is negligible.
        comparison_length: arc length over which rates of forces are compared with forces.
        limit: relative distance from the Coulomb cone, or from zero pressure, below which a force counts as on it.
    """

    all_at_once: int = 6
    tries: int = 60
    none: float = 1e-9
    comparison_length: float = 1e-4
    limit: float = 1e-6


_SEARCH = StatusSearch()


class ToolFrame(NamedTuple):
    """Geometry of the tools at m contact points.

    Attributes:
        normal: unit normals, pointing into the tool, shape (m, 2).
        tangent: unit tangents of the tool, shape (m, 2).
        curvature: curvatures of the tool, shape (m,), 1/length.
        beyond: penetration that gives the present contact force, less the actual penetration, shape (m,), length.
    """

    normal: np.ndarray
    tangent: np.ndarray
    curvature: np.ndarray
    beyond: np.ndarray


class ReducedSystem(NamedTuple):
    """Motion dx of m contact points as a linear function of their contact forces, free of contact stiffness.

    Attributes:
        free: dx without contact forces, shape (2 m,).
        by: derivative of dx by forces of sign -1 (compliance), shape (2 m, 2 m).
        turn: derivative by dx of contact forces that rotate with a curved tool, shape (m, 2, 2).
    """

    free: np.ndarray
    by: np.ndarray
    turn: np.ndarray


class Points:
    """Contact points of all ranks whose compliance is known: the motion of the body due to unit forces at them.

    Args:
        faces: the active `FaceContact` objects.
        n: number of locally owned unknowns of the fields.
        size: number of locally owned entries of x.
        response: linearised response of the body to contact forces.

    Attributes:
        point_ids: (rank, face, point) of each of the m points.
        columns: changes of x by forces -1 at the points, locally owned rows, shape (size, 2 m).
        steps: changes of the control by these forces, shape (2 m,).
        motions: motion of all locally owned points of each face by these forces, shape (points, 2, 2 m).
        friction: coefficient of friction, infinite for stick, shape (m,).
        elastic_slip: elastic slip at which a point begins to slide, shape (m,), length.
    """

    def __init__(self, faces: Sequence[Any], n: int, size: int, response: Response):
        self._faces, self._n, self._response, self._comm = faces, n, response, faces[0].comm
        none: Any = np.zeros(0)
        self.point_ids: list[tuple[int, int, int]] = []
        self.columns, self.steps = np.zeros((size, 0)), none
        c = self._components = faces[0].points.shape[1]
        self.motions = [np.zeros((*face.points.shape, 0)) for face in faces]
        self.friction, self.elastic_slip, self._scale, self._pulls = none, none, none, none.astype(bool)
        self._S, self._C = np.zeros((0, c, c)), np.zeros((0, 0))
        self._owned: list[tuple[int, np.ndarray, np.ndarray, Any]] = []

    def learn(self, chosen: list[np.ndarray], touched: bool = False) -> bool:
        """Add contact points, and solve for their compliance with the stored LU factors.

        Args:
            chosen: for each face, local numbers of the locally owned points to add.
            touched: True if the factorised tangent contains the contact stiffness of these points.

        Returns:
            True; False if the stored factors no longer belong to the state.
        """
        found = self._response.to_points(chosen)
        if found is None:
            return False
        new = [point for rank in self._comm.allgather([(self._comm.rank, f, int(i)) for f, numbers in enumerate(chosen)
                                                       for i in numbers]) for point in rank]
        self.point_ids += new
        self._owned = [(f, k, i, self._faces[f].law.part(i)) for f, k, i in self._of_faces(self.point_ids)]
        self.columns, self.steps = np.column_stack([self.columns, found[0]]), np.append(self.steps, found[1])
        for f, face in enumerate(self._faces):
            motions = [face.moved(column[: self._n], step)[..., None] for column, step in zip(found[0].T, found[1])]
            self.motions[f] = np.concatenate([self.motions[f], *motions], axis=-1)
        self._C = self.values_at(self.motions).reshape(len(self.steps), -1)
        ones = [np.ones(len(face.points)) for face in self._faces]
        more = self.values_at([np.column_stack([np.minimum(face.law.friction, FAR) * unit,
                                         face.law.elastic_slip * unit, face.scale, face.law.pulls * unit])
                        for face, unit in zip(self._faces, ones)], new)
        friction, slip, scale, pulls = more.T
        self.friction = np.append(self.friction, np.where(friction < FAR, friction, np.inf))
        self.elastic_slip, self._scale = np.append(self.elastic_slip, slip), np.append(self._scale, scale)
        self._pulls = np.append(self._pulls, pulls > 0)
        known = self.values_at([face.stiffness_in_tangent for face in self._faces], new)
        self._S = np.concatenate([self._S, known * touched])
        return True

    @property
    def _mu(self) -> np.ndarray:
        """Coefficient of friction of each point, shape (m,), 0 for stick."""
        return np.where(self.friction < np.inf, self.friction, 0.0)

    def values_at(self, values: Sequence[np.ndarray],
                  point_ids: Sequence[tuple[int, int, int]] | None = None) -> np.ndarray:
        """Return values at contact points of all ranks, shape (m, ...).

        Args:
            values: for each face, values at its locally owned points.
            point_ids: (rank, face, point) of each point; None: all m points with known compliance.

        Returns:
            Values in the order of the points, the same on all ranks.
        """
        located = self._owned if point_ids is None else self._of_faces(point_ids)
        found = np.zeros((len(self.point_ids if point_ids is None else point_ids), *values[0].shape[1:]))
        for f, k, i, *_ in located:
            found[k] = values[f][i]
        return found if self._comm.size == 1 else self._comm.allreduce(found, MPI.SUM)

    def spread(self, values: np.ndarray, among: list[np.ndarray]) -> None:
        """Write values at the m points into the arrays of the faces.

        Args:
            values: values at the points, shape (m, ...).
            among: for each face, values at its locally owned points, changed in place.
        """
        for f, k, i, _ in self._owned:
            among[f][i] = values[k]

    def _of_faces(self, point_ids: Sequence[tuple[int, int, int]]) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Return (face number, indices in the list, local point numbers) for faces with listed points of this rank."""
        ids = np.array(point_ids, dtype=int).reshape(-1, 3)
        mine = [np.flatnonzero((ids[:, 0] == self._comm.rank) & (ids[:, 1] == f)) for f in range(len(self._faces))]
        return [(f, k, ids[k, 2]) for f, k in enumerate(mine) if len(k)]

    def motion_to_targets(self, positions: Sequence[np.ndarray], place: np.ndarray, near: ToolFrame) -> np.ndarray:
        """Return the motion of points along their tools to given positions, and normal to them to their contact depth.

        Args:
            positions: for each face, present positions of its locally owned points relative to the tool, shape (n, 2),
                length.
            place: tangential target positions of the m points, shape (m, 2), length.
            near: geometry of the tools at the m points.

        Returns:
            Motion, shape (m, 2), length.
        """
        along = np.einsum("ni,ni->n", near.tangent, place - self.values_at(positions))
        return along[:, None] * near.tangent + near.beyond[:, None] * near.normal

    def tool_frame(self, positions: Sequence[np.ndarray], force: np.ndarray) -> ToolFrame:
        """Return the geometry of the tools at the m points.

        Args:
            positions: for each face, positions of its locally owned points relative to the tool, shape (n, 2), length.
            force: present contact forces in F at the m points, shape (m, 2), which give the depth `ToolFrame.beyond`.

        Returns:
            Normals, tangents, curvatures and missing penetrations.
        """
        c = self._components
        found = np.zeros((len(self.point_ids), c + c + 2))
        for f, k, i, law in self._owned:
            near = law.nearest(positions[f][i])
            N = np.einsum("ni,ni->n", force[k], near.normal) / self._scale[k]
            depth = law.depth(N if law.pulls else np.maximum(N, 0.0))
            found[k, :c], found[k, c:-2], found[k, -2] = near.normal, near.tangent, near.curvature
            found[k, -1] = depth - near.distance
        found = found if self._comm.size == 1 else self._comm.allreduce(found, MPI.SUM)
        return ToolFrame(found[:, :c], found[:, c:-2], found[:, -2], found[:, -1])

    def parts(self, force: np.ndarray, near: ToolFrame) -> tuple[np.ndarray, np.ndarray]:
        """Return the components of vectors normal and tangential to the tools.

        Args:
            force: vectors at the m points (forces, their rates or motions), shape (m, 2).
            near: geometry of the tools.

        Returns:
            Normal and tangential components, N and T for forces, shape (m,) each.
        """
        return np.einsum("ni,ni->n", force, near.normal), np.einsum("ni,ni->n", force, near.tangent)

    def motion_under(self, forces: np.ndarray, f: int) -> np.ndarray:
        """Return the motion of all locally owned points of a face due to contact forces at the m points.

        Args:
            forces: contact forces of sign -1, shape (m, 2).
            f: number of the face.

        Returns:
            Motion relative to the tool, shape (n, 2), length.
        """
        return self.motions[f] @ forces.ravel()

    def forces_at_end(self, u: np.ndarray, status: np.ndarray, near: ToolFrame, force: np.ndarray,
                      to: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute the contact forces F at the end of a given motion, for given contact statuses.

        Args:
            u: motion dx of the points if the contact forces did not change, shape (m, 2), length.
            status: contact statuses, shape (m,).
            near: geometry of the tools.
            force: present contact forces, shape (m, 2).
            to: motion to the target positions of sticking points before their elastic slip g_s T/(mu N), shape (m, 2),
                length. Sliding points are moved to the surface of their tools.

        Returns:
            New forces F, and the change of force outside the factorised tangent, dF - S dx, shape (m, 2) each. If no
            such forces exist, the second is NaN and F is `force`.
        """
        N, mu = self.parts(force, near)[0], self._mu
        slips = np.divide(self.elastic_slip, mu * N, out=np.zeros(len(N)), where=mu * N > 0)
        try:
            small = self._small(u + (self._C @ force.ravel()).reshape(u.shape), near,
                                force * (status != ContactStatus.FREE)[:, None])
            F, dx = self._solved(small, status, near, to, slips)
        except np.linalg.LinAlgError:
            return force, np.full(force.shape, np.nan)
        return F, F - force - np.einsum("nij,nj->ni", self._S, dx)

    def rates(self, u: np.ndarray, status: np.ndarray, near: ToolFrame,
              force: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Compute the rates of the contact forces along the path, with contact statuses that satisfy Coulomb's law.

        Statuses that violate the law are changed by an active-set search.

        Args:
            u: velocity of the points along the tangent of the path, shape (m, 2), length per arc length.
            status: first statuses, shape (m,).
            near: geometry of the tools.
            force: present contact forces, shape (m, 2).

        Returns:
            Rates of the forces F, shape (m, 2); rates outside the factorised tangent, dF - S dx, shape (m, 2);
            statuses, shape (m,). None if no admissible statuses were found.
        """
        (N, T), here = self.parts(force, near), status != ContactStatus.FREE
        try:
            small = self._small(u, near, force)
        except np.linalg.LinAlgError:
            return None
        slack = here & (np.abs(N).max(initial=0.0) * _SEARCH.limit >= N) & ~self._pulls
        for begin in (status, np.where(slack, ContactStatus.FREE, status)):
            found = self._agreed(small, begin.copy(), near, N, T, here)
            if found is not None:
                F, dx, status = found
                return F, F - np.einsum("nij,nj->ni", self._S, dx), status
        return None

    def _agreed(self, small: ReducedSystem, status: np.ndarray, near: ToolFrame, N: np.ndarray,
                T: np.ndarray, here: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Search for contact statuses whose rates of force and motion satisfy Coulomb's law (active set).

        Args:
            small: condensed motion of the points.
            status: first statuses, shape (m,), changed in place.
            near: geometry of the tools.
            N: normal forces, shape (m,).
            T: tangential forces, shape (m,).
            here: mask of the closed points, shape (m,).

        Returns:
            Rates of the forces and of the positions, shape (m, 2) each, and statuses; None if the search failed.
        """
        seen, mu = set(), self._mu
        compliance = self._C.diagonal().reshape(len(N), -1).mean(1)
        for k in range(_SEARCH.tries):
            try:
                F, dx = self._solved(small, status, near)
            except np.linalg.LinAlgError:
                return None
            if not np.isfinite(F).all():
                return None
            (dN, dT), (into, along), held = self.parts(F, near), self.parts(dx, near), status != ContactStatus.FREE
            negligible = _SEARCH.limit * (np.abs(N).max() + _SEARCH.comparison_length * np.abs(dN).max())
            other, miss = status.copy(), np.zeros(len(N))
            slides = held & (status != ContactStatus.STICKS) & (mu > 0)
            turns = slides & (status * along < -_SEARCH.none * np.abs(along).max())
            other[turns], miss[turns] = ContactStatus.STICKS, np.abs(along[turns])
            most = mu * ((1 - _SEARCH.limit) * N - negligible)
            at_limit = held & (status == ContactStatus.STICKS) & (self.friction < np.inf) & (np.abs(T) >= most)
            sense = np.where(np.abs(T) > mu * negligible, np.sign(T), np.sign(dT))
            over = sense * dT - mu * dN
            slips = at_limit & (over > _SEARCH.none * np.abs(dT).max())
            other[slips], miss[slips] = sense[slips], (over * compliance)[slips]
            opens = held & ~self._pulls & (negligible >= N) & (dN < 0)
            other[opens], miss[opens] = ContactStatus.FREE, -(dN * compliance)[opens]
            closes = here & ~held & (into > 0)
            sense = np.where(along[closes] < 0, ContactStatus.SLIDES_BACK, ContactStatus.SLIDES)
            other[closes] = np.where(self.friction[closes] < np.inf, sense, ContactStatus.STICKS)
            miss[closes] = into[closes]
            changes = np.flatnonzero(other != status)
            if not len(changes):
                return F, dx, status
            if k >= _SEARCH.all_at_once or status.tobytes() in seen:
                changes = changes[[np.argmax(miss[changes])]]
            seen.add(status.tobytes())
            status[changes] = other[changes]
        return None

    def change(self, status: np.ndarray, near: ToolFrame, force: np.ndarray, rate: np.ndarray) -> tuple[float,
                                                                                                        np.ndarray]:
        """Return the arc length after which a contact status changes first, with forces linear in the arc length.

        Args:
            status: contact statuses, shape (m,).
            near: geometry of the tools.
            force: present contact forces, shape (m, 2).
            rate: their derivatives by arc length, shape (m, 2).

        Returns:
            Arc length until the first point opens or begins to slide, infinite if none does; statuses after this
            change.
        """
        if not len(status):
            return np.inf, status
        (N, T), (dN, dT), held = self.parts(force, near), self.parts(rate, near), status != ContactStatus.FREE
        negligible = _SEARCH.limit * max(np.abs(N).max(initial=0.0), 1e-30)
        times, other = np.full(len(status), np.inf), status.copy()
        opens = held & ~self._pulls & (dN < 0) & (negligible < N)
        times[opens], other[opens] = -N[opens] / dN[opens], ContactStatus.FREE
        k = np.flatnonzero(held & (status == ContactStatus.STICKS) & (self.friction < np.inf))
        mu = self.friction[k]
        for sense in (ContactStatus.SLIDES, ContactStatus.SLIDES_BACK):
            margin, closing = mu * N[k] - sense * T[k], sense * dT[k] - mu * dN[k]
            slips = (closing > 0) & (margin > _SEARCH.limit * mu * np.abs(N[k]))
            t = np.divide(margin, closing, out=np.full(len(k), np.inf), where=slips)
            first = t < times[k]
            times[k[first]], other[k[first]] = t[first], sense
        first = int(np.argmin(times))
        after = status.copy()
        after[first] = other[first]
        return float(times[first]), after

    def _small(self, u: np.ndarray, near: ToolFrame, force: np.ndarray) -> ReducedSystem:
        """Return the condensed motion of the points by u and by contact forces, with the contact stiffness S removed.

        The stiffness of forces that rotate with a curved tool is included.

        Args:
            u: motion along the tangent of the path, shape (m, 2).
            near: geometry of the tools.
            force: present contact forces, shape (m, 2).
        """
        N, T = self.parts(force, near)
        n, t = near.normal, near.tangent
        turn = near.curvature[:, None, None] * ((N[:, None] * t - T[:, None] * n)[:, :, None] * t[:, None, :])
        size, stiffness = len(self._C), self._S - turn
        if not stiffness.any():
            return ReducedSystem(u.ravel(), self._C, turn)
        CK = np.einsum("xni,nij->xnj", self._C.reshape(size, *u.shape), stiffness).reshape(size, size)
        found = np.linalg.solve(np.eye(size) - CK, np.column_stack([u.ravel(), self._C]))
        return ReducedSystem(found[:, 0], found[:, 1:], turn)

    def _solved(self, small: ReducedSystem, status: np.ndarray, near: ToolFrame,
                to: np.ndarray | None = None, slips: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Solve the condensed equations for the contact forces at given statuses.

        Args:
            small: condensed motion of the points.
            status: contact statuses, shape (m,).
            near: geometry of the tools.
            to: target motion of sticking points, shape (m, 2), length; None: solve for rates.
            slips: compliance of elastic slip of the points, shape (m,), or None.

        Returns:
            Forces, or their rates without `to`, and motions of the points, shape (m, 2) each.
        """
        free, C, turn = small
        held, m, c = status != ContactStatus.FREE, len(status), self._components
        stuck = held & (status == ContactStatus.STICKS) & (self.friction > 0)
        sticks, slides = np.flatnonzero(stuck), np.flatnonzero(held & ~stuck)
        mu = self._mu
        # one unknown force per direction: normal and tangent of sticking points, Coulomb's cone edge of sliding points
        point = np.concatenate([sticks, sticks, slides])
        into = np.concatenate([near.normal[sticks], near.tangent[sticks], near.normal[slides]])
        along = (mu * status)[slides, None] * near.tangent[slides]
        against = np.concatenate([into[:2 * len(sticks)], near.normal[slides] + along])
        each, columns = np.arange(len(point))[:, None], c * point[:, None] + np.arange(c)
        A, B = np.zeros((len(point), len(free))), np.zeros((len(free), len(point)))
        A[each, columns], B[columns, each] = into, against
        compliance, a = A @ C @ B, np.zeros(len(point))
        largest = np.abs(compliance).max(1, initial=0.0)
        most = largest.max(initial=0.0)
        stiff = np.flatnonzero(largest < _SEARCH.none * most)
        compliance[stiff, stiff] = most                          # no motion along a support or across the axis
        if to is not None:
            n = 2 * len(sticks)
            a[:n], a[n:] = np.einsum("ni,ni->n", to[point[:n]], into[:n]), near.beyond[slides]
        if slips is not None:
            k = each[len(sticks):2 * len(sticks), 0]
            compliance[k, k] += slips[sticks]
        amounts = np.linalg.solve(compliance, A @ free - a)
        dx = (free - C @ (B @ amounts)).reshape(m, c)
        return (B @ amounts).reshape(m, c) + np.einsum("nij,nj->ni", turn, dx), dx
