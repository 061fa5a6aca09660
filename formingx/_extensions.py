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
