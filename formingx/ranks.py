"""Values gathered from all ranks, and combined over them."""

from typing import Any

import numpy as np
from mpi4py import MPI


def gathered(comm: Any, own: Any) -> np.ndarray:
    """Return an array with the rows of all ranks, in the order of the ranks; collective.

    Args:
        comm: MPI communicator.
        own: rows of this rank, shape (m, ...).

    Returns:
        Rows of all ranks, shape (n, ...), equal on all ranks.
    """
    return np.concatenate(listed(comm, own))


def listed(comm: Any, own: Any) -> list[Any]:
    """Return the values of all ranks in a list, in the order of the ranks; collective.

    On one rank the list has the value itself: mpi4py would copy it through bytes.

    Args:
        comm: MPI communicator.
        own: value of this rank.

    Returns:
        List, equal on all ranks.
    """
    return [own] if comm.size == 1 else comm.allgather(own)


def combined(comm: Any, own: Any, operation: MPI.Op = MPI.SUM) -> Any:
    """Return the values of all ranks combined by an operation, such as their sum; collective.

    On one rank the result is the value itself: mpi4py would copy it through bytes.

    Args:
        comm: MPI communicator.
        own: value of this rank.
        operation: operation of MPI.

    Returns:
        The combined value, equal on all ranks.
    """
    return own if comm.size == 1 else comm.allreduce(own, operation)
