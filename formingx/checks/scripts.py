"""Check of a script: the script is executed up to its first run, and the scene and targets of this run are checked."""

import inspect
import os
import runpy
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import formingx

from .. import runs
from ..errors import InputError, file_path
from ..run_hooks import dry_runs
from .check import Report, check


class _DryRun(BaseException):
    """Exception in place of the first run of a script, which does not catch it: it is not an `Exception`."""

    def __init__(self, report: Report):
        super().__init__()
        self.report = report


def check_script(script: Any, arguments: Sequence[str] = ()) -> Report:
    """Return findings on a script's first scene, run up to there; no file, run or sound scene is an InputError."""
    file = file_path("check: script", script)
    if not file.is_file():
        raise InputError(f"check: script {str(file)!r} is not there")
    _check_python(file)
    before = sys.argv, sys.path[:]
    sys.argv, sys.path[:0] = [os.fspath(file), *arguments], [os.fspath(file.parent)]
    try:
        with _no_runs():
            runpy.run_path(os.fspath(file), run_name="__main__")
    except _DryRun as found:
        return found.report
    finally:
        sys.argv, sys.path[:] = before
    raise InputError(f"check: {str(file)!r} runs no scene in this process: there is nothing to check")


def _check_python(file: Path) -> None:
    """Raise an InputError unless a file is Python source."""
    try:
        compile(file.read_bytes(), os.fspath(file), "exec")
    except (SyntaxError, ValueError, OverflowError, MemoryError, RecursionError) as error:
        where = f", line {error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
        words = error.msg if isinstance(error, SyntaxError) else str(error) or type(error).__name__
        raise InputError(f"check: script {str(file)!r} is no Python: {words}{where}") from None


@contextmanager
def _no_runs() -> Iterator[None]:
    """Replace functions that run a scene, such as `trace`, by its check and a `_DryRun` within a `with` block."""
    def trace(scene, *, until, intermediate=(), **_):
        raise _DryRun(check(scene, targets=[*intermediate, until]))

    def solve(scene, **_):
        raise _DryRun(check(scene))

    def run(process, stages, **_):
        raise _DryRun(check(process.scene, stages=stages))
    inner = inspect.unwrap(formingx.trace)                  # the function that other modules import
    tracing = [module for name, module in list(sys.modules.items())
               if name.partition(".")[0] == "formingx" and inspect.unwrap(getattr(module, "trace", len)) is inner]
    others: list[Any] = [*((module, "trace", trace) for module in tracing), (formingx, "solve", solve),
                         (runs.Process, "run", run), *((formingx, name, other) for name, other in dry_runs.items())]
    originals = [getattr(owner, name) for owner, name, _ in others]
    try:
        for owner, name, other in others:
            setattr(owner, name, other)
        yield
    finally:
        for (owner, name, _), original in zip(others, originals):
            setattr(owner, name, original)
