"""Common base class of the items of a scene: loads, supports and contacts."""

from __future__ import annotations

from typing import Any


class Part:
    """Base class of the items of a scene: loads, supports and contacts. Each kind overrides some of the defaults.

    Attributes:
        name: name of the item in stages of a process and in columns of results, or None.
        on: name of the boundary on which the item acts, or None.
        driven: True if the run controls the `quantity` of the item.
        quantity: quantity of the item that a run can control, such as "pressure" or "travel", or None.
        symmetric: True if the contribution of the item to the tangent is symmetric.
        direction: motion of a tool per unit of travel, (r, z) or (x, y, z); None for items that are no moving tool.
        holds_rotation: True if a support also constrains the rotation of its boundary.
        described: names of attributes that `repr` shows as text; a summary of the scene leaves their numbers out.
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
        """Return the constraints that the item imposes on the displacement; by default none.

        Returns:
            List of `formingx.physics.supports.Constrained` and `formingx.physics.supports.ConstrainedMean`.
        """
        return []
