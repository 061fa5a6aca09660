"""Meshes of six-node triangles: discs, spheres, parisons, and meshes read from files."""

from .build import ACCURACY, disc, parison, sphere
from .gmsh import read, to_grid, write
from .mesh import Mesh
