"""Arrays gathered from all ranks."""

from typing import Any

import numpy as np


def gathered(comm: Any, own: Any) -> np.ndarray:
    """Return an array with the rows of all ranks, in the order of the ranks; collective.

    Args:
        comm: MPI communicator.
        own: rows of this rank, shape (m, ...).

    Returns:
        Rows of all ranks, shape (n, ...), equal on all ranks.
    """
    return np.concatenate(comm.allgather(own))
