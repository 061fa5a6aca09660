"""Energies and history of a material: the part of its interface that the forms use."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np
import ufl


class Energies:
    """Energies of a material, and its history; see `Material` for the attributes."""

    parameters: dict[str, Any]
    internal: dict[str, Any] = {}
    of_motion: Any = ()
    shapes: Any = MappingProxyType({})
    rate_dependent = True
    integral: Any = None
    stores_energy: Any = True
    symmetric: Any = True
    tested: Any = None
    branches: Any = ()

    def strain_energy(self, F: Any, *args: Any, **constants: Any) -> Any:
        """Return the strain energy per reference volume.

        For a material with a history it is the instantaneous energy, from the reference configuration.

        Args:
            F: deformation gradient (UFL, shape (3, 3)).
            args: not used.
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress), zero at F = I.
        """
        if not self.internal:
            raise NotImplementedError
        rest = {name: ufl.as_ufl(value) if np.ndim(value) == 0 else ufl.as_tensor(value)
                for name, value in self.internal.items()}
        return self.step_energy(F, rest, ufl.as_ufl(0.0), **constants)

    @property
    def of_flow(self) -> tuple[str, ...]:
        """Names of constants that set a rate of flow: a step uses their values at its middle."""
        return ()

    def step_energy(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> Any:
        """Return the potential of a step: its derivative by F is the stress at the end of the step.

        Args:
            F: deformation gradient at the end (UFL, shape (3, 3)).
            internal: internal variables at the beginning.
            time_step: length of the step (UFL scalar, time).
            constants: values of the constants by name.

        Returns:
            Potential per reference volume (UFL, stress).
        """
        return self.strain_energy(F, **constants)

    def updated(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> dict[str, Any]:
        """Return the internal variables at the end of a step.

        Args:
            F: deformation gradient at the end (UFL, shape (3, 3)).
            internal: internal variables at the beginning.
            time_step: length of the step (UFL scalar, time).
            constants: values of the constants by name.

        Returns:
            {name: UFL expression}.
        """
        return {}

    def stored_energy(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the stored energy per reference volume for given internal variables.

        Args:
            F: deformation gradient (UFL, shape (3, 3)).
            internal: internal variables in the same state.
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress).
        """
        return self.strain_energy(F, **constants)

    def equilibrium_energy(self, F: Any, **constants: Any) -> Any:
        """Return the energy per reference volume after complete relaxation.

        Args:
            F: deformation gradient (UFL, shape (3, 3)).
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress); None if there is none, or if it is unknown.
        """
        return None if self.internal else self.strain_energy(F, **constants)

    def elastic_stretches(self, F: Any, internal: dict[str, Any], **constants: Any) -> list[Any]:
        """Return the largest principal elastic stretch of each relaxing branch.

        The stretch is 1 for a relaxed branch, and the largest isochoric stretch of F before any relaxation.

        Args:
            F: deformation gradient (UFL, shape (3, 3)).
            internal: internal variables in the same state.
            constants: values of the constants by name.

        Returns:
            List of stretches (UFL scalars).
        """
        return []

    def dissipation(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the dissipated power per reference volume.

        Args:
            F: deformation gradient (UFL, shape (3, 3)).
            internal: internal variables in the same state.
            constants: values of the constants by name.

        Returns:
            Power (UFL, stress over time); 0 without a history.
        """
        return ufl.as_ufl(0.0)

    def damage_energy(self, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the energy dissipated by damage per reference volume.

        Args:
            internal: internal variables.
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress).
        """
        return ufl.as_ufl(0.0)
