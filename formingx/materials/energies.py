r"""Energies and internal variables of a material: the part of its interface that the forms use.

In a step the internal variables are updated implicitly. A potential of the step replaces the strain energy:

.. math:: P = \frac{\partial W_{step}}{\partial F}(F_{n+1}, \text{internal variables}_n, dt)
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np
import ufl


class Energies:
    """Energies and internal variables of a material, the base class of `Material`.

    By default a material has no internal variables, and all energies equal the strain energy.

    Attributes:
        parameters: {name: constant}.
        internal: {name: value in the reference configuration} of the internal variables; empty: no history.
        motion_variables: names of internal variables that describe the motion in the last step.
        tensor_powers: {name: 1 or -1} of internal variables that are tensors like C (1) or like its inverse (-1).
        rate_dependent: False if the history depends on the strain alone, and not on the time.
        integral: law of a stress that depends on all past states (`IntegralLaw`), or None.
        stores_energy: True if `stored_energy` is defined.
        symmetric: True if the tangent is symmetric.
        tested: tests from which the constants were fitted (a `MeasuredRange`), or None.
        branches: pairs (shear modulus, relaxation time) of a relaxing material, stress and time; else empty.
    """

    parameters: dict[str, Any]
    internal: dict[str, Any] = {}
    motion_variables: Any = ()
    tensor_powers: Any = MappingProxyType({})
    rate_dependent = True
    integral: Any = None
    stores_energy: Any = True
    symmetric: Any = True
    tested: Any = None
    branches: Any = ()

    def strain_energy(self, F: Any, *args: Any, **constants: Any) -> Any:
        """Return the strain energy per reference volume.

        For a material with internal variables it is the energy of a sudden deformation from the reference
        configuration.

        Args:
            F: deformation gradient (UFL, shape (3, 3)).
            args: not used.
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress), zero at F = I.

        Raises:
            NotImplementedError: a subclass without internal variables does not define this method.
        """
        if not self.internal:
            raise NotImplementedError
        rest = {name: ufl.as_ufl(value) if np.ndim(value) == 0 else ufl.as_tensor(value)
                for name, value in self.internal.items()}
        return self.step_energy(F, rest, ufl.as_ufl(0.0), **constants)

    @property
    def flow_constants(self) -> tuple[str, ...]:
        """Names of the constants that determine a rate of flow, such as relaxation times; by default none.

        A step in time uses their values in the middle of the step.
        """
        return ()

    def step_energy(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> Any:
        r"""Return the potential of a step in time; by default the strain energy.

        The nominal stress at the end of the step is

        .. math:: P = \frac{\partial W_{step}}{\partial F}

        Args:
            F: deformation gradient at the end of the step (UFL, shape (3, 3)).
            internal: {name: internal variable at the beginning of the step (UFL)}.
            time_step: length of the step (UFL scalar, time).
            constants: values of the constants by name.

        Returns:
            Potential :math:`W_{step}` per reference volume (UFL, stress).
        """
        return self.strain_energy(F, **constants)

    def updated(self, F: Any, internal: dict[str, Any], time_step: Any, **constants: Any) -> dict[str, Any]:
        """Return the internal variables at the end of a step in time; by default none.

        Args:
            F: deformation gradient at the end of the step (UFL, shape (3, 3)).
            internal: {name: internal variable at the beginning of the step (UFL)}.
            time_step: length of the step (UFL scalar, time).
            constants: values of the constants by name.

        Returns:
            {name: internal variable at the end of the step (UFL)}.
        """
        return {}

    def stored_energy(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the recoverable energy per reference volume in a state; by default the strain energy.

        Args:
            F: deformation gradient in the state (UFL, shape (3, 3)).
            internal: {name: internal variable in the state (UFL)}.
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress).
        """
        return self.strain_energy(F, **constants)

    def equilibrium_energy(self, F: Any, **constants: Any) -> Any:
        """Return the energy per reference volume after complete relaxation at a constant deformation.

        Args:
            F: deformation gradient (UFL, shape (3, 3)).
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress); None if the material keeps no stress, or if the energy is unknown.
        """
        return None if self.internal else self.strain_energy(F, **constants)

    def elastic_stretches(self, F: Any, internal: dict[str, Any], **constants: Any) -> list[Any]:
        """Return the largest principal elastic stretch of each relaxing branch in a state; by default an empty list.

        The stretch is 1 for a relaxed branch. Before any relaxation it is the largest isochoric stretch of F.

        Args:
            F: deformation gradient in the state (UFL, shape (3, 3)).
            internal: {name: internal variable in the state (UFL)}.
            constants: values of the constants by name.

        Returns:
            List of stretches (UFL scalars), one for each branch.
        """
        return []

    def dissipation(self, F: Any, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the dissipated power per reference volume in a state; by default 0.

        Args:
            F: deformation gradient in the state (UFL, shape (3, 3)).
            internal: {name: internal variable in the state (UFL)}.
            constants: values of the constants by name.

        Returns:
            Power (UFL, stress over time).
        """
        return ufl.as_ufl(0.0)

    def damage_energy(self, internal: dict[str, Any], **constants: Any) -> Any:
        """Return the energy per reference volume that damage has dissipated up to a state; by default 0.

        Args:
            internal: {name: internal variable in the state (UFL)}.
            constants: values of the constants by name.

        Returns:
            Energy (UFL, stress).
        """
        return ufl.as_ufl(0.0)
