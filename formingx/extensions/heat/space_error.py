"""An estimate of the error in three dimensions of a temperature: what a space of one degree more would change.

The residual of the temperature and of its change in time, tested by cubics, drives a correction over the time that the
run has taken: (M + t K) e = t (R(T) - M dT/dt). For a varying coefficient on a short length this is the elliptic
reconstruction of Makridakis and Nochetto, SIAM J. Numer. Anal. 41 (2003) 1585-1594.
"""

import numpy as np
from dolfinx import fem

from .conduction import Conduction
from .contact import Touch


class SpaceError:
    """Estimates for a body; `finer`: the same equations of degree 3, which are destroyed with it."""

    def __init__(self, body: Conduction, finer: Conduction):
        self._body, self._finer = body, finer
        self._values, self._raised_values = fem.Function(body.space), fem.Function(finer.space)

    def of(self, state: list[np.ndarray], time: float) -> float:
        """Return the largest estimated error of a state that was reached after a time, degrees; collective.

        The faces of tools are as hot as they are; their lines do answer to the correction.
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
        """Lines at the nodes of the finer space that have only the temperature of the tool's face."""
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
