"""The errors that formingx raises, and the checks that raise them."""

from __future__ import annotations

import math
from typing import Any


class InputError(ValueError):
    """Something that the user gave is not allowed: the message names it, its value and what is allowed."""


class ConvergenceError(RuntimeError):
    """A run could not go on.

    Attributes:
        path: what was computed up to there (`formingx.Path`), its last state converged; or None.
        diagnosis: why, in numbers and words, and as a picture (`formingx.results.diagnosis.Diagnosis`); or None.
    """

    def __init__(self, message: str, path: Any = None, diagnosis: Any = None):
        super().__init__(f"{message}\n{diagnosis}" if diagnosis is not None else message)
        self.path, self.diagnosis = path, diagnosis


def positive(name: str, value: Any) -> float:
    """`value` as a float, or an InputError unless it is finite and greater than 0."""
    number = finite(name, value)
    if number <= 0:
        raise InputError(f"{name} = {value!r}: must be greater than 0")
    return number


def non_negative(name: str, value: Any) -> float:
    """`value` as a float, or an InputError unless it is finite and at least 0."""
    number = finite(name, value)
    if number < 0:
        raise InputError(f"{name} = {value!r}: must not be negative")
    return number


def finite(name: str, value: Any) -> float:
    """`value` as a float, or an InputError unless it is a finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r}: must be a number") from None
    if not math.isfinite(number) or isinstance(value, bool):
        raise InputError(f"{name} = {value!r}: must be a finite number")
    return number


def count(name: str, value: Any) -> int:
    """`value` as an int, or an InputError unless it is a whole number of at least 1."""
    number = finite(name, value)
    if number != int(number) or number < 1:
        raise InputError(f"{name} = {value!r}: must be a whole number of at least 1")
    return int(number)


def known(kind: str, name: Any, names: Any) -> None:
    """An InputError that lists the known names unless `name` is one of them."""
    if name not in names:
        raise InputError(f"{kind} {name!r} is not known; known: {', '.join(map(repr, names)) or 'none'}")
