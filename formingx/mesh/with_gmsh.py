"""A gmsh model for the time of a mesh, in a session that a script has open, or in one of its own."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

_DEFAULTS = {"General.Terminal": 0, "Mesh.Algorithm": 6, "Mesh.ElementOrder": 1, "Mesh.RecombineAll": 0,
             "Mesh.MeshSizeFactor": 1, "Mesh.MeshSizeMin": 0, "Mesh.MeshSizeMax": 1e22, "Mesh.MeshSizeFromPoints": 0,
             "Mesh.MeshSizeFromCurvature": 0, "Mesh.MeshSizeExtendFromBoundary": 1}
"""Gmsh's own, but that it is silent and that points ask for no size: a script may have set others."""


@contextmanager
def model(name: str, options: Mapping[str, float] | None = None) -> Iterator[Any]:
    """gmsh with a new model and these options; then a script's session has its current model and options again."""
    import gmsh
    mine = not gmsh.isInitialized()
    if mine:
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
        if mine:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            for option, value in before.items():
                gmsh.option.setNumber(option, value)
