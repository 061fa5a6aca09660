"""Points that a step brings to their tools, one after the other: each is held as it arrives, and turns the path.

Along the tangent of a state, by a unit of arc length, points move by w0. A point that has arrived is held by what its
law of friction says, and so are those that slid before: each sticks, slides against mu N, or separates, which the
compliance of the body at these points tells (`held`). From one change to the next the path goes straight, and where a
point arrives an iteration with the same factors brings it back to equilibrium: the path is curved, and where a point
sticks depends on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...contact.approach import gap_closures
from ...physics.contact_law import ContactStatus
from .reduced_contact import Points
from .response import Response


@dataclass(frozen=True)
class EventSettings:
    """Number and accuracy of the predicted contact events.

    Attributes:
        iterations: at most this number of for an arrival.
        to_tools: iterations, of the contact alone, that bring points to their tools.
        changes: at most this number of points separate or begin to slide from one arrival to the next.
        taken_over: points that slid before are held by forces of their own, if they are not more than these.
        same_place: the amount by which an iteration may still move an arrival that sticks, over the length of face that
            is its own.
        about_there: the same of one that may slide.
        far: squares of positions beyond all bounds, length^2.
        soon: part of a step within which two points arrive together.
        earlier: at most this number of points turn out to have arrived before the one that is looked at.
        late: part of the way to an arrival by which an iteration may move it: beyond, where it is is not known.
        work: iterations to equilibrium and changes of direction, in all, for the events of one step. With more, the
            step takes one gap closure.
    """

    iterations: int = 8
    to_tools: int = 4
    changes: int = 100
    taken_over: int = 80
    same_place: float = 1e-3
    about_there: float = 1e-2
    far: float = 1e30
    soon: float = 0.02
    earlier: int = 3
    late: float = 1.0
    work: int = 200


_SETTINGS = EventSettings()


class GapClosure(NamedTuple):
    """A point of a face that meets the ramp of its tool; the same on all ranks.

    time: arc length; place: then, shape (2,). length: of face that is its own. sticks: under any force.
    """

    time: float
    rank: int
    face: int
    point: int
    place: np.ndarray
    length: float
    sticks: bool

    @property
    def who(self) -> tuple[int, int, int]:
        """The point."""
        return self.rank, self.face, self.point


class _Piece(NamedTuple):
    """A straight piece of the path, from an arc length on.

    at, speed: positions and velocities of points, by face. Of the m points that are known: status; place: where they
    stick; force, rate: on them, and by arc length; extra, growth: of it, what the factors do not know, all but the
    first of shape (m, 2). off: what (x, control) is there off the tangent by more than these.
    """

    begins: float
    at: list[np.ndarray]
    speed: list[np.ndarray]
    status: np.ndarray
    place: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    extra: np.ndarray
    growth: np.ndarray
    off: tuple[np.ndarray, float]

    def after(self, time: float) -> _Piece:
        """Return the rest of a piece of path from a time on, with the part before it replaced by a straight line."""
        by = time - self.begins
        return self._replace(begins=time, at=[x + by * w for x, w in zip(self.at, self.speed)],
                             force=self.force + by * self.rate, extra=self.extra + by * self.growth)

    def of(self, m: int) -> _Piece:
        """It, when m points are known."""
        more = m - len(self.status)
        if not more:
            return self
        none = np.zeros((more, self.force.shape[1]))
        grown = {name: np.concatenate([getattr(self, name), none])
                 for name in ("place", "force", "rate", "extra", "growth")}
        return self._replace(status=np.append(self.status, np.full(more, ContactStatus.FREE)), **grown)


class ContactEventSequence:
    """The arrivals ahead of a state, in order, and the path bent by them.

    Args:
        faces: in contact (`FaceContact`), those that take part; n: owned unknowns of the fields.
        x, control: the state, locally owned entries; direction, slope: of them by arc length.
        response: of the body; batch: points for which that is asked at a time.

    Attributes:
        touching: how many points of each face touch.
        ends: arc length beyond which nothing is predicted; stops: no path goes on there.
    """

    def __init__(self, faces: Sequence[Any], n: int, x: np.ndarray, control: float, direction: np.ndarray, slope: float,
                 response: Response, batch: int):
        self._faces, self._response, self._comm, self._batch = faces, response, faces[0].comm, batch
        self._n, self._way = n, (x, control, direction, slope)
        start = [face.positions(x[:n], control) for face in faces]
        self._along = [face.moved(direction[:n], slope) for face in faces]
        self._free = [~face.law.touching(at, face.touch) & (face.rule.area > 0) for face, at in zip(faces, start)]
        self.touching = [int(self._comm.allreduce(int(np.sum(~free & (face.rule.area > 0))), MPI.SUM))
                         for face, free in zip(faces, self._free)]
        self._closures: list[GapClosure] = []
        self._points = Points(faces, n, len(x), response)
        none = np.zeros((0, start[0].shape[1]))
        self._pieces = [_Piece(0.0, start, self._along, np.zeros(0, dtype=int), none, none, none, none, none,
                               (np.zeros(len(x)), 0.0))]
        self._end: _Piece | None = None                     # of the last piece, in equilibrium
        self._taken = self._work = 0                        # arrivals that are held; see `EventSettings.work`
        self.ends, self.stops = np.inf, False
        if not self._take_over():
            self._pieces, self.ends = self._pieces[:1], 0.0

    @property
    def exhausted(self) -> bool:
        """True if the events of this step took all the work that they may."""
        return self._work >= _SETTINGS.work

    def next(self, k: int, length: float) -> GapClosure | None:
        """The arrival number k (from 0) within a length, or None; those before it are held."""
        while len(self._closures) <= k:
            if self.ends < np.inf or self.exhausted:
                return None
            if self._taken < len(self._closures) and not self._hold(length):
                self.ends = self._closures[-1].time
                return None
            if not self._find(length):
                return None
            if not self._settle(length):
                self.ends = self._closures[-1].time
        return self._closures[k] if self._closures[k].time < length else None

    def closures(self, length: float) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Return for each face the arc length at which locally owned points touch, `length` if they do not; where
        they are then; which are where their forces want them at the end."""
        piece = self._piece(length)
        times, at = [np.full(len(x), length) for x in piece.at], piece.after(length).at
        for arrival in self._closures:
            if arrival.time < length and arrival.rank == self._comm.rank:
                times[arrival.face][arrival.point] = arrival.time
                at[arrival.face][arrival.point] = arrival.place
        sure = [np.zeros(len(x), dtype=bool) for x in at]
        self._points.spread(piece.of(len(self._points.who)).status != ContactStatus.FREE, sure)
        return times, at, sure

    def positions(self, length: float) -> list[np.ndarray]:
        """Positions of own points of each face at an arc length, straight from the last change."""
        return self._piece(length).after(length).at

    def bend(self, length: float) -> tuple[np.ndarray, float] | None:
        """Return the change of (x, control) at a length along the tangent by the events; None: zero."""
        piece, m = self._piece(length), len(self._points.who)
        if self._end is not None and piece.begins < self._end.begins <= length:
            piece = self._end                               # in equilibrium there
        piece = piece.of(m).after(length)
        if not len(piece.status):
            return None
        for _ in range(_SETTINGS.to_tools):
            piece = self._held(piece)
        if not np.isfinite(piece.extra).all():
            return None
        return (piece.off[0] - self._points.columns @ piece.extra.ravel(),
                piece.off[1] - float(self._points.steps @ piece.extra.ravel()))

    def _held(self, piece: _Piece, moved: Sequence[np.ndarray] = ()) -> _Piece:
        """Return the start of a piece, its points moved onto their tools and to where they stick; moved: first, by
        face.

        (Tools are curved: it takes a few such iterations.)
        """
        points, near = self._points, self._points.near(piece.at, piece.force)
        u = points.at(moved) if moved else np.zeros_like(piece.force)
        force, more = points.held(u, piece.status, near, piece.force,
                                  points.back(piece.at, piece.place, near))
        at = [x - points.moved_by(more, f) for f, x in enumerate(piece.at)]
        return piece._replace(at=[x + m for x, m in zip(at, moved)] if moved else at, force=force,
                              extra=piece.extra + more)

    def _piece(self, length: float) -> _Piece:
        """The last piece of the path that begins before a length."""
        return next(piece for piece in self._pieces[::-1] if piece.begins < length or not piece.begins)

    def _take_over(self) -> bool:
        """Hold points that touched, and may slide, by forces of their own; False: that cannot be told."""
        x, control = self._way[:2]
        slide = [~free & (face.rule.area > 0) & (face.law.friction < np.inf)
                 for face, free in zip(self._faces, self._free)]
        number = self._comm.allreduce(sum(int(np.sum(s)) for s in slide), MPI.SUM)
        if not 0 < number <= _SETTINGS.taken_over:
            return True
        if not self._points.learn([np.flatnonzero(s) for s in slide], touched=True):
            return False
        found = [face.tractions(x[: self._n], control) for face in self._faces]
        force = self._points.at([face.scale[:, None] * t.force for face, t in zip(self._faces, found)])
        status = self._points.at([t.sense for t in found]).astype(int)
        status[self._points.friction == 0] = 1
        slip = self._points.at([np.zeros(len(face.points)) if face.touch is None else face.touch.slip
                                for face in self._faces])
        piece = self._pieces[0].of(len(status))
        place = self._points.at(piece.at) - slip[:, None] * self._points.near(piece.at, force).tangent
        return self._turn(piece._replace(status=status, force=force, place=place), status) and bool(self._pieces.pop(0))

    def _turn(self, piece: _Piece, status: np.ndarray) -> bool:
        """The piece of path that goes on from where one begins, with other statuses; False: it cannot be told."""
        points, near = self._points, self._points.near(piece.at, piece.force)
        self._work += 1
        found = points.rates(points.at(self._along), status, near, piece.force)
        if found is None:
            return False
        rate, growth, status = found
        stuck = (status == ContactStatus.STICKS) & (np.abs(piece.status) == 1)
        slip = (piece.status * points.elastic_slip)[:, None] * near.tangent
        piece = piece._replace(
            place=np.where(stuck[:, None], self._points.at(piece.at) - slip, piece.place), status=status, rate=rate,
            growth=growth, force=np.where((status == ContactStatus.FREE)[:, None], 0.0, piece.force),
            speed=[w - points.moved_by(growth, f) for f, w in enumerate(self._along)])
        points.spread(status == ContactStatus.FREE, self._free)
        self._pieces.append(piece)
        return True

    def _hold(self, length: float) -> bool:
        """Hold the arrival that is not held yet: the next piece of the path; False: it cannot be told."""
        last, arrival, end = self._pieces[-1], self._closures[-1], self._end
        if end is None or arrival.who not in self._points.who and not self._learn(length):
            return False
        self._taken += 1
        end, k = end.of(len(self._points.who)), self._points.who.index(arrival.who)
        status, place = end.status.copy(), end.place.copy()
        slips = self._points.at(last.speed)[k] @ self._points.near(end.at, end.force).tangent[k]
        status[k] = ContactStatus.STICKS if self._points.friction[k] == np.inf else -1 if slips < 0 else 1
        place[k] = arrival.place
        return self._turn(end._replace(status=status, place=place), status)

    def _find(self, length: float) -> bool:
        """The next arrival within a length, on the last piece or off its end."""
        for _ in range(_SETTINGS.changes):
            last = self._pieces[-1]
            if last.begins >= length or self.exhausted:
                return False
            times = [gap_closures(face.law, x, w, free, length - last.begins)
                     for face, x, w, free in zip(self._faces, last.at, last.speed, self._free)]
            first = min(self._comm.allgather(min((float(t.min(initial=np.inf)) for t in times), default=np.inf)))
            after, status = self._points.change(last.status, self._points.near(last.at, last.force), last.force,
                                                last.rate)
            if not after < min(first, length - last.begins):
                break
            if not self._turn(last.after(last.begins + after), status):
                self.ends, self.stops = last.begins + after, True
                return False
        if self._first([last.begins + t for t in times], length, last):
            return True
        self._end = self._moved(length, last)
        return self._end is not None and self._first(self._back(self._end, last), length, last)

    def _first(self, times: list[np.ndarray], length: float, at: _Piece) -> bool:
        """Take up the first of arrivals at times, if it is within a length; at: a piece of path there."""
        best = min(((float(t.min()), self._comm.rank, f, int(np.argmin(t))) for f, t in enumerate(times) if len(t)),
                   default=(length, 0, 0, 0))
        time, rank, f, i = min(self._comm.allgather(best))
        if not time < length:
            return False
        self._closures.append(self._meets(rank, f, i, time, at.after(time).at))
        return True

    def _meets(self, rank: int, f: int, i: int, time: float, at: list[np.ndarray]) -> GapClosure:
        """The arrival of a point near a time, when points are `at` their places."""
        told = None
        if rank == self._comm.rank:
            face, x, w = self._faces[f], at[f][[i]], self._pieces[-1].speed[f][[i]]
            law, by = face.law.part([i]), 0.0
            near = law.nearest(x)
            for _ in range(3):
                gap, rate = float(near.distance[0]) + law.theta, float(near.normal[0] @ w[0])
                if abs(gap) < _SETTINGS.same_place * law.theta or not rate > 0:
                    break
                by = max(by - gap / rate, self._pieces[-1].begins - time)
                near = law.nearest(x + by * w)
            told = GapClosure(time + by, rank, f, i, (x + by * w)[0], float(face.rule.lengths[i]),
                           bool(np.isinf(np.ravel(law.friction)[0])))
        return self._comm.bcast(told, root=rank)

    def _settle(self, length: float) -> bool:
        """Bring the path back to equilibrium where the last point found arrives, and that with it; False: it fails."""
        last, arrival = self._pieces[-1], self._closures[-1]
        self._end = end = last.after(arrival.time)
        if arrival.time - last.begins < _SETTINGS.soon * length:
            return True
        tried: list[tuple[_Piece, _Piece]] = []
        for _ in range(_SETTINGS.iterations * _SETTINGS.earlier):
            if len(tried) == _SETTINGS.iterations or self.exhausted:
                return False
            arrival, moved = self._closures[-1], self._moved(arrival.time, end)
            if moved is None:
                return False
            found = self._meets(*arrival.who, arrival.time, moved.at)
            tried.append((end, moved.after(found.time)))
            mixed = self._mixed(tried)
            if mixed is None:
                return False
            end = mixed
            found = self._meets(*arrival.who, end.begins, end.at)
            if not (found.time > last.begins and abs(found.time - arrival.time) < _SETTINGS.late * arrival.time):
                return False
            self._closures[-1], self._end = found, (end := end.after(found.time))
            near = (_SETTINGS.same_place if found.sticks else _SETTINGS.about_there) * found.length
            if np.linalg.norm(found.place - arrival.place) < near:
                times = self._back(end, last, found)
                if not self._first(times, found.time, end):
                    return True
                self._closures.pop(-2)                      # another one has arrived before
                tried = []
        return False

    def _back(self, end: _Piece, last: _Piece, but: GapClosure | None = None) -> list[np.ndarray]:
        """Return the times at which points that end a piece inside their tools passed the surface, else its time."""
        times = [np.full(len(free), end.begins) for free in self._free]
        for f, (t, face, x, w, free) in enumerate(zip(times, self._faces, end.at, last.speed, self._free)):
            near = face.law.nearest(x)
            inside, rate = free & (near.distance > -face.law.theta), np.einsum("ni,ni->n", near.normal, w)
            if but and (but.rank, but.face) == (self._comm.rank, f):
                inside[but.point] = False
            back = np.divide(near.distance + face.law.theta, rate, out=np.zeros(len(x)), where=inside & (rate > 0))
            left = end.begins - last.begins
            t[inside] = last.begins + np.clip(left - back, 1e-3 * left, 0.999 * left)[inside]
        return times

    def _mixed(self, tried: list[tuple[_Piece, _Piece]]) -> _Piece | None:
        """Return the mean of iterates, (before, after) each, that is nearest to a fixed point (Anderson 1965).

        None: they lead beyond all bounds.

        (Factors of another state alone make them go to and fro.)
        """
        by = np.array([np.concatenate([(b - a).ravel() for a, b in zip(before.at, after.at)])
                       for before, after in tried])
        gram = self._comm.allreduce(by @ by.T)
        if not gram.trace() < _SETTINGS.far:
            return None
        ahead = gram[-1, -1] - gram[-1, :-1] - gram[:-1, -1, None] + gram[:-1, :-1]
        right = gram[-1, -1] - gram[:-1, -1]
        share = np.linalg.lstsq(ahead, right, rcond=1e-10)[0]
        weights, after = np.append(share, 1 - share.sum()), [piece for _, piece in tried]

        def mean(values: list) -> Any:
            return sum(w * v for w, v in zip(weights, values))
        return after[-1]._replace(
            begins=float(mean([p.begins for p in after])), at=[mean(list(at)) for at in zip(*(p.at for p in after))],
            force=mean([p.force for p in after]), extra=mean([p.extra for p in after]),
            off=(mean([p.off[0] for p in after]), float(mean([p.off[1] for p in after]))))

    def _moved(self, time: float, piece: _Piece) -> _Piece | None:
        """A piece of path, from a time on, moved by an iteration towards equilibrium there; None: no factors."""
        piece, points = piece.of(len(self._points.who)).after(time), self._points
        x, control, direction, slope = self._way
        self._work += 1
        forces = [np.full(at.shape, np.nan) for at in piece.at]
        for given, free in zip(forces, self._free):
            given[free] = 0.0                               # open points touch nothing
        points.spread(piece.force, forces)
        by = self._response.to_equilibrium(
            x + time * direction + piece.off[0] - points.columns @ piece.extra.ravel(),
            control + time * slope + piece.off[1] - float(points.steps @ piece.extra.ravel()), forces)
        if by is None:
            return None
        moved = [face.moved(by[0][: self._n], by[1]) for face in self._faces]
        piece = self._held(piece, moved)
        if not np.isfinite(piece.extra).all():
            return None
        return piece._replace(off=(piece.off[0] + by[0], piece.off[1] + by[1]))

    def _learn(self, length: float) -> bool:
        """Columns of the arrival that is to be held and of those that come next as it looks; False: no factors."""
        last, arrival, chosen = self._pieces[-1], self._closures[-1], []
        left = length - last.begins
        for f, face in enumerate(self._faces):
            times = gap_closures(face.law, last.at[f], last.speed[f], self._free[f], left)
            times[[i for rank, g, i in self._points.who if (rank, g) == (self._comm.rank, f)]] = left
            if (arrival.rank, arrival.face) == (self._comm.rank, f):
                times[arrival.point] = -1.0
            first = np.argsort(times, kind="stable")[: self._batch]
            chosen.append(np.sort(first[times[first] < left]))
        return self._points.learn(chosen)
