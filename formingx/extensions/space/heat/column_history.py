"""History of the temperatures of a sheet in three dimensions: a column at each node, see `CoolingHistory`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....findings import Finding
from ....values.temperature import ABSOLUTE_ZERO
from ...heat.cooling_history import CoolingHistory
from ...heat.run import checked_boundaries
from .columns import ColumnConduction


class ColumnHistory(CoolingHistory):
    """History variables of the temperature of a sheet in three dimensions.

    `HeatState.temperature` has those at m points through the thickness of n locally owned nodes, shape (n, m).
    """

    def _conduction(self, degree: int = 2) -> ColumnConduction:
        scene, zero = self._problem.scene, ABSOLUTE_ZERO[self._cooling.unit]
        laws = [*self._cooling.boundaries, *self._cooling.contacts_with_tools(scene)]
        return ColumnConduction(self._field.sheet, self._field.basis, checked_boundaries(scene.mesh, laws, zero),
                                self._field.first[: len(self._field.sheet.points)], zero)

    def _initial_temperatures(self) -> np.ndarray:
        return self._body.start()[0]

    def _set_field(self, T: np.ndarray, before: np.ndarray | None) -> None:
        self._field.now = self._field.sheet.with_ghosts(T)
        self._field.before = None if before is None else self._field.sheet.with_ghosts(before)

    def findings(self, states: Sequence[Any]) -> list[Finding]:
        """Return no finding: the points of a column resolve every face that a check accepts."""
        return []
