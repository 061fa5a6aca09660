"""Summary of a scene as text, a line for each of its parts."""

import contextlib
import re
from inspect import signature
from typing import Any

import numpy as np

from ..errors import InputError
from ..values.temperature import FunctionOfTemperature


def summary(scene: Any) -> dict[str, str]:
    """Return {part of a scene, such as "load 1": its description in a line}; not collective."""
    mesh, extent = scene.mesh, scene.extent
    kind, axes = ("six-node ", "(R, Z)") if scene.kinematics.components == 2 else ("", "(x, y, z)")
    if len(extent) == 3 and extent[2] <= 1e-9 * max(extent):
        extent, axes = extent[:2], "(x, y)"
    lines = {"mesh": f"{mesh.domain.topology.index_map(2).size_global} {kind}triangles,"
                     f" {' by '.join(f'{v:.6g}' for v in extent)} {axes}; layers: {', '.join(mesh.layers)}"
                     f"; boundaries: {', '.join(mesh.boundaries)}"}
    for name, material in scene.materials.items():
        lines[f"material of {name}"] = _material(material, _temperatures(scene))
    for kind in ("supports", "loads", "contacts"):
        for k, item in enumerate(getattr(scene, kind), 1):
            usual = {name: p.default for name, p in signature(type(item)).parameters.items()}
            numbers = "".join(f", {name.replace('_', ' ')} {value!r}" for name, value in vars(item).items()
                              if isinstance(value, int | float) and repr(value) not in text(item)
                              and name not in item.described and value != usual.get(name))
            lines[f"{kind[:-1]} {k}"] = text(item) + numbers + (" (driven)" if item.driven else "")
    return lines | {"model": text(scene.model), "kinematics": text(scene.kinematics),
                    "quadrature degree": str(scene.quadrature_degree),
                    **({} if scene.temperature is None else {"temperature": text(scene.temperature)}),
                    **({} if scene.heat is None else {"heat": text(scene.heat)})}


def _temperatures(scene: Any) -> list[float]:
    """Return the distinct temperatures that a scene gives as numbers: tools, and the body if it is uniform."""
    tools = [given.tool for given in scene.heat.tools.values()] if scene.heat is not None else []
    first = scene.temperature.T.x.array if scene.temperature is not None else []
    even = len(first) and np.ptp(first) == 0
    found = [*(t for t in tools if isinstance(t, int | float)), *(first[:1] if even else ())]
    return sorted({float(f"{t:.6g}") for t in found})


def _material(item: Any, temperatures: list[float]) -> str:
    """Return a material as text, with values at `temperatures` in place of lambda functions of the temperature."""
    found = text(item)
    for value in item.parameters.values():
        if isinstance(value, FunctionOfTemperature) and "<lambda>" in repr(value):
            values = []
            for T in temperatures:
                with contextlib.suppress(InputError):          # outside a table
                    values.append(f"{float(value(T)):.4g} at {T:g}")
            found = found.replace(text(value), f"({', '.join(values) or 'a function of the temperature'})", 1)
    return re.sub(r"\d+\.\d{7,}", lambda digits: f"{float(digits[0]):.6g}", found)


def text(item: Any) -> str:
    """Return the repr of an object without addresses, or its class and public attributes."""
    if type(item).__repr__ is object.__repr__:
        inside = ", ".join(f"{k}={v!r}" for k, v in vars(item).items() if not k.startswith("_"))
        return f"{type(item).__name__}({inside})"
    return re.sub(r" at 0x[0-9a-f]+", "", repr(item))
