"""Import hook of an installed formingx, for DOLFINx from PyPI.

The libraries of PyPI's DOLFINx need the MPI library, which `dolfinx_solver` loads. With this hook a script may import
`dolfinx` or `petsc4py` before formingx.
"""

import contextlib
import sys


class _MPIFirst:
    """Finder that finds no module, and imports `dolfinx_solver` before the first import of DOLFINx or petsc4py."""

    def find_spec(self, name, path=None, target=None):
        """Return None, so that other finders find the module `name`."""
        if name in ("dolfinx", "petsc4py"):
            sys.meta_path.remove(self)
            with contextlib.suppress(ModuleNotFoundError):
                import dolfinx_solver  # noqa: F401


sys.meta_path.insert(0, _MPIFirst())
