"""Contact of one face during a step: prediction of gap closures, and checks for steps that are too long.

A gap is closed where the signed distance of a point from its tool exceeds -theta, the outer edge of the ramp of the
contact law. Contact with tools in three dimensions is lagged: the closed points, and the pressure that limits their
friction, belong to the last accepted state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..ranks import combined, gathered
from .face import FaceContact
from .gap_closures import gap_closures


@dataclass(frozen=True)
class StepLimits:
    """Limits that contact sets to a step.

    Contact with tools in three dimensions is lagged: the closed points, and the pressure that bounds their friction,
    belong to the last accepted state.

    Attributes:
        start_fraction: fraction of a step; gaps that close earlier in the step count as closed at its start.
        overshoot: length of a step that ends at a gap closure, over the arc length to the closure.
        negligible_gap: distance from the outer edge of the ramp, over the thickness of the sheet, that is negligible.
        friction_fraction: fraction of a step. If the gap of a sticking point closes in the rest of the step, friction
            acts on the point from the next step on only.
        max_slip_ratio: largest slip of a sticking point after its gap closure in a step, over its tributary length.
        max_approach_ratio: largest motion of a point in a step of lagged contact, less its tributary length, over its
            gap.
        max_cut_ratio: largest depth of the straight path of a point inside a tool, over its tributary length.
        max_positions: largest number of positions at which this path is checked.
        max_pressure_change: largest predicted change of the pressure in a step of lagged friction, over the pressure.
        max_pressure_difference: allowed difference between the pressure at the end of the step and the pressure that
            bounds friction, over the pressure.
        max_corrections: largest number of repeated solutions of a step that reduce this difference.
        max_target_difference: allowed difference between the contact pressure of a state at a target and the pressure
            with which it was solved, over the pressure.
        rejection_ratio: multiple of `max_pressure_change`; a solved step with a larger change of the pressure is
            rejected.
        settling_iterations: number of Newton iterations that lagged friction needs in a step, however short the step
            is.
        min_force: normal force, over shear modulus times thickness times length, that is added to the denominator of
            relative changes of the pressure: lightly loaded contacts do not limit the step.
        min_length: arc length (dimensionless) below which a step is rejected neither for a change of the pressure nor
            for the slip of a point after its gap closure.
        min_mixed_length: arc length (dimensionless) below which sticking points may lift off while the gaps of others
            close.
    """

    start_fraction: float = 0.02
    overshoot: float = 1.001
    negligible_gap: float = 1e-3
    friction_fraction: float = 0.95
    max_slip_ratio: float = 2e-3
    max_approach_ratio: float = 0.7
    max_cut_ratio: float = 0.5
    max_positions: int = 4000
    max_pressure_change: float = 0.2
    max_pressure_difference: float = 5e-3
    max_corrections: int = 3
    max_target_difference: float = 1e-4
    rejection_ratio: float = 1.4
    settling_iterations: int = 2
    min_force: float = 1e-2
    min_length: float = 1e-4
    min_mixed_length: float = 5e-4


LIMITS = StepLimits()


class Approach:
    """Contact of one face during a step: prediction of gap closures before the solve, checks after it.

    `StepLimit` calls `step_length`, `closures` and `prepare` before the solve of a step, the other methods after it.

    Args:
        face: the contact.
        conducts: True if heat flows through points in contact, from the end of the step on.

    Attributes:
        points: number of points of the face on all ranks.
        max_closures: number of points that may come into contact in one step along the tangent. It is ten times larger
            if the result does not depend on the order of the gap closures.
    """

    def __init__(self, face: FaceContact, conducts: bool):
        self.face, self._comm, given = face, face.comm, face.contact.nodes_per_step
        self.points = combined(face.comm, len(face.rule.points))
        share = max(self.points // 100, 1) if face.contact.lagged else 1
        self.max_closures = (given or 1) * share * (1 if face.law.has_history or conducts else 10)
        self._predicted_closures = 0                        # number in the step, on all ranks
        self._bonded_from: np.ndarray = np.ones(len(face.rule.points))      # fraction of the step; 1: not in the step

    def touches(self, fields: np.ndarray, control: float) -> bool:
        """Return True if any point of the face is in contact with the tool.

        Args:
            fields: locally owned unknowns of the state, shape (n,).
            control: load parameter (control) of the state, dimensionless.

        Returns:
            True if a point on any rank is in contact.
        """
        return bool(combined(self._comm, bool(self.face.touching(fields, control).any()), MPI.LOR))

    def step_length(self, fields: np.ndarray, control: float, direction: np.ndarray, slope: float,
                    length: float) -> float:
        """Return the admissible arc length of a step along a tangent.

        The step ends where `max_closures` new points have come into contact. If at most one point was in contact
        before, it ends at the first gap closure. If a whole region came into contact in one step, its sticking
        positions would depend on the step length. In lagged contact the motion of the points and the change of the
        pressure are limited too.

        Args:
            fields: locally owned unknowns of the state, shape (n,).
            control: load parameter (control) of the state, dimensionless.
            direction: derivative of the unknowns by arc length, shape (n,).
            slope: derivative of the control by arc length.
            length: largest arc length.

        Returns:
            Arc length, at most `length`.
        """
        face = self.face
        start, velocity = face.positions(fields, control), face.relative_motion(direction, slope)
        free = ~face.law.touching(start, face.history)
        if face.contact.lagged:                             # a tangent of a long step predicts no gap closures
            most = LIMITS.max_approach_ratio * np.maximum(-face.law.distance(start), 0.0) + face.rule.lengths
            speed = np.linalg.norm(velocity, axis=1)
            most = np.divide(most, speed, out=np.full(len(speed), length), where=free & (speed > 0))
            length = combined(self._comm, float(most.min(initial=length)), MPI.MIN)
            length = self._within_pressure_change(start, velocity, length)
        arc_lengths = gap_closures(face.law, start, velocity, free, length)
        ahead = (arc_lengths > LIMITS.start_fraction * length) & (arc_lengths < length)
        arc_lengths = np.sort(gathered(self._comm, arc_lengths[ahead]))
        touching = combined(self._comm, int(np.sum(~free & (face.rule.area > 0))), MPI.SUM)
        allowed = self.max_closures if touching > 1 else 1
        return min(LIMITS.overshoot * arc_lengths[allowed - 1], length) if len(arc_lengths) >= allowed else length

    def closures(self, fields: np.ndarray, control: float, direction: np.ndarray, slope: float,
                 length: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the gap closures of the points if they move along a tangent.

        Args:
            fields: locally owned unknowns of the state, shape (n,).
            control: load parameter (control) of the state, dimensionless.
            direction: derivative of the unknowns by arc length, shape (n,).
            slope: derivative of the control by arc length.
            length: arc length of the step.

        Returns:
            For each locally owned point, the arc length at which its gap closes, shape (n,); `length` for points that
            are closed or stay open. Their positions at this arc length, relative to the tool, shape (n, c), length.
        """
        face = self.face
        start, velocity = face.positions(fields, control), face.relative_motion(direction, slope)
        free = ~face.law.touching(start, face.history) & (face.rule.area > 0)
        arc_lengths = gap_closures(face.law, start, velocity, free, length)
        return arc_lengths, start + arc_lengths[:, None] * velocity

    def prepare(self, arc_lengths: np.ndarray, places: np.ndarray, length: float, ends: bool,
                guessed: np.ndarray | None = None, speeds: np.ndarray | None = None) -> None:
        """Prepare the solve of a step: store the predicted positions at which gaps close.

        Args:
            arc_lengths: arc lengths at which gaps close, shape (n,); `length` for gaps that stay open.
            places: positions of the points at these arc lengths, relative to the tool, shape (n, c), length.
            length: arc length of the step (dimensionless).
            ends: True if `StepLimit.check` may shorten the step to one of its gap closures. A sticking point whose gap
                closes near the end of the step (`StepLimits.friction_fraction`) then carries friction in the next step
                only. It carries friction at once if its predicted slip is too large (`StepLimits.max_slip_ratio`).
            guessed: mask of the points whose contact forces are predicted too, shape (n,); None: no points.
            speeds: derivatives of the positions by arc length just before the predicted closures, shape (n, c), length;
                None: unknown.
        """
        face = self.face
        self._predicted_closures = combined(self._comm, int(np.sum(arc_lengths < length)), MPI.SUM)
        if face.law.adhesive:
            self._bonded_from = np.where(False if guessed is None else guessed, arc_lengths / length, 1.0)
        if not face.contact.lagged:                         # lagged friction needs positions for its pressure only
            at_end = ends & face.contact.sticks & (arc_lengths >= LIMITS.friction_fraction * length)
            if speeds is not None and at_end.any():
                tangent = face.law.part(np.flatnonzero(at_end)).nearest(places[at_end]).tangent
                slip = np.abs(np.einsum("ni,ni->n", speeds[at_end], tangent)) * (length - arc_lengths[at_end])
                at_end[at_end] = slip <= LIMITS.max_slip_ratio * face.rule.lengths[at_end]
            face.set_closures(np.where(at_end[:, None], np.nan, places), guessed)
        elif ends and self.has_lagged_friction:
            face.set_closures(places)

    def has_too_many_closures(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """Return True if too many points came into contact in a step.

        The limit is 2 plus twice the larger of `max_closures`, allowed in a step, and the number of predicted gap
        closures. In lagged contact, whose friction uses the last pressure, depth counts: a new point must not be
        deeper in the tool than twice its tributary length. Contacts without history variables have no limit.

        Args:
            old: locally owned unknowns at the start of the step, shape (n,).
            old_control: control at the start of the step.
            new: locally owned unknowns at its end, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.

        Returns:
            True if the step is too long.
        """
        face, theta = self.face, self.face.law.theta
        if face.history is None:
            return False
        a, b = (face.law.distance(face.positions(f, c)) for f, c in ((old, old_control), (new, control)))
        if face.contact.lagged:
            deep = np.where(face.law.touching(a, face.history), 0.0, b - 2 * face.rule.lengths)
            return bool(combined(self._comm, float(deep.max(initial=0.0)), MPI.MAX) > 0)
        found = int(np.sum((a <= -theta - LIMITS.negligible_gap * face.thickness) & (b > -theta)))
        return bool(combined(self._comm, found, MPI.SUM) > 2 * max(self.max_closures, self._predicted_closures) + 2)

    @property
    def has_lagged_friction(self) -> bool:
        """True if friction is lagged: the pressure of the last accepted state bounds the friction in the step."""
        return bool(self.face.contact.lagged and 0 < self.face.law.mu < np.inf)

    def change_of_pressure(self, new: np.ndarray, control: float) -> float:
        """Return the relative change of the contact pressure in a step with lagged friction.

        Args:
            new: locally owned unknowns at the end of the step, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.

        Returns:
            Change of the pressure since the last accepted state over the pressure there; 0 without lagged friction.
        """
        return self._pressure_difference(self.face.tractions(new, control).normal) if self.has_lagged_friction else 0.0

    def update_pressure(self, new: np.ndarray, control: float) -> bool:
        """Replace the pressure that bounds lagged friction by the pressure at the end of the step.

        Args:
            new: locally owned unknowns at the end of the step, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.

        Returns:
            True if the pressure was updated. False if both pressures agree to `StepLimits.max_pressure_difference`, or
            friction is not lagged.
        """
        if not self.has_lagged_friction:
            return False
        face, law = self.face, self.face.law
        now = face.tractions(new, control).normal
        if self._pressure_difference(now, law.friction_pressure(face.history)) <= LIMITS.max_pressure_difference:
            return False
        face.set_closures(law.closure_at_pressure(face.history, now))
        return True

    def renew_pressure(self, new: np.ndarray, control: float) -> bool:
        """Replace the contact pressure stored at the last accepted state by the pressure of a state at a target.

        On tools in three dimensions the stored pressure bounds the friction of a step. Where a sheet slides, the
        tangential part of a fluid pressure also decreases with the stored pressure.

        Args:
            new: locally owned unknowns of the state, which meets a target of the run, shape (n,).
            control: load parameter (control) of the state, dimensionless.

        Returns:
            True if the pressure was replaced. False if both agree to `StepLimits.max_target_difference` in the
            area-weighted 1-norm, or if no pressure is stored for friction.
        """
        face, law, variables = self.face, self.face.law, self.face.get()
        if variables is None or not face.contact.lagged or face.contact.sticks:
            return False
        old, depth = variables.history, np.maximum(law.distance(face.positions(new, control)), 0.0)
        history = old._replace(distance=np.where(law.in_contact(old), depth, old.distance), closure=old.position)
        now = law.pressure(history)
        sums = np.array([face.rule.area @ np.abs(now - law.friction_pressure(old)), face.rule.area @ now])
        change, pressure = combined(self._comm, sums, MPI.SUM)
        if change <= LIMITS.max_target_difference * (pressure + LIMITS.min_force * face.force_scale):
            return False
        face.put(variables._replace(history=history))
        return True

    def _within_pressure_change(self, start: np.ndarray, velocity: np.ndarray, length: float) -> float:
        """Return the arc length after which the contact pressure has changed by a given fraction.

        The fraction is `StepLimits.max_pressure_change`. The pressure is extrapolated linearly from the last accepted
        state. Lagged friction is bounded by the pressure at that state.

        Args:
            start: positions of the points relative to the tool, shape (n, c), length.
            velocity: their derivatives by arc length, shape (n, c), length.
            length: largest arc length.

        Returns:
            Arc length, at most `length`; `length` without lagged friction.
        """
        if not self.has_lagged_friction:
            return length
        law, history = self.face.law, self.face.history
        rate = law.k * np.einsum("ni,ni->n", law.motion(start, history).normal, velocity)
        change = self._pressure_difference(law.pressure(history) + length * rate)
        return length * min(LIMITS.max_pressure_change / change, 1.0) if change else length

    def _pressure_difference(self, normal: np.ndarray, other: np.ndarray | None = None) -> float:
        """Return the relative difference between two pressure fields in the area-weighted 1-norm.

        The difference is summed over the points that were under pressure at the last accepted state. It is divided by
        the total normal force at that state plus a small force (`StepLimits.min_force`).

        Args:
            normal: normal tractions, shape (n,), stress; tension counts as 0.
            other: pressure to compare with, shape (n,), stress; None: the pressure at the last accepted state.

        Returns:
            Relative difference over all ranks.
        """
        face, before = self.face, self.face.law.pressure(self.face.history)
        difference = np.abs(np.maximum(normal, 0.0) - (before if other is None else other))
        sums = np.array([face.rule.area @ np.where(before > 0, difference, 0.0), face.rule.area @ before])
        change, pressure = combined(self._comm, sums, MPI.SUM)
        return float(change / (pressure + LIMITS.min_force * face.force_scale))

    def opens_and_closes(self, new: np.ndarray, control: float) -> bool:
        """Return True if sticking points lifted off and moved back along the tool while other gaps closed.

        The positions at which gaps close depend on the points that still stick. A long step gets these positions wrong.

        Args:
            new: locally owned unknowns at the end of the step, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.

        Returns:
            True if both happened in the step, on any ranks.
        """
        face, theta, history = self.face, self.face.law.theta, self.face.history
        if history is None or not face.contact.sticks or face.law.adhesive or face.contact.lagged:
            return False
        x, area = face.positions(new, control), face.rule.area > 0
        near = face.law.nearest(x)
        distance, back = near.distance, np.abs(np.einsum("ni,ni->n", near.tangent, x - history.position))
        opens = area & (history.distance > -theta) & (distance <= -theta) & (back > 0)      # not on the axis
        closes = area & (history.distance <= -theta - LIMITS.negligible_gap * face.thickness) & (distance > -theta)
        found = combined(self._comm, np.array([opens.any(), closes.any()], dtype=int), MPI.SUM)
        return bool(np.all(found > 0))

    def passes_through(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """Return True if the straight path of a point in a step, relative to the tool, leads through the tool.

        Args:
            old: locally owned unknowns at the start of the step, shape (n,).
            old_control: control at the start of the step.
            new: locally owned unknowns at its end, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.

        Returns:
            True if the depth on a path exceeds the larger depth of its ends by more than `StepLimits.max_cut_ratio`
            times the tributary length of the point.
        """
        return self.cuts_tool(self.face.positions(old, old_control), self.face.positions(new, control))

    def cuts_tool(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Return True if the straight path of a point between two positions penetrates the tool too deeply.

        The depth on the path may exceed the larger depth of its ends by `StepLimits.max_cut_ratio` times the tributary
        length. A point that slides over an edge of the tool may cut the edge off by this depth.

        Args:
            a: positions of the points at the start, relative to the tool, shape (n, c), length.
            b: positions at the end, shape (n, c), length.

        Returns:
            True if a path on any rank is too deep.
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

    def fraction_to_lost_bond(self, new: np.ndarray, control: float) -> float:
        """Return the fraction of a step after which the first gap closes whose point is open again at its end.

        A point that cannot separate is bonded from the first accepted state after its gap closure on. A tension in the
        step of the closure opens it. The step should therefore end at the closure.

        Args:
            new: locally owned unknowns at the end of the step, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.

        Returns:
            Fraction of the arc length up to the first such gap closure; 1 without such points.
        """
        if not self.face.law.adhesive:
            return 1.0
        opened = ~self.face.touching(new, control)
        return float(combined(self._comm, float(self._bonded_from[opened].min(initial=1.0)), MPI.MIN))

    def fraction_to_wrong_slip(self, new: np.ndarray, control: float, direction: np.ndarray, slope: float,
                               length: float) -> float:
        """Return the fraction of a step at which the first gap closes whose point then slips wrongly.

        A sticking point slips wrongly if it carries no friction in the step, but moves along the tool after its gap
        closure. `StepLimits.max_slip_ratio` limits this motion. A point with Coulomb friction slips wrongly if it
        slides, at the end of the step, against its slip since the gap closure. Pressure and slip are assumed to grow
        linearly from the gap closure, with their rates along (direction, slope).

        Args:
            new: locally owned unknowns at the end of the step, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.
            direction: derivative of the unknowns by arc length at the end, shape (n,).
            slope: derivative of the control by arc length at the end.
            length: arc length of the step.

        Returns:
            Fraction of the arc length up to the first such gap closure; 1 without such points.
        """
        face, law, history = self.face, self.face.law, self.face.history
        if history is None or not law.has_friction:
            return 1.0
        end, velocity = face.positions(new, control), face.relative_motion(direction, slope)
        near = law.nearest(end)
        F, grows = law.ramp(near.distance)
        rate = np.maximum(grows * np.einsum("ni,ni->n", near.normal, velocity), 0.0)
        since = np.minimum(np.divide(F, rate, out=np.full(len(F), length), where=rate > 0), length)
        slid = since * np.einsum("ni,ni->n", near.tangent, velocity)
        if face.contact.sticks:
            wrong = np.isnan(history.closure[:, 0]) & (np.abs(slid) > LIMITS.max_slip_ratio * face.rule.lengths)
        else:
            counted = np.einsum("ni,ni->n", near.tangent, end - history.closure)
            wrong = (slid * counted < 0) & (np.minimum(np.abs(slid), np.abs(counted)) > law.elastic_slip)
        late = (history.distance <= -law.theta) & (F > 0) & wrong
        return float(combined(self._comm, 1 - float(since[late].max(initial=0.0)) / length, MPI.MIN))
