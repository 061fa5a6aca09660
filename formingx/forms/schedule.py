"""Step data of a stage: amplitudes of the controls, and inactive items."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any


@dataclass(frozen=True)
class StepData:
    r"""Amplitudes of loads, supports and contacts (`Scene.items`) as linear functions of the control.

    .. math:: a_i = \mathrm{base}_i + \mathrm{rate}_i \, \lambda

    :math:`\lambda` is the control; amplitudes are dimensionless. The last entry of `base` and `rate` belongs to the
    process time.

    Attributes:
        base: amplitude of each load, support and contact at control 0, in the order of `Scene.items` (0 for those
            without control), then the process time.
        rate: derivatives of the amplitudes and of the process time with respect to the control.
        inactive: indices of the inactive loads, supports and contacts in `Scene.items`, and numbers of inactive laws of
            heat (`Scene.heat_laws`).
        fading: True if forces that a change of the active loads, supports or contacts leaves out of balance vanish as
            the control goes from 0 to 1.
        stage: number of the stage in its process.
        piece: number of the piece of the stage; each piece has one control.
        changed: indices of the items that are deactivated or activated while the forces fade.
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
        """Return the step data of the unloaded scene, with the driven item as the control and all items active."""
        rate = [float(scene.driven is not None and t.driven) for t in scene.items] + [0.0]
        return cls([0.0] * len(rate), rate, [])

    @cached_property
    def controlled(self) -> int | None:
        """Index in `rate` of the process time, if it changes, else of the first item that does; None for none."""
        if self.rate[-1]:
            return len(self.rate) - 1
        return next((i for i, rate in enumerate(self.rate) if rate), None)

    @property
    def is_constant(self) -> bool:
        """True if no amplitude depends on the control; the process time may depend on it."""
        return not any(self.rate[:-1])

    def amplitude(self, number: int, control: float) -> float:
        """Return the amplitude of item `number` of `Scene.items`, or the process time for -1."""
        return self.base[number] + self.rate[number] * control

    def acting_amplitude(self, number: int, control: float) -> float:
        """Return the amplitude of an acting load, else 0; `fading`: a new one times control, an old one 1 - control."""
        share = float(number not in self.inactive)
        if self.fading and number in self.changed:
            share = control if share else 1 - control
        return share * self.amplitude(number, control)

    def amplitudes(self, control: float) -> list[float]:
        """Return the amplitudes in the order of `Scene.items`, then the process time."""
        return [self.amplitude(i, control) for i in range(len(self.base))]

    def transferred(self, before: Sequence[float], now: Sequence[float], control: float) -> tuple[StepData, float]:
        """Return step data and control that give the same values in the user's units on the next mesh of a run.

        before, now: value of each item at amplitude 1 on both meshes, in the user's units, then 1 for the time.
        """
        ratio = [b / n for b, n in zip(before, now, strict=True)]
        control_ratio = 1.0 if self.controlled is None else ratio[self.controlled]
        return replace(self, base=[r * b for r, b in zip(ratio, self.base, strict=True)],
                       rate=[r * b / control_ratio for r, b in zip(ratio, self.rate, strict=True)],
                       mesh=self.mesh + 1), control_ratio * control
