"""A disc under pressure with FElupe: python3 felupe_loading.py ELEMENTS LAYERS

A `Job` as in FElupe's tutorials, PyPardiso, which its documentation advises.
"""

import felupe as fem
from clock import Clock, report, sizes
from felupe_disc import disc
from loading import C10, PRESSURE, RADIUS, STEPS, THICKNESS
from pypardiso import spsolve

clock = Clock()
mesh, field, solid = disc(sizes(), RADIUS, THICKNESS, C10)
bottom = fem.RegionBiQuadraticQuadBoundary(mesh, only_surface=True, mask=mesh.points[:, 0] == 0, ensure_3d=True)
load = fem.SolidBodyPressure(fem.FieldContainer([fem.FieldAxisymmetric(bottom, dim=2)]))
bounds = {"axis": fem.Boundary(field[0], fy=0, skip=(True, False)), "rim": fem.Boundary(field[0], fy=RADIUS)}
held, free = fem.dof.partition(field, bounds)
setup = clock.lap()

iterations = []
step = fem.Step(items=[solid, load], ramp={load: fem.math.linsteps([PRESSURE / STEPS, PRESSURE], num=STEPS - 1)},
                boundaries=bounds)
job = fem.Job(steps=[step], plugins=[lambda context, state: iterations.append(context.substep.iterations)])
job.evaluate(solver=spsolve, tol=1e-8, verbose=0)
middle = ((mesh.points - [0, 0]) ** 2).sum(axis=1).argmin()
report(setup, clock.lap(), unknowns=len(free), states=len(iterations), iterations=sum(iterations),
       rise=field[0].values[middle, 0])
