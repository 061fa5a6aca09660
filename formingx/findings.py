"""Findings of the checks of a scene, of a run or of a failed run, with one scale of severity."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal, NamedTuple, Protocol, TypeVar

from .errors import check_name

log = logging.getLogger("formingx")

Severity = Literal["note", "warning", "serious"]
SEVERITIES: tuple[Severity, ...] = ("serious", "warning", "note")
"""Severities from the worst on. serious: the run is refused, or its results must not be used as they are. warning: the
scene may differ from the intended one, or a result is less accurate than usual. note: the accuracy is as usual."""

Moment = Literal["scene", "start", "end", "failure"]
"""Moment at which a check is called. scene: on request (`check`). start: on request, and before every run. end: after
a run. failure: after a failed run."""

Subject = TypeVar("Subject", contravariant=True)
_Check = TypeVar("_Check", bound=Callable[..., Iterable["Finding"]])


class Finding(NamedTuple):
    """Finding of a check.

    Attributes:
        severity: "serious", "warning" or "note" (`SEVERITIES`).
        about: part of the scene or of the result to which the finding refers, such as "mesh".
        text: description of the fault, with its numbers and position.
        advice: advice on how to mend the fault, or "".
    """

    severity: Severity
    about: str
    text: str
    advice: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.about}: {self.text}"


def percent(share: float) -> str:
    """Return a share as text in per cent, with two digits that count, such as "1.5 %" or "120 %"."""
    return f"{float(f'{100 * share:.2g}'):g} %"


def coordinates(point: Iterable[float], digits: int = 4) -> str:
    """Return a position as text, such as "(1.5, 0.25)", with a number of digits for each coordinate."""
    return f"({', '.join(f'{x:.{digits}g}' for x in point)})"


class Check(Protocol[Subject]):
    """Interface of a check: a function of a `SizedBody` before a run, of the `Path` after it, or of a `FailedRun`."""

    def __call__(self, subject: Subject, /) -> Iterable[Finding]:
        """Return or yield the findings on a subject; collective."""


_registered: dict[Moment, list[Check[Any]]] = {"scene": [], "start": [], "end": [], "failure": []}


def register(moment: Moment) -> Callable[[_Check], _Check]:
    """Return a decorator that registers a check for "scene", "start", "end" or "failure", in order.

    An unknown moment is an InputError.
    """
    check_name("register: moment", moment, _registered)

    def add(check: _Check) -> _Check:
        """Register a check, and return it unchanged."""
        _registered[moment].append(check)
        return check
    return add


def findings_at(moment: Moment, subject: Any) -> list[Finding]:
    """Return the findings of all checks of a moment, worst first; an error after a run is one, too; collective."""
    call = _findings_or_error if moment in ("end", "failure") else _findings
    return worst_first(finding for check in _registered[moment] for finding in call(check, subject))


def _findings(check: Check[Any], subject: Any) -> list[Finding]:
    """Return the findings of one check."""
    return list(check(subject))


def _findings_or_error(check: Check[Any], subject: Any) -> list[Finding]:
    """Return the findings of one check; an error in it becomes a warning that names check and error."""
    found: list[Finding] = []
    try:
        found.extend(check(subject))
    except Exception as error:
        name = getattr(check, "__name__", repr(check))
        log.debug("the check %s failed", name, exc_info=True)
        found.append(Finding("warning", name, f"the check {name!r} of the result failed: {error_text(error)}: what it"
                                              f" looks for is unknown; the states of the run are complete",
                             "Report the error, with the script."))
    return found


def error_text(error: BaseException) -> str:
    """Return the class and the message of an error as one line of text."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings sorted by severity, the worst first; the order within one severity is kept."""
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def without_notes(findings: Iterable[Finding]) -> list[Finding]:
    """Return the warnings and serious findings among some findings, in the given order."""
    return [finding for finding in findings if finding.severity != "note"]


def log_findings(findings: Sequence[Finding], rank: int) -> None:
    """Log each warning and serious finding once, on rank 0, as a warning of the logger "formingx"."""
    for finding in dict.fromkeys(without_notes(findings)) if rank == 0 else ():
        log.warning("%s: %s", finding.about, finding.text)
