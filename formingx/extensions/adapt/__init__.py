"""Meshes adapted to the states of a pilot run, for `trace(adapt_mesh=True)` and `formingx.mesh.adapted`."""

from collections.abc import Mapping
from typing import Any

from ...mesh.mesh import Mesh
from ...run_hooks import register_adaptation
from .adapted import adapted, checked_columns


class _Adaptation:
    """Adaptation of a mesh to the states of a pilot run by `adapted`; implements `formingx.run_hooks.MeshAdaptation`.
    """

    def check(self, mesh: Any) -> None:
        if mesh.domain.geometry.dim == 2:
            checked_columns(mesh)

    def make(self, path: Any, options: Mapping[str, float]) -> Mesh:
        return adapted(path, **options)


register_adaptation(_Adaptation())
