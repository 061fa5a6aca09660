"""Loss of stability and buckling modes of axisymmetric bodies."""

from . import hoop
from .imperfection import imperfect
from .instability import unstable
from .top_load import TopLoad, top_load
