"""Rigid tools: profiles of lines and arcs, ready-made shapes, files of other programs, tools in three dimensions."""

from .files import read
from .profile import Tool
from .shapes import Pot, bottle, clamp_ring, cone, cup, cylinder, male, plane, pot, sphere
