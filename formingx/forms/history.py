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

        start                   the body is in the reference configuration;
        get, advance, put       a step is tried: the new history variables; back to the old ones;
        advance                 a state is accepted;
        get, put                to another accepted state, and back;
        save, load              to a file and back, on any number of ranks;
        carry                   to a problem of the same body on another mesh.

    A memory (`get`) is never changed, and fits only the ranks that it was made on. The result of `save` fits all.
    """

    def start(self) -> None:
        """Set the history variables of the reference configuration."""

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Update the history variables for the state of the forms, where a step then begins. x: its owned unknowns.

        start: the state at the beginning of the step that ends now, if there is one.
        """

    def get(self) -> Any:
        """Return the present history variables (a memory)."""

    def put(self, memory: Any) -> None:
        """Set the history variables from a memory."""

    def save(self, memory: Any) -> dict[str, Any]:
        """Return a memory as plain data and arrays, independent of ranks and the same on all of them; collective."""

    def load(self, data: dict[str, Any]) -> Any:
        """Return the memory, locally owned entries, from the result of `save`.

        Raises:
            InputError: it does not fit this scene.
        """

    def carry(self, source: Any, memory: Any, x: np.ndarray, control: float,
              there: Callable[[np.ndarray], np.ndarray]) -> Any:
        """Return the history variables on this mesh, from a problem of the same body on another mesh; collective.

        Args:
            source: history of the same part in the other problem, which is set to the state of `memory`.
            memory: history variables of `source` in that state.
            x, control: the state of this problem (owned unknowns), which its forms are set to.
            there: function that maps reference points of the other mesh, shape (n, coordinates), to this mesh.
        """


@runtime_checkable
class ConstitutiveHistory(History, Protocol):
    """The history of one material of the body.

    Attributes:
        rate_dependent: False if the history follows the strain alone.
    """

    rate_dependent: bool

    def forget_motion(self) -> None:
        """Reset the variables of motion (`Material.of_motion`): the last step predicts nothing of the next one."""
