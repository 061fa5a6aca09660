"""Weights of measured stresses in a fit."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, instance, non_negative, pair, several

_LEAST = 0.02
"""Smallest divisor of a relative misfit, over the largest stress of its test."""


def scales(parts: list[np.ndarray], relative: Any, weights: list[float]) -> np.ndarray:
    """Return the stress by which each misfit is divided, test by test.

    Args:
        parts: measured stresses of each test.
        relative: see `fit`.
        weights: weight of each test.

    Returns:
        Divisors, shape (n,), stress.
    """
    relative = instance("fit: relative", relative, bool, "True or False")
    largest = max((float(np.abs(P).max()) for P in parts if len(P)), default=1.0) or 1.0
    found = []
    for P, weight in zip(parts, weights):
        own = float(np.abs(P).max(initial=0.0)) or largest
        size = np.maximum(np.abs(P), _LEAST * own) if relative else np.full(len(P), largest)
        found.append(size / np.sqrt(weight))
    return np.concatenate(found)


def of_names(weights: Any, names: list[str]) -> list[float]:
    """Return the weights of named tests; the default is 1.

    Args:
        weights: {test: weight}, or None.
        names: names of the tests.

    Returns:
        Weight of each test.

    Raises:
        InputError: an unknown test, or a weight that is not positive.
    """
    if weights is None:
        return [1.0] * len(names)
    if not isinstance(weights, dict):
        raise InputError(f"fit: weights = {weights!r}: must be {{test: weight}}, such as {{'equibiaxial': 2.0}}")
    for name in weights:
        if name not in names:
            raise InputError(f"fit: weights: {name!r}: the data have no such test, they have {', '.join(names)}")
    return [_weight(f"fit: weights[{name!r}]", weights.get(name, 1.0)) for name in names]


def of_numbers(weights: Any, count: int) -> list[float]:
    """Return the weights of numbered tests; the default is 1.

    Args:
        weights: list of weights, or None.
        count: number of tests.

    Returns:
        Weight of each test.

    Raises:
        InputError: another number of weights, or a weight that is not positive.
    """
    if weights is None:
        return [1.0] * count
    given = several("fit: weights", weights, "numbers, one for each test")
    if len(given) != count:
        raise InputError(f"fit: weights: {len(given)} given: must be one for each of the {count} tests")
    return [_weight(f"fit: weights: number {k}", value) for k, value in enumerate(given, 1)]


def _weight(name: str, value: Any) -> float:
    """Return a weight; raise an InputError unless it is positive."""
    if not (found := non_negative(name, value)) > 0:
        raise InputError(f"{name} = {value!r}: must be above 0; leave the test out instead")
    return found


def in_range(within: Any, stretches: np.ndarray) -> np.ndarray:
    """Return the mask of the stretches within a range.

    Args:
        within: (lowest, highest), or None for all.
        stretches: stretches, any shape.

    Returns:
        Mask, the same shape.

    Raises:
        InputError: `within` is no range.
    """
    if within is None:
        return np.ones(np.shape(stretches), dtype=bool)
    low, high = pair("fit: within", within)
    if not 0 <= low < high:
        raise InputError(f"fit: within = {within!r}: must be (lowest, highest) stretch, the first below the second")
    return (stretches >= low) & (stretches <= high)
