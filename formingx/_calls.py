"""Messages for calls of public functions with arguments of a wrong type or number.

If a call fails, its arguments are compared with the signature and the annotations of the function. An argument that
does not fit gives an InputError that names the type it must have. Each function checks the values of its arguments
itself (`errors.py`). Methods that the solver calls during a run are left unchanged, because the comparison costs time.
"""

from __future__ import annotations

import collections.abc
import difflib
import functools
import inspect
import os
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import ConvergenceError, InputError
from .tools.tool import PlaneTool, RigidTool

_CLEAR_ERRORS = (InputError, ConvergenceError, OSError)      # errors whose messages name the cause
_WORDS = {float: "a number", int: "a whole number", str: "a word", bool: "True or False", type(None): "None"}
_PACKAGE = __name__.partition(".")[0]
_INTERNAL = {"physics", "contact", "contact_events", "forms", "problem", "measures", "solve"}
"""Folders of classes whose methods the solver calls: only their constructors are explained."""
_TOOL_METHODS = {name for protocol in (RigidTool, PlaneTool) for name in vars(protocol) if not name.startswith("_")}
"""Methods of tools that the solver calls in every iteration."""
_explained_classes: set[type] = set()                        # classes whose methods are explained


class _WrongCall(InputError, TypeError):
    """InputError about the type or number of arguments; it is also the TypeError that Python raises for such a call."""

    __module__, __qualname__ = InputError.__module__, "InputError"


def explain(module: types.ModuleType) -> None:
    """Make public functions, classes and methods of a module explain calls with wrong arguments by an `InputError`."""
    for name, item in list(vars(module).items()):
        if name.startswith("_") or not getattr(item, "__module__", "").startswith(_PACKAGE):
            continue
        if isinstance(item, type) and not issubclass(item, BaseException):
            _explain_class(item)
        elif isinstance(item, types.FunctionType):
            explained = _explained(item, item.__name__, skip=0)
            setattr(sys.modules[item.__module__], item.__name__, explained)    # where pickle looks for it
            setattr(module, name, explained)


def _explain_class(cls: type) -> None:
    """Make the public methods of a class and of its bases explain calls with wrong arguments."""
    _explained_classes.add(cls)
    for base in cls.__mro__:
        if base.__module__.startswith(_PACKAGE):
            _explain_methods(base)


def _is_internal(cls: type) -> bool:
    """Return True if the solver calls the methods of a class during a run."""
    return not _INTERNAL.isdisjoint(cls.__module__.replace(".extensions.", ".").split(".")[1:2])


def _explain_methods(cls: type) -> None:
    """Make the constructor and the public methods that a class itself defines explain calls with wrong arguments."""
    internal = _is_internal(cls)
    for name, method in list(vars(cls).items()):
        constructs = name in ("__init__", "__new__")
        if not constructs and (internal or name in _TOOL_METHODS or name.startswith("_") and name != "__call__"):
            continue
        public_name = cls.__name__ if constructs else name
        if isinstance(method, types.FunctionType):
            setattr(cls, name, _explained(method, public_name, skip=1))
        elif isinstance(method, classmethod | staticmethod):
            bound = constructs or isinstance(method, classmethod)
            setattr(cls, name, type(method)(_explained(method.__func__, public_name, skip=int(bound))))


def _explained(call: Callable, name: str, skip: int) -> Callable:
    """Return `call` with messages about wrong arguments; a user does not write the first `skip` ones (self, cls)."""
    if getattr(call, "_is_explained", False) or inspect.isgeneratorfunction(call):
        return call

    @functools.wraps(call)
    def explained(*args: Any, **given: Any) -> Any:
        try:
            result = call(*args, **given)
        except _CLEAR_ERRORS:
            raise
        except Exception as error:
            constructs = call.__name__ in ("__init__", "__new__")
            owner = None if constructs or not skip else args[0] if isinstance(args[0], type) else type(args[0])
            fault = _fault(call, f"{owner.__name__}.{name}" if owner else name, skip, args, given)
            if fault is None:
                raise
            raise _WrongCall(fault) from error
        kind = type(result)
        if kind not in _explained_classes and kind.__module__.startswith(_PACKAGE) and not _is_internal(kind):
            _explain_class(kind)
        return result
    explained._is_explained = True                           # type: ignore[attr-defined]
    return explained


def _fault(call: Callable, name: str, skip: int, args: tuple, given: dict[str, Any]) -> str | None:
    """Return the fault in the arguments of a call, without the first `skip`, as text; None if they fit."""
    signature = inspect.signature(call)
    try:
        bound = signature.bind(*args, **given).arguments
    except TypeError as error:
        takes = ", ".join(map(_parameter, list(signature.parameters.values())[skip:]))
        return f"{name}: {_typo(signature, given) or error}: must be {name}({takes})"
    try:
        kinds = typing.get_type_hints(call)
    except Exception:  # noqa: BLE001  of a user's own class: names that are known to a type checker alone
        return None
    for parameter, value in list(bound.items())[skip:]:
        passing, kind = signature.parameters[parameter].kind, kinds.get(parameter, Any)
        values = (value if passing is inspect.Parameter.VAR_POSITIONAL else
                  value.values() if passing is inspect.Parameter.VAR_KEYWORD else [value])
        for entry in values:
            if not _matches(entry, kind):
                return f"{name}: {parameter} = {_short(entry)}: must be {_described(kind)}"
    return None


def _typo(signature: inspect.Signature, given: Mapping[str, Any]) -> str:
    """Return the keyword arguments `given` that a signature lacks, each with the most similar name, as text; or ""."""
    kinds = {p.kind for p in signature.parameters.values()}
    unknown = [] if inspect.Parameter.VAR_KEYWORD in kinds else [n for n in given if n not in signature.parameters]
    close = {n: difflib.get_close_matches(n, [p for p in signature.parameters if p not in given], 1) for n in unknown}
    return ", ".join(f"{n}= is not known" + (f": did you mean {close[n][0]}=?" if close[n] else "") for n in unknown)


def _parameter(p: inspect.Parameter) -> str:
    """Return a parameter of a signature as text: its name and its default, "..." for a long one."""
    if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD):
        return str(p.replace(annotation=p.empty))
    if p.default is p.empty:
        return f"{p.name}=..." if p.kind is p.KEYWORD_ONLY else p.name
    return f"{p.name}={p.default!r}" if len(repr(p.default)) < 20 else f"{p.name}=..."


def _short(value: Any) -> str:
    """Return a value as text, cut to 100 characters."""
    text = repr(value)
    return text if len(text) < 100 else text[:97] + "..."


def _matches(value: Any, kind: Any) -> bool:
    """Return True if a value fits the type annotation `kind`, or if the annotation cannot be checked."""
    origin, of = typing.get_origin(kind) or kind, typing.get_args(kind)
    if kind is Any or isinstance(kind, typing.TypeVar):
        return True
    if kind is np.ndarray or kind == ArrayLike:
        return _is_numeric(value)
    if origin in (typing.Union, types.UnionType):
        return any(_matches(value, entry) for entry in _alternatives(of))
    if origin is typing.Literal:
        return any(value is entry or value == entry for entry in of if type(value) is type(entry))
    if kind is float or kind is int:
        number = Real if kind is float else Integral
        return isinstance(value, number) and not isinstance(value, bool) and _is_numeric(value)
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind is None or kind is type(None):
        return value is None
    if origin is collections.abc.Callable:
        return callable(value)
    if not isinstance(origin, type) or getattr(origin, "_is_protocol", False) > getattr(
            origin, "_is_runtime_protocol", False):
        return True
    if origin in (os.PathLike, Path):
        return isinstance(value, os.PathLike)
    if not isinstance(value, origin) or isinstance(value, str | bytes) and of:      # a word is no list of words
        return False
    entries: Any = value
    if issubclass(origin, Mapping) and len(of) == 2:
        return all(_matches(k, of[0]) and _matches(v, of[1]) for k, v in entries.items())
    if isinstance(value, Sequence) and of:
        if origin is tuple and of[-1] is not Ellipsis:
            return len(value) == len(of) and all(map(_matches, value, of))
        return all(_matches(entry, of[0]) for entry in value)
    return True


def _alternatives(kinds: Sequence[Any]) -> list[Any]:
    """Return the types `kinds` of a union, in which `ArrayLike`, before NumPy 2.5 a union itself, becomes one entry."""
    array = set(typing.get_args(ArrayLike))
    return [ArrayLike, *(k for k in kinds if k not in array)] if array and array <= set(kinds) else list(kinds)


def _is_numeric(value: Any) -> bool:
    """Return True if NumPy can convert a value to an array of floats."""
    try:
        return not isinstance(value, str | bytes) and np.asarray(value, float) is not None
    except (TypeError, ValueError, OverflowError):
        return False


def _described(kind: Any) -> str:
    """Return the type annotation `kind` as text for error messages, such as "a number or None"."""
    origin, of = typing.get_origin(kind) or kind, [k for k in typing.get_args(kind) if k is not Ellipsis]
    if kind is np.ndarray or kind == ArrayLike:
        return "numbers"
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(map(_described, _alternatives(of))))
    if origin is typing.Literal:
        return " or ".join(map(repr, of))
    if kind in _WORDS:
        return _WORDS[kind]
    if origin is collections.abc.Callable:
        return "a function"
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return "a dict" + (f" {{{_described(of[0])}: {_described(of[1])}}}" if len(of) == 2 else "")
    if origin in (os.PathLike, Path):
        return "a path"
    if origin is tuple and of and Ellipsis not in typing.get_args(kind):
        return f"({', '.join(map(_described, of))})"
    if isinstance(origin, type) and issubclass(origin, Iterable) and of:
        return f"a list of {_described(of[0])}"
    name = getattr(origin, "__name__", str(origin))
    return f"{'an' if name[0] in 'AEIO' else 'a'} {name}"
