"""Loss of stability and buckling modes of axisymmetric and plane-strain bodies, imperfections, and top loads."""

from . import hoop
from .imperfection import with_imperfection
from .instability import instability
from .top_load import TopLoad, top_load
