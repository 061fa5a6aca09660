"""Estimate of the discretisation error of a temperature: its change in a space of one degree more.

The residual of the temperature and of its change in time, tested by cubics, drives a correction over the time that the
run has taken: (M + t K) e = t (R(T) - M dT/dt). For errors that vary on a short length this is the elliptic
reconstruction of Makridakis and Nochetto, SIAM J. Numer. Anal. 41 (2003) 1585-1594.
"""

import numpy as np
from dolfinx import fem

from .conduction import Conduction
from .contact import Touch


class SpaceError:
    """Error estimator of a body.

    Args:
        body: the equations of the run.
        finer: the same equations of degree 3; `destroy` frees them.
    """

    def __init__(self, body: Conduction, finer: Conduction):
        self._body, self._finer = body, finer
        self._values, self._raised_values = fem.Function(body.space), fem.Function(finer.space)

    def of(self, state: list[np.ndarray], time: float) -> float:
        """Return the largest estimated error of a state that was reached after a time, degrees; collective.

        The faces of tools keep their temperatures; their lines respond to the correction.
        """
        body, finer = self._body, self._finer
        slope = body.slope(body.rates(state)[0][0])
        lines = [self._faces(*each) for each in zip(body.touches, finer.touches, state[1:], strict=True)]
        rates, _ = finer.rates([self._raised(state[0]), *lines])
        left = time * (rates[0] - finer.mass(self._raised(slope)))
        return finer.difference([left, *(np.zeros_like(line) for line in lines)], time)

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._finer.destroy()

    def _faces(self, touch: Touch, finer: Touch, lines: np.ndarray) -> np.ndarray:
        """Return lines at the nodes of the finer space, with the temperature of the tool's face and 0 below it."""
        found = np.zeros((len(finer.dofs), lines.shape[1]))
        if touch.conducts:
            values = np.zeros(len(self._body.points))
            values[touch.dofs] = lines[:, 0]
            found[:, 0] = self._raised(values)[finer.dofs]
        return found

    def _raised(self, own: np.ndarray) -> np.ndarray:
        """Return a P2 function, owned part, in the finer space, owned part."""
        self._values.x.array[: len(own)] = own
        self._values.x.scatter_forward()
        self._raised_values.interpolate(self._values)
        return self._raised_values.x.array[: len(self._finer.points)].copy()
