"""Ctrl-C while the package is imported, which takes a while, ends with one line."""

import sys
from typing import Any

_usual = sys.excepthook


def _one_line(kind: Any, error: BaseException, trace: Any) -> None:
    if isinstance(error, KeyboardInterrupt):
        print("interrupted while formingx was imported", file=sys.stderr)
    else:
        _usual(kind, error, trace)


def imported() -> None:
    """Complete the import: show uncaught errors as before it."""
    if sys.excepthook is _one_line:
        sys.excepthook = _usual


sys.excepthook = _one_line
