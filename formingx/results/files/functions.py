"""Functions of the user's script as JSON data, so that a scene can be compared by what its functions compute.

A function is described by its byte code and by all values that the code uses: defaults, variables of the enclosing
function, global variables, and in the same way the functions that it calls. Functions of installed packages are
described by their names.
"""

import dis
import functools
import hashlib
import os
import sys
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from ...mesh.mesh import Mesh
from ...ranks import original
from ...scene.summary import text
from ...values.table import Table

UNKNOWN = "cannot be compared"
"""Key of the description of an object whose contents are not known."""

_LARGEST = 64
"""Number of entries above which an array is described by sums."""

_LIBRARIES = tuple(os.path.abspath(folder) + os.sep for folder in (
    os.path.dirname(os.__file__), os.path.join(os.path.dirname(str(np.__file__)), ".."),
    os.path.join(os.path.dirname(__file__), "..", "..")))
"""Folders of installed packages, of the standard library and of formingx."""


def described(value: Any, depth: int = 8, known: tuple[int, ...] = ()) -> Any:
    """Return a value that a function uses as JSON data, or {`UNKNOWN`: text} if it cannot be known.

    `known` has identities of the functions that are being described, which may call themselves.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, complex | bytes | range | slice):
        return repr(value)
    if isinstance(value, np.generic | np.ndarray):
        return _array(np.asarray(value), depth, known)
    if isinstance(value, types.ModuleType | np.ufunc | np.dtype):
        return getattr(value, "__name__", str(value))
    if depth == 0 or id(value) in known:
        return text(value)
    known = (*known, id(value))

    def inner(part: Any) -> Any:
        return described(part, depth - 1, known)
    if isinstance(value, Mapping):
        return {str(k): inner(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [inner(v) for v in value]
    if isinstance(value, set | frozenset):
        return [inner(v) for v in sorted(value, key=repr)]
    if isinstance(value, type):
        return {"kind": value.__qualname__} | _class_code(value, inner)
    if isinstance(value, types.MethodType):
        return {"method": inner(value.__func__), "of": inner(value.__self__)}
    if isinstance(value, functools.partial):
        return {"partial": inner(value.func), "arguments": inner(value.args), "keywords": inner(value.keywords)}
    if isinstance(value, types.FunctionType):
        return _function(value, inner)
    if isinstance(value, types.BuiltinFunctionType):
        owner = value.__self__
        of = {} if owner is None or isinstance(owner, types.ModuleType) else {"of": inner(owner)}
        return {"function": value.__qualname__} | of
    if isinstance(value, Table):
        return {"kind": "table", "x": value.x.tolist(), "y": value.y.tolist()}
    return _object(value, inner)


def functions_in(value: Any, where: str = "", known: set[int] | None = None) -> Iterator[tuple[str, Any]]:
    """Yield (place, description) of functions and tables an object holds anywhere, but not the `known` ones."""
    known = set() if known is None else known
    if id(value) in known or value is None or isinstance(value, type | str | bool | int | float | np.ndarray):
        return
    known.add(id(value))
    start = f"{where}." if where else ""
    if isinstance(value, Mapping):
        parts = {f"{start}{key}": part for key, part in value.items()}
    elif isinstance(value, list | tuple):
        parts = {f"{where}[{k}]": part for k, part in enumerate(value)}
    elif isinstance(value, Table):
        yield where, described(value)
        return
    elif isinstance(value, types.FunctionType | types.MethodType | functools.partial) and _installed(value):
        parts = {f"{start}{name}": part for name, part in _variables(value).items()}
    elif _of_formingx(type(value)):
        if code := class_code(type(value)):
            yield start + "code", code["code"]
            yield start + "attributes", described(attributes(value))
        parts = {f"{start}{name}": part for name, part in attributes(value).items()}
    elif callable(value) and not _installed(value):
        yield where, described(value)
        return
    else:
        return
    for place, part in parts.items():
        yield from functions_in(part, place, known)


def _of_formingx(cls: type) -> bool:
    """Return True if a class belongs to formingx, or the user derived it from one."""
    return any(base.__module__.partition(".")[0] == __name__.partition(".")[0] for base in cls.__mro__)


def _variables(function: Any) -> dict[str, Any]:
    """Return {name: value} of what a function of a package remembers: its object, arguments or enclosing variables."""
    if isinstance(function, types.MethodType):
        return {"": function.__self__}
    if isinstance(function, functools.partial):
        return {"function": function.func, "arguments": function.args, "keywords": function.keywords}
    return {name: cell.cell_contents for name, cell in zip(function.__code__.co_freevars, function.__closure__ or ())}


def attributes(value: Any) -> dict[str, Any]:
    """Return {name without leading underscores: value} of the attributes of an object, without cached properties."""
    return {name.strip("_"): part for name, part in vars(value).items()
            if not isinstance(getattr(type(value), name, None), functools.cached_property)}


def class_code(cls: type) -> dict[str, Any]:
    """Return the code of a class that the user defined as {"code": description}; {} for a class of a package."""
    return _class_code(cls, lambda part: described(part, 6))


def _installed(value: Any) -> bool:
    """Return True if a function or class belongs to formingx, to an installed package or to Python itself."""
    value = getattr(value, "func", value) if isinstance(value, functools.partial) else value
    value = getattr(value, "__func__", value)
    name = getattr(value, "__module__", None) or ""
    if name == "builtins":
        return True
    code = getattr(value, "__code__", None)
    file = code.co_filename if code is not None else getattr(sys.modules.get(name), "__file__", None)
    return file is not None and os.path.abspath(file).startswith(_LIBRARIES)


def _array(value: np.ndarray, depth: int, known: tuple[int, ...]) -> Any:
    """Return an array as JSON data: a small one as lists, a large one by its shape and two sums."""
    if value.dtype.kind not in "biuf":
        return [described(v, max(depth - 1, 0), known) for v in value.ravel()[:_LARGEST]]
    if value.size <= _LARGEST:
        return value.tolist()
    entries = value.ravel().astype(float)
    weights = np.sin(1.0 + np.arange(value.size))
    return {"shape": list(value.shape), "sums": [float(entries.sum()), float(weights @ entries)]}


def _function(function: Any, inner: Callable[[Any], Any]) -> dict[str, Any]:
    """Return a Python function as JSON data; `inner` describes the values that it uses."""
    if _installed(function):
        found = {"function": f"{function.__module__}.{function.__qualname__}"}
        return found | ({"uses": _closure(function, inner)} if function.__closure__ else {})
    uses = _closure(function, inner)
    for name in sorted(set(_global_names(function.__code__))):
        if name in function.__globals__:
            uses[name] = inner(function.__globals__[name])
    defaults = [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).items()]
    return {"function": function.__qualname__, "python": ".".join(map(str, sys.version_info[:2])),
            "code": _digest(function.__code__, function.__doc__), "defaults": inner(defaults), "uses": uses}


def _closure(function: Any, inner: Callable[[Any], Any]) -> dict[str, Any]:
    """Return {name: description} of the variables of the enclosing function that a function uses."""
    found = {}
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or ()):
        try:
            found[name] = inner(cell.cell_contents)
        except ValueError:                                   # it has no value yet
            found[name] = None
    return found


def _global_names(code: types.CodeType) -> Iterator[str]:
    """Yield the names of global variables that a piece of code uses, with the functions defined in it."""
    for instruction in dis.get_instructions(code):
        if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield instruction.argval
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _global_names(constant)


def _digest(code: types.CodeType, doc: str | None = None) -> str:
    """Return a digest of byte code, its names and its constants, without line numbers and docstring."""
    return hashlib.sha256(repr(_code(code, doc)).encode()).hexdigest()[:16]


def _code(code: types.CodeType, doc: str | None = None) -> Any:
    """Return byte code, names and constants of code as nested tuples; `doc` is the docstring, which is left out."""
    constants = [_code(c) if isinstance(c, types.CodeType) else sorted(map(repr, c)) if isinstance(c, frozenset)
                 else repr(c) for c in code.co_consts if doc is None or c != doc]
    return code.co_code, code.co_names, tuple(map(str, constants))


def _class_code(cls: type, inner: Callable[[Any], Any]) -> dict[str, Any]:
    """Return {"code": {name: description}} of methods and values of a class of the user; {} for other classes."""
    found: dict[str, Any] = {}
    for base in cls.__mro__:
        if _installed(base):
            continue
        for name, member in vars(base).items():
            member = getattr(member, "fget", None) or getattr(member, "func", None) or getattr(
                member, "__func__", member)
            if isinstance(member, types.FunctionType) or not name.startswith("__") and isinstance(
                    member, bool | int | float | str | tuple | list | dict | np.ndarray):
                found.setdefault(name, inner(member))
    return {"code": found} if found else {}


def field_sums(field: Any) -> list[float]:
    """Return two sums over a DOLFINx function, the second weighted by position, the same on any ranks; collective."""
    space = field.function_space
    points = space.tabulate_dof_coordinates()
    comm = original(space.mesh.comm)
    size = max(float(comm.allreduce(np.abs(points).max(initial=0.0), MPI.MAX)), 1e-300)
    n = space.dofmap.index_map.size_local
    values = field.x.array[: n * space.dofmap.index_map_bs].reshape(n, -1).sum(axis=1)
    weights = np.sin(1.0 + points[:n] / size @ [5.0, 7.0, 11.0])
    return comm.allreduce(np.array([values.sum(), weights @ values]), MPI.SUM).tolist()


def _object(value: Any, inner: Callable[[Any], Any]) -> Any:
    """Return an object as JSON data: its class, the code of the user's class, and its attributes."""
    kind = {"kind": type(value).__name__} | _class_code(type(value), inner)
    if isinstance(value, fem.Function):
        return kind | {"sums": field_sums(value)}
    if isinstance(value, Mesh):                              # the mesh of the scene is compared by itself
        return kind
    state = None
    if not type(value).__module__.startswith(("ufl", "dolfinx", "petsc4py", "mpi4py")):
        try:
            state = value.__getstate__()
        except Exception:                                    # an object that refuses to be stored
            state = None
    if state is None:
        plain_class = type(value).__module__ != "builtins" and hasattr(value, "__dict__") and not vars(value)
        return kind if plain_class else kind | {UNKNOWN: text(value)}
    if isinstance(state, tuple) and len(state) == 2 and isinstance(state[1], dict):      # slots
        state = (state[0] or {}) | state[1]
    if isinstance(state, Mapping):
        state = {k: v for k, v in state.items()
                 if not isinstance(getattr(type(value), k, None), functools.cached_property)}
    return kind | {"attributes": inner(state)}
