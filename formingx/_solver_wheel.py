"""DOLFINx from PyPI, if it is there: `dolfinx_solver` loads the MPI library, and must be imported before DOLFINx.

It refuses, with a message, an environment that has a second PETSc. Its MPICH has 2046 communicators. DOLFINx does not
look at errors of MPI, and would crash without a message where no communicator is left. So MPI ends the process, with a
message.
"""

import contextlib

with contextlib.suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401
    from mpi4py import MPI
    for _comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        _comm.Set_errhandler(MPI.ERRORS_ARE_FATAL)
