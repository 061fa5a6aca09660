"""Derivatives of a scene's residual without contact: tangent matrix, and derivative with respect to the control."""

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from .constraints import Constraints
from .matrix import ExtendedMatrix


class Tangent:
    """Derivatives dF/dx and dF/dcontrol of the residual F, with the constraints of supports.

    x are the unknowns. `matrix` holds dF/dx, and `by_control` returns dF/dcontrol.

    Args:
        forms: the `Formulation`.
        constraints: the `Constraints` of its scene.
        symmetric: True if dF/dx is symmetric.

    Attributes:
        matrix: the `ExtendedMatrix` of dF/dx.
    """

    def __init__(self, forms: Any, constraints: Constraints, symmetric: bool):
        scene = forms.scene
        self.matrix = ExtendedMatrix(forms.compile(forms.tangent), forms.space.dofmap.index_map,
                                     [e.bc for e in constraints.entries], [row for _, row in constraints.means],
                                     forms.comm, symmetric)
        self._by_load, self._by_time = (form and forms.compile(form)
                                        for form in (forms.control_derivative, forms.time_derivative))
        self._movable = [k for k, item in enumerate(scene.items) if item in scene.supports and item.driven]
        self._by_motion = self._lift = None
        if constraints.can_move:
            self._lift = fem.Function(forms.space)              # driven unknowns load the others through the tangent
            self._by_motion = forms.compile(ufl.action(forms.tangent, self._lift))

    def enter(self, active: Any, rate: list[float], changed: bool) -> None:
        """Set the active constraints, and the motion of driven supports, for new step data.

        rate: `StepData.rate`. changed: True if the constraints differ from the current ones.
        """
        if changed:
            self.matrix.constrain(active.bcs, active.rows)
        if self._lift is not None:
            self._lift.x.array[:] = 0
            self._lift.x.array[active.dofs] = np.append(rate, 0.0)[active.driver]

    def by_control(self, rate: list[float], assemble: Callable[[Any], np.ndarray], n: int) -> np.ndarray:
        """Return dF/dcontrol, shape (n,), through loads, time and driven supports, by rates `StepData.rate`.

        `assemble` maps a compiled linear form to its n locally owned entries.
        """
        values = assemble(self._by_load) if self._by_load else np.zeros(n)
        if self._by_time and rate[-1]:
            values += assemble(self._by_time)
        if self._by_motion and any(rate[k] for k in self._movable):             # the same on all ranks
            values += assemble(self._by_motion)
        return values
