"""Common base of loads, supports and contacts: the items of a scene."""

from __future__ import annotations

from typing import Any


class Part:
    """A load, a support or a contact of a scene; each kind overrides the defaults that are wrong for it.

    Attributes:
        name: its name in a process and in its columns; None: it has no name.
        on: the boundary that it acts on; None: it acts on none.
        driven: True if the run controls it.
        quantity: its controlled quantity, such as "pressure" or "travel"; None: it has none.
        symmetric: True if its part of the tangent is symmetric.
        direction: its motion per unit of travel, (r, z) or (x, y, z); None: it does not move as a whole.
        holds_rotation: True if it also constrains the rotation.
        told: attributes that its repr shows as text: a summary leaves out their numbers.
    """

    name: str | None = None
    on: str | None = None
    driven: Any = False
    quantity: str | None = None
    symmetric: Any = False
    direction: tuple[float, float] | None = None
    holds_rotation = False
    told: tuple[str, ...] = ()

    def constraints(self) -> list[Any]:
        """Return the constraints: a list of `Constrained` or `ConstrainedMean`."""
        return []
