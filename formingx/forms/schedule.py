"""Step data of a stage: amplitudes of the controls, and inactive items."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class StepData:
    r"""Amplitudes of the items of a scene as linear functions of the control.

    .. math::
        a_i = \mathrm{base}_i + \mathrm{rate}_i \, \lambda

    :math:`\lambda` is the control; amplitudes are dimensionless. The last entry of each list is the process time.

    Attributes:
        base: one number for each item (0 for an item without control), then the process time.
        rate: derivatives of the amplitudes and of the process time with respect to the control.
        inactive: numbers of the inactive items.
        fading: True if the control removes, from 0 to 1, the unbalanced forces of a change of the active items.
        stage: number of the stage in its process.
        piece: number of the piece of the stage; each piece has one control.
        changed: numbers of the items that are deactivated or activated while the forces fade.
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
        """Return the step data of the unloaded scene with all its items.

        A single controlled item follows the control.

        Args:
            scene: the `Scene`.

        Returns:
            The step data.
        """
        rate = [float(scene.driven is not None and t.driven) for t in scene.items] + [0.0]
        return cls([0.0] * len(rate), rate, [])

    @property
    def leading(self) -> int | None:
        """Number of the controlled quantity: the time if it runs, else the one item that follows the control, or None.
        """
        if self.rate[-1]:
            return len(self.rate) - 1
        return next((i for i, rate in enumerate(self.rate) if rate), None)

    @property
    def rests(self) -> bool:
        """True if no item follows the control: only the time changes, or nothing."""
        return not any(self.rate[:-1])

    def amplitude(self, number: int, control: float) -> float:
        """Return the amplitude of an item.

        Args:
            number: number of the item; -1 for the process time.
            control: load parameter (control), dimensionless.

        Returns:
            Amplitude, or process time.
        """
        return self.base[number] + self.rate[number] * control

    def acting(self, number: int, control: float) -> float:
        """Return the amplitude of a load that acts on the body.

        Args:
            number: number of the load.
            control: load parameter (control), dimensionless.

        Returns:
            The amplitude, 0 for an inactive load; while forces fade, the amplitude of a changed load times the control
            or times 1 - control.
        """
        share = float(number not in self.inactive)
        if self.fading and number in self.changed:
            share = control if share else 1 - control
        return share * self.amplitude(number, control)

    def amplitudes(self, control: float) -> list[float]:
        """Return the amplitudes of the items and the process time.

        Args:
            control: load parameter (control), dimensionless.

        Returns:
            Amplitudes, then the process time.
        """
        return [self.amplitude(i, control) for i in range(len(self.base))]

    def on_next_mesh(self, before: Sequence[float], now: Sequence[float], control: float) -> tuple[StepData, float]:
        """Return the same step data and control for the scales of another mesh.

        Args:
            before: user's values over the amplitudes on the present mesh, then 1 for the time.
            now: the same on the next mesh.
            control: control on the present mesh.

        Returns:
            Step data and control on the next mesh.
        """
        ratio = [b / n for b, n in zip(before, now, strict=True)]
        of_control = 1.0 if self.leading is None else ratio[self.leading]
        return replace(self, base=[r * b for r, b in zip(ratio, self.base, strict=True)],
                       rate=[r * b / of_control for r, b in zip(ratio, self.rate, strict=True)],
                       mesh=self.mesh + 1), of_control * control
