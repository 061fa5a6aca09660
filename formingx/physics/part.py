"""Common base of loads, supports and contacts: the items of a scene."""

from __future__ import annotations

from typing import Any


class Part:
    """A load, a support or a contact of a scene; each kind overrides what does not hold for it.

    Attributes:
        name: its name in a process and in its columns; None: it has no name.
        on: the boundary that it acts on; None: it acts on none.
        driven: True if the run controls it.
        quantity: what a run controls of it, e.g. "pressure" or "travel"; None: nothing.
        symmetric: True if its part of the tangent is symmetric.
        direction: (r, z) of its motion per unit of travel; None: it does not move as a whole.
        holds_rotation: True if it holds the rotation of what it holds.
        told: attributes of which its repr tells as text; a summary leaves their numbers out.
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
        """Return the constraints: a list of `Held` or `MeanHeld`."""
        return []
