"""History variables of a problem: the arguments of the residual F besides x, control and time."""

from __future__ import annotations

from typing import Any

import numpy as np

from .history import ConstitutiveHistory, History, Start


class Histories:
    """Base class of `Problem` that stores and updates the history variables of materials, contacts and temperature.

    `formingx.solve.equations` describes the members that the solver calls.

    Attributes:
        forms: the `Formulation`.
        histories: list of `History`: contacts first, then materials, then the temperature.
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
        """Current value of the load parameter (control) in the forms, dimensionless."""
        raise NotImplementedError

    def set_fields_and_control(self, x: np.ndarray, control: float) -> None:
        """Set the fields and the load parameter (control) of the forms.

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
        """History of each material with internal variables or past states (`ConstitutiveHistory`)."""
        return [history for history in self.forms.histories if isinstance(history, ConstitutiveHistory)]

    @property
    def body_has_history(self) -> bool:
        """True if materials or the temperature have history variables."""
        return bool(self.forms.histories)

    @property
    def relaxes(self) -> bool:
        """True if the body is rate-dependent, through a material or through its temperature."""
        return any(not isinstance(history, ConstitutiveHistory) or history.rate_dependent
                   for history in self.forms.histories)

    @property
    def time(self) -> float:
        """Process time at the current load parameter (control)."""
        return self.forms.time_at(self.control)

    @property
    def clock(self) -> float:
        """Process time at control 0; a run that chooses its own time steps sets it before each step."""
        return self.forms.clock

    @clock.setter
    def clock(self, time: float) -> None:
        self.forms.clock = time

    def time_at(self, control: float) -> float:
        return self.forms.time_at(control)

    @property
    def history_variables(self) -> list[Any]:
        """History variables of the last accepted state: the result of `History.get` for each of `histories`."""
        return [history.get() for history in self.histories]

    @history_variables.setter
    def history_variables(self, variables: list[Any]) -> None:
        self._predicted = None, []
        for history, stored in zip(self.histories, variables, strict=True):
            history.put(stored)

    def advance(self, x: np.ndarray, control: float) -> None:
        if self.forms.histories:
            self.set_fields_and_control(x, control)
        known = self._predicted[1] if self._predicted[0] is x else []
        for history in self.histories[: len(self.histories) - len(known)]:
            history.advance(x[: self.n_owned], control)
        for history, variables in zip(self.forms.histories, known):
            history.put(variables)
        self._predicted = None, []

    def predict(self, start: Start, x: np.ndarray, control: float) -> list[Any]:
        """Update the history variables of materials and temperature to the end of a step that is not yet accepted.

        The result is stored, and `advance` uses it if it accepts the same x. The caller must restore the earlier
        history variables.

        Args:
            start: state at the beginning of the step.
            x: unknowns at the end of the step, locally owned entries, shape (n,).
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
