"""Common base class of the items of a scene: loads, supports and contacts."""

from __future__ import annotations

from typing import Any


class Part:
    """Load, support or contact of a scene; each kind overrides some of the defaults.

    Attributes:
        name: name in stages of a process and in columns of results, or None.
        on: boundary on which it acts, or None.
        driven: True if its quantity is the control (load parameter) of a run.
        quantity: controlled quantity, such as "pressure" or "travel", or None.
        symmetric: True if its part of the tangent is symmetric.
        direction: motion per unit of travel, (r, z) or (x, y, z); None if it does not move as a whole.
        holds_rotation: True if it also constrains the rotation.
        described: names of attributes that `repr` shows as text, whose numbers a summary of the scene leaves out.
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
        """Return the constraints that it imposes.

        Returns:
            List of `Constrained` and `ConstrainedMean`.
        """
        return []
