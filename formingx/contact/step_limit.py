"""Limits to the number of points that come into contact in one step.

If a whole region comes into contact in one step, the positions at which its points stick depend on the step length.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from .approach import Approach, StepRejection


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
        """Return the predicted path minus the tangent at an arc length: changes of x, shape (n,), and of the control.

        None if it is zero or unknown.
        """


class EventPredictor(Protocol):
    """Predictor of the contact events of all contacts of a `StepLimit`."""

    @property
    def active(self) -> bool:
        """True if contact events are predicted for the contacts that are active now."""

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

    Args:
        problem: the `Problem`.

    Attributes:
        several_closures: True if several gaps may close in one step, in the predicted order.
    """

    def __init__(self, problem: Any):
        self._n, heat = problem.n_owned, problem.scene.heat
        self._all = [getattr(face.contact.tool, "approach", Approach)(
            face, heat is not None and heat.conducts(face.contact)) for face in problem.contacts]
        self.several_closures = not problem.scene.one_node_per_step
        make = type(self).make_predictor
        self._predictor = make(self) if make else None

    make_predictor: ClassVar[Callable[[StepLimit], EventPredictor] | None] = None
    """Function that makes the predictor of contact events of a `StepLimit`; an extension sets it. Without it, a step
    ends where the gap of a sticking point closes."""

    @property
    def active_contacts(self) -> list[Approach]:
        """The `Approach` of each contact that is active in the current stage."""
        return [approach for approach in self._all if approach.face.active]

    @property
    def only_sticks(self) -> bool:
        """True if active contact with friction all sticks, on profiles in a plane: no point begins to slide."""
        faces = [approach.face for approach in self.active_contacts if approach.face.law.has_friction]
        return bool(faces) and all(face.contact.sticks and not face.contact.lagged for face in faces)

    @property
    def predicts_events(self) -> bool:
        """True if contact events after an accepted state are predicted."""
        return self._predictor is not None and self._predictor.active

    def end_at_closures(self) -> None:
        """End each further step at the next gap closure, without prediction of contact events."""
        self.several_closures = False

    def predict(self, curve: Any, state: Any) -> EventPrediction | None:
        """Return the predicted contact events after an accepted state; None if none are predicted."""
        return self._predictor.predict(curve, state) if self._predictor else None

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
        """Return reason and admissible fraction of a solved step that was too long for the contacts, or None.
        `ends`: see `Approach.rejection`."""
        found = [c.rejection(old, new, self._n, length, ends) for c in self.active_contacts]
        return min(filter(None, found), key=lambda rejection: rejection.fraction, default=None)

    @property
    def settling(self) -> int:
        """Number of Newton iterations of a step of any length that the step control does not count."""
        return max((c.settling for c in self.active_contacts), default=0)

    @property
    def corrections(self) -> Any | None:
        """Corrections of a solved step by contacts that open and close points between steps only; None without them.

        The tool of such a contact names their class (`formingx.extensions.space.lagged_corrections`).
        """
        found = [(c, c.face.contact.tool.corrections) for c in self.active_contacts
                 if hasattr(c.face.contact.tool, "corrections")]
        return found[0][1]([c for c, _ in found], self._n) if found else None

    def passes_through(self, old: Any, new: Any) -> bool:
        """Return True if a contact point passes through its tool between two states (`Approach.cuts_tool`)."""
        n = self._n
        return any([c.passes_through(old.x[:n], old.control, new.x[:n], new.control) for c in self.active_contacts])
