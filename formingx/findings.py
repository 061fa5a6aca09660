"""Findings of checks on a scene, on a run and on its failure, on one scale of severity."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal, NamedTuple, Protocol, TypeVar

from .errors import known

log = logging.getLogger("formingx")

Severity = Literal["note", "warning", "serious"]
SEVERITIES: tuple[Severity, ...] = ("serious", "warning", "note")
"""Worst first. serious: the run is refused, or its results must not be used as they are. warning: the scene may be
another than was meant, or a result less exact than usual. note: the results are as exact as usual."""

Moment = Literal["scene", "start", "end", "failure"]
"""When a check runs. scene: a scene is looked over on request. start: before the first state of every run, too.
end: a run has ended. failure: a run could not go on."""

Subject = TypeVar("Subject", contravariant=True)
_Check = TypeVar("_Check", bound=Callable[..., Iterable["Finding"]])


class Finding(NamedTuple):
    """One finding of a check.

    Attributes:
        severity: "serious", "warning" or "note", see `SEVERITIES`.
        about: the part of the scene or of the result that it concerns.
        text: the finding as text, with numbers and the place.
        advice: what to try, or "".
    """

    severity: Severity
    about: str
    text: str
    advice: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.about}: {self.text}"


class Check(Protocol[Subject]):
    """A check of one subject: the body before a run (`Body`), a `Path` at its end, or the facts of a failure (dict)."""

    def __call__(self, subject: Subject, /) -> Iterable[Finding]:
        """Return the findings; collective."""


_registered: dict[Moment, list[Check[Any]]] = {"scene": [], "start": [], "end": [], "failure": []}


def register(moment: Moment) -> Callable[[_Check], _Check]:
    """Return a decorator that registers a check for one moment; the order of registration is the order of calls.

    Raises:
        InputError: the moment is not known.
    """
    known("register: moment", moment, _registered)

    def add(check: _Check) -> _Check:
        _registered[moment].append(check)
        return check
    return add


def found_at(moment: Moment, subject: Any) -> list[Finding]:
    """Return the findings of all checks that are registered for a moment, worst first; collective."""
    return worst_first(finding for check in _registered[moment] for finding in check(subject))


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings sorted by severity; findings of one severity keep their order."""
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def alarming(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings that are more than notes."""
    return [finding for finding in findings if finding.severity != "note"]


def tell(findings: Sequence[Finding], rank: int) -> None:
    """Log each alarming finding once, on rank 0."""
    for finding in dict.fromkeys(alarming(findings)) if rank == 0 else ():
        log.warning("%s: %s", finding.about, finding.text)
