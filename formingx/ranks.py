"""Values gathered from all ranks, and combined over them."""

from typing import Any

import numpy as np
from mpi4py import MPI


def gathered(comm: Any, own: Any) -> np.ndarray:
    """Return the rows (m, ...) of all ranks, in their order, as an array (n, ...); collective."""
    return np.concatenate(listed(comm, own))


def listed(comm: Any, own: Any) -> list[Any]:
    """Return the values of all ranks in a list, in their order; one rank avoids the copy; collective."""
    return [own] if comm.size == 1 else comm.allgather(own)


def combined(comm: Any, own: Any, operation: MPI.Op = MPI.SUM) -> Any:
    """Return the values of all ranks combined by an operation; one rank avoids the copy; collective."""
    return own if comm.size == 1 else comm.allreduce(own, operation)
