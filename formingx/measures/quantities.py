"""Output quantities of a problem: base class, linear forms of the displacements, integrals, and the sag."""

from functools import cached_property
from typing import Any

import numpy as np
import ufl

from .. import _compat
from ..mesh.nodes import dof_positions


class Quantity:
    """Base class of output quantities of one problem, such as the height of its pole.

    A quantity has a value in a state. Its equation replaces the arc-length constraint in the step to a target.

    Attributes:
        size: scale of the quantity, in the user's units; differences below 1e-12 times `size` are round-off.
        smooth: True if the quantity is a smooth function of the displacements and the control alone.
    """

    size = 0.0
    smooth = True

    def value(self, x: Any, control: float) -> float:
        """Return the value of the quantity in a state, the unknowns x (PETSc vector), in the user's units."""
        raise NotImplementedError

    def equation(self, target: float) -> Any:
        """Return the equation c(x, lambda) = 0 that the quantity equals a target value, in the user's units.

        It is a function of the unknowns x, the control lambda and a PETSc vector. It returns c and dc/dlambda, both
        dimensionless, and sets the vector to dc/dx.
        """
        raise NotImplementedError


class WholePartQuantity(Quantity):
    """Output quantity of the whole part, if only a half, a quarter or an eighth of it is modelled (`Scene.symmetry`).

    The quantity of the modelled body is multiplied by `factor`, the number of its images that count.
    """

    def __init__(self, modelled: Quantity, factor: int):
        self._modelled, self._factor = modelled, factor
        self.size, self.smooth = factor * modelled.size, modelled.smooth

    def value(self, x, control):
        return self._factor * self._modelled.value(x, control)

    def equation(self, target):
        return self._modelled.equation(target / self._factor)


class Linear(Quantity):
    r"""Output quantity q that is a function of a linear form of the unknowns x.

    .. math:: q = f(y_0 + a \cdot x), \qquad c(x) = y_0 + a \cdot x - f^{-1}(q^*)

    Here c is the residual of its equation for the target value q*. The row a has locally owned entries, shape (n,).
    Values of f are in the user's units; default is the identity.
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


class Form(Quantity):
    r"""Output quantity q that is an integral over the body or its boundary.

    .. math:: q = q_0 + s \, I(x), \qquad c(x) = \frac{q - q^*}{s}

    Here c is the residual of its equation for the target value q*. I is a dimensionless UFL form of rank 0; s and q_0
    are in the user's units.
    """

    def __init__(self, problem, form, scale, offset=0.0):
        self._problem, self._scale, self._offset = problem, scale, offset
        self._form, self._value = form, problem.forms.compile(form)

    @cached_property
    def _derivative(self):
        """Compiled derivative dI/dx of the integral by the unknowns, a linear form."""
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


class Sag(Quantity):
    """Largest downward displacement, max(0, max_i(-u_z,i)), of a node from the first mesh of a run, length."""

    smooth = False

    def __init__(self, problem: Any):
        forms = problem.forms
        nodes = [dof for dim in forms.displacement_element.entity_dofs[:2] for entity in dim for dof in entity]
        dofs = np.unique(forms.space.sub(0).sub(forms.scene.kinematics.components - 1).dofmap.list[:, nodes])
        self._problem, self._dofs = problem, dofs[dofs < problem.n_owned]
        self.size = self._scale = forms.length
        self._earlier: np.ndarray | float = 0.0               # u_z of the nodes before this mesh was made, over length
        if (state_transfer := forms.scene.state_transfer) is not None:
            space, numbers = _compat.collapsed(forms.space.sub(0).sub(forms.scene.kinematics.components - 1))
            order = np.argsort(numbers)
            nodes_at = dof_positions(space)[order[np.searchsorted(numbers, self._dofs, sorter=order)]]
            self._earlier = (nodes_at - state_transfer.original_positions(nodes_at))[:, -1] / forms.length

    def _largest_sag(self, x: Any) -> tuple[float, int]:
        """Return the largest sag over `forms.length`, and the rank that owns its node; collective."""
        sag = -(x.array_r[self._dofs] + self._earlier).min(initial=0.0)
        found = self._problem.comm.allgather(float(sag))
        return max(found), int(np.argmax(found))

    def value(self, x, control):
        return self._scale * self._largest_sag(x)[0]

    def equation(self, target):
        def c(x, control, gradient):
            depth, rank = self._largest_sag(x)
            row = np.zeros(self._problem.n_owned)
            if self._problem.comm.rank == rank and len(self._dofs):
                row[self._dofs[np.argmin(x.array_r[self._dofs] + self._earlier)]] = -1.0
            self._problem.fill(gradient, row)
            return depth - target / self._scale, 0.0
        return c
