"""formingx: finite element simulation of polymer forming with FEniCSx.

The examples of all classes and functions begin with these lines (mm and MPa):

>>> import formingx as fx
>>> import numpy as np
>>> sheet = fx.mesh.disc(radius=10.0, thickness=0.3, elements=(8, 1))
>>> scene = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=0.4), loads=[fx.Pressure("bottom")],
...                  supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
>>> path = fx.trace(scene, until=fx.pole_height(12.0), progress=False)
"""

import sys as _sys

from . import _solver_wheel  # isort: skip  # loads MPI, before any other module
from . import _calls, _interrupts, exact, mesh, tools
from ._extensions import add as _add
from ._extensions import list_public as _list_public
from ._extensions import optional as _optional
from .checks.check import check
from .errors import ConvergenceError, InputError, Interrupted
from .materials.constants import entropic, of_temperature
from .materials.hyperelastic import ArrudaBoyce, Gent, Hyperelastic, MooneyRivlin, NeoHookean, Ogden, Yeoh
from .materials.material import Material
from .materials.published import published
from .materials.solidification import Solidification
from .materials.viscoelastic import TransientNetwork, Viscoelastic
from .measures.forces import force
from .measures.targets import (
    displacement,
    enclosed_volume,
    pole_height,
    pole_stretch,
    pressure,
    process_time,
    sag,
    travel,
)
from .physics.contact import Contact
from .physics.kinematics import Axisymmetric, PlaneStrain, ThreeD
from .physics.loads import CentrifugalLoad, Gravity, Load, Pressure
from .physics.models import DisplacementPenalty, Membrane, MixedPressure
from .physics.supports import Clamped, PinnedNode, PrescribedDisplacement, SimplySupported, Support, Symmetry
from .results.path import Path
from .results.show.report import report
from .runs import Process, load, solve, trace
from .scene.scene import Scene
from .solve.newton import Tolerances
from .solve.stage import Stage
from .solve.state import State
from .solve.stepping import StepControl
from .tools import Tool
from .units import Units
from .values.amplitude import amplitude
from .values.table import table
from .values.temperature import WLF, Arrhenius
from .values.zones import zones

# Each extension adds its names and takes part by the interfaces of the core; its folder may be taken out.
with _optional():
    from .extensions.contact_events import prediction as _contact_events
with _optional():
    from .extensions.heat import checks as _heat_checks
    from .extensions.heat.boundaries import (
        Absorption,
        Convection,
        FixedTemperature,
        HeatFlux,
        Radiation,
        ThermalProperties,
    )
    from .extensions.heat.contact import ConductingTool, ContactWithTool
    from .extensions.heat.cooling import Cooling
    from .extensions.heat.expansion import ThermalExpansion
    from .extensions.heat.run import heat
    from .extensions.heat.target import temperature
with _optional():
    from .extensions.kbkz import rupture as _kbkz_checks
    from .extensions.kbkz.damping import PSM, Damping, DoubleWagner, LuoTanner, SoskeyWinter, Wagner
    from .extensions.kbkz.kbkz import KBKZ
with _optional():
    from .extensions.release import springback as _springback
with _optional():
    from .extensions.fits import beyond_tests as _fits_checks
    from .extensions.fits.data import treloar1944
    from .extensions.fits.fit import fit
    from .extensions.fits.oscillation import OscillationTest
    from .extensions.fits.tested import with_tests
    from .extensions.fits.timed_test import TimedTest
with _optional():
    from .extensions.fits.fit_damping import fit_spectrum
with _optional():
    from .extensions.space import checks as _space_checks
    from .extensions.space import edge_checks as _edge_checks
    from .extensions.space import layer_checks as _layer_checks
    from .extensions.space import mould_checks as _mould_checks
    from .extensions.space import tool_checks as _tool_checks
    from .extensions.space.names import MESHES, TOOLS
    from .extensions.space.programme import wall_programme
    _add(mesh, *MESHES)
    _add(tools, *TOOLS)
    del MESHES, TOOLS
with _optional():
    from .extensions.adapt import adapted
    _add(mesh, adapted)
    del adapted
with _optional():
    from .extensions.stability import instability, top_load, with_imperfection
with _optional():
    from .extensions.remeshing import Remesh
with _optional():
    from .extensions.compare.compare import compare
    from .extensions.compare.compare_nodes import compare_nodes, write_nodes
    from .extensions.compare.measured_wall import MeasuredWall
with _optional():
    from .extensions.study import study
with _optional():
    from .extensions.design.design import Design
    from .extensions.design.parameters import spline

__version__ = "0.1.0"


for _module in (mesh, tools, _sys.modules[__name__]):
    _calls.explain(_module)
    _list_public(_module, exact, mesh, tools)
_interrupts.importing.restore()
