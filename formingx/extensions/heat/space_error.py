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
    """Estimator of the error of a body's temperatures by `finer`, with cubic elements, which `destroy` frees."""

    def __init__(self, body: Conduction, finer: Conduction):
        self._body, self._finer = body, finer
        self._values, self._cubic_values = fem.Function(body.space), fem.Function(finer.space)

    def largest(self, state: list[np.ndarray], time: float) -> tuple[float, np.ndarray]:
        """Estimate the largest error of the temperature, degrees, and its reference position, shape (2,); collective.

        The error is the largest nodal value of a correction e of cubic elements, (M + t K) e = t (R(T) - M dT/dt).
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
        """Interpolate the contact of quadratic elements to the k contact nodes of cubic ones, 0 to 1, shape (k,)."""
        values = np.zeros(len(self._body.points))
        values[touch.dofs] = touch.conductance > 0
        return self._in_cubic_space(values)[finer.dofs]

    def destroy(self) -> None:
        """Free the PETSc objects of `finer` (collective)."""
        self._finer.destroy()

    def _face_temperatures(self, touch: HeatContact, finer: HeatContact, excess: np.ndarray) -> np.ndarray:
        """Return excess tool temperatures (k, m) below cubic nodes: column 0 interpolated, others without effect."""
        found = np.zeros((len(finer.dofs), excess.shape[1]))
        if touch.conducts:
            values = np.zeros(len(self._body.points))
            values[touch.dofs] = excess[:, 0]
            found[:, 0] = self._in_cubic_space(values)[finer.dofs]
        return found

    def _in_cubic_space(self, own: np.ndarray) -> np.ndarray:
        """Return owned nodal values (n,) of quadratic elements as owned values (k,) in the space of cubic ones."""
        self._values.x.array[: len(own)] = own
        self._values.x.scatter_forward()
        self._cubic_values.interpolate(self._values)
        return self._cubic_values.x.array[: len(self._finer.points)].copy()
