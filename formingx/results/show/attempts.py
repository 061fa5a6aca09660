"""Parts of a report, each of which may fail without the loss of the others."""

import logging
from collections.abc import Callable
from typing import Any

from ...findings import Finding, error_text

log = logging.getLogger("formingx")


class Attempts:
    """Parts of a report that were tried, and findings on the parts that failed.

    Args:
        refusals: classes of errors that are raised, because they refuse an argument of the user.

    Attributes:
        findings: a warning for each part that failed.
    """

    def __init__(self, *refusals: type[Exception]):
        self._refusals = refusals
        self.findings: list[Finding] = []

    def make(self, name: str, draw: Callable[[], Any], fallback: Any) -> Any:
        """Return the result of a function, or a fallback if it fails; the error becomes a finding.

        Args:
            name: name of the part, for the finding, such as "the picture of the wall".
            draw: function without arguments that makes the part.
            fallback: content in place of a part that failed.
        """
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
