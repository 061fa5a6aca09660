"""Progress of a run towards its targets: a progress bar, and lines in the log."""

from __future__ import annotations

import logging
import sys
import time
from collections import Counter
from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from ..measures.targets import Amplitude, Target, is_met
from .arc_length import Curve
from .equations import Quantity
from .state import State

log = logging.getLogger("formingx")


class RunTargets:
    """Open targets of a run, and the progress of the run to its last target.

    Attributes:
        open: pairs (target, output quantity) of the targets that are still to be met.
        until: the last target, which ends the run, as `requested` does, if given.
        quantity: output quantity of the last target.
        is_control: True if the last target is a value of the control, or of an amplitude that depends on the control.
        values: values of this quantity in the states of the run so far, in the user's units.
        patience: number of states after which a run gives up, if they changed its progress (`gained`) by less than
            1e-3.
    """

    patience = 500

    def __init__(self, curve: Curve, targets: Sequence[tuple[Target, Quantity]], requested: Target | None = None):
        self._curve, self.open, self._best = curve, list(targets), 0.0
        self.until, self.quantity = self.open[-1]
        self.is_control = isinstance(self.quantity, Amplitude)
        self.values: list[float] = []
        self._ends = [target for target in (self.until, requested) if target is not None]

    def is_open(self) -> bool:
        """Return True until the last target, or the other target that ends the run (`requested`), is met."""
        return all([any([target is end for target, _ in self.open]) for end in self._ends])

    def gained(self, value: float | None = None) -> float:
        """Return (value - first value)/(target - first value), by default at the last state; 1 at the last target."""
        value = self.values[-1] if value is None else value
        return (value - self.values[0]) / ((self.until.value - self.values[0]) or 1.0)

    def add_known(self, state: State) -> None:
        """Append the value of the last target's quantity in a state that an interrupted run had reached."""
        self.values.append(self._curve.value(self.quantity, state.x, state.control))
        self._best = max(self._best, self.gained())

    def accept(self, state: State) -> None:
        """Append the value of the last target's quantity to `values`, and remove the targets met from `open`."""
        self.values.append(self._curve.value(self.quantity, state.x, state.control))
        self.open = [(t, b) for t, b in self.open if t is not state.target     # other targets may be met, too
                     and not is_met(t, b.size, self._curve.value(b, state.x, state.control))]

    def reached_target(self, state: State) -> Target | None:
        """Return the first open target that a state meets to round-off, or None."""
        return next((target for target, quantity in self.open
                     if is_met(target, quantity.size, self._curve.value(quantity, state.x, state.control))), None)

    def close_reached(self, start: State) -> None:
        """Take the targets that the first state of the run, `start`, meets already, out of `open`."""
        while (target := self.reached_target(start)) is not None:
            start.target = start.target or target
            self.open = [(t, b) for t, b in self.open if t is not target]

    def within_reach(self, old: State, length: float) -> tuple[Target | None, Quantity | None, float]:
        """Return (target, quantity, arc length) first met in a step, linearly, or (None, None, length)."""
        best: tuple[Target | None, Quantity | None, float] = (None, None, length)
        for target, quantity in self.open:
            left, rate = self._curve.target_residual(quantity, target.value, old)
            if left * rate < 0 and -left / rate < best[2]:
                best = (target, quantity, -left / rate)
        return best

    def directed_to_target(self, start: State, first: bool = False) -> State:
        """Direct the tangent of the first state of a run, in place, towards the last target, and return the state.

        In the unloaded state (`first`) it is kept for quantities such as stretch, which both directions reach.
        """
        if self.until.signed or not first:
            left, rate = self._curve.target_residual(self.quantity, self.until.value, start)
            if left * rate > 0:
                start.direction, start.slope = -start.direction, -start.slope
                start.orientation = -start.orientation
        return start

    def short_of_targets(self, old: State, change: float) -> float:
        """Return the change of the control in a snap-through, reduced so that no open target of it is passed."""
        for target, quantity in self.open:
            if isinstance(quantity, Amplitude) and quantity.is_controlled:
                then, now = (self._curve.value(quantity, old.x, c) - target.value
                             for c in (old.control + change, old.control))
                change *= now / (now - then) if now * then < 0 else 1.0
        return change

    # reasons for a run to give up, as text; "" if there is none

    def no_progress(self) -> str:
        """Return a reason to give up if the path leads away from the last target, or came no nearer to it, else "".

        The progress must have fallen below half of its largest value; below 0 for a target of the control. Or the last
        `patience` states changed it by less than 1e-3. A run goes on if their second half gained more than twice as
        much as their first half: its steps grow.
        """
        gained = self.gained()
        self._best = max(self._best, gained)
        kept = 0.0 if self.is_control else 0.5
        if self._best > 0.05 and gained < kept * self._best or gained < -0.05:
            return ("the path turned back, away from the target; a crease at a singular corner (a clamped rim on a fine"
                    " mesh) can cause that")
        if len(self.values) > self.patience:
            first, middle = (self.gained(self.values[-1 - k]) for k in (self.patience, self.patience // 2))
            if abs(gained - first) < 1e-3 and gained - middle <= 2 * abs(middle - first):
                return f"the last {self.patience} states came no nearer to the target"
        return ""

    def jumped_past(self) -> str:
        """Return a reason to give up if the last state, after a snap-through, lies beyond the last target, else ""."""
        if self.is_open():
            before, now = self.values[-2:]
            if (before - self.until.value) * (now - self.until.value) < 0:
                return f"the body snaps past the target, from {before:.6g} to {now:.6g}: no equilibrium lies between"
        return ""

    def pace(self, max_steps: int) -> str:
        """Return as text the progress of a run that used up its `max_steps`, and the number that it still needs."""
        target, (before, now) = self.until.value, self.values[-2:]
        if not (target - now) * (now - before) > 0:
            return f"max_steps = {max_steps} were used up, and the last step led away from the target"
        return (f"max_steps = {max_steps} were used up at {100 * self.gained():.3g} % of the way to the target, without"
                f" trouble: the last step gained {now - before:.4g} of the {target - now:.4g} that are left, so about"
                f" {int(np.ceil((target - now) / (now - before)))} more steps are needed at that pace")


class Progress:
    """Display of the progress of a run on rank 0: a bar after two seconds, in a terminal or notebook, and log lines.

    Log lines have the level WARNING, or INFO without a bar if not `shown`.

    Attributes:
        silence: processor time of this thread between two log lines, s.
    """

    silence = 30.0

    def __init__(self, comm: MPI.Intracomm, words: str, shown: bool):
        self._words, self._here = words, comm.rank == 0
        self._level = logging.WARNING if shown else logging.INFO          # INFO is hidden by default
        self._bar = None
        if shown and comm.rank == 0 and (sys.stderr.isatty() or "ipykernel" in sys.modules):     # no bar in a log file
            from tqdm import tqdm
            self._bar = tqdm(total=1.0, desc=words, delay=2, leave=False,
                             bar_format="{desc}: {percentage:3.0f}% |{bar}| {elapsed}{postfix}")
        self._gained, self._states, self._length = 0.0, 0, 0.0
        self._limits: Counter[str] = Counter()
        self._began = self._said = time.thread_time()
        self._gained_then = 0.0

    def show(self, gained: float, states: int, length: float) -> None:
        """Show a step: progress 0 to 1, number of states, next length (arc, or share of a `QuantityRun`)."""
        self._gained, self._states, self._length = gained, states, length
        if self._bar is not None:
            self._bar.n = min(max(gained, 0.0), 1.0)
            self._bar.set_postfix_str(f"state {states}", refresh=False)
            self._bar.update(0)
        self._log_progress()

    def limited(self, reason: str, length: float) -> None:
        """Show a shortened or failed step, with the reason as text and the length of the next attempt."""
        self._limits[reason] += 1
        self._length = length
        self._log_progress()

    def close(self) -> None:
        """Close the progress bar."""
        if self._bar is not None:
            self._bar.close()

    def _log_progress(self) -> None:
        """Log a line on the progress if the run took `silence` seconds of processor time since the last line."""
        now = time.thread_time()                            # the time of all threads takes the kernel up to 1 ms
        if not self._here or now - self._said < self.silence:
            return
        spent, won = now - self._said, self._gained - self._gained_then
        left = f"about {_duration_text((1 - self._gained) * spent / won)} left" if won > 0 else "no nearer to it since"
        common = self._limits.most_common(2)
        limits = ", ".join(f"{reason} ({n} times)" for reason, n in common) or "their own control only"
        if self._bar is not None:
            self._bar.clear()
        log.log(self._level, "%s: %.3g %% of the way in %d states and %s of processor time; since the last line steps"
                " of %.2g, limited by %s; %s", self._words, 100 * self._gained, self._states,
                _duration_text(now - self._began), self._length, limits, left)
        self._said, self._gained_then = now, self._gained
        self._limits.clear()


def _duration_text(seconds: float) -> str:
    """Return a duration, given in seconds, as text with two digits and a suitable unit."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"
