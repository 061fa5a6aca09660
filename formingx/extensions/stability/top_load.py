"""Top load of a formed body: its neck is pressed down against a plate until the body buckles.

The body is elastic, without plasticity. Units are the user's; forces are totals round the axis.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, check_name, check_type, positive
from ...measures.targets import travel as travel_to
from ...mesh.mesh import Mesh
from ...physics.contact import Contact
from ...physics.supports import PrescribedDisplacement, Symmetry
from ...results.path import Path
from ...runs import trace
from ...scene.scene import Scene
from ...solve.stepping import StepControl
from ...tools import Tool, plane
from ...units import NONE, Units
from .instability import CriticalPoint, Stability, wave_numbers

_FOOT: dict[str, Any] = {"points": 16, "penalty": 2.0, "ramp": 1e-4}
"""Arguments of the `Contact` of the foot: enough points on a compliant plate to let the standing ring roll.

A traction p sinks the foot by p h/(2 mu), with the shear modulus mu and the depth h of the body behind the foot. On a
rigid plate a contact line hops from point to point.
"""

_LARGEST_STEP = 0.004
"""Default of `StepControl.largest`: a crushed wall snaps through along short arcs."""


@dataclass(eq=False, repr=False)
class TopLoad:
    """Force and buckling of a body that is pressed down onto a plate by its neck; `print` shows a table.

    Attributes:
        path: the axisymmetric path.
        stability: stability of the states of the path, with the critical points.
        travel: displacement of the neck in the n states, positive downwards, shape (n,), length.
        force: force on the neck in the n states, positive downwards, shape (n,), force.
        ended: reason why the path ended before the requested travel, or "".
        units: a `formingx.Units` for the labels.
    """

    path: Path
    stability: Stability
    travel: np.ndarray
    force: np.ndarray
    ended: str
    units: Units = NONE

    @property
    def largest_force(self) -> float:
        """Largest force on the axisymmetric path."""
        return float(self.force.max())

    @property
    def travel_at_largest_force(self) -> float:
        """Travel of the neck at the largest force, length."""
        return float(self.travel[self.force.argmax()])

    @property
    def passed_maximum(self) -> bool:
        """True if the force has its maximum before the last state; otherwise it may grow further."""
        return bool(self.force.argmax() < len(self.force) - 1)

    @property
    def first(self) -> CriticalPoint | None:
        """First critical point at which a mode buckles, or None."""
        return self.stability.first

    def first_of(self, number: float) -> CriticalPoint | None:
        """Return the first critical point at which a mode with a given number of waves buckles.

        Args:
            number: number of waves round the axis.

        Returns:
            The critical point, or None; `buckling` returns its force and travel.
        """
        return self.stability.first_of(number)

    def buckling(self, number: float) -> tuple[float, float] | None:
        """Return the force on the neck and its travel at which the body first buckles with a given number of waves.

        Args:
            number: number of waves round the axis.

        Returns:
            Total force, force; travel, length, positive downwards. None if no such mode buckles.
        """
        point = self.first_of(number)
        return None if point is None else (point.state.measures["support_force"], -point.control)

    @property
    def energy(self) -> float:
        """Work of the force on the neck up to the first buckling, force times length.

        If no mode buckles, it is the work up to the state with the largest force.
        """
        first = self.first
        end = self.travel_at_largest_force if first is None else -first.control
        last = int(np.argmax(self.travel >= end * (1 - 1e-12)))
        x, F = self.travel[: last + 1].copy(), self.force[: last + 1].copy()
        if last and x[-1] > end:
            x[-1], F[-1] = end, F[-2] + (end - x[-2]) / (x[-1] - x[-2]) * (F[-1] - F[-2])
        return float(np.trapezoid(F, x))

    def __str__(self) -> str:
        def text(value: float, quantity: str, digits: int = 5) -> str:
            """Return a value with the unit of a quantity, as text with a number of significant digits."""
            return f"{value:.{digits}g} {self.units.unit_of(quantity)}".rstrip()

        def pair(force: float, travel: float, between: str = ", ") -> str:
            """Return a force and a travel, as text."""
            return f"{text(force, 'force')}{between}travel {text(travel, 'travel', 4)}"
        note = "" if self.passed_maximum else " (the last state: it may grow further)"
        largest = pair(self.largest_force, self.travel_at_largest_force, " at ")
        lines = ["top load, elastic:", f"  axisymmetric path: largest force {largest}{note}"]
        for n in self.stability.numbers:
            if (found := self.buckling(n)) is not None:
                lines.append(f"  n = {n:g}: buckles at force {pair(*found)}")
        lines.append("  no mode buckles" if self.first is None else
                     f"  first: n = {self.first.number:g}; energy to it {text(self.energy, 'energy', 4)}")
        return "\n".join([*lines, f"  the path ended before: {self.ended}"] if self.ended else lines)

    __repr__ = __str__


def top_load(body: Mesh, *, material: Any, travel: float, floor: Tool | None = None,
             modes: Iterable[float] = range(2, 9), neck: str = "neck", foot: str = "outer",
             step: StepControl | None = None, units: Units | None = None) -> TopLoad:
    """Press a stress-free body down onto a frictionless plate by its neck, and find its buckling loads.

    The neck is constrained radially and round the axis. The plate is compliant: a traction p sinks the foot by
    p h/(2 mu), with the shear modulus mu and the depth h of the body behind the foot. For the foot `outer` of a parison
    h is the wall thickness. On this plate the contact of a standing ring rolls. On a rigid plate it would hop from
    point to point.

    Args:
        body: mesh of the body, for example `Path.deformed_mesh()`.
        material: a material, or {layer: material}, as in `Scene`.
        travel: requested downward displacement of the neck, length. The run may end earlier, see `TopLoad.ended`.
        floor: the plate, a `Tool`; default: a plane at the lowest node of `foot`.
        modes: circumferential wave numbers to examine.
        neck: name of the boundary that is pressed down.
        foot: name of the boundary that stands on the plate.
        step: control of the step length; default `StepControl(largest=0.004)`, a dimensionless arc length.
        units: a `formingx.Units`, for the labels.

    Returns:
        Forces, travels and critical points of the run.

    Raises:
        InputError: an argument that is not allowed, or a foot that does not reach the floor.
        ConvergenceError: the run failed before its second state.

    >>> bottle = fx.mesh.parison(inner_radius=1.0, thickness=0.03, length=2.0, elements=(12, 1))
    >>> found = fx.top_load(bottle, material=fx.NeoHookean(c10=1.0), travel=0.1, modes=[4],
    ...                     step=fx.StepControl(largest=0.1))
    >>> round(found.largest_force, 4)
    0.0023
    """
    check_type("top_load: body", body, Mesh, "a mesh, such as path.deformed_mesh()")
    check_name("top_load: neck", neck, body.boundaries)
    check_name("top_load: foot", foot, body.boundaries)
    travel = positive("top_load: travel", travel)
    if floor is None:
        floor = plane(float(body.nodes_of(foot)[:, 1].min())).reversed()
    scene = Scene(mesh=body, materials=material,
                  supports=[*[Symmetry("axis")] * ("axis" in body.boundaries), Symmetry(neck, "r"),
                            PrescribedDisplacement(neck, "z")],
                  contacts=[Contact(foot, floor, "none", **_FOOT)])
    modes, ended = wave_numbers(scene, modes), ""
    try:
        path = trace(scene, until=travel_to(-travel), progress=False, step=step or StepControl(largest=_LARGEST_STEP))
    except ConvergenceError as error:
        if error.path is None or len(error.path.states) < 2:
            raise
        path, ended = error.path, str(error).split(". ")[0]
    if not path["contact_length"].any():
        raise InputError(f"top_load: floor = {floor!r}: {foot!r} does not reach it within travel = {travel:g}")
    return TopLoad(path, path.stability(modes, "all"), -path["travel"], path["support_force"], ended,
                   units or NONE)
