"""formingx: how polymers are formed, simulated with finite elements on FEniCSx."""

from . import mesh
from .checkpoint import load
from .data import treloar1944
from .doctor import doctor
from .errors import ConvergenceError, InputError
from .fit import Fit, fit
from .physics import tools
from .physics.contact import Contact
from .physics.incompressibility import DisplacementPenalty, Membrane, MixedPressure
from .physics.kinematics import Axisymmetric, PlaneStrain
from .physics.loads import Pressure
from .physics.materials import ArrudaBoyce, Gent, Hyperelastic, MooneyRivlin, NeoHookean, Ogden, Yeoh
from .physics.supports import Clamped, Displaced, PinnedNode, SimplySupported, Symmetry
from .physics.tools import Tool
from .results.compare import Comparison, compare
from .results.measures import displacement, enclosed_volume, pole_height, pole_stretch, pressure, process_time, travel
from .results.nodal import NodalComparison, compare_nodes, write_nodes
from .results.path import Path, State
from .results.profile import Profile
from .results.stress import Stress, StressField
from .scene import Scene
from .solve.bordered import Tolerances
from .solve.continuation import trace
from .solve.newton import solve
from .solve.process import Process, Stage
from .solve.stepping import StepControl
