"""Temporary gmsh models, in the open session of a script or in a new one."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from ..errors import InputError

_DEFAULTS = {"General.Terminal": 0, "Mesh.Algorithm": 6, "Mesh.ElementOrder": 1, "Mesh.RecombineAll": 0,
             "Mesh.MeshSizeFactor": 1, "Mesh.MeshSizeMin": 0, "Mesh.MeshSizeMax": 1e22, "Mesh.MeshSizeFromPoints": 0,
             "Mesh.MeshSizeFromCurvature": 0, "Mesh.MeshSizeExtendFromBoundary": 1}
"""Default options of gmsh, without its output and without mesh sizes at points; a script may have set others."""

_LIBRARIES = "libglu1-mesa, libgl1, libgomp1, libxcursor1, libxft2 and libxinerama1"
"""Packages of Debian with the libraries that gmsh from PyPI loads."""


def imported() -> Any:
    """Return the module gmsh; InputError without it or a library of the system."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise InputError(f"meshes of free shape and STEP files need gmsh, which cannot be imported: {error}: install it"
                         f" by \"pip install 'formingx[cad]'\"; its libraries are in Debian's packages {_LIBRARIES}"
                         ) from None
    return gmsh


@contextmanager
def model(name: str, options: Mapping[str, float] | None = None) -> Iterator[Any]:
    """Provide gmsh with a new model and options in a block; the script's ones are then restored."""
    gmsh = imported()
    own_session = not gmsh.isInitialized()
    if own_session:
        gmsh.initialize(interruptible=False)
    requested = {**_DEFAULTS, **(options or {})}
    before = {option: gmsh.option.getNumber(option) for option in requested}
    current = gmsh.model.getCurrent()
    try:
        for option, value in requested.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add(name)
        yield gmsh
    finally:
        if own_session:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            for option, value in before.items():
                gmsh.option.setNumber(option, value)
