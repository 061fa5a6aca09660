"""One protocol for history variables: arguments of F that change when a state is accepted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np


class Start(Protocol):
    """The state that a step begins at: x, locally owned entries, and the control. A `State` is one."""

    x: np.ndarray
    control: float


class History(Protocol):
    """History variables of one part of a scene: materials, contacts, the temperature.

    The order of calls, contacts first, then materials, the temperature last, which takes the heat that they dissipate:

        start                   the body is in equilibrium;
        get, advance, put       a step is tried: the new history variables; back to the old ones;
        advance                 a state is accepted;
        get, put                to another accepted state, and back;
        save, load              to a file and back, on any number of ranks;
        carry                   to a problem of the same body on another mesh.

    A memory (`get`) is never changed, and fits only the ranks that it was made on; what `save` gives fits any.
    """

    def start(self) -> None:
        """Nothing has happened yet."""

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Accept the state of the forms; x: its owned unknowns. It becomes the beginning of a step.

        start: the state at the beginning of the step that ends now, if there is one.
        """

    def get(self) -> Any:
        """Return the memory now."""

    def put(self, memory: Any) -> None:
        """Go back, or on, to a memory."""

    def save(self, memory: Any) -> dict[str, Any]:
        """Return a memory as JSON can hold it but for arrays, independent of ranks and the same on all of them;
        collective."""

    def load(self, data: dict[str, Any]) -> Any:
        """Return the memory, locally owned entries, of the result of `save`; an InputError if it does not fit this
        scene."""

    def carry(self, source: Any, memory: Any, x: np.ndarray, control: float,
              there: Callable[[np.ndarray], np.ndarray]) -> Any:
        """Return the history variables of the same part, from a problem of the same body on
        another mesh; collective.

        Args:
            source: its history there; memory: of that. The problem there stands at the state that it belongs to.
            x, control: the state here that it belongs to (owned unknowns), at which the forms stand.
            there: says where reference points of the other mesh are in this one's, shape (n, coordinates) both.
        """


@runtime_checkable
class ConstitutiveHistory(History, Protocol):
    """The history of one material of the body.

    Attributes:
        rate_dependent: False if the history follows the strain alone.
    """

    rate_dependent: bool

    def forget_motion(self) -> None:
        """Let the body reach equilibrium: its motion so far predicts nothing of the next step."""
