"""Points that a step brings to their tools, one after the other: each is held as it arrives, and turns the path.

Along the tangent of a state, by a unit of arc length, points move by w0. Forces g at some of them, in F, move them on
by -C g: C is the compliance of the body in the plane normal to the tangent, found with the factors at hand. A point
that has arrived is held by what its law of friction says: it sticks, or only its motion into the tool ends and it
slides against mu N. So from one arrival to the next the path goes straight,

    w = w0 - C g,   with g such that those that are held are,

and where a point arrives an iteration with the same factors brings it back to equilibrium: the path is curved, and
where a point sticks depends on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from mpi4py import MPI

_TRIES = 6
"""At most so many sets of what sticks and slides are looked at after an arrival."""

_ITERATIONS = 6
"""At most so many for an arrival."""

_SAME_PLACE = 1e-3
"""By how much an iteration may still move an arrival, over the length of face that is its own."""

_SOON = 0.02
"""Part of a step within which two points arrive together."""

_LATE = 0.3
"""Part of the way to an arrival by which an iteration may move it: beyond, where it is is not known."""


class Response(Protocol):
    """How a body gives way, in the plane in which a step ends: (x, control), own part; None: no factors are at hand."""

    def to_points(self, chosen: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray] | None:
        """By forces -1 at own points (numbers) of each face, way by way, all ranks: shapes (n, m), (m,)."""

    def to_rest(self, x: np.ndarray, control: float, forces: list[np.ndarray]) -> tuple[np.ndarray, float] | None:
        """By what is left over at (x, control); forces: at points of each face, NaN: as the law says, (n, 2)."""


class Arrival(NamedTuple):
    """A point of a face that meets the ramp of its tool; the same on all ranks.

    time: arc length; place: then, shape (2,). normal, tangent: of the tool there, shape (2,). friction: T/N where it
    slides; infinite: it sticks. scale: of forces in F by its tractions; length: of face that is its own.
    """

    time: float
    rank: int
    face: int
    point: int
    place: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray
    friction: float
    scale: float
    length: float

    @property
    def who(self) -> tuple[int, int, int]:
        """The point."""
        return self.rank, self.face, self.point


class _Piece(NamedTuple):
    """A straight piece of the path: from an arc length on; positions and velocities of points, by face; forces g and
    their growth; what (x, control) is there off the tangent by more than these forces."""

    begins: float
    at: list[np.ndarray]
    speed: list[np.ndarray]
    force: np.ndarray
    rate: np.ndarray
    off: tuple[np.ndarray, float]


def _at(piece: _Piece, time: float) -> _Piece:
    """What is left of a piece from a time on, or it, and what was before that, on a straight line."""
    by = time - piece.begins
    force = np.append(piece.force, np.zeros(len(piece.rate) - len(piece.force)))
    force[: len(piece.rate)] += by * piece.rate
    return piece._replace(begins=time, at=[x + by * w for x, w in zip(piece.at, piece.speed)], force=force)


class Foretold:
    """The arrivals ahead of a state, in order, and the path bent by them.

    Args:
        faces: in contact (`FaceContact`), those that take part; n: owned unknowns of the fields.
        x, control: the state, own part; direction, slope: of them by arc length.
        response: of the body; batch: points for which that is asked at a time.

    Attributes:
        touching: how many points of each face touch.
        ends: arc length beyond which nothing is foretold.
    """

    def __init__(self, faces: Sequence[Any], n: int, x: np.ndarray, control: float, direction: np.ndarray, slope: float,
                 response: Response, batch: int):
        self._faces, self._response, self._comm, self._batch = faces, response, faces[0].comm, batch
        self._n, self._way = n, (x, control, direction, slope)
        start = [face.positions(x[:n], control) for face in faces]
        speed = [face.moved(direction[:n], slope) for face in faces]
        self._free = [~face.law.touching(at, face.touch) & (face.rule.area > 0) for face, at in zip(faces, start)]
        self.touching = [int(self._comm.allreduce(int(np.sum(~free & (face.rule.area > 0))), MPI.SUM))
                         for face, free in zip(faces, self._free)]
        self._arrivals: list[Arrival] = []
        self._sense: list[float] = []                       # of each that is held: 1, -1 slides, 0 does not
        self._pieces = [_Piece(0.0, start, speed, np.zeros(0), np.zeros(0), (np.zeros(len(x)), 0.0))]
        self._known: list[tuple[int, int, int]] = []        # points whose columns are there
        self._columns, self._C = np.zeros((len(x), 0)), np.zeros((0, 0))
        self._steps: np.ndarray = np.zeros(0)
        self._by = [np.zeros((*at.shape, 0)) for at in start]       # how all points move by them
        self._end: _Piece | None = None                     # of the last piece, in equilibrium
        self.ends = np.inf

    def next(self, k: int, length: float) -> Arrival | None:
        """The arrival number k (from 0) within a length, or None; those before it are held."""
        while len(self._arrivals) <= k:
            if self.ends < np.inf:
                return None
            if len(self._pieces) == len(self._arrivals) and not self._hold(length):
                self.ends = self._arrivals[-1].time
                return None
            if not self._find(length):
                return None
            if not self._settle(length):
                self.ends = self._arrivals[-1].time
        return self._arrivals[k] if self._arrivals[k].time < length else None

    def places(self, length: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Of each face: arc length at which own points arrive, `length` if they do not; where they are then."""
        piece = self._piece(length)
        times = [np.full(len(x), length) for x in piece.at]
        at = [x + (length - piece.begins) * w for x, w in zip(piece.at, piece.speed)]
        for arrival in self._arrivals:
            if arrival.time < length and arrival.rank == self._comm.rank:
                times[arrival.face][arrival.point] = arrival.time
                at[arrival.face][arrival.point] = arrival.place
        return times, at

    def bend(self, length: float) -> tuple[np.ndarray, float] | None:
        """What is added to (x, control) at a length along the tangent; None: nothing."""
        piece = self._piece(length)
        held = self._arrivals[: self._pieces.index(piece)]
        if not held:
            return None
        force = self._forces(piece, length)
        gap = np.zeros((len(held), len(held[0].normal)))
        for k, arrival in enumerate(held):
            f, i = arrival.face, arrival.point
            if arrival.rank == self._comm.rank:             # as deep in its tool as its force wants it
                law, pressed = self._faces[f].law.part([i]), force[self._own(arrival)] @ arrival.normal / arrival.scale
                near = law.nearest((piece.at[f] + (length - piece.begins) * piece.speed[f])[[i]])
                gap[k] = (law.depth(np.array([max(pressed, 0.0)])) - near.distance)[0] * near.normal[0]
        force = force + self._held_by(held, self._spread(held, self._comm.allreduce(-gap)))
        return piece.off[0] - self._columns @ force, piece.off[1] - float(self._steps @ force)

    def _piece(self, length: float) -> _Piece:
        """The last piece of the path that begins before a length."""
        return next(piece for piece in self._pieces[::-1] if piece.begins < length or not piece.begins)

    def _forces(self, piece: _Piece, length: float) -> np.ndarray:
        """g of all known points, at a length on a piece."""
        found = np.zeros(2 * len(self._known))
        found[: len(piece.force)] = piece.force + (length - piece.begins) * piece.rate
        return found

    def _find(self, length: float) -> bool:
        """The next arrival within a length, on the last piece or off its end."""
        last = self._pieces[-1]
        if last.begins >= length:
            return False
        times = [arrivals(face.law, x, w, free, length - last.begins)
                 for face, x, w, free in zip(self._faces, last.at, last.speed, self._free)]
        if self._first([last.begins + t for t in times], length, last):
            return True
        times, self._end = [np.full(len(t), length) for t in times], self._moved(length, last, self._arrivals)
        if self._end is None:
            return False
        for t, face, x, w, free in zip(times, self._faces, self._end.at, last.speed, self._free):
            near = face.law.nearest(x)
            inside, rate = free & (near.distance > -face.law.theta), np.einsum("ni,ni->n", near.normal, w)
            back = np.divide(near.distance + face.law.theta, rate, out=np.zeros(len(x)), where=inside & (rate > 0))
            t[inside] = np.clip(length - back, last.begins + 1e-3 * (length - last.begins), 0.999 * length)[inside]
        return self._first(times, length, last)

    def _first(self, times: list[np.ndarray], length: float, last: _Piece) -> bool:
        """Take up the first of arrivals at times, if it is within a length."""
        best = min(((float(t.min()), self._comm.rank, f, int(np.argmin(t))) for f, t in enumerate(times) if len(t)),
                   default=(length, 0, 0, 0))
        time, rank, f, i = min(self._comm.allgather(best))
        if not time < length:
            return False
        self._arrivals.append(self._meets(rank, f, i, time, [x + (time - last.begins) * w for x, w in zip(
            last.at, last.speed)]))
        return True

    def _meets(self, rank: int, f: int, i: int, time: float, at: list[np.ndarray]) -> Arrival:
        """The arrival of a point near a time, when points are `at` their places."""
        told = None
        if rank == self._comm.rank:
            face, x, w = self._faces[f], at[f][[i]], self._pieces[-1].speed[f][[i]]
            law, by = face.law.part([i]), 0.0
            near = law.nearest(x)
            for _ in range(3):
                gap, rate = float(near.distance[0]) + law.theta, float(near.normal[0] @ w[0])
                if abs(gap) < _SAME_PLACE * law.theta or not rate > 0:
                    break
                by -= gap / rate
                near = law.nearest(x + by * w)
            told = Arrival(time + by, rank, f, i, (x + by * w)[0], near.normal[0], near.tangent[0],
                           float(np.ravel(law.friction)[0]), float(face.scale[i]), float(face.rule.lengths[i]))
        return self._comm.bcast(told, root=rank)

    def _settle(self, length: float) -> bool:
        """Bring the path back to equilibrium where the last point found arrives, and that with it; False: it fails."""
        last, arrival = self._pieces[-1], self._arrivals[-1]
        self._end = end = _at(last, arrival.time)
        if arrival.time - last.begins < _SOON * length:
            return True
        for _ in range(_ITERATIONS):
            arrival, moved = self._arrivals[-1], self._moved(arrival.time, end, self._arrivals[:-1])
            if moved is None:
                return False
            found = self._meets(*arrival.who, arrival.time, moved.at)
            if not (found.time > last.begins and abs(found.time - arrival.time) < _LATE * arrival.time):
                return False
            self._arrivals[-1], self._end = found, (end := _at(moved, found.time))
            if np.linalg.norm(found.place - arrival.place) < _SAME_PLACE * found.length:
                return True
        return False

    def _moved(self, time: float, piece: _Piece, held: Sequence[Arrival]) -> _Piece | None:
        """A piece of path, from a time on, moved by an iteration towards equilibrium there; None: no factors."""
        piece = _at(piece, time)
        x, control, direction, slope = self._way
        force, forces = np.zeros(2 * len(self._known)), [np.full(at.shape, np.nan) for at in piece.at]
        force[: len(piece.force)] = piece.force
        for f, free in enumerate(self._free):
            forces[f][free] = 0.0                           # what has not arrived yet touches nothing
        for a in held:
            if a.rank == self._comm.rank:
                forces[a.face][a.point] = force[self._own(a)]
        by = self._response.to_rest(x + time * direction + piece.off[0] - self._columns @ force,
                                    control + time * slope + piece.off[1] - float(self._steps @ force), forces)
        if by is None:
            return None
        moved = [face.moved(by[0][: self._n], by[1]) for face in self._faces]
        w = self._gather([a.who for a in held], [m[:, :, None] for m in moved])[..., 0]
        more = self._held_by(held, self._spread(held, w))
        at = [x + m - b @ more for x, m, b in zip(piece.at, moved, self._by)]
        return piece._replace(at=at, force=force + more, off=(piece.off[0] + by[0], piece.off[1] + by[1]))

    def _hold(self, length: float) -> bool:
        """Hold the arrival that is not held yet: the next piece of the path; False: it cannot be told."""
        last, arrival, end = self._pieces[-1], self._arrivals[-1], self._end
        if end is None or arrival.who not in self._known and not self._learn(length):
            return False
        force = np.append(end.force, np.zeros(2 * len(self._known) - len(end.force)))
        if any(force[self._own(a)] @ a.normal < 0 for a in self._arrivals[:-1]):
            return False                                    # one of them would let go
        w = self._gather([arrival.who], [speed[:, :, None] for speed in last.speed])[0, :, 0]
        slides = 0 < arrival.friction < np.inf
        self._sense.append(float(np.sign(w @ arrival.tangent)) if slides else 0.0)
        rate = self._rates()
        if rate is None:
            return False
        if arrival.rank == self._comm.rank:
            self._free[arrival.face][arrival.point] = False
        speed = [w0 - by @ rate for w0, by in zip(self._pieces[0].speed, self._by)]
        self._pieces.append(_Piece(arrival.time, end.at, speed, force, rate, end.off))
        return True

    def _rates(self) -> np.ndarray | None:
        """g by arc length that holds all arrivals; None: none that presses the last one on agrees with friction."""
        w0 = self._spread(self._arrivals, self._gather([a.who for a in self._arrivals], [
            speed[:, :, None] for speed in self._pieces[0].speed])[..., 0])
        for _ in range(_TRIES):
            rate = self._held_by(self._arrivals, w0)
            w, good = w0 - self._C @ rate, bool(np.isfinite(rate).all())
            for k, a in enumerate(self._arrivals):
                if not 0 < a.friction < np.inf:
                    continue
                g, slips = rate[self._own(a)], float(w[self._own(a)] @ a.tangent)
                if self._sense[k] * slips < 0:              # it would slide the other way: it sticks
                    self._sense[k], good = 0.0, False
                elif not self._sense[k] and abs(g @ a.tangent) > 1.001 * a.friction * max(g @ a.normal, 0.0):
                    self._sense[k], good = float(np.sign(g @ a.tangent)), False
            if good:
                last = self._arrivals[-1]
                return rate if rate[self._own(last)] @ last.normal > 0 else None
        return None

    def _held_by(self, held: Sequence[Arrival], w: np.ndarray) -> np.ndarray:
        """Forces g that hold points against motions w, shape (m,), as they stick and slide; NaN: there are none."""
        forces, motions = [np.zeros((0, len(w)))], [np.zeros((0, len(w)))]
        for a, sense in zip(held, self._sense, strict=False):
            sticks = a.friction == np.inf or a.friction > 0 and not sense
            ways = [(a.normal, a.normal), (a.tangent, a.tangent)] if sticks else [
                (a.normal + (sense * a.friction * a.tangent if sense else 0.0), a.normal)]
            for force, motion in ways:
                for rows, values in ((forces, force), (motions, motion)):
                    rows.append(np.zeros((1, len(w))))
                    rows[-1][0, self._own(a)] = values
        A, B = np.concatenate(motions), np.concatenate(forces).T
        try:
            return B @ np.linalg.solve(A @ self._C @ B, A @ w)
        except np.linalg.LinAlgError:
            return np.full(len(w), np.nan)

    def _learn(self, length: float) -> bool:
        """Columns of the arrival that is to be held and of those that come next as it looks; False: no factors."""
        last, arrival, chosen = self._pieces[-1], self._arrivals[-1], []
        left = length - last.begins
        for f, face in enumerate(self._faces):
            times = arrivals(face.law, last.at[f], last.speed[f], self._free[f], left)
            times[[i for rank, g, i in self._known if (rank, g) == (self._comm.rank, f)]] = left
            if (arrival.rank, arrival.face) == (self._comm.rank, f):
                times[arrival.point] = -1.0
            first = np.argsort(times, kind="stable")[: self._batch]
            chosen.append(np.sort(first[times[first] < left]))
        found = self._response.to_points(chosen)
        if found is None:
            return False
        points = [(self._comm.rank, f, int(i)) for f, numbers in enumerate(chosen) for i in numbers]
        self._known += [point for rank in self._comm.allgather(points) for point in rank]
        self._columns, self._steps = np.column_stack([self._columns, found[0]]), np.append(self._steps, found[1])
        for f, face in enumerate(self._faces):
            by = [face.moved(column[: self._n], step)[..., None] for column, step in zip(found[0].T, found[1])]
            self._by[f] = np.concatenate([self._by[f], *by], axis=-1)
        self._C = self._gather(self._known, self._by).reshape(2 * len(self._known), -1)
        return True

    def _gather(self, points: Sequence[tuple[int, int, int]], values: list[np.ndarray]) -> np.ndarray:
        """Values of faces' own points, shape (n, 2, m), at some points, on all ranks, shape (points, 2, m)."""
        found = np.zeros((len(points), *values[0].shape[1:]))
        for k, (rank, f, i) in enumerate(points):
            if rank == self._comm.rank:
                found[k] = values[f][i]
        return found if self._comm.size == 1 else self._comm.allreduce(found, MPI.SUM)

    def _spread(self, points: Sequence[Arrival], values: np.ndarray) -> np.ndarray:
        """Values at some points, shape (points, 2), among those of all known, shape (m,)."""
        found = np.zeros(2 * len(self._known))
        for point, value in zip(points, values, strict=True):
            found[self._own(point)] = value
        return found

    def _own(self, arrival: Arrival) -> slice:
        k = self._known.index(arrival.who)
        return slice(2 * k, 2 * k + 2)


def arrivals(law: Any, start: np.ndarray, velocity: np.ndarray, free: np.ndarray, length: float) -> np.ndarray:
    """Arc length at which free points (a mask) that go straight meet the ramp, `length` if not before, shape (n,)."""
    at, times = length * np.linspace(0, 1, 17), np.full(len(start), length)
    ways = 1.01 * length * np.linalg.norm(velocity, axis=1)             # none comes nearer by more
    near = np.flatnonzero(free & (law.distance(start) + ways > -law.theta))
    if len(near):
        gap = -law.theta - law.part(near).distance(start[near] + at[:, None, None] * velocity[near])    # shape (17, m)
        hit = np.flatnonzero((gap[1:] <= 0).any(0))
        k = np.argmax(gap[1:, hit] <= 0, axis=0)
        before, now = np.maximum(gap[k, hit], 0.0), gap[k + 1, hit]
        share = np.divide(before, before - now, out=np.zeros(len(hit)), where=before > 0)
        times[near[hit]] = at[k] + (at[k + 1] - at[k]) * share
    return times
