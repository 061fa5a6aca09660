"""Exact solutions and membrane theory, to compare runs with: `fx.exact.inflation` and others."""

import importlib
from types import ModuleType

_MODULES = ("heat", "inflation", "plug", "stability", "time")


def __getattr__(name: str) -> ModuleType:
    """Return a module of this folder, which is loaded at its first use."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(_MODULES)}")
    return importlib.import_module(f".{name}", __name__)


def __dir__() -> list[str]:
    return list(_MODULES)
