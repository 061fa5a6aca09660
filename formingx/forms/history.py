"""Protocol of history variables: arguments of the residual F that change when a state is accepted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np


class Start(Protocol):
    """Interface of the state at the beginning of a step; the accepted states of a path have it."""

    @property
    def x(self) -> np.ndarray:
        """Unknowns, locally owned entries, shape (n,)."""

    @property
    def control(self) -> float:
        """Load parameter (control), dimensionless."""


class History(Protocol):
    """Interface of the history variables of a material, a contact or the temperature.

    Contacts are updated first, then materials, then the temperature, which receives the heat that they dissipate. A
    run uses the methods as follows:

    - `start` sets the values of the reference configuration.
    - `get` stores the values, `advance` updates them to the end of a trial step, and `put` restores the stored ones.
    - `advance` alone accepts a state.
    - `get` and `put` also change to another accepted state and back.
    - `save` makes data for a file, and `load` takes them back, on any number of ranks.
    - `transfer` transfers the values to a problem of the same body on another mesh.

    The result of `get` is never changed and is valid on the same ranks only. The result of `save` is valid on any
    ranks.
    """

    def start(self) -> None:
        """Set the history variables to their values in the reference configuration."""

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Update the history variables to a state at the end of a step; the forms must be set to this state.

        Args:
            x: unknowns of the state, locally owned entries, shape (n,).
            control: load parameter (control) of the state, dimensionless.
            start: state at the beginning of the step; None for histories that do not depend on it.
        """

    def get(self) -> Any:
        """Return the current history variables.

        Returns:
            Values that `put` accepts.
        """

    def put(self, variables: Any) -> None:
        """Set the history variables.

        Args:
            variables: values from `get`.
        """

    def save(self, variables: Any) -> dict[str, Any]:
        """Return history variables as plain data and arrays, the same on all ranks; collective.

        Args:
            variables: values from `get`.

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
            InputError: the data belong to another mesh, material or boundary.
        """

    def transfer(self, source: Any, variables: Any, x: np.ndarray, control: float,
                 mapping: Callable[[np.ndarray], np.ndarray]) -> Any:
        """Return the history variables on this mesh, from a problem of the same body on another mesh; collective.

        Args:
            source: history of the same material, contact or temperature in the other problem. That problem must be set
                to the state to transfer.
            variables: history variables of `source` in this state.
            x: unknowns of the state on this mesh, locally owned entries, shape (n,). The forms of this problem must be
                set to them.
            control: load parameter (control) of the state, dimensionless.
            mapping: function from reference points of the other mesh, shape (n, coordinates), to points of this mesh.

        Returns:
            Values that `put` accepts.
        """


@runtime_checkable
class ConstitutiveHistory(History, Protocol):
    """Interface of the history variables of one material of the body.

    Attributes:
        rate_dependent: True if the stress depends on time; False if it depends on past strains alone.
    """

    rate_dependent: bool

    def forget_motion(self) -> None:
        """Reset the internal variables that describe the motion in the last step (`Material.motion_variables`).
        The time integration of the next step then assumes no earlier motion."""
