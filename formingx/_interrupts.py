"""Message of one line for Ctrl-C while the package is imported, which takes some seconds."""

import sys
from typing import Any

_usual = sys.excepthook


def _one_line(kind: Any, error: BaseException, trace: Any) -> None:
    """Print an uncaught KeyboardInterrupt as one line, and other errors as usual; a `sys.excepthook`."""
    if isinstance(error, KeyboardInterrupt):
        print("interrupted while formingx was imported", file=sys.stderr)
    else:
        _usual(kind, error, trace)


def restore_excepthook() -> None:
    """Restore the `sys.excepthook` that was in place before the import of the package."""
    if sys.excepthook is _one_line:
        sys.excepthook = _usual


sys.excepthook = _one_line
