"""Membranes in three dimensions and their tools."""

from typing import Any

from ...contact.tooling import register_tools, tool_of
from ...mesh.files import SurfaceReader, surface_readers
from ...physics.kinematics import ThreeD
from . import scene_checks
from .curved import stl_grid
from .intersection import HalfSpace, Intersection
from .reader import SheetReader
from .solid_tool import SolidTool, Swept
from .surface import Surface
from .surface_mesh import of_plain
from .union import Union


class _StoredFileTool(SolidTool):
    """Tool of a checkpoint that stores only the name of the STL file from which the tool was read, not its surface."""

    def __init__(self, name: str):
        self.name = name

    def __repr__(self) -> str:
        return f"solid({self.name!r})"


def _tool(shape: dict[str, Any]) -> SolidTool:
    """Return a tool from the data of a checkpoint, {attribute of the tool: value}, such as {"name": "mould.stl"}."""
    if "parts" in shape:
        found: SolidTool = Union([_tool(part) for part in shape["parts"]], shape["names"], shape.get("fillet", 0.0))
    elif "first" in shape:
        found = Intersection(_tool(shape["first"]), _tool(shape["second"]), shape["fillet"])
    elif "position" in shape:
        found = HalfSpace(shape["axis"], shape["sign"], shape["position"])
    elif "profile" in shape:
        found = Swept(tool_of(shape["profile"]), shape["kind"], tuple(shape["half"]), shape["corner"], shape["along"])
    else:
        found = _StoredFileTool(shape["name"])
    return found.moved(*shape.get("shift", (0.0, 0.0, 0.0)))


surface_readers.append(SurfaceReader(stl_grid, of_plain))
ThreeD.formulation = Surface
ThreeD.reader = SheetReader
ThreeD.scene_checks = scene_checks
register_tools(_tool)
