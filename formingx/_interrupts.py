"""Errors that are printed as one line if nothing catches them, such as Ctrl-C while the package is imported."""

import sys
from typing import Any


class OneLine:
    """A `sys.excepthook` that prints an uncaught error of type `kind` as one line, and others as the hook before it.

    The line is `text`, or the message of the error if that is "".
    """

    def __init__(self, kind: type[BaseException], text: str = ""):
        self._kind, self._text, self._usual = kind, text, sys.excepthook
        sys.excepthook = self

    def __call__(self, kind: Any, error: BaseException, trace: Any) -> None:
        if isinstance(error, self._kind):
            print(self._text or error, file=sys.stderr)
        else:
            self._usual(kind, error, trace)

    def restore(self) -> None:
        """Restore the hook that was in place before, unless another has replaced this one."""
        if sys.excepthook is self:
            sys.excepthook = self._usual


importing = OneLine(KeyboardInterrupt, "interrupted while formingx was imported")
