"""A scene in words."""

from __future__ import annotations

import re
from typing import Any


def summary(scene: Any) -> dict[str, str]:
    """{part: one line for people} of a scene; not collective."""
    mesh, extent = scene.mesh, scene.extent
    lines = {"mesh": f"{mesh.domain.topology.index_map(2).size_global} six-node triangles, {extent[0]:.6g} by"
                     f" {extent[1]:.6g} (R, Z); layers: {', '.join(mesh.layers)}"
                     f"; boundaries: {', '.join(mesh.boundaries)}"}
    for name, material in scene.materials.items():
        lines[f"material of {name}"] = text(material)
    for kind in ("supports", "loads", "contacts"):
        for k, thing in enumerate(getattr(scene, kind), 1):
            numbers = "".join(f", {name.replace('_', ' ')} {value!r}" for name, value in vars(thing).items()
                              if isinstance(value, int | float) and repr(value) not in text(thing))
            lines[f"{kind[:-1]} {k}"] = text(thing) + numbers + (" (driven)" if thing.driven else "")
    return lines | {"model": text(scene.model), "kinematics": text(scene.kinematics),
                    "quadrature degree": str(scene.quadrature_degree),
                    **({} if scene.temperature is None else {"temperature": text(scene.temperature)})}


def text(thing: Any) -> str:
    """repr without memory addresses; of an object that has none of its own, its kind and its public attributes."""
    if type(thing).__repr__ is object.__repr__:
        inside = ", ".join(f"{k}={v!r}" for k, v in vars(thing).items() if not k.startswith("_"))
        return f"{type(thing).__name__}({inside})"
    return re.sub(r" at 0x[0-9a-f]+", "", repr(thing))
