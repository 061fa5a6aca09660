"""Conversion of the dimensionless numbers of a problem to text and to the user's units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..forms.schedule import StepData
from ..scene.scene import Scene
from ..scene.target_checks import implausible


class Units:
    """Part of `Problem` that converts dimensionless numbers to the user's units; see `formingx.solve.equations`.

    Attributes:
        scene: the `Scene`.
        forms: the `Formulation`.
    """

    scene: Scene
    forms: Any

    @property
    def setting(self) -> StepData:
        raise NotImplementedError

    @property
    def why_not_finite(self) -> str:
        limits = {f"{m} was stretched beyond its limit, I1 < {m.largest_I1:.6g}": None
                  for m in self.scene.materials.values() if m.largest_I1 < np.inf}
        strained = limits or ["a material was strained beyond what its law allows"]
        return ", or ".join(["an element turned inside out", *strained])

    def shown(self, control: float) -> tuple[str, float]:
        number, items = self.setting.controlled, self.scene.items
        if number is None:
            return "control", control
        name = "process time" if number == len(items) else self.scene.column(items[number]).replace("_", " ")
        return name, self.forms.scales[number] * self.setting.amplitude(number, control)

    def implausible(self, control: float) -> str | None:
        return implausible(self.scene, self.control_kind, self.shown(control)[1])

    @property
    def control_kind(self) -> str | None:
        number, items = self.setting.controlled, self.scene.items
        return None if number is None else "time" if number == len(items) else items[number].quantity

    @property
    def fixed_loads(self) -> list[str]:
        return [repr(load) for load in self.scene.loads if not load.driven]

    @property
    def main_columns(self) -> list[str]:
        return ["process_time", *map(self.scene.column, self.scene.drivable), "pole_height", "pole_stretch"]

    @property
    def scales(self) -> Sequence[float]:
        return self.forms.scales

    @property
    def units(self) -> tuple[float, float]:
        """Units of the dimensionless energy of the whole part (stress length^3) and of length, in the user's units."""
        return self.scene.symmetry_factor * self.forms.stress * self.forms.volume, self.forms.length

    @property
    def singular_unloaded(self) -> bool:
        """True if the body in the reference configuration has no stiffness in some direction."""
        return self.forms.singular_unloaded
