"""The frictionless cup with formingx: python3 formingx_cup.py ELEMENTS LAYERS"""

from clock import Clock, report, sizes
from cup import C01, C10, DEPTH, FILLET, PRESSURE, RADIUS, THICKNESS

import formingx as fx

clock = Clock()
sheet = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=sizes())
mould = fx.tools.cup(radius=RADIUS, depth=DEPTH, mouth=THICKNESS, fillet=FILLET)
scene = fx.Scene(mesh=sheet, materials=fx.MooneyRivlin(c10=C10, c01=C01), loads=[fx.Pressure("bottom")],
                 supports=[fx.Symmetry("axis"), fx.Clamped("rim")], contacts=[fx.Contact("top", mould, "none")])
rest = fx.trace(scene, until=fx.pressure(0.0), progress=False)
setup = clock.lap()
path = fx.trace(scene, until=fx.pressure(PRESSURE), start=rest, progress=False)
spent = clock.lap()
report(setup, spent, unknowns=path.problem.n_unknowns, states=len(path) - 1, iterations=path.counts.iterations,
       thickness=float(path.profile().thickness_ratio[0]), failures=path.counts.failures)
