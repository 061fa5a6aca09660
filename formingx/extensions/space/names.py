"""Functions and classes in three dimensions that `formingx.mesh` and `formingx.tools` offer."""

from .curved import revolved as revolved_surface
from .curved import surface, tube
from .intersection import half, intersection
from .sheet import circle, rectangle, sheet
from .solid_tool import SolidTool, box, extruded, revolved, swept
from .triangulated import solid
from .union import union

MESHES = (circle, rectangle, sheet, tube, revolved_surface, surface)
"""Functions of `formingx.mesh`."""

TOOLS = (SolidTool, box, extruded, half, intersection, revolved, solid, swept, union)
"""Functions and classes of `formingx.tools`."""
