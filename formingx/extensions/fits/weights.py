"""Weights of measured stresses in a fit."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, instance, non_negative, pair, several

_LEAST = 0.02
"""Smallest divisor of a relative misfit, over the largest stress of its test."""


def scales(parts: list[np.ndarray], relative: Any, weights: list[float]) -> np.ndarray:
    """Return the size by which each misfit is divided, shape (n,), stress, for stresses test by test."""
    relative = instance("fit: relative", relative, bool, "True or False")
    largest = max((float(np.abs(P).max()) for P in parts if len(P)), default=1.0) or 1.0
    found = []
    for P, weight in zip(parts, weights):
        own = float(np.abs(P).max(initial=0.0)) or largest
        size = np.maximum(np.abs(P), _LEAST * own) if relative else np.full(len(P), largest)
        found.append(size / np.sqrt(weight))
    return np.concatenate(found)


def of_names(weights: Any, names: list[str]) -> list[float]:
    """Return the weight of each test of a dictionary; a test that is not named has 1."""
    if weights is None:
        return [1.0] * len(names)
    if not isinstance(weights, dict):
        raise InputError(f"fit: weights = {weights!r}: must be {{test: weight}}, such as {{'equibiaxial': 2.0}}")
    for name in weights:
        if name not in names:
            raise InputError(f"fit: weights: {name!r}: the data have no such test, they have {', '.join(names)}")
    return [_weight(f"fit: weights[{name!r}]", weights.get(name, 1.0)) for name in names]


def of_numbers(weights: Any, count: int) -> list[float]:
    """Return the weight of each of the numbered tests in time; None: 1."""
    if weights is None:
        return [1.0] * count
    given = several("fit: weights", weights, "numbers, one for each test")
    if len(given) != count:
        raise InputError(f"fit: weights: {len(given)} given: must be one for each of the {count} tests")
    return [_weight(f"fit: weights: number {k}", value) for k, value in enumerate(given, 1)]


def _weight(name: str, value: Any) -> float:
    if not (found := non_negative(name, value)) > 0:
        raise InputError(f"{name} = {value!r}: must be above 0; leave the test out instead")
    return found


def in_range(within: Any, stretches: np.ndarray) -> np.ndarray:
    """Return the mask of the stretches, any shape, that lie within (lowest, highest); None: all."""
    if within is None:
        return np.ones(np.shape(stretches), dtype=bool)
    low, high = pair("fit: within", within)
    if not 0 <= low < high:
        raise InputError(f"fit: within = {within!r}: must be (lowest, highest) stretch, the first below the second")
    return (stretches >= low) & (stretches <= high)
