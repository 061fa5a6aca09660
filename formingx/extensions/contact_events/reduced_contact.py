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
from dataclasses import astuple, dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ..._jit import address, address_of_integers
from ...physics.contact_law import FAR, ContactStatus
from ...ranks import combined, listed
from .compiled_contact import compiled
from .response import Response


@dataclass(frozen=True)
class StatusSearch:
    """Limits and tolerances of the active-set search for contact statuses that satisfy Coulomb's law.

    Attributes:
        all_at_once: number of trials in which all statuses that violate the law change; later one changes at a time.
        tries: maximum number of status sets that are tried.
        negligible: fraction of the largest rate of force or motion below which a rate is negligible.
        comparison_length: arc length by which rates of forces are multiplied to compare them with forces.
        limit: relative distance from the Coulomb limit mu N, or from N = 0, below which a force counts as on it.
    """

    all_at_once: int = 6
    tries: int = 60
    negligible: float = 1e-9
    comparison_length: float = 1e-4
    limit: float = 1e-6


_SEARCH = StatusSearch()
_VALUES = np.array(astuple(_SEARCH), dtype=float)
_ADDRESS = address(_VALUES)


class ToolFrame(NamedTuple):
    """Geometry of the tools at m contact points.

    Attributes:
        normal: unit normals, pointing into the tool, shape (m, 2).
        tangent: unit tangents of the tool, shape (m, 2).
        curvature: curvatures of the tool, shape (m,), 1/length.
        beyond: penetration for the present contact force less the actual penetration, shape (m,), length.
    """

    normal: np.ndarray
    tangent: np.ndarray
    curvature: np.ndarray
    beyond: np.ndarray


class Points:
    """Contact points of all ranks with known compliance, the motion of the body under unit forces at these points.

    Each unit force contributes -1 to one component (r or z) of the residual F at one point.

    Args:
        faces: the active `FaceContact` objects.
        n: number of locally owned unknowns of the fields, the first entries of x.
        size: number of locally owned entries of x.
        response: linearised response of the body to contact forces.

    Attributes:
        point_ids: (rank, face, point) of each of the m points.
        columns: changes of x under these unit forces, locally owned rows, shape (size, 2 m).
        steps: changes of the control under these forces, shape (2 m,).
        motions: for each face, motion of its owned points under these forces, shape (points, 2, 2 m), length.
        friction: coefficient of friction, infinite for stick, shape (m,).
        elastic_slip: elastic slip at which a point begins to slide, shape (m,), length.
    """

    def __init__(self, faces: Sequence[Any], n: int, size: int, response: Response):
        self._faces, self._n, self._response, self._comm = faces, n, response, faces[0].comm
        empty: Any = np.zeros(0)
        self.point_ids: list[tuple[int, int, int]] = []
        self.columns, self.steps = np.zeros((size, 0)), empty
        c = faces[0].points.shape[1]
        self.motions = [np.zeros((*face.points.shape, 0)) for face in faces]
        self.friction, self.elastic_slip, self._scale, self._pulls = empty, empty, empty, empty.astype(bool)
        self._S, self._C = np.zeros((0, c, c)), np.zeros((0, 0))
        self._owned: list[tuple[int, np.ndarray, np.ndarray, Any]] = []

    def learn(self, chosen: list[np.ndarray], touched: bool = False) -> bool:
        """Add contact points, and solve for their compliance with the stored LU factors.

        Args:
            chosen: for each face, local numbers of the locally owned points to add.
            touched: True if the factorised tangent contains the contact stiffness of these points.

        Returns:
            False if the stored factors no longer belong to the state, and no point was added; else True.
        """
        found = self._response.to_points(chosen)
        if found is None:
            return False
        new = [point for rank in listed(self._comm, [(self._comm.rank, f, int(i)) for f, numbers in enumerate(chosen)
                                                     for i in numbers]) for point in rank]
        self.point_ids += new
        self._owned = [(f, k, i, self._faces[f].law.part(i)) for f, k, i in self._of_faces(self.point_ids)]
        self.columns, self.steps = np.column_stack([self.columns, found[0]]), np.append(self.steps, found[1])
        for f, face in enumerate(self._faces):
            motions = [face.relative_motion(column[: self._n], step)[..., None]
                       for column, step in zip(found[0].T, found[1])]
            self.motions[f] = np.concatenate([self.motions[f], *motions], axis=-1)
        self._C = self.values_at(self.motions).reshape(len(self.steps), -1)
        ones = [np.ones(len(face.points)) for face in self._faces]
        added = self.values_at([np.column_stack([np.minimum(face.law.friction, FAR) * unit,
                                         face.law.elastic_slip * unit, face.scale, face.law.adhesive * unit])
                        for face, unit in zip(self._faces, ones)], new)
        friction, slip, scale, pulls = added.T
        self.friction = np.append(self.friction, np.where(friction < FAR, friction, np.inf))
        self.elastic_slip, self._scale = np.append(self.elastic_slip, slip), np.append(self._scale, scale)
        self._pulls = np.append(self._pulls, pulls > 0)
        known = self.values_at([face.stiffness_in_tangent for face in self._faces], new)
        self._S = np.concatenate([self._S, known * touched])
        return True

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
        return combined(self._comm, found, MPI.SUM)

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
        """Return the motion that takes the m points to target positions along, and to their contact depth normal to
        tools.

        Args:
            positions: for each face, present positions of its locally owned points relative to the tool, shape (n, 2),
                length.
            place: target positions of the m points, whose tangential components count, shape (m, 2), length.
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
            Normals, tangents and curvatures, and the penetrations that are missing for the forces.
        """
        found = np.zeros((len(self.point_ids), 4))
        for f, k, i, law in self._owned:
            normal, found[k, 2], found[k, 3] = frame(law, positions[f][i], force[k], self._scale[k])
            found[k, :2] = normal
        found = combined(self._comm, found, MPI.SUM)
        normal = found[:, :2].copy()
        return ToolFrame(normal, normal[:, ::-1] * (-1.0, 1.0), found[:, 2], found[:, 3])

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
        """Return the motion of all locally owned points of a face under contact forces at the m points.

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
            New forces F; change of force beyond the stiffness S in the factorised tangent, dF - S dx; shape (m, 2)
            each. If no such forces exist, F is `force`, and the second array is NaN.
        """
        F, outside = np.empty(force.shape), np.empty(force.shape)
        good = compiled().forces_at_end(
            *self._given(near), address(self.elastic_slip), address(near.beyond), address(u),
            address_of_integers(status), address(force), address(to), _ADDRESS, address(F), address(outside))
        return (F, outside) if good else (force, np.full(force.shape, np.nan))

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
            Rates of the forces F, shape (m, 2); their part beyond the stiffness S in the factorised tangent, dF - S dx,
            shape (m, 2); statuses, shape (m,). None if no admissible statuses were found.
        """
        slack = (status != ContactStatus.FREE) & ~self._pulls
        F, outside, N = np.empty(force.shape), np.empty(force.shape), self.parts(force, near)[0]
        slack &= np.abs(N).max(initial=0.0) * _SEARCH.limit >= N
        given = *self._given(near), address(u), address(force), address_of_integers(status), _ADDRESS
        for found in (np.array(status, dtype=int), np.where(slack, ContactStatus.FREE, status).astype(int)):
            if compiled().rates(*given, address_of_integers(found), address(F), address(outside)):
                return F, outside, found
        return None

    def change(self, status: np.ndarray, near: ToolFrame, force: np.ndarray, rate: np.ndarray) -> tuple[float,
                                                                                                        np.ndarray]:
        """Return the arc length after which a contact status changes first, with forces linear in the arc length.

        Args:
            status: contact statuses, shape (m,).
            near: geometry of the tools.
            force: present contact forces, shape (m, 2).
            rate: derivatives of the forces with respect to arc length, shape (m, 2).

        Returns:
            Arc length until the first point opens or begins to slide, infinite if none does; statuses after this
            change.
        """
        changed, after = np.zeros(2, dtype=int), np.array(status, dtype=int)
        time = compiled().change(*self._given(near), address_of_integers(status), address(force), address(rate),
                                 _ADDRESS, address_of_integers(changed))
        if time < np.inf:
            after[changed[0]] = changed[1]
        return time, after

    def _given(self, near: ToolFrame) -> tuple:
        """Return the arguments for the C structure `Points` (`compiled_contact`)."""
        return (len(self.friction), address(self.friction), address(self._pulls), address(self._S), address(self._C),
                address(near.normal), address(near.curvature))


def frame(law: Any, x: np.ndarray, force: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the geometry of the tool at n points that it touches.

    Args:
        law: contact law of these points.
        x: positions of the points relative to the tool, shape (n, 2), length.
        force: contact forces in F, shape (n, 2).
        scale: forces in F over tractions, shape (n,), 1/stress.

    Returns:
        Normals, shape (n, 2), curvatures, shape (n,), 1/length, and `ToolFrame.beyond`, shape (n,), length.
    """
    if law.profile is None:
        near = law.nearest(x)
        N = np.einsum("ni,ni->n", force, near.normal) / scale
        return near.normal, near.curvature, law.depth(N if law.adhesive else np.maximum(N, 0.0)) - near.distance
    normal, curvature, beyond = np.empty(x.shape), np.empty(len(x)), np.empty(len(x))
    k, shift = np.broadcast_to(law.k, len(x)), np.broadcast_to(law.shift, len(x))
    compiled().frame(len(x), address(x), address(force), address(scale), address(k), law.theta, law.adhesive,
                     address(shift), *law.profile.compiled_table, address(normal), address(curvature), address(beyond))
    return normal, curvature, beyond
