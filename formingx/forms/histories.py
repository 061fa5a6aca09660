"""History variables of a problem: the arguments of the residual F besides x, control and time."""

from __future__ import annotations

from typing import Any

import numpy as np

from .history import ConstitutiveHistory, History, Start


class Histories:
    """Part of `Problem` that updates its history variables; see `formingx.solve.equations`.

    Attributes:
        forms: the `Formulation`.
        histories: history variables of the contacts, then of the materials, then of the temperature.
    """

    forms: Any
    histories: list[History]
    _predicted: tuple[Any, list[Any]] = None, []             # x, and the history variables of the forms at x

    @property
    def n_owned(self) -> int:
        """Number of field unknowns that this rank owns."""
        raise NotImplementedError

    @property
    def control(self) -> float:
        """Present control of the forms."""
        raise NotImplementedError

    def set_fields_and_control(self, x: np.ndarray, control: float) -> None:
        """Set the fields and the control of the forms.

        Args:
            x: unknowns, locally owned entries, shape (n,).
            control: load parameter (control), dimensionless.
        """
        raise NotImplementedError

    @property
    def has_history(self) -> bool:
        return bool(self.histories)

    @property
    def materials(self) -> list[ConstitutiveHistory]:
        """History variables of the materials, one entry for each material that has them."""
        return [history for history in self.forms.histories if isinstance(history, ConstitutiveHistory)]

    @property
    def body_has_history(self) -> bool:
        """True if materials or the temperature have history variables."""
        return bool(self.forms.histories)

    @property
    def relaxes(self) -> bool:
        """True if the residual depends on time, through rate-dependent materials, contact or heat."""
        return any(not isinstance(history, ConstitutiveHistory) or history.rate_dependent
                   for history in self.forms.histories)

    @property
    def time(self) -> float:
        """Process time at the present control of the forms."""
        return self.forms.time_at(self.control)

    @property
    def clock(self) -> float:
        """Process time at control 0, from the step data or from a run that chooses its time steps."""
        return self.forms.clock

    @clock.setter
    def clock(self, time: float) -> None:
        self.forms.clock = time

    def time_at(self, control: float) -> float:
        return self.forms.time_at(control)

    @property
    def memory(self) -> list[Any]:
        """History variables of the last accepted state, one entry for each history."""
        return [history.get() for history in self.histories]

    @memory.setter
    def memory(self, memory: list[Any]) -> None:
        self._predicted = None, []
        for history, remembered in zip(self.histories, memory, strict=True):
            history.put(remembered)

    def advance(self, x: np.ndarray, control: float) -> None:
        if self.forms.histories:
            self.set_fields_and_control(x, control)
        known = self._predicted[1] if self._predicted[0] is x else []
        for history in self.histories[: len(self.histories) - len(known)]:
            history.advance(x[: self.n_owned], control)
        for history, memory in zip(self.forms.histories, known):
            history.put(memory)
        self._predicted = None, []

    def predict(self, start: Start, x: np.ndarray, control: float) -> list[Any]:
        """Compute the history variables of materials and temperature at the end of a step, and store them.

        If `advance` then accepts the same x, it uses the stored values. Afterwards the history variables are those at
        the end of the step: the caller must restore the earlier ones.

        Args:
            start: state at the beginning of the step.
            x: unknowns at its end, locally owned entries, shape (n,).
            control: load parameter (control) at the end of the step, dimensionless.

        Returns:
            History variables of materials and temperature at the end of the step.
        """
        self.set_fields_and_control(x, control)
        for history in self.forms.histories:
            history.advance(x[: self.n_owned], control, start)
        after = [history.get() for history in self.forms.histories]
        self._predicted = x, after
        return after
