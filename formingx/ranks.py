"""Arrays gathered from all ranks."""

from typing import Any

import numpy as np


def gathered(comm: Any, own: Any) -> np.ndarray:
    """Return the rows of all ranks, one rank after the other, on each of them; collective."""
    return np.concatenate(comm.allgather(own))
