"""Division of a sheet into elements: thickness of the layers, grading along the sheet, rows of nodes through it."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..errors import InputError, count, finite, positive

MAX_RECTANGLES = 250_000   # largest number of rectangles of a mesh

Thickness = float | Callable[[float], float] | Mapping[float, float]
"""Thickness of a layer: a length, a function of the coordinate along the sheet, or a table {coordinate: length}."""


def layer_thicknesses(kind: str, thickness: Any, alone: str, coordinate: str) -> dict[str, Callable]:
    """Return {layer: function of coordinates (n,), that returns its thickness, shape (n,), length}.

    `thickness`: length, function, table or {layer: such} over the coordinate "R", "Z", or "" for constant ones.
    """
    named = isinstance(thickness, Mapping) and all(isinstance(name, str) for name in thickness)
    layers = dict(thickness) if named else {alone: thickness}
    if not layers:
        raise InputError(f"{kind}: thickness = {{}}: must name at least one layer")
    return {name: _thickness(f"{kind}: thickness of {name!r}", given, coordinate) for name, given in layers.items()}


def _thickness(caller: str, given: Any, coordinate: str) -> Callable[[np.ndarray], np.ndarray]:
    """Return the thickness of a layer as a function of coordinates, shape (n,), with values of this shape, length.

    `given`: length, function or table {coordinate: length}. A value missing or not positive is an InputError.
    """
    if not coordinate or not (callable(given) or isinstance(given, Mapping)):
        value = positive(caller, given)
        return lambda x: np.full(len(x), value)
    if callable(given):
        return lambda x: np.array([positive(f"{caller} at {coordinate} = {v:.6g}",
                                            _call(given, v, caller, coordinate))
                                   for v in map(float, x)])
    points = sorted((finite(f"{caller}: {coordinate}", x_value), positive(f"{caller} at {coordinate} = {x_value!r}", h))
                    for x_value, h in given.items())
    ends, values = np.array(points).reshape(-1, 2).T

    def between(x):
        tolerance = 1e-9 * max(np.abs(x).max(), 1e-300)
        if len(ends) < 2 or x.min() < ends[0] - tolerance or x.max() > ends[-1] + tolerance:
            raise InputError(f"{caller} = {given!r}: must cover {coordinate} from {x.min():.6g} to {x.max():.6g}")
        return np.interp(x, ends, values)
    return between


def _call(function: Callable, v: float, caller: str, coordinate: str) -> Any:
    """Return the thickness by a user's function at `v`; its error is an InputError with the coordinate."""
    try:
        return function(v)
    except Exception as error:
        raise InputError(f"{caller} at {coordinate} = {v:.6g}: the function raised {type(error).__name__}:"
                         f" {error}") from error


def checked_grading(kind: str, grading: Any) -> float:
    """Return the size of the last over the first element as a float from 1e-6 to 1e6, else an InputError."""
    grading = positive(f"{kind}: grading", grading)
    if not 1e-6 <= grading <= 1e6:
        raise InputError(f"{kind}: grading = {grading!r}: must be from 1e-6 to 1e6")
    return grading


def divisions(kind: str, along_what: str, elements: Any, layers: int) -> tuple[int, list[np.ndarray]]:
    """Return the number of elements along a sheet, and the ends of the elements through each layer on [0, 1].

    `elements` is (number, division), where the division is a number for all layers, or a number or relative sizes for
    each. Another form or too many elements are an InputError.
    """
    if not is_sequence(elements) or len(elements) != 2:
        raise InputError(f"{kind}: elements = {elements!r}: must be (along the {along_what}, through each layer)")
    along = count(f"{kind}: elements along the {along_what}", elements[0])
    if isinstance(elements[1], Mapping):
        raise InputError(f"{kind}: elements through the layers = {elements[1]!r}: must be a number, or a list with an"
                         f" entry for each layer, from the bottom up")
    through = list(elements[1]) if is_sequence(elements[1]) else [elements[1]] * layers
    if layers == 1 and len(through) > 1:
        through = [through]
    if len(through) != layers:
        raise InputError(f"{kind}: elements through the layers = {through!r}: {layers} layers need as many counts")
    ends = [_layer_ends(kind, given) for given in through]
    rectangles = along * sum(len(found) - 1 for found in ends)
    if rectangles > MAX_RECTANGLES:
        raise InputError(f"{kind}: elements = {elements!r}: {rectangles} rectangles: at most {MAX_RECTANGLES}")
    return along, ends


def _layer_ends(kind: str, given: Any) -> np.ndarray:
    """Return the ends (n + 1,) of elements through a layer on [0, 1] by number or positive relative sizes."""
    if not is_sequence(given):
        n = count(f"{kind}: elements through a layer", given)
        if n > MAX_RECTANGLES:
            raise InputError(f"{kind}: elements through a layer = {given!r}: must be at most {MAX_RECTANGLES}")
        return np.linspace(0.0, 1.0, n + 1)
    sizes = np.array([positive(f"{kind}: relative size of an element through a layer", size) for size in given])
    if not len(sizes) or sizes.max() > 1e6 * sizes.min():
        raise InputError(f"{kind}: relative sizes of elements through a layer = {given!r}: must be at least one, the"
                         f" largest at most 1e6 times the smallest")
    ends = np.concatenate([[0.0], np.cumsum(sizes / sizes.max())])
    return ends / ends[-1]


def is_sequence(values: Any) -> bool:
    """Return True for a list, a tuple or a one-dimensional array."""
    return isinstance(values, tuple | list) or isinstance(values, np.ndarray) and values.ndim == 1


def graded_ends(along: int, grading: float) -> np.ndarray:
    """Return the ends (n + 1,) of n elements on [0, 1] whose sizes are in proportion to grading^(i/(n - 1))."""
    sizes = grading ** (np.arange(along) / max(along - 1, 1))
    ends = np.concatenate([[0.0], np.cumsum(sizes)])
    return ends / ends[-1]


def with_middles(joints: np.ndarray) -> np.ndarray:
    """Return n + 1 ends of elements, the array `joints`, and the n middles between them in order, shape (2 n + 1,)."""
    points = np.empty(2 * len(joints) - 1)
    points[::2], points[1::2] = joints, (joints[1:] + joints[:-1]) / 2
    return points


def levels(layers: Mapping[str, Callable], through: list[np.ndarray], coordinates: np.ndarray) -> np.ndarray:
    """Return distances (rows, n), length, of rows at ends and middles of elements from the first face."""
    rows = [np.zeros(len(coordinates))]
    for thickness_at, ends in zip(layers.values(), through):
        h, base = thickness_at(coordinates), rows[-1]
        rows += [base + h * fraction for fraction in with_middles(ends)[1:]]
    return np.array(rows)
