"""Meshes of six-node triangles: discs, spheres, parisons, and meshes from files; sheets in three dimensions."""

from .build import ACCURACY, disc, from_lines, parison, sphere
from .files import read, write
from .grid import Grid, to_grid
from .mesh import MPI, Mesh
