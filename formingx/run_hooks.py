"""Interfaces through which extensions take part in a run; the core does not import them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from .errors import InputError
from .measures.targets import Target
from .mesh.mesh import Mesh
from .results.path import Path
from .scene.scene import Scene


class RunExtension:
    """Base class of extensions that take part in a run: `formingx.Remesh` and the result of `formingx.instability`.

    Attributes:
        argument: name of the argument of `formingx.trace` for the extension, "remesh" or "stop_at".
    """

    argument = ""

    def check(self, caller: str, scene: Scene, targets: Sequence[Target]) -> None:
        """Check that the extension can take part in a run.

        Args:
            caller: name of the calling function, for messages.
            scene: the scene.
            targets: targets of the run.

        Raises:
            InputError: the extension cannot take part.
        """

    def attach(self, path: Path) -> None:
        """Register functions that the run calls in `path.record.hooks` (`RunHooks`).

        Such a function ends the run if it sets `path.record.ended` to the reason, as text.

        Args:
            path: the path that the run continues.
        """
        raise NotImplementedError


class MeshAdaptation(Protocol):
    """Adaptation of the mesh to the states of a first run, for `trace(adapt_mesh=...)`."""

    def check(self, mesh: Mesh) -> None:
        """Raise an InputError if `mesh` cannot be adapted."""

    def make(self, path: Path, options: Mapping[str, float]) -> Mesh:
        """Return a mesh of the body adapted to a first run, by checked options of `formingx.mesh.adapted`."""


def check_argument(caller: str, argument: str, given: Any, what: str) -> None:
    """Raise an InputError unless the argument `remesh` or `stop_at` of a run is a `RunExtension` for this argument.

    what: description of the required extension, for the message.
    """
    if not isinstance(given, RunExtension) or given.argument != argument:
        raise InputError(f"{caller}: {argument} = {given!r}: must be {what}")


dry_runs: dict[str, Callable[..., None]] = {}
"""{public name: function that replaces it during `check`}. The function calls the user's code once, without a run."""

_adaptation: list[MeshAdaptation] = []


def register_adaptation(adaptation: MeshAdaptation) -> None:
    """Register the mesh adaptation of `trace(adapt_mesh=...)`; it replaces an earlier one."""
    _adaptation[:] = [adaptation]


def adaptation(caller: str) -> MeshAdaptation:
    """Return the registered mesh adaptation; InputError in the name of `caller` without the extension `adapt`."""
    if not _adaptation:
        raise InputError(f"{caller}: adapt_mesh: the extension 'adapt' of formingx is not installed")
    return _adaptation[0]
