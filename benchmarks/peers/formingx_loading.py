"""A disc under pressure with formingx: python3 formingx_loading.py ELEMENTS LAYERS"""

from clock import Clock, report, sizes
from loading import C10, PRESSURE, RADIUS, STEPS, THICKNESS

import formingx as fx

clock = Clock()
disc = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=sizes())
scene = fx.Scene(mesh=disc, materials=fx.NeoHookean(c10=C10), loads=[fx.Pressure("bottom")],
                 supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
fx.trace(scene, until=fx.pressure(0.0), progress=False)
setup = clock.lap()
fx.trace(scene, until=fx.pressure(0.0), progress=False)
again = clock.lap()                                          # less than the first time, and `solve` sets up once more
rise = fx.displacement(0.0, at=(0.0, 0.0), component="z")
path = fx.solve(scene, to=PRESSURE, increments=STEPS, record={"rise": rise})
report(setup, [both - once for both, once in zip(clock.lap(), again)], unknowns=path.problem.n_unknowns,
       states=len(path) - 1, iterations=path.counts.iterations, rise=float(path.last.measures["rise"]))
