"""Converged states of a path."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..measures.targets import Target
from .equations import Array


@dataclass(eq=False, repr=False)
class State:
    """Converged state of a path. Two states are equal only if they are the same object.

    Attributes:
        x: the unknowns, locally owned entries, shape (n,), dimensionless.
        control: load parameter (control), dimensionless.
        direction: derivative of x with respect to arc length, locally owned entries, shape (n,).
        slope: derivative of the control with respect to arc length; (direction, slope) is the unit tangent of the path.
        measures: {name: value} of the output quantities, in the user's units.
        history: `formingx.solve.newton.Iteration` (residual, correction, work, chord) of each Newton iteration of the
            solution for this state. The last entry is the residual of the converged state.
        kind: "start", "step", "target", "limit point" or "jump" (the body snapped to this state).
        jump: of a "jump": {"dissipated": energy lost in the snap-through (stress length^3), "moved": displacement from
            the state before, root mean square over the volume of the body (length)}.
        target: the target that the state meets exactly, or None.
        history_variables: history variables of the problem after this state, an entry for each history of the problem
            (contacts, materials, temperature).
        history_variables_before: history variables with which the state was solved for, in the same order; empty in a
            loaded path.
        stage: name of the stage of a process.
        setting: step data of the stage, as a dict of the fields of `StepData`.
        stepping: {name: data} with which a run continues after this state: its step control, its counts and its target;
            empty for a state inside a step.
        time: process time.
        orientation: sign of det(dF/dx) times the sign of the slope; 0 if it is not known. It is constant along a smooth
            path, also through limit points, and changes its sign where another path branches off. At a kink of F it
            belongs to the side of the next step, as the tangent does.
        inadmissible_reason: reason for which no body can have this state, as text; "" for an admissible state. A run
            continues past an inadmissible state only with `allow_inadmissible=True`.

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
    target: Target | None = None
    history_variables: list[Any] = field(default_factory=list)
    history_variables_before: list[Any] = field(default_factory=list)
    stage: str = ""
    setting: dict[str, Any] = field(default_factory=dict)
    stepping: dict[str, Any] = field(default_factory=dict)
    time: float = 0.0
    jump: dict[str, Any] = field(default_factory=dict)
    orientation: int = 0
    inadmissible_reason: str = ""

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value:.6g}" for name, value in self.measures.items())
        return f"State({self.kind!r}, " + f"stage={self.stage!r}, " * bool(self.stage) + f"{numbers})"
