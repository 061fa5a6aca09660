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

    `start` sets the values of the reference configuration. `advance` updates them to the end of a step; `get` stores
    them before, and `put` restores them, or another accepted state. `save` makes data for a file, `load` takes them
    back, on any number of ranks; `transfer` moves them to a problem of the same body on another mesh. The result of
    `get` is never changed, and is valid on the same ranks only. Contacts are updated first, then materials, then the
    temperature, which receives the heat that they dissipate.
    """

    def start(self) -> None:
        """Set the history variables to their values in the reference configuration."""

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Update to x, owned entries (n,), to which the forms are set; start: state at the beginning, or None."""

    def get(self) -> Any:
        """Return the current history variables, for `put`."""

    def put(self, variables: Any) -> None:
        """Set the history variables from `get`."""

    def save(self, variables: Any) -> dict[str, Any]:
        """Return history variables from `get` as plain data and arrays, the same on any number of ranks; collective."""

    def load(self, data: dict[str, Any]) -> Any:
        """Return values for `put` on this rank from data of `save`; InputError: another mesh, material or boundary."""

    def transfer(self, source: Any, variables: Any, x: np.ndarray, control: float,
                 mapping: Callable[[np.ndarray], np.ndarray]) -> Any:
        """Return values for `put` on this mesh from the history `source` on another mesh; collective.

        `source` has the same `variables`, and its problem must be set to the state to transfer, the forms of this one
        to x, owned entries, shape (n,). mapping: function from reference points there, shape (n, coordinates), to
        points here.
        """


@runtime_checkable
class ConstitutiveHistory(History, Protocol):
    """History variables of one material; `rate_dependent`: the stress depends on time, not on past strains alone."""

    rate_dependent: bool

    def forget_motion(self) -> None:
        """Reset variables of motion in the last step (`Material.motion_variables`): the next assumes no earlier one."""
