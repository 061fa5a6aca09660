"""Result of an implicit stage of a time step of heat conduction."""

from typing import NamedTuple

import numpy as np


class ImplicitStage(NamedTuple):
    """Result of an implicit stage of a time step, for a body and the tools in contact with it.

    Attributes:
        changes: changes of temperature since the start of the step, degrees. The first array is for the body, locally
            owned entries, shape (n,). An array for each tool in contact follows, shape (contact nodes, m), for the m
            nodes along the depth of the tool below each contact node.
        rates: rates of heat M dT/dt at the end of the stage, with the capacity matrix M, shapes as of `changes`. For
            the body they are divided by its heat capacity, degrees per time; for the tools they are per contact area.
        heats: heat per time into the whole body through each boundary and from each source, in the order of
            `Conduction.names`, without faces of prescribed temperature.
    """

    changes: list[np.ndarray]
    rates: list[np.ndarray]
    heats: np.ndarray
