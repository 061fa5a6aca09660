"""Converged states."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..measures.targets import Target
from .equations import Array


@dataclass(eq=False, repr=False)
class State:
    """One converged state. Two states are equal only if they are the same object.

    Attributes:
        x: the unknowns, locally owned entries (dimensionless).
        control: the dimensionless control.
        direction, slope: dx and dcontrol by arc length: the unit tangent of the path.
        measures: {name: value} in the user's units.
        history: the Newton iterations that led to it (`formingx.solve.newton.Iteration`).
        kind: "start", "step", "target", "limit point" or "jump" (the body snapped to it).
        jump: of a "jump": {"dissipated": energy that was lost (stress length^3), "moved": how far the body moved from
            the state before, mean over its volume (length)}.
        met: the target that it hits, or None.
        memory: the history variables of the problem from here on (`Problem.histories`); before: those used to
            solve for the state; empty if they are not known.
        stage: name of the stage of a process; setting: the step data of the stage, as plain data (`StepData`).
        stepping: the data with which a run continues: its next step, its counts and its target; empty inside a step.
        time: process time.
        orientation: sign of the tangent's determinant times that of the slope: the same along a path, through limit
            points too, until another path branches off; 0 if it is not known.
        verdict: reason for which no body can have this state, as text; "" for an admissible state. Only a run with
            `allow_inadmissible=True` continues past such a state.

    >>> state = path.limit_points[0]
    >>> state.kind, round(float(state.measures["pressure"]), 4), len(state.history)
    ('limit point', 0.0451, 2)
    """

    x: Array
    control: float
    direction: Array
    slope: float
    measures: dict[str, float] = field(default_factory=dict)
    history: list[Any] = field(default_factory=list)
    kind: str = "step"
    met: Target | None = None
    memory: list[Any] = field(default_factory=list)
    before: list[Any] = field(default_factory=list)
    stage: str = ""
    setting: dict[str, Any] = field(default_factory=dict)
    stepping: dict[str, Any] = field(default_factory=dict)
    time: float = 0.0
    jump: dict[str, Any] = field(default_factory=dict)
    orientation: int = 0
    verdict: str = ""

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value:.6g}" for name, value in self.measures.items())
        return f"State({self.kind!r}, " + f"stage={self.stage!r}, " * bool(self.stage) + f"{numbers})"
