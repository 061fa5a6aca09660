"""The tools of a scene and where they stand in its states: for pictures and tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..forms.schedule import StepData
from ..physics.contact import Contact
from ..tools.shapes import Arc, Line, Tool


class Tooling(NamedTuple):
    """All contacts of a scene.

    Attributes:
        contacts: in the order of the scene.
        before: number of items of the scene before the contacts (`Scene.items`).
        length: length scale of the forms of a problem: travel over amplitude, length.
    """

    contacts: list[Contact]
    before: int
    length: float

    @classmethod
    def of_problem(cls, problem: Any) -> Tooling:
        """Return the tools of a `Problem`."""
        scene = problem.scene
        return cls(scene.contacts, len(scene.loads) + len(scene.supports), problem.forms.length)

    @classmethod
    def of_description(cls, scene: dict[str, Any]) -> Tooling:
        """Return the tools of a scene as plain data (`description.describe`)."""
        return cls([_contact(dict(data)) for data in scene["contacts"]], len(scene["loads"]) + len(scene["supports"]),
                   scene["mesh"]["length"])

    @property
    def names(self) -> list[str]:
        """Name of the tool of each contact; one without a name is "tool 1" and so on, by its (first) contact."""
        first: dict[Any, int] = {}
        # tools with one motion are one
        alike = [k if c.direction is None else c.direction for k, c in enumerate(self.contacts)]
        return [c.name or f"tool {first.setdefault(alike[k], k) + 1}" for k, c in enumerate(self.contacts)]

    @property
    def force_columns(self) -> dict[str, str]:
        """{tool: the column of its force}: "tool_force" of the only one, else "plug_force" of one named "plug"."""
        names = list(dict.fromkeys(self.names))
        return {name: "tool_force" if len(names) == 1 else f"{name}_force".replace(" ", "_") for name in names}

    def travels(self, setting: dict[str, Any], control: float) -> list[float | None]:
        """Return the travel of each tool (length) for these step data and control; None: the tool is inactive."""
        if not setting:
            return [0.0] * len(self.contacts)
        there = StepData(**setting)
        return [None if i in there.inactive else self.length * there.amplitude(i, control)
                for i in range(self.before, self.before + len(self.contacts))]

    def placed(self, travels: list[float | None]) -> list[tuple[Tool, np.ndarray]]:
        """(tool, its shift (r, z)) of the active tools."""
        return [(contact.tool, travel * contact.way)
                for contact, travel in zip(self.contacts, travels, strict=True) if travel is not None]


_three_dimensional: list[Callable[[dict[str, Any]], Any]] = []


def register_tools(make: Callable[[dict[str, Any]], Any]) -> None:
    """Provide the function that makes a tool in three dimensions from its plain data."""
    _three_dimensional[:] = [make]


def tool_of(shape: dict[str, Any]) -> Any:
    """Return the tool of plain data (`description.describe`).

    Raises:
        InputError: the tool is three-dimensional, and the extension is not installed.
    """
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
    direction = data["direction"] and tuple(data["direction"])
    names = ("penalty", "ramp", "elastic_slip", "separates", "nodes_per_step", "points", "name")
    more = {name: data[name] for name in names if name in data}
    words = isinstance(data["friction"], str) and data["friction"] not in ("stick", "none")
    found = Contact(data["on"], tool_of(data["tool"]), "stick" if words else data["friction"], direction=direction,
                    **more)
    found.friction = data["friction"]                       # a function of the temperature is stored as text
    return found
