"""Interfaces through which extensions take part in a run, without an import of them in the core."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, runtime_checkable

from .errors import InputError
from .measures.targets import Target
from .mesh.mesh import Mesh
from .results.path import Path
from .scene.scene import Scene
from .solve.newton import Tolerances


@runtime_checkable
class StopCondition(Protocol):
    """Condition that ends a run as a result, for `trace(stop_at=...)`, such as `formingx.instability`."""

    def watch(self, path: Path) -> None:
        """Add a function to `path.record.on_step` that sets `path.record.ended` (text) to end the run."""


@runtime_checkable
class MeshRenewal(Protocol):
    """New meshes during a run, for `trace(remesh=...)`, such as `formingx.Remesh`."""

    def check(self, caller: str, scene: Scene, targets: Sequence[Target]) -> None:
        """Raise an InputError if the scene or a target cannot be transferred to another mesh."""

    def follow(self, path: Path, tolerances: Tolerances, part: Callable[[], None], done: Callable[[], bool]) -> None:
        """Continue a path with as many meshes as it needs.

        Args:
            path: the path, whose record receives a new segment for each mesh.
            tolerances: convergence tolerances.
            part: continues the run from its last state, on the mesh of that state.
            done: tells whether the target is reached.
        """


class MeshAdaptation(Protocol):
    """A mesh for the second run of a scene, made from the states of the first, for `trace(adapt_mesh=...)`."""

    def check(self, mesh: Mesh) -> None:
        """Raise an InputError if the mesh cannot be adapted."""

    def make(self, path: Path, options: Mapping[str, float]) -> Mesh:
        """Return the adapted mesh; options: arguments of `formingx.mesh.adapted`, whose names are checked before."""


dry_runs: dict[str, Callable[..., None]] = {}
"""Functions that call the user's code once without a run, by the public name that each replaces (`fx.check`)."""

_adaptation: list[MeshAdaptation] = []


def register_adaptation(adaptation: MeshAdaptation) -> None:
    """Provide the mesh adaptation of `trace(adapt_mesh=...)`; the last one that was registered is used."""
    _adaptation[:] = [adaptation]


def adaptation(caller: str) -> MeshAdaptation:
    """Return the registered mesh adaptation.

    Raises:
        InputError: none is registered, since the extension is not installed.
    """
    if not _adaptation:
        raise InputError(f"{caller}: adapt_mesh: the extension 'adapt' of formingx is not installed")
    return _adaptation[0]
