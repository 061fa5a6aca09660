"""Protocol of history variables: arguments of the residual F that change when a state is accepted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np


class Start(Protocol):
    """State at the beginning of a step; a `State` is one.

    Attributes:
        x: unknowns, locally owned entries, shape (n,).
        control: load parameter (control), dimensionless.
    """

    x: np.ndarray
    control: float


class History(Protocol):
    """History variables of one part of a scene: a material, a contact or the temperature.

    Contacts come first, then materials. The temperature comes last, since it takes the heat that they dissipate. Calls:

    - `start` sets the reference configuration.
    - `get`, `advance` and `put` try a step: they store, update and restore the variables.
    - `advance` alone accepts a state.
    - `get` and `put` go to another accepted state and return.
    - `save` and `load` write to and read from a file, on any number of ranks.
    - `transfer` transfers the variables to a problem of the same body on another mesh.

    The result of `get` is never changed and is valid on the same ranks only. The result of `save` is valid on any
    ranks.
    """

    def start(self) -> None:
        """Set the history variables of the reference configuration."""

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Update the history variables to the current state of the forms, where the next step begins.

        Args:
            x: unknowns of the state, locally owned entries, shape (n,).
            control: load parameter (control) of the state, dimensionless.
            start: state at the beginning of the step that ends now, or None.
        """

    def get(self) -> Any:
        """Return the present history variables.

        Returns:
            Values that `put` accepts.
        """

    def put(self, memory: Any) -> None:
        """Set the history variables.

        Args:
            memory: values from `get`.
        """

    def save(self, memory: Any) -> dict[str, Any]:
        """Return history variables as plain data and arrays, the same on all ranks; collective.

        Args:
            memory: values from `get`.

        Returns:
            Data that do not depend on the number of ranks.
        """

    def load(self, data: dict[str, Any]) -> Any:
        """Return the history variables of this rank from the result of `save`.

        Args:
            data: result of `save`.

        Returns:
            Values that `put` accepts.

        Raises:
            InputError: the data do not match this scene.
        """

    def transfer(self, source: Any, memory: Any, x: np.ndarray, control: float,
                 mapping: Callable[[np.ndarray], np.ndarray]) -> Any:
        """Return the history variables on this mesh, from a problem of the same body on another mesh; collective.

        Args:
            source: history of the same part in the other problem, which is set to the state of `memory`.
            memory: history variables of `source` in that state.
            x: unknowns of this problem, to which its forms are set, locally owned entries, shape (n,).
            control: load parameter (control) of the state, dimensionless.
            mapping: function from reference points of the other mesh, shape (n, coordinates), to points of this mesh.

        Returns:
            Values that `put` accepts.
        """


@runtime_checkable
class ConstitutiveHistory(History, Protocol):
    """History of one material of the body.

    Attributes:
        rate_dependent: False if the history depends on the strain alone.
    """

    rate_dependent: bool

    def forget_motion(self) -> None:
        """Reset the variables that store the motion in the last step (`Material.of_motion`).

        The next step is then integrated without this motion.
        """
