"""Output quantities of a problem: the base class, linear and integral quantities, the sag."""

from functools import cached_property
from typing import Any

import numpy as np
import ufl

from ..mesh.nodes import of_space


class Bound:
    """Output quantity of one problem: its value, and the equation quantity = target for a run with this target.

    Attributes:
        size: scale of the quantity, in the user's units: differences below 1e-12 of it are round-off.
        smooth: True if it is a smooth function of the displacements and the control alone.
    """

    size = 0.0
    smooth = True

    def value(self, x: Any, control: float) -> float:
        """Return the value in a state.

        Args:
            x: unknowns.
            control: dimensionless control.

        Returns:
            The value, in the user's units.
        """
        raise NotImplementedError

    def equation(self, target: float) -> Any:
        """Return the equation c = 0 of a target value.

        Args:
            target: the target value, in the user's units.

        Returns:
            Function (x, control, gradient) -> (c, dc/dcontrol) that sets the vector `gradient` to dc/dx.
        """
        raise NotImplementedError


class OfWholePart(Bound):
    """Quantity of the modelled part times a factor for its images (`Scene.symmetry`).

    Args:
        modelled: quantity of the modelled part.
        factor: factor for the images.
    """

    def __init__(self, modelled: Bound, factor: int):
        self._modelled, self._factor = modelled, factor
        self.size, self.smooth = factor * modelled.size, modelled.smooth

    def value(self, x, control):
        return self._factor * self._modelled.value(x, control)

    def equation(self, target):
        return self._modelled.equation(target / self._factor)


class Linear(Bound):
    """Function of a linear form, f(offset + row . x).

    Args:
        problem: the `Problem`.
        row: row, locally owned entries, shape (n,).
        offset: the offset.
        function: function f.
        inverse: inverse of f.
    """

    def __init__(self, problem, row, offset=0.0, function=lambda y: y, inverse=lambda v: v):
        self._row, self._offset, self._function, self._inverse = problem.x.duplicate(), offset, function, inverse
        problem.fill(self._row, row)

    def value(self, x, control):
        return self._function(self._offset + self._row.dot(x))

    def equation(self, target):
        y = self._inverse(target)

        def c(x, control, gradient):
            self._row.copy(gradient)
            return self._offset + self._row.dot(x) - y, 0.0
        return c


class Form(Bound):
    """Offset plus scale times the value of a scalar form.

    Args:
        problem: the `Problem`.
        form: UFL form of rank 0.
        scale: the scale.
        offset: the offset.
    """

    def __init__(self, problem, form, scale, offset=0.0):
        self._problem, self._scale, self._offset = problem, scale, offset
        self._form, self._value = form, problem.forms.compile(form)

    @cached_property
    def _derivative(self):
        """Compiled derivative of the form."""
        forms = self._problem.forms
        return forms.compile(ufl.derivative(self._form, forms.w, forms.test_function()))

    def value(self, x, control):
        self._problem.set_state(x, control)
        return self._offset + self._scale * self._problem.assemble_scalar(self._value)

    def equation(self, target):
        def c(x, control, gradient):
            value = self.value(x, control)
            self._problem.fill(gradient, self._problem.assemble(self._derivative))
            return (value - target) / self._scale, 0.0
        return c


class Sag(Bound):
    """Downward displacement of the lowest node; among equal ones the first.

    Args:
        problem: the `Problem`.
    """

    smooth = False

    def __init__(self, problem: Any):
        forms = problem.forms
        nodes = [dof for dim in forms.displacement_element.entity_dofs[:2] for entity in dim for dof in entity]
        dofs = np.unique(forms.space.sub(0).sub(forms.scene.kinematics.components - 1).dofmap.list[:, nodes])
        self._problem, self._dofs = problem, dofs[dofs < problem.n_owned]
        self.size = self._scale = forms.length
        self._so_far: np.ndarray | float = 0.0               # u_z of the nodes before this mesh was made, over length
        if (brought := forms.scene.preformed) is not None:
            space, numbers = forms.space.sub(0).sub(forms.scene.kinematics.components - 1).collapse()
            order = np.argsort(numbers)
            nodes_at = of_space(space)[order[np.searchsorted(numbers, self._dofs, sorter=order)]]
            self._so_far = (nodes_at - brought.first_places(nodes_at))[:, -1] / forms.length

    def _deepest(self, x: Any) -> tuple[float, int]:
        """Return the sag over length, and the rank of the node."""
        mine = -(x.array_r[self._dofs] + self._so_far).min(initial=0.0)
        found = self._problem.comm.allgather(float(mine))
        return max(found), int(np.argmax(found))

    def value(self, x, control):
        return self._scale * self._deepest(x)[0]

    def equation(self, target):
        def c(x, control, gradient):
            depth, rank = self._deepest(x)
            row = np.zeros(self._problem.n_owned)
            if self._problem.comm.rank == rank and len(self._dofs):
                row[self._dofs[np.argmin(x.array_r[self._dofs] + self._so_far)]] = -1.0
            self._problem.fill(gradient, row)
            return depth - target / self._scale, 0.0
        return c
