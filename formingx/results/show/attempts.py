"""Parts of a report, each of which may fail without the loss of the others."""

import logging
from collections.abc import Callable
from typing import Any

from ...findings import Finding, error_text

log = logging.getLogger("formingx")


class Attempts:
    """Parts of a report that were tried, and findings: a warning for each part that failed.

    Errors of the classes `refusals` are raised, because they refuse an argument of the user.
    """

    def __init__(self, *refusals: type[Exception]):
        self._refusals = refusals
        self.findings: list[Finding] = []

    def make(self, name: str, draw: Callable[[], Any], fallback: Any) -> Any:
        """Return the result of `draw`, or a fallback if it fails: a finding on `name`, such as "the picture"."""
        try:
            return draw()
        except self._refusals:
            raise
        except Exception as error:
            log.debug("%s failed", name, exc_info=True)
            self.findings.append(Finding("warning", "report", f"{name} could not be made and is left out:"
                                         f" {error_text(error)}. The states of the run are complete.",
                                         "Report the error, with the script."))
            return fallback
