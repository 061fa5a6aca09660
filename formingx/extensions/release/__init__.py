"""Springback of a formed part, and its mesh: `Path.springback`, `Path.deformed_mesh`, `Path.to_msh`.

`Path.deformed_mesh(size=...)` imports the extension `remeshing`, for new elements.
"""

from . import deformed_mesh, springback

__all__ = ["deformed_mesh", "springback"]
