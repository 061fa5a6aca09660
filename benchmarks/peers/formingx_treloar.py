"""Treloar's sheet with formingx: python3 formingx_treloar.py ELEMENTS LAYERS"""

from clock import Clock, report, sizes
from treloar import C10, HEIGHT, RADIUS, THICKNESS

import formingx as fx

clock = Clock()
sheet = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=sizes())
scene = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=C10), loads=[fx.Pressure("bottom")],
                 supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
rest = fx.trace(scene, until=fx.pressure(0.0), progress=False)
setup = clock.lap()
path = fx.trace(scene, until=fx.pole_height(HEIGHT), start=rest, progress=False)
report(setup, clock.lap(), unknowns=path.problem.n_unknowns, states=len(path) - 1, iterations=path.counts.iterations,
       limit=float(path.limit_points[0].measures["pressure"]), pressure=float(path.last.measures["pressure"]))
