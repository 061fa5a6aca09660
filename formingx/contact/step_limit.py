"""Limits to the number of points that come into contact in one step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from mpi4py import MPI

from ..ranks import combined, gathered
from ..values.tolerances import NEGLIGIBLE
from .face import FaceContact


@dataclass(frozen=True)
class StepLimits:
    """Limits that contact sets to a step.

    Attributes:
        start_fraction: fraction of a step; gaps that close earlier in the step count as closed at its start.
        overshoot: length of a step that ends at a gap closure, over the arc length to the closure.
        negligible_gap: distance from the outer edge of the ramp, over the thickness of the sheet, that is negligible.
        friction_fraction: fraction of a step. If the gap of a sticking point closes in the rest of the step, friction
            acts on the point from the next step on only.
        max_slip_ratio: largest slip of a sticking point after its gap closure in a step, over its tributary length.
        max_cut_ratio: largest depth of the straight path of a point inside a tool, over its tributary length.
        max_positions: largest number of positions at which this path is checked.
        min_length: arc length (dimensionless) below which a step is rejected neither for a change of the pressure nor
            for the slip of a point after its gap closure.
        min_mixed_length: arc length (dimensionless) below which sticking points may lift off while the gaps of others
            close.
    """

    start_fraction: float = 0.02
    overshoot: float = 1.001
    negligible_gap: float = NEGLIGIBLE
    friction_fraction: float = 0.95
    max_slip_ratio: float = 2e-3
    max_cut_ratio: float = 0.5
    max_positions: int = 4000
    min_length: float = 1e-4
    min_mixed_length: float = 5e-4


LIMITS = StepLimits()


class StepRejection(NamedTuple):
    """Rejection of a step that is too long.

    Attributes:
        reason: the reason, as text for the log.
        fraction: admissible fraction of the step length; 0 if unknown.
    """

    reason: str
    fraction: float = 0.0


class Approach:
    """Contact of one face during a step: prediction of gap closures before the solve, checks after it.

    `StepLimit` calls `step_length`, `closures` and `prepare` before the solve of a step, the other methods after it.

    Attributes:
        points: number of points of the face on all ranks.
        max_closures: number of points that may come into contact in one step along the tangent. It is ten times larger
            if the result does not depend on the order of the gap closures.
    """

    def __init__(self, face: FaceContact, conducts: bool):
        self.face, self._comm, given = face, face.comm, face.contact.max_closures
        self.points = combined(face.comm, len(face.rule.points))
        nodes = max(int(given * self.points), 1) if given < 1 else int(given)
        self.max_closures = nodes * (1 if face.law.has_history or conducts else 10)
        self._predicted_closures = 0                        # number in the step, on all ranks
        self._bonded_from: np.ndarray = np.ones(len(face.rule.points))      # fraction of the step; 1: not in the step

    def touches(self, fields: np.ndarray, control: float) -> bool:
        """Return True if a point of the face, on any rank, is in contact; fields: owned unknowns, shape (n,)."""
        return bool(combined(self._comm, bool(self.face.touching(fields, control).any()), MPI.LOR))

    def step_length(self, fields: np.ndarray, control: float, direction: np.ndarray, slope: float,
                    length: float) -> float:
        """Return the arc length, at most `length`, of a step along (direction, slope), d/ds of (fields, control).

        fields, direction: locally owned unknowns, shape (n,). The step ends where `max_closures` new points have come
        into contact, or at the first gap closure if at most one point was in contact. If a whole region came into
        contact in one step, its sticking positions would depend on the step length.
        """
        face = self.face
        start, velocity = face.positions(fields, control), face.relative_motion(direction, slope)
        free = ~face.law.touching(start, face.history)
        length = self._within_motion(start, velocity, free, length)
        arc_lengths = face.law.gap_closures(start, velocity, free, length)
        ahead = (arc_lengths > LIMITS.start_fraction * length) & (arc_lengths < length)
        arc_lengths = np.sort(gathered(self._comm, arc_lengths[ahead]))
        touching = combined(self._comm, int(np.sum(~free & (face.rule.area > 0))), MPI.SUM)
        allowed = self.max_closures if touching > 1 else 1
        return min(LIMITS.overshoot * arc_lengths[allowed - 1], length) if len(arc_lengths) >= allowed else length

    def _within_motion(self, start: np.ndarray, velocity: np.ndarray, free: np.ndarray, length: float) -> float:
        """Return the arc length within which a tangent predicts gap closures; by default `length`.

        start, velocity: positions of points and d/ds, shape (n, c). free: mask of the open ones.
        """
        return length

    def closures(self, fields: np.ndarray, control: float, direction: np.ndarray, slope: float,
                 length: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the gap closures of the n owned points along a tangent (direction, slope), d/ds of (fields, control).

        For each point the arc length, shape (n,), `length` for points that are closed or stay open, and the position
        there relative to the tool, shape (n, c), length.
        """
        face = self.face
        start, velocity = face.positions(fields, control), face.relative_motion(direction, slope)
        free = ~face.law.touching(start, face.history) & (face.rule.area > 0)
        arc_lengths = face.law.gap_closures(start, velocity, free, length)
        return arc_lengths, start + arc_lengths[:, None] * velocity

    def prepare(self, arc_lengths: np.ndarray, places: np.ndarray, length: float, ends: bool,
                guessed: np.ndarray | None = None, speeds: np.ndarray | None = None) -> None:
        """Store the predicted positions `places`, shape (n, c), length, of gap closures at `arc_lengths`, shape (n,).

        speeds: d(position)/ds before the closures, shape (n, c). guessed: mask of points with predicted forces. ends:
        True if `StepLimit.check` may shorten the step to a closure. A late closure (`StepLimits.friction_fraction`)
        then carries friction in the next step only, unless its slip is too large (`StepLimits.max_slip_ratio`).
        """
        face = self.face
        self._predicted_closures = combined(self._comm, int(np.sum(arc_lengths < length)), MPI.SUM)
        if face.law.adhesive:
            self._bonded_from = np.where(False if guessed is None else guessed, arc_lengths / length, 1.0)
        at_end = ends & face.contact.sticks & (arc_lengths >= LIMITS.friction_fraction * length)
        if speeds is not None and at_end.any():
            tangent = face.law.nearest(places).tangent[at_end]
            slip = np.abs(np.einsum("ni,ni->n", speeds[at_end], tangent)) * (length - arc_lengths[at_end])
            at_end[at_end] = slip <= LIMITS.max_slip_ratio * face.rule.lengths[at_end]
        face.set_closures(np.where(at_end[:, None], np.nan, places), guessed)

    settling = 0
    """Number of Newton iterations that contact needs in a step of any length; the step control does not count them."""

    def prepares(self, ends: bool) -> bool:
        """Return True if `prepare` uses predicted gap closures; ends: True if `rejection` may shorten the step."""
        return True

    def rejection(self, old: Any, new: Any, n: int, length: float, ends: bool) -> StepRejection | None:
        """Return the rejection of a solved step that is too long for this contact, or None.

        n: number of locally owned unknowns. ends: True to also reject a step after whose gap closure a point slips
        wrongly (`fraction_to_wrong_slip`). The repeated step ends at this gap closure.
        """
        face = self.face
        a, b = face.positions(old.x[:n], old.control), face.positions(new.x[:n], new.control)
        if self.has_too_many_closures(a, b):
            return StepRejection("too many points came into contact in one step")
        if self.passes_through(old.x[:n], old.control, new.x[:n], new.control):
            return StepRejection("a tool would pass through the face that it touches")
        if length > LIMITS.min_mixed_length and self.opens_and_closes(b):
            return StepRejection("points lift off while others come into contact", 0.5)
        if ends and length > LIMITS.min_length:
            part = self.fraction_to_lost_bond(b)
            if part < 1:
                return StepRejection("gap closure", min(LIMITS.overshoot * part, 1.0))
            part = self.fraction_to_wrong_slip(b, face.relative_motion(new.direction[:n], new.slope), length)
            if part < 1:
                return StepRejection("gap closure", part)
        return None

    def has_too_many_closures(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Return True if too many points came into contact in a step from positions a to b, shape (n, c), length.

        The limit is 2 plus twice the larger of `max_closures` and the number predicted; none without history variables.
        """
        face, theta = self.face, self.face.law.theta
        if face.history is None:
            return False
        open_before = face.law.distance(a) <= -theta - LIMITS.negligible_gap * face.thickness
        found = combined(self._comm, int(np.sum(open_before & (face.law.distance(b) > -theta))), MPI.SUM)
        return bool(found > 2 * max(self.max_closures, self._predicted_closures) + 2)

    def opens_and_closes(self, x: np.ndarray) -> bool:
        """Return True if sticking points lifted off and moved along the tool while other gaps closed, on any ranks.

        The positions at which gaps close depend on the points that still stick. A long step gets these positions wrong.
        x: positions at its end, shape (n, c), length.
        """
        face, theta, history = self.face, self.face.law.theta, self.face.history
        if history is None or not face.contact.sticks or face.law.adhesive:
            return False
        near, area = face.law.nearest(x), face.rule.area > 0
        distance, back = near.distance, np.abs(np.einsum("ni,ni->n", near.tangent, x - history.position))
        opens = area & (history.distance > -theta) & (distance <= -theta) & (back > 0)      # not on the axis
        closes = area & (history.distance <= -theta - LIMITS.negligible_gap * face.thickness) & (distance > -theta)
        found = combined(self._comm, np.array([opens.any(), closes.any()], dtype=int), MPI.SUM)
        return bool(np.all(found > 0))

    def passes_through(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """Return True if the straight path of a point, relative to the tool, leads through it (`cuts_tool`)."""
        return self.cuts_tool(self.face.positions(old, old_control), self.face.positions(new, control))

    def cuts_tool(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Return True if a straight path from a to b, relative to the tool, shape (n, c), length, is too deep in it.

        The depth on the path may exceed the larger depth of its ends by `StepLimits.max_cut_ratio` times the tributary
        length. A point that slides over an edge may cut the edge off by this depth. The result holds for all ranks.
        """
        law, lengths = self.face.law, self.face.rule.lengths
        path_length, most = np.linalg.norm(b - a, axis=1), LIMITS.max_cut_ratio * lengths
        first, last = law.distance(a), law.distance(b)
        ends, between = np.maximum(np.maximum(first, last), 0.0), (first + last + path_length) / 2    # bound of depths
        far = np.flatnonzero((between > ends + most) & (lengths > 0))
        found = False
        if len(far):
            parts = int(min(np.ceil((path_length / most)[far].max() * 2), LIMITS.max_positions)) + 1
            places = a[far] + np.linspace(0, 1, parts)[:, None, None] * (b - a)[far]
            found = bool(np.any(law.part(far).distance(places).max(0) > (ends + most)[far]))
        return bool(combined(self._comm, found, MPI.LOR))

    def fraction_to_lost_bond(self, x: np.ndarray) -> float:
        """Return the fraction of a step to the first gap closure whose point is open again at its end; else 1.

        A point that cannot separate is bonded from the first accepted state after its closure on: the step should end
        there. x: positions at its end, shape (n, c), length.
        """
        if not self.face.law.adhesive:
            return 1.0
        opened = ~self.face.law.touching(x, self.face.history)
        return float(combined(self._comm, float(self._bonded_from[opened].min(initial=1.0)), MPI.MIN))

    def fraction_to_wrong_slip(self, x: np.ndarray, velocity: np.ndarray, length: float) -> float:
        """Return the fraction of a step to the first gap closure whose point then slips wrongly; 1 without such points.

        A sticking point slips wrongly if it moves along the tool by more than `StepLimits.max_slip_ratio` without
        friction. A point with Coulomb friction does so if it slides against its slip since the closure. Pressure and
        slip are assumed to grow linearly from there. x, velocity: positions and d/ds at the end of the step, shape (n,
        c), length.
        """
        face, law, history = self.face, self.face.law, self.face.history
        if history is None or not law.has_friction:
            return 1.0
        near = law.nearest(x)
        F, grows = law.ramp(near.distance)
        rate = np.maximum(grows * np.einsum("ni,ni->n", near.normal, velocity), 0.0)
        since = np.minimum(np.divide(F, rate, out=np.full(len(F), length), where=rate > 0), length)
        slid = since * np.einsum("ni,ni->n", near.tangent, velocity)
        if face.contact.sticks:
            wrong = np.isnan(history.closure[:, 0]) & (np.abs(slid) > LIMITS.max_slip_ratio * face.rule.lengths)
        else:
            counted = np.einsum("ni,ni->n", near.tangent, x - history.closure)
            wrong = (slid * counted < 0) & (np.minimum(np.abs(slid), np.abs(counted)) > law.elastic_slip)
        late = (history.distance <= -law.theta) & (F > 0) & wrong
        return float(combined(self._comm, 1 - float(since[late].max(initial=0.0)) / length, MPI.MIN))


class EventPrediction(Protocol):
    """Predicted contact events after an accepted state, and the predicted path with these events.

    The extension `formingx.extensions.contact_events` provides it. `StepLimit` calls `step_length` first, then
    `closures` and `bend` for the length that the step has in the end.
    """

    def step_length(self, length: float) -> float | None:
        """Return the arc length, at most `length`, limited by the number of gaps that close in it.

        None if the prediction failed; `closures` and `bend` then also return None.
        """

    def closures(self, length: float) -> list[tuple] | None:
        """Return the gap closures within an arc length, a tuple of arrays for the n owned points of each contact.

        Arc length, shape (n,); position there relative to the tool, shape (n, 2), length; mask of points with a
        predicted force, shape (n,); d(position)/ds just before, shape (n, 2). None if the prediction failed.
        """

    def bend(self, length: float) -> tuple[np.ndarray, float] | None:
        """Return the path minus the tangent at an arc length, x (n,) and control; None if zero or unknown."""


class EventPredictor(Protocol):
    """Predictor of the contact events of all contacts of a `StepLimit`.

    Attributes:
        active: True if contact events are predicted for the contacts that are active now.
    """

    active: bool

    def enter(self, contacts: list[Approach]) -> None:
        """Set the contacts that are active in the current stage, and `active`."""

    def predict(self, curve: Any, state: Any) -> EventPrediction | None:
        """Return the contact events after an accepted state; None if none can be predicted."""


class TrialStep(NamedTuple):
    """Straight trial step from an accepted state, such as a step along the tangent of the path.

    At the arc length s, 0 <= s <= length, the unknowns are x + s direction, and the control is control + s slope.

    Attributes:
        x: unknowns at the state, locally owned entries, shape (n,).
        control: load parameter (control) of the state, dimensionless.
        direction: derivative of x by arc length, shape (n,).
        slope: derivative of the control by arc length.
        length: arc length of the step, dimensionless.
        events: contact events predicted after the state, or None.
    """

    x: np.ndarray
    control: float
    direction: np.ndarray
    slope: float
    length: float
    events: EventPrediction | None = None


class StepLimit:
    """Limits the length of a step so that contacts do not change too much.

    The run calls `length` (largest admissible arc length), then `prepare` (before the solve), then `check` (accept the
    solved step or shorten it).

    Attributes:
        active_contacts: the `Approach` of each contact that is active in the current stage.
        corrections: corrections of a solved step by contacts that open and close points between steps only; None
            without them. The tool names their class (`formingx.extensions.space.lagged_corrections`).
        predictor: predictor of contact events, with which several gaps may close in one step. None: each step ends at
            the next gap closure.
    """

    def __init__(self, problem: Any):
        self._n, heat = problem.n_owned, problem.scene.heat
        self._all = [getattr(face.contact.tool, "approach", Approach)(
            face, heat is not None and heat.conducts(face.contact)) for face in problem.contacts]
        self.active_contacts: list[Approach] = []
        self.corrections: Any = None
        make = None if problem.scene.one_node_per_step else type(self).make_predictor
        self.predictor = make() if make else None

    make_predictor: ClassVar[Callable[[], EventPredictor] | None] = None
    """Function that makes the predictor of contact events; an extension sets it. Without it, a step
    ends where the gap of a sticking point closes."""

    def note_active(self) -> None:
        """Set `active_contacts` and `corrections` after a change of the stage."""
        self.active_contacts = [approach for approach in self._all if approach.face.active]
        lagged = [approach for approach in self.active_contacts if hasattr(approach.face.contact.tool, "corrections")]
        self.corrections = lagged[0].face.contact.tool.corrections(lagged, self._n) if lagged else None
        if self.predictor:
            self.predictor.enter(self.active_contacts)

    @property
    def only_sticks(self) -> bool:
        """True if active contact with friction all sticks, on profiles in a plane: no point begins to slide."""
        faces = [approach.face for approach in self.active_contacts if approach.face.law.has_friction]
        return bool(faces) and all([face.contact.sticks and not face.contact.lagged for face in faces])

    @property
    def predicts_events(self) -> bool:
        """True if contact events after an accepted state are predicted."""
        return self.predictor is not None and self.predictor.active

    def length(self, trial: TrialStep) -> float:
        """Return the largest admissible arc length, at most `trial.length`, of a step along a tangent.

        It ends where the gaps of `Approach.max_closures` points have closed (up to a twentieth of a face if the order
        is predicted), or at the first gap closure if at most one point is in contact.
        """
        found = trial.events.step_length(trial.length) if trial.events else None
        if found is not None:
            return found
        n = self._n
        return min([c.step_length(trial.x[:n], trial.control, trial.direction[:n], trial.slope, trial.length)
                    for c in self.active_contacts], default=trial.length)

    def prepare(self, trial: TrialStep, ends: bool = False) -> tuple[np.ndarray, float] | None:
        """Store the predicted positions of gap closures in all active contacts; return the deviation from the tangent.

        It is (change of x, shape (n,); of the control), or None if zero. ends: True if `check` may shorten the step to
        a gap closure; only then may a late sticking closure carry no friction in it.
        """
        n, found = self._n, trial.events.closures(trial.length) if trial.events else None
        for k, approach in enumerate(self.active_contacts):
            if not approach.prepares(ends):
                continue
            arc_lengths, places, *predicted = found[k] if found else approach.closures(
                trial.x[:n], trial.control, trial.direction[:n], trial.slope, trial.length)
            approach.prepare(arc_lengths, places, trial.length, ends, *predicted)
        return trial.events.bend(trial.length) if trial.events and found else None

    def check(self, old: Any, new: Any, length: float, ends: bool = False) -> StepRejection | None:
        """Return reason and admissible fraction of a step too long for contacts, or None; ends: see `rejection`."""
        found = [c.rejection(old, new, self._n, length, ends) for c in self.active_contacts]
        return min(filter(None, found), key=lambda rejection: rejection.fraction, default=None)

    @property
    def settling(self) -> int:
        """Number of Newton iterations of a step of any length that the step control does not count."""
        return max([c.settling for c in self.active_contacts], default=0)

    def passes_through(self, old: Any, new: Any) -> bool:
        """Return True if a contact point passes through its tool between two states (`Approach.cuts_tool`)."""
        n = self._n
        return any([c.passes_through(old.x[:n], old.control, new.x[:n], new.control) for c in self.active_contacts])
