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
    """Extension of a run: `formingx.Remesh` for `trace(remesh=)`, `formingx.instability` for `trace(stop_at=)`.

    Attributes:
        argument: argument of `formingx.trace` that takes the extension, "remesh" or "stop_at".
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
        """Register functions in `path.record.hooks` (`RunHooks`), which the run calls.

        A function that sets `path.record.ended` to a text, the reason, ends the run.

        Args:
            path: the path that the run continues.
        """
        raise NotImplementedError


class MeshAdaptation(Protocol):
    """Adaptation of the mesh to the states of a first run, for `trace(adapt_mesh=...)`."""

    def check(self, mesh: Mesh) -> None:
        """Check that `mesh` can be adapted.

        Raises:
            InputError: the mesh cannot be adapted.
        """

    def make(self, path: Path, options: Mapping[str, float]) -> Mesh:
        """Return the adapted mesh.

        Args:
            path: the first run.
            options: arguments of `formingx.mesh.adapted`; their names are checked before.
        """


def check_argument(caller: str, argument: str, given: Any, what: str) -> None:
    """Check that an argument of a run is an extension for this argument.

    Args:
        caller: name of the calling function, for messages.
        argument: "remesh" or "stop_at".
        given: the argument.
        what: description of the extension, for the message.

    Raises:
        InputError: the argument is no extension, or one for another argument.
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
    """Return the registered mesh adaptation.

    Args:
        caller: name of the calling function, for the message.

    Raises:
        InputError: the extension `adapt` is not installed.
    """
    if not _adaptation:
        raise InputError(f"{caller}: adapt_mesh: the extension 'adapt' of formingx is not installed")
    return _adaptation[0]
