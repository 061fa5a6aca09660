"""What a stage of a process sets: how everything that can be driven follows the control, and what takes no part."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Setting:
    """amplitude = base + rate * control of every thing of a scene (`Scene.things`), dimensionless; last, process time.

    Attributes:
        base, rate: one number for each thing (0 unless it can be driven), then those of the process time.
        off: numbers of the things that take no part.
        fading: the control takes away, from 0 to 1, the forces that what has changed left without balance.
        stage, piece: number of the stage in its process, and of the piece of it that has one control.
    """

    base: list[float]
    rate: list[float]
    off: list[int]
    fading: bool = False
    stage: int = 0
    piece: int = 0

    @classmethod
    def first(cls, scene: Any) -> Setting:
        """Everything at 0 and there; what is driven, if it is one thing, is the control."""
        n = len(scene.things)
        return cls([0.0] * (n + 1), [float(thing is scene.driven) for thing in scene.things] + [0.0], [])

    @property
    def leading(self) -> int | None:
        """Number of what the control stands for: the time if it runs, else the one thing that is driven, or None."""
        return max((i for i, rate in enumerate(self.rate) if rate), default=None)

    def amplitude(self, number: int, control: float) -> float:
        """Of a thing, or with -1 the process time."""
        return self.base[number] + self.rate[number] * control

    def driving(self, number: int, stage: int, piece: int, off: Iterable[int], control: float) -> tuple:
        """(setting, control) with one thing driven from where it stands at a control; the others stay."""
        base = [self.amplitude(i, control) for i in range(len(self.base))]
        now, base[number] = base[number], 0.0
        rate = [float(i == number) for i in range(len(base))]
        return Setting(base, rate, sorted(off), False, stage, piece), now

    def standing(self, stage: int, piece: int, off: Iterable[int], control: float, fading: bool = False) -> Setting:
        """Everything stays where it stands at a control."""
        base = [self.amplitude(i, control) for i in range(len(self.base))]
        return Setting(base, [0.0] * len(base), sorted(off), fading, stage, piece)
