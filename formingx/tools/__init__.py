"""Rigid tools as profiles of lines and arcs: shapes, and what other programs have drawn; tools in three dimensions."""

from .files import read
from .profile import Tool
from .shapes import Pot, bottle, clamp_ring, cone, cup, cylinder, male, plane, pot, sphere
