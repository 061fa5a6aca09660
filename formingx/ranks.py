"""Values gathered from all ranks, and combined over them."""

from typing import Any

import numpy as np
from mpi4py import MPI


def original(comm: Any) -> Any:
    """Return the communicator whose copy `comm` is, if that is MPI.COMM_WORLD or MPI.COMM_SELF, else `comm`.

    Python objects must not be passed on the copy that a DOLFINx object holds: mpi4py 4.0 keeps a lock for it, and if an
    exception frees the copy, this lock stays locked, and the next one is waited for without end.
    """
    return next((known for known in (MPI.COMM_WORLD, MPI.COMM_SELF)
                 if MPI.Comm.Compare(comm, known) in (MPI.IDENT, MPI.CONGRUENT)), comm)


def gathered(comm: Any, own: Any) -> np.ndarray:
    """Return the rows (m, ...) of all ranks, in their order, as an array (n, ...); collective."""
    return np.concatenate(listed(comm, own))


def listed(comm: Any, own: Any) -> list[Any]:
    """Return the values of all ranks in a list, in their order; one rank avoids the copy; collective."""
    return [own] if comm.size == 1 else comm.allgather(own)


def combined(comm: Any, own: Any, operation: MPI.Op = MPI.SUM) -> Any:
    """Return the values of all ranks combined by an operation; one rank avoids the copy; collective."""
    return own if comm.size == 1 else comm.allreduce(own, operation)
