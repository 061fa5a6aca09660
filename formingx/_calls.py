"""Errors of public calls with arguments of a wrong kind or number: an InputError that names the allowed ones.

A call that fails is explained: its arguments are compared with its signature and its annotations. Each function
checks the values itself (`errors.py`). Calls by a user are explained. Methods that the solver calls during a run stay
plain functions.
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

_SAID = (InputError, ConvergenceError, OSError)              # their messages tell the fault already
_WORDS = {float: "a number", int: "a whole number", str: "a word", bool: "True or False", type(None): "None"}
_PACKAGE = __name__.partition(".")[0]
_SOLVER = {"physics", "contact", "forms", "problem", "measures", "solve"}
"""Subpackages of objects whose methods the solver calls: only calls of their constructors are explained."""
_ASKED = {name for protocol in (RigidTool, PlaneTool) for name in vars(protocol) if not name.startswith("_")}
"""Methods of tools that the solver calls in every iteration."""
_seen: set[type] = set()     # classes whose methods are explained


class _WrongCall(InputError, TypeError):
    """`InputError` that is also a `TypeError`, which Python raises for a wrong call."""

    __module__, __qualname__ = InputError.__module__, "InputError"


def explain(module: types.ModuleType) -> None:
    """Explain the calls that fail of all that a module of the package exports: functions, classes and their methods."""
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
    """Explain the public methods of a class and of its bases, and the methods of their results."""
    _seen.add(cls)
    for base in cls.__mro__:
        if base.__module__.startswith(_PACKAGE):
            _explain_methods(base)


def _in_solver(cls: type) -> bool:
    return not _SOLVER.isdisjoint(cls.__module__.split(".")[1:2])


def _explain_methods(cls: type) -> None:
    asked = _in_solver(cls)
    for name, method in list(vars(cls).items()):
        makes = name in ("__init__", "__new__")
        if not makes and (asked or name in _ASKED or name.startswith("_") and name != "__call__"):
            continue
        known = cls.__name__ if makes else name
        if isinstance(method, types.FunctionType):
            setattr(cls, name, _explained(method, known, skip=1))
        elif isinstance(method, classmethod | staticmethod):
            bound = makes or isinstance(method, classmethod)
            setattr(cls, name, type(method)(_explained(method.__func__, known, skip=int(bound))))


def _explained(call: Callable, name: str, skip: int) -> Callable:
    """Return `call`, explained if it fails; `skip`: number of leading arguments that are the object or its class."""
    if getattr(call, "_is_explained", False) or inspect.isgeneratorfunction(call):
        return call

    @functools.wraps(call)
    def explained(*args: Any, **given: Any) -> Any:
        try:
            result = call(*args, **given)
        except _SAID:
            raise
        except Exception as error:
            makes = call.__name__ in ("__init__", "__new__")
            owner = None if makes or not skip else args[0] if isinstance(args[0], type) else type(args[0])
            why = _wrong(call, f"{owner.__name__}.{name}" if owner else name, skip, args, given)
            if why is None:
                raise
            raise _WrongCall(why) from error
        if (made := type(result)) not in _seen and made.__module__.startswith(_PACKAGE) and not _in_solver(made):
            _explain_class(made)
        return result
    explained._is_explained = True                           # type: ignore[attr-defined]
    return explained


def _wrong(call: Callable, name: str, skip: int, args: tuple, given: dict[str, Any]) -> str | None:
    """Return the fault in the arguments of a call, as text; None: the signature finds no fault."""
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
        how, kind = signature.parameters[parameter].kind, kinds.get(parameter, Any)
        values = (value if how is inspect.Parameter.VAR_POSITIONAL else
                  value.values() if how is inspect.Parameter.VAR_KEYWORD else [value])
        for entry in values:
            if not _is(entry, kind):
                return f"{name}: {parameter} = {_short(entry)}: must be {_said(kind)}"
    return None


def _typo(signature: inspect.Signature, given: Mapping[str, Any]) -> str:
    """Return the names of arguments that a function does not take, with what was meant, as text; or ""."""
    kinds = {p.kind for p in signature.parameters.values()}
    unknown = [] if inspect.Parameter.VAR_KEYWORD in kinds else [n for n in given if n not in signature.parameters]
    close = {n: difflib.get_close_matches(n, [p for p in signature.parameters if p not in given], 1) for n in unknown}
    return ", ".join(f"{n}= is not known" + (f": did you mean {close[n][0]}=?" if close[n] else "") for n in unknown)


def _parameter(p: inspect.Parameter) -> str:
    if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD):
        return str(p.replace(annotation=p.empty))
    if p.default is p.empty:
        return f"{p.name}=..." if p.kind is p.KEYWORD_ONLY else p.name
    return f"{p.name}={p.default!r}" if len(repr(p.default)) < 20 else f"{p.name}=..."


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 100 else text[:97] + "..."


def _is(value: Any, kind: Any) -> bool:
    """Tell whether a value is of the kind that an annotation names; True where it cannot be told."""
    origin, of = typing.get_origin(kind) or kind, typing.get_args(kind)
    if kind is Any or isinstance(kind, typing.TypeVar):
        return True
    if kind is np.ndarray or kind == ArrayLike:
        return _numbers(value)
    if origin in (typing.Union, types.UnionType):
        return any(_is(value, entry) for entry in _either(of))
    if origin is typing.Literal:
        return any(value is entry or value == entry for entry in of if type(value) is type(entry))
    if kind is float or kind is int:
        number = Real if kind is float else Integral
        return isinstance(value, number) and not isinstance(value, bool) and _numbers(value)
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
        return all(_is(k, of[0]) and _is(v, of[1]) for k, v in entries.items())
    if isinstance(value, Sequence) and of:
        if origin is tuple and of[-1] is not Ellipsis:
            return len(value) == len(of) and all(map(_is, value, of))
        return all(_is(entry, of[0]) for entry in value)
    return True


def _either(kinds: Sequence[Any]) -> list[Any]:
    """Return the kinds of a union, in which `ArrayLike`, a union too, is one."""
    array = set(typing.get_args(ArrayLike))
    return [ArrayLike, *(k for k in kinds if k not in array)] if array <= set(kinds) else list(kinds)


def _numbers(value: Any) -> bool:
    try:
        return not isinstance(value, str | bytes) and np.asarray(value, float) is not None
    except (TypeError, ValueError, OverflowError):
        return False


def _said(kind: Any) -> str:
    """Return an annotation as text."""
    origin, of = typing.get_origin(kind) or kind, [k for k in typing.get_args(kind) if k is not Ellipsis]
    if kind is np.ndarray or kind == ArrayLike:
        return "numbers"
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(map(_said, _either(of))))
    if origin is typing.Literal:
        return " or ".join(map(repr, of))
    if kind in _WORDS:
        return _WORDS[kind]
    if origin is collections.abc.Callable:
        return "a function"
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return "a dict" + (f" of {_said(of[0])}: {_said(of[1])}" if len(of) == 2 else "")
    if origin in (os.PathLike, Path):
        return "a path"
    if origin is tuple and of and Ellipsis not in typing.get_args(kind):
        return f"({', '.join(map(_said, of))})"
    if isinstance(origin, type) and issubclass(origin, Iterable) and of:
        return f"a list of {_said(of[0])}"
    name = getattr(origin, "__name__", str(origin))
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
