"""Weights of the measured stresses in a fit, and the stresses by which misfits are divided."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, as_list, check_type, non_negative, pair

MIN_DIVISOR = 0.02
"""Smallest divisor of a relative misfit, over the largest stress of its test."""


def divisors(parts: list[np.ndarray], relative: Any, weights: list[float], floors: list[float] | None = None
             ) -> np.ndarray:
    """Return the stress by which the misfit of each measured stress is divided, shape (n,).

    `relative` takes the stress itself, at least its test's largest times the floor (default 0.02), otherwise the
    largest of all; weights divide by their root. Neither True nor False is an InputError.
    """
    relative = check_type("fit: relative", relative, bool, "True or False")
    largest = max((float(np.abs(P).max()) for P in parts if len(P)), default=1.0) or 1.0
    found = []
    for P, weight, floor in zip(parts, weights, floors or [MIN_DIVISOR] * len(parts)):
        own = float(np.abs(P).max(initial=0.0)) or largest
        size = np.maximum(np.abs(P), floor * own) if relative else np.full(len(P), largest)
        found.append(size / np.sqrt(weight))
    return np.concatenate(found)


def named_weights(weights: Any, names: list[str]) -> list[float]:
    """Return weights of tests in the order of names, default 1; unknown or not positive ones are an InputError."""
    if weights is None:
        return [1.0] * len(names)
    if not isinstance(weights, dict):
        raise InputError(f"fit: weights = {weights!r}: must be {{test: weight}}, such as {{'equibiaxial': 2.0}}")
    for name in weights:
        if name not in names:
            raise InputError(f"fit: weights: {name!r}: the data have no such test, they have {', '.join(names)}")
    return [_weight(f"fit: weights[{name!r}]", weights.get(name, 1.0)) for name in names]


def numbered_weights(weights: Any, count: int) -> list[float]:
    """Return the positive weights of `count` tests in time, None: all 1; others are an InputError."""
    if weights is None:
        return [1.0] * count
    given = as_list("fit: weights", weights, "numbers, one for each test")
    if len(given) != count:
        raise InputError(f"fit: weights: {len(given)} given: must be one for each of the {count} tests")
    return [_weight(f"fit: weights: number {k}", value) for k, value in enumerate(given, 1)]


def _weight(name: str, value: Any) -> float:
    """Return a weight as a number; raise an InputError unless it is positive."""
    if not (found := non_negative(name, value)) > 0:
        raise InputError(f"{name} = {value!r}: must be above 0; leave the test out instead")
    return found


def in_range(within: Any, stretches: np.ndarray) -> np.ndarray:
    """Return the mask of stretches, any shape, within an ascending pair (else an InputError); None for all."""
    if within is None:
        return np.ones(np.shape(stretches), dtype=bool)
    low, high = pair("fit: within", within)
    if not 0 <= low < high:
        raise InputError(f"fit: within = {within!r}: must be (lowest, highest) stretch, the first below the second")
    return (stretches >= low) & (stretches <= high)
