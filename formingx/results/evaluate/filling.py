"""Filling of a mould: the remaining gap in each corner, state by state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, non_negative
from ...forms.probes import probe
from ...tools.shapes import Arc, Tool
from ...values.tolerances import ROUND_OFF
from ..files.column_table import ColumnTable
from .profile import distance_to_line, refined


class Corner(NamedTuple):
    """Corner of a tool that the body must fill.

    Attributes:
        position: middle of the corner (r, z), before the tool moves, length.
        radius: radius of the fillet in the corner, length; 0 for a sharp corner.
    """

    position: tuple[float, float]
    radius: float


@dataclass(frozen=True, repr=False)
class Filling(ColumnTable):
    """Remaining gaps in the k corners of a tool, in n states.

    Attributes:
        corners: the k corners, in the order of the tool's profile.
        control: {column: its values, shape (n,)} for each pressure; without a pressure, for each load, support and tool
            that a stage can control.
        gaps: largest distance from the points of each corner to the deformed face, shape (n, k), length.
        comm: MPI communicator of the run.
    """

    corners: list[Corner]
    control: dict[str, np.ndarray]
    gaps: np.ndarray
    comm: Any

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the table of n states, {name: values, shape (n,)}.

        They are the columns of `control`, such as the pressure, and "corner_1_gap", "corner_2_gap", ..., the largest
        distance from each corner to the deformed face, length.
        """
        return self.control | {f"corner_{k}_gap": gap for k, gap in enumerate(self.gaps.T, 1)}

    @property
    def pressure(self) -> np.ndarray:
        """Values of the first entry of `control`, usually a pressure, shape (n,)."""
        return next(iter(self.control.values()))

    def pressure_at(self, gap: float, corner: int | None = None) -> float:
        """Return the pressure from which on the gap stays at or below a value, interpolated linearly between states.

        Args:
            gap: remaining gap, length.
            corner: index of a corner in `corners`, from 0; default the largest gap of all corners.

        Returns:
            The value of `pressure`, stress, or the value of another control in its unit.

        Raises:
            InputError: the gap is negative or is not reached, or there is no such corner.
        """
        gap = non_negative("pressure_at: gap", gap)
        if corner is not None and corner not in range(len(self.corners)):
            raise InputError(f"pressure_at: corner = {corner!r}: must be from 0 to {len(self.corners) - 1}")
        remaining = self.gaps.max(1) if corner is None else self.gaps[:, corner]
        if remaining[-1] > gap:
            raise InputError(f"pressure_at: gap = {gap:g} is not reached: {remaining[-1]:.6g} remains at the end")
        wider = np.flatnonzero(remaining > gap)
        if not len(wider):
            return float(self.pressure[0])
        k = wider[-1]
        part = (remaining[k] - gap) / (remaining[k] - remaining[k + 1])
        return float((1 - part) * self.pressure[k] + part * self.pressure[k + 1])


def filling(path: Any, contact: Any) -> Filling:
    """Return the gaps in a tool's corners, state by state (`Path.filling`), InputError without any; collective."""
    from ...contact.tooling import Tooling
    tooling = Tooling.of_problem(path.problem)
    number = path.problem.contacts.index(contact)
    corners = corners_of(contact.contact.tool)
    if not corners:
        raise InputError(f"filling: {contact.contact.tool!r} has no corner that the body must fill")
    face = probe(path.problem, path.problem.scene.mesh.line_of(contact.contact.on))
    gaps = np.full((len(path), len(corners)), np.nan)
    for n, state in enumerate(path.states):
        travel = tooling.travels(state.setting, state.control)[number] or 0.0
        shift = travel * contact.contact.travel_vector
        with path.problem.state_context(state) as problem:
            line = refined(face.points + face.displacement(problem.x))
        gaps[n] = [distance_to_line(points + shift, line).max() for _, points in corners]
    driven = [c for c in path.columns if c.endswith("pressure")] or [
        path.problem.scene.column(item) for item in path.problem.scene.drivable]
    return Filling([corner for corner, _ in corners], {c: path[c] for c in driven}, gaps, path.problem.comm)


def corners_of(tool: Tool) -> list[tuple[Corner, np.ndarray]]:
    """Return (`Corner`, points on it (m, 2), length) of the concave fillets and sharp corners of a tool.

    A fillet has m = 17 points, a sharp corner m = 1. The tool has not moved.
    """
    found = []
    pieces = list(tool.pieces)
    for i, piece in enumerate(pieces):
        if isinstance(piece, Arc) and -np.pi < piece.sweep < -ROUND_OFF:
            angles = piece.start + piece.sweep * np.linspace(0, 1, 17)
            points = piece.centre + piece.radius * np.column_stack([np.cos(angles), np.sin(angles)])
            found.append((Corner((float(points[8, 0]), float(points[8, 1])), piece.radius), points))
        following = pieces[i + 1] if i + 1 < len(pieces) else pieces[0] if tool.closed else None
        if following is not None:
            turn = np.pi - (np.pi - (following.angles[0] - piece.angles[1])) % (2 * np.pi)
            if turn < -ROUND_OFF:
                end = piece.ends[1]
                found.append((Corner((float(end[0]), float(end[1])), 0.0), end[None]))
    return found
