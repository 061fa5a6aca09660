"""What `doctor` finds, and its report."""

from collections.abc import Sequence
from typing import NamedTuple


class Finding(NamedTuple):
    """One thing found: severity ("error": the run is refused; "warning": it may fail), what it is about, text."""

    severity: str
    about: str
    text: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.about}: {self.text}"


class Report:
    """What `doctor` found, worst first; prints in plain words.

    Attributes:
        findings: list of `Finding`; empty for a good scene.
    """

    def __init__(self, findings: Sequence[Finding]):
        self.findings = sorted(findings, key=lambda f: f.severity)

    @property
    def healthy(self) -> bool:
        """True if nothing was found."""
        return not self.findings

    def __str__(self) -> str:
        return "\n".join(map(str, self.findings)) or "no fault was found in this scene"

    __repr__ = __str__
