r"""Estimate of the discretisation error of a temperature, by its change in a space of one degree more.

The residual of the temperature and of its time derivative, tested by cubics, drives a correction e over the time t of
the run:

.. math:: (M + t K) e = t \left(R(T) - M \frac{dT}{dt}\right)

For errors that vary on a short length this is the elliptic reconstruction of Makridakis and Nochetto, SIAM J. Numer.
Anal. 41 (2003) 1585-1594.
"""

import numpy as np
from dolfinx import fem

from ...ranks import gathered
from .conduction import Conduction
from .contact import HeatContact


class SpaceError:
    """Estimator of the discretisation error of the temperatures of a body with quadratic elements.

    Args:
        body: heat equation of the run, with quadratic elements.
        finer: heat equation of the same body with cubic elements; `destroy` frees it.
    """

    def __init__(self, body: Conduction, finer: Conduction):
        self._body, self._finer = body, finer
        self._values, self._cubic_values = fem.Function(body.space), fem.Function(finer.space)

    def largest(self, state: list[np.ndarray], time: float) -> tuple[float, np.ndarray]:
        """Estimate the largest discretisation error of the temperature in a state; collective.

        The estimate is the largest absolute nodal value of a correction e in the space of cubic elements. It satisfies
        (M + t K) e = t (R(T) - M dT/dt), with capacity matrix M, conductivity matrix K, rate of heat R and time t. R
        contains the present temperatures of the faces of tools. K contains the response of the tools to e.

        Args:
            state: temperatures of the body, shape (n,). Then for each tool in contact its excess temperatures over its
                back, at m nodes along the depth, shape (contact nodes, m).
            time: time since the start of the run.

        Returns:
            Error, degrees. Reference position of the largest error in the body, shape (2,), length.
        """
        body, finer = self._body, self._finer
        slope = body.slope(body.rates(state)[0][0])
        in_tools = [self._face_temperatures(*each)
                    for each in zip(body.tool_contacts, finer.tool_contacts, state[1:], strict=True)]
        rates, _ = finer.rates([self._in_cubic_space(state[0]), *in_tools])
        residual = time * (rates[0] - finer.mass(self._in_cubic_space(slope)))
        error, change = finer.difference([residual, *map(np.zeros_like, in_tools)], time)
        own = np.column_stack([np.abs(change), finer.points])
        rows = gathered(body.comm, own[np.argsort(own[:, 0])[-1:]])
        return error, rows[np.argmax(rows[:, 0]), 1:3]

    def contact_fraction(self, touch: HeatContact, finer: HeatContact) -> np.ndarray:
        """Interpolate the contact of the nodes of the quadratic elements to the k contact nodes of the cubic elements.

        The run takes a facet between nodes in contact as touching, even if its middle bridges a concave tool.

        Args:
            touch: contact with the tool, of the quadratic elements, with its present conductances.
            finer: the same contact, of the cubic elements.

        Returns:
            1 on facets whose nodes all touch, 0 where none of them touches, other values at the end of a contact, shape
            (k,).
        """
        values = np.zeros(len(self._body.points))
        values[touch.dofs] = touch.conductance > 0
        return self._in_cubic_space(values)[finer.dofs]

    def destroy(self) -> None:
        """Free the PETSc objects of `finer` (collective)."""
        self._finer.destroy()

    def _face_temperatures(self, touch: HeatContact, finer: HeatContact, excess: np.ndarray) -> np.ndarray:
        """Return the excess temperatures of a tool over its back, below the k contact nodes of cubic elements, degrees.

        The shape is (k, m). Column 0 is the face of the tool, interpolated from the contact nodes of the quadratic
        elements. The other m - 1 columns belong to nodes at a depth in the tool. They are 0, because they have no
        effect on the body.

        Args:
            touch: contact with the tool, of the quadratic elements.
            finer: the same contact, of the cubic elements.
            excess: excess temperatures of the tool over its back for the contact nodes of the quadratic elements, shape
                (contact nodes, m), degrees. The m nodes lie along the depth, the face first.
        """
        found = np.zeros((len(finer.dofs), excess.shape[1]))
        if touch.conducts:
            values = np.zeros(len(self._body.points))
            values[touch.dofs] = excess[:, 0]
            found[:, 0] = self._in_cubic_space(values)[finer.dofs]
        return found

    def _in_cubic_space(self, own: np.ndarray) -> np.ndarray:
        """Return the nodal values of a function in the space of cubic elements, locally owned entries, shape (k,).

        own: its nodal values in the space of quadratic elements, locally owned entries, shape (n,).
        """
        self._values.x.array[: len(own)] = own
        self._values.x.scatter_forward()
        self._cubic_values.interpolate(self._values)
        return self._cubic_values.x.array[: len(self._finer.points)].copy()
