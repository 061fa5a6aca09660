"""Top load of a formed body: its neck is pressed down against a plate until the body buckles.

The body is elastic, without plasticity. Units are the user's; forces are totals round the axis.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, instance, known, positive
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
"""Contact of the foot: enough points on a compliant plate to let the standing ring roll.

The compliance is about a thousandth of the wall. On a rigid plate a contact line hops from point to point.
"""

_STEP = 0.004
"""Largest step length: a crushed wall snaps through along short arcs."""


@dataclass(eq=False, repr=False)
class TopLoad:
    """Top load of a body that is pressed down onto a plate; prints a table.

    Attributes:
        path: the axisymmetric path.
        stability: stability of its states, with the critical points.
        travel: displacement of the neck at all n states, positive downwards, shape (n,), length.
        force: its force, positive downwards, shape (n,), force.
        largest_force: peak force of the axisymmetric path.
        at_travel: travel at the peak force, length.
        peak: False if the force is largest in the last state: it may grow further.
        ended: why the path ended before the requested travel, as text, or "".
        energy: work up to the first buckling or to the largest force, length force.
        units: a `Units` for the labels.
    """

    path: Path
    stability: Stability
    travel: np.ndarray
    force: np.ndarray
    ended: str
    units: Units = NONE

    @property
    def largest_force(self) -> float:
        """Peak force of the axisymmetric path."""
        return float(self.force.max())

    @property
    def at_travel(self) -> float:
        """Travel at the peak force, length."""
        return float(self.travel[self.force.argmax()])

    @property
    def peak(self) -> bool:
        """True if the force passes a maximum within the path."""
        return bool(self.force.argmax() < len(self.force) - 1)

    @property
    def first(self) -> CriticalPoint | None:
        """First buckling point, or None."""
        return self.stability.first

    def of(self, number: float) -> CriticalPoint | None:
        """Return the first buckling point with a number of waves; `buckling` returns its force and travel.

        Args:
            number: number of waves.

        Returns:
            The critical point, or None.
        """
        return self.stability.first_of(number)

    def buckling(self, number: float) -> tuple[float, float] | None:
        """Return force and travel of the first buckling point with a number of waves.

        Args:
            number: number of waves.

        Returns:
            (force, travel), or None.
        """
        loss = self.of(number)
        return None if loss is None else (loss.state.measures["support_force"], -loss.control)

    @property
    def energy(self) -> float:
        """Work up to the first buckling or to the largest force, length force."""
        first = self.first
        end = self.at_travel if first is None else -first.control
        last = int(np.argmax(self.travel >= end * (1 - 1e-12)))
        x, F = self.travel[: last + 1].copy(), self.force[: last + 1].copy()
        if last and x[-1] > end:
            x[-1], F[-1] = end, F[-2] + (end - x[-2]) / (x[-1] - x[-2]) * (F[-1] - F[-2])
        return float(np.trapezoid(F, x))

    def __str__(self) -> str:
        def said(value: float, of: str, digits: int = 5) -> str:
            return f"{value:.{digits}g} {self.units.of(of)}".rstrip()

        def at(force: float, travel: float, between: str = ", ") -> str:
            return f"{said(force, 'force')}{between}travel {said(travel, 'travel', 4)}"
        what = "" if self.peak else " (the last state: it may grow further)"
        lines = ["top load, elastic:",
                 f"  axisymmetric path: largest force {at(self.largest_force, self.at_travel, ' at ')}{what}"]
        for n in self.stability.numbers:
            if (found := self.buckling(n)) is not None:
                lines.append(f"  n = {n:g}: buckles at force {at(*found)}")
        lines.append("  no mode buckles" if self.first is None else
                     f"  first: n = {self.first.number:g}; energy to it {said(self.energy, 'energy', 4)}")
        return "\n".join([*lines, f"  the path ended before: {self.ended}"] if self.ended else lines)

    __repr__ = __str__


def top_load(body: Mesh, *, material: Any, travel: float, floor: Tool | None = None,
             modes: Iterable[float] = range(2, 9), neck: str = "neck", foot: str = "outer",
             step: StepControl | None = None, units: Units | None = None) -> TopLoad:
    """Press a stress-free body down onto a frictionless plate by its neck, and find its buckling loads.

    The neck is constrained radially and round the axis. The contact compliance is about a thousandth of the wall,
    so that the standing ring of a bottle rolls.

    Args:
        body: for example `Path.deformed_mesh()`.
        material: as in `Scene`.
        travel: requested downward displacement of the neck, length. The run may end earlier, see `TopLoad.ended`.
        floor: the plate; default: a plane at the lowest node of the body.
        modes: circumferential wave numbers to examine.
        neck: boundary that is pressed down.
        foot: boundary that stands on the plate.
        step: default `StepControl(largest=0.004)`.
        units: a `formingx.Units`, for the labels.

    Returns:
        The `TopLoad`.

    Raises:
        InputError: an argument that is not allowed, or a foot that does not reach the floor.
        ConvergenceError: the first state was not found.

    >>> tube = fx.mesh.disc(radius=1.0, inner_radius=0.8, thickness=4.0, elements=(1, 8))
    >>> found = fx.top_load(tube, material=fx.NeoHookean(c10=1.0), travel=0.3, neck="top", foot="bottom", modes=[1],
    ...                     step=fx.StepControl(largest=0.2))
    >>> round(found.largest_force, 2)
    0.21
    """
    instance("top_load: body", body, Mesh, "a mesh, such as path.deformed_mesh()")
    known("top_load: neck", neck, body.boundaries)
    known("top_load: foot", foot, body.boundaries)
    travel = positive("top_load: travel", travel)
    if floor is None:
        floor = plane(float(body.nodes_of(foot)[:, 1].min())).reversed()
    scene = Scene(mesh=body, materials=material,
                  supports=[*[Symmetry("axis")] * ("axis" in body.boundaries), Symmetry(neck, "r"),
                            PrescribedDisplacement(neck, "z")],
                  contacts=[Contact(foot, floor, "none", **_FOOT)])
    modes, ended = wave_numbers(scene, modes), ""
    try:
        path = trace(scene, until=travel_to(-travel), progress=False, step=step or StepControl(largest=_STEP))
    except ConvergenceError as error:
        if error.path is None or len(error.path.states) < 2:
            raise
        path, ended = error.path, str(error).split(". ")[0]
    if not path["contact_length"].any():
        raise InputError(f"top_load: floor = {floor!r}: {foot!r} does not reach it within travel = {travel:g}")
    return TopLoad(path, path.stability(modes, "all"), -path["travel"], path["support_force"], ended,
                   units or NONE)
