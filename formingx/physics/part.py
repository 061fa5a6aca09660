"""Common base class of the items of a scene: loads, supports and contacts."""

from __future__ import annotations

from typing import Any


class ScenePart:
    """Base class of loads, supports and contacts, the items of a model declaration (`Scene`).

    Attributes:
        name: name of the item in the stages of a `Process` and in the column names of results, or None.
        on: name of the boundary on which the item acts, or None.
        driven: True if the `quantity` of the item is a load parameter (control) of the run.
        quantity: quantity of the item that can be a load parameter, such as "pressure" or "travel", or None.
        symmetric: True if the contribution of the item to the tangent is symmetric.
        direction: motion of a tool per unit of travel, (r, z) or (x, y, z); None except for moving tools.
        holds_rotation: True if a support also constrains the rotation of its boundary.
        described: names of attributes whose values `repr` shows as text, such as the friction. A summary of the scene
            does not show their numbers once more.
    """

    name: str | None = None
    on: str | None = None
    driven: Any = False
    quantity: str | None = None
    symmetric: Any = False
    direction: tuple[float, float] | None = None
    holds_rotation = False
    described: tuple[str, ...] = ()

    def constraints(self) -> list[Any]:
        """Return the constraints that a support imposes on the displacement; none for loads and contacts.

        Returns:
            List of `formingx.physics.supports.Constrained` and `formingx.physics.supports.ConstrainedMean`.
        """
        return []
