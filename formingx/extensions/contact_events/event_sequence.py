"""Prediction of the contact events of a step (gap closure, sliding, opening), and of the path between them.

1. Predictor: along the tangent of an accepted state, an open point moves with constant velocity (per arc length).
2. Event: the gap of a point closes where the point meets its tool. The earliest event of all points and ranks counts.
3. Status: from this event on the point sticks, slides against mu N, or opens. The contact forces F of all closed points
   follow from Coulomb's law on the condensed system (`reduced_contact`). Changes of status are events too.
4. Equilibrium: at each event, modified Newton iterations return the prediction to the curved path. They use the stored
   LU factors and Anderson acceleration (1965).

The path is piecewise linear between the events. A point sticks where its gap closed, so the order of events matters.
"""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...contact.step_limit import LIMITS
from ...physics.contact_law import ContactStatus
from ...ranks import combined, listed
from ...solve.local_contact import LOCAL
from ...values.tolerances import FAR, LARGE_ERROR
from .reduced_contact import BodyResponse, CondensedPoints, ToolFrame


class GapClosure(NamedTuple):
    """Contact event: the gap of an open point closes, at the signed distance -theta from its tool.

    The half-width theta of the contact ramp belongs to the contact law. All ranks store the same value.

    Attributes:
        arc_length: arc length of the event from the accepted state.
        point: rank that owns the point, and its number among the points of all faces there (`FacePoints.ids`).
        face: number of the contact face.
        place: position of the point relative to the tool at the event, shape (2,), length.
        tolerance: convergence tolerance of `place`, length.
    """

    arc_length: float
    point: tuple[int, int]
    face: int
    place: np.ndarray
    tolerance: float


class PathSegment(NamedTuple):
    """Linear segment of the predicted path, from an arc length to the next event.

    n is the number of all contact points of this rank. m is the number of those points, of all ranks, whose compliance
    is known: the motion of the body under unit forces at the points. The contact stiffness of points that were closed
    at the accepted state is part of the factorised tangent.

    Attributes:
        begins: arc length at the start of the segment, from the accepted state.
        positions: positions of the n points of all faces relative to their tools at the start, shape (n, 2), length.
        speed: derivatives of the positions with respect to arc length, shape (n, 2), length.
        status: contact statuses, shape (m,): -1 or 1 for sliding against or along the tangent of the tool, 0 sticking,
            2 open (`ContactStatus`).
        place: positions relative to the tools at which sticking points have no tangential force, shape (m, 2), length.
        force: contact forces at the start, with the sign and scale of the residual F, shape (m, 2), dimensionless.
        rate: derivatives of `force` with respect to arc length, shape (m, 2).
        extra: change of `force` since the accepted state, minus the part due to the contact stiffness in the factorised
            tangent, shape (m, 2).
        growth: derivatives of `extra` with respect to arc length, shape (m, 2).
        correction: sums of all equilibrium corrections of x, locally owned entries, and of the control.
    """

    begins: float
    positions: np.ndarray
    speed: np.ndarray
    status: np.ndarray
    place: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    extra: np.ndarray
    growth: np.ndarray
    correction: tuple[np.ndarray, float]

    def after(self, s: float) -> PathSegment:
        """Return the rest of this segment, from an arc length on, measured from the accepted state."""
        ds = s - self.begins
        return self if ds == 0 else self._replace(begins=s, positions=self.positions + ds * self.speed,
                                                  force=self.force + ds * self.rate,
                                                  extra=self.extra + ds * self.growth)

    def extended(self, m: int) -> PathSegment:
        """Return this segment with forces and statuses for m points; points added at the end are open."""
        added = m - len(self.status)
        if not added:
            return self
        blank = np.zeros((added, self.force.shape[1]))
        grown = {name: np.concatenate([getattr(self, name), blank])
                 for name in ("place", "force", "rate", "extra", "growth")}
        return self._replace(status=np.append(self.status, np.full(added, ContactStatus.FREE)), **grown)


@dataclass(frozen=True)
class EventSettings:
    """Limits and tolerances of the event prediction.

    Attributes:
        max_iterations: maximum number of equilibrium iterations per event.
        surface_iterations: number of projections of closed points onto their tools, and maximum number of Newton
            iterations that locate a gap closure there. Both converge in a few steps if the tools are curved.
        position_tolerance: convergence tolerance of the position of a gap closure, over the tributary length of the
            point. Most points with Coulomb friction stick near this position, too.
        arc_length_tolerance: convergence tolerance of the arc length of a gap closure, over its distance from the last
            event. A point near a constrained end hardly moves along its tool, so its position alone says little.
        max_arc_length_change: largest relative change of the arc length of an event in one equilibrium iteration.
        max_work: maximum number of equilibrium iterations and status changes in the prediction of a step. If it is
            reached, the prediction is not used, and the step closes one gap.
    """

    max_iterations: int = 8
    surface_iterations: int = 4
    position_tolerance: float = 1e-3
    arc_length_tolerance: float = LARGE_ERROR
    max_arc_length_change: float = 1.0
    max_work: int = 200


_SETTINGS = EventSettings()


class ContactEventSequence:
    """Gap closures after an accepted state (x, control), in order, and the piecewise-linear path through them.

    direction, slope: d/ds of x, owned entries, of which the first n are fields, and of the control. response: solver
    for the motion under contact forces by the stored LU factors. batch: points of a face whose compliance is computed
    at a time.

    Attributes:
        touching: number of closed points of each face at the state, on all ranks.
        ends: arc length up to which the prediction is valid; inf without a limit.
        stops: True if the prediction ends since no admissible contact statuses were found at `ends`.
        slip_ends: arc length of the first event at which a point sticks after it has slipped along its tool, by more
            than `StepLimits.max_slip_ratio`; inf without one.
    """

    def __init__(self, faces: Sequence[Any], n: int, x: np.ndarray, control: float, direction: np.ndarray, slope: float,
                 response: BodyResponse, batch: int):
        self._faces, self._response, self._comm, self._batch = faces, response, faces[0].comm, batch
        self._n, self._tangent = n, (x, control, direction, slope)
        self._points = CondensedPoints(faces, n, len(x), response)
        start = [face.positions(x[:n], control) for face in faces]
        self._along = np.concatenate([face.relative_motion(direction[:n], slope) for face in faces])
        self._area = np.concatenate([face.rule.area for face in faces]) > 0
        self._free = self._area & ~np.concatenate([face.law.touching(x, face.history) for face, x in zip(faces, start)])
        self.touching = [int(combined(self._comm, int(np.sum(closed)), MPI.SUM))
                         for closed in self._points.of_faces(self._area & ~self._free)]
        self._closures: list[GapClosure] = []
        blank = np.zeros((0, start[0].shape[1]))
        self._pieces = [PathSegment(0.0, np.concatenate(start), self._along, np.zeros(0, dtype=int), blank, blank,
                                    blank, blank, blank, (np.zeros(len(x)), 0.0))]
        self._near = self._points.tool_frame(self._pieces[0].positions, blank)     # at the start of the last segment
        self._end: PathSegment | None = None                # end of the last segment, in equilibrium
        self._taken = self._work = 0                        # closures with a contact force; `EventSettings.max_work`
        self.ends, self.stops, self.slip_ends = np.inf, False, np.inf
        if not self._free_sliding():
            self._pieces, self.ends = self._pieces[:1], 0.0

    @property
    def exhausted(self) -> bool:
        """True if the prediction used up its number of equilibrium iterations and status changes for a step."""
        return self._work >= _SETTINGS.max_work

    def next(self, k: int, length: float) -> GapClosure | None:
        """Return gap closure k (from 0) on the path within an arc length, or None, as if the prediction fails."""
        while len(self._closures) <= k:
            if self.ends < np.inf or self.exhausted:
                return None
            if self._taken < len(self._closures) and not self._close(length):
                self.ends = self._closures[-1].arc_length
                return None
            if not self._find_next(length):
                return None
            if not self._equilibrate(length):
                self.ends = self._closures[-1].arc_length
        return self._closures[k] if self._closures[k].arc_length < length else None

    def closures(self, length: float) -> tuple[list[np.ndarray], ...]:
        """Return the gap closures within an arc length `length`, as four lists with an array for each face.

        Arc lengths at the closures, shape (n,), `length` without one; positions there relative to the tool, shape (n,
        2); mask of points with a predicted contact force; d(position)/ds just before, shape (n, 2), 0 without a
        closure.
        """
        piece, points = self._piece(length), self._points
        arc_lengths, positions = np.full(len(piece.positions), length), piece.after(length).positions.copy()
        speeds, sure = np.zeros_like(positions), np.zeros(len(positions), dtype=bool)
        for closure in self._closures:
            s, (rank, i) = closure.arc_length, closure.point
            if s < length and rank == self._comm.rank:
                arc_lengths[i], positions[i], speeds[i] = s, closure.place, self._piece(s).speed[i]
        points.spread(piece.extended(len(points.ids)).status != ContactStatus.FREE, sure)
        return tuple(map(points.of_faces, (arc_lengths, positions, sure, speeds)))

    def positions(self, length: float) -> list[np.ndarray]:
        """Return for each face the positions of its owned points relative to the tool at an arc length, shape (n, 2).
        """
        return self._points.of_faces(self._piece(length).after(length).positions)

    def bend(self, length: float) -> tuple[np.ndarray, float] | None:
        """Return x (size,) and control of the path minus the tangent at an arc length; None if 0 or not finite."""
        piece, m = self._piece(length), len(self._points.ids)
        if self._end is not None and piece.begins < self._end.begins <= length:
            piece = self._end                               # in equilibrium there
        piece = piece.extended(m).after(length)
        if not len(piece.status):
            return None
        for _ in range(_SETTINGS.surface_iterations):
            piece = self._projected(piece)
        if not np.isfinite(piece.extra).all():
            return None
        return (piece.correction[0] - self._points.columns @ piece.extra.ravel(),
                piece.correction[1] - float(self._points.steps @ piece.extra.ravel()))

    def _projected(self, piece: PathSegment, moved: np.ndarray | None = None) -> PathSegment:
        """Return a segment at whose start closed points are moved onto their tools or to their sticking positions.

        They move along the tangents of the tools, so curved tools need several calls. moved: earlier motion of the n
        points, shape (n, 2), length, or None.
        """
        points, near = self._points, self._points.tool_frame(piece.positions, piece.force)
        u = np.zeros(piece.force.shape) if moved is None else points.values_at(moved)
        along = np.einsum("ni,ni->n", near.tangent, piece.place - points.values_at(piece.positions))
        targets = along[:, None] * near.tangent + near.beyond[:, None] * near.normal
        force, added = points.forces_at_end(u, piece.status, near, piece.force, targets)
        positions = piece.positions - points.motions @ added.ravel()
        return piece._replace(positions=positions if moved is None else positions + moved, force=force,
                              extra=piece.extra + added)

    def _piece(self, length: float) -> PathSegment:
        """Return the segment of the predicted path at an arc length: the last one that begins before it."""
        return [piece for piece in self._pieces if piece.begins < length or not piece.begins][-1]

    def _free_sliding(self) -> bool:
        """Apply Coulomb's law to the points that slide at the accepted state; return False if this fails.

        In the factorised tangent their forces follow from its contact stiffness. If their number is at most
        `LocalContact.max_points`, they are added to `_points`, and their forces become unknowns.
        """
        x, control = self._tangent[:2]
        points = self._points
        slide = self._area & ~self._free & ~points.sticks
        if not 0 < combined(self._comm, int(np.sum(slide)), MPI.SUM) <= LOCAL.max_points:
            return True
        if not points.learn([np.flatnonzero(s) for s in points.of_faces(slide)], touched=True):
            return False
        found = [face.tractions(x[: self._n], control) for face in self._faces]
        force = points.values_at(np.concatenate([face.scale[:, None] * t.force for face, t in zip(self._faces, found)]))
        status = points.values_at(np.concatenate([t.sense for t in found])).astype(int)
        status[points.friction == 0] = ContactStatus.SLIDES
        slip = points.values_at(np.concatenate([
            np.zeros(len(face.points)) if face.history is None else face.history.slip for face in self._faces]))
        piece = self._pieces[0].extended(len(status))
        place = points.values_at(piece.positions) - slip[:, None] * points.tool_frame(piece.positions, force).tangent
        if not self._append(piece._replace(status=status, force=force, place=place), status):
            return False
        del self._pieces[0]
        return True

    def _append(self, piece: PathSegment, status: np.ndarray, near: ToolFrame | None = None) -> bool:
        """Append a segment with new contact statuses to the path; return False if no statuses are admissible.

        piece: segment whose start is the start of the new one. status: statuses with which the search for admissible
        statuses begins, shape (m,). near: geometry of the tools at the start; None: it is computed.
        """
        points, near = self._points, near or self._points.tool_frame(piece.positions, piece.force)
        self._near, self._work = near, self._work + 1
        found = points.rates(points.values_at(self._along), status, near, piece.force)
        if found is None:
            return False
        rate, growth, status = found
        stuck = (status == ContactStatus.STICKS) & (np.abs(piece.status) == 1)
        slip, before = (piece.status * points.elastic_slip)[:, None] * near.tangent, piece.place
        piece = piece._replace(
            place=np.where(stuck[:, None], points.values_at(piece.positions) - slip, piece.place), status=status,
            rate=rate, growth=growth, force=np.where((status == ContactStatus.FREE)[:, None], 0.0, piece.force),
            speed=self._along - points.motions @ growth.ravel())
        if stuck.any() and self.slip_ends == np.inf:
            slipped = np.linalg.norm(piece.place - before, axis=1)[stuck]
            lengths = points.values_at(np.concatenate([face.rule.lengths for face in self._faces]))[stuck]
            self.slip_ends = piece.begins if np.any(slipped > LIMITS.max_slip_ratio * lengths) else np.inf
        points.spread(status == ContactStatus.FREE, self._free)
        self._pieces.append(piece)
        return True

    def _close(self, length: float) -> bool:
        """Append the segment after the last gap closure, in which the closed point carries a contact force.

        length: arc length of the step. The result is False if the state at the gap closure, the compliance of the point
        or admissible contact statuses were not found.
        """
        last, closure, end = self._pieces[-1], self._closures[-1], self._end
        if end is None or closure.point not in self._points.ids and not self._learn(length):
            return False
        self._taken += 1
        end, k = end.extended(len(self._points.ids)), self._points.ids.index(closure.point)
        status, place = end.status.copy(), end.place.copy()
        near = self._points.tool_frame(end.positions, end.force)
        slips = self._points.values_at(last.speed)[k] @ near.tangent[k]
        status[k] = ContactStatus.STICKS if self._points.friction[k] == np.inf else -1 if slips < 0 else 1
        place[k] = closure.place
        return self._append(end._replace(status=status, place=place), status, near)

    def _find_next(self, length: float) -> bool:
        """Store the next gap closure in the list of closures; return False if there is none within an arc length.

        Changes of contact statuses that come before it are appended to the path first.
        """
        while True:
            last = self._pieces[-1]
            if last.begins >= length or self.exhausted:
                return False
            arc_lengths = self._gap_closures(last, length - last.begins)
            first = min(listed(self._comm, float(arc_lengths.min(initial=np.inf))))
            after, status = self._points.change(last.status, self._near, last.force, last.rate)
            if not after < min(first, length - last.begins):
                break
            if not self._append(last.after(last.begins + after), status):
                self.ends, self.stops = last.begins + after, True
                return False
        if self._store_first(last.begins + arc_lengths, length, last):
            return True
        self._end = self._iterated(length, last)
        return self._end is not None and self._store_first(self._missed(self._end, last), length, last)

    def _gap_closures(self, segment: PathSegment, length: float) -> np.ndarray:
        """Return the arc lengths from the start of a segment at which gaps close, shape (n,); `length` if open."""
        parts = zip(self._faces, *map(self._points.of_faces, (segment.positions, segment.speed, self._free)))
        return np.concatenate([face.law.gap_closures(x, w, free, length) for face, x, w, free in parts])

    def _store_first(self, arc_lengths: np.ndarray, length: float, segment: PathSegment) -> bool:
        """Append the earliest gap closure of all ranks to `_closures`; return False if none is before `length`.

        arc_lengths: arc lengths of the gap closures of the n points, shape (n,). segment: segment of the predicted
        path, which gives the position of that point at its gap closure. All arc lengths are measured from the accepted
        state.
        """
        best: tuple[float, tuple[int, int]] = (length, (0, 0))
        if len(arc_lengths):
            k = int(np.argmin(arc_lengths))
            best = float(arc_lengths[k]), (self._comm.rank, k)
        s, point = min(listed(self._comm, best))
        if not s < length:
            return False
        self._closures.append(self._closure(point, s, segment.after(s).positions))
        return True

    def _closure(self, point: tuple[int, int], s: float, positions: np.ndarray) -> GapClosure:
        """Return the gap closure of a point (`GapClosure.point`) near the arc length `s`, with `positions` there."""
        closure: Any = None
        rank, row = point
        if rank == self._comm.rank:
            f = bisect.bisect_right(self._points.starts, row) - 1
            face, i = self._faces[f], row - self._points.starts[f]
            x, w = positions[row], self._pieces[-1].speed[row]
            ds = face.law.gap_closure(i, x, w, self._pieces[-1].begins - s, _SETTINGS.position_tolerance,
                                      _SETTINGS.surface_iterations)
            tolerance = _SETTINGS.position_tolerance * float(face.rule.lengths[i])
            closure = GapClosure(s + ds, point, f, x + ds * w, tolerance)
        return closure if self._comm.size == 1 else self._comm.bcast(closure, root=rank)

    def _equilibrate(self, length: float) -> bool:
        """Bring the predicted path to equilibrium at the last gap closure, and locate this closure again.

        Modified Newton iterations correct the unknowns there. length: arc length of the step. The result is False
        without convergence.
        """
        last, closure = self._pieces[-1], self._closures[-1]
        self._end = end = last.after(closure.arc_length)
        if closure.arc_length - last.begins < LIMITS.start_fraction * length:
            return True
        tried: list[tuple[PathSegment, PathSegment]] = []
        while len(tried) < _SETTINGS.max_iterations and not self.exhausted:
            closure = self._closures[-1]
            moved = self._iterated(closure.arc_length, end)
            if moved is None:
                return False
            found = self._closure(closure.point, closure.arc_length, moved.positions)
            tried.append((end, moved.after(found.arc_length)))
            mixed = self._anderson_mixture(tried)
            if mixed is None:
                return False
            end = mixed
            found = self._closure(closure.point, end.begins, end.positions)
            late = abs(found.arc_length - closure.arc_length) >= _SETTINGS.max_arc_length_change * closure.arc_length
            if late or not found.arc_length > last.begins:
                return False
            self._closures[-1], self._end = found, (end := end.after(found.arc_length))
            settled = abs(found.arc_length - closure.arc_length) < _SETTINGS.arc_length_tolerance * (
                closure.arc_length - last.begins)
            if settled and np.linalg.norm(found.place - closure.place) < found.tolerance:
                arc_lengths = self._missed(end, last, found)
                if not self._store_first(arc_lengths, found.arc_length, end):
                    return True
                self._closures.pop(-2)                      # another gap closed before
                tried = []
        return False

    def _missed(self, end: PathSegment, last: PathSegment, but: GapClosure | None = None) -> np.ndarray:
        """Return the arc lengths at which open points entered a tool along the segment `last`, shape (n,).

        end: segment after `last`, at whose start such points lie inside the tool. The result is the arc length at the
        start of `end` for points outside, and for the point whose gap closure is `but`.
        """
        arc_lengths, free = np.full(len(self._free), end.begins), self._free.copy()
        if but and but.point[0] == self._comm.rank:
            free[but.point[1]] = False
        parts = map(self._points.of_faces, (arc_lengths, end.positions, last.speed, free))
        for face, t, x, w, candidates in zip(self._faces, *parts):
            near = face.law.nearest(x)
            inside = candidates & (near.distance > -face.law.theta)
            if not inside.any():
                continue
            rate = np.einsum("ni,ni->n", near.normal, w)
            back = np.divide(near.distance + face.law.theta, rate, out=np.zeros(len(x)), where=inside & (rate > 0))
            left = end.begins - last.begins
            t[inside] = last.begins + np.clip(left - back, 1e-3 * left, 0.999 * left)[inside]
        return arc_lengths

    def _anderson_mixture(self, tried: list[tuple[PathSegment, PathSegment]]) -> PathSegment | None:
        """Return Anderson's (1965) mixture of (segment before, after) iterations; None if they diverge."""
        changes = np.array([(after.positions - before.positions).ravel() for before, after in tried])
        gram = combined(self._comm, changes @ changes.T)
        if not gram.trace() < FAR:
            return None
        if len(tried) == 1:
            return tried[0][1]
        ahead = gram[-1, -1] - gram[-1, :-1] - gram[:-1, -1, None] + gram[:-1, :-1]
        right = gram[-1, -1] - gram[:-1, -1]
        share = np.linalg.lstsq(ahead, right, rcond=1e-10)[0]
        weights, after = np.append(share, 1 - share.sum()), [piece for _, piece in tried]

        def mean(values: list) -> Any:
            return sum([w * v for w, v in zip(weights, values)])
        return after[-1]._replace(
            begins=float(mean([p.begins for p in after])), force=mean([p.force for p in after]),
            positions=mean([p.positions for p in after]), extra=mean([p.extra for p in after]),
            correction=(mean([p.correction[0] for p in after]), float(mean([p.correction[1] for p in after]))))

    def _iterated(self, s: float, piece: PathSegment) -> PathSegment | None:
        """Return a segment after one modified Newton iteration towards equilibrium; None if it fails.

        s: arc length at which the iteration takes place and the result begins. piece: segment to be corrected. Its
        positions, contact forces and `correction` are replaced in the result.
        """
        piece, points = piece.extended(len(self._points.ids)).after(s), self._points
        x, control, direction, slope = self._tangent
        self._work += 1
        forces = np.full(piece.positions.shape, np.nan)
        forces[self._free] = 0.0
        points.spread(piece.force, forces)
        change = self._response.to_equilibrium(
            x + s * direction + piece.correction[0] - points.columns @ piece.extra.ravel(),
            control + s * slope + piece.correction[1] - float(points.steps @ piece.extra.ravel()),
            points.of_faces(forces))
        if change is None:
            return None
        moved = np.concatenate([face.relative_motion(change[0][: self._n], change[1]) for face in self._faces])
        piece = self._projected(piece, moved)
        if not np.isfinite(piece.extra).all():
            return None
        return piece._replace(correction=(piece.correction[0] + change[0], piece.correction[1] + change[1]))

    def _learn(self, length: float) -> bool:
        """Learn compliances of the last and the next points to close; return False if the factors are outdated."""
        last, closure, points, chosen = self._pieces[-1], self._closures[-1], self._points, []
        left = length - last.begins
        arc_lengths = self._gap_closures(last, left)
        points.spread(np.full(len(points.ids), left), arc_lengths)
        if closure.point[0] == self._comm.rank:
            arc_lengths[closure.point[1]] = -1.0
        for of_face in points.of_faces(arc_lengths):
            first = np.argsort(of_face, kind="stable")[: self._batch]
            chosen.append(np.sort(first[of_face[first] < left]))
        return points.learn(chosen)
