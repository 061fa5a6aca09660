"""Limits of a step, and corrections after its solution, for lagged contact with tools in three dimensions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from ...contact.face import FaceContact
from ...contact.step_limit import LIMITS, Approach, StepRejection
from ...findings import coordinates
from ...physics.contact_law import ContactHistory
from ...ranks import combined
from ...values.tolerances import NEGLIGIBLE
from .passed_tools import PassedPoint, PassedTool


@dataclass(frozen=True)
class LaggedLimits:
    """Limits of a step with lagged contact.

    Attributes:
        max_approach_ratio: largest motion of a point in a step of lagged contact, less its tributary length, over its
            gap.
        max_pressure_change: largest predicted change of the pressure in a step of lagged friction, over the pressure.
        max_pressure_difference: allowed difference between the pressure at the end of the step and the pressure that
            bounds friction, over the pressure.
        max_corrections: largest number of repeated solutions of a step that reduce this difference.
        max_target_difference: allowed difference between the contact pressure of a state at a target and the pressure
            with which it was solved, over the pressure. Walls of frictionless sheets then agree to 1e-6.
        rejection_ratio: multiple of `max_pressure_change`; a solved step with a larger change of the pressure is
            rejected.
        settling_iterations: number of Newton iterations that lagged friction needs in a step, however short the step
            is.
        max_solutions: largest number of solutions of a step. After each of them points separate or come into contact.
        min_force: normal force, over shear modulus times thickness times length, that is added to the denominator of
            relative changes of the pressure: lightly loaded contacts do not limit the step.
        max_passed_ratio: largest distance by which a point of the tool may have passed a triangle, over the longest
            edge of the triangle. A triangle that bridges a sharp edge cuts off up to 0.35 of its edge.
        max_bridged_ratio: the same where the sheet sticks and the corners of the triangle touch the tool or will, as
            over a narrow rib. A chord over a ridge of 40 degrees cuts off 1.4 of its length.
    """

    max_approach_ratio: float = 0.7
    max_pressure_change: float = 0.05
    max_pressure_difference: float = 5e-3
    max_corrections: int = 3
    max_target_difference: float = 1e-7
    rejection_ratio: float = 1.4
    settling_iterations: int = 2
    max_solutions: int = 30
    min_force: float = 1e-2
    max_passed_ratio: float = 0.4
    max_bridged_ratio: float = 1.5


LAGGED = LaggedLimits()

_SLOW = 0.7                # ratio of successive differences of the pressure, from which on corrections are halved
_SHORTENINGS = 50          # of a step until its predicted change of pressure is that of the limit


class LaggedApproach(Approach):
    """Lagged contact of one face during a step, see `formingx.contact.step_limit.Approach`.

    conducts: True if heat flows through points in contact, from the end of the step on.
    """

    def __init__(self, face: FaceContact, conducts: bool):
        super().__init__(face, conducts)
        self.pressure_difference = np.inf                   # relative, of the last correction of the present step
        self._last: tuple[np.ndarray, float, PassedPoint | None] | None = None        # result of `passed`, and where

    def _within_motion(self, start: np.ndarray, velocity: np.ndarray, free: np.ndarray, length: float) -> float:
        most = LAGGED.max_approach_ratio * np.maximum(-self.face.law.distance(start), 0.0) + self.face.rule.lengths
        speed = np.linalg.norm(velocity, axis=1)            # a tangent of a long step predicts no gap closures
        most = np.divide(most, speed, out=np.full(len(speed), length), where=free & (speed > 0))
        length = combined(self._comm, float(most.min(initial=length)), MPI.MIN)
        return self._within_pressure_change(start, velocity, length)

    def prepares(self, ends: bool) -> bool:
        return ends and self.has_lagged_friction

    def prepare(self, arc_lengths: np.ndarray, places: np.ndarray, length: float, ends: bool,
                guessed: np.ndarray | None = None, speeds: np.ndarray | None = None) -> None:
        """Store the predicted positions at which gaps close; lagged friction needs them for its pressure."""
        self.face.set_closures(places)

    def has_too_many_closures(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Return True if a new point is deeper than twice its tributary length; a, b: before and after, (n, 3)."""
        law, history = self.face.law, self.face.history
        deep = np.where(law.touching(a, history), 0.0, law.distance(b) - 2 * self.face.rule.lengths)
        return bool(combined(self._comm, float(deep.max(initial=0.0)), MPI.MAX) > 0)

    def opens_and_closes(self, x: np.ndarray) -> bool:
        return False                                        # points open and close between steps only

    def _jumps_over(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        """Return True if an open point that does not stick enters the tool in a step, up to its other side.

        A point that sticks is held where it entered. Another one would be pushed out where it is nearest to the
        surface, which must be the side on which it entered. old, new: owned unknowns, shape (n,).
        """
        face, law = self.face, self.face.law
        if face.contact.sticks or face.history is None:
            return False
        a, b = face.positions(old, old_control), face.positions(new, control)
        free = face.history.distance <= -law.theta
        rows = np.flatnonzero(law.enter(a, b, free, law.distance(b) > -law.theta))
        found = False
        if len(rows):
            sides = (law.tool.distances(x[rows]).normal for x in (a, b))
            found = bool((np.einsum("ni,ni->n", *sides) < 0).any())
        return bool(combined(self._comm, found, MPI.LOR))

    @cached_property
    def _passed_tool(self) -> PassedTool:
        """Test for parts of the tool on the wrong side of the sheet."""
        return PassedTool(self.face)

    def passed(self, fields: np.ndarray, control: float) -> PassedPoint | None:
        """Return the point of the tool that passed the sheet farthest, None below resolution; fields: owned, (n,)."""
        if self._last is None or self._last[1] != control or not np.array_equal(self._last[0], fields):
            found = self._passed_tool.deepest(fields, control, LAGGED.max_passed_ratio, self._bridged_limit)
            self._last = fields.copy(), control, found
        found = self._last[2]
        passes = found is not None and found.ratio > LAGGED.max_passed_ratio and found.bridged >= self._bridged_limit
        return found if passes else None

    @property
    def _bridged_limit(self) -> float:
        """Largest ratio of a point beyond a triangle whose corners touch the tool; 0 for a sheet that slides."""
        return LAGGED.max_bridged_ratio if self.face.contact.sticks else 0.0

    def passes_through(self, old: np.ndarray, old_control: float, new: np.ndarray, control: float) -> bool:
        return (super().passes_through(old, old_control, new, control) or self._jumps_over(
            old, old_control, new, control) or self.passed(new, control) is not None)

    def rejection(self, old: Any, new: Any, n: int, length: float, ends: bool) -> StepRejection | None:
        if self._jumps_over(old.x[:n], old.control, new.x[:n], new.control):
            return StepRejection("a point passes through a thin part of its tool")
        passed = self.passed(new.x[:n], new.control)
        if passed is not None:
            return StepRejection(f"the tool of {self.face.contact.label!r} passes through the sheet at (x, y, z) ="
                                 f" {coordinates(passed.place, 3)}, where a triangle is"
                                 f" {passed.depth:.2g} beyond it: smaller triangles are needed there")
        found = super().rejection(old, new, n, length, ends)
        if found is not None or not length > LIMITS.min_length:
            return found
        change = self.change_of_pressure(new.x[:n], new.control)
        if change > LAGGED.rejection_ratio * LAGGED.max_pressure_change:
            return StepRejection("the pressure that limits friction changes", LAGGED.max_pressure_change / change)
        return None

    @property
    def settling(self) -> int:                              # type: ignore[override]
        return LAGGED.settling_iterations if self.has_lagged_friction else 0

    def separate(self, fields: np.ndarray, control: float) -> bool:
        """Open the points in tension in the state of owned `fields` (n,); return True if there are any; collective."""
        face, variables = self.face, self.face.get()
        if variables is None or not face.contact.separates:
            return False
        history, x = variables.history, face.positions(fields, control)
        free = face.law.in_tension(x, history) & ~variables.newly_closed
        found = bool(combined(self._comm, int(free.sum()), MPI.SUM))
        if found:
            face.put(variables._replace(history=history._replace(
                position=np.where(free[:, None], x, history.position),
                distance=np.where(free, -2 * face.law.theta, history.distance))))
        return found

    def correct(self, fields: np.ndarray, control: float, at_target: bool, sweep: int) -> bool:
        """Close points that penetrated the tool in a step, and renew friction's pressure; True: solve again.

        Gaps close at a target or with lagged friction. sweep: number of earlier calls for this step.
        """
        if sweep == 0:
            self.pressure_difference = np.inf
        late = (at_target or self.has_lagged_friction) and self._close_penetrated(fields, control)
        return (sweep < LAGGED.max_corrections and self.update_pressure(fields, control)) | late

    def _close_penetrated(self, fields: np.ndarray, control: float) -> bool:
        """Close the gaps of open points that penetrate the tool more than is negligible; True if any; collective.

        Each such point sticks or slides from the position where its path in the step met the tool.
        """
        face, variables = self.face, self.face.get()
        if variables is None:
            return False
        old, x, theta = variables.history, face.positions(fields, control), face.law.theta
        late = face.law.distance(x) > LIMITS.negligible_gap * face.reference_length
        if face.law.sticks:                                 # also behind a thin part of the tool
            late = face.law.enter(old.position, x, old.distance <= -theta, late)
        late &= old.distance <= -theta
        found = bool(combined(self._comm, int(late.sum()), MPI.SUM))
        if found:
            new = face.law.tractions(x, old).history
            face.put(variables._replace(history=ContactHistory(*(
                np.where(late if a.ndim == 1 else late[:, None], b, a) for a, b in zip(old, new)))))
        return found

    @property
    def has_lagged_friction(self) -> bool:
        """True if friction is lagged: the pressure of the last accepted state bounds the friction in the step."""
        mu = np.max(self.face.law.mu, initial=0.0)
        return bool(combined(self._comm, bool(0 < mu < np.inf), MPI.LOR))

    def change_of_pressure(self, new: np.ndarray, control: float) -> float:
        """Return the relative change of contact pressure in a step; 0 without lagged friction; new: shape (n,)."""
        return self._pressure_difference(self.face.tractions(new, control).normal) if self.has_lagged_friction else 0.0

    def update_pressure(self, new: np.ndarray, control: float) -> bool:
        """Replace the pressure that bounds lagged friction by that at the end of the step; new: shape (n,).

        False if both agree to `LaggedLimits.max_pressure_difference`, or friction is not lagged.
        """
        if not self.has_lagged_friction:
            return False
        face, law = self.face, self.face.law
        now, before = face.tractions(new, control).normal, law.friction_pressure(face.history)
        difference = self._pressure_difference(now, before)
        if difference <= LAGGED.max_pressure_difference:
            return False
        share = self._share(difference)
        face.set_closures(law.closure_at_pressure(face.history, share * now + (1 - share) * before))
        return True

    def _share(self, difference: float) -> float:
        """Return the share of the latest pressure in the next one, and store the difference between both.

        It is 1/2 where the correction before has hardly reduced the difference: with much friction the pressure would
        alternate.
        """
        share = 1.0 if difference < _SLOW * self.pressure_difference else 0.5
        self.pressure_difference = difference
        return share

    def renew_pressure(self, new: np.ndarray, control: float) -> bool:
        """Replace the stored contact pressure by that of a state at a target, owned unknowns, shape (n,).

        It bounds friction in a step, and turns a fluid pressure into the normals of a tool on which the sheet slides.
        False if both agree to `LaggedLimits.max_target_difference` in the area-weighted 1-norm, or if none is
        stored.
        """
        face, law, variables = self.face, self.face.law, self.face.get()
        if variables is None or face.contact.sticks:
            return False
        old, depth = variables.history, np.maximum(law.distance(face.positions(new, control)), 0.0)
        history = old._replace(distance=np.where(law.in_contact(old), depth, old.distance), closure=old.position)
        now, before = law.pressure(history), law.friction_pressure(old)
        sums = np.array([face.rule.area @ np.abs(now - before), face.rule.area @ now])
        change, pressure = combined(self._comm, sums, MPI.SUM)
        difference = float(change / (pressure + LAGGED.min_force * face.force_scale))
        if difference <= LAGGED.max_target_difference:
            return False
        share = self._share(difference)
        face.put(variables._replace(history=history._replace(distance=np.where(
            law.in_contact(old), share * depth + (1 - share) * before / law.k, old.distance))))
        return True

    def _within_pressure_change(self, start: np.ndarray, velocity: np.ndarray, length: float) -> float:
        """Return the arc length, at most `length`, in which the pressure changes by `LaggedLimits.max_pressure_change`.

        start, velocity: positions relative to the tool and d/ds, shape (n, c), length. The pressure is extrapolated
        linearly, down to 0, so its change grows less than in proportion. Without lagged friction: `length`.
        """
        if not self.has_lagged_friction:
            return length
        law, history = self.face.law, self.face.history
        rate = law.k * np.einsum("ni,ni->n", law.motion(start, history).normal, velocity)
        for _ in range(_SHORTENINGS):
            change = self._pressure_difference(law.pressure(history) + length * rate)
            if change <= (1 + NEGLIGIBLE) * LAGGED.max_pressure_change:
                break
            length *= LAGGED.max_pressure_change / change
        return length

    def _pressure_difference(self, normal: np.ndarray, other: np.ndarray | None = None) -> float:
        """Return the relative difference of two pressures, shape (n,), stress, in the area-weighted 1-norm.

        other: None for that of the last accepted state, whose points under pressure count. The sum is divided by their
        force plus a small one (`LaggedLimits.min_force`).
        """
        face, before = self.face, self.face.law.pressure(self.face.history)
        difference = np.abs(np.maximum(normal, 0.0) - (before if other is None else other))
        sums = np.array([face.rule.area @ np.where(before > 0, difference, 0.0), face.rule.area @ before])
        change, pressure = combined(self._comm, sums, MPI.SUM)
        return float(change / (pressure + LAGGED.min_force * face.force_scale))
