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
        """Return the tooling of a scene that is given as plain data.

        Args:
            scene: plain data of the scene, with lists of "contacts", "loads" and "supports", and the entry "mesh".

        Returns:
            The tooling.
        """
        return cls([_contact(dict(data)) for data in scene["contacts"]], len(scene["loads"]) + len(scene["supports"]),
                   scene["mesh"]["length"])

    @property
    def names(self) -> list[str]:
        """Name of the tool of each contact, in the order of the contacts.

        A tool without a name is called "tool 1", "tool 2", ..., by the number of its contact. Unnamed tools with the
        same direction of motion count as one tool: they all have the name of the first of them.
        """
        first: dict[Any, int] = {}
        alike = [k if c.direction is None else c.direction for k, c in enumerate(self.contacts)]
        return [c.name or f"tool {first.setdefault(alike[k], k) + 1}" for k, c in enumerate(self.contacts)]

    @property
    def force_columns(self) -> dict[str, str]:
        """Column name of the contact force on each tool, {tool name: column}.

        The force on the only tool is in "tool_force". Of several tools, the force on "plug" is in "plug_force", and
        the force on "tool 1", which has no name, in "tool_1_force".
        """
        names = self.names
        if len(set(names)) == 1:
            return {names[0]: "tool_force"}
        return {name: f"{c.name or name.replace(' ', '_')}_force" for name, c in zip(names, self.contacts)}

    def travels(self, setting: dict[str, Any], control: float) -> list[float | None]:
        """Return the travel of each tool in a state.

        Args:
            setting: step data of the state, as plain data of a `StepData`; empty for the reference configuration.
            control: load parameter (control) of the state, dimensionless.

        Returns:
            Travel of each tool along its direction of motion, length; None for an inactive tool.
        """
        if not setting:
            return [0.0] * len(self.contacts)
        step_data = StepData(**setting)
        return [None if i in step_data.inactive else self.length * step_data.amplitude(i, control)
                for i in range(self.first, self.first + len(self.contacts))]

    def placed(self, travels: list[float | None]) -> list[tuple[Tool, np.ndarray]]:
        """Return the active tools with their displacements.

        Args:
            travels: travel of each tool, length; None for an inactive tool.

        Returns:
            For each active tool the tool and its displacement (r, z), shape (2,), length.
        """
        return [(contact.tool, travel * contact.travel_vector)
                for contact, travel in zip(self.contacts, travels, strict=True) if travel is not None]


_three_dimensional: list[Callable[[dict[str, Any]], Any]] = []


def register_tools(make: Callable[[dict[str, Any]], Any]) -> None:
    """Register the function that makes tools in three dimensions; the extension 'space' calls this function.

    Args:
        make: function that maps the plain data of a tool to the tool.
    """
    _three_dimensional[:] = [make]


def tool_of(shape: dict[str, Any]) -> Any:
    """Return the tool that is described by plain data.

    Args:
        shape: plain data of the tool. A tool in a section has the entries "pieces", lists of the values of a `Line` or
            an `Arc`, and "closed". A tool in three dimensions has other entries.

    Returns:
        The tool.

    Raises:
        InputError: the tool is three-dimensional, and `formingx.extensions.space` is not installed.
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
    """Return the `Contact` that plain data describe, {name of an attribute: its value}."""
    direction = data["direction"] and tuple(data["direction"])
    names = ("penalty", "ramp", "elastic_slip", "separates", "nodes_per_step", "points", "name")
    options = {name: data[name] for name in names if name in data}
    friction = data["friction"]
    if isinstance(friction, dict):                          # a function of the temperature is stored as plain data
        friction = repr(table(dict(zip(friction["x"], friction["y"])))) if "x" in friction else str(friction)
    words = isinstance(friction, str) and friction not in ("stick", "none")
    found = Contact(data["on"], tool_of(data["tool"]), "stick" if words else friction, direction=direction, **options)
    found.friction = friction
    return found
