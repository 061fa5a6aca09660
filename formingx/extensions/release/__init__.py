"""Springback of a formed part, and its mesh: `Path.released`, `Path.formed`, `Path.to_msh`.

Imports `remeshing` where a formed body gets new elements (`Path.formed(size=...)`).
"""

from . import formed, released

__all__ = ["formed", "released"]
