"""Chord iterations: Newton's method with a tangent that was kept (Ortega and Rheinboldt 1970, section 7.1)."""

from __future__ import annotations

from typing import Any

_SEVERAL = 3
"""Chord iterations that may cost less than one with a new tangent: each costs a residual and a solve, about a sixth."""

_SLOW = 0.1
"""Fall of the residual in an iteration above which a tangent is not kept: round-off would look like convergence."""


class Chords:
    """Whether the tangent that is there serves for the next iteration: if `_SEVERAL` like the last one will do.

    For the first iteration of a step it is that of a state before. How far a residual falls with such a tangent is
    known from the last step that began with one; that is halved for every step since, so that it is tried again.
    """

    def __init__(self) -> None:
        self._setting: Any = None                           # of the tangent; None: there is none
        self._before, self._fall = 0.0, 1.0

    def made(self, setting: Any) -> None:
        """There is another tangent, of an equation with this setting; None: it could not be made."""
        self._setting = setting

    def begin(self, setting: Any, allowed: bool) -> None:
        """Newton's method begins at a guess; `allowed`: of a step in which tangents may be kept."""
        self._allowed, self._first = allowed, True
        self._fall = self._before if self._setting is setting else 1.0

    def serve(self, residual: float, wanted: float) -> bool:
        """True if the tangent serves for the next iteration, from this residual to the one wanted."""
        return bool(self._allowed and self._fall < _SLOW and residual * self._fall**_SEVERAL < wanted)

    def took(self, chord: bool, fall: float) -> None:
        """An iteration, with a tangent that was kept or not, made the residual fall by a factor."""
        if self._allowed and self._first:
            self._before = fall if chord else self._before / 2
        self._fall, self._first = fall, False
