"""Springback of a formed part, and its mesh: `Path.springback`, `Path.deformed_mesh`, `Path.to_msh`.

Imports `remeshing` where a formed body gets new elements (`Path.deformed_mesh(size=...)`).
"""

from . import deformed_mesh, springback

__all__ = ["deformed_mesh", "springback"]
