"""Errors of formingx, and checks of arguments that raise them."""

import math
import os
import sys
from collections.abc import Callable, Hashable, Iterable, Mapping
from numbers import Complex, Real
from pathlib import Path
from typing import Any

import numpy as np

from ._interrupts import OneLine


class InputError(ValueError):
    """Argument that is not allowed; the message gives its name, its value and the allowed values.

    Attributes:
        path: path computed so far, if a process refuses a stage during a run; else None.

    >>> fx.NeoHookean(c10=-1.0)
    Traceback (most recent call last):
    formingx.errors.InputError: NeoHookean(c10=-1.0) has no stiffness: its initial shear modulus is -2, must be positive
    """

    path: Any = None


class ConvergenceError(RuntimeError):
    """Failure of a run that did not reach its target.

    Args:
        message: the message.
        path: path computed so far.
        diagnosis: cause of the failure, which is added to the message, or None.

    Attributes:
        path: path computed so far (`formingx.Path`), with a converged last state, or None.
        diagnosis: cause as numbers, text and picture (`formingx.solve.diagnose.Diagnosis`), or None.

    >>> try:
    ...     fx.trace(scene, until=fx.pole_height(12.0), max_steps=3, progress=False)
    ... except fx.ConvergenceError as error:
    ...     len(error.path.states)
    4
    """

    def __init__(self, message: str, path: Any = None, diagnosis: Any = None):
        super().__init__(f"{message}\n{diagnosis}" if diagnosis is not None else message)
        self.path, self.diagnosis = path, diagnosis


class Interrupted(KeyboardInterrupt):
    """Interruption of a run by Ctrl-C; if it is not caught, one line is printed in place of a traceback.

    Args:
        message: the message.
        path: path computed so far.

    Attributes:
        path: path computed so far (`formingx.Path`), or None.
    """

    def __init__(self, message: str, path: Any = None):
        super().__init__(message)
        self.path = path
        if not isinstance(sys.excepthook, OneLine):
            OneLine(Interrupted)


def positive(name: str, value: Any) -> float:
    """Return an argument as a float; InputError, with the argument's name, unless it is finite and above 0."""
    number = finite(name, value)
    if number <= 0:
        raise InputError(f"{name} = {value!r}: must be greater than 0")
    return number


def non_negative(name: str, value: Any) -> float:
    """Return an argument as a float; InputError, with the argument's name, unless it is finite and 0 or more."""
    number = finite(name, value)
    if number < 0:
        raise InputError(f"{name} = {value!r}: must not be negative")
    return number


def fraction(name: str, value: Any) -> float:
    """Return an argument in the open interval (0, 1) as a float; otherwise an InputError by name."""
    number = finite(name, value)
    if not 0 < number < 1:
        raise InputError(f"{name} = {value!r}: must be between 0 and 1")
    return number


def finite(name: str, value: Any) -> float:
    """Return an argument that must be a finite number as a float; otherwise an InputError by name."""
    try:
        not_a_number = isinstance(value, str | bytes | bytearray) or getattr(value, "ndim", 0) > 0
        if not_a_number or isinstance(value, Complex) and not isinstance(value, Real):
            raise InputError(f"{name} = {value!r}: must be a number")
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r}: must be a number") from None
    except OverflowError:
        raise InputError(f"{name}: is too large a number") from None
    if not math.isfinite(number) or isinstance(value, bool):
        raise InputError(f"{name} = {value!r}: must be a finite number")
    return number


def count(name: str, value: Any) -> int:
    """Return an argument that must be a positive integer as an int; otherwise an InputError by name."""
    number = finite(name, value)
    if number != int(number) or number < 1:
        raise InputError(f"{name} = {value!r}: must be a whole number of at least 1")
    return int(number)


def check_type(name: str, value: Any, kind: Any, what: str) -> Any:
    """Return an argument of a type or union `kind`; an InputError describes it by `what`."""
    if not isinstance(value, kind):
        raise InputError(f"{name} = {value!r}: must be {what}")
    return value


def as_list(name: str, values: Any, what: str) -> list[Any]:
    """Return an argument that must be a sequence of `what` as a list; otherwise an InputError by name."""
    is_item = isinstance(values, str | bytes | dict) or hasattr(values, "_fields")         # a NamedTuple is one item
    if not isinstance(values, Iterable) or is_item or getattr(values, "ndim", 1) == 0:
        raise InputError(f"{name} = {values!r}: must be a list of {what}")
    return list(values)


def pair(name: str, values: Any) -> tuple[float, float]:
    """Return an argument that must be two finite numbers as floats; otherwise an InputError by name."""
    first, second = _finite(name, values, 2, "two numbers")
    return first, second


def triple(name: str, values: Any) -> tuple[float, float, float]:
    """Return an argument that must be three finite numbers as floats; otherwise an InputError by name."""
    first, second, third = _finite(name, values, 3, "three numbers")
    return first, second, third


def direction(name: str, values: Any) -> np.ndarray:
    """Return three finite numbers, not all 0, as a unit vector, shape (3,); otherwise an InputError."""
    vector = np.array(triple(name, values))
    if not vector.any():
        raise InputError(f"{name} = {values!r}: must not be 0 in all components")
    return vector / np.linalg.norm(vector)


def _finite(name: str, values: Any, n: int, what: str) -> list[float]:
    """Return an argument that must be n finite numbers as floats; otherwise an InputError by name and `what`."""
    found = as_list(name, values, what)
    if len(found) != n:
        raise InputError(f"{name} = {values!r}: must be {what}")
    return [finite(name, value) for value in found]


def finite_array(name: str, values: Any) -> np.ndarray:
    """Return an argument that must be finite numbers as an array of floats, of the same shape; or an InputError."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        found = np.array(np.nan)
    if not np.all(np.isfinite(found)):
        raise InputError(f"{name} = {values!r}: must be finite numbers")
    return found


def as_points(name: str, values: Any, components: int = 2) -> np.ndarray:
    """Return points, shape (..., components), as an array of floats, (n, components); otherwise an InputError."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        found = np.zeros(1)
    if found.size and found.shape[-1:] != (components,):
        raise InputError(f"{name} = {values!r}: must be points {'(R, Z)' if components == 2 else '(x, y, z)'}")
    return found.reshape(-1, components)


def values(name: str, function: Callable, arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return a user's function of {name: array} as floats, shape of the arrays; failures and inf are an InputError."""
    arguments = ", ".join(arrays) if len(arrays) == 1 else f"({', '.join(arrays)})"
    try:
        found = np.broadcast_to(np.asarray(function(*arrays.values()), dtype=float),
                                np.shape(next(iter(arrays.values()))))
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{name}: the function of arrays {arguments} fails:"
                         f" {type(error).__name__}: {error}") from error
    wrong = ~np.isfinite(found)
    if np.any(wrong):
        where = ", ".join(f"{array[wrong].flat[0]:.6g}" for array in arrays.values())
        raise InputError(f"{name}: is {found[wrong].flat[0]}, not a finite number, at"
                         f" {arguments} = {where if len(arrays) == 1 else f'({where})'}")
    return found


def file_path(name: str, value: Any) -> Path:
    """Return the name of a file or a folder as a path; otherwise an InputError by name."""
    if not isinstance(value, str | os.PathLike) or not os.fspath(value) or "\0" in os.fsdecode(value):
        raise InputError(f"{name} = {value!r}: must be the name of a file or a folder")
    return Path(value)


def check_name(kind: str, name: Any, names: Any) -> None:
    """Raise an InputError that lists the known names unless `name` is one. kind: such as "Scene: layer"."""
    if not isinstance(name, Hashable) or isinstance(name, bool) or name not in names:
        raise InputError(f"{kind} {name!r} is not known; known: {', '.join(map(repr, names)) or 'none'}")


def call_on_all_ranks(comm: Any, calls: Iterable[Callable[[], Any]]) -> None:
    """Call functions on all ranks, and raise an InputError on all ranks if one of them raises it; collective."""
    refused = None
    for call in calls:
        try:
            call()
        except InputError as error:
            refused = refused or str(error)
    for message in filter(None, comm.allgather(refused)):
        raise InputError(message)
