"""Top load of a formed body: its neck is pressed down against a plate until the body buckles.

The body is elastic, without plasticity. Units are the user's; forces are totals round the axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, check_name, check_type, positive
from ...forms.outline import Outline
from ...measures.targets import travel as travel_to
from ...mesh.mesh import Mesh
from ...physics.contact import Contact
from ...physics.supports import PrescribedDisplacement, Symmetry
from ...problem.problem import Problem
from ...results.path import Path
from ...runs import trace
from ...scene.scene import Scene
from ...solve.stepping import StepControl
from ...tools import Tool, plane
from ...units import NONE, Units
from .instability import CriticalPoint, Stability, max_wave_number, wave_numbers

_FOOT: dict[str, Any] = {"points": 16, "penalty": 2.0, "ramp": 1e-4}
"""Arguments of the `Contact` of the foot: enough points on a compliant plate to let the standing ring roll.

A traction p sinks the foot by p h/(2 mu), with the shear modulus mu and the depth h of the body behind the foot. On a
rigid plate a contact line hops from point to point.
"""

_LARGEST_STEP = 0.004
"""Largest default of `StepControl.largest`: a crushed wall snaps through along short arcs."""

_STEP_OF_WALL = 0.4
"""Default of `StepControl.largest` over the wall divided by the radius, the order of the strain at buckling."""

_SHORTER, _RERUNS = 0.25, 3
"""Factor on the length of steps, and largest number of repetitions, until the first critical point is solved for."""

_WAVES = 9**0.25 / 2
"""Wave number over sqrt(R/t) up to which modes of an incompressible cylinder buckle first (Koiter 1945)."""

_NO_FORCE = 1e-9
"""Largest force, over the shear modulus times the square of the length of the body, that is round-off."""


@dataclass(eq=False, repr=False)
class TopLoad:
    """Force and buckling of a body that is pressed down onto a plate by its neck; `print` shows a table.

    Attributes:
        path: the axisymmetric path.
        stability: stability of the states of the path, with the critical points.
        travel: displacement of the neck in the n states, positive towards the plate, shape (n,), length.
        force: force on the neck in the n states, positive towards the plate, shape (n,), force.
        ended: reason why the path ended before the requested travel, or "".
        units: a `formingx.Units` for the labels.
        up: True if the neck is above the foot and moves down, False if it is below and moves up.
    """

    path: Path
    stability: Stability
    travel: np.ndarray
    force: np.ndarray
    ended: str
    units: Units = NONE
    up: bool = True

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
            Total force, force; travel, length, positive towards the plate. None if no such mode buckles.
        """
        point = self.first_of(number)
        sense = 1 if self.up else -1
        return None if point is None else (sense * point.state.measures["support_force"], -sense * point.control)

    @property
    def energy(self) -> float:
        """Work of the force on the neck up to the first buckling, force times length.

        If no mode buckles, it is the work up to the state with the largest force.
        """
        first = self.first
        end = self.travel_at_largest_force if first is None else abs(first.control)
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
                point = self.first_of(n)
                lines.append(f"  n = {n:g}: buckles at force {pair(*found)}"
                             + ", interpolated" * (point is not None and not point.solved))
        lines.append("  no mode buckles" if self.first is None else
                     f"  first: n = {self.first.number:g}; energy to it {text(self.energy, 'energy', 4)}")
        return "\n".join([*lines, f"  the path ended before: {self.ended}"] if self.ended else lines)

    __repr__ = __str__


def top_load(body: Mesh, *, material: Any, travel: float, floor: Tool | None = None,
             modes: Iterable[float] | None = None, neck: str = "neck", foot: str = "outer",
             up: bool | None = None, step: StepControl | None = None, units: Units | None = None) -> TopLoad:
    r"""Press a stress-free body onto a frictionless plate by its neck, and find its buckling loads.

    The neck is constrained radially and round the axis. The plate is compliant: a traction p sinks the foot by
    p h/(2 mu), with the shear modulus mu and the depth h of the body behind the foot. For the foot `outer` of a parison
    h is the wall thickness. On this plate the contact of a standing ring rolls. On a rigid plate it would hop from
    point to point.

    Args:
        body: mesh of the body, for example `Path.deformed_mesh()`.
        material: a material, or {layer: material}, as in `Scene`.
        travel: requested displacement of the neck, length. The run may end earlier, see `TopLoad.ended`.
        floor: the plate, a `Tool`; default: a plane at the node of `foot` that is farthest from the neck.
        modes: circumferential wave numbers to examine. Default: from 1 to somewhat above
            :math:`\tfrac{1}{2} \sqrt[4]{9} \sqrt{R/t}`, with the largest ratio of radius and wall (Koiter 1945 for a
            cylinder); more follow while the mode with the largest number buckles first.
        neck: name of the boundary that is pressed towards the plate.
        foot: name of the boundary that stands on the plate.
        up: True: the neck is above the foot and moves down. False: the body stands on its head, such as a pot that was
            formed with its base up; the plate is above it, and the neck moves up. Default: as the neck lies.
        step: control of the step length, a dimensionless arc length; the default is shorter for thinner walls. Steps
            are shortened, and the run is repeated, until the first critical point is solved for.
        units: a `formingx.Units`, for the labels.

    Returns:
        Forces, travels and critical points of the run.

    Raises:
        InputError: an argument that is not allowed, a foot that does not reach the floor, or a force that is not above
            round-off.
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
    necks, feet = body.nodes_of(neck)[:, 1], body.nodes_of(foot)[:, 1]
    if up is None:
        up = bool(necks.mean() >= (feet.min() + feet.max()) / 2)
    sense = 1 if check_type("top_load: up", up, bool, "True, False or None") else -1
    if floor is None:
        floor = plane(float(feet.min())).reversed() if up else plane(float(feet.max()))
    scene = Scene(mesh=body, materials=material,
                  supports=[*[Symmetry("axis")] * ("axis" in body.boundaries), Symmetry(neck, "r"),
                            PrescribedDisplacement(neck, "z")],
                  contacts=[Contact(foot, floor, "none", **_FOOT)])
    slender = _slenderness(scene)
    given, step = modes, step or StepControl(largest=min(_LARGEST_STEP, _STEP_OF_WALL / slender))
    modes = _default_modes(scene, slender) if given is None else wave_numbers(scene, given)
    path, ended = _press(scene, -sense * travel, step)
    if not path["contact_length"].any():
        raise InputError(f"top_load: floor = {floor!r}: {foot!r} does not reach it within travel = {travel:g}")
    forms = path.problem.forms
    if np.abs(path["support_force"]).max() <= _NO_FORCE * forms.stress * forms.length**2:
        raise InputError(f"top_load: up = {up!r}: {neck!r} moves {'down' if up else 'up'} by {path.last.control:.4g}"
                         f" without a force on it: the floor does not press against the body; give up={not up}, or"
                         f" floor=...")
    stability = path.stability(modes, "all")
    for _ in range(_RERUNS):
        if stability.first is None or stability.first.solved:
            break
        step = replace(step, largest=_SHORTER * step.largest, length=min(step.length, _SHORTER * step.largest))
        try:
            shorter, why = _press(scene, -sense * travel, step)
        except ConvergenceError:
            break
        path, ended, stability = shorter, why, shorter.stability(modes, "all")
    while given is None and stability.first is not None and stability.first.number >= modes[-1] - 1:
        largest = min(int(1.5 * modes[-1]), int(max_wave_number(scene)))
        if largest <= modes[-1]:
            break
        modes = [*modes, *range(int(modes[-1]) + 1, largest + 1)]
        stability = path.stability(modes, "all")
    return TopLoad(path, stability, -sense * path["travel"], sense * path["support_force"], ended, units or NONE, up)


def _press(scene: Scene, travel: float, step: StepControl) -> tuple[Path, str]:
    """Return the path of a neck to a `travel`, and why it ended before, or ""; none at all is a ConvergenceError."""
    try:
        return trace(scene, until=travel_to(travel), progress=False, step=step), ""
    except ConvergenceError as error:
        if error.path is None or len(error.path.states) < 2:
            raise
        return error.path, str(error).split(". ")[0]


def _default_modes(scene: Scene, slender: float) -> list[float]:
    """Return the wave numbers that are examined by default, for the largest ratio of radius and wall of a body."""
    largest = min(math.ceil(1.2 * _WAVES * math.sqrt(slender)) + 2, int(max_wave_number(scene)))
    return wave_numbers(scene, range(1, max(largest, 1) + 1))


def _slenderness(scene: Scene) -> float:
    """Return the largest ratio of radius and wall of a body; collective.

    The wall at the middle of an edge is the distance along the inner normal to the halves of the other edges.
    """
    edges = Outline(Problem(scene).forms).reference_edges
    a, b, middle = edges.transpose(1, 0, 2)
    along = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    # the ray middle + s normal meets the chord start + t chord of half an edge
    start, chord = np.concatenate([a, middle]), np.concatenate([middle - a, b - middle])
    offset = start[None] - middle[:, None]
    cross = normal[:, None, 0] * chord[None, :, 1] - normal[:, None, 1] * chord[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (offset[..., 0] * chord[None, :, 1] - offset[..., 1] * chord[None, :, 0]) / cross
        t = (offset[..., 0] * normal[:, None, 1] - offset[..., 1] * normal[:, None, 0]) / cross
    met = (s > 0) & (t >= -1e-9) & (t <= 1 + 1e-9)
    own = np.arange(len(edges))
    met[own, own] = met[own, own + len(edges)] = False             # a curved edge does not meet itself
    wall = np.where(met, s, np.inf).min(axis=1)
    return float(max(np.max(middle[:, 0] / wall), 1.0))
