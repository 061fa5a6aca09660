"""Check of the accuracy of walls that the chosen elements of a sheet promise."""

from __future__ import annotations

from collections.abc import Iterator

from ..findings import Finding, register
from ..mesh.contact_columns import is_thick_sheet
from .sizes import SizedBody


@register("start")
def walls(body: SizedBody) -> Iterator[Finding]:
    """Report sheets on tools whose walls may miss the accuracy that `accuracy=` promises (docs/accuracy.md)."""
    mesh = body.scene.mesh
    for text in mesh.inaccurate:
        yield Finding("warning", "mesh", text)
    if mesh.preset is not None and is_thick_sheet(mesh) and body.scene.contacts:
        yield Finding("note", "mesh", f"the elements of accuracy = {mesh.preset.accuracy!r} are chosen without the"
                      " tools for a sheet thicker than a tenth of its length: its walls have no promised accuracy."
                      " Compare runs with two numbers of elements")
