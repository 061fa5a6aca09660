"""Import of extensions, whose folders may be missing."""

from __future__ import annotations

import contextlib
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parent / "extensions"


@contextlib.contextmanager
def optional() -> Iterator[None]:
    """Skip an import whose extension's folder is missing; another missing module is a ModuleNotFoundError."""
    try:
        yield
    except ModuleNotFoundError as error:
        package, _, name = (error.name or "").partition(".extensions.")
        if package != __package__ or not name or (_FOLDER / name.partition(".")[0]).is_dir():
            raise


def add(module: types.ModuleType, *objects: Any) -> None:
    """Add functions or classes of an extension to a module, as attributes with their own names."""
    for found in objects:
        setattr(module, found.__name__, found)


def list_public(module: types.ModuleType, *submodules: types.ModuleType) -> None:
    """Let `dir` and the completion of editors list what users meet: functions, classes, and some submodules."""
    def names() -> list[str]:
        return sorted(name for name, item in vars(module).items() if name.startswith("__") or name[0] != "_" and (
            item in submodules or not isinstance(item, types.ModuleType)
            and str(getattr(item, "__module__", "")).startswith(f"{__package__}.")))
    vars(module)["__dir__"] = names
