"""Design parameters: single numbers, and profiles along the body, given by their values at knots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InputError, as_list, check_type, count, finite


class Knots:
    """A function of a length from 0 to 1, given by its values at k equidistant knots, shape (k,).

    Their lengths are `coordinates`. It is a cubic spline if `smooth`, else straight in between. Lengths outside 0 to 1
    count as the nearest end, below -1 or above 2 they are an InputError: they were not divided by the length of the
    body.
    """

    def __init__(self, values: Any, smooth: bool = False):
        self.values, self.smooth = np.array(values, dtype=float), smooth
        self.coordinates = np.linspace(0.0, 1.0, len(self.values))

    def __call__(self, s: Any) -> Any:
        far = np.abs(np.subtract(s, 0.5)) > 1.5
        if np.any(far):
            raise InputError(f"spline: the profile was called with {np.asarray(s)[far].flat[0]:.4g}: must be a length"
                             f" from 0 to 1; divide by the length of the body, as in thickness=lambda R: wall(R / 60.0)"
                             f" for a sheet of radius 60")
        s = np.clip(s, 0.0, 1.0)
        return self._spline(s) if self.smooth else np.interp(s, self.coordinates, self.values)

    @cached_property
    def _spline(self) -> Any:
        """Cubic spline through the values at the knots."""
        from scipy.interpolate import CubicSpline
        return CubicSpline(self.coordinates, self.values)

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, k: Any) -> Any:
        return self.values[k]

    def __repr__(self) -> str:
        return f"Knots({np.array2string(self.values, precision=4, threshold=20)})"


@dataclass(frozen=True)
class Spline:
    """Start values and bounds of a design parameter: of a profile with k knots, or of a single number (k = 1).

    Attributes:
        start: start values at the knots, shape (k,).
        low: lower bound of all values.
        high: upper bound of all values.
        smooth: True for a cubic spline through the knots, False for straight lines between them.
        profile: True for a profile, False for a single number.
    """

    start: np.ndarray
    low: float
    high: float
    smooth: bool = False
    profile: bool = True


def spline(knots: int, start: Any, low: float = -np.inf, high: float = np.inf, smooth: bool = False) -> Spline:
    """Return a design parameter that is a profile of thickness, temperature or a material constant.

    The function that builds the scene receives the profile as a function (`Knots`) of a length from 0 to 1. For a sheet
    of radius 60 its thickness is `lambda R: wall(R / 60)`.

    Args:
        knots: number k of equidistant knots, 2 or more; with `smooth` 4 or more.
        start: start value of all knots, or one for each knot, shape (k,).
        low: lower bound of the values at all knots.
        high: upper bound of the values at all knots.
        smooth: True for a cubic spline through the knots, False for straight lines between them.

    Returns:
        The parameter, for `Design`.

    Raises:
        InputError: too few knots, another number of start values, bounds in the wrong order, or a start value beyond a
            bound.

    >>> fx.spline(3, start=2.0, low=1.0).start.tolist()
    [2.0, 2.0, 2.0]
    """
    required = 4 if check_type("spline: smooth", smooth, bool, "True or False") else 2
    if count("spline: knots", knots) < required:
        raise InputError(f"spline: knots = {knots}: must be at least {required}")
    values = [start] * knots if np.ndim(start) == 0 else as_list("spline: start", start, "numbers")
    if len(values) != knots:
        raise InputError(f"spline: start has {len(values)} numbers: must be one for each of {knots} knots")
    starts = np.array([finite("spline: start", v) for v in values])
    _check_bounds("spline", starts, low, high)
    return Spline(starts, float(low), float(high), smooth)


class Parameters:
    """Parameters of a design as a vector of n numbers.

    A parameter that is a number has one entry, a profile has an entry for each knot.

    Attributes:
        names: names of the entries, such as "travel" or "wall[3]".
        start: start values, shape (n,).
        low: lower bounds, shape (n,).
        high: upper bounds, shape (n,).
        size: size of each entry that scales its changes, shape (n,): its range if it has two bounds, else the magnitude
            of its start value, or 1 if that is 0.
    """

    def __init__(self, given: Mapping[str, Any]):
        if not isinstance(given, Mapping) or not given:
            raise InputError("Design: parameters: must be {name: (start, low, high) or fx.spline(...)}, at least one")
        self._given: dict[str, Spline] = {}
        self.names: list[str] = []
        for name, entry in given.items():
            if not isinstance(name, str):
                raise InputError(f"Design: parameter {name!r}: must be a name")
            self._given[name] = entry = entry if isinstance(entry, Spline) else _number(name, entry)
            self.names += [f"{name}[{k}]" for k in range(len(entry.start))] if entry.profile else [name]
        all_of = list(self._given.values())
        self.start = np.concatenate([entry.start for entry in all_of])
        self.low = np.concatenate([np.full(len(entry.start), entry.low) for entry in all_of])
        self.high = np.concatenate([np.full(len(entry.start), entry.high) for entry in all_of])
        width = self.high - self.low
        self.size = np.where(np.isfinite(width) & (width > 0), width, np.where(self.start != 0, abs(self.start), 1.0))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def profiles(self) -> dict[str, tuple[float, float]]:
        """Bounds of the parameters that are profiles: {parameter: (lower, upper)}."""
        return {name: (entry.low, entry.high) for name, entry in self._given.items() if entry.profile}

    def values(self, vector: np.ndarray) -> dict[str, Any]:
        """Return {parameter: number or `Knots`}, arguments of the user's function, of a vector, shape (n,)."""
        parts = np.split(vector, np.cumsum([len(entry.start) for entry in self._given.values()])[:-1])
        return {name: Knots(part, entry.smooth) if entry.profile else float(part[0])
                for (name, entry), part in zip(self._given.items(), parts)}

    def vector(self, values: Mapping[str, Any]) -> np.ndarray:
        """Return the vector, shape (n,), for {parameter: number, values at the knots, or `Knots`}.

        Other parameters have their start values. An unknown name or a wrong number of values is an InputError.
        """
        found, first = self.start.copy(), 0
        for name in values:
            if name not in self._given:
                raise InputError(f"Design: parameter {name!r} is not known; known: {', '.join(self._given)}")
        for name, entry in self._given.items():
            n = len(entry.start)
            if name in values:
                given = values[name]
                given = given.values if isinstance(given, Knots) else np.atleast_1d(given)
                if given.shape not in ((n,), (1,)):
                    raise InputError(f"Design: {name} = {values[name]!r}: must be {n} number{'s' * (n > 1)}")
                given = [finite(f"Design: {name}", number) for number in given.tolist()]
                found[first: first + n] = given
            first += n
        return found


def _number(name: str, given: Any) -> Spline:
    """Return the start value, or (start, lower bound, upper bound), of a number as a `Spline` with one knot."""
    parts: Sequence[Any] = (given, -np.inf, np.inf) if np.ndim(given) == 0 else tuple(given)
    if len(parts) != 3:
        raise InputError(f"Design: {name} = {given!r}: must be a number, (start, low, high) or fx.spline(...)")
    start = np.array([finite(f"Design: {name}: start", parts[0])])
    _check_bounds(f"Design: {name}", start, parts[1], parts[2])
    return Spline(start, float(parts[1]), float(parts[2]), profile=False)


def _check_bounds(caller: str, start: np.ndarray, low: Any, high: Any) -> None:
    """Raise an InputError unless start values, shape (k,), lie between the bounds, and `low` is below `high`."""
    try:
        low, high = float(low), float(high)
    except (TypeError, ValueError):
        raise InputError(f"{caller}: low = {low!r}, high = {high!r}: must be numbers") from None
    if not low < high:
        raise InputError(f"{caller}: low = {low:g}, high = {high:g}: the first must be below the second")
    if not np.all((start >= low) & (start <= high)):
        raise InputError(f"{caller}: start = {start if len(start) > 1 else start[0]}: must be from {low:g} to {high:g}")
