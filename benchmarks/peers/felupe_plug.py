"""A plug of driven nodes with FElupe: python3 felupe_plug.py ELEMENTS LAYERS

A `Job` as in FElupe's tutorials with the fewest equal steps that converge, PyPardiso, which its documentation advises.
"""

import felupe as fem
import numpy as np
from clock import Clock, report, sizes
from felupe_disc import disc
from plug import C10, PLUG, RADIUS, THICKNESS, TRAVEL
from pypardiso import spsolve

STEPS = 4
clock = Clock()
mesh, field, solid = disc(sizes(), RADIUS, THICKNESS, C10)
plug = (mesh.points[:, 0] == 0) & (mesh.points[:, 1] <= PLUG + 1e-9)
bounds = {"axis": fem.Boundary(field[0], fy=0, skip=(True, False)), "rim": fem.Boundary(field[0], fy=RADIUS),
          "glue": fem.Boundary(field[0], mask=plug, skip=(True, False)),
          "plug": fem.Boundary(field[0], mask=plug, skip=(False, True))}
held, free = fem.dof.partition(field, bounds)
setup = clock.lap()

iterations = []
step = fem.Step(items=[solid], ramp={bounds["plug"]: fem.math.linsteps([TRAVEL / STEPS, TRAVEL], num=STEPS - 1)},
                boundaries=bounds)
job = fem.Job(steps=[step], plugins=[lambda context, state: iterations.append(context.substep.iterations)])
job.evaluate(solver=spsolve, tol=1e-8, verbose=0)
force = np.abs(solid.results.force.toarray().reshape(-1, 2)[plug, 0].sum())
report(setup, clock.lap(), unknowns=len(free), states=len(iterations), iterations=sum(iterations), force=float(force))
