"""Contact of one face with a tool: forces at its points and their history variables. No form is compiled per tool."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..forms.history import Start
from ..forms.transfer import MovingLeastSquares
from ..mesh.nodes import matching_rows
from ..physics.contact import Contact
from ..physics.contact_law import ContactHistory, ContactLaw, Motion, Tractions, symmetric_stiffness
from ..values.tolerances import NEGLIGIBLE
from .rule import Gauss, Lobatto, Rule, Vertices


class FaceHistory(NamedTuple):
    """History variables of the points of a face at the last accepted state.

    Attributes:
        history: history variables of the contact law.
        newly_closed: mask of the points that came into contact in the step to this state, shape (n,).
        penalty: penalty with which the state was solved for, over the reference penalty, shape (n,)
            (`Contact.present_area`).
    """

    history: ContactHistory
    newly_closed: np.ndarray
    penalty: np.ndarray

    def saved(self, points: np.ndarray, comm: Any) -> dict[str, np.ndarray]:
        """Return {name: array} of history variables and points (n, components), length, of all ranks; collective."""
        parts = comm.allgather((points, *self.history, self.newly_closed, self.penalty))
        names = ("points", *self.history._fields, "newly_closed", "penalty")
        return {name: np.concatenate(column) for name, column in zip(names, zip(*parts, strict=True))}

    @classmethod
    def loaded(cls, data: dict[str, Any], points: np.ndarray, start: ContactHistory, tolerance: float) -> FaceHistory:
        """Return the history variables of owned points, shape (n, components), length, from the arrays of `saved`.

        Raise `InputError` if a point has no stored one within `tolerance`, length. `start` gives the shapes of arrays.
        """
        rows = matching_rows(points, data["points"], tolerance,
                             "checkpoint: a contact point of the scene is not in it: it belongs to another mesh")
        history = ContactHistory(*(np.array(data[name], dtype=float)[rows].reshape(getattr(start, name).shape)
                                   for name in ContactHistory._fields))
        return cls(history, np.array(data["newly_closed"], dtype=bool)[rows], np.array(data["penalty"])[rows])


class Increment:
    """Tractions at n contact points during one increment, starting from the last accepted state.

    An increment begins with each run of Newton's method, and with each evaluation of a state. It ends when the state is
    accepted. x are the positions of the points relative to the tool, with c components. In each iteration these methods
    are called:

    * `tractions(x)`, for the residual.
    * `linearise(x)` at the same positions. After it, `tractions(x)` returns the linearised law with its stiffness.
    * If statuses change, the local contact problem (`LocalSolve`) reads `newly_closed` and `last`, predicts tractions
      by `after`, and sets the sense of sliding of the next iteration by `expect`.

    `start` are the positions at the last accepted state, shape (n, c), length. The first iteration linearises the law
    at the guess for the points `guessed`, mask of shape (n,), and extrapolates from `start` for the others.

    Attributes:
        last: `Tractions` that were computed last, with the `ContactStatus` of each point and, after `linearise`, the
            stiffness that it used; None before.
    """

    def __init__(self, law: ContactLaw, history: ContactHistory | None, start: np.ndarray | None = None,
                 guessed: np.ndarray | None = None):
        self._law, self._history = law, history
        self._touched = None if start is None else law.touching(start, history)
        self._before: Motion | None = None if start is None else law.motion(start, history)   # in the last iteration
        self._guessed = guessed
        self._sense: np.ndarray | None = None               # of sliding in the last iteration
        self.last: Any = None
        self._last_x: Any = None                            # positions of `last`, and their bytes
        self._last_positions = b""

    def tractions(self, x: np.ndarray) -> Tractions:
        """Return the tractions at x (n, c), length, of the law, or linearised after `linearise(x)`, stored."""
        positions = x.tobytes()
        if self.last is None or positions != self._last_positions:
            self._last_x, self._last_positions, self.last = x, positions, self._law.tractions(x, self._history)
        return self.last

    def linearise(self, x: np.ndarray) -> np.ndarray:
        """Linearise the law at distances and slips extrapolated from the last iteration to x, shape (n, c), length.

        Return the tractions of the linearised law minus those of the law itself, both at x, shape (n, c), stress.
        """
        plain = found = self.tractions(x)
        now = self._law.motion(x, self._history)
        if self._before is not None:
            expected = self._before.to(x)
            if self._guessed is not None:
                expected = Motion(*[np.where(self._guessed if a.ndim == 1 else self._guessed[:, None], b, a)
                                    for a, b in zip(expected, now)])
            found = self._law.tractions(x, self._history, self._sense, expected)
            self._last_x, self.last = x, found
        self._sense, self._before, self._guessed = found.sense, now, None
        return found.force - plain.force

    @property
    def newly_closed(self) -> np.ndarray:
        """Mask of the points that are in contact now and were open at the start of the increment, shape (n,)."""
        if self._touched is None:
            return np.zeros(len(self._last_x), dtype=bool)
        return self._law.touching(self._last_x, self._history) & ~self._touched

    def after(self, motion: np.ndarray) -> Tractions:
        """Return the law linearised after a motion y (n, c), length: the traction f + S y, with the stiffness S."""
        assert self._before is not None
        return self._law.tractions(self._last_x, self._history, None, self._before.to(self._last_x + motion))

    def ramp_depth(self, motion: np.ndarray) -> np.ndarray:
        """Return the depth in the ramp over its width 2 theta, shape (n,), after a motion, shape (n, c), length."""
        assert self._before is not None
        return self._before.to(self._last_x + motion).distance / (2 * self._law.theta) + 0.5

    @property
    def ramp_normal(self) -> np.ndarray:
        """Normal times the width of the ramp, along which sticking points stop at its edge, shape (n, c), length.

        It is 0 for points that slide, adhere or have no friction.
        """
        assert self._before is not None
        law = self._law
        sticks = np.reshape(law.has_friction and not law.adhesive and law.sticks, (-1, 1))
        return 2 * law.theta * sticks * self._before.normal

    def expect(self, points: np.ndarray, sense: np.ndarray) -> None:
        """Set the sense of sliding, 1, -1 or 0 (sticking), at masked points, shape (n,) both, for `linearise`."""
        self._sense = np.where(points, sense, 0.0 if self._sense is None else self._sense)


class FaceContact:
    """Residual, tangent and history variables of one contact, at the n locally owned points of its face.

    Positions are relative to the tool: position of the point minus travel of the tool. A state is given by `fields`,
    the locally owned unknowns, and by `control`. `assemble` assembles a compiled linear form and returns its owned
    entries.

    Attributes:
        rule: quadrature rule, with the contact points (`Rule`).
        points: their reference positions, shape (n, components), length.
        law: contact law at the points.
        thickness: thickness of the body behind the face, length.
        reference_length: length to which penalty, ramp and elastic slip refer (`Contact.reference_length`).
        increment: the current `Increment`.
        history: history variables of the contact law; None if it has none, as without friction.
        displacement: function of owned unknowns, see `Rule.displacement`.
        add: function that adds dimensionless forces at the points to owned entries of the residual, see `Rule.add`.
        scale: factor from tractions to the dimensionless forces in the residual F, shape (n,), 1/stress.
        active: True if the contact is active in the stage.
        moves: True if the tool moves as the control changes, in the stage.
        shift: reduction of the signed distances from the tool after a remeshing, shape (n,), length; else None.
        applied: dimensionless forces, shape (n, c), in the residual in place of the law, except where NaN; or None.
        unbalanced: sum of the residual at the points in contact, as a force, shape (components,), stress length^2. The
            resultant `force` is reduced by it, so that it balances the internal forces of the body. It is 0 except in
            the perturbed runs of a design sensitivity, whose changes of the gaps are below round-off.
    """

    def __init__(self, solid: Any, contact: Contact, assemble: Any):
        self.contact, self.comm, self._solid, self._length = contact, solid.comm, solid, solid.length
        in_space = contact.tool.components == 3
        self.rule: Rule = (Vertices(solid, assemble) if in_space else
                           Lobatto(solid, contact.on, assemble) if contact.points == "nodes" else
                           Gauss(solid, contact.on, int(contact.points)))
        self.points, self.thickness = self.rule.points, solid.thickness(contact.on)
        self.displacement, self.add = self.rule.displacement, self.rule.add
        self.reference_length = contact.reference_length(self.thickness, solid.length)
        self._warm = solid.temperature.nodes(self.rule.nodes, contact.on) if contact.friction_by_temperature else None
        self._penalty = np.ones(len(self.points))
        self.unbalanced = np.zeros(self.points.shape[1])
        self.shift: np.ndarray | None = None
        self.law = self._law(1.0)
        self.scale = solid.length / (solid.stress * solid.volume) * self.rule.area
        self._travel_vector = solid.length * contact.travel_vector
        self.enter(0.0, float(contact.driven), True)
        self._in_tangent = np.zeros((*self.points.shape, self.points.shape[1]))  # stiffness in the last tangent
        self._guessed: np.ndarray | None = None
        self.applied: np.ndarray | None = None
        self._stored: FaceHistory | None = None
        self.history: ContactHistory | None = None
        self.start()

    def enter(self, base: float, rate: float, active: bool) -> None:
        """Set the travel of the tool at control 0 and its derivative, over the length scale, and whether it is active.
        """
        self._base, self._rate, self.active, self.moves = base, rate, active, bool(rate)

    def shift_distances(self, shift: np.ndarray) -> None:
        """Reduce distances from the tool by `shift`, (n,), length: a remeshed body thus keeps its pressures."""
        self.shift = shift
        self.law = self._law(self._penalty)

    def _temperatures(self) -> np.ndarray | None:
        """Return the temperatures at the points, shape (n,); None if friction does not depend on the temperature."""
        return None if self._warm is None else self.rule.at_points(self._solid.temperature.at_nodes(self._warm))

    def update_temperature(self) -> None:
        """Update friction to the temperature of the body; raise `InputError` if it has no finite value."""
        if self._warm is not None:
            self.law = self.law.with_friction(self.contact.friction_at(self._temperatures(), clamped=True))
            self.increment = Increment(self.law, self.history)

    def positions(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return the positions of the points relative to the tool, shape (n, components), length; fields: owned."""
        return self.points + self._length * self.displacement(fields) - self.tool_displacement(control)

    def tool_displacement(self, control: float) -> np.ndarray:
        """Return the displacement of the tool at a load parameter (control), shape (components,), length."""
        return (self._base + self._rate * control) * self._travel_vector

    def relative_motion(self, dx: np.ndarray, step: np.ndarray | float) -> np.ndarray:
        """Return the motion relative to the tool, (n, components[, k]), length, by dx, (m[, k]), and a step."""
        motion = self._length * self.displacement(dx)
        return motion - np.multiply.outer(self._travel_vector, self._rate * step) if self._rate else motion

    def tractions(self, fields: np.ndarray, control: float) -> Tractions:
        """Return the contact tractions in a state; after `linearise` there, those of the linearised law."""
        return self.increment.tractions(self.positions(fields, control))

    def touching(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return a mask of the points in contact, shape (n,); fields: locally owned unknowns of the state."""
        return self.law.touching(self.positions(fields, control), self.history)

    @property
    def area(self) -> np.ndarray:
        """Reference area on which the contact forces act, shape (n,), length^2 (per depth: length).

        For tools in three dimensions it is 0 for points whose gap closed in the last step.
        """
        if self._stored is None or not self.contact.lagged:
            return self.rule.area
        return np.where(self._stored.newly_closed, 0.0, self.rule.area)

    @property
    def stiffness_in_tangent(self) -> np.ndarray:
        """d(nodal force)/d(position) in the last tangent, shape (n, components, components), 1/length."""
        return self.scale[:, None, None] * self._in_tangent

    def forces(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return the forces on the tool near the points, shape (n, components), stress length^2; collective.

        They are contact forces and, in three dimensions, pressure on the tool between points. fields: owned.
        """
        between = self._solid.carried_forces(self, fields, control)
        return self.area[:, None] * self.tractions(fields, control).force + between

    def begin(self, old: np.ndarray | None, control: float = 0.0) -> None:
        """Begin an increment from an accepted state, owned unknowns `old`; None: only evaluate states; collective."""
        if self.contact.present_area and old is not None:   # the area of a sheet grows as its wall thins
            self._set_penalty(np.maximum(self.rule.area_ratio(old), 1.0) ** 2)
        start = None if old is None else self.positions(old, control)
        self.increment, self._guessed = Increment(self.law, self.history, start, self._guessed), None

    def keep_open(self, points: np.ndarray) -> None:
        """Keep some points without contact forces until the next increment begins; points: their mask, shape (n,)."""
        self.increment = Increment(self.law.without(points), self.history)

    def add_residual(self, values: np.ndarray, fields: np.ndarray, control: float) -> None:
        """Add the contact forces in a state to the residual `values`; both with locally owned entries."""
        force = self.scale[:, None] * self.tractions(fields, control).force
        self.add(values, force if self.applied is None else np.where(np.isnan(self.applied), force, self.applied))

    def linearise(self, values: np.ndarray, fields: np.ndarray, control: float) -> None:
        """Linearise the law at a state; its forces replace those of the law in `values`, shape (m,)."""
        self.add(values, self.scale[:, None] * self.increment.linearise(self.positions(fields, control)))

    def tangent(self, fields: np.ndarray, control: float, one_sided: bool = False) -> np.ndarray:
        """Return and store the derivative of the nodal forces by the m unknowns of each point, shape (n, m, m).

        one_sided: True gives points whose gap just closed the stiffness of deeper contact, in place of 0.
        """
        self._in_tangent = self._stiffness(fields, control, one_sided)
        return self._of_unknowns(self._in_tangent)

    def stiffness(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return the derivative of the forces by the m unknowns of each point, dimensionless, shape (n, m, m)."""
        return self._of_unknowns(self._stiffness(fields, control, False))

    def mode_stiffness(self, fields: np.ndarray, control: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the stiffness of the points in the section and round the axis, for the second variation of modes.

        Shapes: (n, m, m), symmetric, with the m unknowns of each point; (n, k, k) with its k nodes.
        """
        radius = np.full(len(self.points), np.inf)
        if self._solid.scene.kinematics.axisymmetric:
            radius = self.points[:, 0] + self._length * self.displacement(fields)[:, 0]
        both, x = np.zeros_like(self._in_tangent), self.positions(fields, control)
        both[:, 0, 0] = self.law.hoop_stiffness(x, self.history, radius)
        return self._of_unknowns(symmetric_stiffness(self.law, x, self.history)), self._of_unknowns(both)[:, ::2, ::2]

    def one_sided_change(self, fields: np.ndarray, control: float) -> np.ndarray:
        """Return one-sided minus last stiffness of points, (n, components, components), 0 if negligible."""
        change = self._stiffness(fields, control, True) - self._in_tangent
        least = NEGLIGIBLE * np.abs(self._in_tangent).max((1, 2), keepdims=True)
        return np.where(np.abs(change).max((1, 2), keepdims=True) > least, change, 0.0)

    def add_control_derivative(self, values: np.ndarray, fields: np.ndarray, control: float,
                               one_sided: bool = False) -> None:
        """Add the derivative of the contact forces by the control, through the travel of the tool, to owned `values`.

        one_sided: True gives points whose gap just closed the stiffness of deeper contact.
        """
        if self._rate:
            stiffness = self._stiffness(fields, control, one_sided)
            self.add(values, -self.scale[:, None] * (stiffness @ (self._rate * self._travel_vector)))

    def _stiffness(self, fields: np.ndarray, control: float, one_sided: bool) -> np.ndarray:
        """Return d(traction)/d(position), shape (n, components, components), stress/length.

        one_sided: True gives points whose gap just closed the stiffness of deeper contact, in place of 0.
        """
        if one_sided:
            newly_closed = self._stored.newly_closed if self._stored else np.zeros(len(self.points), dtype=bool)
            return self.law.one_sided_stiffness(self.positions(fields, control), self.history, newly_closed)
        return self.tractions(fields, control).stiffness

    def _of_unknowns(self, stiffness: np.ndarray) -> np.ndarray:
        """Return derivatives of nodal forces, shape (n, m, m), from those of tractions, stress/length."""
        return self.rule.nodal_stiffness((self.scale * self._length)[:, None, None] * stiffness)

    @property
    def _reference_penalty(self) -> float:
        """Penalty of the contact in the reference configuration, stress/length."""
        reference = self.contact.penalty * self._solid.stress / self.thickness
        return reference * (self.thickness / self.reference_length) ** 2

    def _law(self, penalty: np.ndarray | float) -> Any:
        """Return the contact law at the points; penalty: current over reference penalty, shape () or (n,)."""
        law: Any = self.contact.law(self._reference_penalty * penalty, self.reference_length, self.points,
                                    self._temperatures())
        if self.shift is not None:
            law.shift = self.shift
        return law

    def _set_penalty(self, penalty: np.ndarray) -> None:
        """Set the ratio of the current to the reference penalty, shape (n,), and update the law."""
        if not np.array_equal(penalty, self._penalty):
            self._penalty, self.law = penalty, self._law(penalty)

    @property
    def has_history(self) -> bool:
        """True if the contact forces depend on history variables."""
        return self.law.has_history or self.contact.present_area

    def start(self) -> None:
        """Set the history variables of the reference configuration, in which the points have not been in contact."""
        self._start_at(self.points)

    def activate(self, fields: np.ndarray, control: float) -> None:
        """Set the history variables of points without earlier contact, at the state of activation."""
        self._start_at(self.positions(fields, control))

    def _start_at(self, x: np.ndarray) -> None:
        """Set the history variables of points that begin at positions x relative to the tool, shape (n, c), length."""
        none, ones = np.zeros(len(x), dtype=bool), np.ones(len(x))
        self._set_history(FaceHistory(self.law.start(x), none, ones) if self.has_history else None)

    def set_closures(self, closure: np.ndarray, guessed: np.ndarray | None = None) -> None:
        """Store the predicted positions of gap closures in the step, shape (n, components), length.

        At NaN no friction acts in the step. guessed: mask of points with predicted forces, shape (n,).
        """
        self._guessed = guessed
        if self._stored is not None:
            self._set_history(self._stored._replace(history=self._stored.history._replace(closure=closure)))

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Update the history variables to an accepted state, owned unknowns x; they stay while the tool is inactive."""
        if self._stored is None or not self.active:
            return
        old, theta = self._stored.history, self.law.theta
        history = self.law.tractions(self.positions(x, control), old).history
        penalty = self._penalty if self.contact.present_area else self._stored.penalty
        newly_closed = (old.distance <= -theta) & (history.distance > -theta)
        if self.contact.lagged:                             # no point has moved since a stage began here
            moved = np.abs(history.closure - old.closure).max(1, initial=0.0)
            newly_closed |= self._stored.newly_closed & (moved < 1e-12 * self._length)
        self._set_history(FaceHistory(history, newly_closed, penalty))

    @property
    def force_scale(self) -> float:
        """Magnitude of the forces in the body: shear modulus times thickness times largest extent of the body."""
        return float(self._solid.stress * self.thickness * self._length)

    def get(self) -> FaceHistory | None:
        """Return the current history variables; None without history variables."""
        return self._stored

    def put(self, variables: FaceHistory | None) -> None:
        """Restore history variables that `get` returned."""
        if variables is not self._stored:
            self._set_history(variables)

    def _set_history(self, variables: FaceHistory | None) -> None:
        """Set the history variables (None: there are none), and begin an increment that evaluates single states."""
        self._stored, self.history = variables, variables and variables.history
        if self.contact.present_area and variables is not None:
            self._set_penalty(variables.penalty)
        self.increment = Increment(self.law, self.history)

    def save(self, variables: FaceHistory) -> dict[str, np.ndarray]:
        """Return {name: array} of history variables and reference positions of the points of all ranks; collective."""
        return variables.saved(self.points, self.comm)

    def load(self, data: dict[str, Any]) -> FaceHistory:
        """Return the history variables from the arrays of `save`; raise `InputError` if a point is missing."""
        return FaceHistory.loaded(data, self.points, self.law.start(self.points), 1e-9 * self._length)

    def transfer(self, source: FaceContact, variables: FaceHistory | None, x: np.ndarray, control: float,
                 mapping: Callable[[np.ndarray], np.ndarray]) -> FaceHistory | None:
        """Return the history variables of the same face on another mesh (`source`), transferred to this face.

        A point is in contact if the nearest point of the source is; elastic slips are fitted. x: locally owned unknowns
        on this mesh. mapping: from reference points of the other mesh, shape (n, components), to points of this one.
        """
        if variables is None:
            return None
        interpolation, history = MovingLeastSquares(self.comm, mapping(source.points), self.points), variables.history
        distance, newly_closed, penalty = (interpolation.source_values(values)[interpolation.nearest] for values in
                                      (history.distance, variables.newly_closed, variables.penalty))
        touched, position, theta = distance > -source.law.theta, self.positions(x, control), self.law.theta
        free = np.minimum(self.law.distance(position), -(1 + 1e-9) * theta)
        slip = np.where(touched, interpolation.fitted(history.slip), 0.0)
        distance = np.where(touched, distance * theta / source.law.theta, free)
        return FaceHistory(ContactHistory(position, distance, slip, position), newly_closed, penalty)
