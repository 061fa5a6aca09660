"""Checks of the arguments `friction`, `points` and `nodes_per_step` of a `Contact`."""

import math
from typing import Any

from ..errors import InputError, count, non_negative, positive
from ..values.table import Table
from ..values.temperature import FunctionOfTemperature

MAX_DEGREE = 30
"""Largest degree of a quadrature rule: higher degrees are mistakes, and their points would fill the memory."""

_MAX_POINTS = 100
"""Largest number of Gauss points on a facet. A ring that rolls on a compliant plate needs 16."""


def coefficient(name: str, friction: Any) -> Any:
    """Return the argument `friction` as a number (infinite: "stick", 0: "none") or a function of temperature.

    Raise `InputError` if it is not "stick", "none", a number from 0, a `Table` or a `FunctionOfTemperature`.
    """
    words = {"none": 0.0, "stick": math.inf}
    if isinstance(friction, str) and friction in words:
        return words[friction]
    if isinstance(friction, Table):
        non_negative(f"{name} = {friction!r}: its smallest value", float(friction.y.min()))   # monotone between points
        return FunctionOfTemperature(friction)
    if isinstance(friction, FunctionOfTemperature):
        return friction
    if isinstance(friction, str) or callable(friction):
        raise InputError(f"{name} = {friction!r}: must be 'stick', 'none' or a coefficient of friction: a number"
                         f" or, by temperature, table({{T: mu, ...}}) or of_temperature(f)")
    return non_negative(name, friction)


def closures(name: str, nodes: Any) -> int | float | None:
    """Return `nodes_per_step`, None, a number from 1 or a share below 1 of a face's nodes, else an InputError."""
    if nodes is None:
        return None
    return float(nodes) if positive(name, nodes) < 1 else count(name, nodes)


def contact_points(name: str, points: Any) -> str | int:
    """Return `points`, "nodes" or a number of Gauss points per facet from 1 to 100; else raise `InputError`."""
    if isinstance(points, str) and points == "nodes":
        return points
    number = count(name, points)
    if number > _MAX_POINTS:
        raise InputError(f"{name} = {points!r}: must be at most {_MAX_POINTS} on a facet")
    return number
