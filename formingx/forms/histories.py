"""Histories of a problem, and the time: the arguments of F besides x and control."""

from __future__ import annotations

from typing import Any

import numpy as np

from .history import ConstitutiveHistory, History, Start


class Histories:
    """Histories of a problem: contact first, then materials, then heat."""

    forms: Any
    histories: list[History]
    _foretold: tuple[Any, list[Any]] = None, []             # x, and the history variables of the forms there

    @property
    def n_owned(self) -> int:
        """Number of fields' unknowns that this rank owns."""
        raise NotImplementedError

    @property
    def control(self) -> float:
        """The present control of the forms."""
        raise NotImplementedError

    def look_at(self, x: np.ndarray, control: float) -> None:
        """Set the fields of the forms to x, locally owned entries, and their control."""
        raise NotImplementedError

    @property
    def has_history(self) -> bool:
        """True if F depends on more than x and control."""
        return bool(self.histories)

    @property
    def materials(self) -> list[ConstitutiveHistory]:
        """The histories of materials."""
        return [history for history in self.forms.histories if isinstance(history, ConstitutiveHistory)]

    @property
    def body_has_history(self) -> bool:
        """True if materials or the temperature have a history."""
        return bool(self.forms.histories)

    @property
    def relaxes(self) -> bool:
        """True if F depends on time: on histories of rate-dependent materials, contact or heat."""
        return any(not isinstance(history, ConstitutiveHistory) or history.rate_dependent
                   for history in self.forms.histories)

    @property
    def time(self) -> float:
        """Process time at the present control of the forms."""
        return self.forms.time_at(self.control)

    @property
    def clock(self) -> float:
        """Process time at control 0: from the setting, or set by a run that chooses its time steps."""
        return self.forms.clock

    @clock.setter
    def clock(self, time: float) -> None:
        self.forms.clock = time

    def time_at(self, control: float) -> float:
        """Return the process time at a control in the present setting."""
        return self.forms.time_at(control)

    @property
    def memory(self) -> list[Any]:
        """History variables of the last accepted state."""
        return [history.get() for history in self.histories]

    @memory.setter
    def memory(self, memory: list[Any]) -> None:
        self._foretold = None, []
        for history, remembered in zip(self.histories, memory, strict=True):
            history.put(remembered)

    def advance(self, x: np.ndarray, control: float) -> None:
        """Update the history variables for an accepted state. x: locally owned entries, shape (n,)."""
        if self.forms.histories:
            self.look_at(x, control)
        known = self._foretold[1] if self._foretold[0] is x else []
        for history in self.histories[: len(self.histories) - len(known)]:
            history.advance(x[: self.n_owned], control)
        for history, memory in zip(self.forms.histories, known):
            history.put(memory)
        self._foretold = None, []

    def foretell(self, start: Start, x: np.ndarray, control: float) -> list[Any]:
        """Advance the histories of the forms to a state; return their history variables there, for `advance`.

        The histories are left in the new state: the caller restores the old one. start: the state that the step begins
        at; x: locally owned entries.
        """
        self.look_at(x, control)
        for history in self.forms.histories:
            history.advance(x[: self.n_owned], control, start)
        after = [history.get() for history in self.forms.histories]
        self._foretold = x, after
        return after
