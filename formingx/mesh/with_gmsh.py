"""Temporary gmsh models, in the open session of a script or in a new one."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

_DEFAULTS = {"General.Terminal": 0, "Mesh.Algorithm": 6, "Mesh.ElementOrder": 1, "Mesh.RecombineAll": 0,
             "Mesh.MeshSizeFactor": 1, "Mesh.MeshSizeMin": 0, "Mesh.MeshSizeMax": 1e22, "Mesh.MeshSizeFromPoints": 0,
             "Mesh.MeshSizeFromCurvature": 0, "Mesh.MeshSizeExtendFromBoundary": 1}
"""Default options of gmsh, without its output and without mesh sizes at points; a script may have set others."""


@contextmanager
def model(name: str, options: Mapping[str, float] | None = None) -> Iterator[Any]:
    """Provide gmsh with a new model within a block; afterwards the script's model and options are restored.

    Args:
        name: name of the model.
        options: {name: value} of gmsh options.

    Yields:
        The module gmsh.
    """
    import gmsh
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
