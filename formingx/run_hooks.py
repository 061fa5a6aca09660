"""Interfaces through which extensions take part in a run; the core does not import them."""

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
        """Register a function in `path.record.on_step` that ends the run by a text in `path.record.ended`."""


@runtime_checkable
class MeshRenewal(Protocol):
    """Remeshing during a run, for `trace(remesh=...)`, such as `formingx.Remesh`."""

    def check(self, caller: str, scene: Scene, targets: Sequence[Target]) -> None:
        """Check that the scene and its targets can be transferred to another mesh.

        Args:
            caller: name of the calling function, for messages.
            scene: the scene.
            targets: targets of the run.

        Raises:
            InputError: an item cannot be transferred.
        """

    def follow(self, path: Path, tolerances: Tolerances, part: Callable[[], None], done: Callable[[], bool]) -> None:
        """Continue a path on as many meshes as necessary.

        Args:
            path: the path; its record receives a new segment for each mesh.
            tolerances: convergence criteria.
            part: function that continues the run from its last state, on the mesh of this state.
            done: function that returns True if the target is reached.
        """


class MeshAdaptation(Protocol):
    """Adaptation of the mesh to the states of a first run, for `trace(adapt_mesh=...)`."""

    def check(self, mesh: Mesh) -> None:
        """Check that a mesh can be adapted.

        Raises:
            InputError: it cannot.
        """

    def make(self, path: Path, options: Mapping[str, float]) -> Mesh:
        """Return the adapted mesh.

        Args:
            path: the first run.
            options: arguments of `formingx.mesh.adapted`; their names are checked before.
        """


dry_runs: dict[str, Callable[..., None]] = {}
"""{public name: function that replaces it during `check`}; it calls the user's code once without a run."""

_adaptation: list[MeshAdaptation] = []


def register_adaptation(adaptation: MeshAdaptation) -> None:
    """Register the mesh adaptation of `trace(adapt_mesh=...)` in place of an earlier one."""
    _adaptation[:] = [adaptation]


def adaptation(caller: str) -> MeshAdaptation:
    """Return the registered mesh adaptation.

    Args:
        caller: name of the calling function, for the message.

    Raises:
        InputError: the extension `adapt` is not installed.
    """
    if not _adaptation:
        raise InputError(f"{caller}: adapt_mesh: the extension 'adapt' of formingx is not installed")
    return _adaptation[0]
