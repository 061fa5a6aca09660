"""Contact of one face as forces at its nodes, and what they remember (a `History`). No form is compiled per tool."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from ..errors import InputError
from ..physics.contact import Contact, Motion, Touch, Tractions

HOVERING = 1e-3
"""Distances (over thickness) at which a node is as good as in touch."""

_AT_END = 0.95
"""Part of a step from which on what arrives, and will stick, has no friction until the next."""

_SLIDES = 1e-2
"""How far (over the length of face that is its own) a node may slide so."""

_CUT_OFF, _MOST_PLACES = 0.5, 4000
"""How deep the way of a node in a step may lead through a tool, over the length of face that is its own; at how many
places the way is looked at."""

_SAME_STIFFNESS = 1e-3
"""Of the stiffness of a node: what it may differ by to count as the same in the tangent ahead."""


class Memory(NamedTuple):
    """What the nodes of a face remember of the last accepted state.

    touch: of the law of friction; arrived: which nodes came into contact in the step that ended there, shape (n,).
    """

    touch: Touch
    arrived: np.ndarray


class ContactNodes:
    """Residual, tangent and history of one contact, at the nodes of its face that this rank owns.

    Args:
        solid: the scene's `Solid`; contact: the `Contact`; assemble: makes the owned part of a linear form.

    Attributes:
        dofs: local numbers of (u_r, u_z), shape (n, 2); points: reference positions, shape (n, 2), length.
        lengths, lumped: reference length and area that belong to each node, shape (n,) (lumped: 0 on the axis).
        area: that forces act on: `lumped`, but for a facet that ends on the axis, see `_spread_to_axis`, shape (n,).
    """

    def __init__(self, solid: Any, contact: Contact, assemble: Any):
        self.solid, self.contact = solid, contact
        self._comm, self._length = solid.comm, solid.length
        self._place(assemble)
        self._temperature_nodes: Any = None                 # of the temperature that friction depends on
        if contact.friction_by_temperature:
            self._temperature_nodes = solid.temperature.nodes(self._nodes())
        self.thickness = solid.thickness(contact.on)
        self.law = contact.law(contact.penalty * solid.stress / self.thickness, self.thickness, self.points,
                               self._temperatures())
        self._scale = solid.length / (solid.stress * solid.volume) * self.area
        self._motion = solid.length * np.array(contact.moves or (0.0, 0.0))
        self.base, self.rate = 0.0, float(contact.driven)   # of the travel by the control (`Setting`)
        self.present = True                                 # it takes part in the stage
        self._last: Any = None                              # positions and tractions last computed
        self._in_tangent = np.zeros((len(self.points), 2, 2))   # stiffness per area in the tangent last made
        # of Newton's method: `Motion` and sense of sliding at the iteration before; which points touched before it
        self._iterate: Any = None
        self._sense: Any = None
        self._touched: Any = None
        # of the step ahead: nodes that it may bring into contact (where it does not matter when they come, its own
        # convergence limits them), and that its tangent brings
        heat = solid.scene.heat
        timed = self.law.remembers or heat is not None and heat.conducts(contact)
        self._allowed = contact.nodes_per_step * (1 if timed else 10)
        self._foreseen = 0
        self._memory: Any = None
        self.start()

    def _place(self, assemble: Any) -> None:
        """Where the contact acts: `dofs`, `points`, `lengths` and `area`."""
        solid, on = self.solid, self.contact.on
        vectors, numbers = solid.space.sub(0).collapse()
        nodes = np.sort(fem.locate_dofs_topological(vectors, 1, solid.scene.mesh.facets_of(on)))
        dofs = np.asarray(numbers, dtype=np.int32).reshape(-1, 2)[nodes]
        own = dofs[:, 0] < solid.space.dofmap.index_map.size_local
        self.dofs, self.points = dofs[own], vectors.tabulate_dof_coordinates()[nodes[own], :2].copy()
        self.lengths = assemble(solid.compile(solid.length_row(on)))[self.dofs[:, 0]]
        self.lumped = self.lengths * solid.scene.kinematics.weight(self.points.T)
        self.area = self.lumped.copy()
        self._spread_to_axis(solid.scene.kinematics)

    def displacement(self, values: np.ndarray) -> np.ndarray:
        """Of the points, shape (n, 2), for owned unknowns, in their units."""
        return values[self.dofs]

    def add(self, values: np.ndarray, forces: np.ndarray) -> None:
        """Add forces at the points, shape (n, 2), to the owned residual."""
        values[self.dofs] += forces

    def _between_unknowns(self, stiffness: np.ndarray) -> np.ndarray:
        """Stiffness of the points, shape (n, 2, 2), as that of their unknowns."""
        return stiffness

    def _nodes(self) -> np.ndarray:
        """Reference positions of the nodes of the face that the points take a temperature from, length."""
        return self.points

    def _temperatures(self) -> np.ndarray | None:
        """Of the body at the points now, shape (n,); None where friction does not depend on them."""
        nodes = self._temperature_nodes
        return None if nodes is None else self.solid.temperature.at_nodes(nodes)

    def take_temperature(self) -> None:
        """The temperature has changed: friction follows it.

        Raises:
            InputError: friction has no value at a temperature.
        """
        if self._temperature_nodes is not None:
            self.law, self._last = self.law.with_friction(self.contact.friction_at(self._temperatures())), None

    def positions(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Nodes seen from the tool, shape (n, 2), length; `fields`: owned unknowns."""
        return self.points + self._length * self.displacement(fields) - self.travelled(control)

    def travelled(self, control: float) -> np.ndarray:
        """How far the tool has moved in (r, z), shape (2,), length."""
        return (self.base + self.rate * control) * self._motion

    def tractions(self, fields: np.ndarray, control: float) -> Tractions:
        """What the law gives at a state, computed once for it."""
        x = self.positions(fields, control)
        if self._last is None or not np.array_equal(x, self._last[0]):
            self._last = x, self.law.tractions(x, self.touch)
        return self._last[1]

    @property
    def touch(self) -> Touch | None:
        """What the law of friction remembers; None without friction."""
        return self._memory and self._memory.touch

    def start(self) -> None:
        """Nothing has touched the tool yet, the body being at rest."""
        self._start_at(self.points)

    def come_in(self, fields: np.ndarray, control: float) -> None:
        """The tool comes in: nothing has touched it yet."""
        self._start_at(self.positions(fields, control))

    def _start_at(self, x: np.ndarray) -> None:
        self.put(Memory(self.law.start(x), np.zeros(len(x), dtype=bool)) if self.law.remembers else None)

    def get(self) -> Memory | None:
        """What the nodes remember of the last accepted state; None without friction."""
        return self._memory

    def put(self, memory: Memory | None) -> None:
        """Remember something else."""
        if memory is not self._memory:
            self._memory, self._last = memory, None

    def advance(self, fields: np.ndarray, control: float) -> None:
        """A state is accepted: remember it. (A tool that is away remembers nothing new.)"""
        if self._memory is None or not self.present:
            return
        before, theta = self._memory.touch.distance, self.law.theta
        touch = self.law.tractions(self.positions(fields, control), self._memory.touch).touch
        self.put(Memory(touch, (before <= -theta) & (touch.distance > -theta)))

    def save(self, memory: Memory) -> dict[str, np.ndarray]:
        """A memory as plain data, node by node with its reference position, all ranks; collective."""
        parts = self._comm.allgather((self.points, *memory.touch, memory.arrived))
        names = ("points", *memory.touch._fields, "arrived")
        return {name: np.concatenate(column) for name, column in zip(names, zip(*parts, strict=True))}

    def load(self, data: dict[str, Any]) -> Memory:
        """The own part of what `save` gave.

        Raises:
            InputError: a node of the face is not in it.
        """
        from scipy.spatial import cKDTree
        away, rows = cKDTree(np.array(data["points"]).reshape(-1, 2)).query(self.points)
        if np.any(away > 1e-9 * self._length):
            raise InputError("checkpoint: a contact node of the scene is not in it: it is of another mesh")
        like = self.law.start(self.points)
        touch = Touch(*(np.array(data[name], dtype=float)[rows].reshape(getattr(like, name).shape)
                        for name in Touch._fields))
        return Memory(touch, np.array(data["arrived"], dtype=bool)[rows])

    def _spread_to_axis(self, kinematics: Any) -> None:
        """Give the node on the axis some area of its facet's, so that something holds it.

        (1/24, -2/24, 1/24) of L times the weight at L: integrals of what is linear along the facet stay exact.
        """
        nodes = np.concatenate(self._comm.allgather(np.column_stack([self.points, self.lengths, self.lumped])))
        for axis in nodes[_no_area(nodes[:, 3], nodes[:, 2])]:
            length = 6 * axis[2]                                        # of its facet, on which Gauss-Lobatto gives 1/6
            away = np.hypot(*(self.points - axis[:2]).T) / length
            at = kinematics.weight(np.array([axis[0] + length, axis[1]])) * length / 24
            for place, share in ((0.0, 1), (0.5, -2), (1.0, 1)):
                self.area[np.abs(away - place) < 0.1] += share * at

    @property
    def active(self) -> np.ndarray:
        """`Tractions.active` of those last computed, shape (n,)."""
        return self._last[1].active

    @property
    def arrivals(self) -> np.ndarray:
        """Which points touch at the state last looked at that did not where Newton's method began, shape (n,)."""
        if self._touched is None:
            return np.zeros(len(self.points), dtype=bool)
        return self.law.touching(self._last[0], self.touch) & ~self._touched

    @property
    def ramp(self) -> float:
        """Half-width of the ramp in which contact begins, length."""
        return self.law.theta

    @property
    def scale(self) -> np.ndarray:
        """Of the forces in F by tractions, shape (n,)."""
        return self._scale

    def begin(self, x: np.ndarray | None) -> None:
        """Newton's method begins ahead of a state with the nodes at x, shape (n, 2), if there is one."""
        self._sense = None
        self._touched = None if x is None else self.law.touching(x, self.touch)
        self._iterate = None if x is None else self.law.motion(x, self.touch)

    def linearise(self, values: np.ndarray, fields: np.ndarray, control: float) -> None:
        """Make the tangent at a state the one that an iteration wants, and the residual (`values`) fit to it."""
        x = self.positions(fields, control)
        plain = self.tractions(fields, control)
        if self._iterate is not None:
            found = self.law.tractions(x, self.touch, self._sense, self._iterate.to(x))
            self.add(values, self._scale[:, None] * (found.force - plain.force))
            self._last = x, found
        self._sense = self._last[1].sense
        self._iterate = self.law.motion(x, self.touch)

    def moved(self, dx: np.ndarray, step: float) -> np.ndarray:
        """Change of `positions` by one of the unknowns (own part) and of the control, shape (n, 2), length."""
        return self._length * self.displacement(dx) - self.rate * step * self._motion

    def taken(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces and stiffnesses per area that `linearise` has taken, of some nodes, shapes (m, 2), (m, 2, 2)."""
        return self._last[1].force[nodes], self._last[1].stiffness[nodes]

    def foretold(self, by: np.ndarray, nodes: np.ndarray | slice = slice(None)) -> Tractions:
        """The law at some nodes, linearised where they come to if they move on by so much, shape (m, 2), length."""
        x, touch = self._last[0][nodes], self.touch and Touch(*(part[nodes] for part in self.touch))
        iterate = Motion(*(part[nodes] for part in self._iterate))
        return self.law.part(nodes).tractions(x, touch, None, iterate.to(x + by))

    def expect(self, nodes: np.ndarray, sense: np.ndarray) -> None:
        """Which way nodes, shape (n,), are going to slide."""
        self._sense = np.where(nodes, sense, self._sense)

    def add_residual(self, values: np.ndarray, fields: np.ndarray, control: float) -> None:
        """Add the nodal forces to the owned residual."""
        self.add(values, self._scale[:, None] * self.tractions(fields, control).force)

    def stiffness(self, fields: np.ndarray, control: float, ahead: bool = False) -> np.ndarray:
        """For a tangent: derivative of forces by the unknowns of each point, shape (n, m, m); `ahead`: see the law."""
        self._in_tangent = self._stiffness(fields, control, ahead)
        return self._between_unknowns((self._scale * self._length)[:, None, None] * self._in_tangent)

    def stiffness_round(self, fields: np.ndarray, control: float) -> np.ndarray:
        """As `stiffness`, of forces round the axis by motions there, shape (n, m/2, m/2), see the law."""
        radius = np.full(len(self.points), np.inf)
        if self.solid.scene.kinematics.axisymmetric:
            radius = self.points[:, 0] + self._length * self.displacement(fields)[:, 0]
        found = self.law.stiffness_round(self.positions(fields, control), self.touch, radius)
        both = np.zeros((len(found), 2, 2))
        both[:, 0, 0] = self._scale * self._length * found
        return self._between_unknowns(both)[:, ::2, ::2]

    def change_ahead(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Stiffness ahead of an accepted state, less that in the tangent last made, shape (n, 2, 2), stress/length.

        0 where they differ by less than `_SAME_STIFFNESS` of it.
        """
        change = self._stiffness(fields, control, True) - self._in_tangent
        least = _SAME_STIFFNESS * np.abs(self._in_tangent).max((1, 2), keepdims=True)
        return np.where(np.abs(change).max((1, 2), keepdims=True) > least, change, 0.0)

    def _stiffness(self, fields: np.ndarray, control: float, ahead: bool) -> np.ndarray:
        """Derivative of the tractions by the positions, shape (n, 2, 2), stress/length."""
        if ahead:
            arrived = self._memory.arrived if self._memory else np.zeros(len(self.points), dtype=bool)
            return self.law.stiffness_ahead(self.positions(fields, control), self.touch, arrived)
        return self.tractions(fields, control).stiffness

    def add_control_derivative(self, values: np.ndarray, fields: np.ndarray, control: float,
                               ahead: bool = False) -> None:
        """Add the derivative of the nodal forces by the control: the tool moves; `ahead`: as in `stiffness`."""
        if self.rate:
            stiffness = self._stiffness(fields, control, ahead)
            self.add(values, -self._scale[:, None] * (stiffness @ (self.rate * self._motion)))

    def reach(self, fields: np.ndarray, control: float, direction: np.ndarray, slope: float, length: float) -> float:
        """How long a step along a tangent may be: to the first touch, or until enough new nodes touch.

        A step that would bring a whole region into contact at once would decide by its own length where it sticks.
        """
        start = self.positions(fields, control)
        velocity = self.moved(direction, slope)
        free = ~self.law.touching(start, self.touch)
        times = self._arrivals(start, velocity, length)
        ahead = (times > 0.02 * length) & (times < length)         # nearer ones are as good as in touch
        times = np.sort(np.concatenate(self._comm.allgather(times[ahead])))
        touching = self._comm.allreduce(int(np.sum(~free & (self.area > 0))), MPI.SUM)
        allowed = self._allowed if touching > 1 else 1
        return min(1.001 * times[allowed - 1], length) if len(times) >= allowed else length

    def prepare(self, fields: np.ndarray, control: float, direction: np.ndarray, slope: float, length: float,
                ends: bool) -> None:
        """A step of this length along a tangent is about to be taken: foretell where nodes arrive.

        ends: it is to end where a node touches that sticks (see `touches_by`), which has no friction before.
        """
        start = self.positions(fields, control)
        velocity = self.moved(direction, slope)
        times = self._arrivals(start, velocity, length)
        self._foreseen = self._comm.allreduce(int(np.sum(times < length)), MPI.SUM)
        if self._memory is not None:
            at_end = ends & self.contact.sticks & (times >= _AT_END * length)
            arrival = np.where(at_end[:, None], np.nan, start + times[:, None] * velocity)
            self.put(self._memory._replace(touch=self._memory.touch._replace(arrival=arrival)))

    def _arrivals(self, start: np.ndarray, velocity: np.ndarray, length: float) -> np.ndarray:
        """Arc length at which free nodes meet the ramp, `length` if they do not before, shape (n,)."""
        at, times = length * np.linspace(0, 1, 17), np.full(len(start), length)
        ways = 1.01 * length * np.hypot(*velocity.T)                    # none comes nearer by more
        free = ~self.law.touching(start, self.touch) & (self.area > 0)
        near = np.flatnonzero(free & (self.law.distance(start) + ways > -self.law.theta))
        law = self.law.part(near)
        gap = -law.theta - law.distance(start[near] + at[:, None, None] * velocity[near])       # shape (17, m)
        hit = np.flatnonzero((gap[1:] <= 0).any(0))
        k = np.argmax(gap[1:, hit] <= 0, axis=0)
        before, now = gap[k, hit], gap[k + 1, hit]
        times[near[hit]] = at[k] + (at[k + 1] - at[k]) * before / (before - now)
        return times

    def grew_too_much(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """More than twice the new nodes that a step is meant, or foreseen, to bring into contact."""
        if self._memory is None:
            return False
        a, b = (self.law.distance(self.positions(f, c)) for f, c in ((old, old_control), (new, control)))
        found = int(np.sum((a <= -self.law.theta - HOVERING * self.thickness) & (b > -self.law.theta)))
        return self._comm.allreduce(found, MPI.SUM) > 2 * max(self._allowed, self._foreseen) + 2

    def passes_through(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """True if a point's straight way from one state to another, seen from the tool, leads through the tool.

        That is, deeper than both its ends by `_CUT_OFF`: so much a point may cut off an edge that it slides over.
        """
        a, b = self.positions(old, old_control), self.positions(new, control)
        way, most = np.hypot(*(b - a).T), _CUT_OFF * self.lengths
        ends = np.maximum(np.maximum(self.law.distance(a), self.law.distance(b)), 0.0)
        between = (self.law.distance(a) + self.law.distance(b) + way) / 2          # no place of the way is deeper
        far = np.flatnonzero((between > ends + most) & (self.lengths > 0))
        found = False
        if len(far):
            parts = int(min(np.ceil((way / most)[far].max() * 2), _MOST_PLACES)) + 1
            places = a[far] + np.linspace(0, 1, parts)[:, None, None] * (b - a)[far]
            found = bool(np.any(self.law.part(far).distance(places).max(0) > (ends + most)[far]))
        return self._comm.allreduce(found, MPI.LOR)

    def touches_by(self, new: np.ndarray, control: float, direction: np.ndarray, slope: float, length: float) -> float:
        """Part of a step by which the first of the nodes touched whose slip the step got wrong; 1 if there is none.

        Since it touched its pressure has grown, and it has slid, as it does at the end, along (direction, slope). One
        that sticks slid too far without friction; under Coulomb's law it slides the other way than it came.
        """
        if self._memory is None or not self.law.has_friction:
            return 1.0
        end, touch = self.positions(new, control), self._memory.touch
        near = self.law.nearest(end)
        F, grows = self.law.ramp(near.distance)
        velocity = self.moved(direction, slope)
        rate = np.maximum(grows * np.einsum("ni,ni->n", near.normal, velocity), 0.0)
        since = np.minimum(np.divide(F, rate, out=np.full(len(F), length), where=rate > 0), length)
        slid = since * np.einsum("ni,ni->n", near.tangent, velocity)
        if self.contact.sticks:
            wrong = np.isnan(touch.arrival[:, 0]) & (np.abs(slid) > _SLIDES * self.lengths)
        else:
            counted = np.einsum("ni,ni->n", near.tangent, end - touch.arrival)
            wrong = (slid * counted < 0) & (np.minimum(np.abs(slid), np.abs(counted)) > self.law.elastic_slip)
        late = (touch.distance <= -self.law.theta) & (F > 0) & wrong
        return self._comm.allreduce(1 - float(since[late].max(initial=0.0)) / length, MPI.MIN)

    def touching(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Which nodes touch, or are held, shape (n,)."""
        return self.law.touching(self.positions(fields, control), self.touch)

    def largest_penetration(self, fields: np.ndarray, control: float) -> float:
        """Depth of the deepest node inside the tool, 0 if none is, length, all ranks."""
        d = self.contact.tool.signed_distance(self.positions(fields, control))
        return self._comm.allreduce(max(float(d.max(initial=0.0)), 0.0), MPI.MAX)

    def contact_length(self, fields: np.ndarray, control: float) -> float:
        """Reference length of the face that is in touch, all ranks."""
        return self._comm.allreduce(float(self.lengths[self.touching(fields, control)].sum()), MPI.SUM)

    def traction(self, fields: np.ndarray, control: float) -> tuple[np.ndarray, np.ndarray]:
        """(reference points (m, 2), normal and tangential traction per reference area (m, 2)) of all ranks, by R.

        That is force over `lumped` area: their sum is the force. The node on the axis has none: its force counts to the
        middle of its facet, whose pressure it shows (pressure is even in R, tangential traction odd).
        """
        found = self.tractions(fields, control)
        rows = np.column_stack([self.points, self.area, self.lumped, self.lengths, found.normal, found.tangential])
        rows = np.concatenate(self._comm.allgather(rows))
        rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
        points, (area, lumped, lengths), values = rows[:, :2], rows[:, 2:5].T, rows[:, 5:]
        axis = _no_area(lumped, lengths)
        values = values * np.divide(area, lumped, out=area.copy(), where=~axis)[:, None]
        for i in np.flatnonzero(axis):
            middle = np.argsort(np.hypot(*(points - points[i]).T))[1]
            values[middle] += values[i] / lumped[middle]
            values[i] = values[middle, 0], 0.0
        return points, values

    def force(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Total force of the body on the tool (r, z), shape (2,), stress length^2 (per depth: length), all ranks.

        Axisymmetric: the r entry is the radial traction summed around, not a resultant (which is 0).
        """
        total = (self.area[:, None] * self.tractions(fields, control).force).sum(0)
        return self._comm.allreduce(total, MPI.SUM)

    def energy(self, fields: np.ndarray, control: float) -> float:
        """What penetration holds, stress length^3 (per depth: length^2), all ranks."""
        return self._comm.allreduce(float(self.area @ self.law.energy(self.positions(fields, control))), MPI.SUM)

    def pressing(self, fields: np.ndarray, control: float) -> float:
        """Sum of the normal forces at the points, in the units of `force`, all ranks."""
        return self._comm.allreduce(float(self.area @ self.tractions(fields, control).normal), MPI.SUM)


def _no_area(lumped: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Which nodes of a face are on the axis, of all ranks, shape (n,)."""
    return (lumped < 1e-9 * lumped.max()) & (lengths > 0)
