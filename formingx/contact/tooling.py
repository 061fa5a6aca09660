"""Names and positions of the tools of a scene in its states, for pictures and tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..forms.schedule import StepData
from ..physics.contact import Contact
from ..tools.shapes import Arc, Line, Tool
from ..values.table import table


class Tooling(NamedTuple):
    """All contacts of a scene, with names, travels and positions of their tools.

    Attributes:
        contacts: contacts in the order of the scene.
        first: number of items of the scene that precede the contacts in `Scene.items`.
        length: length by which an amplitude is multiplied to give the travel of a tool, length.
    """

    contacts: list[Contact]
    first: int
    length: float

    @classmethod
    def of_problem(cls, problem: Any) -> Tooling:
        """Return the tooling of a `Problem`."""
        scene = problem.scene
        return cls(scene.contacts, len(scene.loads) + len(scene.supports), problem.forms.length)

    @classmethod
    def of_description(cls, scene: dict[str, Any]) -> Tooling:
        """Return the tooling of a scene that is given as plain data."""
        return cls([_contact(dict(data)) for data in scene["contacts"]], len(scene["loads"]) + len(scene["supports"]),
                   scene["mesh"]["length"])

    @property
    def names(self) -> list[str]:
        """Name of the tool of each contact, in order; one without a name is "tool 1", by its contact's number.

        Unnamed tools with the same direction count as one, with the name of the first.
        """
        first: dict[Any, int] = {}
        alike = [k if c.direction is None else c.direction for k, c in enumerate(self.contacts)]
        return [c.name or f"tool {first.setdefault(alike[k], k) + 1}" for k, c in enumerate(self.contacts)]

    @property
    def force_columns(self) -> dict[str, str]:
        """{tool name: column of its contact force}: "tool_force" for the only tool, else "plug_force", "tool_1_force".
        """
        names = self.names
        if len(set(names)) == 1:
            return {names[0]: "tool_force"}
        return {name: f"{c.name or name.replace(' ', '_')}_force" for name, c in zip(names, self.contacts)}

    def travels(self, setting: dict[str, Any], control: float) -> list[float | None]:
        """Return the travel of each tool, length, by plain `StepData` or {}; None for an inactive tool."""
        if not setting:
            return [0.0] * len(self.contacts)
        step_data = StepData(**setting)
        return [None if i in step_data.inactive else self.length * step_data.amplitude(i, control)
                for i in range(self.first, self.first + len(self.contacts))]

    def placed(self, travels: list[float | None]) -> list[tuple[Tool, np.ndarray]]:
        """Return each active tool with its displacement (r, z), shape (2,), length; travels: None if inactive."""
        return [(contact.tool, travel * contact.travel_vector)
                for contact, travel in zip(self.contacts, travels, strict=True) if travel is not None]


_three_dimensional: list[Callable[[dict[str, Any]], Any]] = []


def register_tools(make: Callable[[dict[str, Any]], Any]) -> None:
    """Register the function that makes a tool in three dimensions from plain data, for the extension 'space'."""
    _three_dimensional[:] = [make]


def tool_of(shape: dict[str, Any]) -> Any:
    """Return the tool that plain data describe; one in three dimensions without the extension is an InputError."""
    if "pieces" in shape:
        pieces: list[Line | Arc] = []
        for piece in shape["pieces"]:
            values: list[Any] = [np.array(v) if isinstance(v, list) else v for v in piece]
            pieces.append((Line if len(values) == 2 else Arc)(*values))
        return Tool.of_pieces(pieces, shape["closed"])
    if not _three_dimensional:
        raise InputError("tools in three dimensions: the extension 'space' of formingx is not installed")
    return _three_dimensional[0](shape)


def _contact(data: dict[str, Any]) -> Contact:
    """Return the `Contact` that plain data describe, {name of an attribute: its value}."""
    direction = data["direction"] and tuple(data["direction"])
    names = ("penalty", "ramp", "elastic_slip", "separates", "points", "name")
    options = {name: data[name] for name in names if name in data}
    friction = data["friction"]
    if isinstance(friction, dict):                          # a function of the temperature is stored as plain data
        friction = repr(table(dict(zip(friction["x"], friction["y"])))) if "x" in friction else str(friction)
    words = isinstance(friction, str) and friction not in ("stick", "none")
    found = Contact(data["on"], tool_of(data["tool"]), "stick" if words else friction, direction=direction, **options)
    found.friction = friction
    return found
