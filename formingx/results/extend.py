"""Methods that extensions add to results, such as `Path.stability`.

An extension writes a function whose first argument is the result, and attaches it under the function's own name::

    from ...results.extend import method_of
    from ...results.path import Path

    @method_of(Path)
    def stability(path: Path, modes: Any = range(9), states: Any = 20) -> Stability:
        \"""Find the modes that are unstable.\"""

`path.stability(...)` then calls it, and `help(path.stability)` shows it. `formingx/__init__` imports the extensions, so
every method is there after `import formingx`. The class itself names no extension.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def method_of(owner: type) -> Callable[[Function], Function]:
    """Return a decorator that adds a function to a class as a method, under the name of the function.

    Args:
        owner: the class, such as `formingx.Path`.

    Returns:
        The decorator. It returns the function unchanged, so the extension can also call it as a function.

    Raises:
        TypeError: the class already has an attribute of that name.

    >>> from formingx.results.extend import method_of
    >>> @method_of(fx.Path)
    ... def largest_pressure(path):
    ...     return float(path["pressure"].max())
    >>> round(path.largest_pressure(), 4)
    0.0451
    >>> del fx.Path.largest_pressure
    """
    def attach(function: Function) -> Function:
        name, before = function.__name__, getattr(owner, function.__name__, None)
        if before is not None and getattr(before, "__module__", None) != function.__module__:
            raise TypeError(f"{owner.__name__}.{name} is defined already: give the function another name")
        setattr(owner, name, function)
        return function
    return attach
