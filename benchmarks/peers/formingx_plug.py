"""A plug of driven nodes with formingx: python3 formingx_plug.py ELEMENTS LAYERS"""

from clock import Clock, report, sizes
from plug import C10, PLUG, RADIUS, THICKNESS, TRAVEL

import formingx as fx

clock = Clock()
sheet = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=sizes()).with_part("plug", "bottom", (0, PLUG))
scene = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=C10), supports=[
    fx.Symmetry("axis"), fx.Clamped("rim"), fx.Symmetry("plug", normal="r"), fx.PrescribedDisplacement("plug", "z")])
rest = fx.trace(scene, until=fx.travel(0.0), progress=False)
setup = clock.lap()
path = fx.trace(scene, until=fx.travel(TRAVEL), start=rest, progress=False)
spent = clock.lap()
report(setup, spent, unknowns=path.problem.n_unknowns, states=len(path) - 1, iterations=path.counts.iterations,
       force=abs(path.last.measures["support_force"]), failures=path.counts.failures)
