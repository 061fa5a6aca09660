"""Step data of a stage: amplitudes of the controls, and inactive items."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class StepData:
    """amplitude = base + rate * control of every item of a scene (`Scene.items`), dimensionless; last, process time.

    Attributes:
        base, rate: one number for each item (0 unless it can be controlled), then the process time.
        inactive: numbers of the items that take no part.
        fading: the control takes away, from 0 to 1, the unbalanced forces of the change.
        stage, piece: number of the stage in its process, and of the piece of it that has one control.
        changed: numbers of the items that leave or come in while it fades.
        mesh: number of remeshings before (`formingx.extensions.remeshing.remeshing`).
    """

    base: list[float]
    rate: list[float]
    inactive: list[int]
    fading: bool = False
    stage: int = 0
    piece: int = 0
    changed: list[int] = field(default_factory=list)
    mesh: int = 0

    @classmethod
    def first(cls, scene: Any) -> StepData:
        """Return the setting of the unloaded scene with all its items; a single controlled item follows the control."""
        rate = [float(scene.driven is not None and t.driven) for t in scene.items] + [0.0]
        return cls([0.0] * len(rate), rate, [])

    @property
    def leading(self) -> int | None:
        """Number of the controlled quantity: the time if it runs, else the one item that is driven, or None."""
        if self.rate[-1]:
            return len(self.rate) - 1
        return next((i for i, rate in enumerate(self.rate) if rate), None)

    @property
    def rests(self) -> bool:
        """True if only the time changes, or nothing."""
        return not any(self.rate[:-1])

    def amplitude(self, number: int, control: float) -> float:
        """Return the amplitude of an item, or with -1 the process time."""
        return self.base[number] + self.rate[number] * control

    def acting(self, number: int, control: float) -> float:
        """Return the active part of a load's amplitude: 0 if the load is inactive; it fades in or out in a change."""
        share = float(number not in self.inactive)
        if self.fading and number in self.changed:
            share = control if share else 1 - control
        return share * self.amplitude(number, control)

    def amplitudes(self, control: float) -> list[float]:
        """Return the amplitudes of the items and the process time at a control."""
        return [self.amplitude(i, control) for i in range(len(self.base))]

    def on_next_mesh(self, before: Sequence[float], now: Sequence[float], control: float) -> tuple[StepData, float]:
        """Return (the same setting, the same control) where the user's values over the amplitudes are `now`."""
        ratio = [b / n for b, n in zip(before, now, strict=True)]
        of_control = 1.0 if self.leading is None else ratio[self.leading]
        return replace(self, base=[r * b for r, b in zip(ratio, self.base, strict=True)],
                       rate=[r * b / of_control for r, b in zip(ratio, self.rate, strict=True)],
                       mesh=self.mesh + 1), of_control * control
