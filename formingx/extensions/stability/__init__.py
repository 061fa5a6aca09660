"""Loss of stability and buckling modes of axisymmetric bodies."""

from . import hoop
from .imperfection import with_imperfection
from .instability import instability
from .top_load import TopLoad, top_load
