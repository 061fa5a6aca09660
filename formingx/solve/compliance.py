"""Response of the linearised equations to forces at a few unknowns: all of it, or its part at these unknowns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from petsc4py import PETSc

from ..ranks import combined
from .equations import Array
from .linear import CONDENSATION, DirectSolver

Border: TypeAlias = Callable[[Array], Array]
"""Function that maps solutions V = K^-1 E, shape (n, m), to the bordered system, in place; it returns the changes of
the control, shape (m,)."""

Moved: TypeAlias = Callable[[Array, Array | float], Array]
"""Linear function of an update of the unknowns, shape (n,), and of the control; it returns motions, shape (k,). Several
updates are columns: it maps the shapes (n, m) and (m,) to (k, m)."""


@dataclass(frozen=True)
class BorderedTangent:
    r"""Border of the linear system of F = 0 with a constraint c = 0, as a function.

    It maps a solution V = K^-1 E with the tangent K to the solution (V', dlambda) of the bordered system:

    .. math:: \Delta\lambda = -\frac{\nabla c \cdot V}{s}, \qquad V' = V + b \, \Delta\lambda

    Here s is the slope, the derivative of c with respect to the control along the path.

    Attributes:
        gradient: vector dc/dx.
        b: vector dx/dcontrol along the path.
        slope: total derivative dc/dcontrol along the path.
    """

    gradient: PETSc.Vec
    b: PETSc.Vec
    slope: float

    def __call__(self, V: Array) -> Array:
        """Map solutions K^-1 E, owned rows, shape (n, m), to the bordered system in place.

        Return the changes of the control, shape (m,).
        """
        steps: Array = -combined(self.b.comm.tompi4py(), self.gradient.array_r @ V) / self.slope
        V += np.outer(self.b.array_r, steps)
        return steps


class BorderedColumns:
    """Solutions of the bordered system for m right-hand sides, such as unit forces at contact points.

    The bordered system is K dx = E for the tangent K, with the constraint of the step as a further row.

    Args:
        solver: solver with the factors of the tangent K.
        E: right-hand sides as columns, locally owned rows, shape (n, m).
        border: function that maps solutions K^-1 E, shape (n, m), to the bordered system in place. It returns the
            changes of the control, shape (m,).

    Attributes:
        steps: change of the control for each right-hand side, shape (m,).
    """

    def __init__(self, solver: DirectSolver, E: Array, border: Border):
        self._values = solver.solve_all(E)
        self.steps = border(self._values)

    def motions(self, moved: Moved) -> Array:
        """Return the motions of contact points, shape (k, m), length; `moved` maps (dx, dcontrol) to these motions."""
        return np.asfortranarray(moved(self._values, self.steps))         # a column of each force in one piece

    def update(self, factors: Array) -> tuple[Array, float]:
        """Return the updates of x, shape (n,), and of the control by factors of the right-hand sides, shape (m,)."""
        return self._values @ factors, float(self.steps @ factors)

    def updates(self, factors: Array) -> Array:
        """Return the updates of x, shape (n, k), by k columns of factors of the right-hand sides, shape (m, k)."""
        return self._values @ factors


class CondensedColumns:
    """Solutions of the bordered system for m right-hand sides that are zero in most rows.

    The bordered system is K dx = E for the tangent K, with the constraint of the step as a further row.

    Only the entries of K^-1 in the nonzero rows of the right-hand sides are computed. They give the solutions in these
    rows, and so the motions of contact points that depend on no other unknowns. One solution with the transposed K
    gives the changes of the control for all right-hand sides. Each update of all unknowns takes one solution with K.

    Args:
        solver: solver with the factors of the tangent K.
        E: right-hand sides as columns, shape (n, m).
        border: border of the system, from the constraint of the step.
        inverse: entries of K^-1 in `rows` and in the columns of the same numbers, shape (k, k).
        rows: numbers of the rows in which a right-hand side is not zero, shape (k,).

    Attributes:
        steps: change of the control for each right-hand side, shape (m,).
    """

    def __init__(self, solver: DirectSolver, E: Array, border: BorderedTangent, inverse: Array, rows: Array):
        self._solver, self._rows, self._E, self._border = solver, rows, E[rows], border
        self._found = inverse @ self._E
        adjoint = border.b.duplicate()
        solver.solve_transposed(border.gradient, adjoint)
        self.steps = -(adjoint.array_r[rows] @ self._E) / border.slope
        adjoint.destroy()

    def motions(self, moved: Moved) -> Array:
        """Return the motions of contact points, shape (k, m), length; `moved` maps (dx, dcontrol) to these motions."""
        V = np.zeros((self._border.b.getLocalSize(), self._found.shape[1]))
        V[self._rows] = self._found
        return moved(V, np.zeros(V.shape[1])) + np.outer(moved(self._border.b.array_r, 1.0), self.steps)

    def update(self, factors: Array) -> tuple[Array, float]:
        """Return the updates of x, shape (n,), and of the control by factors of the right-hand sides, shape (m,)."""
        rhs, out, step = self._border.b.duplicate(), self._border.b.duplicate(), float(self.steps @ factors)
        rhs.array_w[:] = 0.0
        rhs.array_w[self._rows] = self._E @ factors
        self._solver.solve(rhs, out)
        dx = out.array_r + step * self._border.b.array_r
        rhs.destroy()
        out.destroy()
        return dx, step

    def updates(self, factors: Array) -> Array:
        """Return the updates of x, shape (n, k), by k columns of factors of the right-hand sides, shape (m, k)."""
        return np.array([self.update(column)[0] for column in factors.T]).T


def columns(solver: DirectSolver, E: Array, border: Border) -> BorderedColumns | CondensedColumns:
    """Solve the bordered system for right-hand sides E, locally owned rows, shape (n, m); K is the factorised tangent.

    Entries of K^-1 are used if they cost less than m solutions and `border` is a `BorderedTangent`.
    """
    worthwhile = len(E) >= CONDENSATION.min_rows and E.shape[1] >= CONDENSATION.min_columns
    if isinstance(border, BorderedTangent) and worthwhile:
        rows = np.flatnonzero(E.any(axis=1))
        inverse = solver.inverse(rows)
        if inverse is not None:
            return CondensedColumns(solver, E, border, inverse, rows)
    return BorderedColumns(solver, E, border)
