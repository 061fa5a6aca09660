"""formingx: how polymers are formed, simulated with finite elements on FEniCSx."""

from . import mesh
from .doctor import doctor
from .errors import ConvergenceError, InputError
from .materials.data import treloar1944
from .materials.fit import Fit, fit
from .materials.fit_in_time import TimedTest
from .materials.hyperelastic import ArrudaBoyce, Gent, Hyperelastic, MooneyRivlin, NeoHookean, Ogden, Yeoh
from .materials.viscoelastic import TransientNetwork, Viscoelastic
from .physics import tools
from .physics.contact import Contact
from .physics.kinematics import Axisymmetric, PlaneStrain
from .physics.loads import Pressure
from .physics.models import DisplacementPenalty, Membrane, MixedPressure
from .physics.supports import Clamped, Displaced, PinnedNode, SimplySupported, Symmetry
from .physics.tools import Tool
from .results.compare import Comparison, compare
from .results.compare_nodes import NodalComparison, compare_nodes, write_nodes
from .results.evaluate.profile import Profile
from .results.evaluate.stress import Stress, StressField
from .results.files.checkpoint import load
from .results.path import Path, State
from .scene.scene import Scene
from .solve.fixed import solve
from .solve.follow import trace
from .solve.newton import Tolerances
from .solve.process import Process, Stage
from .solve.stepping import StepControl
from .solve.targets import displacement, enclosed_volume, pole_height, pole_stretch, pressure, process_time, travel
